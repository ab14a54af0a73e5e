// What became of a fix.
#pragma once

#include <cmath>
#include <cstdint>

#include "fusion/jump_evidence.hpp"
#include "fusion/motion_filter.hpp"

namespace railfix::fusion {

/// A plain value.
struct FixOutcome {
  enum class Verdict : uint8_t { none, used, corrected, refused };
  Verdict verdict = Verdict::none;
  Offer offer;  // by how far it was from where it was expected
  /// Of a landmark that was met before, since when little was forgotten: it says hardly anything new.
  bool again = false;

  [[nodiscard]] bool used() const { return verdict == Verdict::used || corrected(); }
  /// Used against the filter's word, because the one before, which was refused, says the same.
  [[nodiscard]] bool corrected() const { return verdict == Verdict::corrected; }
  [[nodiscard]] bool refused() const { return verdict == Verdict::refused; }
  /// How far beyond `excused_m` it was from where it was expected, in standard deviations.
  [[nodiscard]] double sigmas_off(double excused_m = 0) const {
    const double off_m = std::abs(offer.residual);
    return off_m > excused_m ? std::sqrt(offer.nis) * (1 - excused_m / off_m) : 0;
  }
  /// It was hardly to be believed where it was expected.
  [[nodiscard]] bool unexpected() const { return refused() || sigmas_off() >= kUnlikelySigmas; }
};

}  // namespace railfix::fusion
