// The first step of the search on the whole network: stretches of the measured way, as turns of a few hundred metres
// each, compared with every 10 m of every chain of edges in both directions.
#pragma once

#include <vector>

#include "map_matcher/locator_types.hpp"
#include "map_matcher/network_index.hpp"

namespace railfix::map_matcher {

struct PlacesFound {
  std::vector<Candidate> candidates;
  bool complete = true;  // false: there were more that fit
};

class PlaceSearch {
 public:
  PlaceSearch(const LocatorParameters& parameters, const NetworkIndex& index, const MeasuredWay& way)
      : parameters_(parameters), index_(index), way_(way) {}

  [[nodiscard]] PlacesFound search() const;

 private:
  /// A stretch as turns of its segments.
  struct Window {
    size_t first_bin = 0;
    size_t segment_bins = 0;
    double scale = 1;
    std::vector<double> turns;
    std::vector<double> tolerances;
    std::vector<size_t> order;  // what tells most, first
  };
  /// A candidate before it is known on which edge it lies.
  struct Hit {
    size_t chain = 0;
    bool forward = true;
    std::ptrdiff_t cell = 0;
    double squared = 0;
    size_t window = 0;
  };
  [[nodiscard]] Window window_at(size_t first_bin, size_t segment_bins, size_t segments, double scale) const;
  [[nodiscard]] std::vector<size_t> stretches(size_t bins) const;
  void look_on(size_t chain, bool forward, const Window& window, size_t number, std::vector<Hit>& hits) const;
  void look_everywhere(const Window& window, size_t number, std::vector<Hit>& hits) const;
  [[nodiscard]] Candidate candidate_of(const Hit& hit, const Window& window) const;

  const LocatorParameters& parameters_;
  const NetworkIndex& index_;
  const MeasuredWay& way_;
};

}  // namespace railfix::map_matcher
