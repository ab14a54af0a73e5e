#include "support/train/drive.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::train {
namespace {

constexpr double kTickS = 0.05;
constexpr double kRoomM = 60;  // kept in front of where a train began that sets back

double new_target(core::Random& random, double max_speed_mps, const DriveStyle& style) {
  const double luck = random.uniform();
  if (luck < 0.25) return 0;
  if (style.back_mps > 0 && luck < 0.6) return -random.uniform(0.5, style.back_mps);
  return random.uniform(3, max_speed_mps);
}

}  // namespace

Drive::Drive(core::Random& random, double duration_s, double max_speed_mps, double max_way_m, const DriveStyle& style) {
  double speed = random.uniform() < 0.5 ? 0 : random.uniform(5, std::min(30.0, max_speed_mps));
  double distance = 0;
  double accel = 0;
  double target = random.uniform(5, max_speed_mps);
  double change_s = random.uniform(10, 40);
  for (int i = 0; i * kTickS <= duration_s + 1; ++i) {
    samples_.push_back({distance, speed, accel});
    if (i * kTickS > change_s) {
      target = new_target(random, max_speed_mps, style);
      change_s += random.uniform(10, 40);
    }
    const bool backs = speed < 0 || (speed == 0 && target < 0);
    const double left_m = backs ? distance - kRoomM : max_way_m - distance - 5;
    if (speed * speed / (2 * 0.6 * style.brake_mps2) + 3 * std::abs(speed) > left_m) target = 0;
    const double wanted =
        std::clamp(style.gain_per_s * (target - speed), backs ? -style.traction_mps2 : -style.brake_mps2,
                   backs ? style.brake_mps2 : style.traction_mps2);
    accel += std::clamp(wanted - accel, -style.jerk_mps3 * kTickS, style.jerk_mps3 * kTickS);
    const double before = speed;
    speed += accel * kTickS;
    if (before * speed < 0 || (before == 0 && target == 0) || (speed < 0 && style.back_mps == 0)) speed = 0;
    if (speed == 0) accel = 0;
    distance += 0.5 * (before + speed) * kTickS;
  }
}

Motion Drive::at(double t_s) const {
  const double t = std::clamp(t_s / kTickS, 0.0, static_cast<double>(samples_.size() - 2));
  const auto i = static_cast<size_t>(t);
  const double part = t - static_cast<double>(i);
  const auto& a = samples_[i];
  const auto& b = samples_[i + 1];
  const double accel = (b.speed_mps - a.speed_mps) / kTickS;
  const double dt_s = part * kTickS;
  return {a.distance_m + a.speed_mps * dt_s + 0.5 * accel * dt_s * dt_s, a.speed_mps + accel * dt_s, accel};
}

double Drive::duration_s() const {
  return static_cast<double>(samples_.size() - 2) * kTickS;
}

double Drive::time_at(double distance_m) const {
  const auto passed =
      std::find_if(samples_.begin(), samples_.end(), [&](const Motion& m) { return m.distance_m >= distance_m; });
  if (passed == samples_.end()) return duration_s();
  return std::min(static_cast<double>(passed - samples_.begin()) * kTickS, duration_s());
}

}  // namespace railfix::train
