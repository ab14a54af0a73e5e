// The shape of a whole network, made once for searching it (0.2 s for 20,000 km): headings every 10 m of every edge,
// and which runs follow which, by numbers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "map_matcher/locate/locator_types.hpp"
#include "track/track_finder.hpp"
#include "track/ways.hpp"

namespace railfix::map_matcher {

class NetworkIndex {
 public:
  static constexpr double kCellM = 10.0;
  static constexpr uint32_t kNoRun = UINT32_MAX;
  explicit NetworkIndex(std::shared_ptr<const track::Map> map);

  [[nodiscard]] const track::Ways& ways() const { return ways_; }
  [[nodiscard]] const track::Map& map() const { return *map_; }
  [[nodiscard]] const std::shared_ptr<const track::Map>& shared_map() const { return map_; }
  [[nodiscard]] std::vector<track::NearTrack> near(double easting_m, double northing_m, double radius_m) const {
    return finder_.near(easting_m, northing_m, radius_m);
  }
  /// Runs beside a place in about the same direction, with the place beside it on each; its own run is among them.
  struct Beside {
    track::Run run;
    double into_m = 0;
  };
  [[nodiscard]] std::vector<Beside> beside(const track::Run& run, double into_m, double within_m) const;
  /// Turn since the beginning of a run, in the direction of travel, left positive; straight beyond its ends.
  [[nodiscard]] double turned(const track::Run& run, double into_m) const { return turned_on(number(run), into_m); }
  /// Landmarks on a run, in its direction.
  [[nodiscard]] const std::vector<Mark>& marks_on(const track::Run& run) const { return marks_[number(run)]; }
  /// The same by the numbers of the runs, which are quicker.
  [[nodiscard]] uint32_t runs() const { return static_cast<uint32_t>(marks_.size()); }
  [[nodiscard]] track::Run run(uint32_t number) const { return {&map_->edges[number / 2], number % 2 == 0}; }
  [[nodiscard]] const std::vector<uint32_t>& after(uint32_t run) const { return after_[run]; }
  [[nodiscard]] const std::vector<Mark>& marks_on(uint32_t run) const { return marks_[run]; }
  [[nodiscard]] float length_m(uint32_t run) const { return lengths_m_[run / 2]; }
  [[nodiscard]] float turned(uint32_t run, float into_m) const { return turned_on(run, into_m); }

 private:
  static uint32_t number(const track::Run& run) { return 2 * (run.edge->id - 1) + (run.forward ? 0 : 1); }
  template <typename Number>
  [[nodiscard]] Number turned_on(uint32_t run, Number into_m) const {
    const Number length_m = lengths_m_[run / 2];
    if (run % 2 == 0) return heading_on<Number>(run / 2, into_m);
    return heading_on<Number>(run / 2, length_m - into_m) - ends_rad_[run / 2];
  }
  /// Heading on an edge relative to its start, along growing offset.
  template <typename Number>
  [[nodiscard]] Number heading_on(uint32_t edge, Number offset_m) const {
    const float* headings = headings_.data() + first_cells_[edge];
    const auto last = static_cast<Number>(first_cells_[edge + 1] - first_cells_[edge] - 2);
    const Number cell = std::clamp(offset_m / static_cast<Number>(kCellM), Number{0}, last + 1);
    const auto whole = static_cast<size_t>(std::min(cell, last));
    return headings[whole] + (cell - static_cast<Number>(whole)) * (headings[whole + 1] - headings[whole]);
  }
  std::shared_ptr<const track::Map> map_;
  track::Ways ways_;
  track::TrackFinder finder_;
  std::vector<float> headings_;               // of one edge after the other, every cell; two or more for each
  std::vector<size_t> first_cells_;           // of each edge, and the end
  std::vector<float> lengths_m_;              // of each edge
  std::vector<float> ends_rad_;               // heading at its end
  std::vector<std::vector<Mark>> marks_;      // of each run, in order
  std::vector<std::vector<uint32_t>> after_;  // the straight way first
};

}  // namespace railfix::map_matcher
