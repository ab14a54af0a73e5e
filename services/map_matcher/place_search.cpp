#include "map_matcher/place_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace railfix::map_matcher {
namespace {

struct WindowShape {
  size_t segment_bins;
  size_t segments;
};
// 800 m between the switches, 2.4 km where the way is plain.
constexpr std::array kWindowShapes{WindowShape{5, 8}, WindowShape{10, 12}};
constexpr size_t kWholeSegmentBins = 10;
constexpr std::array<double, 4> kWholeScales = {-0.75, -0.25, 0.25, 0.75};  // of the range
constexpr double kTurnRad = 0.02;
constexpr double kShiftM = 20.0;     // grid, scale over half a window
constexpr size_t kPlainHits = 1500;  // a window that fits at so many places is too plain
constexpr size_t kMostWhole = 400;   // ... but of those of the whole way the best are kept
constexpr size_t kMostStretches = 12;
constexpr double kSameM = 40.0;
constexpr std::ptrdiff_t kSameCells = 4;

}  // namespace

// Disjoint stretches, those that bend most unevenly first.
std::vector<size_t> PlaceSearch::stretches(size_t bins) const {
  std::vector<double> sums;
  for (size_t i = 0; i + bins <= way_.size(); ++i) {
    double sum = 0;
    for (size_t k = i + 1; k < i + bins; ++k) sum += std::abs(way_[k].turn_rad - way_[k - 1].turn_rad);
    sums.push_back(sum);
  }
  std::vector<size_t> chosen;
  while (chosen.size() < kMostStretches && !sums.empty()) {
    const auto best = std::max_element(sums.begin(), sums.end());
    if (*best <= 0) break;
    const auto at = static_cast<size_t>(best - sums.begin());
    chosen.push_back(at);
    const size_t apart = bins / 2;
    for (size_t i = at > apart ? at - apart : 0; i < std::min(sums.size(), at + apart + 1); ++i) sums[i] = 0;
  }
  return chosen;
}

// A place is found to a cell or two, and the scale moves the ends: where the curvature changes that makes a difference.
PlaceSearch::Window PlaceSearch::window_at(size_t first_bin, size_t segment_bins, size_t segments, double scale) const {
  Window window{first_bin, segment_bins, scale, std::vector<double>(segments, 0), std::vector<double>(segments, 0), {}};
  for (size_t k = 0; k < segments; ++k) {
    const size_t from = first_bin + k * segment_bins;
    double low = INFINITY;
    double high = -INFINITY;
    for (size_t i = from > 0 ? from - 1 : 0; i < std::min(way_.size(), from + segment_bins + 1); ++i) {
      low = std::min(low, way_[i].turn_rad / kBinM);
      high = std::max(high, way_[i].turn_rad / kBinM);
    }
    for (size_t i = from; i < from + segment_bins; ++i) window.turns[k] += way_[i].turn_rad;
    window.tolerances[k] =
        kTurnRad + kShiftM * (high - low) + 2 * parameters_.curvature_share * std::abs(window.turns[k]);
  }
  window.order.resize(segments);
  std::iota(window.order.begin(), window.order.end(), size_t{0});
  std::sort(window.order.begin(), window.order.end(), [&](size_t a, size_t b) {
    return std::abs(window.turns[a]) - window.tolerances[a] > std::abs(window.turns[b]) - window.tolerances[b];
  });
  return window;
}

void PlaceSearch::look_on(size_t chain, bool forward, const Window& window, size_t number,
                          std::vector<Hit>& hits) const {
  const auto& headings = index_.chains()[chain].heading_rad;
  const double cells = window.scale * static_cast<double>(window.segment_bins) * kBinM / NetworkIndex::kCellM;
  std::vector<std::ptrdiff_t> ends;
  for (size_t k = 0; k <= window.turns.size(); ++k) {
    ends.push_back((forward ? 1 : -1) * static_cast<std::ptrdiff_t>(std::lround(cells * static_cast<double>(k))));
  }
  const std::ptrdiff_t reach = std::abs(ends.back());
  const auto size = std::ssize(headings);
  std::ptrdiff_t first = -kSameCells;
  for (std::ptrdiff_t i = forward ? 0 : reach; i < (forward ? size - reach : size); ++i) {
    const float* heading = headings.data() + i;
    double squared = 0;
    bool fits = true;
    for (const size_t k : window.order) {
      const double error = static_cast<double>(heading[ends[k + 1]] - heading[ends[k]]) - window.turns[k];
      fits = std::abs(error) < window.tolerances[k];
      if (!fits) break;
      squared += error * error / (window.tolerances[k] * window.tolerances[k]);
    }
    if (!fits) continue;
    // Neighbouring cells are one place: the best of them is kept.
    const bool same = i - first < kSameCells;
    if (!same) first = i;
    if (same && squared >= hits.back().squared) continue;
    if (same) hits.pop_back();
    hits.push_back({chain, forward, i, squared, number});
  }
}

void PlaceSearch::look_everywhere(const Window& window, size_t number, std::vector<Hit>& hits) const {
  for (size_t chain = 0; chain < index_.chains().size(); ++chain) {
    for (const bool forward : {true, false}) look_on(chain, forward, window, number, hits);
  }
}

Candidate PlaceSearch::candidate_of(const Hit& hit, const Window& window) const {
  const auto& chain = index_.chains()[hit.chain];
  const double place_m = NetworkIndex::kCellM * static_cast<double>(hit.cell);
  const auto after = std::upper_bound(chain.legs.begin(), chain.legs.end(), place_m,
                                      [](double m, const NetworkIndex::Leg& leg) { return m < leg.begin_m; });
  const auto& leg = *(after - 1);
  const double into_m = place_m - leg.begin_m;
  const double squared = hit.squared / static_cast<double>(window.turns.size());
  return {hit.forward ? leg.run : leg.run.reversed(), hit.forward ? into_m : leg.run.length_m() - into_m,
          window.first_bin, window.scale, squared};
}

PlacesFound PlaceSearch::search() const {
  PlacesFound found;
  std::vector<Window> windows;
  std::vector<Hit> hits;
  const auto look = [&](const Window& window, size_t most) {
    std::vector<Hit> now;
    windows.push_back(window);
    look_everywhere(window, windows.size() - 1, now);
    const auto worse = [](const Hit& a, const Hit& b) { return a.squared < b.squared; };
    if (now.size() > kPlainHits && most == 0) return;
    if (most > 0 && now.size() > most) {
      std::nth_element(now.begin(), now.begin() + static_cast<std::ptrdiff_t>(most), now.end(), worse);
      now.resize(most);
    }
    hits.insert(hits.end(), now.begin(), now.end());
  };
  for (const auto& shape : kWindowShapes) {
    for (const size_t first : stretches(shape.segment_bins * shape.segments)) {
      look(window_at(first, shape.segment_bins, shape.segments, 1), 0);
    }
  }
  if (hits.empty()) {
    const size_t segments = way_.size() / kWholeSegmentBins;
    for (const double share : kWholeScales) {
      look(window_at(0, kWholeSegmentBins, segments, 1 + share * parameters_.scale_range), kMostWhole);
    }
  }
  // One place of the train may be found by several windows: where the way would begin tells.
  const auto begin_m = [&](const Hit& hit) {
    const double back_m = kBinM * static_cast<double>(windows[hit.window].first_bin);
    return NetworkIndex::kCellM * static_cast<double>(hit.cell) - (hit.forward ? back_m : -back_m);
  };
  std::sort(hits.begin(), hits.end(), [&](const Hit& a, const Hit& b) {
    return std::tuple(a.chain, a.forward, begin_m(a)) < std::tuple(b.chain, b.forward, begin_m(b));
  });
  const Hit* last = nullptr;
  for (const Hit& hit : hits) {
    const auto candidate = candidate_of(hit, windows[hit.window]);
    const bool same = last != nullptr && last->chain == hit.chain && last->forward == hit.forward &&
                      begin_m(hit) - begin_m(*last) < kSameM;
    if (!same) {
      last = &hit;
      found.candidates.push_back(candidate);
    } else if (candidate.squared < found.candidates.back().squared) {
      found.candidates.back() = candidate;
    }
  }
  return found;
}

}  // namespace railfix::map_matcher
