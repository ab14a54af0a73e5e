// Is it the ground that stands or creeps, or only what most of the picture shows?
//
// Reflections, frost and dirt stay in the picture while the ground leaves under them; shadows leave while the ground
// stays. Either way the picture shows two motions, the stronger of which would be believed. Neither is, until one of
// them is gone.
#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "odometry/train_mouse.hpp"

namespace railfix::odometry {
namespace {

constexpr double kMayStandMps = 0.5;    // as slow as this a train may stand, ...
constexpr double kSurelyMovingMps = 5;  // ... and while nothing is known of it, or in doubt, up to this
constexpr int64_t kDoubtNs = core::kNsPerSecond / 2;
constexpr double kOtherMotion = 0.16;  // correlation with what is left over; noise alone gives up to 0.13
constexpr int kSameMotionRows = 2;     // coarse; nearer motions cannot be told apart, and ...
constexpr int kBesideRows = 4;         // ... up to here only a peak of its own is one
constexpr int kFewestCommonRows = 30;  // coarse
constexpr double kLowestCorrelation = 0.75;
constexpr double kUnexplainedGrowth = 2.5;  // of what rest leaves unexplained: ground that creeps is interpolated, ...
constexpr double kUnexplainedMore = 0.05;   // ... and light changes
constexpr double kAsAtRest = 1.3;
constexpr double kCorrelationGain = 0.1;
constexpr int64_t kRestMemoryNs = 10 * core::kNsPerSecond;

constexpr double kRepeatShare = 0.25;  // of the least way that a train must have gone: less is nothing

}  // namespace

// A picture that is shown again, but not bit for bit (film coded anew, a lost packet concealed), looks like standstill.
// No train stops so soon: the way that it must have gone at least though nothing has moved, else 0.
double TrainMouse::stopped_short_m() const {
  if (measured_stamp_ns_ == 0) return 0;
  // The mean lags behind a train that brakes.
  const double before_mps = confirmed_ ? std::min(std::abs(supported_speed_mps()), std::abs(recent_.speed_mps(0)))
                                       : std::abs(speed_before_gap_mps_);
  const double least_mps =
      before_mps - options_.max_acceleration_mps2 * core::seconds(now_.stamp_ns - measured_stamp_ns_);
  const double least_m = std::max(0.0, least_mps) * core::seconds(now_.stamp_ns - tentative_stamp_ns_);
  return std::abs(moved_m()) < kRepeatShare * least_m ? least_m : 0;
}

// Since the last picture with any motion.
double TrainMouse::moved_m() const {
  return reference_->measured_m + motion_.now.mean(PoseErrors::kDistance) - tentative_distance_m_;
}

// Two motions, or patches that fit worse than they did at rest: no answer, for as long as a leaving train needs to show
// which of the two is its own.
bool TrainMouse::doubtful() {
  const double dt_s = core::seconds(now_.stamp_ns - tentative_stamp_ns_);
  const double limit_mps = confirmed_ && doubt_stamp_ns_ == 0 ? kMayStandMps : kSurelyMovingMps;
  const bool slow = std::abs(moved_m()) < limit_mps * dt_s || (speed_known_ && std::abs(speed_mps_) < limit_mps);
  if (!slow) return false;
  double correlation = 0;
  for (const PatchMotion& patch : votes_) correlation += patch.correlation / static_cast<double>(votes_.size());
  const bool remembered = rest_stamp_ns_ != 0 && now_.stamp_ns - rest_stamp_ns_ < kRestMemoryNs;
  const double at_rest = 1 - kUnexplainedGrowth * (1 - rest_correlation_) - kUnexplainedMore;
  const bool poor = correlation < std::max(kLowestCorrelation, remembered ? at_rest : 0);
  // A few drops on the pane are no second motion while the patches fit as they did at rest.
  const bool as_at_rest = remembered && 1 - correlation < kAsAtRest * (1 - rest_correlation_);
  if (poor || (!as_at_rest && shows_another_motion())) {
    doubt_stamp_ns_ = now_.stamp_ns;
    return true;
  }
  if (doubt_stamp_ns_ != 0 && now_.stamp_ns - doubt_stamp_ns_ < kDoubtNs) return true;
  doubt_stamp_ns_ = 0;
  rest_correlation_ =
      remembered ? rest_correlation_ + kCorrelationGain * (correlation - rest_correlation_) : correlation;
  rest_stamp_ns_ = now_.stamp_ns;
  return false;
}

// What leaves at speed must have done so for a while before it is taken for the ground.
bool TrainMouse::waits_after_doubt() const {
  return doubt_stamp_ns_ != 0 && now_.stamp_ns - restart_stamp_ns_ < kDoubtNs;
}

// Takes the found motion's ground out of the picture and looks for the reference's ground elsewhere in what is left.
bool TrainMouse::shows_another_motion() {
  const CoarseView& then = reference_->seen.coarse;
  const int rows = now_.coarse.rows;
  const double cell_m = 2.0 * maker_->sheet().cell_m;
  const double dt_s = core::seconds(now_.stamp_ns - tentative_stamp_ns_);
  const double reach_m = options_.reference_length_m + options_.max_speed_mps * dt_s;
  const int reach = static_cast<int>(std::min(reach_m / cell_m, static_cast<double>(rows - kFewestCommonRows)));
  const int found = static_cast<int>(std::lround(motion_.along_m / cell_m));
  take_out(then, now_.coarse, found, left_over_);
  const auto at_rows = [&](int first, int last) -> double {
    const ShiftPeak peak =
        search_.find(then, left_over_, {0, rows - 1}, {std::max(first, -reach), std::min(last, reach)}, 1, 0);
    return peak.score > kOtherMotion ? std::abs(peak.rows - found) : 0;
  };
  // What the found motion's fraction of a row, and the camera's vibration, leave over falls off beside it.
  const auto beside = [&](int first, int last) {
    const double away = at_rows(first, last);
    return away > kSameMotionRows + 0.25 && away < kBesideRows;
  };
  if (reach <= std::abs(found) + kBesideRows) return false;
  return at_rows(-reach, found - kBesideRows) > 0 || at_rows(found + kBesideRows, reach) > 0 ||
         beside(found - kBesideRows, found - kSameMotionRows) || beside(found + kSameMotionRows, found + kBesideRows);
}

}  // namespace railfix::odometry
