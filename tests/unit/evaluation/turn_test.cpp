#include "evaluation/turn.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "evaluation/motion.hpp"

namespace railfix::evaluation {
namespace {

constexpr double kSpeedMps = 20;

/// A line that bends to and fro, or not at all, run at 20 m/s.
struct Line {
  double most_per_m = 0.002;
  double lead_m = 0;
  double bias_rps = 0;
  double blind_from_s = 1e9;

  [[nodiscard]] double curvature_per_m(double place_m) const { return most_per_m * std::sin(place_m / 40); }
  [[nodiscard]] double heading_rad(double place_m) const { return 3.1 + most_per_m * 40 * std::cos(place_m / 40); }

  [[nodiscard]] TurnResult judged() const {
    std::vector<dataset::TruthRow> truth;
    std::vector<OdometryRow> rows;
    for (int i = 0; i <= 1500; ++i) {
      const double time_s = i / 30.0;
      dataset::TruthRow real;
      real.stamp_ns = std::llround(time_s * 1e9);
      real.distance_m = kSpeedMps * time_s;
      real.curvature_per_m = curvature_per_m(real.distance_m);
      real.heading_rad = heading_rad(real.distance_m);
      truth.push_back(real);
      // Of the step that ends here.
      const double rate_rps = kSpeedMps * curvature_per_m(real.distance_m - kSpeedMps / 60 + lead_m) + bias_rps;
      rows.push_back({real.stamp_ns, time_s < blind_from_s, real.distance_m, kSpeedMps, "track", rate_rps});
    }
    return judge_odometry({truth, {}, {}}, rows).turn;
  }
};

TEST(Turn, OfTheFootDoesNotLead) {
  Line line;
  line.bias_rps = 0.001;
  const auto turn = line.judged();
  EXPECT_EQ(turn.stretches, 3U);
  EXPECT_NEAR(turn.lead_m, 0, 0.1);
  EXPECT_LT(turn.error_rad, 1e-4);
}

TEST(Turn, OfTheTrackAheadLeads) {
  Line line;
  line.lead_m = 3;
  const auto turn = line.judged();
  EXPECT_NEAR(turn.lead_m, 3, 0.1);
  EXPECT_NEAR(turn.error_rad, 3 * 0.002 / std::sqrt(2.0), 6e-4);
  line.lead_m = -6;
  EXPECT_NEAR(line.judged().lead_m, -6, 0.2);
}

TEST(Turn, OnStraightTrackNobodyCanSay) {
  Line line;
  line.most_per_m = 0;
  EXPECT_EQ(line.judged().stretches, 3U);
  EXPECT_TRUE(std::isnan(line.judged().lead_m));
}

TEST(Turn, StretchesHaveNoGap) {
  Line line;
  line.blind_from_s = 29;
  EXPECT_EQ(line.judged().stretches, 1U);
}

}  // namespace
}  // namespace railfix::evaluation
