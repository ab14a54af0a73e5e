// The train mouse: how far has the train gone, seen from the ground between the rails (paper 002, 2.1).
//
// Every picture is turned into a top view of the texture plane with its own camera pose, the ground of a reference
// picture is found again in it, first roughly, then patch by patch to a fraction of a cell, and the patches'
// displacements give the motion. While the train is slow the reference stays, so standing still adds up to nothing.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "geometry/camera.hpp"
#include "odometry/motion_filter.hpp"
#include "odometry/recent_places.hpp"
#include "odometry/shift_search.hpp"
#include "odometry/standstill.hpp"
#include "odometry/texture_alignment.hpp"
#include "vision/ground_sheet.hpp"

namespace railfix::odometry {

struct TrainMouseOptions {
  double gauge_m = 1.435;
  double texture_depth_m = 0.18;  // sleeper tops below the rail heads
  double rail_margin_m = 0.12;    // ground beside the rail that its foot and shadow spoil
  double near_m = 4.0;            // ground used, ahead of the camera; the picture may limit it further
  double far_m = 14.0;
  double cell_m = 0.02;
  double noise_grey = 2.0;
  double max_speed_mps = 70.0;
  double max_acceleration_mps2 = 3.0;
  double search_band_m = 0.15;      // around the predicted shift, beside what the acceleration allows
  double reference_length_m = 0.5;  // the reference stays until the train has moved so far
  double lowest_score = 0.25;       // of the rough search
  double ambiguity = 0.75;          // full search: the second-best shift must stay below this share of the best
  double lowest_contrast_grey = 1.0;
  double mount_pitch_sigma_rad = 0.004;  // where the pose is only that of the mount
  double mount_height_sigma_m = 0.02;
  MotionFilter::Options filter;
  double standstill_m = 0.003;  // motion below it, at standstill, is not counted until it exceeds it
  double bridge_s = 3.0;        // cumulative distance goes on with the mean speed over gaps up to this long
};

struct MousePicture {
  cv::Mat grey;  // CV_8UC1
  int64_t stamp_ns = 0;
  geometry::CameraPose pose;  // of this picture where measured, else the mount's or the last
  bool pose_measured = false;
  bool mount_guessed = false;  // nobody has calibrated it: what is seen to move is so for any mount, but not how far
  PoseTrust trust;             // of a measured pose
  double curvature_per_m = 0;
  double vertical_curvature_per_m = 0;
  double exposure_s = 0;            // 0 = not known
  std::optional<double> speed_mps;  // from elsewhere, only to find the first match
};

enum class MouseMode : uint8_t { search, track, keyframe, blind };

/// Why a step is not valid, where that can be told.
enum class MouseWhy : uint8_t {
  none,
  no_texture,
  no_pose,
  other_size,      // than the calibration's
  not_newer,       // than the picture before
  stamps_jump,     // by more than a gap between pictures is
  shown_again,     // though the train moves
  two_motions,     // a pattern on the pane, or moving shadows
  repeats_itself,  // the ground, so that several motions are as likely
  not_found,
  beginning,  // nothing to compare with, or not yet twice
  mount_guessed
};

/// As odometry_step (idl/odometry.idl); step, lateral and yaw count from the reference picture.
struct MouseStep {
  int64_t stamp_ns = 0;
  int64_t reference_stamp_ns = 0;
  double step_m = 0;
  double lateral_m = 0;
  double yaw_rad = 0;
  double step_sigma_m = 0;
  double yaw_sigma_rad = 0;
  double distance_m = 0;
  double speed_mps = 0;
  double lateral_speed_mps = 0;
  double yaw_rate_rps = 0;
  double height_m = 0;
  MouseMode mode = MouseMode::blind;
  bool valid = false;
  MouseWhy why = MouseWhy::none;
  double off_m = 0;            // farther on than inertia allows: the stamp is wrong, or the pictures' order
  int patches = 0;             // that voted
  double matched = 0;          // share of the patches in sight that voted
  double agreement = 0;        // 0..1
  double score = 0;            // correlation of the rough search
  double pitch_bias_rad = 0;   // measured less true pitch, as the ground shows it
  double ballast_depth_m = 0;  // below the sleeper tops, as the ground shows it
};

class TrainMouse {
 public:
  TrainMouse(const geometry::Intrinsics& camera, const TrainMouseOptions& options);

  /// Pictures in the order of their stamps; one that is not newer than the last is answered as invalid and left out.
  /// A measured pose with a number that is none is no measured pose; without a pose at all the picture is left out.
  /// When it is older by more than a second the clock was set back: measuring begins anew, the distance goes on.
  MouseStep process(const MousePicture& given);

 private:
  struct Seen {  // one picture, ready to be compared
    int64_t stamp_ns = 0;
    vision::SheetPose pose;
    vision::TopView view;
    CoarseView coarse;
    PosePrior prior;
    bool pose_measured = false;
    double exposure_s = 0;
  };
  struct Reference {
    explicit Reference(const TextureReference::Options& options) : texture(options) {}
    Seen seen;
    TextureReference texture;
    PoseErrors errors;
    double measured_m = 0;  // distance there, ...
    double distance_m = 0;  // ... and as reported: less what was held back at rest
    double off_m = 0;       // off_m_ there
  };
  struct Rough {  // displacement of the ground in two halves of the sheet
    bool found = false;
    bool ambiguous = false;
    double score = 0;
    double near_m = 0, far_m = 0;
    double near_shift_m = 0, far_shift_m = 0;
    double left_shift_m = 0;
  };

  bool look(const MousePicture& picture);
  void make_reference();
  MouseStep begin_step(const MousePicture& picture);
  void measure(const MousePicture& picture, MouseStep& step);
  [[nodiscard]] double predicted_m(const MousePicture& picture) const;
  [[nodiscard]] Rough find(const MousePicture& picture, double expected_m);
  [[nodiscard]] Rough find_roughly(bool full_band, double predicted_m, double band_m);
  bool align(const Rough& rough, MouseStep& step);
  [[nodiscard]] PoseTie tie(double along_m) const;
  [[nodiscard]] double supported_speed_mps() const;
  [[nodiscard]] double stopped_short_m() const;
  [[nodiscard]] double moved_m() const;
  bool doubtful();
  [[nodiscard]] bool waits_after_doubt() const;
  bool shows_another_motion();
  void accept(MouseStep& step);
  [[nodiscard]] double off_inertia_m(double expected_m) const;
  [[nodiscard]] double scale_sigma() const;
  [[nodiscard]] double blur_sigma_m() const;
  [[nodiscard]] double turn_of_camera() const;
  /// Of the foot, in the reference picture.
  [[nodiscard]] double patches_ahead_m() const;
  void fill(MouseStep& step, double distance_m) const;
  void say_validity(const MousePicture& picture, MouseStep& step) const;
  void renew_reference(const MouseStep& step, double dt_s);
  double bridge(double speed_after_mps);
  void give_up(MouseStep& step);
  void begin_places();
  void smooth_curves(const MousePicture& picture);
  void begin_anew();

  geometry::Intrinsics camera_;
  TrainMouseOptions options_;
  MotionFilter filter_;
  std::unique_ptr<vision::TopViewMaker> maker_;
  CoarseViewMaker coarse_maker_;
  ShiftSearch search_;
  Seen now_;
  CoarseView left_over_;
  Motion motion_;
  Standstill standstill_;
  RecentPlaces recent_;  // since the last start anew
  std::vector<PatchMotion> votes_;
  std::optional<Reference> reference_;
  double curvature_per_m_ = 0;
  double vertical_curvature_per_m_ = 0;
  bool curves_known_ = false;

  int64_t last_stamp_ns_ = 0;        // of any picture
  int64_t measured_stamp_ns_ = 0;    // of the last picture with a confirmed motion, 0 = none yet
  int64_t tentative_stamp_ns_ = 0;   // of the last picture with any motion
  double tentative_distance_m_ = 0;  // there, as measured
  double off_m_ = 0;                 // sum of what steps were off inertia: wrong stamps, made good by later pictures
  double repeated_m_ = 0;            // what the train may have gone in a picture that is shown again
  bool over_gap_ = false;            // stamps say more time than pictures are apart
  double usual_s_ = 0;               // between pictures, 0 = not known
  int unmeasured_ = 0;               // pictures since the last confirmed motion
  double distance_m_ = 0;            // confirmed and reported
  double speed_mps_ = 0;
  bool speed_known_ = false;
  bool confirmed_ = false;
  int64_t restart_stamp_ns_ = 0;  // of the first picture after a gap
  double speed_before_gap_mps_ = 0;
  int64_t doubt_stamp_ns_ = 0;   // of the last picture that showed two motions, 0 = no doubt
  double rest_correlation_ = 0;  // of the patches at rest, lately ...
  int64_t rest_stamp_ns_ = 0;    // ... until then, 0 = never
};

}  // namespace railfix::odometry
