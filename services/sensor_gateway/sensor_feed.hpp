// Keeps a live sensor going in a thread of its own: connects, hands its samples over, and connects again when it is
// gone or silent.
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>

#include "sensor_gateway/live_sensor.hpp"

namespace railfix::sensor_gateway {

/// Called in the feed's thread.
struct FeedEvents {
  std::function<void(const std::string& what)> connected;
  std::function<void(const std::string& why)> gone;  // also when connecting fails; each reason once
  std::function<void(std::vector<Sample> samples)> samples;
};

class SensorFeed {
 public:
  SensorFeed(std::unique_ptr<LiveSensor> sensor, const LiveConfig& config, FeedEvents events);
  ~SensorFeed();
  SensorFeed(const SensorFeed&) = delete;
  SensorFeed& operator=(const SensorFeed&) = delete;

 private:
  void run();
  void deliver();
  void tell_gone(const std::string& why);
  bool sleep_s(double seconds);  // false: stopped
  [[nodiscard]] bool stopped();
  std::unique_ptr<LiveSensor> sensor_;
  LiveConfig config_;
  FeedEvents events_;
  std::string told_;  // since the last sample
  bool told_connected_ = false;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopped_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace railfix::sensor_gateway
