// Is the train on the track that is followed? Certain where it starts; behind every switch that could have led it
// elsewhere only as probable as somebody says who looked (map_matcher), else as one of the ways.
#pragma once

#include <optional>
#include <vector>

#include "track/path.hpp"

namespace railfix::fusion {

class TrackDoubt {
 public:
  /// Somebody says that the track is right with this probability, for a train at `of_m` (nothing: not on this path)
  /// while it is at `place_m`. Switches between the two stay open.
  void said(double probability, std::optional<double> of_m, double place_m);
  /// The train is at `place_m` of its path now.
  void move(const track::Path& path, double place_m);
  [[nodiscard]] double probability() const;
  /// The same for a train that has gone on to `place_m`.
  [[nodiscard]] double probability_at(const track::Path& path, double place_m) const;

 private:
  double said_ = 1;
  std::optional<double> place_m_;
  std::vector<track::PathSwitch> open_;  // run over since somebody looked
};

}  // namespace railfix::fusion
