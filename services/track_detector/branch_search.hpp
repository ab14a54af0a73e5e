// A second pair of rails at the gauge that leaves the followed one or joins it: the other leg of a switch. Which leg
// the train takes cannot be known before the blades, so the detector must know that there is another.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "track_detector/rail_fit.hpp"
#include "track_detector/top_view.hpp"

namespace railfix::track_detector {

/// The other leg lies `bend_per_m` (X - from_m)^2 / 2 to the left of the followed one, where X > from_m.
struct Branch {
  double from_m = 0;      // ahead of the camera; negative: the legs part behind it
  double bend_per_m = 0;  // left positive
  double score = 0;       // 0..1, of the other leg where it is apart
};

/// Keeps its buffers between pictures.
class BranchSearch {
 public:
  /// `ridges`: the scores of `view` for this picture; `shape`: the rails that are followed.
  std::optional<Branch> find(const TopView& view, const cv::Mat& ridges, const geometry::Intrinsics& camera,
                             const TrackShape& shape, double gauge_m, double head_m);

 private:
  struct Row {
    const float* scores = nullptr;
    double ahead_m = 0;
    double columns_per_m = 0;
    double left = 0;  // columns of the middles of the followed heads
    double right = 0;
    double own = 0;
  };
  void place_rows(const TopView& view, const cv::Mat& ridges, const geometry::Intrinsics& camera,
                  const TrackShape& shape, double gauge_m, double head_m);
  [[nodiscard]] double score(double from_m, double bend_per_m, int columns) const;

  std::vector<Row> rows_;
};

/// The other leg as a shape of its own; good where the legs part not far ahead of the camera.
TrackShape other_leg(const TrackShape& shape, const Branch& branch);

}  // namespace railfix::track_detector
