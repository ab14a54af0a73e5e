// Landmarks in, beside and over the track: found in every picture, followed over pictures, each reported once.
//
// Each kind has a search on one picture that gives candidates. What the train ran between pictures, from the ground
// itself, says where a candidate must show in the next one; only what stays in its place on the track is reported.
#pragma once

#include <memory>
#include <vector>

#include "track_detector/edge_tracker.hpp"
#include "track_detector/frog_search.hpp"
#include "track_detector/ground_motion.hpp"
#include "track_detector/ground_shade.hpp"
#include "track_detector/ground_tracker.hpp"
#include "track_detector/landmark_types.hpp"
#include "track_detector/plate_search.hpp"
#include "track_detector/platform_tracker.hpp"
#include "track_detector/upright_objects.hpp"
#include "track_detector/upright_search.hpp"
#include "vision/ground_sheet.hpp"

namespace railfix::track_detector {

/// What stands beside the track, told at way_m as of the picture that showed it nearest, if that is not long ago.
/// way_sigma: error of the way, share of it.
[[nodiscard]] Sighting sighting_of(const UprightObject& object, double way_m, int64_t now_ns, double way_sigma);

/// Error of the way past what stands beside the track, share of it: it is one with the height above the ground.
[[nodiscard]] double way_past_sigma(const LandmarkOptions& options, double height_m);

class LandmarkFinder {
 public:
  LandmarkFinder(const geometry::Intrinsics& camera, const LandmarkOptions& options);

  /// Pictures in the order of their stamps, with the pose of this picture. Gives what is settled now.
  const std::vector<Sighting>& process(const LandmarkPicture& picture);

 private:
  [[nodiscard]] bool move(const LandmarkPicture& picture);
  void find_in_track(const LandmarkPicture& picture);
  void find_platforms(const LandmarkPicture& picture);
  void find_uprights(const LandmarkPicture& picture);
  void report(Sighting sighting, const LandmarkPicture& picture);
  [[nodiscard]] double pitch_error_m(const LandmarkPicture& picture, double ahead_m, double depth_m) const;

  geometry::Intrinsics camera_;
  LandmarkOptions options_;
  std::unique_ptr<vision::TopViewMaker> maker_;
  vision::TopView view_;
  GroundMotion motion_;
  GroundShade shade_;
  double way_m_ = 0;  // run since the beginning, good to a percent
  int64_t stamp_ns_ = 0;
  double speed_mps_ = 0;
  double frog_look_m_ = -1e9;
  double platform_look_m_ = -1e9;
  std::unique_ptr<PlateSearch> plate_search_;
  GroundTracker plates_;
  FrogSearch frog_search_;
  GroundTracker frogs_;
  PlatformSearch platform_search_;
  PlatformTracker platforms_;
  UprightSearch upright_search_;
  EdgeTracker edges_;
  UprightObjects uprights_;
  std::vector<Sighting> sightings_;
};

}  // namespace railfix::track_detector
