// Is the gyro to be believed? One that is stuck, that scatters, or that turns otherwise than the camera and no nearer
// to the track has failed: what it says speaks for no track and against none.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "core/repeated.hpp"
#include "fusion/fusion_parameters.hpp"
#include "fusion/fusion_types.hpp"

namespace railfix::fusion {

/// A plain value.
class GyroWatch {
 public:
  enum class Fault : uint8_t { none, stuck, scatters, contradicted, absent };

  void add(int64_t stamp_ns, double rate_rps);
  /// How the camera turned.
  void add(const OdometryInput& step);
  /// What has turned since the last judgement, over some time and way.
  struct Turned {
    double time_s = 0;
    double way_m = 0;
    double gyro_rad = 0;
    double sigma_rad = 0;               // as promised
    std::optional<double> track_rad{};  // where the place is known
  };
  void judge(const Turned& turned, int64_t stamp_ns);
  /// The train stood: what has turned is the bias.
  void rest(const Turned& turned);
  /// What came so far belongs to no period: samples were missing.
  void begin_period();
  void set_clock(int64_t stamp_ns);
  [[nodiscard]] Fault fault() const { return fault_; }
  [[nodiscard]] int64_t since_ns() const { return since_ns_; }

 private:
  /// Differences of turns over a piece of the way.
  struct Piece {
    double gyro_from_camera_rad = 0;
    std::optional<double> gyro_from_track_rad;
    double variance = 0;
    double way_m = 0;
    double time_s = 0;
  };
  [[nodiscard]] std::optional<Fault> fault_now(const Turned& turned);
  [[nodiscard]] bool contradicted() const;
  void learn_bias(double turned_rad, double variance, double time_s);

  static constexpr size_t kMost = 12;
  std::array<Piece, kMost> pieces_;
  size_t count_ = 0;  // of pieces, the newest first
  // Of the period that is not judged yet.
  double squares_ = 0;  // of differences between successive samples
  int samples_ = 0;
  double camera_rad_ = 0;
  double camera_variance_ = 0;
  double camera_s_ = 0;

  // Against the camera and at rest: that of the filter follows a place that may be wrong.
  double bias_rps_ = 0;
  double bias_variance_ = kGyroBiasSigmaRps * kGyroBiasSigmaRps;

  core::Repeated rate_;
  bool has_turned_ = false;            // an IMU without a gyro says 0 all the time
  std::optional<OdometryInput> step_;  // the last one that was measured
  Fault fault_ = Fault::none;
  int64_t since_ns_ = 0;
  int well_ = 0;  // judgements without a fault, in a row
};

}  // namespace railfix::fusion
