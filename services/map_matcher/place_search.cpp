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
// 800 m between the switches, 2.4 km where the way is plain, 500 m where it bends much.
constexpr std::array kWindowShapes{WindowShape{5, 8}, WindowShape{10, 12}, WindowShape{5, 5}};
constexpr double kTurnRad = 0.035;
constexpr double kBendRad = 0.045;    // of a heading against the straight line between the ends
constexpr double kShiftM = 20.0;      // grid, scale over half a window
constexpr size_t kPlainHits = 25000;  // a stretch that fits at so many places is too plain
constexpr size_t kMostStretches = 8;
constexpr size_t kFewHits = 1000;
constexpr int kApartEnough = 3;  // stretches that do not overlap, ...
constexpr int kApartLeast = 2;   // ... of which so many do not all miss the place
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
  Window window{first_bin, segment_bins, scale, std::vector<double>(segments, 0), std::vector<double>(segments, 0),
                {},        {},           {}};
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
  add_bends(window);
  return window;
}

void PlaceSearch::add_bends(Window& window) const {
  std::vector<double> headings{0};
  for (const double turn : window.turns) headings.push_back(headings.back() + turn);
  const double per_segment = headings.back() / static_cast<double>(window.turns.size());
  for (size_t k = 0; k < headings.size(); ++k) {
    window.bends.push_back(headings[k] - static_cast<double>(k) * per_segment);
    double change = 0;
    const size_t bin = window.first_bin + k * window.segment_bins;
    for (size_t i = bin > 1 ? bin - 2 : 0; i < std::min(way_.size(), bin + 2); ++i) {
      change = std::max(change, std::abs(way_[i].turn_rad - per_segment / static_cast<double>(window.segment_bins)));
    }
    const double share = parameters_.curvature_share * std::abs(window.bends.back());
    window.bend_tolerances.push_back(kBendRad + kShiftM / kBinM * change + share);
  }
}

std::optional<double> PlaceSearch::Window::squared_error(const float* heading,
                                                         const std::vector<std::ptrdiff_t>& ends) const {
  double squared = 0;
  for (const size_t k : order) {
    const double error = static_cast<double>(heading[ends[k + 1]] - heading[ends[k]]) - turns[k];
    if (std::abs(error) >= tolerances[k]) return std::nullopt;
    squared += error * error / (tolerances[k] * tolerances[k]);
  }
  const double per_segment = static_cast<double>(heading[ends.back()] - heading[0]) / static_cast<double>(turns.size());
  for (size_t k = 1; k + 1 < bends.size(); ++k) {
    const double bend = static_cast<double>(heading[ends[k]] - heading[0]) - static_cast<double>(k) * per_segment;
    if (std::abs(bend - bends[k]) >= bend_tolerances[k]) return std::nullopt;
  }
  return squared;
}

// What tells most is compared everywhere, without a branch, the rest where that fits.
void PlaceSearch::look_on(size_t chain, bool forward, const Window& window, Scratch& scratch,
                          std::vector<Hit>& hits) const {
  const auto& headings = index_.chains()[chain].heading_rad;
  const double cells = window.scale * static_cast<double>(window.segment_bins) * kBinM / NetworkIndex::kCellM;
  auto& ends = scratch.ends;
  auto& fitting = scratch.fitting;
  ends.clear();
  for (size_t k = 0; k <= window.turns.size(); ++k) {
    ends.push_back((forward ? 1 : -1) * static_cast<std::ptrdiff_t>(std::lround(cells * static_cast<double>(k))));
  }
  const std::ptrdiff_t reach = std::abs(ends.back());
  std::ptrdiff_t from = forward ? 0 : reach;
  std::ptrdiff_t to = std::ssize(headings) - (forward ? reach : 0);
  if (const double through_m = index_.chains()[chain].through_m; !std::isnan(through_m)) {
    const auto through = static_cast<std::ptrdiff_t>(through_m / NetworkIndex::kCellM);
    from = std::max(from, through - (forward ? reach : 0));
    to = std::min(to, through + (forward ? 1 : reach + 1));
  }
  if (to <= from) return;
  if (std::ssize(fitting) < to - from) fitting.resize(static_cast<size_t>(to - from));
  size_t count = 0;
  {
    const size_t k = window.order.front();
    const auto turn = static_cast<float>(window.turns[k]);
    const auto tolerance = static_cast<float>(window.tolerances[k]);
    const float* begin = headings.data() + ends[k];
    const float* end = headings.data() + ends[k + 1];
    for (std::ptrdiff_t i = from; i < to; ++i) {
      fitting[count] = i;
      count += std::abs(end[i] - begin[i] - turn) < tolerance ? 1 : 0;
    }
  }
  std::ptrdiff_t first = -kSameCells;
  for (size_t n = 0; n < count; ++n) {
    const std::ptrdiff_t i = fitting[n];
    const auto squared = window.squared_error(headings.data() + i, ends);
    if (!squared) continue;
    // Neighbouring cells are one place: the best of them is kept.
    const bool same = i - first < kSameCells;
    if (!same) first = i;
    if (same && *squared >= hits.back().squared) continue;
    if (same) hits.pop_back();
    hits.push_back({chain, forward, i, *squared, 0});
  }
}

PlaceSearch::Look PlaceSearch::look_everywhere(const Window& window) const {
  Look look{window, {}, false};
  Scratch scratch;
  for (size_t chain = 0; chain < index_.chains().size() && !look.plain; ++chain) {
    for (const bool forward : {true, false}) look_on(chain, forward, window, scratch, look.hits);
    look.plain = look.hits.size() > kPlainHits;
  }
  if (look.plain) look.hits.clear();
  return look;
}

Candidate PlaceSearch::candidate_of(const Hit& hit, const Window& window) const {
  const auto& chain = index_.chains()[hit.chain];
  const double place_m = NetworkIndex::kCellM * static_cast<double>(hit.cell);
  const auto after = std::upper_bound(chain.legs.begin(), chain.legs.end(), place_m,
                                      [](double m, const NetworkIndex::Leg& leg) { return m < leg.begin_m; });
  const auto& leg = *(after - 1);
  const double into_m = place_m - leg.begin_m;
  const double squared = hit.squared / static_cast<double>(window.turns.size());
  return {hit.forward ? leg.run : leg.run.reversed(),
          hit.forward ? into_m : leg.run.length_m() - into_m,
          window.first_bin,
          window.scale,
          1,
          squared};
}

// Until enough of them fit at a few places only. What was looked for before is remembered.
std::vector<PlaceSearch::Look> PlaceSearch::looks() {
  Memory kept;
  std::vector<Look> looks;
  std::vector<Window> telling;
  for (const auto& shape : kWindowShapes) {
    for (const size_t first : stretches(shape.segment_bins * shape.segments)) {
      if (apart(telling) >= kApartEnough) break;
      const std::tuple key(gone_bins_ + first, shape.segment_bins, shape.segments);
      auto known = memory_.extract(key);
      const auto& look =
          kept.emplace(key, known ? std::move(known.mapped())
                                  : look_everywhere(window_at(first, shape.segment_bins, shape.segments, 1)))
              .first->second;
      if (look.plain) continue;
      looks.push_back(look);
      looks.back().window.first_bin = first;
      if (look.hits.size() <= kFewHits) telling.push_back(looks.back().window);
    }
  }
  memory_ = std::move(kept);
  return looks;
}

// So many of the stretches do not overlap.
int PlaceSearch::apart(std::vector<Window> windows) {
  std::sort(windows.begin(), windows.end(), [](const Window& a, const Window& b) { return a.end_bin() < b.end_bin(); });
  size_t free_bin = 0;
  int count = 0;
  for (const Window& window : windows) {
    if (window.first_bin < free_bin) continue;
    free_bin = window.end_bin();
    ++count;
  }
  return count;
}

// Those that fit at the fewest places, until enough of them do not overlap.
std::vector<PlaceSearch::Look> PlaceSearch::chosen(std::vector<Look> looks, bool& complete) {
  std::sort(looks.begin(), looks.end(), [](const Look& a, const Look& b) { return a.hits.size() < b.hits.size(); });
  std::vector<Window> windows;
  for (size_t i = 0; i < looks.size() && apart(windows) < kApartEnough; ++i) {
    windows.push_back(looks[i].window);
    for (Hit& hit : looks[i].hits) hit.window = i;
  }
  looks.resize(windows.size());
  complete = apart(windows) >= kApartLeast;
  return looks;
}

// One place of the train may be found by several stretches: where the way would begin tells.
std::vector<Candidate> PlaceSearch::merged(const std::vector<Look>& looks) const {
  const auto begin_m = [&](const Hit& hit) {
    const double back_m = kBinM * static_cast<double>(looks[hit.window].window.first_bin);
    return NetworkIndex::kCellM * static_cast<double>(hit.cell) - (hit.forward ? back_m : -back_m);
  };
  std::vector<Hit> hits;
  for (const Look& look : looks) hits.insert(hits.end(), look.hits.begin(), look.hits.end());
  std::sort(hits.begin(), hits.end(), [&](const Hit& a, const Hit& b) {
    return std::tuple(a.chain, a.forward, begin_m(a)) < std::tuple(b.chain, b.forward, begin_m(b));
  });
  std::vector<Candidate> candidates;
  const Hit* last = nullptr;
  for (const Hit& hit : hits) {
    const auto candidate = candidate_of(hit, looks[hit.window].window);
    const bool same = last != nullptr && last->chain == hit.chain && last->forward == hit.forward &&
                      begin_m(hit) - begin_m(*last) < kSameM;
    if (!same) {
      candidates.push_back(candidate);
    } else {
      Candidate& before = candidates.back();
      const int found = before.found + (hit.window != last->window ? 1 : 0);
      if (candidate.squared < before.squared) before = candidate;
      before.found = found;
    }
    last = &hit;
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.found != b.found ? a.found > b.found : a.squared < b.squared;
  });
  return candidates;
}

PlacesFound PlaceSearch::search() {
  PlacesFound found;
  found.candidates = merged(chosen(looks(), found.complete));
  return found;
}

}  // namespace railfix::map_matcher
