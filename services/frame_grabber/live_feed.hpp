// Keeps a live camera going in a thread of its own: connects, hands its pictures over, and connects again when it is
// gone or silent.
#pragma once

#include <atomic>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "frame_grabber/live_camera.hpp"

namespace railfix::frame_grabber {

/// Called in the feed's thread.
struct LiveEvents {
  std::function<void(const std::string& what)> connected;
  std::function<void(const std::string& why)> gone;  // also when connecting fails; each reason once
  std::function<void(RawPicture picture)> picture;   // LiveFeed::finished() when it has been dealt with
};

class LiveFeed {
 public:
  LiveFeed(std::unique_ptr<LiveCamera> camera, const LiveConfig& config, LiveEvents events);
  ~LiveFeed();
  LiveFeed(const LiveFeed&) = delete;
  LiveFeed& operator=(const LiveFeed&) = delete;

  /// Whoever takes the pictures is done with one. When too many wait, the next are lost and counted. Any thread.
  void finished() { --waiting_; }

 private:
  void run();
  bool connect();
  void deliver();
  void hand_over(RawPicture picture);
  void tell_gone(const std::string& why);
  bool sleep_s(double seconds);  // false: stopped
  std::unique_ptr<LiveCamera> camera_;
  LiveConfig config_;
  LiveEvents events_;
  std::string told_;
  uint64_t lost_ = 0;
  std::atomic<int> waiting_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::atomic<bool> stopped_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace railfix::frame_grabber
