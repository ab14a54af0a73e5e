#include "video/gstreamer.hpp"

#include <gst/pbutils/pbutils.h>

#include <string_view>

namespace railfix::video {
namespace {

using Problem = std::unique_ptr<GError, Release<g_error_free>>;

core::Status started() {
  GError* error = nullptr;
  if (gst_init_check(nullptr, nullptr, &error) != FALSE) {
    gst_pb_utils_init();
    return {};
  }
  const Problem problem(error);
  return core::Error{std::string("GStreamer cannot be used: ") + (problem ? problem->message : "it does not say why")};
}

}  // namespace

core::Status start_gstreamer() {
  static const core::Status status = started();
  return status;
}

core::Result<Element> parse_pipeline(const std::string& description) {
  if (auto status = start_gstreamer(); !status.ok()) return status.error();
  GError* error = nullptr;
  GstElement* const made = gst_parse_launch_full(description.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  const Problem problem(error);
  if (made == nullptr) return core::Error{problem ? problem->message : "it is empty"};
  return Element(GST_ELEMENT(gst_object_ref_sink(made)));
}

std::string error_text(GstMessage* error) {
  GError* raw = nullptr;
  gchar* raw_detail = nullptr;
  gst_message_parse_error(error, &raw, &raw_detail);
  const Problem problem(raw);
  const Text detail(raw_detail);
  std::string text = problem->message;
  // "file.c(123): function (): /GstPipeline:pipeline0/...:\nwhat it is about"
  const std::string_view all = detail ? detail.get() : "";
  const size_t line = all.find('\n');
  if (line != std::string_view::npos)
    text += " " + std::string(all.substr(line + 1, all.find('\n', line + 1) - line - 1));
  return text;
}

}  // namespace railfix::video
