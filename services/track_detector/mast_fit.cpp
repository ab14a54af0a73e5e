#include "track_detector/mast_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kNearShare = 0.5;       // of the widest bearing: near enough to see both edges
constexpr int kFewestTogether = 3;       // looks that show both
constexpr double kApartCells = 3.3;      // between edges, so that they do not disturb each other
constexpr double kBlurredCells = 3.0;    // edges that are nearer to one another show so far apart
constexpr double kNarrowestCells = 1.2;  // what is narrower is pushed about by a third edge, too
constexpr double kGateCells = 1.2;       // of how far apart they show: farther off, one of them is another edge
constexpr int kFewestMiddles = 8;        // for place, lateral offset and bend
constexpr double kHiddenShare = 0.5;     // of front less side
constexpr double kFarthestOffM = 0.6;    // the middle from the inner edge
constexpr double kOneEdgeSigmaM = 0.06;  // of a mast of which only one edge could be followed

// Size of a thing from how far apart its two edges are in the same pictures: its front looks smaller with the distance,
// its side with the distance squared. Errors of the pose move both edges alike. Far away the edges run together.
class SizeFit {
 public:
  SizeFit(const SettledEdge& edge, double place_m, double lateral_m)
      : place_m_(place_m), lateral_m_(std::abs(lateral_m)), apart_(kApartCells * edge.cell) {
    widest_ = std::abs(edge.measured[edge.count - 1].bearing);
  }
  void add(double way_m, double bearing, double apart) {
    if (std::abs(bearing) < kNearShare * widest_ || apart < apart_) return;
    const double ahead_m = std::max(1.0, place_m_ - way_m);
    const double side = lateral_m_ / ahead_m;
    const double weight = 1 / (ahead_m * ahead_m);
    n_ += weight;
    x_ += weight * side;
    y_ += weight * apart * ahead_m;
    xx_ += weight * side * side;
    xy_ += weight * side * apart * ahead_m;
    yy_ += weight * apart * ahead_m * apart * ahead_m;
    ++looks_;
  }
  [[nodiscard]] std::optional<MastSize> solve() const {
    const double spread = n_ * xx_ - x_ * x_;
    if (looks_ < kFewestTogether || spread < 1e-4 * n_ * n_) return std::nullopt;
    double side_m = (n_ * xy_ - x_ * y_) / spread;
    double front_m = (y_ - side_m * x_) / n_;
    if (side_m < 0) {
      side_m = 0;
      front_m = y_ / n_;
    } else if (front_m < 0) {
      front_m = 0;
      side_m = xy_ / xx_;
    }
    const double squared = yy_ - 2 * front_m * y_ - 2 * side_m * xy_ + front_m * front_m * n_ +
                           2 * front_m * side_m * x_ + side_m * side_m * xx_;
    return MastSize{front_m, side_m, std::sqrt(std::max(0.0, squared / n_)), looks_};
  }

 private:
  double place_m_, lateral_m_, apart_, widest_ = 0;
  double n_ = 0, x_ = 0, y_ = 0, xx_ = 0, xy_ = 0, yy_ = 0;
  int looks_ = 0;
};

// How far apart they show in one look (bearing).
double apart(const EdgeMeasurement& inner, const EdgeMeasurement& outer) {
  return std::abs(outer.bearing - inner.bearing);
}

// Far away two edges push each other off where they are, equally far, so that their middle stays. Where it stands, as a
// correction of the inner edge: its residuals already know the curves of the way. The curvature's error is estimated
// anew, because the inner edge's took up the push.
std::optional<MastPlace> middle_of(const SettledEdge& inner, const SettledEdge& outer, const MastSize& size) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  const double side = inner.lateral_m > 0 ? 1 : -1;
  const double nearest_way_m = inner.measured[inner.count - 1].way_m;
  int looks = 0;
  together(inner, outer, [&](const EdgeMeasurement& look, const EdgeMeasurement& other) {
    const double apart_there = apart(look, other);
    const double per_ahead = 1 / std::max(1.0, inner.place_m - look.way_m);
    const double per_place = std::abs(inner.lateral_m) * per_ahead * per_ahead;
    const double expected = size.front_m * per_ahead + size.side_m * per_place;
    if (expected < kNarrowestCells * inner.cell) return;
    if (std::abs(apart_there - std::max(expected, kBlurredCells * inner.cell)) > kGateCells * inner.cell) return;
    const Eigen::Vector3d slope(-per_place, per_ahead, nearest_way_m - look.way_m);
    normal += slope * slope.transpose();
    right += slope * (side * look.residual + 0.5 * apart_there);
    ++looks;
  });
  if (looks < kFewestMiddles) return std::nullopt;
  const Eigen::Vector3d correction = normal.ldlt().solve(right);
  if (!(std::abs(correction(0)) < kFarthestOffM)) return std::nullopt;
  return MastPlace{inner.place_m + correction(0), inner.lateral_m + side * correction(1), inner.sigma_m};
}

}  // namespace

std::optional<MastSize> size_between(const SettledEdge& inner, const SettledEdge& outer) {
  SizeFit fit(inner, 0.5 * (inner.place_m + outer.place_m), 0.5 * (inner.lateral_m + outer.lateral_m));
  together(inner, outer, [&fit](const EdgeMeasurement& look, const EdgeMeasurement& other) {
    fit.add(look.way_m, look.bearing, apart(look, other));
  });
  return fit.solve();
}

std::optional<MastSize> size_outward(const SettledEdge& edge) {
  SizeFit fit(edge, edge.place_m, edge.lateral_m);
  for (size_t i = 0; i < edge.stripe_count; ++i)
    fit.add(edge.stripe[i].way_m, edge.stripe[i].bearing, edge.stripe[i].outward);
  return fit.solve();
}

std::optional<MastSize> size_inward(const SettledEdge& edge) {
  SizeFit fit(edge, edge.place_m, edge.lateral_m);
  for (size_t i = 0; i < edge.stripe_count; ++i)
    fit.add(edge.stripe[i].way_m, edge.stripe[i].bearing, edge.stripe[i].inward);
  return fit.solve();
}

MastPlace mast_place(const SettledEdge& inner, const SettledEdge* outer, const MastSize& size) {
  std::optional<MastPlace> at;
  if (outer != nullptr) at = middle_of(inner, *outer, size);
  if (!at) {
    at = {inner.place_m - 0.5 * size.side_m, inner.lateral_m + std::copysign(0.5 * size.front_m, inner.lateral_m),
          std::hypot(inner.sigma_m, kOneEdgeSigmaM)};
  }
  // Of what shows no side, nobody knows the depth: none of a lattice or a round mast, the front's width of a square
  // one.
  const double hidden_m = kHiddenShare * std::max(0.0, size.front_m - size.side_m);
  at->place_m += hidden_m;
  at->sigma_m = std::hypot(at->sigma_m, hidden_m);
  return *at;
}

}  // namespace railfix::track_detector
