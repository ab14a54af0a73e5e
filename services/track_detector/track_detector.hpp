// Rails in one picture after the other -> camera shake and track curvature, or "not seen".
#pragma once

#include <array>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "track_detector/branch_search.hpp"
#include "track_detector/rail_edges.hpp"
#include "track_detector/rail_fit.hpp"
#include "track_detector/rail_search.hpp"

namespace railfix::track_detector {

struct DetectorOptions {
  double gauge_m = 1.435;  // between the inner edges of the rail heads
  double head_m = 0.07;    // width of a rail head
  double far_m = 60;       // rails are followed as far as this
  /// What the suspension and the track do to the camera, one sigma about the mount; also limits the search (3 sigma).
  TrackShapeSigma limits{0.008, 0.008, 0.02, 0.10, 0.04, 0.003, 0.0005, 3e-5};
  double rail_offset_sigma_m = 0.001;  // of a whole rail's edges: gauge, wear
  double min_contrast = 6;             // grey levels of a rail head against both its sides
  double min_supported = 0.5;          // share of the stations that must show a rail for "seen"
};

/// What another sensor says about the roll of the camera against the track.
struct RollHint {
  double roll_rad = 0;
  double sigma_rad = 0.01;
};

/// One picture's answer. Without `seen_left` or `seen_right` the shape is the mount and the covariance that of the
/// limits.
struct TrackObservation {
  bool seen_left = false;
  bool seen_right = false;
  [[nodiscard]] bool seen() const { return seen_left && seen_right; }
  TrackShape shape;
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();  // order of ShapeVector
  double condition = 0;
  double residual_px = 0;
  double confidence = 0;          // 0..1
  std::vector<EdgePoint> points;  // inner edges that the fit uses, left rail first, near to far
  double near_m = 0;              // the rails were looked for from here ...
  double far_m = 0;               // ... to here
  bool branches = false;          // another leg leaves ahead and which one is the own is not known: far_m ends there
  std::string reason;             // why not seen

  /// Nothing seen; keeps its memory.
  void clear();
};

class TrackDetector {
 public:
  TrackDetector(const geometry::Intrinsics& camera, const geometry::CameraPose& mount, const DetectorOptions& options);

  /// Grey picture (CV_8UC1) of the camera's size. Starts from the previous picture's answer where it still holds, else
  /// searches the whole range of the limits. `roll`: straight rails alone cannot tell it from a sideways position.
  /// The answer is valid until the next call.
  const TrackObservation& detect(const cv::Mat& grey, const std::optional<RollHint>& roll = std::nullopt);
  /// The answer for a picture that is not worth looking at.
  const TrackObservation& not_seen(const char* why);
  /// Forgets the previous picture.
  void reset() {
    previous_.reset();
    misses_ = 0;
    usual_ = last_ = to_vector(mount_);
    edge_finder_.forget();
  }

  [[nodiscard]] const geometry::Intrinsics& camera() const { return camera_; }
  [[nodiscard]] const TrackShape& mount() const { return mount_; }
  [[nodiscard]] const DetectorOptions& options() const { return options_; }

 private:
  bool follow(const cv::Mat& grey);
  void search(const cv::Mat& grey, bool dark, TrackObservation& best);
  void refine(const cv::Mat& grey, const TrackShape& start, bool dark, double first_reach_m,
              TrackObservation& observation);
  /// `last`: of the passes, with an honest covariance.
  const RailFit& fit(const std::vector<EdgePoint>& points, const TrackShape& start, bool last,
                     double rail_offset_sigma_m = 0);
  /// An edge within this of the fit supports the rail.
  [[nodiscard]] double support_px(const RailEdge& edge) const;
  void judge(const std::vector<RailEdge>& edges, const std::array<int, 2>& tried, const RailFit& fit,
             TrackObservation& observation);
  /// How far edges stand out of the noise and lie together: noise is below 1.5, rails above.
  double clearness(std::span<const RailEdge> edges, std::span<const double> residuals_px);
  /// Nothing is left where the one rail is doubtful.
  void keep_one_rail(const std::vector<RailEdge>& edges, const std::array<int, 2>& tried,
                     TrackObservation& observation);
  /// Where the camera usually is, or was a moment ago.
  [[nodiscard]] bool is_usual(const TrackShape& shape) const;
  /// Goes over to the other leg of a switch where the train stands better on it; else ends where the legs part.
  void choose_leg(const cv::Mat& grey, bool dark, TrackObservation& observation);
  /// How far the pose is from another (the usual one), in sigmas squared.
  [[nodiscard]] double displacement(const TrackShape& shape, const ShapeVector& from) const;
  void end_at(double far_m, TrackObservation& observation);
  void forget(TrackObservation& observation) const;
  /// Why the pose cannot be; null when it can.
  [[nodiscard]] const char* outside_limits(const TrackShape& shape) const;

  geometry::Intrinsics camera_;
  TrackShape mount_;
  DetectorOptions options_;
  SearchLimits search_limits_;
  double near_m_ = 0;
  std::unique_ptr<TopView> top_view_;
  std::unique_ptr<RailSearch> search_;
  BranchSearch branch_search_;
  EdgeFinder edge_finder_;
  RailFitter fitter_;
  std::vector<EdgePoint> points_;
  std::vector<double> clear_;
  TrackObservation observation_;  // the answer
  TrackObservation found_;        // of one kind of rails
  TrackObservation trial_;        // of one candidate, of one leg
  std::optional<TrackShape> previous_;
  ShapeVector usual_;  // slow mean of the pose
  ShapeVector last_;   // pose of the last pair
  std::optional<RollHint> roll_;
  int misses_ = 0;     // pictures without rails in a row
  bool dark_ = false;  // the previous picture's rails are darker than the ground
};

}  // namespace railfix::track_detector
