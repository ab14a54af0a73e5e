// Upright edges beside the track in one picture: sides of masts, of portals, of abutments.
#pragma once

#include <array>
#include <vector>

#include "track_detector/landmark_types.hpp"
#include "track_detector/picture_lines.hpp"

namespace railfix::track_detector {

struct UprightEdge {
  double bearing = 0;     // metres left per metre ahead, at the camera's height
  double inner_grey = 0;  // beside it, towards the track
  double outer_grey = 0;
  double deep_grey = -1;  // mean of what lies between it and the track farther away; negative = not seen
  [[nodiscard]] double contrast() const { return outer_grey - inner_grey; }
};

/// Looks at a band below the horizon as a level camera that looks along the track would see it: what is upright stands
/// on one bearing in all rows, what lies on the ground does not. Objects stand on the ground and reach above the
/// camera up to about 25 m ahead. Masts lean against a canted track: the lean that shows the clearest edges is kept.
class UprightSearch {
 public:
  explicit UprightSearch(const geometry::Intrinsics& camera);

  /// From right to left; valid until the next call.
  const std::vector<UprightEdge>& find(const LandmarkPicture& picture);

  /// Mean brightness between two bearings in the last picture; negative where that is not in the picture.
  [[nodiscard]] double mean_grey(double from_bearing, double to_bearing) const;
  /// Largest bearing that the last picture shows on both sides.
  [[nodiscard]] double widest_bearing() const { return widest_; }

 private:
  void look(const LandmarkPicture& picture);
  void differentiate();
  void sum_up(double lean);
  [[nodiscard]] double clearness() const;
  void collect();
  [[nodiscard]] double column_grey(int column) const;

  PictureLines lines_;
  double cell_ = 0;  // bearing between two columns
  int columns_ = 0;
  double top_slope_ = 0;
  double widest_ = 0;
  size_t lean_ = 0;
  std::array<double, 9> clear_{};  // how clear edges were with each lean, fading
  cv::Mat grey_, step_;            // CV_32F, rows from low to high, columns from right to left
  std::vector<float> sum_, squared_, score_;
  std::vector<UprightEdge> found_;
};

}  // namespace railfix::track_detector
