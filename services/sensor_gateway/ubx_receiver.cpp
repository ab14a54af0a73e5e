// IMU and wheel of a u-blox receiver with sensors, on a serial line.
#include <array>

#include "core/device_clock.hpp"
#include "core/time.hpp"
#include "sensor_gateway/byte_line.hpp"
#include "sensor_gateway/imu_axes.hpp"
#include "sensor_gateway/live_sensor.hpp"
#include "sensor_gateway/ubx_readings.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr std::string_view kScheme = "ubx:/";

class UbxReceiver final : public LiveSensor {
 public:
  UbxReceiver(const std::string& source, const LiveConfig& config, const ImuAxes& axes)
      : source_(source),
        device_(source.substr(kScheme.size() - 1)),
        config_(config),
        axes_(axes),
        latency_ns_(core::to_ns(config.line_latency_ms * 1e-3)),
        readings_(config.wheel == source ? config.wheel_pulses_per_metre : 0) {}

  core::Result<std::string> connect() override {
    readings_.connected();
    const auto status = line_.open_serial(device_, config_.baud);
    if (status.ok()) return name() + " is open";
    return core::Error{
        name() + " cannot be opened (" + status.error().message +
        "); see that it is plugged in (`ls -l /dev/serial/by-id`) and that no other program, as gpsd, has "
        "it; it is tried again"};
  }

  core::Result<Delivery> next(std::chrono::milliseconds patience) override {
    const auto got = line_.read(bytes_, patience);
    if (!got.ok())
      return core::Error{name() + " was unplugged (" + got.error().message + "); check the cable, it is tried again"};
    const core::HostTime arrival = core::host_time();
    std::vector<Sample> samples;
    for (const auto& sample : readings_.read(std::span(bytes_).first(got.value()), arrival.monotonic_ns)) {
      if (wanted(sample)) samples.push_back(in_train(sample, arrival));
    }
    return Delivery{std::move(samples), readings_.take_frames(), ""};
  }

  void disconnect() override { line_.close(); }
  void cancel() override { line_.cancel(); }
  [[nodiscard]] const std::string& source() const override { return source_; }
  [[nodiscard]] std::string name() const override { return "receiver " + source_; }
  [[nodiscard]] std::string why_silent() const override { return readings_.why_silent(); }

 private:
  [[nodiscard]] bool wanted(const Sample& sample) const {
    return (std::holds_alternative<dataset::ImuRow>(sample) ? config_.imu : config_.wheel) == source_;
  }
  Sample in_train(Sample sample, const core::HostTime& arrival) {
    auto& clock = clocks_[sample.index()];
    std::visit([&](auto& row) { row.stamp_ns = clock.host_ns(row.stamp_ns, arrival) - latency_ns_; }, sample);
    if (auto* imu = std::get_if<dataset::ImuRow>(&sample)) axes_.turn(*imu);
    if (auto* wheel = std::get_if<dataset::WheelRow>(&sample); wheel != nullptr && config_.wheel_reversed)
      wheel->pulses = -wheel->pulses;
    return sample;
  }

  std::string source_;
  std::string device_;
  LiveConfig config_;
  ImuAxes axes_;
  int64_t latency_ns_;
  ByteLine line_;
  UbxReadings readings_;
  std::array<core::DeviceClock, std::variant_size_v<Sample>> clocks_;  // each sensor may have its own
  std::array<uint8_t, 4096> bytes_{};
};

}  // namespace

core::Result<std::unique_ptr<LiveSensor>> make_ubx_receiver(const std::string& source, const LiveConfig& config) {
  if (!source.starts_with(kScheme))
    return core::Error{"'" + source + "' is no IMU or wheel; give ubx:DEVICE, as ubx:/dev/ttyACM0"};
  if (!is_baud(config.baud)) return core::Error{"no serial line has a baud of " + std::to_string(config.baud)};
  const auto axes = ImuAxes::parse(config.imu_axes);
  if (!axes.ok()) return axes.error();
  if (config.wheel == source && config.wheel_pulses_per_metre <= 0)
    return core::Error{"sensor_gateway.live.wheel_pulses_per_metre is not given; without it pulses are no distance"};
  return std::unique_ptr<LiveSensor>(std::make_unique<UbxReceiver>(source, config, axes.value()));
}

}  // namespace railfix::sensor_gateway
