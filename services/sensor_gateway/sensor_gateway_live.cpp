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
  events.samples = [this, source](std::vector<Sample> samples) {
    context_.post([this, source, samples = std::move(samples)] { take(source, samples); });
  };
  feeds_.push_back(std::make_unique<SensorFeed>(std::move(sensor), config_.live, std::move(events)));
}

void SensorGatewayService::take(const std::string& source, const std::vector<Sample>& samples) {
  troubles_.erase(source);
  for (const auto& sample : samples) {
    context_.health().input();
    auto& wanted = wanted_[sample.index()];
    wanted.heard = true;
    wanted.heard_ns = core::monotonic_ns();
    if (usable(sample)) {
      std::visit([this](const auto& row) { publish(row); }, sample);
    } else {
      context_.health().dropped(1);
    }
  }
  say_live();
}

/// An IMU that sits otherwise than it is said to measures another motion than the train's.
bool SensorGatewayService::usable(const Sample& sample) {
  const auto* imu = std::get_if<dataset::ImuRow>(&sample);
  if (imu == nullptr) return true;
  gravity_watch_.add(*imu);
  return gravity_watch_.trouble().empty();
}

/// A source that is gone says why itself; one that delivers may still lack one of its sensors.
void SensorGatewayService::say_live() {
  constexpr const char* kLacks[] = {
      "no IMU samples from {}, which sends others; switch on gyroscope and accelerometer in its UBX-ESF-MEAS",
      "no wheel pulses from {}, which sends others; check the wheel's cable, and that its receiver takes pulses", ""};
  std::string reasons;
  const auto add = [&reasons](const std::string& why) { reasons += (reasons.empty() ? "" : "; ") + why; };
  for (const auto& [source, why] : troubles_) add(why);
  if (const auto why = gravity_watch_.trouble(); !why.empty()) add(why);
  bool all_heard = true;
  for (size_t i = 0; i < wanted_.size(); ++i) {
    const auto& one = wanted_[i];
    if (one.source.empty()) continue;
    all_heard = all_heard && one.heard;
    const bool silent = core::seconds(core::monotonic_ns() - one.heard_ns) > config_.live.silent_s;
    const bool delivers = std::any_of(wanted_.begin(), wanted_.end(), [&](const Wanted& other) {
      return other.source == one.source && other.heard_ns > one.heard_ns;
    });
    if (silent && delivers && !troubles_.contains(one.source)) add(fmt::format(fmt::runtime(kLacks[i]), one.source));
  }
  if (!reasons.empty()) return context_.health().degraded(reasons);
  if (all_heard) context_.health().active();
}

}  // namespace railfix::sensor_gateway
