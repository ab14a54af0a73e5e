// How late the camera's stamps are against the wheel's: where the speed changes, the way between two pictures is that
// of a little earlier. Landmarks put the train where it was then, and at constant speed nothing else shows it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>

#include "fusion/fusion_types.hpp"
#include "fusion/seen_way.hpp"

namespace railfix::fusion {

/// Fitted to the way of both over windows of a second, beside their ratio and the wheel's creep, which grows with
/// acceleration and speed. Where both say another change of speed, as in a slip, and where samples come late, nothing
/// is measured. Two clocks that nobody keeps together run apart, which at constant speed looks like a ratio: the lag is
/// less and less known until the speed changes. Stamps that jump on the way, as those of a camera that is started anew,
/// show against the way itself. Where no lag of half a second fits one of up to two is looked for, and then again one
/// of half a second: the wheel may have slipped for long.
class CameraLag {
 public:
  struct Lag {
    double late_s = 0;  // the camera's stamps, or the wheel's early; below 0: the other way round
    double sigma_s = 0;
  };
  /// Before anything has shown it.
  static Lag unknown();
  CameraLag() : CameraLag(kUsualS) {}
  void add(const WheelInput& sample);
  void add(const OdometryInput& step);
  /// By all that was measured so far; vague until the speed has changed. Nothing until both have measured.
  [[nodiscard]] std::optional<Lag> lag() const;
  [[nodiscard]] bool has_wheel_only() const { return !compared_ && !wheel_.empty(); }
  /// The stamps have, or may have: what an earlier trip knew is void.
  [[nodiscard]] bool has_jumped() const { return has_jumped_; }

 private:
  static constexpr double kUsualS = 0.5;  // the farthest that is looked for at first
  explicit CameraLag(double farthest_s);
  [[nodiscard]] double lag_sigma_s() const;
  void look_elsewhere();
  using Reading = SeenWay::Picture;
  using Readings = std::deque<Reading>;
  struct Moving {
    Reading at;
    double speed_mps = 0;
  };
  struct Mark {
    Moving camera;
    Moving wheel;
  };
  [[nodiscard]] std::optional<Lag> jump(int64_t stamp_ns, const std::optional<Reading>& picture) const;
  [[nodiscard]] std::optional<double> seen_speed_mps() const;
  /// The lag is known better than at first: less than that is never known.
  [[nodiscard]] bool is_narrowed() const;
  void doubt(double sigma_s);
  void begin_again(const OdometryInput& step);
  static std::optional<Reading> reading_at(const Readings& readings, int64_t stamp_ns);
  static std::optional<Moving> moving_at(const Readings& readings, int64_t stamp_ns);
  void compare();
  void fit(const Mark& from, const Mark& to);
  void pass(double seconds);

  Readings wheel_;
  Readings seen_;  // variances since the first picture
  SeenWay way_;
  std::optional<Mark> mark_;
  std::optional<int64_t> last_step_ns_;
  double interval_s_ = 0;  // between the last two steps
  bool compared_ = false;
  bool stood_ = false;
  bool has_jumped_ = false;
  // Ratio of the ways less one, creep (m of way per m and m/s gained), lag (s), its growth (s/s).
  Eigen::Vector4d fitted_ = Eigen::Vector4d::Zero();
  Eigen::Matrix4d covariance_;
  int refused_ = 0;  // in a row
  double farthest_s_ = kUsualS;
};

}  // namespace railfix::fusion
