// The doubt of a train whose track is not declared.
#pragma once

#include <optional>

#include "tpr_publisher/position_report.hpp"

namespace railfix::tpr_publisher {

/// Behind a switch the place is that of the followed leg. A landmark of that leg corrects it there and narrows its
/// interval; when the train runs on the other leg, it has not passed that landmark. So until the track is declared the
/// interval does not shrink, and takes up by how much the place moved otherwise than the speed says.
class HeldDoubt {
 public:
  /// `foot_m`: beyond the LRBG, along; nothing = not known. `same_group`: the LRBG is the one of the position before.
  void follow(const TrainPosition& position, std::optional<double> foot_m, bool same_group, bool declared);
  [[nodiscard]] double over_m() const { return over_m_; }
  [[nodiscard]] double under_m() const { return under_m_; }

 private:
  std::optional<TrainPosition> last_;
  std::optional<double> last_foot_m_;
  double widest_over_m_ = 0;  // since the track was declared
  double widest_under_m_ = 0;
  double corrected_m_ = 0;  // in the same time, along
  double over_m_ = 0;
  double under_m_ = 0;
};

}  // namespace railfix::tpr_publisher
