// Pictures of a video, a network camera, a V4L2 device or a GStreamer pipeline, through GStreamer.
#pragma once

#include <chrono>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "core/result.hpp"

namespace railfix::video {

struct Frame {
  cv::Mat pixels;  // CV_8UC1, or CV_8UC3 (blue, green, red) where colours are asked for; to be read only, while `keep`
                   // is kept
  std::shared_ptr<const void> keep;
  int64_t age_ns = 0;                 // since the source has stamped it; 0 where the source has no clock
  std::optional<int64_t> at_ns = {};  // when the film or the pipeline shows it; nothing where it does not say
};

/// What is asked of a device; 0 = the most that it has, up to `most_*`.
struct DeviceOptions {
  int64_t width_px = 0;
  int64_t height_px = 0;
  double rate_hz = 0;
  int64_t most_width_px = 1920;
  int64_t most_height_px = 1200;
};

/// Grey is the luma of the video as it is coded, 0 to 255 also where it is coded as 16 to 235.
enum class Colours : uint8_t { grey, bgr };

/// When pictures come.
enum class Pace : uint8_t {
  as_asked,  // every one, when it is asked for
  real,      // at the video's rate; only the newest is kept
};

/// Used by one thread. Opening and closing may block for as long as a device likes, next() only as long as it is told.
/// Errors are sentences without their subject, as GStreamer says them.
class VideoStream {
 public:
  virtual ~VideoStream() = default;
  /// Nothing when none came in time and at the end, which ended() tells apart.
  virtual core::Result<std::optional<Frame>> next(std::chrono::milliseconds patience) = 0;
  [[nodiscard]] virtual bool ended() const = 0;
  /// Everything is connected and runs, though there may be no picture yet.
  [[nodiscard]] virtual bool playing() const = 0;
  /// What the source says of its rate, once there was a picture; 0 = nothing.
  [[nodiscard]] virtual double rate_hz() const = 0;
};

core::Result<std::unique_ptr<VideoStream>> open_file(const std::string& file, Pace pace, Colours colours);
core::Result<std::unique_ptr<VideoStream>> open_url(const std::string& url);
core::Result<std::unique_ptr<VideoStream>> open_device(const std::string& device, const DeviceOptions& options);
/// In the notation of gst-launch-1.0, with one appsink in it.
core::Result<std::unique_ptr<VideoStream>> open_pipeline(const std::string& description);

}  // namespace railfix::video
