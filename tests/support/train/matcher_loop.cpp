#include "support/train/matcher_loop.hpp"

#include <cmath>

namespace railfix::train {
namespace {

using map_matcher::CurvatureOf;

// As map_matcher has them by default.
constexpr double kMatchEveryM = 5;
constexpr double kLeastSpeedMps = 1;
constexpr double kTurnSigmaRad = 2e-4;  // of a step
constexpr double kLostS = 5;
constexpr double kOldStateS = map_matcher::FollowedPath::kOldStateS;

map_matcher::PlacedTrain placed(const fusion::TrainEstimate& state) {
  return {state.stamp_ns, state.position, state.speed_mps, state.distance_m, state.over_m, state.under_m};
}

}  // namespace

MatcherLoop::MatcherLoop(const TrainSimulation& simulation)
    : simulation_(simulation),
      followed_(simulation.map, std::make_shared<const track::Ways>(*simulation.map)),
      search_({}, simulation.map),
      random_(simulation.stream_of(17)),
      seen_(simulation, random_) {}

bool MatcherLoop::follow(const fusion::TrainEstimate& state) {
  using Way = map_matcher::FollowedPath::Way;
  if (!state.track_known) {
    followed_.forget();
    return false;
  }
  const Way way = core::value_or_throw(followed_.follow(placed(state)));
  if (way == Way::same) return true;
  const auto& path = followed_.path();
  if (way == Way::other_path) {
    shape_->change_path(path);
    landmarks_->change_path(path);
  } else {
    shape_.emplace(map_matcher::CurvatureParameters{}, path);
    landmarks_.emplace(map_matcher::LandmarkParameters{}, path);
  }
  return true;
}

void MatcherLoop::look(double arrival_s, const Motion& truth) {
  const auto seen_per_m = seen_.look(truth.distance_m, truth.distance_m, arrival_s);
  if (seen_per_m) shape_->add(shape_m(), *seen_per_m, SeenShape::kSigmaPerM, CurvatureOf::rails);
}

void MatcherLoop::found(const map_matcher::Fix& fix, fusion::FixKind kind, double due_s) {
  const auto place = followed_.path()->position_at(fix.path_distance_m);
  found_.emplace_back(
      due_s, fusion::FixInput{fix.stamp_ns, place.edge, place.offset_m, fix.sigma_m, fix.probability, fix.landmark,
                              kind, place.direction, nullptr, static_cast<fusion::SightingsFit>(fix.sightings_fit)});
}

void MatcherLoop::match_shape(int64_t stamp_ns, const fusion::TrainEstimate& state, double arrival_s) {
  if (std::abs(shape_m() - matched_m_) < kMatchEveryM) return;
  matched_m_ = shape_m();
  const auto prior = followed_.prior_at(stamp_ns, placed(state));
  const auto fix = prior ? shape_->match(stamp_ns, shape_m(), *prior) : std::nullopt;
  if (!fix) return;
  const auto& fault = simulation_.plan().fault;
  const bool late = fault.is(Sensor::shape, FaultKind::delay) && fault.active(arrival_s);
  found(*fix, fusion::FixKind::curvature, arrival_s + (late ? fault.size : 0));
}

void MatcherLoop::match_sightings(const fusion::TrainEstimate& state, double arrival_s) {
  const auto& all = simulation_.sightings;
  for (; next_sighting_ < all.size() && all[next_sighting_].arrival_s <= arrival_s; ++next_sighting_) {
    const auto& sighting = all[next_sighting_].sighting;
    search_.sight(sighting);
    const auto prior = state.track_known ? followed_.prior_at(sighting.stamp_ns, placed(state)) : std::nullopt;
    const auto fix = prior ? landmarks_->add(sighting, *prior) : std::nullopt;
    if (fix) found(*fix, fusion::FixKind::landmark, arrival_s);
    if (prior) doubt_place(state, arrival_s);
  }
}

// As map_matcher does it, with the turning of the camera or, where that is blind, of a gyro. Where no start was told
// the plan says when the place is found.
void MatcherLoop::look_for_place(const fusion::OdometryInput& step, const fusion::TrainEstimate& state,
                                 double arrival_s) {
  const double since_s = core::seconds(step.stamp_ns - std::exchange(moved_ns_, step.stamp_ns));
  const double way_m = chain_.odometer_m() - std::exchange(moved_m_, chain_.odometer_m());
  const bool position = state.track_known && state.integrity != fusion::Integrity::unusable;
  if (position || !simulation_.plan().start_told) return;
  std::optional<map_matcher::Turn> turn;
  if (since_s > 0 && since_s < kLostS && std::isfinite(state.speed_mps)) {
    const double moved_m = chain_.broken() ? state.speed_mps * since_s : way_m;
    const auto truth = simulation_.pictured_at(step.stamp_ns, arrival_s);
    const double turn_rad = (simulation_.curvature_at(truth.distance_m, arrival_s) + seen_.bias_per_m()) * moved_m;
    turn = {moved_m, turn_rad + kTurnSigmaRad * random_.normal(), kTurnSigmaRad};
  }
  const auto places = search_.move(turn);
  if (!places.empty()) found(places.front(), fusion::FixKind::network, step.stamp_ns, arrival_s);
}

void MatcherLoop::hear(const fusion::GnssInput& gnss, double arrival_s) {
  if (!search_.searches() || gnss.fix == 0 || !std::isfinite(state_->speed_mps)) return;
  const double since_s = core::seconds(gnss.stamp_ns - state_->stamp_ns);
  const double odometer_m = state_->distance_m + state_->speed_mps * since_s;
  const auto place = search_.hear({gnss.easting_m, gnss.northing_m, gnss.hdop}, odometer_m, state_->speed_mps);
  if (place) found(*place, fusion::FixKind::gnss, gnss.stamp_ns, arrival_s);
}

void MatcherLoop::found(const map_matcher::LocatedPlace& located, fusion::FixKind kind, int64_t stamp_ns,
                        double due_s) {
  const auto& place = located.place;
  found_.emplace_back(due_s, fusion::FixInput{stamp_ns, place.edge, place.offset_m, located.sigma_m,
                                              located.probability, 0, kind, place.direction, nullptr});
}

// As map_matcher says it, with a track of which only the rest is believed.
void MatcherLoop::doubt_place(const fusion::TrainEstimate& state, double due_s) {
  const bool gnss = !search_.of_gnss() && (state.sources & 1U << static_cast<unsigned>(fusion::Source::gnss)) != 0;
  const double elsewhere = landmarks_->place_doubt();
  if (gnss || elsewhere == 0) return;
  const auto& place = state.position;
  found_.emplace_back(
      due_s, fusion::FixInput{state.stamp_ns, place.edge, place.offset_m, INFINITY, 1 - elsewhere, 0,
                              fusion::FixKind::track, place.direction, nullptr, fusion::SightingsFit::nowhere});
}

std::vector<fusion::FixInput> MatcherLoop::see(const fusion::OdometryInput& step, const fusion::TrainEstimate& state,
                                               double arrival_s) {
  chain_.add({step.stamp_ns, step.reference_stamp_ns, step.valid, step.step_m, 0, 0, std::nan(""), state.speed_mps});
  state_ = state;
  search_.follow(state.track_known, state.integrity != fusion::Integrity::unusable);
  const bool placed = follow(state);
  look_for_place(step, state, arrival_s);
  match_sightings(state, arrival_s);
  if (!placed || !simulation_.plan().shape) return due_now(arrival_s);
  if (chain_.broken()) {
    shape_in_the_dark(step.stamp_ns, state);
  } else {
    shaped_ns_ = step.stamp_ns;
    if (std::abs(state.speed_mps) > kLeastSpeedMps) look(arrival_s, simulation_.pictured_at(step.stamp_ns, arrival_s));
  }
  match_shape(step.stamp_ns, state, arrival_s);
  return due_now(arrival_s);
}

// As map_matcher does it.
void MatcherLoop::shape_in_the_dark(int64_t stamp_ns, const fusion::TrainEstimate& state) {
  const double since_s = core::seconds(stamp_ns - shaped_ns_);
  if (std::abs(since_s) < kOldStateS && since_s <= 0) return;
  auto turn = std::abs(since_s) < kOldStateS && std::isfinite(state.speed_mps) ? gyro_.between(shaped_ns_, stamp_ns)
                                                                               : std::nullopt;
  shaped_ns_ = stamp_ns;
  if (!turn) {
    shape_->forget();
    return;
  }
  turn->way_m = state.speed_mps * since_s;
  unseen_m_ += turn->way_m;
  if (std::abs(state.speed_mps) > kLeastSpeedMps) shape_->add(shape_m(), *turn);
}

std::vector<fusion::FixInput> MatcherLoop::run_on(const fusion::TrainEstimate& state, double arrival_s) {
  if (stands_since_ns_ != 0 && state.standstill) gyro_.stood(stands_since_ns_, state.stamp_ns);
  stands_since_ns_ = state.standstill ? state.stamp_ns : 0;
  if (simulation_.plan().camera || !simulation_.plan().shape) return {};
  state_ = state;
  if (!follow(state)) return {};
  shape_in_the_dark(state.stamp_ns, state);
  match_shape(state.stamp_ns, state, arrival_s);
  return due_now(arrival_s);
}

std::vector<fusion::FixInput> MatcherLoop::due_now(double arrival_s) {
  std::vector<fusion::FixInput> due;
  std::erase_if(found_, [&](auto& one) {
    if (one.first > arrival_s) return false;
    due.push_back(std::move(one.second));
    return true;
  });
  return due;
}

}  // namespace railfix::train
