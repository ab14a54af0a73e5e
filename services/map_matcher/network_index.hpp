// The shape of a whole network, made once for searching it (0.2 s for 20,000 km): headings every 10 m of every edge,
// chains of edges that follow each other straight on, and short ones through every other leg of a switch.
#pragma once

#include <cmath>
#include <deque>
#include <memory>
#include <vector>

#include "map_matcher/locator_types.hpp"
#include "track/track_finder.hpp"
#include "track/ways.hpp"

namespace railfix::map_matcher {

class NetworkIndex {
 public:
  static constexpr double kCellM = 10.0;
  static constexpr double kReachM = 2500.0;  // of a chain through the other leg of a switch, to either side
  explicit NetworkIndex(std::shared_ptr<const track::Map> map);

  struct Leg {
    track::Run run;
    double begin_m = 0;
  };
  /// Runs that follow each other, with the heading every cell.
  struct Chain {
    std::vector<Leg> legs;
    std::vector<float> heading_rad;
    double length_m = 0;
    double through_m =
        NAN;  // of the other leg of a switch; what does not lie across this place is on another chain, too
  };
  [[nodiscard]] const std::vector<Chain>& chains() const { return chains_; }
  [[nodiscard]] const track::Ways& ways() const { return ways_; }
  [[nodiscard]] const track::Map& map() const { return *map_; }
  /// Runs beside a place in about the same direction, with the place beside it on each; its own run is among them.
  struct Beside {
    track::Run run;
    double into_m = 0;
  };
  [[nodiscard]] std::vector<Beside> beside(const track::Run& run, double into_m, double within_m) const;
  /// Turn since the beginning of a run, in the direction of travel, left positive.
  [[nodiscard]] double turned(const track::Run& run, double into_m) const;
  /// Landmarks on a run, in its direction.
  [[nodiscard]] const std::vector<Mark>& marks_on(const track::Run& run) const {
    return marks_[2 * (run.edge->id - 1) + (run.forward ? 0 : 1)];
  }

 private:
  void add_straight_on(const track::Run& first, std::vector<bool>& used);
  void add_through(const track::Run& from, const track::Run& leg);
  [[nodiscard]] Chain chain_of(const std::deque<track::Run>& runs) const;
  /// Heading on an edge relative to its start, along growing offset.
  [[nodiscard]] double heading_on(const track::Edge& edge, double offset_m) const;
  std::shared_ptr<const track::Map> map_;
  track::Ways ways_;
  track::TrackFinder finder_;
  std::vector<std::vector<float>> headings_;  // of each edge, every cell
  std::vector<std::vector<Mark>> marks_;      // of each run, in order
  std::vector<Chain> chains_;
};

}  // namespace railfix::map_matcher
