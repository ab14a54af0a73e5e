// A live camera that is kept going, whose pictures are handed over.
#pragma once

#include <atomic>
#include <functional>
#include <memory>

#include "core/device_feed.hpp"
#include "frame_grabber/live_camera.hpp"

namespace railfix::frame_grabber {

/// Called in the feed's thread.
struct LiveEvents {
  std::function<void(const std::string& what)> connected;
  std::function<void(const std::string& why)> gone;  // also when connecting fails; each reason once
  std::function<void(RawPicture picture)> picture;   // LiveFeed::finished() when it has been dealt with
  std::function<void(uint64_t pictures)> lost;       // beside those that the next picture tells of
};

class LiveFeed {
 public:
  LiveFeed(std::unique_ptr<LiveCamera> camera, const LiveConfig& config, LiveEvents events);

  /// Whoever takes the pictures is done with one. When too many wait, the next are lost and counted. Any thread.
  void finished() { --waiting_; }

 private:
  core::DeviceFeed::Device device();
  core::Result<bool> take(std::chrono::milliseconds patience);
  [[nodiscard]] std::string why_silent() const;
  void hand_over(RawPicture picture);
  std::unique_ptr<LiveCamera> camera_;
  LiveConfig config_;
  LiveEvents events_;
  uint64_t lost_ = 0;
  std::atomic<int> waiting_ = 0;
  core::DeviceFeed feed_;  // last: its thread uses all of the above
};

}  // namespace railfix::frame_grabber
