#include "map_matcher/locate/network_locator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/units.hpp"
#include "map_matcher/locate/way_comparison.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kSettledM = 100.0;  // behind a switch
constexpr double kLeastSigmaM = 3.0;
constexpr size_t kAnewBins = 50;
constexpr size_t kSettledBins = 2;       // a train that rolls back, and late sightings, change no more
constexpr double kWorstMisfit = 7.0;     // over 200 m
constexpr double kMostOfRange = 1.1;     // of the odometer's scale
constexpr double kLeastEvidence = 20.0;  // that the track is on the map at all, a log

}  // namespace

std::string to_string(Doubt doubt) {
  constexpr std::array<const char*, 9> kTexts = {"certain",
                                                 "the way is too short or bends too little",
                                                 "more places may fit than were compared",
                                                 "no place fits to the noise",
                                                 "a track that is not on the map would fit by chance",
                                                 "several places fit",
                                                 "the place along the track is vague",
                                                 "not which of the tracks beside each other",
                                                 "not which leg of the switch behind"};
  return kTexts.at(static_cast<size_t>(doubt));
}

void NetworkLocator::move(double way_m, double turn_rad, double turn_sigma_rad) {
  for (auto& [run, filter] : searches_) {
    run.move(way_m, turn_rad, turn_sigma_rad);
    // What was taken back stays in the filter: another one begins.
    if (filter && filter->taken_bins() > run.end_bin()) filter.reset();
  }
}

void NetworkLocator::sight(const Sighting& sighting) {
  if (!is_mark(sighting.kind)) return;
  for (auto& search : searches_) search.run.sight(sighting);
}

void NetworkLocator::prepare() {
  Search& search = searches_[leading()];
  const MeasuredRun& run = search.run;
  const size_t taken_bins = search.filter ? search.filter->taken_bins() : run.gone_bins();
  if (!run.at_front() || run.end_bin() < taken_bins + PlaceFilter::kBlockBins + kSettledBins) return;
  // A train that shunts would begin anew each time that it has come back.
  if (!search.filter && std::exchange(begun_, true)) return;
  MeasuredWay way = run.way();
  way.resize(way.size() - kSettledBins);
  follow(search, way);
}

void NetworkLocator::forget() {
  for (auto& [run, filter] : searches_) {
    run.clear();
    filter.reset();
  }
}

size_t NetworkLocator::leading() const {
  const auto bins = [](const MeasuredRun& run) { return run.at_front() ? run.bins() : 0; };
  return bins(searches_[1].run) > bins(searches_[0].run) ? 1 : 0;
}

double NetworkLocator::way_m() const {
  const MeasuredRun& run = searches_[leading()].run;
  return run.at_front() ? static_cast<double>(run.bins()) * kBinM : 0.0;
}

// A filter that began long ago may have been led astray by what is not on the map, and one that was not asked for long
// lacks what the way has forgotten: another one begins.
void NetworkLocator::follow(Search& search, const MeasuredWay& way) const {
  auto& filter = search.filter;
  const size_t gone_bins = search.run.gone_bins();
  const auto most_bins = static_cast<size_t>(parameters_.window_m / kBinM);
  if (!filter) {
    filter.emplace(parameters_, *index_, gone_bins);
  } else if (filter->lost() || filter->overflowed() || filter->first_bin() + most_bins < gone_bins ||
             filter->taken_bins() < gone_bins) {
    filter.emplace(parameters_, *index_, gone_bins + way.size() - std::min(way.size(), kAnewBins));
  }
  filter->advance(way, gone_bins);
}

Location NetworkLocator::locate() {
  Search& search = searches_[leading()];
  const MeasuredRun& run = search.run;
  if (!run.at_front()) return {};
  const MeasuredWay way = run.way();
  begun_ = false;
  follow(search, way);
  const PlaceFilter& filter = *search.filter;
  double turn = 0;
  for (const MeasuredBin& bin : way) turn += std::abs(bin.turn_rad);
  if (way_m() < parameters_.least_way_m || turn < parameters_.least_turn_rad) return {};
  const TurnModel model(parameters_, way);
  const auto candidates = filter.candidates(run.gone_bins());
  const auto compared = WayComparison(model, *index_).compare(candidates);
  Location location = sum_up(compared.fits, run);
  location.candidates = candidates.size();
  location.doubt = doubt_of(location, !filter.overflowed() && compared.complete, filter.evidence());
  if (run.ahead()) return location;
  // Found in the direction of the run: its front looks the other way.
  for (auto& found : location.places) {
    found.place.direction = track::run_of(index_->map(), found.place).reversed().direction();
  }
  return location;
}

Doubt NetworkLocator::doubt_of(const Location& location, bool complete, double evidence) const {
  if (!complete || location.places.empty()) return Doubt::not_all_seen;
  const LocatedPlace& best = location.places.front();
  const bool scaled = std::abs(best.scale - 1) < kMostOfRange * parameters_.scale_range;
  if (best.misfit >= parameters_.most_misfit() || best.worst_misfit >= kWorstMisfit || !scaled) return Doubt::misfit;
  // Where the map is drawn more roughly than the noise says, what is not on it fits as well as that more easily.
  const double rough = best.misfit < parameters_.certain_misfit ? 1 : std::max(1.0, best.misfit);
  if (evidence < kLeastEvidence * rough * rough) return Doubt::by_chance;
  if (location.place_probability < parameters_.certain) return Doubt::alike;
  if (best.sigma_m >= parameters_.certain_sigma_m) return Doubt::wide;
  if (best.probability < parameters_.certain) return Doubt::beside;
  return just_behind_switch(best) ? Doubt::near_switch : Doubt::none;
}

// On from the last whole bin.
LocatedPlace NetworkLocator::place_of(const WayFit& fit, const MeasuredRun& run) const {
  const auto here = place_on(fit.runs, fit.end_m + fit.scale * run.open_m());
  return {here.run.at(here.into_m),
          0,
          std::hypot(fit.sigma_m, kLeastSigmaM, parameters_.lag_m / std::sqrt(12.0)),
          fit.scale,
          fit.misfit,
          fit.worst_misfit};
}

// The body of a car turns up to a bogie distance behind the foot: which leg was taken shows only further on.
bool NetworkLocator::just_behind_switch(const LocatedPlace& place) const {
  track::Run run = track::run_of(index_->map(), place.place);
  double into_m = run.into_m(place.place.offset_m);
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

Location NetworkLocator::sum_up(const std::vector<WayFit>& fits, const MeasuredRun& run) const {
  Location location;
  if (fits.empty()) return location;
  const WayFit& best = best_of(fits);
  // As much as the best one is further off than the noise says, the others are, too.
  const double per_log = 1 / std::max(1.0, best.misfit);
  double sum = 0;
  for (const WayFit& fit : fits) {
    location.places.push_back(place_of(fit, run));
    location.places.back().probability = std::exp(per_log * (fit.log_evidence - best.log_evidence));
    sum += location.places.back().probability;
  }
  for (auto& place : location.places) place.probability /= sum;
  std::erase_if(location.places, [](const LocatedPlace& p) { return p.probability < 1e-9; });
  std::sort(location.places.begin(), location.places.end(),
            [](const LocatedPlace& a, const LocatedPlace& b) { return a.probability > b.probability; });
  location.place_probability = beside_probability(location.places);
  return location;
}

// Of the best place and those on tracks beside it.
double NetworkLocator::beside_probability(const std::vector<LocatedPlace>& places) const {
  const auto pose_of = [&](const LocatedPlace& p) {
    const auto run = track::run_of(index_->map(), p.place);
    return run.pose_at(run.into_m(p.place.offset_m));
  };
  const auto at = pose_of(places.front());
  double sum = 0;
  for (const auto& place : places) {
    const auto pose = pose_of(place);
    const bool beside = std::hypot(pose.easting_m - at.easting_m, pose.northing_m - at.northing_m) < kBesideM &&
                        std::abs(core::wrap_pi(pose.heading_rad - at.heading_rad)) < kParallelRad;
    if (beside) sum += place.probability;
  }
  return sum;
}

}  // namespace railfix::map_matcher
