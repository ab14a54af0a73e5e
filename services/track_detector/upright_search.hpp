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
  double wall_grey = -1;  // mean of what lies behind it on the track's side; negative = not seen
  double deep_grey = -1;  // the same, farther away
  // Bearing to the next edge, if that is where the brightness steps back; else 0.
  double outward = 0, inward = 0;
  [[nodiscard]] double contrast() const { return outer_grey - inner_grey; }
};

/// How the brightness steps from bearing to bearing, over the whole band of one picture.
struct UprightProfile {
  double cell = 0;                              // bearing between two columns
  double widest = 0;                            // largest bearing that the picture shows on both sides
  double beside_grey = 0;                       // mean of what lies far beside the track, of the darker side
  std::vector<float> step;                      // grey levels, brighter on the left positive; from right to left
  std::vector<float> score;                     // the same against its scatter over the rows
  std::array<std::vector<float>, 2> half_step;  // as step, of the lower and of the upper rows alone
  [[nodiscard]] double bearing(double column) const {
    return (column - 0.5 * (static_cast<double>(step.size()) - 1)) * cell;
  }
  [[nodiscard]] double column(double at) const { return at / cell + 0.5 * (static_cast<double>(step.size()) - 1); }
};

/// Looks at a band below the horizon as a level camera that looks along the track would see it: what is upright stands
/// on one bearing in all rows, what lies on the ground does not. Objects stand on the ground and reach above the
/// camera up to about 25 m ahead. Masts lean against a canted track: the lean that shows the clearest edges is kept.
class UprightSearch {
 public:
  explicit UprightSearch(const geometry::Intrinsics& camera);

  /// From right to left; valid until the next call.
  const std::vector<UprightEdge>& find(const LandmarkPicture& picture);

  /// Of the last picture.
  [[nodiscard]] const UprightProfile& profile() const { return profile_; }

 private:
  /// Rise per metre ahead, and how many columns a thing with that lean is moved by.
  [[nodiscard]] double slope_of(int row) const;
  [[nodiscard]] int shift_of(int row, double lean) const;
  void look(const LandmarkPicture& picture);
  void differentiate();
  void sum_up(double lean);
  void sum_up_halves();
  [[nodiscard]] double clearness() const;
  void look_beside();
  void collect();
  void pair();
  [[nodiscard]] double column_grey(int column) const;
  [[nodiscard]] double mean_grey(double bearing, const double (&share)[2]) const;

  PictureLines lines_;
  double cell_ = 0;
  int columns_ = 0;
  double top_slope_ = 0;
  size_t lean_ = 0;
  std::array<double, 9> clear_{};  // how clear edges were with each lean, fading
  cv::Mat grey_, step_;            // CV_32F, rows from low to high, columns from right to left
  std::vector<float> squared_;
  UprightProfile profile_;
  std::vector<UprightEdge> found_;
};

}  // namespace railfix::track_detector
