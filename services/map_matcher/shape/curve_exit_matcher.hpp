// The curvature odometry of paper 004, section 8, as the baseline for CurvatureMatcher. The track is straights and
// curvature functions: curves, and S-curves as one. The measured curvature (equation 48) is compared with the function
// that comes next, laid with its exit on the newest measurement (49), over the function's own square (50): where this
// normalised squared error (51) has its minimum the curve has been left. That corrects the odometer at the exit and, by
// the width of the function, at the entry; in between it is mapped linearly (Fig. 17).
//
// The function is as wide as on the map, whatever the odometer's scale: in a curve of 500 m a wheel that is wrong by 1
// % moves the minimum by 2.5 m. The sigma of an exit covers it.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "map_matcher/match_types.hpp"
#include "map_matcher/shape/curvature_matcher.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

struct CurveExitParameters {
  double bin_m = 2.0;
  double straight_per_m = 1.0 / 8000;  // less curvature is none ...
  double least_straight_m = 25;        // ... if it lasts so long; the middle of an S-curve does not
  double least_turn_rad = 0.03;        // of a curve that is looked for
  double most_error = 0.35;            // normalised squared error of an exit
  double rise = 1.3;                   // the minimum is past when the error has risen by this factor ...
  double rise_m = 10;                  // ... or for this way
  double search_margin_m = 30;
  double sigma_m = 6.0;    // of an exit
  double least_lag_m = 0;  // the body turns as the track does so far behind the foot at least ...
  double most_lag_m = 0;   // ... and at most
};

/// Where the train's foot was when the odometer said so.
struct Anchor {
  double odometer_m = 0;
  double place_m = 0;
};

class CurveExitMatcher {
 public:
  CurveExitMatcher(const CurveExitParameters& parameters, std::shared_ptr<const track::Path> path);

  /// Curvature (left positive), turning over way, when the odometer said this for the foot; readings only grow.
  void add(double odometer_m, double curvature_per_m, CurvatureOf of);
  /// Where the foot is after the exit of a curve within the window, told once for each. While the promised interval is
  /// shorter than what is open of the lag nothing is told: that error is the same in every fix, and more of them must
  /// not make the place surer than it is.
  std::optional<Fix> match(int64_t stamp_ns, double odometer_m, const Prior& prior);
  /// The odometer lost the way: what came before cannot be used any more.
  void forget();
  /// Entry and exit of every curve that was recognised.
  [[nodiscard]] const std::vector<Anchor>& anchors() const { return anchors_; }
  /// Place of the foot by the linear mapping between anchors; behind the last it goes on as from exit to exit.
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
    CurvatureOf of = CurvatureOf::body;
  };
  void find_curves();
  void add_curve(double begin_m, double exit_m);
  void wait_for(size_t curve);
  [[nodiscard]] std::optional<double> error(const Curve& curve) const;
  void add_anchors(const Curve& curve);
  /// Has the body shown any of the curve, and not the rails all of it?
  [[nodiscard]] bool any_of_body(const Curve& curve) const;
  [[nodiscard]] double lag_m() const { return 0.5 * (parameters_.least_lag_m + parameters_.most_lag_m); }
  [[nodiscard]] double open_lag_m() const { return parameters_.most_lag_m - parameters_.least_lag_m; }

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
  bool has_new_ = false;  // a reading since the last match
};

}  // namespace railfix::map_matcher
