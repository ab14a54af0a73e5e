#include "map_matcher/shape/curvature_matcher.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/result.hpp"
#include "map_matcher/shape/curve_exit_matcher.hpp"
#include "support/sensed_ride.hpp"

namespace railfix::map_matcher::curvature_matcher_test {
namespace {

std::shared_ptr<const track::Path> line_of(const std::vector<track::Element>& elements) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, elements)});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 0}};
  return std::make_shared<const track::Path>(
      core::value_or_throw(track::Path::follow(map, {1, 0, track::Direction::forward}, 50000, 0)));
}

struct Result {
  int fixes = 0;
  double worst_sigmas = 0;
  double worst_m = 0;
};

Result run(const std::shared_ptr<const track::Path>& path, uint64_t seed, double interval_m, double noise_per_m) {
  core::Random random(seed);
  CurvatureMatcher matcher({}, path);
  const double scale = 1 + 0.005 * random.normal();
  const double prior_error_m = random.uniform(-0.9, 0.9) * interval_m;
  Result result;
  for (double s = 10; s < path->end_m() - 10; s += 0.5) {
    const double odometer_m = s * scale;
    matcher.add(odometer_m, path->curvature_at(s) + noise_per_m * random.normal(), noise_per_m, CurvatureOf::rails);
    if (std::fmod(s, 20.0) != 0) continue;
    const auto fix = matcher.match(1, odometer_m, {s + prior_error_m, interval_m, interval_m, odometer_m});
    if (!fix) continue;
    ++result.fixes;
    result.worst_sigmas = std::max(result.worst_sigmas, std::abs(fix->path_distance_m - s) / fix->sigma_m);
    result.worst_m = std::max(result.worst_m, std::abs(fix->path_distance_m - s));
  }
  return result;
}

TEST(CurvatureMatcher, SaysNothingOnAStraightOrInAnArc) {
  EXPECT_EQ(run(line_of({{3000, 0, 0}}), 1, 20, 3e-4).fixes, 0);
  EXPECT_EQ(run(line_of({{3000, 0.002, 0.002}}), 2, 20, 3e-4).fixes, 0);
}

// A speed that nobody knows once made the place no number, and the search ran beyond its memory.
TEST(CurvatureMatcher, SaysNothingWhenThePlaceIsNoNumberOrTheIntervalHasNoEnd) {
  const auto path = line_of({{300, 0, 0}, {80, 0, 0.002}, {300, 0.002, 0.002}});
  for (const Prior& prior : {Prior{NAN, 20, 20, 400}, Prior{400, NAN, 20, 400}, Prior{400, 20, INFINITY, 400},
                             Prior{400, 1e12, 20, 400}, Prior{400, -20, 20, 400}}) {
    CurvatureMatcher matcher({}, path);
    for (double s = 10; s < 450; s += 0.5) {
      matcher.add(s, path->curvature_at(s), 3e-4, CurvatureOf::rails);
      EXPECT_FALSE(matcher.match(1, s, prior));
    }
  }
}

std::shared_ptr<const track::Path> line_of_curves(uint64_t seed) {
  core::Random random(seed);
  std::vector<track::Element> elements;
  for (int k = 0; k < 4; ++k) {
    const double curvature = (random.uniform() < 0.5 ? -1 : 1) / random.uniform(400, 1200);
    for (const auto& e :
         {track::Element{random.uniform(150, 500), 0, 0}, track::Element{80, 0, curvature},
          track::Element{random.uniform(80, 300), curvature, curvature}, track::Element{80, curvature, 0}}) {
      elements.push_back(e);
    }
  }
  elements.push_back({300, 0, 0});
  return line_of(elements);
}

TEST(CurvatureMatcher, EntriesAndExitsOfCurvesGiveHonestFixes) {
  int fixes = 0;
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    const auto result = run(line_of_curves(seed), seed, 25, 5e-4);
    fixes += result.fixes;
    EXPECT_LT(result.worst_sigmas, 4) << "seed " << seed;
    EXPECT_LT(result.worst_m, 20) << "seed " << seed;
  }
  EXPECT_GE(fixes, 8 * 2);
}

/// Errors of the fixes in metres and in sigmas, as a cheap gyro feels a body that sways.
struct Swayed {
  std::vector<double> errors_m;
  std::vector<double> errors_sigmas;
  [[nodiscard]] static double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value * value;
    return std::sqrt(sum / static_cast<double>(values.size()));
  }
};

void ride_swaying(uint64_t seed, bool backwards, const CurvatureParameters& parameters, Swayed& sum) {
  constexpr double kStepM = 0.5;
  constexpr double kSpeedMps = 25;
  const auto path = line_of_curves(seed);
  testing::RideErrors errors;
  errors.odometer_scale = errors.turn_bias_rps = errors.bogies_behind_m = errors.bogie_distance_m = 0;
  const testing::VehicleHeading heading([&](double m) { return path->curvature_at(m); }, 0, path->end_m(), errors);
  testing::RideSensors sensors(errors, seed);
  CurvatureMatcher matcher(parameters, path);
  const double duration_s = kStepM / kSpeedMps;
  double s = backwards ? path->end_m() - 10 : 10;
  for (double run_m = 0; run_m < path->end_m() - 20; run_m += kStepM) {
    const double next = s + (backwards ? -kStepM : kStepM);
    const auto sensed = sensors.step(heading, run_m / kSpeedMps, s, next, duration_s);
    matcher.add(0.5 * (s + next), sensed.turn_rad / sensed.way_m, sensed.turn_sigma_rad / kStepM, CurvatureOf::body);
    s = next;
    if (std::fmod(run_m, 5.0) != 0) continue;
    const auto fix = matcher.match(1, s, {s + 8, 25, 25, s});
    if (!fix) continue;
    sum.errors_m.push_back(fix->path_distance_m - s);
    sum.errors_sigmas.push_back(sum.errors_m.back() / fix->sigma_m);
  }
}

// What sways to the one side sways back.
TEST(CurvatureMatcher, ABodyThatSwaysTellsThePlaceAllTheSame) {
  CurvatureParameters unaware;
  unaware.sway_rad = 0;
  Swayed with;
  Swayed without;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    for (const bool backwards : {false, true}) {
      ride_swaying(seed, backwards, {}, with);
      ride_swaying(seed, backwards, unaware, without);
    }
  }
  const auto told = [](const Swayed& rides) {
    return static_cast<double>(rides.errors_m.size()) / std::pow(Swayed::rms(rides.errors_m), 2);
  };
  EXPECT_GT(told(with), 1.2 * told(without)) << told(with) << " and " << told(without);
  EXPECT_LT(Swayed::rms(with.errors_sigmas), 1.0);
  for (const double sigmas : with.errors_sigmas) EXPECT_LT(std::abs(sigmas), 4);
}

// Readings further apart than the bins, at an odd distance: each bin counts all the same.
TEST(CurvatureMatcher, LooksLessOftenInAWideWindow) {
  const auto path = line_of({{2000, 0, 0}, {60, 0, 0.003}, {40, 0.003, 0.003}, {60, 0.003, 0}, {2000, 0, 0}});
  for (const double interval_m : {50.0, 1000.0}) {
    CurvatureMatcher matcher({}, path);
    double s = 1900;
    const auto look_at = [&](double to_m) {
      for (; s < to_m; s += 0.5) matcher.add(s, path->curvature_at(s), 1e-4, CurvatureOf::rails);
      return matcher.match(1, s, {s, interval_m, interval_m, s}).has_value();
    };
    EXPECT_FALSE(look_at(2180)) << "it may still become better";
    EXPECT_EQ(look_at(2185), interval_m < 100);
    EXPECT_EQ(look_at(2225), interval_m > 100);
  }
}

TEST(CurveExitMatcher, TheExitOfACurveIsFoundWhereItIs) {
  for (const double step_m : {1.3, 2.4, 3.7}) {
    const auto path = line_of({{400, 0, 0}, {80, 0, 0.002}, {250, 0.002, 0.002}, {80, 0.002, 0}, {400, 0, 0}});
    CurveExitMatcher matcher({}, path);
    int exits = 0;
    for (double s = 5; s < 1000; s += step_m) {
      matcher.add(s - 0.5 * step_m, path->curvature_at(s - 0.5 * step_m), CurvatureOf::body);
      const auto fix = matcher.match(1, s, {s, 30, 30, s});
      if (!fix) continue;
      ++exits;
      EXPECT_NEAR(fix->path_distance_m, s, 5) << "step " << step_m;
    }
    EXPECT_EQ(exits, 1) << "step " << step_m;
  }
}

/// Runs a foot over the path with a body so far behind it; the odometer reads `scale` times the way.
struct ExitRun {
  std::vector<double> errors_m;  // of the fixes
  std::vector<double> sigmas_m;
  std::vector<std::pair<double, double>> readings;  // odometer, truth
};
ExitRun run_exits(CurveExitMatcher& matcher, const track::Path& path, double lag_m, double scale, double promised_m,
                  CurvatureOf of = CurvatureOf::body) {
  ExitRun out;
  for (double s = path.begin_m() + 40; s < path.end_m(); s += 0.7) {
    matcher.add(s * scale, path.curvature_at(s - lag_m) / scale, of);
    out.readings.emplace_back(s * scale, s);
    const auto fix = matcher.match(1, s * scale, {s, promised_m, promised_m, s * scale});
    if (!fix) continue;
    out.errors_m.push_back(fix->path_distance_m - s);
    out.sigmas_m.push_back(fix->sigma_m);
  }
  return out;
}

// Paper 004, section 8: a double trapezoid is one curvature function, not two.
TEST(CurveExitMatcher, AnSCurveIsOneCurve) {
  const auto path = line_of({{300, 0, 0},
                             {80, 0, 0.002},
                             {150, 0.002, 0.002},
                             {160, 0.002, -0.002},
                             {150, -0.002, -0.002},
                             {80, -0.002, 0},
                             {300, 0, 0}});
  CurveExitMatcher matcher({}, path);
  const ExitRun run = run_exits(matcher, *path, 0, 1, 30);
  ASSERT_EQ(run.errors_m.size(), 1U);
  ASSERT_EQ(matcher.anchors().size(), 2U);  // where it begins and where it ends
  EXPECT_NEAR(matcher.anchors()[0].place_m, 300, 8);
  EXPECT_NEAR(matcher.anchors()[1].place_m, 920, 8);
  for (const Anchor& anchor : matcher.anchors()) EXPECT_NEAR(anchor.odometer_m, anchor.place_m, 2);
}

// Figure 17: between the exit of one curve and the entry of the next the wheel's error is spread evenly.
TEST(CurveExitMatcher, TheOdometerIsMappedLinearlyBetweenCurves) {
  std::vector<track::Element> elements;
  for (int i = 0; i < 3; ++i) {
    for (const auto& e : {track::Element{600, 0, 0}, track::Element{60, 0, 0.002}, track::Element{120, 0.002, 0.002},
                          track::Element{60, 0.002, 0}})
      elements.push_back(e);
  }
  elements.push_back({600, 0, 0});
  const auto path = line_of(elements);
  CurveExitMatcher matcher({}, path);
  const ExitRun run = run_exits(matcher, *path, 0, 1.01, 40);
  ASSERT_EQ(matcher.anchors().size(), 6U);
  for (const auto& [odometer_m, place_m] : run.readings) {
    if (place_m < 600) continue;  // the first curve tells nothing of the scale before it
    EXPECT_NEAR(matcher.corrected_m(odometer_m), place_m, 3.5) << place_m;
  }
  EXPECT_NEAR(matcher.corrected_m(run.readings.back().first), run.readings.back().second, 3.5);
  ASSERT_EQ(run.errors_m.size(), 3U);
  for (const double error_m : run.errors_m) EXPECT_LT(std::abs(error_m), 4);
}

TEST(CurveExitMatcher, TheLagOfTheBodyIsTakenOff) {
  const auto path = line_of({{400, 0, 0}, {80, 0, 0.002}, {250, 0.002, 0.002}, {80, 0.002, 0}, {400, 0, 0}});
  CurveExitParameters known;
  known.least_lag_m = known.most_lag_m = 11.5;
  CurveExitMatcher of_known(known, path);
  const ExitRun exact = run_exits(of_known, *path, 11.5, 1, 15);
  ASSERT_EQ(exact.errors_m.size(), 1U);
  EXPECT_LT(std::abs(exact.errors_m[0]), 2);
  EXPECT_NEAR(exact.sigmas_m[0], known.sigma_m, 1e-9);

  CurveExitParameters open;
  open.most_lag_m = 20;
  for (const double lag_m : {0.0, 10.0, 20.0}) {
    CurveExitMatcher matcher(open, path);
    const ExitRun run = run_exits(matcher, *path, lag_m, 1, 25);
    ASSERT_EQ(run.errors_m.size(), 1U) << lag_m;
    EXPECT_GT(run.sigmas_m[0], 8);
    EXPECT_LT(std::abs(run.errors_m[0]), 1.5 * run.sigmas_m[0]) << lag_m;
    CurveExitMatcher sure(open, path);
    EXPECT_TRUE(run_exits(sure, *path, lag_m, 1, 15).errors_m.empty()) << "surer than the lag lets anybody be";
  }
  CurveExitMatcher seen(open, path);
  const ExitRun rails = run_exits(seen, *path, 0, 1, 15, CurvatureOf::rails);
  ASSERT_EQ(rails.errors_m.size(), 1U);
  EXPECT_LT(std::abs(rails.errors_m[0]), 2);
}

TEST(CurveExitMatcher, ForgetsWhatCameBeforeTheCameraWasBlind) {
  const auto path = line_of({{400, 0, 0}, {80, 0, 0.002}, {250, 0.002, 0.002}, {80, 0.002, 0}, {400, 0, 0}});
  CurveExitMatcher matcher({}, path);
  for (double s = 50; s < 805; s += 1) {
    matcher.add(s, path->curvature_at(s), CurvatureOf::body);
    EXPECT_FALSE(matcher.match(1, s, {s, 30, 30, s}));
  }
  matcher.forget();
  for (double s = 805; s < 1200; s += 1) {
    matcher.add(s, path->curvature_at(s), CurvatureOf::body);
    EXPECT_FALSE(matcher.match(1, s, {s, 30, 30, s})) << s;
  }
}

// The body of a car whose bogies' middle lies 11.5 m behind the foot. Rails that are seen, too, tell the lag.
TEST(CurvatureMatcher, ABodyThatTurnsBehindTheFootIsInTheSigma) {
  const auto path = line_of({{400, 0, 0}, {80, 0, 0.002}, {250, 0.002, 0.002}, {80, 0.002, 0}, {400, 0, 0}});
  CurvatureParameters parameters;
  parameters.lag_m = 20;
  for (const double lag_m : {0.0, 3.0, 11.5, 20.0}) {
    for (const bool rails : {false, true}) {
      CurvatureMatcher matcher(parameters, path);
      int fixes = 0;
      for (double s = 30; s < 1150; s += 0.5) {
        matcher.add(s, path->curvature_at(s - lag_m), 3e-4, CurvatureOf::body);
        if (rails) matcher.add(s, path->curvature_at(s), 3e-4, CurvatureOf::rails);
        if (std::fmod(s, 10.0) != 0) continue;
        if (!rails) {
          EXPECT_FALSE(CurvatureMatcher(matcher).match(1, s, {s, 15, 15, s})) << "lag " << lag_m;
        }
        const auto fix = matcher.match(1, s, {s + 3, 25, 25, s});
        if (!fix) continue;
        ++fixes;
        EXPECT_LT(std::abs(fix->path_distance_m - s), 2.5 * fix->sigma_m) << "lag " << lag_m << " at " << s;
        if (rails) {
          EXPECT_NEAR(fix->path_distance_m, s, 3) << "lag " << lag_m;
        }
      }
      EXPECT_GE(fixes, 1) << "lag " << lag_m << (rails ? " with rails" : "");
    }
  }
}

TEST(CurvatureMatcher, ForgetsWhatCameBeforeTheCameraWasBlind) {
  const auto path = line_of({{300, 0, 0}, {80, 0, 0.002}, {300, 0.002, 0.002}});
  CurvatureMatcher matcher({}, path);
  for (double s = 100; s < 400; s += 0.5) matcher.add(s, path->curvature_at(s), 2e-4, CurvatureOf::rails);
  matcher.forget();
  EXPECT_FALSE(matcher.match(1, 400, {400, 20, 20, 400}));
}

}  // namespace
}  // namespace railfix::map_matcher::curvature_matcher_test
