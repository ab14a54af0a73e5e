#include "map_matcher/track_choice/track_chooser.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "map_matcher/inputs.hpp"
#include "map_matcher/track_choice/picture_fits.hpp"
#include "track/declared.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kLostM = 60.0;  // afterwards the window is right and the routes are not
constexpr double kTurnRoundM = 0.3;
constexpr double kFarFromWindowM = 200;
constexpr double kMostWindowM = 300;
constexpr double kSamePlaceM = 1.0;
constexpr double kAtEndM = 0.5;
constexpr double kNoLagShare = 0.3;      // of the cars
constexpr double kViewNoisePerM = 3e-4;  // least sigma of a picture's curvature
constexpr double kApartM = 2.5;          // tracks further apart than that share no rails
constexpr double kAlikeM = 3;            // along the track
constexpr double kOthersBalise = 0.01;   // chance that it is another track's all the same
constexpr double kJumpsPerS = 1e-4;      // chance that a gyro fails, far more than it does
constexpr double kJumpedBefore = 1e-3;   // ... that it had failed before
constexpr double kJumpEveryS = 2.0;      // or ...
constexpr double kJumpEveryM = 10.0;     // ... between the times at which it may have
constexpr double kWatched = 0.9;         // a begin less probable lies behind a switch that nobody watched

double apart_m(const track::Map& map, const track::EdgePosition& a, const track::EdgePosition& b) {
  const auto at = [&](const track::EdgePosition& p) { return map.edge(p.edge)->alignment.at(p.offset_m).pose; };
  return std::hypot(at(a).easting_m - at(b).easting_m, at(a).northing_m - at(b).northing_m);
}

/// Of places, best first, the furthest to either side that are not the best one; without the last ones, which are not
/// worth saying as long as they are so improbable together.
std::vector<TrackOption> furthest_places(std::vector<TrackOption> places) {
  double neglected = 0;
  while (places.size() > 1 && (neglected += places.back().probability) < 1 - track::kDeclaredProbability)
    places.pop_back();
  const auto [least, most] =
      std::ranges::minmax_element(places, {}, [](const TrackOption& option) { return option.place.offset_m; });
  std::vector<TrackOption> furthest;
  for (const auto& one : {least, most}) {
    if (one != places.begin()) furthest.push_back(*one);
  }
  return furthest;
}

}  // namespace

void TrackChooser::start(const TrackWindow& window) {
  hypotheses_.clear();
  pending_ = {};
  lost_m_ = moved_back_m_ = 0;
  place_m_ = 0;
  watched_s_ = INFINITY;
  sure_m_.reset();
  window_ = window;
  hypotheses_.push_back({track::Route(track::run_of(*map_, window.place), window.place.offset_m, 0),
                         0,
                         {0, std::log(parameters_.astray)},
                         {}});
  forwards_ = window.forwards;
  guess_nothing();
  open_ways_behind();
  cells_m_ = first_m();
  for (auto& hypothesis : hypotheses_) extend_behind(hypothesis.route);
  fit_cells();
  extend();
}

void TrackChooser::follow(const TrackWindow& window) {
  TrackWindow wanted = window;
  wanted.over_m = std::clamp(window.over_m, 0.0, kMostWindowM);
  wanted.under_m = std::clamp(window.under_m, 0.0, kMostWindowM);
  // Where ways of different length lead there fusion is on the one that it was on before.
  std::optional<double> found;
  for (const auto& hypothesis : hypotheses_) {
    auto place_m = hypothesis.route.distance_of(window.place, place_m_);
    if (!place_m) continue;
    // At the end of its track fusion stays; the train may be on another one, and has gone on.
    const double end_m = forwards_ ? hypothesis.route.end_m() : hypothesis.route.begin_m();
    if (std::abs(*place_m - end_m) < kAtEndM && (forwards_ ? place_m_ > end_m : place_m_ < end_m)) place_m = place_m_;
    if (std::abs(*place_m - place_m_) > kFarFromWindowM) continue;
    if (!found || std::abs(*place_m - place_m_) < std::abs(*found - place_m_)) found = place_m;
  }
  // While no leg is declared fusion goes on along the straight one, which may have been given up here. Where not even
  // the begin is known nothing is lost.
  const auto is_known = [&] {
    const auto chosen = choice();
    return chosen && chosen->known;
  };
  if (!found && lost_m_ > kLostM && told_ >= kWatched && stands_near(window.place) && !is_known()) lost_m_ = 0;
  if (hypotheses_.empty() || (!found && lost_m_ > kLostM)) {
    start(wanted);
    return;
  }
  // A window on a track that was given up is followed on the one that is left.
  if (found) {
    place_m_ = *found;
    lost_m_ = 0;
  }
  window_ = wanted;
  if (on_guess()) turn_round();
}

bool TrackChooser::on_guess() const {
  return forwards_ ? place_m_ < guessed_m_ : place_m_ > guessed_m_;
}

bool TrackChooser::stands_near(const track::EdgePosition& place) const {
  if (hypotheses_.empty()) return false;
  return apart_m(*map_, hypotheses_.front().route.position_at(place_m_), place) < kFarFromWindowM;
}

void TrackChooser::move(const Turn& turn) {
  if (hypotheses_.empty() || !has_sense(turn)) return;
  if (turn.sensor != sensor_) {
    if (pending_.way_m != 0) use_pending();
    sensor_ = turn.sensor;
    for (auto& hypothesis : hypotheses_) {
      for (auto& cell : hypothesis.cells) cell.begin_sensor();
    }
    watched_s_ = INFINITY;
  }
  run(turn.way_m);
  pending_.way_m += turn.way_m;
  pending_.turn_rad += turn.turn_rad;
  pending_.variance += turn.sigma_rad * turn.sigma_rad;
  pending_.bias_rad += turn.bias_rad;
  pending_.bias_walk += turn.bias_walk;
  pending_.duration_s += turn.duration_s;
  pending_.jump_rad += turn.jump_rad;
  if (std::abs(pending_.way_m) >= parameters_.bin_m) use_pending();
}

// A train that rocks a little has not turned round, but what was guessed of its way must not be told.
void TrackChooser::run(double way_m) {
  place_m_ += way_m;
  lost_m_ += std::abs(way_m);
  moved_back_m_ = std::max(0.0, moved_back_m_ - (forwards_ ? way_m : -way_m));
  if (moved_back_m_ > kTurnRoundM || on_guess()) turn_round();
  run_pictures(way_m);
}

void TrackChooser::stand(const Turn& turn) {
  if (turn.sensor != sensor_ || !has_sense(turn) || !(turn.sigma_rad > 0)) return;
  const BinTurn stood{
      0, turn.turn_rad, turn.sigma_rad * turn.sigma_rad, turn.bias_rad, turn.bias_walk, turn.duration_s, turn.jump_rad};
  watch_for_jump(stood);
  for (auto& hypothesis : hypotheses_) {
    for (auto& cell : hypothesis.cells) weigh_stand(cell, stood, parameters_);
  }
}

void TrackChooser::move_blind(double way_m) {
  if (hypotheses_.empty() || !has_sense(Turn{way_m})) return;
  cells_m_ += pending_.way_m + way_m;
  pending_ = {};
  watched_s_ = INFINITY;
  run(way_m);
  for (auto& hypothesis : hypotheses_) {
    spread(hypothesis.cells, way_m);
    for (auto& cell : hypothesis.cells) cell.forget(TurnErrors::sway);
  }
  trim();
  merge();
  extend();
  fit_cells();
}

void TrackChooser::use_pending() {
  const BinTurn bin = pending_;
  pending_ = {};
  cells_m_ += bin.way_m;
  trim();
  extend();
  fit_cells();
  watch_for_jump(bin);
  for (auto& hypothesis : hypotheses_) {
    spread(hypothesis.cells, bin.way_m);
    weigh_turn(hypothesis.cells, cells_m_, hypothesis.route, bin, parameters_);
  }
  merge();
  prune();
}

// Before it was looked to for the first time, or while it said nothing, nobody has watched the sensor. The least likely
// of the jumps that are followed makes room.
void TrackChooser::watch_for_jump(const BinTurn& bin) {
  watched_s_ += bin.duration_s;
  watched_m_ += std::abs(bin.way_m);
  if (!(bin.jump_rad > 0) || (watched_s_ < kJumpEveryS && watched_m_ < kJumpEveryM)) return;
  const double chance = std::isinf(watched_s_) ? kJumpedBefore : kJumpsPerS * watched_s_;
  std::array<double, TurnCell::kFits> logs;
  logs.fill(-INFINITY);
  for (const auto& hypothesis : hypotheses_) {
    for (const auto& cell : hypothesis.cells) {
      for (size_t i = 0; i < logs.size(); ++i) logs[i] = log_sum(logs[i], cell.fits[i].log_weight);
    }
  }
  const auto fit = static_cast<size_t>(std::min_element(logs.begin() + 1, logs.end()) - logs.begin());
  for (auto& hypothesis : hypotheses_) {
    for (auto& cell : hypothesis.cells) begin_jump(cell, fit, bin, chance);
  }
  watched_s_ = watched_m_ = 0;
}

// The cells cover where the train can be; new ones at the ends know no more than their neighbours.
void TrackChooser::fit_cells() {
  const auto ahead = static_cast<int>(std::floor((first_m() - cells_m_) / kCellM));
  cells_m_ += kCellM * ahead;
  const auto count = static_cast<size_t>(std::ceil((last_m() - cells_m_) / kCellM)) + 1;
  for (auto& hypothesis : hypotheses_) {
    auto& cells = hypothesis.cells;
    if (cells.empty()) cells.emplace_back();
    if (ahead > 0) {
      cells.erase(cells.begin(), cells.begin() + std::min<std::ptrdiff_t>(ahead, std::ssize(cells) - 1));
    } else if (ahead < 0) {
      cells.insert(cells.begin(), static_cast<size_t>(-ahead), cells.front());
    }
    cells.resize(count, cells.back());
  }
}

// Of the train at a place: as fusion says, and up to the lag further back for the turning. Many cars do not lag at all.
double TrackChooser::log_of_place(double place_m) const {
  const double off_m = place_m - place_m_;
  const double beyond_m = off_m > 0 ? off_m : std::min(0.0, off_m + parameters_.lag_m);
  const double sigma_m = std::hypot(window_.sigma_m, parameters_.map_sigma_m);
  const auto bell = [&](double m) { return -0.5 * m * m / (sigma_m * sigma_m); };
  const double at_once = kNoLagShare / (1 - kNoLagShare) * parameters_.lag_m / (2.5 * sigma_m);
  return log_sum(bell(beyond_m), std::log(at_once + 1e-9) + bell(off_m));
}

double TrackChooser::evidence(const Hypothesis& hypothesis) const {
  return hypothesis.log_prior + log_sum(hypothesis.pictures.own, hypothesis.pictures.astray) + of_turning(hypothesis);
}

double TrackChooser::of_turning(const Hypothesis& hypothesis) const {
  std::vector<double> logs;
  logs.reserve(hypothesis.cells.size());
  double prior = 0;
  for (size_t i = 0; i < hypothesis.cells.size(); ++i) {
    const double of_place = log_of_place(cells_m_ + kCellM * static_cast<double>(i));
    logs.push_back(hypothesis.cells[i].log_weight() + of_place);
    prior += std::exp(of_place);
  }
  const double most = *std::max_element(logs.begin(), logs.end());
  double sum = 0;
  for (const double log : logs) sum += std::exp(log - most);
  return most + std::log(sum / std::max(prior, 1e-300));
}

// Astray, the pictures show one of the other ways.
void TrackChooser::use_picture(const std::vector<double>& log_fits) {
  for (size_t i = 0; i < hypotheses_.size(); ++i) {
    double other = -INFINITY;
    for (size_t k = 0; k < log_fits.size(); ++k) {
      if (k != i) other = std::max(other, log_fits[k]);
    }
    hypotheses_[i].pictures.own += log_fits[i];
    hypotheses_[i].pictures.astray += other;
  }
}

// A detector goes astray and comes back, as often as `astray` and `astray_m` say.
void TrackChooser::run_pictures(double way_m) {
  seen_m_ += std::abs(way_m);
  const double back = std::min(0.5, std::abs(way_m) / parameters_.astray_m);
  const double away = back * parameters_.astray / (1 - parameters_.astray);
  for (auto& [route, prior, pictures, cells] : hypotheses_) {
    pictures = {log_sum(pictures.own + std::log(1 - away), pictures.astray + std::log(back)),
                log_sum(pictures.own + std::log(away), pictures.astray + std::log(1 - back))};
  }
}

void TrackChooser::sight(const Sighting& sighting) {
  if (hypotheses_.size() < 2 || !has_sense(sighting)) return;
  const SightedOnRoute seen{sighting, place_m_ + sighting.distance_ahead_m,
                            std::hypot(sighting.sigma_m, window_.sigma_m, parameters_.map_sigma_m)};
  std::vector<double> fits;
  for (const auto& hypothesis : hypotheses_)
    fits.push_back(std::log(sighting_fits(*map_, hypothesis.route, seen, parameters_)));
  const bool below_train =
      sighting.kind == track::LandmarkKind::balise && lies_in_track(sighting.kind, sighting.lateral_m);
  if (!below_train || !are_apart_at(seen.at_m)) {
    use_picture(fits);
  } else if (!sure_m_ || std::abs(seen.at_m - *sure_m_) > kOneThingM) {
    sure_m_ = seen.at_m;
    use_sure(fits);
  }
  prune();
}

double TrackChooser::share_of(const track::Landmark& landmark) const {
  std::optional<double> at_m;
  for (const auto& hypothesis : hypotheses_) {
    if (!at_m) at_m = hypothesis.route.distance_of({landmark.edge, landmark.offset_m}, place_m_);
  }
  if (!at_m || hypotheses_.size() < 2) return 1;
  double with = -INFINITY;
  double all = -INFINITY;
  for (const auto& hypothesis : hypotheses_) {
    const double log = evidence(hypothesis);
    all = log_sum(all, log);
    if (has_one_at(*map_, hypothesis.route, landmark.kind, *at_m, kAlikeM)) with = log_sum(with, log);
  }
  return std::exp(with - all);
}

bool TrackChooser::are_apart_at(double at_m) const {
  std::map<uint32_t, track::EdgePosition> tracks;
  for (const auto& hypothesis : hypotheses_) {
    const auto place = hypothesis.route.position_at(at_m);
    tracks.try_emplace(place.edge, place);
  }
  for (auto one = tracks.begin(); one != tracks.end(); ++one) {
    for (auto other = std::next(one); other != tracks.end(); ++other) {
      if (apart_m(*map_, one->second, other->second) < kApartM) return false;
    }
  }
  return true;
}

// Whether the detector is astray or not.
void TrackChooser::use_sure(const std::vector<double>& log_fits) {
  const double most = *std::ranges::max_element(log_fits);
  for (size_t i = 0; i < hypotheses_.size(); ++i) {
    const double fit = log_sum(log_fits[i] + std::log(1 - kOthersBalise), most + std::log(kOthersBalise));
    hypotheses_[i].pictures.own += fit;
    hypotheses_[i].pictures.astray += fit;
  }
}

void TrackChooser::see(double curvature_per_m, double sigma_per_m) {
  if (hypotheses_.size() < 2 || seen_m_ < parameters_.bin_m) return;
  if (!has_sense(ViewInput{curvature_per_m, sigma_per_m * sigma_per_m})) return;
  seen_m_ = 0;
  const double sigma = std::hypot(sigma_per_m, kViewNoisePerM);
  std::vector<double> fits;
  const ViewedCurvature view{curvature_per_m, sigma, place_m_ - window_.over_m - 2, last_m()};
  for (const auto& hypothesis : hypotheses_) fits.push_back(view_fits(hypothesis.route, view, parameters_));
  use_picture(fits);
}

std::optional<TrackChoice> TrackChooser::choice() const {
  if (hypotheses_.empty()) return std::nullopt;
  if (hypotheses_.size() == 1) {
    return TrackChoice{
        {{hypotheses_.front().route.position_at(place_m_), told_}}, {}, told_ >= track::kDeclaredProbability};
  }
  const auto tracks = weigh_tracks();
  if (tracks.empty()) return std::nullopt;
  TrackChoice choice;
  for (const auto& track : tracks) choice.options.push_back({track.places.front().place, track.probability});
  choice.elsewhere = furthest_places(tracks.front().places);
  choice.known = choice.options.front().probability >= track::kDeclaredProbability;
  return choice;
}

std::vector<TrackChooser::WeighedTrack> TrackChooser::weigh_tracks() const {
  struct Place {
    track::EdgePosition place;
    double log = -INFINITY;
  };
  struct Track {
    std::vector<Place> places;
    double log = -INFINITY;
  };
  std::map<std::pair<uint32_t, track::Direction>, Track> tracks;
  double all = -INFINITY;
  for (const auto& hypothesis : hypotheses_) {
    const double log = evidence(hypothesis);
    all = log_sum(all, log);
    // On a track that has ended the train is nowhere on the map.
    if (forwards_ ? hypothesis.route.end_m() < first_m() : hypothesis.route.begin_m() > last_m()) continue;
    const auto place = hypothesis.route.position_at(place_m_);
    auto& [places, sum] = tracks[{place.edge, place.direction}];
    const auto known = std::ranges::find_if(
        places, [&](const Place& other) { return std::abs(other.place.offset_m - place.offset_m) < kSamePlaceM; });
    auto& mine = known == places.end() ? places.emplace_back(Place{place}) : *known;
    mine.log = log_sum(mine.log, log);
    sum = log_sum(sum, log);
  }
  std::vector<Track> sorted;
  for (auto& [edge, track] : tracks) {
    std::ranges::sort(track.places, std::ranges::greater{}, &Place::log);
    sorted.push_back(std::move(track));
  }
  std::ranges::stable_sort(sorted, std::ranges::greater{}, &Track::log);
  const auto probability = [&](double log) { return told_ * std::exp(log - all); };
  std::vector<WeighedTrack> weighed;
  for (const auto& track : sorted) {
    auto& [places, sum] = weighed.emplace_back();
    for (const auto& place : track.places) places.push_back({place.place, probability(place.log)});
    sum = probability(track.log);
  }
  return weighed;
}

}  // namespace railfix::map_matcher
