#include "sensor_gateway/sensor_feed.hpp"

#include <spdlog/fmt/fmt.h>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr std::chrono::milliseconds kPatience{100};

}  // namespace

SensorFeed::SensorFeed(std::unique_ptr<LiveSensor> sensor, const LiveConfig& config, FeedEvents events)
    : sensor_(std::move(sensor)), config_(config), events_(std::move(events)), thread_([this] { run(); }) {}

SensorFeed::~SensorFeed() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }
  sensor_->cancel();
  thread_.join();
}

bool SensorFeed::stopped() {
  const std::lock_guard lock(mutex_);
  return stopped_;
}

bool SensorFeed::sleep_s(double seconds) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return stopped_; });
}

void SensorFeed::run() {
  do {
    const auto connected = sensor_->connect();
    if (stopped()) return;
    if (connected.ok()) {
      if (!told_connected_) events_.connected(connected.value());
      told_connected_ = true;
      deliver();
    } else {
      tell_gone(connected.error().message);
    }
    sensor_->disconnect();
  } while (sleep_s(config_.reconnect_s));
}

void SensorFeed::deliver() {
  int64_t last_ns = core::monotonic_ns();
  while (!stopped()) {
    auto next = sensor_->next(kPatience);
    if (!next.ok()) return tell_gone(next.error().message);
    if (!next.value().empty()) {
      told_.clear();
      last_ns = core::monotonic_ns();
      events_.samples(std::move(next).value());
    } else if (core::seconds(core::monotonic_ns() - last_ns) > config_.silent_s) {
      return tell_gone(fmt::format("{} {} (nothing for {:.1f} s); it is tried again", sensor_->name(),
                                   sensor_->why_silent(), config_.silent_s));
    }
  }
}

void SensorFeed::tell_gone(const std::string& why) {
  if (why == told_) return;
  told_ = why;
  told_connected_ = false;
  events_.gone(why);
}

}  // namespace railfix::sensor_gateway
