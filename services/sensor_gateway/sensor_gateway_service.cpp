#include "sensor_gateway/sensor_gateway_service.hpp"

#include <algorithm>
#include <filesystem>

#include "core/time.hpp"
#include "service/data_time.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr std::chrono::milliseconds kTick{5};  // one IMU sample at 200 Hz

dataset::Sensors read(const SensorGatewayConfig& config) {
  if (config.is_live()) return {};
  if (config.source.empty()) throw core::BadInput("sensor_gateway.source is empty; give a dataset folder, or live");
  if (!std::filesystem::exists(config.source)) {
    throw core::BadInput("sensor_gateway.source: " + config.source + " does not exist; give a dataset folder, or live");
  }
  auto sensors = core::value_or_throw(dataset::read_sensors(config.source));
  if (!config.imu) sensors.imu.clear();
  if (!config.wheel) sensors.wheel.clear();
  if (!config.gnss) sensors.gnss.clear();
  return sensors;
}

}  // namespace

SensorGatewayService::SensorGatewayService(const Config& config, service::Context& context)
    : config_(config),
      context_(context),
      born_wall_ns_(core::wall_ns()),
      imu_(context.writer(messaging::topics::imu_sample)),
      wheel_(context.writer(messaging::topics::wheel_sample)),
      gnss_(context.writer(messaging::topics::gnss_fix)),
      playback_(read(config)),
      sinks_{[this](const dataset::ImuRow& row) {
               publish(row);
               if (!config_.is_live()) watch_gravity(row);
             },
             [this](const dataset::WheelRow& row) { publish(row); },
             [this](const dataset::GnssRow& row) { publish(row); }} {
  context_.health().flows(service::Flow::steady);
  if (config_.is_live()) {
    prepare_live();
  } else {
    prepare_played();
  }
}

void SensorGatewayService::prepare_played() {
  const auto& sensors = playback_.sensors();
  context_.log().info("has {} IMU, {} wheel and {} GNSS samples", sensors.imu.size(), sensors.wheel.size(),
                      sensors.gnss.size());
  context_.every(kTick, [this] { play_on(); });
  if (config_.clock == "follow") {
    context_.on<msg::DataClock>(messaging::topics::data_clock, [this](const msg::DataClock& clock) { follow(clock); });
    // A frame_grabber that is started anew plays from the front: sensors of another time would belong to no picture.
    context_.at_restart([this](int64_t) { begun_ = false; });
    return;
  }
  clock_.emplace(context_.writer(messaging::topics::data_clock));
  context_.on_command("start", [this](const std::string&) { return start(); });
  if (config_.start == "immediately") {
    if (!playback_.next_ns()) throw core::BadInput(nothing_to_play());
    context_.post([this] { (void)start(); });
  }
}

void SensorGatewayService::begin(int64_t from_ns) {
  if (begun_) return;
  begun_ = true;
  playback_.go_to(from_ns);
  context_.health().active();
}

// A device delivers nothing from before it is asked: started anew in the middle of a ride, this one neither.
void SensorGatewayService::follow(const msg::DataClock& clock) {
  const int64_t lead_from_ns = clock.data_ns() - core::to_ns(config_.lead_s);
  const int64_t born_ns = clock.data_ns() - (clock.wall_ns() - born_wall_ns_);
  begin(clock.lock_step() != 0 ? lead_from_ns : std::max(lead_from_ns, born_ns));
  if (clock.lock_step() != 0 || clock.ended() != 0) {
    ahead_ns_.reset();
    playback_.play_until(clock.data_ns(), sinks_);
  } else {
    ahead_ns_ = service::DataTime(clock, core::wall_ns(), core::monotonic_ns()).at(0);
  }
  if (clock.ended() != 0) end();
}

std::string SensorGatewayService::nothing_to_play() const {
  return config_.source +
         " has no IMU, wheel or GNSS samples to play; give a dataset folder with mav0/imu0, wheel0 or "
         "gnss0 whose tables have rows, and see that none is switched off";
}

core::Result<std::string> SensorGatewayService::start() {
  const auto first = playback_.next_ns();
  if (!first) return core::Error{nothing_to_play()};
  if (ahead_ns_) return std::string("plays already");
  begin(*first);
  ahead_ns_ = *first - core::monotonic_ns();
  return std::string("plays ") + config_.source;
}

void SensorGatewayService::play_on() {
  if (!ahead_ns_) return;
  const int64_t now_ns = core::monotonic_ns();
  const int64_t data_ns = now_ns + *ahead_ns_;
  playback_.play_until(data_ns, sinks_);
  if (!clock_) return;
  if (!playback_.next_ns()) {
    publish_clock(data_ns, true);
    ahead_ns_.reset();
    return end();
  }
  if (now_ns - clock_sent_ns_ >= service::DataTime::kPeriodNs) publish_clock(data_ns, false);
}

void SensorGatewayService::publish_clock(int64_t data_ns, bool ended) {
  clock_sent_ns_ = core::monotonic_ns();
  msg::DataClock clock;
  clock.data_ns(data_ns);
  clock.wall_ns(core::wall_ns());
  clock.seq(++clock_seq_);
  clock.ended(ended ? 1 : 0);
  clock_->write(clock);
}

void SensorGatewayService::end() {
  context_.log().info("played {} IMU, {} wheel and {} GNSS samples", imu_seq_, wheel_seq_, gnss_seq_);
  tell_unplayed();
  if (config_.at_end != "finish") return;
  const int64_t ended_ns = core::monotonic_ns();
  context_.every(kTick, [this, ended_ns] {
    if (core::monotonic_ns() - ended_ns > service::kLastWordsNs) context_.finish("all samples played");
  });
}

void SensorGatewayService::watch_gravity(const dataset::ImuRow& row) {
  if (gravity_told_) return;
  gravity_watch_.add(row);
  const std::string trouble = gravity_watch_.trouble_of_recording();
  gravity_told_ = !trouble.empty();
  if (gravity_told_) context_.log().warn(trouble);
}

void SensorGatewayService::tell_unplayed() {
  const auto& sensors = playback_.sensors();
  const auto tell = [this](const char* sensor, size_t samples, uint64_t played) {
    if (samples == 0 || played != 0) return;
    context_.log().warn(
        "{}: none of the {} samples lies in the time of the pictures; stamps are Unix nanoseconds, in one "
        "clock for all",
        sensor, samples);
  };
  tell("IMU", sensors.imu.size(), imu_seq_);
  tell("wheel", sensors.wheel.size(), wheel_seq_);
  tell("GNSS", sensors.gnss.size(), gnss_seq_);
}

void SensorGatewayService::publish(const dataset::ImuRow& row) {
  msg::ImuSample sample;
  sample.stamp_ns(row.stamp_ns);
  sample.grabbed_ns(core::wall_ns());
  sample.seq(++imu_seq_);
  sample.rate_x_rps(row.rate_rps[0]);
  sample.rate_y_rps(row.rate_rps[1]);
  sample.rate_z_rps(row.rate_rps[2]);
  sample.accel_x_mps2(row.accel_mps2[0]);
  sample.accel_y_mps2(row.accel_mps2[1]);
  sample.accel_z_mps2(row.accel_mps2[2]);
  imu_.write(sample);
  context_.health().output(sample.grabbed_ns());
}

void SensorGatewayService::publish(const dataset::WheelRow& row) {
  msg::WheelSample sample;
  sample.stamp_ns(row.stamp_ns);
  sample.grabbed_ns(core::wall_ns());
  sample.seq(++wheel_seq_);
  sample.pulses(row.pulses);
  sample.pulses_per_metre(config_.is_live() ? config_.live.wheel_pulses_per_metre
                                            : playback_.sensors().pulses_per_metre);
  wheel_.write(sample);
  context_.health().output(sample.grabbed_ns());
}

void SensorGatewayService::publish(const dataset::GnssRow& row) {
  msg::GnssFix fix;
  fix.stamp_ns(row.stamp_ns);
  fix.grabbed_ns(core::wall_ns());
  fix.seq(++gnss_seq_);
  fix.lat_deg(row.lat_deg);
  fix.lon_deg(row.lon_deg);
  fix.alt_m(row.alt_m);
  fix.hdop(row.hdop);
  fix.fix(static_cast<uint8_t>(row.fix));
  gnss_.write(fix);
  context_.health().output(fix.grabbed_ns());
}

}  // namespace railfix::sensor_gateway
