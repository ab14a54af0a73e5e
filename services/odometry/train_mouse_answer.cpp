// What a step says of the motion that was found, and how sure it is.
#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "odometry/train_mouse.hpp"

namespace railfix::odometry {
namespace {

constexpr double kReliefSigmaM = 0.008;    // mean of the ground in sight against the sheet; tuned on simulated relief
constexpr double kUnseenPitchShare = 0.4;  // of the mount's pitch sigma that the ground does not take out; tuned alike
// Of the square of the way during the exposure, by the share of the patches that is noise; tuned on simulated nights.
constexpr double kBlurSigmaPerM = 0.2;
constexpr double kGuessedScaleSigma = 0.3;
// What a prediction is off without a wrong stamp, beside what the acceleration allows.
constexpr double kPredictionM = 0.02;
constexpr double kPredictionS = 0.008;

}  // namespace

// Errors that all patches and many steps have in common, which the least squares takes for independent: the mean relief
// of the ground in sight and, where rails are not seen, the slow pitching of the body about the mount's pose.
double TrainMouse::scale_sigma() const {
  const double height_m = now_.pose.height_m();
  const double relief = kReliefSigmaM / height_m;
  if (now_.pose_measured && reference_->seen.pose_measured) return relief;
  return std::hypot(relief, 2.0 * patches_ahead_m() / height_m * kUnseenPitchShare * options_.mount_pitch_sigma_rad);
}

// Ground that ran by during the exposure has little gradient along the track, and what noise leaves of it the least
// squares takes for the ground's.
double TrainMouse::blur_sigma_m() const {
  const double blur_m = speed_mps_ * std::max(0.0, now_.exposure_s);
  double noise = 0;
  for (const PatchMotion& patch : votes_) noise += (1 - patch.correlation) / static_cast<double>(votes_.size());
  return kBlurSigmaPerM * noise * blur_m * blur_m;
}

// The sheets follow the rails that are seen, metres ahead and perhaps those of another leg; the camera turns with the
// car body, whatever the sheets follow. What the two sheets make of it is taken off again: their yaw at the foot and
// their curve over the step.
double TrainMouse::turn_of_camera() const {
  const auto& then = reference_->seen.pose;
  return motion_.turn_rad + now_.pose.camera.yaw_rad - then.camera.yaw_rad + then.curvature_per_m * motion_.along_m;
}

double TrainMouse::patches_ahead_m() const {
  double ahead_m = 0;
  for (const PatchMotion& patch : votes_) ahead_m += patch.place_m.x() / static_cast<double>(votes_.size());
  return ahead_m;
}

// How much farther on the ground is than inertia allows; 0 where it allows it.
double TrainMouse::off_inertia_m(double expected_m) const {
  if (!confirmed_ || over_gap_) return 0;
  const double dt_s = core::seconds(now_.stamp_ns - tentative_stamp_ns_);
  const double allowed_m =
      kPredictionM + kPredictionS * std::abs(speed_mps_) + options_.max_acceleration_mps2 * dt_s * (dt_s + 0.1);
  const double off_m = motion_.along_m - expected_m;
  return std::abs(off_m) > allowed_m ? off_m : 0;
}

void TrainMouse::fill(MouseStep& step, double distance_m) const {
  // With what this picture says of the reference's own distance, so that steps add up to the distance.
  step.step_m = distance_m - reference_->distance_m;
  step.lateral_m = motion_.lateral_m + 0.5 * now_.pose.curvature_per_m * motion_.along_m * motion_.along_m;
  step.yaw_rad = turn_of_camera();
  // What standstill holds back is an error of the step that is known to be there. So is what one of the two pictures
  // was off inertia: it does not show what was to be seen at its stamp.
  step.step_sigma_m = std::hypot(motion_.along_sigma_m, std::hypot(scale_sigma() * motion_.along_m, blur_sigma_m()),
                                 std::hypot(step.step_m - motion_.along_m, off_m_ - reference_->off_m, repeated_m_));
  step.yaw_sigma_rad = motion_.turn_sigma_rad;
  const double since_reference_s = core::seconds(now_.stamp_ns - reference_->seen.stamp_ns);
  step.lateral_speed_mps = step.lateral_m / since_reference_s;
  step.yaw_rate_rps = step.yaw_rad / since_reference_s;
  step.speed_mps = speed_mps_;
  step.agreement = motion_.agreement;
  step.pitch_bias_rad = motion_.now.mean(PoseErrors::kPitchBias);
  step.ballast_depth_m = motion_.now.mean(PoseErrors::kBallastDepth);
  step.mode = !confirmed_                                   ? MouseMode::search
              : reference_->seen.stamp_ns == last_stamp_ns_ ? MouseMode::track
                                                            : MouseMode::keyframe;
}

// From a guessed mount lengths along the track may be wrong by a third, all with one sign. Rest is rest with any mount.
void TrainMouse::say_validity(const MousePicture& picture, MouseStep& step) const {
  step.valid = confirmed_ && !over_gap_;
  if (!step.valid) step.why = over_gap_ ? MouseWhy::stamps_jump : MouseWhy::beginning;
  if (!picture.mount_guessed || !step.valid) return;
  step.step_sigma_m = std::hypot(step.step_sigma_m, kGuessedScaleSigma * step.step_m);
  step.valid = standstill_.resting();
  if (!step.valid) step.why = MouseWhy::mount_guessed;
}

}  // namespace railfix::odometry
