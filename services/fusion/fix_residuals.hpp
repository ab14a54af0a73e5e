// What landmarks tell of themselves and of the odometers, by how far they are from where they were expected. Known from
// adaptive filters, which judge their noise by the innovations (Mohamed and Schwarz 1999). One false landmark is
// somebody else's matter (hypotheses).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace railfix::fusion {

/// A plain value.
class FixResiduals {
 public:
  /// A landmark was so far from where it was expected, which is so many standard deviations, so far behind the last
  /// reference. The same one again, which errs likewise, is not counted.
  void add(uint32_t landmark, double residual_m, double sigmas, double way_m);
  /// One sigma (m) of what landmarks err by when most of the last ones err by more than they say: a detector, or a map,
  /// that is worse than it knows. 0 while they do not, and while there are too few.
  [[nodiscard]] double scatter_m() const;
  /// Error per metre of way that the last two legs between references showed and the filter had not expected: a scale
  /// that is learnt from a false landmark.
  [[nodiscard]] double error_per_m() const;

 private:
  struct Residual {
    double metres = 0;
    double sigmas = 0;
    double way_m = 0;
  };
  static constexpr size_t kFixes = 5;
  std::array<Residual, kFixes> last_;  // the latest one first
  size_t count_ = 0;
  uint32_t landmark_ = 0;  // of the latest one; 0 = not known
};

}  // namespace railfix::fusion
