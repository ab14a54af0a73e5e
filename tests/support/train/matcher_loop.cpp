#include "support/train/matcher_loop.hpp"

#include <cmath>

namespace railfix::train {
namespace {

using map_matcher::CurvatureOf;

constexpr double kPathAheadM = 20000;
constexpr double kPathBehindM = 1000;
constexpr double kPathLeftM = 3000;
// As map_matcher has them by default.
constexpr double kMatchEveryM = 5;
constexpr double kLeastSpeedMps = 1;
constexpr double kOldStateS = 2;
// Curvature from pictures: 9e-5 1/m rms where a sigma of 1.4e-4 is said (docs/figures.md, 26 km at 8 degrees).
constexpr double kSigmaPerM = 1.4e-4;
constexpr double kWhitePerM = 7e-5;
constexpr double kWanderPerM = 5e-5;
constexpr double kWanderLengthM = 20;
constexpr double kBiasPerM = 2e-5;
constexpr double kOutlierPerM = 2e-3;

std::shared_ptr<const track::Path> path_of(const std::shared_ptr<const track::Map>& map,
                                           const track::EdgePosition& place) {
  return std::make_shared<const track::Path>(
      core::value_or_throw(track::Path::follow(map, place, kPathAheadM, kPathBehindM)));
}

}  // namespace

MatcherLoop::MatcherLoop(const TrainSimulation& simulation)
    : simulation_(simulation),
      ways_(*simulation.map),
      random_(simulation.stream_of(17)),
      bias_per_m_(kBiasPerM * random_.normal()) {}

bool MatcherLoop::follow(const fusion::TrainEstimate& state) {
  if (!state.track_known) return false;
  const auto place_m = path_ ? path_->distance_of(state.position.edge, state.position.offset_m) : std::nullopt;
  if (place_m && path_->end_m() - *place_m > std::min(kPathLeftM, 0.5 * path_->end_m())) {
    place_m_ = *place_m;
    return true;
  }
  auto way = path_ && !place_m ? track::rerouted(*path_, ways_, state.position, place_m_, kPathAheadM, kPathBehindM)
                               : std::nullopt;
  if (way) {
    path_ = std::make_shared<const track::Path>(std::move(*way));
    shape_->change_path(path_);
    landmarks_->change_path(path_);
    place_m_ = path_->distance_of(state.position.edge, state.position.offset_m).value_or(place_m_);
    return true;
  }
  path_ = path_of(simulation_.map, state.position);
  shape_.emplace(map_matcher::CurvatureParameters{}, path_);
  landmarks_.emplace(map_matcher::LandmarkParameters{}, path_);
  place_m_ = 0;
  return true;
}

void MatcherLoop::look(double arrival_s, const Motion& truth) {
  const auto& fault = simulation_.plan().fault;
  const bool faulty = fault.sensor == Sensor::shape && fault.active(arrival_s);
  const double way_m = std::abs(truth.distance_m - looked_m_);
  looked_m_ = truth.distance_m;
  const double keep = std::exp(-way_m / kWanderLengthM);
  wander_per_m_ = keep * wander_per_m_ + std::sqrt(1 - keep * keep) * kWanderPerM * random_.normal();
  const double times = faulty && fault.kind == FaultKind::noise ? fault.size : 1;
  double seen_per_m = simulation_.curvature_at(truth.distance_m, arrival_s) + bias_per_m_ +
                      times * (wander_per_m_ + kWhitePerM * random_.normal());
  const bool wild = random_.uniform() < 0.3;
  if (fault.is(Sensor::shape, FaultKind::drift)) seen_per_m += fault.size * fault.progress(arrival_s);
  if (faulty && fault.kind == FaultKind::outliers && wild) seen_per_m += kOutlierPerM;
  if (faulty && fault.kind == FaultKind::stuck) seen_per_m = *(stuck_per_m_ = stuck_per_m_.value_or(seen_per_m));
  if (!simulation_.sees(arrival_s) || (faulty && fault.kind == FaultKind::dropout)) return;
  shape_->add(chain_.odometer_m(), seen_per_m, kSigmaPerM, CurvatureOf::rails);
}

map_matcher::Prior MatcherLoop::prior_at(int64_t stamp_ns, const fusion::TrainEstimate& state) const {
  const double dt_s = core::seconds(stamp_ns - state.stamp_ns);
  const double way_m = std::isnan(state.speed_mps) ? 0.0 : state.speed_mps * dt_s;
  return {place_m_ + way_m, state.over_m, state.under_m, state.distance_m + way_m};
}

void MatcherLoop::found(const map_matcher::Fix& fix, fusion::FixKind kind, double due_s) {
  const auto place = path_->position_at(fix.path_distance_m);
  found_.emplace_back(due_s, fusion::FixInput{fix.stamp_ns, place.edge, place.offset_m, fix.sigma_m, fix.probability,
                                              fix.landmark, kind, place.direction, nullptr});
}

void MatcherLoop::match_shape(int64_t stamp_ns, const fusion::TrainEstimate& state, double arrival_s) {
  if (std::abs(chain_.odometer_m() - matched_m_) < kMatchEveryM) return;
  matched_m_ = chain_.odometer_m();
  const auto fix = shape_->match(stamp_ns, chain_.odometer_m(), prior_at(stamp_ns, state));
  if (!fix) return;
  const auto& fault = simulation_.plan().fault;
  const bool late = fault.is(Sensor::shape, FaultKind::delay) && fault.active(arrival_s);
  found(*fix, fusion::FixKind::curvature, arrival_s + (late ? fault.size : 0));
}

void MatcherLoop::match_sightings(const fusion::TrainEstimate& state, double arrival_s) {
  const auto& all = simulation_.sightings;
  for (; next_sighting_ < all.size() && all[next_sighting_].arrival_s <= arrival_s; ++next_sighting_) {
    const auto& sighting = all[next_sighting_].sighting;
    if (!state.track_known || std::abs(core::seconds(sighting.stamp_ns - state.stamp_ns)) > kOldStateS) continue;
    const auto fix = landmarks_->add(sighting, prior_at(sighting.stamp_ns, state));
    if (fix) found(*fix, fusion::FixKind::landmark, arrival_s);
  }
}

std::vector<fusion::FixInput> MatcherLoop::see(const fusion::OdometryInput& step, const fusion::TrainEstimate& state,
                                               double arrival_s) {
  chain_.add({step.stamp_ns, step.reference_stamp_ns, step.valid, step.step_m, 0, 0, std::nan(""), state.speed_mps});
  const bool placed = follow(state);
  match_sightings(state, arrival_s);
  if (placed && !chain_.broken() && simulation_.plan().shape) {
    if (std::abs(state.speed_mps) > kLeastSpeedMps) look(arrival_s, simulation_.truth_at(step.stamp_ns, arrival_s));
    match_shape(step.stamp_ns, state, arrival_s);
  } else if (shape_) {
    shape_->forget();
  }
  std::vector<fusion::FixInput> due;
  std::erase_if(found_, [&](auto& one) {
    if (one.first > arrival_s) return false;
    due.push_back(std::move(one.second));
    return true;
  });
  return due;
}

}  // namespace railfix::train
