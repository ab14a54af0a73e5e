// Which end of the train is its front: the one whose cab is active. train_state and the tracker know the axis that the
// camera looks along; all that a report says is along the train's own (SUBSET-026 3.6.1).
#pragma once

#include <optional>

#include "tpr_publisher/position_report.hpp"

namespace railfix::tpr_publisher {

/// Values as in OnboardStatus of idl/onboard.idl.
enum class ActiveCab : uint8_t { not_said = 0, camera = 1, other = 2 };

/// From the camera's foot to either end of the train.
struct TrainEnds {
  double front_m = 0;  // forward to the camera's end
  double rear_m = -1;  // backward to the other end; below 0 = nobody drives from there

  /// To the end where the cab is active; nothing = not known. Who has two cabs must say which one is.
  [[nodiscard]] std::optional<double> to_front_m(ActiveCab cab) const;
};

/// The same, along the axis of a train whose front is the other end.
TrainPosition turned(TrainPosition position);
Reference turned(Reference reference);
Motion turned(Motion motion);

}  // namespace railfix::tpr_publisher
