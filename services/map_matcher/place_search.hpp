// The first step of the search on the whole network: stretches of the measured way, as turns of a few hundred metres
// each, compared with every 10 m of every chain of edges in both directions. A stretch may miss the place (a switch too
// many, an error of the map beyond what is allowed), several that do not overlap will not.
#pragma once

#include <map>
#include <optional>
#include <tuple>
#include <vector>

#include "map_matcher/locator_types.hpp"
#include "map_matcher/network_index.hpp"

namespace railfix::map_matcher {

struct PlacesFound {
  std::vector<Candidate> candidates;  // the likely ones first
  bool complete = true;               // false: the place may not be among them
};

class PlaceSearch {
 public:
  /// A stretch as turns of its segments.
  struct Window {
    size_t first_bin = 0;
    size_t segment_bins = 0;
    double scale = 1;
    std::vector<double> turns;
    std::vector<double> tolerances;
    std::vector<size_t> order;  // what tells most, first
    // Headings at the ends of the segments, less the straight line between the first and the last one: a constant error
    // of the sensor does not matter, and errors of the map do not add up.
    std::vector<double> bends;
    std::vector<double> bend_tolerances;
    [[nodiscard]] size_t end_bin() const { return first_bin + segment_bins * turns.size(); }
    /// Of a way that begins at `heading`, its segments' ends at these cells from there; nothing when it does not fit.
    [[nodiscard]] std::optional<double> squared_error(const float* heading,
                                                      const std::vector<std::ptrdiff_t>& ends) const;
  };
  /// A candidate before it is known on which edge it lies.
  struct Hit {
    size_t chain = 0;
    bool forward = true;
    std::ptrdiff_t cell = 0;
    double squared = 0;
    size_t window = 0;
  };
  struct Look {
    Window window;
    std::vector<Hit> hits;
    bool plain = false;  // it fits at too many places; not all of them are here
  };
  /// What was looked for before, by where the stretch begins since the first bin ever, and by its shape.
  using Memory = std::map<std::tuple<size_t, size_t, size_t>, Look>;

  /// `gone_bins` were measured before the way, and forgotten.
  PlaceSearch(const LocatorParameters& parameters, const NetworkIndex& index, const MeasuredWay& way, size_t gone_bins,
              Memory& memory)
      : parameters_(parameters), index_(index), way_(way), gone_bins_(gone_bins), memory_(memory) {}

  [[nodiscard]] PlacesFound search();

 private:
  [[nodiscard]] Window window_at(size_t first_bin, size_t segment_bins, size_t segments, double scale) const;
  [[nodiscard]] std::vector<size_t> stretches(size_t bins) const;
  [[nodiscard]] std::vector<Look> looks();
  [[nodiscard]] static int apart(std::vector<Window> windows);
  [[nodiscard]] static std::vector<Look> chosen(std::vector<Look> looks, bool& complete);
  void add_bends(Window& window) const;
  struct Scratch {
    std::vector<std::ptrdiff_t> ends;
    std::vector<std::ptrdiff_t> fitting;
  };
  void look_on(size_t chain, bool forward, const Window& window, Scratch& scratch, std::vector<Hit>& hits) const;
  [[nodiscard]] Look look_everywhere(const Window& window) const;
  [[nodiscard]] Candidate candidate_of(const Hit& hit, const Window& window) const;
  [[nodiscard]] std::vector<Candidate> merged(const std::vector<Look>& looks) const;

  const LocatorParameters& parameters_;
  const NetworkIndex& index_;
  const MeasuredWay& way_;
  size_t gone_bins_;
  Memory& memory_;
};

}  // namespace railfix::map_matcher
