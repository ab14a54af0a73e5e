// Frogs: where the rail of another track crosses one of our rails at a small angle (paper 002, figure 10).
#pragma once

#include <optional>
#include <vector>

#include "track_detector/landmark_types.hpp"
#include "track_detector/picture_lines.hpp"
#include "track_detector/rail_edges.hpp"

namespace railfix::track_detector {

/// Looks at the plane of the rail heads, seen from above. A frog is a line of rail heads that runs from between our
/// rails through one of them to the outside, seen on both sides of it. Its place is where the inner edges cross,
/// measured against our own rail, so that errors of the pose cancel.
class FrogSearch {
 public:
  FrogSearch(const geometry::Intrinsics& camera, const LandmarkOptions& options);

  /// Best first; no two near each other. The result is valid until the next call.
  const std::vector<GroundCandidate>& find(const LandmarkPicture& picture);

 private:
  struct Crossing {
    int side = 1;       // of our rail that is crossed, +1 left
    double at_m = 0;    // ahead
    double slope = 0;   // metres outward per metre ahead
    double inside = 0;  // share of the rows that show the other rail
    double outside = 0;
    [[nodiscard]] double score() const { return inside < outside ? inside : outside; }
  };
  struct Point {
    double ahead_m, out_m;  // outward from where the inner edges cross
  };
  void look(const LandmarkPicture& picture);
  void rate_ridges(int row);
  [[nodiscard]] Crossing best_crossing() const;
  void rate(Crossing& crossing) const;
  bool refine(const LandmarkPicture& picture, Crossing& crossing, GroundCandidate& candidate);
  /// Where a rail is looked for: a row, the middle of its head, +1 for a left rail of its track, and how it runs.
  struct Place {
    int row = 0;
    double lateral_m = 0;
    int kind = 1;
    double slope = 0;
  };
  std::optional<double> inner_edge(const cv::Mat& grey, const geometry::View& view, const Place& place);
  [[nodiscard]] Eigen::Vector3d point_at(double ahead_m, double lateral_m) const;
  [[nodiscard]] bool peak_near(int row, double lateral_m, double& found_m) const;

  LandmarkOptions options_;
  PictureLines lines_;
  int rows_ = 0;
  int first_row_ = 0;  // the nearest that the picture shows
  cv::Mat grey_;       // CV_32F, rows x columns, near to far and right to left
  cv::Mat ridges_;     // 0..1: 1 stands out as our own rails do in this row
  cv::Mat spread_;     // the largest of each column and its neighbours
  std::vector<float> sums_;
  std::vector<Point> points_;
  double curvature_per_m_ = 0;  // of the picture
  double vertical_curvature_per_m_ = 0;
  EdgeFinder edges_;
  std::vector<GroundCandidate> found_;
};

}  // namespace railfix::track_detector
