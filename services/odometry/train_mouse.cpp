#include "odometry/train_mouse.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::odometry {
namespace {

constexpr double kShakeMarginRad = 0.02;
constexpr double kCurveSmoothingS = 0.3;
constexpr double kVerticalSmoothingS = 0.5;
constexpr double kInertiaS = 0.3;      // after it the speed is not enough to choose among alike shifts
constexpr double kWrongStampS = 0.03;  // searched again over so much way before the ground is given up
constexpr double kSlowMps = 0.5;
constexpr int kAlignments = 4;
constexpr size_t kFewestPatches = 5;
constexpr double kLowestAgreement = 0.35;
constexpr double kStandingStepM = 0.05;         // less is standstill, which ...
constexpr double kStandingShare = 0.8;          // ... nearly all the ground in sight must show (lettering: up to 0.7)
constexpr double kLongestReferenceShare = 0.6;  // of the sheet that may have gone out of sight
constexpr double kSpeedGain = 0.5;
constexpr double kSupportS = 2;  // of acceleration beside the last second's mean
constexpr int64_t kSpeedOverNs = core::kNsPerSecond / 10;
constexpr double kHeightShakeM = 0.0015;  // of the camera between two pictures: motors, ...
constexpr double kBouncePerM = 0.02;      // ... the springs on the way, ...
constexpr double kSettlingMps = 1e-4;     // ... people getting in
constexpr double kVerticalChangePerM2 = 1e-5;
constexpr double kVerticalChangeM = 0.2;
constexpr double kFadedScore = 0.6;  // at rest: the light has changed since the reference
constexpr int64_t kShortestRestNs = 2 * core::kNsPerSecond;
constexpr int64_t kClockSetBackNs = core::kNsPerSecond;  // no picture is as late as that
constexpr double kRepeatLeastM = 0.02;  // less way in a picture shown again is only an error of the step
constexpr double kLongestStepS = 1;     // a longer one between pictures is no step, unless ...
constexpr double kUsualSteps = 3;       // ... it is not so many times as long as usual
constexpr double kUsualGain = 0.2;

bool finite(const geometry::CameraPose& pose) {
  return std::isfinite(pose.roll_rad + pose.pitch_rad + pose.yaw_rad + pose.lateral_m + pose.height_m);
}

// With one number that is none nothing of it is believed.
bool measured_wholly(const MousePicture& picture) {
  return finite(picture.pose) && picture.trust.covariance.allFinite() &&
         std::isfinite(picture.curvature_per_m + picture.vertical_curvature_per_m);
}

}  // namespace

TrainMouse::TrainMouse(const geometry::Intrinsics& camera, const TrainMouseOptions& options)
    : camera_(camera), options_(options), filter_(options.filter), standstill_(options.standstill_m) {}

void TrainMouse::smooth_curves(const MousePicture& picture) {
  if (!picture.pose_measured) return;
  const double dt_s = curves_known_ ? core::seconds(picture.stamp_ns - last_stamp_ns_) : 1e9;
  const double fast = 1.0 - std::exp(-dt_s / kCurveSmoothingS);
  const double slow = 1.0 - std::exp(-dt_s / kVerticalSmoothingS);
  curvature_per_m_ += fast * (picture.curvature_per_m - curvature_per_m_);
  vertical_curvature_per_m_ += slow * (picture.vertical_curvature_per_m - vertical_curvature_per_m_);
  curves_known_ = true;
}

// Makes the top view of the picture; false when there is nothing to see in it.
bool TrainMouse::look(const MousePicture& picture) {
  now_.stamp_ns = picture.stamp_ns;
  now_.pose = {picture.pose, options_.texture_depth_m, curvature_per_m_, vertical_curvature_per_m_};
  now_.prior = {};
  now_.prior.trust = picture.trust;
  now_.pose_measured = picture.pose_measured;
  now_.exposure_s = picture.exposure_s;
  if (!picture.pose_measured) {
    now_.prior.trust = PoseTrust::independent(options_.mount_pitch_sigma_rad, options_.mount_height_sigma_m);
  }
  // A slow train's pictures are compared at one pose: the noise of measured poses would only move the ground.
  if (reference_ && confirmed_ && std::abs(speed_mps_) < kSlowMps) {
    now_.pose = reference_->seen.pose;
    now_.prior.pitch_offset_rad = now_.pose.camera.pitch_rad - picture.pose.pitch_rad;
    now_.prior.height_offset_m = now_.pose.camera.height_m - picture.pose.height_m;
  }
  if (picture.pose_measured)
    now_.prior.vertical_offset_per_m = now_.pose.vertical_curvature_per_m - picture.vertical_curvature_per_m;
  if (!maker_) {
    const vision::Sheet sheet =
        vision::fit_sheet(camera_, now_.pose, options_.near_m, options_.far_m,
                          0.5 * options_.gauge_m - options_.rail_margin_m, options_.cell_m, kShakeMarginRad);
    maker_ = std::make_unique<vision::TopViewMaker>(camera_, sheet);
  }
  if (maker_->sheet().rows < 100) {
    maker_.reset();  // the pose shows no ground: try again with the next one
    return false;
  }
  maker_->make(picture.grey, now_.pose, now_.view);
  coarse_maker_.make(now_.view, now_.coarse);
  return now_.coarse.contrast_grey > options_.lowest_contrast_grey;
}

// The present picture becomes the reference; the old one's buffers take the next picture.
void TrainMouse::make_reference() {
  if (!reference_) {
    TextureReference::Options texture;
    texture.noise_grey = options_.noise_grey;
    reference_.emplace(texture);
  }
  reference_->texture.set(now_.view, maker_->sheet());
  std::swap(reference_->seen, now_);
  now_.stamp_ns = reference_->seen.stamp_ns;
  now_.pose = reference_->seen.pose;
  now_.prior = reference_->seen.prior;
  now_.pose_measured = reference_->seen.pose_measured;
  reference_->errors = {};
  reference_->measured_m = reference_->distance_m = 0;
  reference_->off_m = off_m_;
}

TrainMouse::Rough TrainMouse::find_roughly(bool full_band, double predicted_m, double band_m) {
  const vision::Sheet& sheet = maker_->sheet();
  const double cell_m = 2.0 * sheet.cell_m;
  const int rows = now_.coarse.rows;
  const int apart = static_cast<int>(std::ceil(0.16 / cell_m));
  RowRange shifts{static_cast<int>(std::floor((predicted_m - band_m) / cell_m)),
                  static_cast<int>(std::ceil((predicted_m + band_m) / cell_m))};
  const int limit = rows - 30;
  shifts = {std::max(shifts.first, -limit), std::min(shifts.last, limit)};
  Rough rough;
  if (shifts.first > shifts.last) return rough;
  const ShiftPeak whole = search_.find(reference_->seen.coarse, now_.coarse, {0, rows - 1}, shifts, 2, apart);
  rough.score = whole.score;
  if (whole.score < options_.lowest_score) return rough;
  rough.ambiguous = full_band && whole.runner_up > options_.ambiguity * whole.score;
  if (rough.ambiguous) return rough;
  rough.found = true;
  rough.left_shift_m = -whole.cols * cell_m;

  // A camera that has pitched between the pictures moves far ground more than near ground.
  const int first = std::max(0, static_cast<int>(whole.rows));
  const int last = std::min(rows - 1, rows - 1 + static_cast<int>(whole.rows));
  const int middle = (first + last) / 2;
  const auto around = [&](double shift) {
    return RowRange{static_cast<int>(std::lround(shift)) - 3, static_cast<int>(std::lround(shift)) + 3};
  };
  const auto part = [&](RowRange section) {
    const ShiftPeak peak = search_.find(reference_->seen.coarse, now_.coarse, section, around(whole.rows), 2, apart);
    return peak.score > 0.5 * whole.score ? peak.rows : whole.rows;
  };
  rough.near_m = sheet.ahead_m(first + middle);
  rough.far_m = sheet.ahead_m(middle + last);
  rough.near_shift_m = -part({first, middle}) * cell_m;
  rough.far_shift_m = -part({middle, last}) * cell_m;
  return rough;
}

// How the body bounces grows with speed; at rest people get in and out.
PoseTie TrainMouse::tie(double along_m) const {
  const auto& then = reference_->seen;
  const double dt_s = core::seconds(now_.stamp_ns - then.stamp_ns);
  PoseTie tie;
  tie.height_used_m = now_.pose.camera.height_m - then.pose.camera.height_m;
  tie.vertical_used_per_m = now_.pose.vertical_curvature_per_m - then.pose.vertical_curvature_per_m;
  tie.curvature_used_per_m = now_.pose.curvature_per_m - then.pose.curvature_per_m;
  tie.height_sigma_m = kHeightShakeM + (kBouncePerM * std::abs(along_m) + kSettlingMps * dt_s);
  tie.vertical_sigma_per_m = kVerticalChangePerM2 * (kVerticalChangeM + std::abs(along_m));
  return tie;
}

bool TrainMouse::align(const Rough& rough, MouseStep& step) {
  const double height_m = now_.pose.height_m();
  DisplacementField field = [&rough](const Eigen::Vector2d& place, bool) {
    const double share = std::clamp((place.x() - rough.near_m) / (rough.far_m - rough.near_m), -0.5, 1.5);
    return Eigen::Vector2d(rough.near_shift_m + share * (rough.far_shift_m - rough.near_shift_m), rough.left_shift_m);
  };
  size_t in_sight = 0;
  for (int i = 0; i < kAlignments; ++i) {
    in_sight = reference_->texture.measure(now_.view, field, votes_);
    if (votes_.size() < kFewestPatches) return false;
    const double along_m = i == 0 ? rough.near_shift_m : motion_.along_m;
    filter_.solve(reference_->errors, now_.prior, tie(along_m), height_m, votes_, motion_);
    field = [this, height_m](const Eigen::Vector2d& place, bool ballast) {
      return MotionFilter::displacement(motion_, height_m, place, ballast);
    };
  }
  step.patches = static_cast<int>(votes_.size());
  step.matched = static_cast<double>(votes_.size()) / static_cast<double>(in_sight);
  if (motion_.agreement < kLowestAgreement) return false;
  // What sticks to the picture (lettering, dirt on the pane) stands still whatever the train does; the ground around it
  // tells.
  return std::abs(motion_.along_m) >= kStandingStepM || step.matched >= kStandingShare;
}

// As it is, but no more than the last second's mean and the train's acceleration allow: stamps may be wrong.
double TrainMouse::supported_speed_mps() const {
  if (recent_.count() < 2) return speed_mps_;
  const double mean_mps = recent_.speed_mps(core::kNsPerSecond);
  const double change_mps = kSupportS * options_.max_acceleration_mps2;
  return std::clamp(speed_mps_, mean_mps - change_mps, mean_mps + change_mps);
}

void TrainMouse::accept(MouseStep& step) {
  const double dt_s = core::seconds(now_.stamp_ns - tentative_stamp_ns_);
  double measured_m = reference_->measured_m + motion_.now.mean(PoseErrors::kDistance);
  recent_.remember(now_.stamp_ns, measured_m);
  const double measured_mps =
      std::clamp(recent_.speed_mps(kSpeedOverNs), -options_.max_speed_mps, options_.max_speed_mps);
  if (over_gap_) {
    recent_.forget();  // what stamps say of that speed is nothing
    recent_.remember(now_.stamp_ns, measured_m);
  } else {
    speed_mps_ = speed_known_ ? speed_mps_ + kSpeedGain * (measured_mps - speed_mps_) : measured_mps;
  }
  if (!confirmed_ && speed_known_ && !waits_after_doubt()) {
    confirmed_ = true;
    doubt_stamp_ns_ = 0;
    const double bridge_m = bridge(measured_mps);
    measured_m += bridge_m;
    recent_.shift(bridge_m);
  }
  speed_known_ = true;
  tentative_distance_m_ = measured_m;
  tentative_stamp_ns_ = now_.stamp_ns;
  if (confirmed_) {
    distance_m_ = standstill_.report(now_.stamp_ns, measured_m);
    measured_stamp_ns_ = now_.stamp_ns;
    unmeasured_ = 0;
    if (standstill_.resting() || std::abs(speed_mps_) < kSlowMps) speed_mps_ = standstill_.recent_speed_mps();
  }
  fill(step, confirmed_ ? distance_m_ : measured_m);
  renew_reference(step, dt_s);
}

// The reference stays while the next picture will still be near it; at rest until the light has changed.
void TrainMouse::renew_reference(const MouseStep& step, double dt_s) {
  const double next_m = std::abs(motion_.along_m + speed_mps_ * dt_s);
  const bool faded =
      standstill_.resting() && step.score < kFadedScore && now_.stamp_ns - reference_->seen.stamp_ns > kShortestRestNs;
  if (next_m <= options_.reference_length_m && !faded) return;
  const PoseErrors errors = motion_.now;
  make_reference();
  reference_->errors = errors;
  reference_->errors.mean(PoseErrors::kDistance) = 0;
  reference_->measured_m = tentative_distance_m_;
  reference_->distance_m = confirmed_ ? distance_m_ : tentative_distance_m_;
}

// Distance over the gap before the present reference, at the mean of the speeds on either side; of the one after it
// no more than the train can have gained.
double TrainMouse::bridge(double speed_after_mps) {
  if (measured_stamp_ns_ == 0) return 0;
  const double gap_s = core::seconds(restart_stamp_ns_ - measured_stamp_ns_);
  if (gap_s > options_.bridge_s) return 0;
  const double gain_mps = options_.max_acceleration_mps2 * (1.0 + core::seconds(now_.stamp_ns - measured_stamp_ns_));
  const double after_mps =
      std::clamp(speed_after_mps, speed_before_gap_mps_ - gain_mps, speed_before_gap_mps_ + gain_mps);
  const double bridge_m = 0.5 * (speed_before_gap_mps_ + after_mps) * gap_s;
  reference_->measured_m += bridge_m;
  reference_->distance_m += bridge_m;
  return bridge_m;
}

// No motion from this picture. The reference waits for the next one while its ground is still in sight.
void TrainMouse::give_up(MouseStep& step) {
  const vision::Sheet& sheet = maker_->sheet();
  const double gone_m = std::abs(speed_mps_) * core::seconds(now_.stamp_ns - reference_->seen.stamp_ns);
  const bool out_of_sight = gone_m > kLongestReferenceShare * sheet.rows * sheet.cell_m;
  const bool too_long = now_.stamp_ns - tentative_stamp_ns_ > core::kNsPerSecond / 2;
  step.mode = MouseMode::search;
  if (confirmed_ && !out_of_sight && !too_long) return;
  // Start anew from this picture.
  if (confirmed_) speed_before_gap_mps_ = supported_speed_mps();
  restart_stamp_ns_ = now_.stamp_ns;
  speed_known_ = false;
  confirmed_ = false;
  make_reference();
  reference_->errors = filter_.first(now_.prior);
  reference_->measured_m = reference_->distance_m = tentative_distance_m_ = distance_m_;
  tentative_stamp_ns_ = now_.stamp_ns;
  begin_places();
}

void TrainMouse::begin_places() {
  recent_.forget();
  recent_.remember(tentative_stamp_ns_, tentative_distance_m_);
}

// The clock was set back, or a stamp was far ahead of the others: what is known of the motion is of no use, but for the
// way of the pictures since.
void TrainMouse::begin_anew() {
  const double speed_mps = confirmed_ ? supported_speed_mps() : speed_before_gap_mps_;
  if (measured_stamp_ns_ != 0) distance_m_ += speed_mps * std::min(unmeasured_ * usual_s_, options_.bridge_s);
  reference_.reset();
  standstill_ = Standstill(options_.standstill_m);
  speed_mps_ = 0;
  speed_known_ = confirmed_ = curves_known_ = false;
  measured_stamp_ns_ = last_stamp_ns_ = doubt_stamp_ns_ = rest_stamp_ns_ = 0;
  tentative_distance_m_ = distance_m_;
}

MouseStep TrainMouse::begin_step(const MousePicture& picture) {
  MouseStep step;
  step.stamp_ns = picture.stamp_ns;
  step.reference_stamp_ns = picture.stamp_ns;
  step.height_m = picture.pose.height_m + options_.texture_depth_m;
  ++unmeasured_;
  if (picture.stamp_ns < last_stamp_ns_ - kClockSetBackNs) {
    begin_anew();
    step.why = MouseWhy::stamps_jump;
  }
  step.distance_m = distance_m_;
  if (picture.grey.type() != CV_8UC1 || picture.grey.cols != camera_.width_px ||
      picture.grey.rows != camera_.height_px) {
    step.why = MouseWhy::other_size;
  } else if (picture.stamp_ns <= last_stamp_ns_) {
    step.why = MouseWhy::not_newer;
  } else if (!finite(picture.pose)) {
    step.why = MouseWhy::no_pose;
  }
  return step;
}

MouseStep TrainMouse::process(const MousePicture& given) {
  MousePicture picture = given;
  picture.pose_measured = given.pose_measured && measured_wholly(given);
  MouseStep step = begin_step(picture);
  if (step.why != MouseWhy::none && step.why != MouseWhy::stamps_jump) return step;
  smooth_curves(picture);
  if (!look(picture)) {
    step.why = MouseWhy::no_texture;
  } else if (!reference_) {
    left_over_ = now_.coarse;  // takes its memory
    make_reference();
    reference_->errors = filter_.first(now_.prior);
    reference_->measured_m = reference_->distance_m = distance_m_;
    tentative_stamp_ns_ = picture.stamp_ns;
    begin_places();
    step.mode = MouseMode::search;
    if (step.why == MouseWhy::none) step.why = MouseWhy::beginning;
  } else {
    measure(picture, step);
  }
  last_stamp_ns_ = picture.stamp_ns;
  return step;
}

double TrainMouse::predicted_m(const MousePicture& picture) const {
  if (!speed_known_)
    return picture.speed_mps.value_or(0.0) * core::seconds(picture.stamp_ns - reference_->seen.stamp_ns);
  return tentative_distance_m_ - reference_->measured_m +
         speed_mps_ * core::seconds(picture.stamp_ns - tentative_stamp_ns_);
}

TrainMouse::Rough TrainMouse::find(const MousePicture& picture, double expected_m) {
  const double since_m_s = core::seconds(picture.stamp_ns - tentative_stamp_ns_);
  const double reference_s = core::seconds(picture.stamp_ns - reference_->seen.stamp_ns);
  const bool predicted = speed_known_ || picture.speed_mps.has_value();
  if (over_gap_) return find_roughly(true, 0, maker_->sheet().rows * maker_->sheet().cell_m);
  double band_m = options_.search_band_m + options_.max_acceleration_mps2 * since_m_s * (since_m_s + 0.1);
  if (!speed_known_) band_m = predicted ? band_m + 0.1 * std::abs(expected_m) : options_.max_speed_mps * reference_s;
  Rough rough = find_roughly(!predicted || since_m_s > kInertiaS, expected_m, band_m);
  if (rough.found || !speed_known_) return rough;
  return find_roughly(true, expected_m, 2.0 * band_m + kWrongStampS * std::abs(speed_mps_));
}

void TrainMouse::measure(const MousePicture& picture, MouseStep& step) {
  step.reference_stamp_ns = reference_->seen.stamp_ns;
  const double apart_s = core::seconds(picture.stamp_ns - last_stamp_ns_);
  over_gap_ = usual_s_ > 0 && apart_s > std::max(kLongestStepS, kUsualSteps * usual_s_);
  if (!over_gap_) usual_s_ = usual_s_ > 0 ? usual_s_ + kUsualGain * (apart_s - usual_s_) : apart_s;
  const double expected_m = predicted_m(picture);
  const Rough rough = find(picture, expected_m);
  step.score = rough.score;
  const bool aligned = rough.found && align(rough, step);
  repeated_m_ = aligned && !over_gap_ ? stopped_short_m() : 0;
  if (repeated_m_ > kRepeatLeastM) {
    step.mode = MouseMode::blind;  // reference and speed wait for the next picture
    step.why = MouseWhy::shown_again;
  } else if (aligned && !doubtful()) {
    step.off_m = off_inertia_m(expected_m);
    off_m_ += step.off_m;
    accept(step);
    say_validity(picture, step);
  } else {
    step.why = over_gap_         ? MouseWhy::stamps_jump
               : aligned         ? MouseWhy::two_motions
               : rough.ambiguous ? MouseWhy::repeats_itself
                                 : MouseWhy::not_found;
    give_up(step);
  }
  step.distance_m = distance_m_;
}

}  // namespace railfix::odometry
