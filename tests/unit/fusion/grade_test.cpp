// The accelerometer feels the track's grade. Where the map has no heights that must not pass for a change of speed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/random.hpp"
#include "core/units.hpp"
#include "straight_run.hpp"

namespace railfix::fusion::grade_test {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr double kPeriodS = 0.05;
constexpr double kSpeedMps = 15;
constexpr double kRiseBeginsM = 1000;
constexpr double kRise = 0.02;
constexpr double kBlindFromS = 66;
constexpr double kBlindToS = 75;

std::shared_ptr<const track::Map> line_with_a_rise() {
  auto map = std::make_shared<track::Map>(*straight_line());
  const double end_m = 20000;
  map->edges[0].alignment = track::Alignment::chained(
      {0, 0, 0}, {{end_m, 0, 0}}, {{0, 0, 0}, {kRiseBeginsM, 0, 0}, {end_m, (end_m - kRiseBeginsM) * kRise, 0}});
  return map;
}

struct Ride {
  double error_in_the_dark_m = 0;
  double sigma_before_m = 0;
  double grown_m = 0;  // sigma, in the dark; the interval holds the train without IMU, too
  std::string reason;  // once the camera is back
};

// A camera and an IMU alone at one speed; in the dark the train comes to the rise. Every state must hold it.
Ride ride_over_the_rise(const std::shared_ptr<const track::Map>& map) {
  auto fusion = core::value_or_throw(Fusion::create({}, map, track::EdgePosition{1, 0, track::Direction::forward}));
  core::Random random(5);
  Ride ride;
  for (int i = 1; i * kPeriodS < kBlindToS + 5; ++i) {
    const double t_s = i * kPeriodS;
    const double way_m = kSpeedMps * t_s;
    const double grade = way_m > kRiseBeginsM ? kRise : 0.0;
    const double noise_mps2 = 0.1 * random.normal();
    fusion.add(ImuInput{at(t_s), core::kGravityMps2 * grade / std::hypot(1.0, grade) + noise_mps2, 0});
    const bool blind = t_s > kBlindFromS && t_s < kBlindToS;
    auto step = step_at(t_s, kSpeedMps, kPeriodS);
    step.valid = !blind;
    const auto state = fusion.add(step);
    if (!state) continue;
    const double error_m = state->distance_m - way_m;
    EXPECT_LT(error_m, state->over_m) << t_s << " s: " << state->reason;
    EXPECT_LT(-error_m, state->under_m) << t_s << " s: " << state->reason;
    const double sigma_m = state->sigma_m;
    if (t_s <= kBlindFromS) ride.sigma_before_m = sigma_m;
    if (blind) {
      ride.error_in_the_dark_m = std::max(ride.error_in_the_dark_m, std::abs(error_m));
      ride.grown_m = sigma_m - ride.sigma_before_m;
    }
    ride.reason = state->reason;
  }
  return ride;
}

TEST(Grade, OfAMapWithoutHeightsIsNoChangeOfSpeed) {
  const Ride ride = ride_over_the_rise(straight_line());
  EXPECT_GT(ride.error_in_the_dark_m, 2) << "no test";
  EXPECT_THAT(ride.reason, Not(HasSubstr("camera")));
}

TEST(Grade, OfTheMapIsTakenOff) {
  const Ride not_told = ride_over_the_rise(straight_line());
  const Ride told = ride_over_the_rise(line_with_a_rise());
  EXPECT_LT(told.error_in_the_dark_m, 2);
  EXPECT_LT(told.grown_m, 0.8 * not_told.grown_m);
  EXPECT_THAT(told.reason, Not(HasSubstr("camera")));
}

}  // namespace
}  // namespace railfix::fusion::grade_test
