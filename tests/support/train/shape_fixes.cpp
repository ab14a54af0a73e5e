#include "support/train/shape_fixes.hpp"

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

ShapeFixes::ShapeFixes(const TrainSimulation& simulation)
    : simulation_(simulation),
      ways_(*simulation.map),
      random_(simulation.stream_of(17)),
      bias_per_m_(kBiasPerM * random_.normal()) {}

bool ShapeFixes::follow(const fusion::TrainEstimate& state) {
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
    matcher_->change_path(path_);
    place_m_ = path_->distance_of(state.position.edge, state.position.offset_m).value_or(place_m_);
    return true;
  }
  path_ = path_of(simulation_.map, state.position);
  matcher_.emplace(map_matcher::CurvatureParameters{}, path_);
  place_m_ = 0;
  return true;
}

void ShapeFixes::look(double arrival_s, const Motion& truth) {
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
  if (faulty && fault.kind == FaultKind::dropout) return;
  matcher_->add(chain_.odometer_m(), seen_per_m, kSigmaPerM, CurvatureOf::rails);
}

std::optional<fusion::FixInput> ShapeFixes::match(int64_t stamp_ns, const fusion::TrainEstimate& state) {
  if (std::abs(chain_.odometer_m() - matched_m_) < kMatchEveryM) return std::nullopt;
  matched_m_ = chain_.odometer_m();
  const map_matcher::Prior prior{place_m_, state.over_m, state.under_m, state.distance_m};
  const auto fix = matcher_->match(stamp_ns, chain_.odometer_m(), prior);
  if (!fix) return std::nullopt;
  const auto place = path_->position_at(fix->path_distance_m);
  return fusion::FixInput{
      stamp_ns,        place.edge, place.offset_m, fix->sigma_m, fix->probability, 0, fusion::FixKind::curvature,
      place.direction, nullptr};
}

std::optional<fusion::FixInput> ShapeFixes::see(const fusion::OdometryInput& step, const fusion::TrainEstimate& state,
                                                double arrival_s) {
  chain_.add({step.stamp_ns, step.reference_stamp_ns, step.valid, step.step_m, 0, 0, std::nan(""), state.speed_mps});
  if (follow(state) && !chain_.broken()) {
    if (std::abs(state.speed_mps) > kLeastSpeedMps) look(arrival_s, simulation_.truth_at(step.stamp_ns, arrival_s));
    const auto& fault = simulation_.plan().fault;
    const bool late = fault.is(Sensor::shape, FaultKind::delay) && fault.active(arrival_s);
    if (auto fix = match(step.stamp_ns, state))
      found_.emplace_back(arrival_s + (late ? fault.size : 0), std::move(*fix));
  } else if (matcher_) {
    matcher_->forget();
  }
  if (found_.empty() || found_.front().first > arrival_s) return std::nullopt;
  auto due = std::move(found_.front().second);
  found_.pop_front();
  return due;
}

}  // namespace railfix::train
