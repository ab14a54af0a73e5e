#include "evaluation/turn.hpp"

#include <cmath>

#include "core/time.hpp"

namespace railfix::evaluation {
namespace {

constexpr double kStretchM = 300;
constexpr double kPointM = 5;
constexpr double kLongestGapS = 0.5;
constexpr double kBendsPerM = 1e-4;  // rms of the curvature in all stretches, below which nothing leads

struct Point {
  double way_m = 0;
  double error_rad = 0;
  double curvature_per_m = 0;
};

/// Without the straight line that fits best.
template <class Of>
std::vector<double> without_line(const std::vector<Point>& points, Of of) {
  const auto count = static_cast<double>(points.size());
  double way_m = 0;
  double value = 0;
  for (const Point& point : points) {
    way_m += point.way_m / count;
    value += of(point) / count;
  }
  double both = 0;
  double ways = 0;
  for (const Point& point : points) {
    both += (point.way_m - way_m) * (of(point) - value);
    ways += (point.way_m - way_m) * (point.way_m - way_m);
  }
  std::vector<double> rest;
  for (const Point& point : points) rest.push_back(of(point) - value - both / ways * (point.way_m - way_m));
  return rest;
}

class Stretches {
 public:
  void add(const Point& point) {
    if (!points_.empty() && point.way_m < points_.back().way_m + kPointM) return;
    points_.push_back(point);
    if (points_.back().way_m - points_.front().way_m >= kStretchM) use();
  }
  void gap() { points_.clear(); }

  [[nodiscard]] TurnResult result() const {
    TurnResult result;
    result.stretches = stretches_;
    if (count_ == 0) return result;
    const auto count = static_cast<double>(count_);
    result.error_rad = std::sqrt(squared_error_ / count);
    if (std::sqrt(squared_curvature_ / count) > kBendsPerM) result.lead_m = both_ / squared_curvature_;
    return result;
  }

 private:
  // What leads by l is wrong by l times the curvature.
  void use() {
    const auto error = without_line(points_, [](const Point& point) { return point.error_rad; });
    const auto curvature = without_line(points_, [](const Point& point) { return point.curvature_per_m; });
    for (size_t i = 0; i < points_.size(); ++i) {
      squared_error_ += error[i] * error[i];
      both_ += error[i] * curvature[i];
      squared_curvature_ += curvature[i] * curvature[i];
    }
    count_ += points_.size();
    ++stretches_;
    points_.clear();
  }

  std::vector<Point> points_;
  double squared_error_ = 0;
  double both_ = 0;
  double squared_curvature_ = 0;
  size_t count_ = 0;
  size_t stretches_ = 0;
};

}  // namespace

TurnResult judge_turn(const Truth& truth, const std::vector<OdometryRow>& rows) {
  Stretches stretches;
  double error_rad = 0;
  std::optional<dataset::TruthRow> before;
  for (const OdometryRow& row : rows) {
    const auto real = truth.at(row.stamp_ns);
    const bool goes_on = before && real && row.valid && std::isfinite(row.yaw_rate_rps) &&
                         real->distance_m >= before->distance_m &&
                         core::seconds(row.stamp_ns - before->stamp_ns) < kLongestGapS;
    if (goes_on) {
      // Headings are clockwise, turns to the left.
      const double turned_left_rad = -std::remainder(real->heading_rad - before->heading_rad, 2 * M_PI);
      error_rad += row.yaw_rate_rps * core::seconds(row.stamp_ns - before->stamp_ns) - turned_left_rad;
      stretches.add({real->distance_m, error_rad, real->curvature_per_m});
    } else {
      stretches.gap();
    }
    before = real;
    if (before) before->stamp_ns = row.stamp_ns;
  }
  return stretches.result();
}

}  // namespace railfix::evaluation
