// Curvature matching alone on a real alignment: a wheel that is wrong by 1 % and a cheap gyro, nothing else. The
// matchers of map_matcher are compared: nothing, the exits of paper 004 with linear correction, the likelihood over the
// place.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "core/units.hpp"
#include "map_matcher/shape/curvature_matcher.hpp"
#include "map_matcher/shape/curve_exit_matcher.hpp"
#include "matching.hpp"
#include "support/sensed_ride.hpp"
#include "track/import/build.hpp"

namespace railfix::measure {
namespace {

constexpr double kRateHz = 50;
constexpr double kCurve = 1.0 / 5000;
constexpr double kStartSigmaM = 2.0;
constexpr double kBinM = 2.0;

/// Place and scale of the odometer, from fixes alone.
class PlaceFilter {
 public:
  void move(double way_m) {
    place_m_ += way_m * (1 + scale_);
    place_place_ += 2 * way_m * place_scale_ + way_m * way_m * scale_scale_;
    place_scale_ += way_m * scale_scale_;
  }
  void fix(double place_m, double sigma_m) {
    const double variance = place_place_ + sigma_m * sigma_m;
    const double off_m = place_m - place_m_;
    if (off_m * off_m > 16 * variance) return;
    const double k_place = place_place_ / variance;
    const double k_scale = place_scale_ / variance;
    place_m_ += k_place * off_m;
    scale_ += k_scale * off_m;
    scale_scale_ -= k_scale * place_scale_;
    place_scale_ -= k_scale * place_place_;
    place_place_ -= k_place * place_place_;
  }
  [[nodiscard]] double place_m() const { return place_m_; }
  [[nodiscard]] double sigma_m() const { return std::sqrt(place_place_); }
  explicit PlaceFilter(double place_m) : place_m_(place_m) {}

 private:
  double place_m_;
  double scale_ = 0;
  double place_place_ = kStartSigmaM * kStartSigmaM;
  double place_scale_ = 0;
  double scale_scale_ = 0.01 * 0.01;
};

struct Errors {
  std::vector<double> in_curves_m;
  std::vector<double> all_m;
  double squared_sigmas = 0;
  int fixes = 0;
  int fixes_outside = 0;  // worse than 4 sigma

  void add(double error_m, bool curve) {
    all_m.push_back(std::abs(error_m));
    if (curve) in_curves_m.push_back(std::abs(error_m));
  }
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return NAN;
  std::sort(values.begin(), values.end());
  return values[static_cast<size_t>(share * static_cast<double>(values.size() - 1))];
}

void print(const char* what, const Errors& errors) {
  std::printf(
      "%-34s in curves p50 %5.1f  p95 %5.1f  max %5.1f m; everywhere p95 %5.1f m; fixes %d, rms %.2f sigma, beyond 4 "
      "sigma %d\n",
      what, quantile(errors.in_curves_m, 0.5), quantile(errors.in_curves_m, 0.95), quantile(errors.in_curves_m, 1),
      quantile(errors.all_m, 0.95), errors.fixes, std::sqrt(errors.squared_sigmas / std::max(errors.fixes, 1)),
      errors.fixes_outside);
}

struct Comparison {
  Errors wheel;
  Errors exits;
  Errors exits_linear;
  Errors likelihood;
};

void run(const std::shared_ptr<const track::Path>& path, uint64_t seed, Comparison& sums) {
  core::Random random(seed);
  testing::RideErrors errors;
  errors.odometer_scale = (random.uniform() < 0.5 ? -1 : 1) * 0.01;
  errors.turn_bias_rps = 0.002 * random.normal();
  const double begin_m = path->begin_m() + 30;
  const double end_m = path->end_m() - 30;
  const testing::VehicleHeading heading([&](double m) { return path->curvature_at(m); }, path->begin_m(), path->end_m(),
                                        errors);
  testing::RideSensors sensors(errors, seed * 13 + 1);
  map_matcher::CurvatureParameters likelihood_parameters;
  likelihood_parameters.bias_per_m = 1e-4;
  map_matcher::CurvatureMatcher likelihood(likelihood_parameters, path);
  const double lag_m = errors.bogies_behind_m + 0.5 * errors.bogie_distance_m;
  map_matcher::CurveExitParameters exit_parameters;
  exit_parameters.least_lag_m = exit_parameters.most_lag_m = lag_m;
  map_matcher::CurveExitMatcher exits(exit_parameters, path);
  PlaceFilter by_likelihood(begin_m);
  PlaceFilter by_exits(begin_m);
  double odometer_m = begin_m;
  double pending_m = 0;
  double pending_rad = 0;
  double looked_m = begin_m;
  double at_m = begin_m;
  double speed_mps = core::mps_from_kmh(random.uniform(60, 120));
  std::vector<map_matcher::Anchor> stations;
  const auto step = [&](double time_s) {
    // The bogies turn behind the foot: what was measured belongs there.
    const double next_m = at_m + speed_mps / kRateHz;
    const auto s = sensors.step(heading, time_s, at_m, next_m, 1 / kRateHz);
    at_m = next_m;
    odometer_m += s.way_m;
    by_likelihood.move(s.way_m);
    by_exits.move(s.way_m);
    pending_m += s.way_m;
    pending_rad += s.turn_rad;
  };
  for (int i = 0; at_m < end_m; ++i) {
    if (i % 500 == 0) speed_mps = std::clamp(speed_mps + 3 * random.normal(), 14.0, 36.0);
    step(i / kRateHz);
    if (pending_m < kBinM) continue;
    const double middle_m = odometer_m - 0.5 * pending_m;
    const double noise_per_m = errors.turn_noise_rps * std::sqrt(pending_m / speed_mps / kRateHz) / pending_m;
    likelihood.add(middle_m - lag_m, pending_rad / pending_m, noise_per_m, map_matcher::CurvatureOf::body);
    exits.add(middle_m, pending_rad / pending_m, map_matcher::CurvatureOf::body);
    pending_m = pending_rad = 0;
    const auto window = [&](const PlaceFilter& filter) {
      const double bound_m = std::max(10.0, 4 * filter.sigma_m());
      return map_matcher::Prior{filter.place_m(), bound_m, bound_m, odometer_m};
    };
    const auto use = [&](const std::optional<map_matcher::Fix>& fix, PlaceFilter& filter, Errors& sum) {
      if (!fix) return;
      ++sum.fixes;
      sum.squared_sigmas += std::pow((fix->path_distance_m - at_m) / fix->sigma_m, 2);
      sum.fixes_outside += std::abs(fix->path_distance_m - at_m) > 4 * fix->sigma_m ? 1 : 0;
      filter.fix(fix->path_distance_m, fix->sigma_m);
    };
    use(exits.match(1, odometer_m, window(by_exits)), by_exits, sums.exits);
    if (odometer_m - looked_m > 5) {
      looked_m = odometer_m;
      use(likelihood.match(1, odometer_m, window(by_likelihood)), by_likelihood, sums.likelihood);
    }
    const bool curve = std::abs(path->curvature_at(at_m)) > kCurve;
    sums.wheel.add(odometer_m - at_m, curve);
    sums.exits.add(by_exits.place_m() - at_m, curve);
    stations.push_back({odometer_m, at_m});
    sums.likelihood.add(by_likelihood.place_m() - at_m, curve);
  }
  // The paper corrects afterwards, when the curves on both sides are known.
  for (const auto& station : stations) {
    const bool curve = std::abs(path->curvature_at(station.place_m)) > kCurve;
    sums.exits_linear.add(exits.corrected_m(station.odometer_m) - station.place_m, curve);
  }
  sums.exits_linear.fixes += static_cast<int>(exits.anchors().size() / 2);
}

/// Wherever the tool is started.
std::string real_alignment() {
  namespace fs = std::filesystem;
  const char* const told = std::getenv("RAILFIX_DATA");
  const fs::path data = told != nullptr ? fs::path(told) : fs::path(RAILFIX_SOURCE_DIR).parent_path() / "shared/data";
  const fs::path file = data / "alignment/sbb_mszw_a2.landxml";
  if (!fs::exists(file))
    throw core::BadInput(file.string() + " does not exist; give --map, or its folder's place as RAILFIX_DATA");
  return file;
}

}  // namespace

int measure_curvature(const MatchingOptions& options) {
  const std::string file = options.map.empty() ? real_alignment() : options.map;
  const auto map = std::make_shared<const track::Map>(core::value_or_throw(track::build_map({file}, {})).map);
  const auto longest = std::max_element(map->edges.begin(), map->edges.end(), [](const auto& a, const auto& b) {
    return a.alignment.length_m() < b.alignment.length_m();
  });
  const auto path = std::make_shared<const track::Path>(
      core::value_or_throw(track::Path::follow(map, {longest->id, 0, track::Direction::forward}, 1e6, 0)));
  Comparison sums;
  const int count = options.count > 0 ? options.count : 20;
  for (int i = 0; i < count; ++i) run(path, options.seed * 1000 + static_cast<uint64_t>(i), sums);
  std::printf("%d runs over %.1f km of %s, wheel 1 %% wrong, gyro bias 0.11 deg/s, noise 0.57 deg/s at 50 Hz\n", count,
              path->end_m() / 1000, file.c_str());
  print("wheel alone", sums.wheel);
  print("exits, linear (paper 004)", sums.exits_linear);
  print("exits, filtered", sums.exits);
  print("likelihood, filtered", sums.likelihood);
  return 0;
}

}  // namespace railfix::measure
