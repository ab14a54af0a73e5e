#include "track/frog.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track {
namespace {

constexpr double kLongestSwitchM = 150.0;
constexpr double kStepM = 0.5;
constexpr int kHalvings = 20;        // to less than 1e-6 m
constexpr double kSideKnownM = 1.2;  // where the rails cross the middles are 1.4 m apart

/// How far a place beside the straight leg, left_m of its middle, is left of the branch, looking away from the switch.
Alignment::Nearest beside(const SwitchLeg& straight, const SwitchLeg& branch, double from_switch_m, double left_m) {
  const PlanPose pose = straight.alignment->at(straight.offset(from_switch_m)).pose;
  const double left = straight.forward ? left_m : -left_m;
  Alignment::Nearest nearest = branch.alignment->nearest(pose.easting_m - left * std::cos(pose.heading_rad),
                                                         pose.northing_m + left * std::sin(pose.heading_rad));
  if (!branch.forward) nearest.lateral_m = -nearest.lateral_m;
  return nearest;
}

}  // namespace

std::optional<FrogPlace> frog_place(const SwitchLeg& straight, const SwitchLeg& branch) {
  const double reach_m = std::min({kLongestSwitchM, straight.alignment->length_m(), branch.alignment->length_m()});
  for (double far_m = kStepM; far_m <= reach_m; far_m += kStepM) {
    const double apart_m = beside(straight, branch, far_m, 0).lateral_m;
    if (std::abs(apart_m) < kSideKnownM) continue;
    const double side = apart_m < 0 ? 1 : -1;
    const double face_m = side * 0.5 * kGaugeM;
    const auto crossed = [&](double m) {
      return side * beside(straight, branch, m, face_m).lateral_m < -0.5 * kGaugeM;
    };
    if (!crossed(far_m)) continue;
    if (far_m < 1.5 * kStepM) return std::nullopt;  // they begin apart: no switch
    double before_m = far_m - kStepM;
    double behind_m = far_m;
    for (int i = 0; i < kHalvings; ++i) {
      const double middle_m = 0.5 * (before_m + behind_m);
      (crossed(middle_m) ? behind_m : before_m) = middle_m;
    }
    return FrogPlace{straight.offset(behind_m), beside(straight, branch, behind_m, face_m).offset_m, side};
  }
  return std::nullopt;
}

}  // namespace railfix::track
