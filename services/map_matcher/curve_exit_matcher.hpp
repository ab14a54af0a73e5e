// The curvature odometry of paper 004, section 8 (equations 48-51), as the baseline for CurvatureMatcher: the shape of
// the curve that comes next is compared with the last measurements; where the normalised squared error has its minimum
// the exit of the curve has been reached. Between two exits the odometer is corrected linearly.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "map_matcher/match_types.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

struct CurveExitParameters {
  double bin_m = 2.0;
  double straight_per_m = 1.0 / 8000;  // less curvature is none
  double least_turn_rad = 0.03;        // of a curve that is looked for
  double most_error = 0.35;            // normalised squared error of an exit
  double rise = 1.3;                   // the minimum is past when the error has risen by this factor ...
  double rise_m = 10;                  // ... or for this way
  double search_margin_m = 30;
  double sigma_m = 6.0;  // of an exit
};

/// Where the train was when the odometer said so.
struct Anchor {
  double odometer_m = 0;
  double place_m = 0;
};

class CurveExitMatcher {
 public:
  CurveExitMatcher(const CurveExitParameters& parameters, std::shared_ptr<const track::Path> path);

  /// Curvature (left positive) of the track at this odometer reading; readings only grow.
  void add(double odometer_m, double curvature_per_m);
  /// The exit of a curve within the window, told once.
  std::optional<Fix> match(int64_t stamp_ns, double odometer_m, const Prior& prior);
  [[nodiscard]] const std::vector<Anchor>& anchors() const { return anchors_; }
  /// Place by the linear mapping between anchors; before the first and behind the last its slope goes on.
  [[nodiscard]] double corrected_m(double odometer_m) const;

 private:
  /// A stretch without straight in it (normal curve or S-curve).
  struct Curve {
    double begin_m = 0;
    double exit_m = 0;
    std::vector<double> shape;  // every bin, to the exit
    double squared = 0;         // normalisation, equation 50
  };
  struct Bin {
    double odometer_m = 0;
    double curvature_per_m = 0;
    int count = 0;
  };
  void find_curves();
  void wait_for(size_t curve);
  [[nodiscard]] std::optional<double> error(const Curve& curve) const;

  CurveExitParameters parameters_;
  std::shared_ptr<const track::Path> path_;
  std::vector<Curve> curves_;
  std::deque<Bin> bins_;  // every bin_m, the last one is being filled
  std::vector<Anchor> anchors_;
  size_t next_ = 0;  // curve that is waited for
  double least_error_ = 1;
  double least_at_m_ = 0;
  double most_before_ = 0;  // a minimum has larger errors on both sides
  bool fallen_ = false;
};

}  // namespace railfix::map_matcher
