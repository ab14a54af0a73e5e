#include "map_matcher/network_locator.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "map_matcher/place_search.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kFarBelow = 25.0;  // a way whose log likelihood is so far below the best one is given up
constexpr size_t kMostFitted = 400;
constexpr size_t kLookEvery = 50;
constexpr double kAlikeBelow = 8.0;
constexpr std::ptrdiff_t kMostAlike = 25;
constexpr double kRivalBelow = 15.0;
constexpr WayWalker::Trial kRoughly{20.0, 0.02, 4};
constexpr WayWalker::Trial kExactly{8.0, 0.001, 8};
constexpr size_t kMostTried = 12;
constexpr int kFirstHalvings = 1;
constexpr int kHalvings = 3;
constexpr double kSamePlaceM = 60.0;
constexpr double kRepeatedM = 45.0;
constexpr double kBesideM = 40.0;
constexpr double kSettledM = 100.0;  // behind a switch
constexpr double kLeastSigmaM = 3.0;

bool same_way(const WayFit& a, const WayFit& b) {
  const auto at = place_on(a.runs, a.end_m);
  const auto other = place_on(b.runs, b.end_m);
  return at.run == other.run && std::abs(at.into_m - other.into_m) < kSamePlaceM;
}

// The better one where the place is the same.
void add(const WayFit& fit, std::vector<WayFit>& fits) {
  const auto same = std::find_if(fits.begin(), fits.end(), [&](const WayFit& f) { return same_way(f, fit); });
  if (same == fits.end()) {
    fits.push_back(fit);
  } else if (fit.log_evidence > same->log_evidence) {
    *same = fit;
  }
}

// Candidates of several windows lead to the same way: the best of them is kept. REQUIRES: best first.
void drop_repeated(std::vector<WalkedWay>& ways, size_t bins) {
  struct End {
    const WalkedWay* way;
    Candidate place;
  };
  std::vector<End> ends;
  std::vector<WalkedWay> kept;
  kept.reserve(ways.size());
  for (auto& way : ways) {
    const double ahead_m = way.scale * kBinM * static_cast<double>(bins - way.bin);
    const auto end = place_on(way.runs, way.anchor_m + ahead_m);
    const bool repeated = std::any_of(ends.begin(), ends.end(), [&](const End& e) {
      return e.place.run == end.run && std::abs(e.place.into_m - end.into_m) < kRepeatedM && e.way->runs == way.runs;
    });
    if (repeated) continue;
    kept.push_back(std::move(way));
    ends.push_back({&kept.back(), end});
  }
  ways = std::move(kept);
}

}  // namespace

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
  MeasuredBin next;
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

// Best first. Where more places fit alike than could be told apart, the rest is not looked at.
std::vector<WayFit> NetworkLocator::first_fits(const WayFitter& fitter, const std::vector<WalkedWay>& ways,
                                               bool& complete) const {
  double best = -INFINITY;
  std::vector<WayFit> fits;
  for (size_t i = 0; i < ways.size(); ++i) {
    const auto fit = fitter.fit(ways[i], kFirstHalvings, best - kFarBelow);
    if (fit) {
      best = std::max(best, fit->best_log);
      fits.push_back(*fit);
    }
    if (i % kLookEvery != kLookEvery - 1) continue;
    const auto alike =
        std::count_if(fits.begin(), fits.end(), [&](const WayFit& f) { return f.best_log > best - kAlikeBelow; });
    const auto top = std::max_element(fits.begin(), fits.end(),
                                      [](const WayFit& a, const WayFit& b) { return a.best_log < b.best_log; });
    if (alike <= kMostAlike || top->misfit > parameters_.certain_misfit) continue;
    complete = false;
    break;
  }
  std::sort(fits.begin(), fits.end(), [](const WayFit& a, const WayFit& b) { return a.best_log > b.best_log; });
  return fits;
}

// First one rough walk each; what may be the place is fitted, walked again as exactly as the fit knows it, and what
// that finds is fitted in full.
std::vector<WayFit> NetworkLocator::compare(const TurnModel& model, const std::vector<Candidate>& candidates,
                                            bool& complete) const {
  const WayWalker walker(model, *index_);
  const WayFitter fitter(model, *index_);
  double best = -INFINITY;
  std::vector<WalkedWay> rough;
  for (const Candidate& candidate : candidates) {
    for (auto& way : walker.follow(candidate, kRoughly, best - kFarBelow)) {
      best = std::max(best, way.log);
      rough.push_back(std::move(way));
    }
  }
  std::erase_if(rough, [&](const WalkedWay& w) { return w.log < best - kFarBelow; });
  std::sort(rough.begin(), rough.end(), [](const WalkedWay& a, const WalkedWay& b) { return a.log > b.log; });
  drop_repeated(rough, model.way().size());
  complete = rough.size() <= kMostFitted;
  if (!complete) rough.resize(kMostFitted);
  const auto first = first_fits(fitter, rough, complete);
  if (first.empty()) return {};
  best = first.front().best_log;
  std::vector<WayFit> fits;
  std::vector<WayFit> tried;
  double best_fit = -INFINITY;
  for (const WayFit& fit : first) {
    if (fit.best_log < best - kFarBelow) break;
    if (std::any_of(tried.begin(), tried.end(), [&](const WayFit& t) { return same_way(t, fit); })) continue;
    if (tried.size() == kMostTried) {
      complete = complete && fit.best_log < best - kRivalBelow;
      break;
    }
    tried.push_back(fit);
    Candidate anchor = place_on(fit.runs, fit.anchor_m - 0.5 * parameters_.lag_m);
    anchor.bin = fit.bin;
    anchor.scale = fit.scale;
    for (const WalkedWay& way : walker.follow(anchor, kExactly, -INFINITY)) {
      const auto full = fitter.fit(way, kHalvings, best_fit - kFarBelow);
      if (!full) continue;
      best_fit = std::max(best_fit, full->best_log);
      add(*full, fits);
    }
  }
  add_beside(walker, fitter, fits);
  return fits;
}

// The tracks beside the best place are compared too: no window needs to have found them.
void NetworkLocator::add_beside(const WayWalker& walker, const WayFitter& fitter, std::vector<WayFit>& fits) const {
  if (fits.empty()) return;
  const WayFit best = *std::max_element(
      fits.begin(), fits.end(), [](const WayFit& a, const WayFit& b) { return a.log_evidence < b.log_evidence; });
  if (best.misfit > parameters_.certain_misfit) return;
  const auto end = place_on(best.runs, best.end_m);
  for (const auto& beside : index_->beside(end.run, end.into_m, kBesideM)) {
    const double into_m = std::max(0.0, beside.into_m - 0.5 * parameters_.lag_m);
    for (const WalkedWay& way : walker.follow({beside.run, into_m, bins_.size(), best.scale, 0}, kExactly, -INFINITY)) {
      if (const auto fit = fitter.fit(way, kHalvings, best.best_log - kFarBelow)) add(*fit, fits);
    }
  }
}

Location NetworkLocator::locate() const {
  double turn = 0;
  for (const MeasuredBin& bin : bins_) turn += std::abs(bin.turn_rad);
  if (way_m() < parameters_.least_way_m || turn < parameters_.least_turn_rad) return {};
  const MeasuredWay way(bins_.begin(), bins_.end());
  const TurnModel model(parameters_, way);
  const auto found = PlaceSearch(parameters_, *index_, way).search();
  bool complete = true;
  Location location = sum_up(compare(model, found.candidates, complete));
  location.candidates = found.candidates.size();
  if (!complete || !found.complete) location.certain = location.place_certain = false;
  return location;
}

// On from the last whole bin.
LocatedPlace NetworkLocator::place_of(const WayFit& fit) const {
  const auto here = place_on(fit.runs, fit.end_m + fit.scale * open_m_);
  const double offset_m = here.run.forward ? here.into_m : here.run.length_m() - here.into_m;
  return {{here.run.edge->id, offset_m, here.run.forward ? track::Direction::forward : track::Direction::reverse},
          0,
          std::hypot(fit.sigma_m, kLeastSigmaM, parameters_.lag_m / std::sqrt(12.0)),
          fit.scale,
          fit.misfit};
}

// The body of a car turns up to a bogie distance behind the foot: which leg was taken shows only further on.
bool NetworkLocator::just_behind_switch(const LocatedPlace& place) const {
  track::Run run{index_->map().edge(place.place.edge), place.place.direction != track::Direction::reverse};
  double into_m = run.forward ? place.place.offset_m : run.length_m() - place.place.offset_m;
  while (into_m < kSettledM + 3 * place.sigma_m) {
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

Location NetworkLocator::sum_up(const std::vector<WayFit>& fits) const {
  Location location;
  double most = -INFINITY;
  double sum = 0;
  for (const WayFit& fit : fits) most = std::max(most, fit.log_evidence);
  for (const WayFit& fit : fits) {
    location.places.push_back(place_of(fit));
    location.places.back().probability = std::exp(fit.log_evidence - most);
    sum += location.places.back().probability;
  }
  for (auto& place : location.places) place.probability /= sum;
  std::erase_if(location.places, [](const LocatedPlace& p) { return p.probability < 1e-9; });
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
  const bool good = first.misfit < parameters_.certain_misfit && first.sigma_m < parameters_.certain_sigma_m;
  location.place_certain = good && location.place_probability >= parameters_.certain;
  location.certain = good && first.probability >= parameters_.certain && !just_behind_switch(first);
  return location;
}

}  // namespace railfix::map_matcher
