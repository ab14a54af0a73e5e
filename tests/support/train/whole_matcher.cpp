#include "support/train/whole_matcher.hpp"

#include <cmath>
#include <utility>

#include "fusion/fusion_messages.hpp"
#include "map_matcher/matcher_messages.hpp"

namespace railfix::train {
namespace {

constexpr double kViewAheadM = 3.5;  // of a view whose curvature is as vague as SeenShape says
constexpr double kSlowestViewMps = 1;

}  // namespace

WholeMatcher::WholeMatcher(const TrainSimulation& simulation)
    : simulation_(simulation),
      matcher_({}, simulation.map),
      random_(simulation.stream_of(17)),
      seen_(simulation, random_) {}

template <class Input>
void WholeMatcher::give(const Input& input) {
  if (has_sense(input)) say(matcher_.add(input));
}

void WholeMatcher::say(const map_matcher::PlaceFixes& fixes) {
  for (const auto& fix : fixes) found_.push_back(fusion::input_of(map_matcher::message_of(*simulation_.map, fix)));
}

void WholeMatcher::feel(const fusion::ImuInput& sample) {
  const map_matcher::GyroInput input{sample.rate_z_rps, sample.stamp_ns};
  if (has_sense(input)) matcher_.add(input);
}

void WholeMatcher::hear(const fusion::GnssInput& gnss, double /*arrival_s*/) {
  if (gnss.fix != 0 && matcher_.wants_gnss())
    give(map_matcher::GnssInput{gnss.easting_m, gnss.northing_m, gnss.hdop, gnss.stamp_ns});
}

// A view shows the middle of what is seen.
void WholeMatcher::look(const fusion::OdometryInput& step, double speed_mps, double arrival_s) {
  const auto& fault = simulation_.plan().fault;
  const bool late = fault.is(Sensor::shape, FaultKind::delay) && fault.active(arrival_s);
  if (std::abs(speed_mps) > kSlowestViewMps) {
    const double foot_m = simulation_.pictured_at(step.stamp_ns, arrival_s).distance_m;
    const auto seen_per_m = seen_.look(foot_m, foot_m + kViewAheadM, arrival_s);
    const double variance = SeenShape::kSigmaPerM * SeenShape::kSigmaPerM;
    if (seen_per_m)
      views_.emplace_back(arrival_s + (late ? fault.size : 0),
                          map_matcher::ViewInput{*seen_per_m, variance, step.stamp_ns});
  }
  for (; !views_.empty() && views_.front().first <= arrival_s; views_.pop_front()) matcher_.add(views_.front().second);
}

// As odometry counts: from one picture to the next, or on from the key frame.
map_matcher::StepInput WholeMatcher::counted(const fusion::OdometryInput& step, double speed_mps) {
  if (step.valid) {
    const bool same_frame = last_ && last_->reference_stamp_ns == step.reference_stamp_ns;
    counted_m_ += step.step_m - (same_frame ? last_->step_m : 0);
    last_ = step;
  }
  return {.stamp_ns = step.stamp_ns,
          .reference_stamp_ns = step.reference_stamp_ns,
          .measured = step.valid,
          .step_m = step.step_m,
          .yaw_rad = step.yaw_rad,
          .yaw_sigma_rad = step.yaw_sigma_rad,
          .distance_m = counted_m_,
          .speed_mps = speed_mps};
}

std::vector<fusion::FixInput> WholeMatcher::see(const fusion::OdometryInput& step, const fusion::TrainEstimate& state,
                                                double arrival_s) {
  if (simulation_.plan().shape) look(step, state.speed_mps, arrival_s);
  const auto& all = simulation_.sightings;
  for (; next_sighting_ < all.size() && all[next_sighting_].arrival_s <= arrival_s; ++next_sighting_)
    give(all[next_sighting_].sighting);
  give(counted(step, state.speed_mps));
  return run_on(state, arrival_s);
}

std::vector<fusion::FixInput> WholeMatcher::run_on(const fusion::TrainEstimate& state, double /*arrival_s*/) {
  const auto input = map_matcher::input_of(fusion::message_of(state));
  if (!input.track_known || has_sense(input)) say(matcher_.add(input));
  return found();
}

}  // namespace railfix::train
