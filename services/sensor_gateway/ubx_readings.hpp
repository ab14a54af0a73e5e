// What a u-blox receiver with sensors says in UBX-ESF-MEAS -> IMU and wheel. Bytes in, samples out; knows no line and
// no clock. (ZED-F9R interface description, UBX-20039643: 3.2 frame structure, 3.11.3 UBX-ESF-MEAS.)
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "sensor_gateway/live_sensor.hpp"

namespace railfix::sensor_gateway {

class UbxReadings {
 public:
  /// A count of pulses that was lost shows as a leap of so many, which no train can make however long it was away.
  static constexpr int64_t kLeap = int64_t{1} << 40;

  /// Of the wheel; 0 where it is not used.
  explicit UbxReadings(double pulses_per_metre) : pulses_per_metre_(pulses_per_metre) { connected(); }
  /// What came before does not continue on this connection; the count of pulses does.
  void connected();
  /// With stamps in the receiver's time, IMU in its own axes. A wheel's pulses are counted over all connections.
  /// Arrival on the host's monotonic clock.
  [[nodiscard]] std::vector<Sample> read(std::span<const uint8_t> bytes, int64_t arrival_ns);
  /// Since it was asked last. A frame whose beginning is broken, too, is not seen.
  [[nodiscard]] Frames take_frames();
  /// Why there may be no samples, for a technician.
  [[nodiscard]] std::string why_silent() const;

 private:
  /// The receiver's 32-bit milliseconds, which begin anew every 50 days.
  class Tag {
   public:
    int64_t ns(uint32_t tag_ms);

   private:
    std::optional<uint32_t> last_ms_;
    int64_t ns_ = 0;
  };
  /// Value of an axis and when it was measured.
  struct Axis {
    double value = 0;
    int64_t tag_ns = 0;
    bool fresh = false;
  };
  struct Count {
    uint32_t ticks;
    uint32_t tag_ms;  // as it stands in the message: since the receiver began
    int64_t tag_ns;
    int64_t arrival_ns;
  };
  size_t read_frame(std::span<const uint8_t> bytes, int64_t arrival_ns, std::vector<Sample>& samples);
  void read_measurements(std::span<const uint8_t> payload, int64_t arrival_ns, std::vector<Sample>& samples);
  size_t broken(size_t bytes);
  void set_axis(Axis& axis, const Axis& now);
  [[nodiscard]] int64_t together_ns() const;
  void add_imu(int64_t tag_ns, std::vector<Sample>& samples);
  [[nodiscard]] bool counted_on(const Count& count, uint32_t ticks) const;
  void add_wheel(uint32_t data, const Count& count, std::vector<Sample>& samples);

  double pulses_per_metre_;
  std::vector<uint8_t> pending_;
  Tag imu_tag_;
  Tag wheel_tag_;
  std::array<Axis, 6> axes_;              // rates x, y, z in rad/s; accelerations x, y, z in m/s^2
  std::array<int64_t, 24> periods_ns_{};  // of the axes, the last four of each: a ring
  size_t next_period_ = 0;
  std::optional<int64_t> last_imu_ns_;
  std::optional<Count> last_count_;
  int64_t pulses_ = 0;
  Frames frames_;
  uint64_t broken_in_a_row_ = 0;
  bool has_bytes_ = false;
  bool has_frames_ = false;
  bool has_measurements_ = false;
};

}  // namespace railfix::sensor_gateway
