#include "track_detector/branch_search.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kBendsPerM[] = {1.0 / 190, 1.0 / 240, 1.0 / 300, 1.0 / 400, 1.0 / 500, 1.0 / 760, 1.0 / 1200};
constexpr double kFirstFromM = -30.0;
constexpr double kFromStepM = 1.5;
// Where the other leg is looked for: nearer its heads merge with the followed ones, farther it is another track.
constexpr double kLeastApartM = 0.14;
constexpr double kMostApartM = 0.95;
constexpr size_t kLeastRows = 5;
constexpr double kLeastScore = 0.3;
constexpr double kLeastShareOfOwn = 0.55;
constexpr int kSlackColumns = 1;

/// Largest score near a column.
double around(const float* scores, double column, int columns) {
  const int c = static_cast<int>(std::lround(column));
  if (c < kSlackColumns || c + kSlackColumns >= columns) return 0;
  float best = 0;
  for (int k = -kSlackColumns; k <= kSlackColumns; ++k) best = std::max(best, scores[c + k]);
  return static_cast<double>(best);
}

}  // namespace

void BranchSearch::place_rows(const TopView& view, const cv::Mat& ridges, const geometry::Intrinsics& camera,
                              const TrackShape& shape, double gauge_m, double head_m) {
  const geometry::View now(camera, shape.camera);
  const geometry::View mounted(camera, view.pose());
  rows_.clear();
  rows_.reserve(static_cast<size_t>(view.rows()));
  for (int r = 0; r < view.rows(); ++r) {
    Row row;
    row.ahead_m = view.ahead_m(r);
    const auto left = now.project(rail_point(shape, Side::left, gauge_m, row.ahead_m, head_m / 2));
    const auto right = now.project(rail_point(shape, Side::right, gauge_m, row.ahead_m, head_m / 2));
    if (!left || !right) continue;
    const auto left_seen = mounted.on_plane(*left, 0);
    const auto right_seen = mounted.on_plane(*right, 0);
    if (!left_seen || !right_seen) continue;
    // The shaken picture shows the row a little nearer or farther than the mount's view has it.
    const double middle_m = (left_seen->x() + right_seen->x()) / 2;
    int nearest = r;
    while (nearest > 0 && view.ahead_m(nearest) > middle_m) --nearest;
    while (nearest + 1 < view.rows() && view.ahead_m(nearest + 1) < middle_m) ++nearest;
    row.scores = ridges.ptr<float>(nearest);
    row.left = view.column_of(left_seen->y());
    row.right = view.column_of(right_seen->y());
    row.columns_per_m = (row.left - row.right) / (gauge_m + head_m);
    row.own = std::sqrt(around(row.scores, row.left, view.columns()) * around(row.scores, row.right, view.columns()));
    rows_.push_back(row);
  }
}

double BranchSearch::score(double from_m, double bend_per_m, int columns) const {
  double left = 0;
  double right = 0;
  double own = 0;
  size_t count = 0;
  for (const auto& row : rows_) {
    const double past_m = row.ahead_m - from_m;
    if (past_m <= 0) continue;
    const double apart_m = 0.5 * bend_per_m * past_m * past_m;
    if (std::abs(apart_m) < kLeastApartM || std::abs(apart_m) > kMostApartM) continue;
    const double shift = apart_m * row.columns_per_m;
    left += around(row.scores, row.left + shift, columns);
    right += around(row.scores, row.right + shift, columns);
    own += row.own;
    ++count;
  }
  if (count < kLeastRows) return 0;
  const double found = std::min(left, right) / static_cast<double>(count);
  return found >= kLeastShareOfOwn * own / static_cast<double>(count) ? found : 0;
}

std::optional<Branch> BranchSearch::find(const TopView& view, const cv::Mat& ridges, const geometry::Intrinsics& camera,
                                         const TrackShape& shape, double gauge_m, double head_m) {
  place_rows(view, ridges, camera, shape, gauge_m, head_m);
  Branch best;
  best.score = kLeastScore;
  for (double from_m = kFirstFromM; from_m < view.ahead_m(view.rows() - 1); from_m += kFromStepM) {
    for (const double bend_per_m : kBendsPerM) {
      for (const double signed_bend : {bend_per_m, -bend_per_m}) {
        const double found = score(from_m, signed_bend, view.columns());
        if (found > best.score) best = {from_m, signed_bend, found};
      }
    }
  }
  if (best.bend_per_m == 0) return std::nullopt;
  return best;
}

TrackShape other_leg(const TrackShape& shape, const Branch& branch) {
  TrackShape leg = shape;
  leg.curvature_per_m += branch.bend_per_m;
  leg.camera.yaw_rad += branch.bend_per_m * branch.from_m;
  leg.camera.lateral_m -= 0.5 * branch.bend_per_m * branch.from_m * branch.from_m;
  return leg;
}

}  // namespace railfix::track_detector
