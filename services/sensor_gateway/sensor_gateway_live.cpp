// The part of the service that deals with live sensors.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>

#include "core/time.hpp"
#include "sensor_gateway/sensor_gateway_service.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr std::chrono::milliseconds kSilenceCheck{500};

}  // namespace

/// A sensor may be switched on later than the train: nothing here waits for it.
void SensorGatewayService::prepare_live() {
  const auto& live = config_.live;
  wanted_ = {live.imu, live.wheel, live.gnss};
  silence_ = SensorSilence(wanted_, live.silent_s, core::monotonic_ns());
  context_.at_stop([this] { feeds_.clear(); });
  context_.health().ready();
  for (auto& sensor : core::value_or_throw(make_live_sensors(live))) feed_from(std::move(sensor));
  context_.every(kSilenceCheck, [this] { say_live(); });
}

void SensorGatewayService::feed_from(std::unique_ptr<LiveSensor> sensor) {
  const std::string source = sensor->source();
  FeedEvents events;
  events.connected = [this](const std::string& what) {
    context_.post([this, what] { context_.log().info("{}", what); });
  };
  events.gone = [this, source](const std::string& why) {
    context_.post([this, source, why] {
      troubles_[source] = why;
      silence_.gone(source);
      say_live();
    });
  };
  events.delivered = [this, source](Delivery delivery) {
    context_.post([this, source, delivery = std::move(delivery)] { take(source, delivery); });
  };
  feeds_.push_back(std::make_unique<SensorFeed>(std::move(sensor), config_.live, std::move(events)));
}

void SensorGatewayService::take(const std::string& source, const Delivery& delivery) {
  frame_watches_[source].add(delivery.frames, core::monotonic_ns());
  if (delivery.frames.broken > 0) context_.health().dropped(delivery.frames.broken);
  if (!delivery.samples.empty()) {
    complaints_[source] = delivery.complaint;
    troubles_.erase(source);
  }
  for (const auto& sample : delivery.samples) hear(sample);
  say_live();
}

/// An IMU that sits otherwise than it is said to measures another motion than the train's.
void SensorGatewayService::hear(const Sample& sample) {
  context_.health().input();
  silence_.heard(sample.index(), core::monotonic_ns());
  if (const auto* imu = std::get_if<dataset::ImuRow>(&sample)) {
    gravity_watch_.add(*imu);
    if (!gravity_watch_.trouble().empty()) return context_.health().dropped(1);
    if (!gravity_watch_.agrees()) return;
  }
  used_[sample.index()] = true;
  std::visit([this](const auto& row) { publish(row); }, sample);
}

/// A source that is gone says why itself; one that delivers may still lack one of its sensors.
std::string SensorGatewayService::live_troubles() {
  // In the order of Sample; GNSS has its source to itself.
  static constexpr std::array kLacks{
      "no IMU samples from {}, which sends others; switch on gyroscope and accelerometer in its UBX-ESF-MEAS",
      "no wheel pulses from {}, which sends others; check the wheel's cable, and that its receiver takes pulses"};
  std::string reasons;
  const auto add = [&reasons](const std::string& why) { reasons += (reasons.empty() ? "" : "; ") + why; };
  const int64_t now_ns = core::monotonic_ns();
  for (const auto& [source, why] : troubles_) add(why);
  for (auto& [source, watch] : frame_watches_) {
    if (troubles_.contains(source)) continue;
    if (const auto why = watch.trouble(now_ns); !why.empty()) add("receiver " + source + " " + why);
  }
  for (const auto& [source, why] : complaints_) {
    if (!why.empty() && !troubles_.contains(source)) add(why);
  }
  if (const auto why = gravity_watch_.trouble(); !why.empty()) add(why);
  for (size_t i = 0; i < kLacks.size(); ++i) {
    if (silence_.lacks(i, now_ns)) add(fmt::format(fmt::runtime(kLacks[i]), wanted_[i]));
  }
  return reasons;
}

void SensorGatewayService::say_live() {
  if (const std::string reasons = live_troubles(); !reasons.empty()) return context_.health().degraded(reasons);
  for (size_t i = 0; i < wanted_.size(); ++i) {
    if (!wanted_[i].empty() && !used_[i]) return;
  }
  context_.health().active();
}

}  // namespace railfix::sensor_gateway
