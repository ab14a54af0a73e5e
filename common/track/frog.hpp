// Where the rails of a switch's two legs cross.
#pragma once

#include <optional>

#include "track/alignment.hpp"

namespace railfix::track {

inline constexpr double kGaugeM = 1.435;

/// A leg of a switch as seen from the switch; the alignment begins there, or ends there.
struct SwitchLeg {
  const Alignment* alignment = nullptr;
  bool forward = true;

  /// Of a place so far from the switch.
  [[nodiscard]] double offset(double from_switch_m) const {
    return forward ? from_switch_m : alignment->length_m() - from_switch_m;
  }
};

/// The mathematical point of the frog, where the gauge faces of the two inner rails cross.
struct FrogPlace {
  double on_straight_m = 0;  // offset on the straight leg
  double on_branch_m = 0;    // offset on the other one
  double side = 1;           // +1: the branch leaves to the left, looking away from the switch
};

/// Nothing if the rails do not cross within 150 m.
[[nodiscard]] std::optional<FrogPlace> frog_place(const SwitchLeg& straight, const SwitchLeg& branch);

}  // namespace railfix::track
