// The sensor tables of a dataset, in step with data_clock, or live sensors -> imu_sample, wheel_sample, gnss_fix.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "sensor_gateway/frame_watch.hpp"
#include "sensor_gateway/gravity_watch.hpp"
#include "sensor_gateway/playback.hpp"
#include "sensor_gateway/sensor_feed.hpp"
#include "sensor_gateway/sensor_gateway_config.hpp"
#include "sensor_gateway/sensor_silence.hpp"
#include "service/service.hpp"

namespace railfix::sensor_gateway {

class SensorGatewayService {
 public:
  using Config = SensorGatewayConfig;
  SensorGatewayService(const Config& config, service::Context& context);

 private:
  void prepare_played();
  void prepare_live();
  void feed_from(std::unique_ptr<LiveSensor> sensor);
  void take(const std::string& source, const Delivery& delivery);
  void hear(const Sample& sample);
  void say_live();
  [[nodiscard]] std::string live_troubles();
  void follow(const msg::DataClock& clock);
  [[nodiscard]] std::string nothing_to_play() const;
  core::Result<std::string> start();
  void begin(int64_t from_ns);
  void play_on();
  void publish_clock(int64_t data_ns, bool ended);
  void end();
  void tell_unplayed();
  void watch_gravity(const dataset::ImuRow& row);
  void publish(const dataset::ImuRow& row);
  void publish(const dataset::WheelRow& row);
  void publish(const dataset::GnssRow& row);

  Config config_;
  service::Context& context_;
  int64_t born_wall_ns_;
  messaging::Writer<msg::ImuSample> imu_;  // are found while the tables are read
  messaging::Writer<msg::WheelSample> wheel_;
  messaging::Writer<msg::GnssFix> gnss_;
  Playback playback_;  // of nothing with live sensors
  Sinks sinks_;
  std::optional<messaging::Writer<msg::DataClock>> clock_;  // with clock own
  std::optional<int64_t> ahead_ns_;                         // of the monotonic clock; real pace, while it plays
  bool begun_ = false;
  uint64_t imu_seq_ = 0;
  uint64_t wheel_seq_ = 0;
  uint64_t gnss_seq_ = 0;
  uint64_t clock_seq_ = 0;
  int64_t clock_sent_ns_ = 0;      // monotonic
  SensorSilence::Sources wanted_;  // live sensors
  std::array<bool, std::variant_size_v<Sample>> used_{};
  SensorSilence silence_;
  GravityWatch gravity_watch_;
  bool gravity_told_ = false;
  std::map<std::string, std::string> troubles_;      // of each source, since its last sample
  std::map<std::string, std::string> complaints_;    // of each source, of its last samples
  std::map<std::string, FrameWatch> frame_watches_;  // of each source
  std::vector<std::unique_ptr<SensorFeed>> feeds_;   // last: their threads call the context
};

}  // namespace railfix::sensor_gateway
