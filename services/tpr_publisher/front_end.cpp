#include "tpr_publisher/front_end.hpp"

#include <utility>

namespace railfix::tpr_publisher {

std::optional<double> TrainEnds::to_front_m(ActiveCab cab) const {
  const bool has_two = rear_m >= 0;
  if (cab == ActiveCab::other) return has_two ? std::optional(rear_m) : std::nullopt;
  if (cab == ActiveCab::not_said && has_two) return std::nullopt;
  return front_m;
}

TrainPosition turned(TrainPosition position) {
  position.distance_m = -position.distance_m;
  position.speed_mps = -position.speed_mps;
  std::swap(position.over_m, position.under_m);
  return position;
}

Reference turned(Reference reference) {
  reference.foot_m = -reference.foot_m;
  reference.nominal_along = !reference.nominal_along;
  reference.from_previous_along = !reference.from_previous_along;
  for (auto& one : reference.earlier) {
    one.ahead_m = -one.ahead_m;
    one.nominal_along = !one.nominal_along;
    one.from_previous_along = !one.from_previous_along;
  }
  return reference;
}

Motion turned(Motion motion) {
  if (motion == Motion::unknown) return motion;
  return motion == Motion::forward ? Motion::backward : Motion::forward;
}

}  // namespace railfix::tpr_publisher
