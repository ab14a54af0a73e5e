#include "frame_grabber/live_camera.hpp"

namespace railfix::frame_grabber {

core::Result<std::unique_ptr<LiveCamera>> make_live_camera(const std::string& source, const LiveConfig& config) {
  constexpr std::string_view kGenicam = "genicam:";
  constexpr std::string_view kCapture = "capture:";
  if (source.starts_with(kGenicam)) {
    if (!pixel_format(config.pixel_format)) {
      return core::Error{"pixel_format '" + config.pixel_format + "' is not read; give one of " + pixel_format_names()};
    }
    const std::string id = source.substr(kGenicam.size());
    return make_genicam_camera(id == "any" ? "" : id, config);
  }
  if (source.starts_with(kCapture)) return make_capture_camera(source.substr(kCapture.size()), config);
  return std::unique_ptr<LiveCamera>();
}

}  // namespace railfix::frame_grabber
