// The part of the service that deals with live sensors.
#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "core/time.hpp"
#include "sensor_gateway/sensor_gateway_service.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr std::chrono::milliseconds kSilenceCheck{500};

}  // namespace

/// A sensor may be switched on later than the train: nothing here waits for it.
void SensorGatewayService::prepare_live() {
  const auto& live = config_.live;
  wanted_ = {Wanted{live.imu}, Wanted{live.wheel}, Wanted{live.gnss}};
  for (auto& one : wanted_) one.heard_ns = core::monotonic_ns();
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
      say_live();
    });
  };
  events.delivered = [this, source](Delivery delivery) {
    context_.post([this, source, delivery = std::move(delivery)] { take(source, delivery); });
  };
  feeds_.push_back(std::make_unique<SensorFeed>(std::move(sensor), config_.live, std::move(events)));
}

void SensorGatewayService::take(const std::string& source, const Delivery& delivery) {
  const int64_t now_ns = core::monotonic_ns();
  frame_watches_[source].add(delivery.frames, now_ns);
  if (delivery.frames.broken > 0) context_.health().dropped(delivery.frames.broken);
  if (!delivery.samples.empty()) complaints_[source] = delivery.complaint;
  // Behind an outage of the whole source none of its sensors has been silent by itself.
  if (!delivery.samples.empty() && troubles_.erase(source) > 0) {
    for (auto& one : wanted_) {
      if (one.source == source) one.heard_ns = now_ns;
    }
  }
  for (const auto& sample : delivery.samples) hear(sample);
  say_live();
}

/// An IMU that sits otherwise than it is said to measures another motion than the train's.
void SensorGatewayService::hear(const Sample& sample) {
  context_.health().input();
  auto& wanted = wanted_[sample.index()];
  wanted.heard_ns = core::monotonic_ns();
  if (const auto* imu = std::get_if<dataset::ImuRow>(&sample)) {
    gravity_watch_.add(*imu);
    if (!gravity_watch_.trouble().empty()) return context_.health().dropped(1);
    if (!gravity_watch_.agrees()) return;
  }
  wanted.used = true;
  std::visit([this](const auto& row) { publish(row); }, sample);
}

/// A source that is gone says why itself; one that delivers may still lack one of its sensors.
std::string SensorGatewayService::live_troubles() {
  constexpr const char* kLacks[] = {
      "no IMU samples from {}, which sends others; switch on gyroscope and accelerometer in its UBX-ESF-MEAS",
      "no wheel pulses from {}, which sends others; check the wheel's cable, and that its receiver takes pulses", ""};
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
  for (size_t i = 0; i < wanted_.size(); ++i) {
    const auto& one = wanted_[i];
    if (one.source.empty()) continue;
    const bool silent = core::seconds(now_ns - one.heard_ns) > config_.live.silent_s;
    const bool delivers = std::any_of(wanted_.begin(), wanted_.end(), [&](const Wanted& other) {
      return other.source == one.source && other.heard_ns > one.heard_ns;
    });
    if (silent && delivers && !troubles_.contains(one.source)) add(fmt::format(fmt::runtime(kLacks[i]), one.source));
  }
  return reasons;
}

void SensorGatewayService::say_live() {
  if (const std::string reasons = live_troubles(); !reasons.empty()) return context_.health().degraded(reasons);
  const bool all_used =
      std::all_of(wanted_.begin(), wanted_.end(), [](const Wanted& one) { return one.source.empty() || one.used; });
  if (all_used) context_.health().active();
}

}  // namespace railfix::sensor_gateway
