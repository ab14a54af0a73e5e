// Cameras that deliver by themselves, behind one small interface.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "core/result.hpp"
#include "frame_grabber/raw_picture.hpp"

namespace railfix::frame_grabber {

struct LiveConfig {
  double rate_hz = 0;  // 0 = as the camera is set
  double exposure_us = 0;
  double gain_db = -1;
  std::string pixel_format = "Mono8";
  std::string trigger;
  int64_t packet_size = 0;
  int64_t width_px = 0;
  int64_t height_px = 0;
  bool ptp = false;
  double latency_ms = 0;
  double silent_s = 2;
  double reconnect_s = 1;
};

/// Used by one thread. Errors are sentences for a technician: what, where, what to do.
class LiveCamera {
 public:
  virtual ~LiveCamera() = default;
  /// Finds, sets and starts the camera; may take some seconds. The text says what was found.
  virtual core::Result<std::string> connect() = 0;
  /// Nothing when no picture came in time; an error when the camera is gone.
  virtual core::Result<std::optional<RawPicture>> next(std::chrono::milliseconds patience) = 0;
  virtual void disconnect() = 0;
  /// Makes connect() and next() return soon, now and from now on. The only one that another thread may call.
  virtual void cancel() {}
  /// Pictures that did not come, or not whole, and that no picture has told of (RawPicture::lost).
  virtual uint64_t take_lost() { return 0; }
  /// "camera genicam:GV01", for messages.
  [[nodiscard]] virtual std::string name() const = 0;
  /// Behind the name: why nothing may come, and what to do; empty = not known.
  [[nodiscard]] virtual std::string why_silent() const { return ""; }
};

/// "genicam:ID or address" (any = the first that is found), "capture:DEVICE, PIPELINE, URL or FILE"; nullptr for a
/// source that is recorded.
core::Result<std::unique_ptr<LiveCamera>> make_live_camera(const std::string& source, const LiveConfig& config);

std::unique_ptr<LiveCamera> make_genicam_camera(const std::string& id, const LiveConfig& config);
std::unique_ptr<LiveCamera> make_capture_camera(const std::string& what, const LiveConfig& config);

}  // namespace railfix::frame_grabber
