// The way that a train has run in one direction, as it turned, and the landmarks on it. Of a train that backs it is the
// way that a train turned round runs forward.
#pragma once

#include <cstddef>
#include <deque>

#include "map_matcher/locate/locator_types.hpp"
#include "map_matcher/match_types.hpp"

namespace railfix::map_matcher {

/// What is run against the direction is taken back, and measured anew when the train comes again: it may come another
/// way.
class MeasuredRun {
 public:
  enum class Direction : uint8_t { ahead, astern };
  MeasuredRun(const LocatorParameters& parameters, Direction direction)
      : parameters_(parameters), sign_(direction == Direction::ahead ? 1 : -1) {}

  /// Moved by way_m (measured, forward positive) and turned meanwhile (left positive).
  void move(double way_m, double turn_rad, double turn_sigma_rad);
  void sight(const Sighting& sighting);
  void clear();

  /// Whole bins only.
  [[nodiscard]] MeasuredWay way() const { return {bins_.begin(), bins_.end()}; }
  [[nodiscard]] size_t bins() const { return bins_.size(); }
  [[nodiscard]] size_t gone_bins() const { return gone_bins_; }
  [[nodiscard]] size_t end_bin() const { return gone_bins_ + bins_.size(); }
  [[nodiscard]] bool ahead() const { return sign_ > 0; }
  /// The train is where it has come to, but for some rocking. Behind that a switch may have led it elsewhere.
  [[nodiscard]] bool at_front() const;
  /// From the last whole bin to the camera's foot, in the direction of the run. The bogies are behind the foot when the
  /// train runs ahead; when it backs they are in front of it, and the way is that of a point as far before them.
  [[nodiscard]] double open_m() const { return open_m_ - lead_m(); }

 private:
  [[nodiscard]] double lead_m() const { return ahead() ? 0 : parameters_.lag_m; }
  void lay(double way_m, double turn_rad, double variance);
  void take_back(double way_m, double turn_rad, double variance);
  [[nodiscard]] bool elsewhere(double turn_rad) const;

  LocatorParameters parameters_;
  double sign_;
  std::deque<MeasuredBin> bins_;  // oldest first
  size_t gone_bins_ = 0;          // in front of them
  MeasuredBin open_;
  double open_m_ = 0;
  double back_m_ = 0;  // behind the farthest point
};

}  // namespace railfix::map_matcher
