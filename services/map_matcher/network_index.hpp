// The shape of a whole network, made once for searching it (0.1 s for 20,000 km): headings every 10 m of every edge,
// and chains of edges that follow each other straight on.
#pragma once

#include <memory>
#include <vector>

#include "track/track_finder.hpp"
#include "track/ways.hpp"

namespace railfix::map_matcher {

class NetworkIndex {
 public:
  static constexpr double kCellM = 10.0;
  explicit NetworkIndex(std::shared_ptr<const track::Map> map);

  struct Leg {
    track::Run run;
    double begin_m = 0;
  };
  /// Runs that follow each other straight on, with the heading every cell.
  struct Chain {
    std::vector<Leg> legs;
    std::vector<float> heading_rad;
    double length_m = 0;
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
  [[nodiscard]] const std::vector<const track::Landmark*>& balises_on(const track::Edge& edge) const {
    return balises_[edge.id - 1];
  }

 private:
  void add_chain(const track::Run& first, std::vector<bool>& used);
  /// Heading on an edge relative to its start, along growing offset.
  [[nodiscard]] double heading_on(const track::Edge& edge, double offset_m) const;
  std::shared_ptr<const track::Map> map_;
  track::Ways ways_;
  track::TrackFinder finder_;
  std::vector<std::vector<float>> headings_;  // of each edge, every cell
  std::vector<std::vector<const track::Landmark*>> balises_;
  std::vector<Chain> chains_;
};

}  // namespace railfix::map_matcher
