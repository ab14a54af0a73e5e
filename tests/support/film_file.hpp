// Films whose pictures come at any times.
#pragma once

#include <gst/app/gstappsrc.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "video/gstreamer.hpp"

namespace railfix::testing {

inline constexpr int kFilmWidthPx = 320;
inline constexpr int kFilmHeightPx = 240;

/// Runs a pipeline to its end.
inline void run_to_end(GstElement* pipeline) {
  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  const video::Bus bus(gst_element_get_bus(pipeline));
  const video::Message end(gst_bus_timed_pop_filtered(
      bus.get(), 60 * GST_SECOND, static_cast<GstMessageType>(GST_MESSAGE_EOS | GST_MESSAGE_ERROR)));
  ASSERT_TRUE(end);
  EXPECT_EQ(GST_MESSAGE_TYPE(end.get()), GST_MESSAGE_EOS) << video::error_text(end.get());
  gst_element_set_state(pipeline, GST_STATE_NULL);
}

/// The grey of a picture is its number times 10. `encoder`: "jpegenc ! avimux", say; `rate`: "25/1", "0/1" = it varies.
inline void write_film(const std::string& file, const std::string& encoder, const std::string& rate,
                       const std::vector<int64_t>& times_ns) {
  ASSERT_TRUE(video::start_gstreamer().ok());
  auto pipeline = video::parse_pipeline(
      "appsrc name=pictures format=time caps=video/x-raw,format=GRAY8,width=320,height=240,framerate=" + rate +
      " ! videoconvert ! " + encoder + " ! filesink location=" + file);
  ASSERT_TRUE(pipeline.ok()) << pipeline.error().message;
  const video::Element source(gst_bin_get_by_name(GST_BIN(pipeline.value().get()), "pictures"));
  for (size_t number = 0; number < times_ns.size(); ++number) {
    constexpr gsize kBytes = kFilmWidthPx * kFilmHeightPx;
    GstBuffer* const picture = gst_buffer_new_allocate(nullptr, kBytes, nullptr);
    gst_buffer_memset(picture, 0, static_cast<guint8>(10 * number), kBytes);
    GST_BUFFER_PTS(picture) = static_cast<GstClockTime>(times_ns[number]);
    ASSERT_EQ(gst_app_src_push_buffer(GST_APP_SRC(source.get()), picture), GST_FLOW_OK);
  }
  gst_app_src_end_of_stream(GST_APP_SRC(source.get()));
  run_to_end(pipeline.value().get());
}

}  // namespace railfix::testing
