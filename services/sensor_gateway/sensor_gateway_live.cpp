// The part of the service that deals with live sensors.
#include "core/time.hpp"
#include "sensor_gateway/sensor_gateway_service.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr std::chrono::milliseconds kSilenceCheck{500};

}  // namespace

/// A sensor may be switched on later than the train: nothing here waits for it.
void SensorGatewayService::prepare_live() {
  const auto& live = config_.live;
  if (config_.clock == "own") {
    throw core::BadInput(
        "sensor_gateway.clock is own, which is for played data; live sensors have this computer's time: leave it out");
  }
  if (live.gnss.empty()) {
    throw core::BadInput(
        "sensor_gateway.source is live, but no sensor is named; give sensor_gateway.live.gnss, or take sensor_gateway "
        "out of the train's services");
  }
  context_.at_stop([this] { feeds_.clear(); });
  context_.health().ready();
  wanted_[Sample(dataset::GnssRow()).index()].source = live.gnss;
  feed_from(core::value_or_throw(make_gpsd_receiver(live.gnss, live)), live.gnss);
  context_.every(kSilenceCheck, [this] { say_live(); });
}

void SensorGatewayService::feed_from(std::unique_ptr<LiveSensor> sensor, const std::string& source) {
  FeedEvents events;
  events.connected = [this](const std::string& what) {
    context_.post([this, what] { context_.log().info("{}", what); });
  };
  events.gone = [this, source](const std::string& why) {
    context_.post([this, source, why] {
      context_.log().warn("{}", why);
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
    wanted_[sample.index()].heard_ns = core::monotonic_ns();
    std::visit([this](const auto& row) { publish(row); }, sample);
  }
  say_live();
}

void SensorGatewayService::say_live() {
  std::string reasons;
  for (const auto& [source, why] : troubles_) reasons += (reasons.empty() ? "" : "; ") + why;
  if (!reasons.empty()) return context_.health().degraded(reasons);
  for (const auto& one : wanted_) {
    if (!one.source.empty() && one.heard_ns == 0) return;  // it has still to be heard of
  }
  context_.health().active();
}

}  // namespace railfix::sensor_gateway
