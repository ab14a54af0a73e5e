// Sensors that deliver by themselves, behind one small interface.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "core/result.hpp"
#include "dataset/dataset.hpp"

namespace railfix::sensor_gateway {

struct LiveConfig {
  std::string gnss;
  double gnss_latency_ms = 100;
  std::string imu;
  std::string imu_axes = "x y z";
  std::string wheel;
  double wheel_pulses_per_metre = 0;
  bool wheel_reversed = false;
  int64_t baud = 115200;
  double line_latency_ms = 5;
  double silent_s = 5;
  double reconnect_s = 1;
};

/// With its stamp in this host's time.
using Sample = std::variant<dataset::ImuRow, dataset::WheelRow, dataset::GnssRow>;

/// Messages of a line that can break them; those of others are whole.
struct Frames {
  uint64_t whole = 0;
  uint64_t broken = 0;
};

struct Delivery {
  std::vector<Sample> samples;
  Frames frames;          // since the delivery before
  std::string complaint;  // of samples that can be sent, but not be used; empty = none
};

/// Used by one thread. Errors are sentences for a technician: what, where, what to do.
class LiveSensor {
 public:
  virtual ~LiveSensor() = default;
  /// The text says what was found.
  virtual core::Result<std::string> connect() = 0;
  /// Without samples when none came in time; an error when the device is gone or cannot be used as it is.
  virtual core::Result<Delivery> next(std::chrono::milliseconds patience) = 0;
  virtual void disconnect() = 0;
  /// Makes connect() and next() return soon, now and from now on. The only one that another thread may call.
  virtual void cancel() = 0;
  /// As in the configuration.
  [[nodiscard]] virtual const std::string& source() const = 0;
  /// For messages.
  [[nodiscard]] virtual std::string name() const = 0;
  /// Behind the name: why nothing may come, and what to do.
  [[nodiscard]] virtual std::string why_silent() const = 0;
};

/// All that are named, each source once; an error where one cannot be. Connects to none.
core::Result<std::vector<std::unique_ptr<LiveSensor>>> make_live_sensors(const LiveConfig& config);

/// "gpsd://ADDRESS:PORT", or "gpsd://ADDRESS:PORT/DEVICE" for one of several receivers.
core::Result<std::unique_ptr<LiveSensor>> make_gpsd_receiver(const std::string& source, const LiveConfig& config);
/// "ubx:DEVICE": IMU and wheel, those of the two that the configuration takes from this source.
core::Result<std::unique_ptr<LiveSensor>> make_ubx_receiver(const std::string& source, const LiveConfig& config);

}  // namespace railfix::sensor_gateway
