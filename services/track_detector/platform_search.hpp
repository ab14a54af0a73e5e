// Where a platform's edge begins or ends in one picture.
#pragma once

#include <vector>

#include "track_detector/landmark_types.hpp"
#include "track_detector/picture_lines.hpp"

namespace railfix::track_detector {

constexpr double kUsualPlatformM = 0.55;  // height over the rail heads of the plane that is looked at

/// On the plane of usual platforms; a platform of another height is seen nearer or farther and closer or wider by one
/// and the same factor.
struct PlatformMark {
  int side = 1;        // +1 left
  bool begins = true;  // seen from the train as it comes
  double ahead_m = 0;
  double beside_m = 0;  // from the track centre, positive
  double score = 0;     // 0..1, of the edge against its continuation
};

/// A platform edge is a long straight step of brightness beside the track. It begins where the step does.
class PlatformSearch {
 public:
  explicit PlatformSearch(const geometry::Intrinsics& camera);

  /// At most one beginning and one end a side; valid until the next call.
  const std::vector<PlatformMark>& find(const LandmarkPicture& picture);

 private:
  void look(const LandmarkPicture& picture, int side);
  void rate_steps();
  struct Best {
    int column = 0;
    int row = 0;
    float edge = 0, free = 0;  // mean steps there
  };
  void collect(int side, double polarity);
  void add_up(int column, float sign);
  [[nodiscard]] float steep_mean(int first, int last) const;
  void rate(Best& best, int column, int row, int first_edge, int last_edge, int first_free, int last_free) const;

  PictureLines lines_;
  int rows_ = 0;
  std::vector<int> first_row_;  // of each column that is in the picture
  cv::Mat grey_;                // CV_32F, rows near to far, columns outward
  cv::Mat steps_;               // whole steps, brighter outward positive
  std::vector<float> sums_, steep_sums_;
  std::vector<PlatformMark> found_;
};

}  // namespace railfix::track_detector
