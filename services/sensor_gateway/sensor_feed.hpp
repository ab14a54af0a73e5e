// A live sensor that is kept going, whose samples are handed over.
#pragma once

#include <functional>
#include <memory>

#include "core/device_feed.hpp"
#include "sensor_gateway/live_sensor.hpp"

namespace railfix::sensor_gateway {

/// Called in the feed's thread.
struct FeedEvents {
  std::function<void(const std::string& what)> connected;  // once until it is gone
  std::function<void(const std::string& why)> gone;        // also when connecting fails; each reason once
  std::function<void(Delivery delivery)> delivered;
};

class SensorFeed {
 public:
  SensorFeed(std::unique_ptr<LiveSensor> sensor, const LiveConfig& config, FeedEvents events);

 private:
  core::DeviceFeed::Device device(const LiveConfig& config);
  core::Result<bool> take(std::chrono::milliseconds patience);
  std::unique_ptr<LiveSensor> sensor_;
  FeedEvents events_;
  bool told_connected_ = false;
  core::DeviceFeed feed_;  // last: its thread uses all of the above
};

}  // namespace railfix::sensor_gateway
