#include "sensor_gateway/sensor_feed.hpp"

#include <spdlog/fmt/fmt.h>

namespace railfix::sensor_gateway {

SensorFeed::SensorFeed(std::unique_ptr<LiveSensor> sensor, const LiveConfig& config, FeedEvents events)
    : sensor_(std::move(sensor)),
      events_(std::move(events)),
      feed_(device(config), config.silent_s, config.reconnect_s) {}

core::DeviceFeed::Device SensorFeed::device(const LiveConfig& config) {
  return {
      .connect = [this] { return sensor_->connect(); },
      .take = [this](std::chrono::milliseconds patience) { return take(patience); },
      .disconnect = [this] { sensor_->disconnect(); },
      .cancel = [this] { sensor_->cancel(); },
      .why_silent =
          [this, silent_s = config.silent_s] {
            return fmt::format("{} {} (nothing for {:.1f} s); it is tried again", sensor_->name(),
                               sensor_->why_silent(), silent_s);
          },
      .connected =
          [this](const std::string& what) {
            if (!std::exchange(told_connected_, true)) events_.connected(what);
          },
      .gone =
          [this](const std::string& why) {
            told_connected_ = false;
            events_.gone(why);
          },
  };
}

core::Result<bool> SensorFeed::take(std::chrono::milliseconds patience) {
  auto next = sensor_->next(patience);
  if (!next.ok()) return next.error();
  Delivery& delivery = next.value();
  const bool has_samples = !delivery.samples.empty();
  if (has_samples || delivery.frames.whole + delivery.frames.broken > 0) events_.delivered(std::move(delivery));
  return has_samples;
}

}  // namespace railfix::sensor_gateway
