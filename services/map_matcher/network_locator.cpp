#include "map_matcher/network_locator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/units.hpp"

namespace railfix::map_matcher {
namespace {

struct WindowShape {
  size_t segment_bins;
  size_t segments;
};
constexpr std::array kWindowShapes{WindowShape{5, 8}, WindowShape{10, 12}};  // 800 m; plain ways need 2,400 m
constexpr double kCoarseTurnRad = 0.02;
constexpr double kCoarseShiftM = 20.0;  // grid, scale over half a window
constexpr int kMostWindows = 5;
constexpr size_t kPlainCandidates = 1500;  // a window that fits at so many places is too plain
constexpr double kFarBelow = 25.0;         // a place whose log likelihood is so far below the best one is given up
constexpr double kMostSquared = 25.0;
constexpr size_t kMostWalks = 4;
constexpr int kMostRunsAStep = 12;
constexpr double kBaliseSigmaM = 4.0;
constexpr double kSamePlaceM = 60.0;
constexpr double kBesideM = 40.0;
constexpr double kSettledM = 100.0;  // behind a switch
constexpr double kLeastSigmaM = 3.0;

/// Turn since the beginning of a run, in the direction of travel.
double turned(const NetworkIndex& index, const track::Run& run, double into_m) {
  if (run.forward) return index.heading_on(*run.edge, into_m);
  const double length_m = run.length_m();
  return index.heading_on(*run.edge, length_m - into_m) - index.heading_on(*run.edge, length_m);
}

}  // namespace

NetworkIndex::NetworkIndex(std::shared_ptr<const track::Map> map)
    : map_(std::move(map)), ways_(*map_), headings_(map_->edges.size()), balises_(map_->edges.size()) {
  for (const auto& edge : map_->edges) {
    auto& headings = headings_[edge.id - 1];
    double heading = 0;
    double from_m = 0;
    headings.push_back(0);
    for (double m = kCellM; from_m < edge.alignment.length_m(); m += kCellM) {
      // Elements are longer than a cell nearly everywhere: the curvature is all but linear within it.
      heading += kCellM / 6 *
                 (edge.alignment.curvature_at(from_m) + 4 * edge.alignment.curvature_at(from_m + 0.5 * kCellM) +
                  edge.alignment.curvature_at(m));
      headings.push_back(static_cast<float>(heading));
      from_m = m;
    }
  }
  for (const auto& landmark : map_->landmarks) {
    if (landmark.kind == track::LandmarkKind::balise && map_->edge(landmark.edge) != nullptr) {
      balises_[landmark.edge - 1].push_back(&landmark);
    }
  }
  std::vector<bool> used(map_->edges.size(), false);
  for (const auto& edge : map_->edges) {
    if (!used[edge.id - 1]) add_chain({&edge, true}, used);
  }
}

double NetworkIndex::heading_on(const track::Edge& edge, double offset_m) const {
  const auto& headings = headings_[edge.id - 1];
  const double cell = std::clamp(offset_m / kCellM, 0.0, static_cast<double>(headings.size()) - 1.0);
  const size_t i = std::min(static_cast<size_t>(cell), headings.size() >= 2 ? headings.size() - 2 : 0);
  if (headings.size() < 2) return 0;
  return headings[i] + (cell - static_cast<double>(i)) * (headings[i + 1] - headings[i]);
}

void NetworkIndex::add_chain(const track::Run& first, std::vector<bool>& used) {
  std::deque<track::Run> runs{first};
  used[first.edge->id - 1] = true;
  for (const bool ahead : {true, false}) {
    while (true) {
      const track::Run end = ahead ? runs.back() : runs.front().reversed();
      const auto& next = ways_.after(end);
      if (next.empty() || used[next.front().edge->id - 1]) break;
      const auto& back = ways_.after(next.front().reversed());
      if (back.empty() || !(back.front() == end.reversed())) break;
      used[next.front().edge->id - 1] = true;
      ahead ? runs.push_back(next.front()) : runs.push_front(next.front().reversed());
    }
  }
  Chain chain;
  double heading = 0;
  for (const auto& run : runs) {
    chain.legs.push_back({run, chain.length_m});
    const double end_m = chain.length_m + run.length_m();
    for (double m = kCellM * static_cast<double>(chain.heading_rad.size()); m < end_m; m += kCellM) {
      chain.heading_rad.push_back(static_cast<float>(heading + turned(*this, run, m - chain.length_m)));
    }
    heading += turned(*this, run, run.length_m());
    chain.length_m = end_m;
  }
  chains_.push_back(std::move(chain));
}

void NetworkLocator::move(double way_m, double turn_rad, double turn_sigma_rad) {
  if (way_m <= 0) {
    if (way_m < -1) forget();
    return;
  }
  open_.turn_rad += turn_rad;
  open_.variance += turn_sigma_rad * turn_sigma_rad;
  open_m_ += way_m;
  if (open_m_ < kBinM) return;
  // What is too much belongs to the next bin, with its share of the turn.
  const double over_m = std::fmod(open_m_, kBinM);
  const double share = std::min(1.0, over_m / way_m);
  Bin next;
  next.turn_rad = share * turn_rad;
  next.variance = share * turn_sigma_rad * turn_sigma_rad;
  open_.turn_rad -= next.turn_rad;
  open_.variance = std::max(0.0, open_.variance - next.variance);
  for (const double balise_m : open_.balises_m) {
    if (balise_m >= kBinM) next.balises_m.push_back(balise_m - kBinM);
  }
  std::erase_if(open_.balises_m, [](double m) { return m >= kBinM; });
  bins_.push_back(std::move(open_));
  open_ = std::move(next);
  open_m_ = over_m;
  if (way_m > 2 * kBinM) forget();  // a gap
  while (static_cast<double>(bins_.size()) * kBinM > parameters_.window_m) bins_.pop_front();
}

void NetworkLocator::sight(const Sighting& sighting) {
  if (sighting.kind != track::LandmarkKind::balise) return;
  open_.balises_m.push_back(open_m_ + sighting.distance_ahead_m);
}

void NetworkLocator::forget() {
  bins_.clear();
  open_ = {};
  open_m_ = 0;
}

struct NetworkLocator::Walk {
  track::Run run;
  double into_m = 0;
  double turn_rad = 0;  // of the present step
  double log = 0;
  double squared = 0;
  double start_into_m = 0;  // of the present step, on start
  track::Run start;
};

struct NetworkLocator::Fit {
  track::Run run;
  double into_m = 0;
  double log = 0;
  double misfit = 0;
  double scale = 1;
};

// The stretches that bend most unevenly, apart from each other.
std::vector<size_t> NetworkLocator::uneven_stretches(size_t bins) const {
  std::vector<double> uneven(bins_.size(), 0);
  for (size_t i = 1; i < bins_.size(); ++i) uneven[i] = std::abs(bins_[i].turn_rad - bins_[i - 1].turn_rad);
  std::vector<double> sums;
  for (size_t i = 0; i + bins <= bins_.size(); ++i) {
    sums.push_back(std::accumulate(uneven.begin() + static_cast<std::ptrdiff_t>(i),
                                   uneven.begin() + static_cast<std::ptrdiff_t>(i + bins), 0.0));
  }
  std::vector<size_t> chosen;
  for (int k = 0; k < kMostWindows && !sums.empty(); ++k) {
    const auto best = std::max_element(sums.begin(), sums.end());
    if (*best <= 0) break;
    const auto at = static_cast<size_t>(best - sums.begin());
    chosen.push_back(at);
    for (size_t i = at > bins ? at - bins : 0; i < std::min(sums.size(), at + bins); ++i) sums[i] = 0;
  }
  return chosen;
}

// A place is found to a cell or two, and the scale moves the ends: where the curvature changes that makes a difference.
NetworkLocator::Window NetworkLocator::window_at(size_t first_bin, size_t segment_bins, size_t segments) const {
  Window window{first_bin, segment_bins, std::vector<double>(segments, 0), std::vector<double>(segments, 0)};
  for (size_t k = 0; k < segments; ++k) {
    const size_t from = first_bin + k * segment_bins;
    double low = INFINITY;
    double high = -INFINITY;
    for (size_t i = from > 0 ? from - 1 : 0; i < std::min(bins_.size(), from + segment_bins + 1); ++i) {
      low = std::min(low, bins_[i].turn_rad / kBinM);
      high = std::max(high, bins_[i].turn_rad / kBinM);
    }
    for (size_t i = from; i < from + segment_bins; ++i) window.turns[k] += bins_[i].turn_rad;
    window.tolerances[k] =
        kCoarseTurnRad + kCoarseShiftM * (high - low) + 2 * parameters_.curvature_share * std::abs(window.turns[k]);
  }
  return window;
}

std::vector<NetworkLocator::Candidate> NetworkLocator::coarse(size_t segment_bins, size_t segments) const {
  std::vector<Candidate> candidates;
  for (const size_t first_bin : uneven_stretches(segment_bins * segments)) {
    const Window window = window_at(first_bin, segment_bins, segments);
    std::vector<Candidate> found;
    for (const auto& chain : index_->chains()) {
      for (const bool forward : {true, false}) {
        if (found.size() <= kPlainCandidates) coarse_on(chain, forward, window, found);
      }
    }
    // One window may run over the diverging way of a switch, which no chain has: others count too.
    if (found.size() <= kPlainCandidates) candidates.insert(candidates.end(), found.begin(), found.end());
  }
  return candidates;
}

void NetworkLocator::coarse_on(const NetworkIndex::Chain& chain, bool forward, const Window& window,
                               std::vector<Candidate>& found) const {
  const auto& turns = window.turns;
  const auto& tolerances = window.tolerances;
  const auto cells =
      static_cast<std::ptrdiff_t>(static_cast<double>(window.segment_bins) * kBinM / NetworkIndex::kCellM);
  const auto reach = cells * std::ssize(turns);
  const auto size = std::ssize(chain.heading_rad);
  if (size <= reach) return;
  // The segment that turns most tells most.
  std::vector<size_t> order(turns.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return std::abs(turns[a]) - tolerances[a] > std::abs(turns[b]) - tolerances[b];
  });
  const float* heading = chain.heading_rad.data();
  const std::ptrdiff_t sign = forward ? 1 : -1;
  std::ptrdiff_t last = -10;
  for (std::ptrdiff_t i = forward ? 0 : reach; i < (forward ? size - reach : size); ++i) {
    double squared = 0;
    bool fits = true;
    for (const size_t k : order) {
      const float* from = heading + i + sign * cells * static_cast<std::ptrdiff_t>(k);
      const double error = static_cast<double>(from[sign * cells] - from[0]) - turns[k];
      fits = std::abs(error) < tolerances[k];
      if (!fits) break;
      squared += error * error / (tolerances[k] * tolerances[k]);
    }
    if (!fits) continue;
    // Neighbouring cells are one place: the best of them is kept.
    if (i - last <= 2 && !found.empty()) {
      if (squared >= found.back().squared) {
        last = i;
        continue;
      }
      found.pop_back();
    }
    last = i;
    const double place_m = NetworkIndex::kCellM * static_cast<double>(i);
    const auto after = std::upper_bound(chain.legs.begin(), chain.legs.end(), place_m,
                                        [](double m, const NetworkIndex::Leg& leg) { return m < leg.begin_m; });
    const auto& leg = *(after - 1);
    const double into_m = place_m - leg.begin_m;
    found.push_back({forward ? leg.run : leg.run.reversed(), forward ? into_m : leg.run.length_m() - into_m,
                     window.first_bin, squared});
  }
}

// One step of the way, with all ways at switches; negative = backwards in time.
void NetworkLocator::step(const Walk& from, double way_m, std::vector<Walk>& to, int depth) const {
  const double end_m = from.into_m + way_m;
  const double length_m = from.run.length_m();
  if (end_m >= 0 && end_m <= length_m) {
    to.push_back(from);
    to.back().into_m = end_m;
    to.back().turn_rad += turned(*index_, from.run, end_m) - turned(*index_, from.run, from.into_m);
    return;
  }
  if (depth == 0) return;
  const double border_m = way_m > 0 ? length_m : 0.0;
  const double turn = turned(*index_, from.run, border_m) - turned(*index_, from.run, from.into_m);
  const auto go_on = [&](const track::Run& run) {
    Walk next = from;
    next.turn_rad += turn;
    next.run = run;
    next.into_m = way_m > 0 ? 0.0 : run.length_m();
    step(next, way_m - (border_m - from.into_m), to, depth - 1);
  };
  if (way_m > 0) {
    for (const auto& run : index_->ways().after(from.run)) go_on(run);
  } else {
    for (const auto& run : index_->ways().before(from.run)) go_on(run);
  }
}

// Roughly: a shift and a scale that nobody looked for yet make errors where the curvature changes.
void NetworkLocator::weigh(Walk& walk, size_t at, const Trial& trial, double rough_m) const {
  const Bin& bin = bins_[at];
  const double noise = parameters_.noise_per_m * kBinM;
  const double rough = parameters_.curvature_share * walk.turn_rad;
  const double before = bins_[at > 0 ? at - 1 : 0].turn_rad;
  const double after = bins_[std::min(at + 1, bins_.size() - 1)].turn_rad;
  const double change = std::max(std::abs(bin.turn_rad - before), std::abs(after - bin.turn_rad)) * rough_m / kBinM;
  const double variance = bin.variance + noise * noise + rough * rough + change * change;
  const double error = bin.turn_rad - walk.turn_rad;
  const double squared = error * error / variance;
  walk.squared += squared;
  walk.log -=
      0.5 * (std::min(squared, kMostSquared) + std::log(variance / (noise * noise))) / parameters_.correlated_bins;
  for (const double balise_m : bin.balises_m) {
    // On the run of the step's beginning, or where it ended.
    double density = parameters_.false_per_m;
    for (const bool at_start : {true, false}) {
      const track::Run& run = at_start ? walk.start : walk.run;
      if (!at_start && walk.run == walk.start) break;
      const double into_m =
          at_start ? walk.start_into_m + trial.scale * balise_m : walk.into_m - trial.scale * (kBinM - balise_m);
      const double offset_m = run.forward ? into_m : run.length_m() - into_m;
      for (const auto* mapped : index_->balises_on(*run.edge)) {
        const double z = (mapped->offset_m - offset_m) / kBaliseSigmaM;
        if (std::abs(z) < 6) density += parameters_.detection * std::exp(-0.5 * z * z) / (kBaliseSigmaM * 2.5066);
      }
    }
    walk.log += std::log(std::min(density, 1.0));
  }
}

std::vector<NetworkLocator::Walk> NetworkLocator::walk(const Candidate& candidate, const Trial& trial,
                                                       double least_log) const {
  const auto prune = [&](std::vector<Walk>& walks) {
    std::erase_if(walks, [&](const Walk& w) { return w.log < least_log; });
    std::sort(walks.begin(), walks.end(), [](const Walk& a, const Walk& b) { return a.log > b.log; });
    if (walks.size() > kMostWalks) walks.resize(kMostWalks);
  };
  const auto go = [&](std::vector<Walk> walks, size_t bin, bool ahead) {
    const double from_anchor_m = kBinM * std::abs(static_cast<double>(bin) - static_cast<double>(candidate.bin));
    const double rough_m = trial.rough ? kCoarseShiftM + parameters_.scale_range * from_anchor_m : 0.0;
    std::vector<Walk> next;
    for (Walk& w : walks) {
      w.turn_rad = 0;
      const size_t first = next.size();
      step(w, (ahead ? 1 : -1) * trial.scale * kBinM, next, kMostRunsAStep);
      for (size_t i = first; i < next.size(); ++i) {
        next[i].start = ahead ? w.run : next[i].run;
        next[i].start_into_m = ahead ? w.into_m : next[i].into_m;
        // Behind the anchor the step was taken backwards: its turn counts the other way round.
        if (!ahead) next[i].turn_rad = -next[i].turn_rad;
        const Walk end = next[i];
        if (!ahead) {
          next[i].run = w.run;
          next[i].into_m = w.into_m;
        }
        weigh(next[i], bin, trial, rough_m);
        next[i].run = end.run;
        next[i].into_m = end.into_m;
      }
    }
    prune(next);
    return next;
  };
  std::vector<Walk> moved;
  step({candidate.run, candidate.into_m, 0, 0, 0, 0, {}}, trial.shift_m, moved, kMostRunsAStep);
  std::vector<Walk> best;
  for (Walk& anchor : moved) {
    anchor.log = anchor.squared = anchor.turn_rad = 0;
    // How well the way behind the anchor fits counts for every way ahead of it.
    std::vector<Walk> behind{anchor};
    for (size_t i = candidate.bin; i > 0 && !behind.empty(); --i) behind = go(std::move(behind), i - 1, false);
    if (behind.empty()) continue;
    anchor.log = behind.front().log;
    anchor.squared = behind.front().squared;
    std::vector<Walk> ahead{anchor};
    for (size_t i = candidate.bin; i < bins_.size() && !ahead.empty(); ++i) ahead = go(std::move(ahead), i, true);
    best.insert(best.end(), ahead.begin(), ahead.end());
  }
  return best;
}

void NetworkLocator::compare(const Candidate& candidate, bool fine, double& best_log, std::vector<Fit>& fits) const {
  const int shifts = fine ? 4 : 1;
  const double shift_step_m = fine ? 5.0 : 15.0;
  const int scales = fine ? 4 : 2;
  for (int a = -shifts; a <= shifts; ++a) {
    for (int b = -scales; b <= scales; ++b) {
      const double scale = 1 + parameters_.scale_range * b / scales;
      const double below = fine ? kFarBelow : 2 * kFarBelow;
      for (const Walk& w : walk(candidate, {a * shift_step_m, scale, false}, best_log - below)) {
        best_log = std::max(best_log, w.log);
        fits.push_back({w.run, w.into_m, w.log, w.squared / static_cast<double>(bins_.size()), scale});
      }
    }
  }
}

// One rough walk each, so that only what may be the place is compared with every shift and scale.
std::vector<NetworkLocator::Candidate> NetworkLocator::screen(std::vector<Candidate> candidates) const {
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.squared < b.squared; });
  double best = -INFINITY;
  std::vector<std::pair<double, size_t>> logs;
  for (size_t i = 0; i < candidates.size(); ++i) {
    const auto walks = walk(candidates[i], {0, 1, true}, best - kFarBelow);
    if (walks.empty()) continue;
    double log = -INFINITY;
    for (const Walk& w : walks) log = std::max(log, w.log);
    best = std::max(best, log);
    logs.emplace_back(log, i);
  }
  std::sort(logs.rbegin(), logs.rend());
  std::vector<Candidate> kept;
  for (const auto& [log, i] : logs) {
    if (log > best - kFarBelow) kept.push_back(candidates[i]);
  }
  return kept;
}

Location NetworkLocator::locate() const {
  double turn = 0;
  for (const Bin& bin : bins_) turn += std::abs(bin.turn_rad);
  if (way_m() < parameters_.least_way_m || turn < parameters_.least_turn_rad) return {};
  std::vector<Candidate> candidates;
  for (const auto& shape : kWindowShapes) {
    if (candidates.empty()) candidates = screen(coarse(shape.segment_bins, shape.segments));
  }
  double best_log = -INFINITY;
  std::vector<std::pair<double, size_t>> order;
  for (size_t i = 0; i < candidates.size(); ++i) {
    std::vector<Fit> fits;
    compare(candidates[i], false, best_log, fits);
    double best = -INFINITY;
    for (const Fit& fit : fits) best = std::max(best, fit.log);
    if (!fits.empty()) order.emplace_back(-best, i);
  }
  std::sort(order.begin(), order.end());
  std::vector<Fit> fits;
  double fine_log = best_log;
  for (const auto& [log, i] : order) {
    if (-log < best_log - 2 * kFarBelow) break;
    compare(candidates[i], true, fine_log, fits);
  }
  Location location = sum_up(fits);
  location.candidates = candidates.size();
  return location;
}

// The body of a car turns up to a bogie distance behind the foot: which leg was taken shows only further on.
bool NetworkLocator::just_behind_switch(const track::EdgePosition& place) const {
  track::Run run{index_->map().edge(place.edge), place.direction != track::Direction::reverse};
  double into_m = run.forward ? place.offset_m : run.length_m() - place.offset_m;
  while (into_m < kSettledM) {
    const auto before = index_->ways().before(run);
    if (before.empty()) return false;
    for (const auto& from : before) {
      if (index_->ways().after(from).size() > 1) return true;
    }
    run = before.front();
    into_m += run.length_m();
  }
  return false;
}

Location NetworkLocator::sum_up(const std::vector<Fit>& fits) const {
  Location location;
  struct Group {
    Fit best;
    double weight = 0;
    double mean_m = 0;
    double square = 0;
  };
  std::vector<Group> groups;
  double most = -INFINITY;
  for (const Fit& fit : fits) most = std::max(most, fit.log);
  for (const Fit& fit : fits) {
    const double weight = std::exp(fit.log - most);
    if (weight < 1e-9) continue;
    const auto same = std::find_if(groups.begin(), groups.end(), [&](const Group& g) {
      return g.best.run == fit.run && std::abs(g.best.into_m - fit.into_m) < kSamePlaceM;
    });
    Group& group = same != groups.end() ? *same : groups.emplace_back(Group{fit, 0, 0, 0});
    const double off_m = fit.into_m - group.best.into_m;
    group.mean_m += weight * off_m;
    group.square += weight * off_m * off_m;
    group.weight += weight;
    if (fit.log > group.best.log) {
      // Moments stay those about the old best place: shift them.
      group.mean_m -= group.weight * off_m;
      group.square += group.weight * off_m * off_m - 2 * off_m * (group.mean_m + group.weight * off_m);
      group.best = fit;
    }
  }
  double sum = 0;
  for (const Group& g : groups) sum += g.weight;
  for (const Group& g : groups) {
    const double mean_m = g.mean_m / g.weight;
    const double sigma_m = std::sqrt(std::max(0.0, g.square / g.weight - mean_m * mean_m));
    // On from the last whole bin, and from where the body turns to the foot in front of it.
    Walk here;
    here.run = g.best.run;
    here.into_m = std::clamp(g.best.into_m + mean_m, 0.0, g.best.run.length_m());
    std::vector<Walk> there;
    step(here, g.best.scale * open_m_ + 0.5 * parameters_.lag_m, there, kMostRunsAStep);
    if (!there.empty()) here = there.front();
    location.places.push_back({{here.run.edge->id, here.run.forward ? here.into_m : here.run.length_m() - here.into_m,
                                here.run.forward ? track::Direction::forward : track::Direction::reverse},
                               g.weight / sum,
                               std::hypot(sigma_m, kLeastSigmaM, parameters_.lag_m / std::sqrt(12.0)),
                               g.best.scale,
                               g.best.misfit});
  }
  std::sort(location.places.begin(), location.places.end(),
            [](const LocatedPlace& a, const LocatedPlace& b) { return a.probability > b.probability; });
  if (location.places.empty()) return location;
  const auto pose_of = [&](const LocatedPlace& p) {
    auto pose = index_->map().edge(p.place.edge)->alignment.at(p.place.offset_m).pose;
    if (p.place.direction == track::Direction::reverse) pose.heading_rad += core::kPi;
    return pose;
  };
  const auto& first = location.places.front();
  const auto at = pose_of(first);
  for (const auto& place : location.places) {
    const auto pose = pose_of(place);
    const bool beside = std::hypot(pose.easting_m - at.easting_m, pose.northing_m - at.northing_m) < kBesideM &&
                        std::abs(core::wrap_pi(pose.heading_rad - at.heading_rad)) < 0.3;
    if (beside) location.place_probability += place.probability;
  }
  const bool good = first.misfit < parameters_.certain_misfit;
  location.place_certain = good && location.place_probability >= parameters_.certain;
  location.certain = good && first.probability >= parameters_.certain && !just_behind_switch(first.place);
  return location;
}

}  // namespace railfix::map_matcher
