// GStreamer's objects with owners.
#pragma once

#include <gst/gst.h>

#include <memory>
#include <string>

#include "core/result.hpp"

namespace railfix::video {

template <auto release>
struct Release {
  template <class T>
  void operator()(T* object) const {
    release(object);
  }
};
using Element = std::unique_ptr<GstElement, Release<gst_object_unref>>;
using Bus = std::unique_ptr<GstBus, Release<gst_object_unref>>;
using Caps = std::unique_ptr<GstCaps, Release<gst_caps_unref>>;
using Clock = std::unique_ptr<GstClock, Release<gst_object_unref>>;
using Message = std::unique_ptr<GstMessage, Release<gst_message_unref>>;
using Sample = std::shared_ptr<GstSample>;
using Text = std::unique_ptr<gchar, Release<g_free>>;

/// Makes GStreamer ready, once in a process.
core::Status start_gstreamer();
/// Nothing (nullptr) when there is none.
core::Result<Element> parse_pipeline(const std::string& description);
/// The message's text, and where GStreamer says more than a common place, that too.
std::string error_text(GstMessage* error);

}  // namespace railfix::video
