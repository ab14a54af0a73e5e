// From the filter to the state that is published: place on the map, interval, integrity.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string_view>

#include "core/time.hpp"
#include "fusion/estimator.hpp"

namespace railfix::fusion {
namespace {

constexpr double kRecentS = 1.0;
constexpr double kRecentPositionS = 30.0;
constexpr double kNoMotionUnusableS = 5.0;

// Operators ask since when a sensor is distrusted.
std::string since(int64_t changed_ns) {
  const int64_t second = changed_ns / 1'000'000'000 % 86'400;
  char text[32];
  std::snprintf(text, sizeof text, " since %02d:%02d:%02d UTC", static_cast<int>(second / 3600),
                static_cast<int>(second / 60 % 60), static_cast<int>(second % 60));
  return text;
}

const char* what_of(GyroWatch::Fault fault) {
  switch (fault) {
    case GyroWatch::Fault::none:
    case GyroWatch::Fault::absent:
      break;
    case GyroWatch::Fault::stuck:
      return "the IMU's gyro is stuck";
    case GyroWatch::Fault::scatters:
      return "the IMU's gyro scatters";
    case GyroWatch::Fault::contradicted:
      return "the IMU's gyro turns otherwise than the camera";
  }
  return nullptr;
}

std::string why_given_up(Against because) {
  switch (because) {
    case Against::sightings:
      return ": it was given up, what was sighted fitted the map nowhere near it";
    case Against::turning:
      return ": it was given up, the train turned otherwise than the track there";
    case Against::map_end:
      return ": it was given up, the train has run far beyond the end of the mapped track";
    case Against::fusion_before:
      break;
  }
  return ": it was given up, the fusion before this one had doubted it, and nothing has agreed since";
}

}  // namespace

// The sentences that people read on the dashboard.
void TrainEstimate::degrade(const std::string& why) {
  integrity = std::max(integrity, Integrity::degraded);
  if (!reason.empty()) reason += "; ";
  reason += why;
}

void TrainEstimate::judge_width(const FusionParameters& parameters) {
  constexpr std::string_view kWide = "interval wider than allowed";
  const double bound_m = std::max(over_m, under_m);
  const double allowed_m = parameters.allowed_m(since_sure_m);
  if (bound_m > allowed_m && reason.find(kWide) == std::string::npos) degrade(std::string(kWide));
  if (bound_m > parameters.unusable_budgets * allowed_m) integrity = Integrity::unusable;
}

TrainEstimate Estimator::estimate(const Interval& promised, double since_sure_m) const {
  const auto& filter = motion_.filter();
  const auto& path = place_.path();
  TrainEstimate e;
  e.integrity = Integrity::ok;
  e.stamp_ns = filter.stamp_ns();
  e.distance_m = motion_.distance_m();
  e.speed_mps = filter.speed_mps();
  e.acceleration_mps2 = filter.value(StateIndex::acceleration);
  e.visual_scale = filter.scale(Odometer::camera);
  e.wheel_scale = filter.scale(Odometer::wheel);
  e.since_reference_m = since_reference_m();
  e.since_sure_m = since_sure_m;
  e.reference = place_.reference();
  e.standstill = motion_.stands();
  e.track_known = path != nullptr;
  e.track_probability = path ? place_.track_doubt().probability_at(*path, filter.path_distance_m()) : 0;
  e.sigma_m = place_.sigma_m(motion_);
  locate(e);
  // The place is one on the map, the ends are where the train is: beyond the end of the map one reaches further.
  const double centre_m = path ? e.path_distance_m : e.distance_m;
  e.over_m = std::max(0.0, centre_m - promised.rear_m);
  e.under_m = std::max(0.0, promised.front_m - centre_m);
  if (!std::isfinite(centre_m + e.sigma_m + promised.rear_m + promised.front_m)) {
    e.over_m = e.under_m = std::numeric_limits<double>::infinity();
    e.degrade("the filter's numbers ran over");
  }
  judge_sensors(e);
  judge_place(e);
  judge_bounds(e);
  return e;
}

void Estimator::locate(TrainEstimate& e) const {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  e.lat_deg = e.lon_deg = e.easting_m = e.northing_m = e.heading_rad = nan;
  const auto& path = place_.path();
  if (!path) return;
  e.path = path;
  e.path_distance_m = std::clamp(motion_.filter().path_distance_m(), path->begin_m(), path->end_m());
  e.position = path->position_at(e.path_distance_m);
  const auto pose = path->at(e.path_distance_m).pose;
  e.easting_m = pose.easting_m;
  e.northing_m = pose.northing_m;
  e.heading_rad = pose.heading_rad;
  if (path->map().edge(e.position.edge)->is_drawn) return;  // a drawing lies nowhere on the Earth
  if (const auto geo = path->map().to_geo(pose.easting_m, pose.northing_m)) {
    e.lat_deg = geo->lat_deg;
    e.lon_deg = geo->lon_deg;
  }
}

void Estimator::judge_sensors(TrainEstimate& e) const {
  for (int i = 0; i < kSources; ++i) {
    const auto source = static_cast<Source>(i);
    const bool motion = std::ranges::find(kMotionSources, source) != kMotionSources.end();
    if (watch(source).used_within(motion ? kRecentS : kRecentPositionS, e.stamp_ns)) e.sources |= 1U << i;
  }

  const auto& sensors = motion_.sensors();
  const double timeout_s = parameters_->sensor_timeout_s;
  const auto& camera = sensors[Source::camera];
  if (sensors.silent(Source::camera, timeout_s)) {
    e.degrade("no camera");
  } else if (camera.isolated) {
    e.degrade("camera motion contradicts the other sensors" + since(camera.changed_ns));
  } else if (camera.seen_ns != 0 && sensors.unused_for_s(Source::camera) > timeout_s) {
    e.degrade("camera blind");
  }
  const auto& wheel = sensors[Source::wheel];
  if (sensors.silent(Source::wheel, timeout_s)) {
    e.degrade("no wheel pulses");
  } else if (wheel.isolated) {
    e.degrade("wheel slips or slides" + since(wheel.changed_ns));
  } else if (motion_.wheel_scatters()) {
    e.degrade("wheel readings scatter");
  }
  const auto& imu = sensors[Source::imu];
  if (sensors.silent(Source::imu, timeout_s)) {
    e.degrade("no IMU");
  } else if (imu.isolated) {
    e.degrade("IMU contradicts the other sensors" + since(imu.changed_ns));
  }
  const auto& gyro = motion_.gyro();
  if (const char* what = what_of(gyro.fault())) e.degrade(what + since(gyro.since_ns()));
}

void Estimator::judge_place(TrainEstimate& e) const {
  const auto& track_doubt = place_.track_doubt();
  const auto& wrong_place = place_.wrong_place();
  if (place_.gnss().isolated) e.degrade("GNSS contradicts the position" + since(place_.gnss().changed_ns));
  const bool turned_away = track_doubt.turns_otherwise() && wrong_place.is_no_position();
  e.place_in_doubt = place_.gnss_denies() || turned_away || wrong_place.lost();
  if (place_.gnss_denies() || turned_away) e.integrity = Integrity::unusable;
  if (motion_.gap_m() > 0) e.degrade("a gap in time: the clock was set, or nothing measured");
  if (place_.has_refused()) e.degrade("a position fix was refused");
  if (place_.was_corrected()) e.degrade("position was corrected by two fixes against the filter");
  if (place_.seen_beside()) e.degrade("a position fix lies on another track");
  if (track_doubt.turns_otherwise()) e.degrade("the train turns otherwise than this track");
  if (wrong_place.fits_nowhere()) {
    e.degrade("what is sighted fits the map nowhere near this place");
    e.integrity = Integrity::unusable;
  } else if (wrong_place.lost()) {
    e.degrade(wrong_place.of_before() ? "the fusion before this one doubted the place: waits for landmarks or GNSS"
                                      : "what was sighted did not fit the map: waits for a landmark or GNSS");
  } else if (track_doubt.disbelieved()) {
    e.degrade("map_matcher finds some other place far more probable");
  }
  judge_told(e);
  const auto& path = place_.path();
  if (!path) {
    e.degrade("place on the map not known" + (place_.given_up() ? why_given_up(*place_.given_up()) : ""));
  } else if (const double here_m = motion_.filter().path_distance_m();
             here_m < path->begin_m() || here_m > path->end_m()) {
    e.degrade("beyond the end of the mapped track");
  }
}

void Estimator::judge_told(TrainEstimate& e) const {
  switch (place_.told().by()) {
    case ToldBy::nobody:
      break;
    case ToldBy::gnss:
      e.degrade("GNSS alone has told the place: waits for a landmark");
      break;
    case ToldBy::start_and_gnss:
      e.degrade("the place was only told, and GNSS agrees to some 10 m only: waits for a landmark or curves");
      break;
    case ToldBy::start:
      if (place_.wrong_place().lost()) break;
      e.degrade(place_.told().alike_beside()
                    ? "the place was only told, and what agrees is the same on a track beside it: waits "
                      "for a balise or a frog"
                    : "the place was only told: waits for a landmark or curves");
  }
}

void Estimator::judge_bounds(TrainEstimate& e) const {
  e.judge_width(*parameters_);
  const auto& sensors = motion_.sensors();
  const double no_camera_s = sensors.unused_for_s(Source::camera);
  const double no_wheel_s = sensors.unused_for_s(Source::wheel);
  if (no_wheel_s < kRecentS && no_camera_s > kRecentS && sensors.unused_for_s(Source::imu) > kRecentS) {
    e.degrade("the wheel alone measures: nothing would see it slip");
  }
  const double no_motion_s = std::min(no_camera_s, no_wheel_s);
  if (no_motion_s > parameters_->sensor_timeout_s) e.degrade("nothing measures the motion");
  if (!e.standstill && (!sensors.has_any_counted() || no_motion_s > kNoMotionUnusableS))
    e.speed_mps = std::numeric_limits<double>::quiet_NaN();
  if (no_motion_s > kNoMotionUnusableS) e.integrity = Integrity::unusable;
}

}  // namespace railfix::fusion
