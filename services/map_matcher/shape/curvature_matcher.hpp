// Place from the shape of the track: the measured curvature of the last few hundred metres against the map's (paper
// 004, 8). Where a curve begins or ends the place is known; on a straight or within an arc it is not, and nothing is
// said.
#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "map_matcher/match_types.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

struct CurvatureParameters {
  double bin_m = 4.0;            // measurements are averaged over this way
  double window_m = 400;         // longest way that is matched
  double noise_per_m = 2e-4;     // least sigma of one bin: car body, sleepers, map
  double correlated_bins = 1.5;  // neighbouring bins err together
  double sway_rad = 0.002;       // the body turns to and fro on its springs, one sigma, ...
  double sway_m = 6;             // ... and forgets it over about this way
  double bias_per_m = 3e-5;      // constant error of the curvature, one sigma
  double scale_sigma = 0.01;     // of the odometer
  double search_margin_m = 10;   // beyond the promised interval of train_state
  double max_sigma_m = 8.0;      // of a fix that is worth sending
  double lag_m = 0;              // the body may turn so far behind the camera's foot
  double sigma_floor_m = 1.2;    // map and the point that the curvature belongs to
  double min_probability = 0.9;
};

/// What shows a curvature: the rails as they are seen, or the turning of the body, which follows the bogies.
enum class CurvatureOf : uint8_t { rails, body };

class CurvatureMatcher {
 public:
  CurvatureMatcher(const CurvatureParameters& parameters, std::shared_ptr<const track::Path> path)
      : parameters_(parameters), path_(std::move(path)) {}

  /// Curvature (left positive) with its sigma, of the track at this odometer reading.
  void add(double odometer_m, double curvature_per_m, double sigma_per_m, CurvatureOf of);
  /// How the body turned on the way up to this reading, by a gyro whose constant error is the larger the slower it
  /// runs.
  void add(double odometer_m, const Turn& turn);
  /// Another way with distances that go on from the old one's; the measurements so far stay.
  void change_path(std::shared_ptr<const track::Path> path) { path_ = std::move(path); }
  /// The odometer lost the way (camera blind): what came before cannot be used any more.
  void forget() {
    bins_.clear();
    waiting_sigma_m_ = 0;
  }
  [[nodiscard]] size_t bins() const { return bins_.size(); }
  /// Best place now. A fix uses up its measurements, so that none is counted twice. Call it every few metres: in a wide
  /// window it looks less often.
  std::optional<Fix> match(int64_t stamp_ns, double odometer_m, const Prior& prior);

 private:
  struct Bin {
    double odometer_m = 0;  // weighted mean of its samples
    double curvature_per_m = 0;
    double weight = 0;  // of its samples, in m^2: 1 / sigma^2
    CurvatureOf of = CurvatureOf::rails;
    double gyro_per_m = 0;  // what one sigma of a gyro's constant error makes of it

    void add(const Bin& sample);
  };
  /// How a bin's error is weighed, given those of the bins before: what the body swayed to the one side within a bin it
  /// sways back in the next ones. A Kalman filter of the sway at the bin's end (in 1/m, over bin_m), whose gains depend
  /// on no candidate.
  struct Weighing {
    double way = 1;       // 1 or -1: the odometer's from bin to bin
    double of_sway = 0;   // of the last sway in what is expected, ...
    double keeps = 1;     // ... and in the next one
    double gain = 0;      // of the next sway
    double weight = 0;    // of what is not expected
    double of_bias = 1;   // a constant error in it ...
    double of_gyro = 0;   // ... and one sigma of the gyro's
    bool begins = false;  // nothing is known of the sway before
  };
  /// ... and what they leave open of the two constant errors: the inverse of their normal equations.
  struct Weighings {
    std::vector<Weighing> bins;
    double bias = 0;
    double both = 0;
    double gyro = 0;
  };
  class SwayFilter;
  void add(double odometer_m, double curvature_per_m, double sigma_per_m, CurvatureOf of, double gyro_per_m);
  struct Peak {
    double offset_m = 0;  // of the place from the prior's
    double sigma_m = 0;
    double probability = 0;
    bool at_edge = false;
  };
  /// Where the train may be, from the prior's place; it is looked for every metre.
  struct Window {
    double from_m = 0;
    double to_m = 0;
    [[nodiscard]] size_t places() const;
    [[nodiscard]] double offset_m(size_t place) const;
  };
  class MapCurvature;
  [[nodiscard]] bool any_of_body() const;
  [[nodiscard]] Weighings weighings() const;
  /// The best place by a flat prior in the window.
  [[nodiscard]] Peak search(double odometer_m, const Prior& prior) const;
  /// Of every place, lag of the body and scale of the odometer, the scales innermost.
  [[nodiscard]] std::vector<double> misfits(const Window& window, double odometer_m, double expected_m) const;
  [[nodiscard]] std::vector<double> likelihoods(const std::vector<double>& misfits, size_t places) const;
  [[nodiscard]] Peak peak_of(const std::vector<double>& likelihood, const Window& window) const;
  [[nodiscard]] double misfit(const MapCurvature& map, const Weighings& weighings, double place_m, double scale,
                              double lag_m, double odometer_m) const;

  CurvatureParameters parameters_;
  std::shared_ptr<const track::Path> path_;
  std::deque<Bin> bins_;
  std::optional<double> looked_m_;  // odometer at the last search
  double waiting_sigma_m_ = 0;      // best sigma so far of a fix that may still become better, 0 = none
};

}  // namespace railfix::map_matcher
