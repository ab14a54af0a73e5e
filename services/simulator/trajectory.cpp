#include "simulator/trajectory.hpp"

#include <algorithm>
#include <cmath>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"

namespace railfix::simulator {
namespace {

// Longest run with these rates that ends at this time; the speed stays below the cruise when the time is short.
double length_for(const RunOptions& run) {
  const double moving_s = std::max(0.0, run.duration_s - 2.0 * run.dwell_s - (run.stop_at_m > 0.0 ? run.stop_s : 0.0));
  const double ramps_s = run.cruise_mps / run.accelerate_mps2 + run.cruise_mps / run.brake_mps2;
  if (moving_s >= ramps_s) return run.cruise_mps * (moving_s - 0.5 * ramps_s);
  const double top_mps = run.cruise_mps * moving_s / ramps_s;
  return 0.5 * top_mps * moving_s;
}

}  // namespace

Trajectory::Trajectory(std::shared_ptr<const Line> line, const RunOptions& run, const geometry::CameraPose& mount,
                       const ShakeOptions& shake, uint64_t seed)
    : line_(std::move(line)), run_(run), mount_(mount), shake_(shake) {
  const double wanted_m = run_.length_m > 0.0 ? run_.length_m : length_for(run_);
  const double length_m = std::min(wanted_m, line_->path().end_m());
  phases_.push_back({0.0, 0.0, 0.0, 0.0});
  phase(run_.dwell_s, 0.0);
  if (run_.stop_at_m > 0.0 && run_.stop_at_m < length_m) {
    leg(run_.stop_at_m, run_.cruise_mps);
    phase(run_.stop_s, 0.0);
    leg(length_m - run_.stop_at_m, run_.cruise_mps);
  } else {
    leg(length_m, run_.cruise_mps);
  }
  phase(run_.dwell_s, 0.0);

  const double rattle = shake.scale > 0.0 ? shake.rattle_rad : 0.0;
  rattle_ = {
      {{2.0 * core::kPi * shake.rattle_hz, 0.3, rattle}, {2.0 * core::kPi * 1.37 * shake.rattle_hz, 1.9, rattle}}};
  core::Random random(seed ^ 0x5A5A5A5AULL);
  const double sigmas[5] = {shake.roll_rad, shake.pitch_rad, shake.yaw_rad, shake.lateral_m, shake.height_m};
  for (int axis = 0; axis < 5; ++axis) waves_[axis] = ShakeWaves(shake.scale * sigmas[axis], random);
}

void Trajectory::phase(double duration_s, double acceleration_mps2) {
  phases_.back().acceleration_mps2 = acceleration_mps2;
  const Phase last = phases_.back();
  duration_s_ = last.begin_s + duration_s;
  const double speed = last.speed_mps + acceleration_mps2 * duration_s;
  phases_.push_back({duration_s_, last.distance_m + 0.5 * (last.speed_mps + speed) * duration_s,
                     std::abs(speed) < 1e-9 ? 0.0 : speed, 0.0});
}

void Trajectory::leg(double length_m, double cruise_mps) {
  if (length_m <= 0.0) return;  // no time is left between the dwells: the train stands
  const double per_speed2 = 0.5 / run_.accelerate_mps2 + 0.5 / run_.brake_mps2;
  const double top_mps = std::min(cruise_mps, std::sqrt(length_m / per_speed2));
  phase(top_mps / run_.accelerate_mps2, run_.accelerate_mps2);
  phase((length_m - top_mps * top_mps * per_speed2) / top_mps, 0.0);
  phase(top_mps / run_.brake_mps2, -run_.brake_mps2);
}

Motion Trajectory::motion(double time_s) const {
  const auto after =
      std::upper_bound(phases_.begin(), phases_.end(), time_s, [](double t, const Phase& p) { return t < p.begin_s; });
  const Phase& now = after == phases_.begin() ? phases_.front() : *std::prev(after);
  const double dt = std::max(0.0, time_s - now.begin_s);
  return {now.distance_m + (now.speed_mps + 0.5 * now.acceleration_mps2 * dt) * dt,
          now.speed_mps + now.acceleration_mps2 * dt, now.acceleration_mps2};
}

geometry::CameraPose Trajectory::shake(double time_s) const {
  const double speed_mps = motion(time_s).speed_mps;
  const double envelope = speed_mps / kShakeSpeedMps;
  double values[5];
  for (int axis = 0; axis < 5; ++axis) values[axis] = waves_[axis].at(time_s, speed_mps);
  for (const auto& wave : rattle_)
    values[1] += envelope * wave.amplitude * std::sin(wave.rate_rps * time_s + wave.phase_rad);
  return {values[0], values[1], values[2], values[3], values[4]};
}

dataset::TruthRow Trajectory::truth(double time_s) const {
  const Motion now = motion(time_s);
  const auto track = line_->path().at(now.distance_m);
  const auto moved = shake(time_s);
  dataset::TruthRow row;
  row.stamp_ns = run_.begin_ns + core::to_ns(time_s);
  row.distance_m = now.distance_m;
  row.speed_mps = now.speed_mps;
  row.acceleration_mps2 = now.acceleration_mps2;
  row.camera = {mount_.roll_rad + moved.roll_rad, mount_.pitch_rad + moved.pitch_rad, mount_.yaw_rad + moved.yaw_rad,
                mount_.lateral_m + moved.lateral_m, mount_.height_m + moved.height_m};
  if (shake_.knock_at_s > 0.0 && time_s >= shake_.knock_at_s) {
    row.camera.pitch_rad += shake_.knock_pitch_rad;
    row.camera.yaw_rad += shake_.knock_yaw_rad;
  }
  row.curvature_per_m = track.curvature_per_m;
  row.vertical_curvature_per_m = track.vertical_curvature_per_m;
  row.easting_m = track.pose.easting_m;
  row.northing_m = track.pose.northing_m;
  row.heading_rad = track.pose.heading_rad;
  return row;
}

}  // namespace railfix::simulator
