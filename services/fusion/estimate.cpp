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
constexpr double kFreshS = 0.12;
constexpr double kRecentPositionS = 30.0;
constexpr double kNoMotionUnusableS = 5.0;
constexpr double kHeldByGnssS = 5.0;
constexpr double kLostAtLeastM = 100.0;
constexpr double kLostAtMostM = 500.0;

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

bool Estimator::gnss_denies_place() const {
  const bool never_agreed = watch(Source::gnss).used_ns == 0 && !place_.told.believed();
  return watch(Source::gnss).isolated && (never_agreed || place_.wrong_place.lost());
}

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

Interval Estimator::interval() const {
  const double bound_m = std::max(known_to_m() + doubts_.odometers_m + unchecked_m_, lost_to_m());
  // Since the last sample the train may have stopped counting, or the clock may have run ahead.
  const double silent_s = core::seconds(filter_.stamp_ns() - stamp_ns_);
  const double silent_m = silent_s > kFreshS ? std::abs(filter_.speed_mps()) * silent_s : 0;
  const Sides ways = place_.other_ways.held();
  Sides held{bound_m + ways.behind_m, bound_m + ways.ahead_m};
  held.hold(doubts_.refused);
  held.hold(doubts_.gnss);
  return {centre_m() - held.behind_m - gap_.way_m() - silent_m, centre_m() + held.ahead_m};
}

double Estimator::known_to_m() const {
  return parameters_->interval_factor * sigma_m() + parameters_->interval_floor_m +
         parameters_->interval_drift * since_fix_m();
}

// Where a map lacks a piece of track the place is off by that from there on. So far that it is no position, and that
// the matcher, which has few landmarks to choose from then, finds the train there.
double Estimator::lost_to_m() const {
  const auto& p = *parameters_;
  const double budgets_m = p.unusable_budgets * p.allowed_m(since_reference_m());
  return place_.wrong_place.lost() ? std::clamp(budgets_m, kLostAtLeastM, kLostAtMostM) : 0.0;
}

Interval Estimator::widened(const Interval& interval) const {
  const bool held = gnss_proven() && used_within(Source::gnss, kHeldByGnssS);
  const double most_m = held ? gnss_bound_m() : std::numeric_limits<double>::infinity();
  const Sides more = unwatched_.may_be_off(*parameters_);
  return {interval.rear_m - std::min(more.behind_m, most_m), interval.front_m + std::min(more.ahead_m, most_m)};
}

double Estimator::gnss_bound_m() const {
  return parameters_->gnss_bound_m + parameters_->gnss_lag_s * std::abs(filter_.speed_mps());
}

TrainEstimate Estimator::estimate(const Interval& promised, double since_sure_m) const {
  TrainEstimate e;
  e.integrity = Integrity::ok;
  e.stamp_ns = filter_.stamp_ns();
  e.distance_m = filter_.value(StateIndex::distance);
  e.speed_mps = filter_.speed_mps();
  e.acceleration_mps2 = filter_.value(StateIndex::acceleration);
  e.visual_scale = filter_.scale(Odometer::camera);
  e.wheel_scale = filter_.scale(Odometer::wheel);
  e.since_reference_m = since_reference_m();
  e.since_sure_m = since_sure_m;
  e.reference = place_.reference;
  e.standstill = standstill_.stands();
  e.track_known = place_.path != nullptr;
  e.track_probability = place_.path ? place_.track_doubt.probability_at(*place_.path, filter_.path_distance_m()) : 0;
  e.sigma_m = sigma_m();
  locate(e);
  // The place is one on the map, the ends are where the train is: beyond the end of the map one reaches further.
  const double centre_m = place_.path ? e.path_distance_m : e.distance_m;
  e.over_m = std::max(0.0, centre_m - promised.rear_m);
  e.under_m = std::max(0.0, promised.front_m - centre_m);
  if (!std::isfinite(centre_m + e.sigma_m + promised.rear_m + promised.front_m)) {
    e.over_m = e.under_m = std::numeric_limits<double>::infinity();
    e.degrade("the filter's numbers ran over");
  }
  judge(e);
  return e;
}

void Estimator::locate(TrainEstimate& e) const {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  e.lat_deg = e.lon_deg = e.easting_m = e.northing_m = e.heading_rad = nan;
  if (!place_.path) return;
  e.path = place_.path;
  e.path_distance_m = std::clamp(filter_.path_distance_m(), place_.path->begin_m(), place_.path->end_m());
  e.position = place_.path->position_at(e.path_distance_m);
  const auto pose = place_.path->at(e.path_distance_m).pose;
  e.easting_m = pose.easting_m;
  e.northing_m = pose.northing_m;
  e.heading_rad = pose.heading_rad;
  if (place_.path->map().edge(e.position.edge)->is_drawn) return;  // a drawing lies nowhere on the Earth
  if (const auto geo = place_.path->map().to_geo(pose.easting_m, pose.northing_m)) {
    e.lat_deg = geo->lat_deg;
    e.lon_deg = geo->lon_deg;
  }
}

double Estimator::unused_for_s(Source source) const {
  const auto used_ns = watch(source).used_ns;
  return core::seconds(filter_.stamp_ns() - (used_ns == 0 ? start_ns_ : used_ns));
}

bool Estimator::silent(Source source) const {
  const auto& w = watch(source);
  return w.seen_ns != 0 && core::seconds(filter_.stamp_ns() - w.seen_ns) > parameters_->sensor_timeout_s;
}

void Estimator::judge(TrainEstimate& e) const {
  judge_sensors(e);
  judge_place(e);
  judge_bounds(e);
}

void Estimator::judge_sensors(TrainEstimate& e) const {
  for (int i = 0; i < kSources; ++i) {
    const auto source = static_cast<Source>(i);
    const bool motion = source == Source::camera || source == Source::wheel || source == Source::imu;
    if (watch(source).used_ns != 0 && !watch(source).isolated &&
        unused_for_s(source) < (motion ? kRecentS : kRecentPositionS))
      e.sources |= 1U << i;
  }

  const auto& camera = watch(Source::camera);
  if (silent(Source::camera)) {
    e.degrade("no camera");
  } else if (camera.isolated) {
    e.degrade("camera motion contradicts the other sensors" + since(camera.changed_ns));
  } else if (camera.seen_ns != 0 && unused_for_s(Source::camera) > parameters_->sensor_timeout_s) {
    e.degrade("camera blind");
  }
  if (silent(Source::wheel)) {
    e.degrade("no wheel pulses");
  } else if (watch(Source::wheel).isolated) {
    e.degrade("wheel slips or slides" + since(watch(Source::wheel).changed_ns));
  } else if (wheel_.odometer.scatters()) {
    e.degrade("wheel readings scatter");
  }
  if (silent(Source::imu)) {
    e.degrade("no IMU");
  } else if (watch(Source::imu).isolated) {
    e.degrade("IMU contradicts the other sensors" + since(watch(Source::imu).changed_ns));
  }
  if (const char* gyro = what_of(gyro_watch_.fault())) e.degrade(gyro + since(gyro_watch_.since_ns()));
}

void Estimator::judge_place(TrainEstimate& e) const {
  const auto& gnss = watch(Source::gnss);
  if (gnss.isolated) e.degrade("GNSS contradicts the position" + since(gnss.changed_ns));
  const bool turned_away = place_.track_doubt.turns_otherwise() && place_.wrong_place.is_no_position();
  e.place_in_doubt = gnss_denies_place() || turned_away || place_.wrong_place.lost();
  if (gnss_denies_place() || turned_away) e.integrity = Integrity::unusable;
  if (gap_.way_m() > 0) e.degrade("a gap in time: the clock was set, or nothing measured");
  if (refused_fix_) e.degrade("a position fix was refused");
  if (corrected_) e.degrade("position was corrected by two fixes against the filter");
  if (off_path_) e.degrade("a position fix lies on another track");
  if (place_.track_doubt.turns_otherwise()) e.degrade("the train turns otherwise than this track");
  if (place_.wrong_place.fits_nowhere()) {
    e.degrade("what is sighted fits the map nowhere near this place");
    e.integrity = Integrity::unusable;
  } else if (place_.wrong_place.lost()) {
    e.degrade(place_.wrong_place.of_before()
                  ? "the fusion before this one doubted the place: waits for landmarks or GNSS"
                  : "what was sighted did not fit the map: waits for a landmark or GNSS");
  } else if (place_.track_doubt.disbelieved()) {
    e.degrade("map_matcher finds some other place far more probable");
  }
  if (place_.told.by() == ToldBy::gnss) e.degrade("GNSS alone has told the place: waits for a landmark");
  if (place_.told.by() == ToldBy::start_and_gnss) {
    e.degrade("the place was only told, and GNSS agrees to some 10 m only: waits for a landmark or curves");
  }
  if (place_.told.by() == ToldBy::start && !place_.wrong_place.lost()) {
    e.degrade(place_.told.alike_beside()
                  ? "the place was only told, and what agrees is the same on a track beside it: waits "
                    "for a balise or a frog"
                  : "the place was only told: waits for a landmark or curves");
  }
  if (!place_.path) e.degrade("place on the map not known" + (place_.given_up ? why_given_up(*place_.given_up) : ""));
  if (place_.path &&
      (filter_.path_distance_m() < place_.path->begin_m() || filter_.path_distance_m() > place_.path->end_m())) {
    e.degrade("beyond the end of the mapped track");
  }
}

void Estimator::judge_bounds(TrainEstimate& e) const {
  e.judge_width(*parameters_);
  const bool wheel = unused_for_s(Source::wheel) < kRecentS;
  if (wheel && unused_for_s(Source::camera) > kRecentS && unused_for_s(Source::imu) > kRecentS) {
    e.degrade("the wheel alone measures: nothing would see it slip");
  }
  const double no_motion_s = std::min(unused_for_s(Source::camera), unused_for_s(Source::wheel));
  if (no_motion_s > parameters_->sensor_timeout_s) e.degrade("nothing measures the motion");
  const bool moved = watch(Source::camera).used_ns != 0 || watch(Source::wheel).used_ns != 0;
  if (!e.standstill && (!moved || no_motion_s > kNoMotionUnusableS))
    e.speed_mps = std::numeric_limits<double>::quiet_NaN();
  if (no_motion_s > kNoMotionUnusableS) e.integrity = Integrity::unusable;
}

}  // namespace railfix::fusion
