#include "compare/doubts.hpp"

#include <gtest/gtest.h>

#include "core/random.hpp"
#include "unit/compare/made_up_reports.hpp"

namespace railfix::compare {
namespace {

using namespace testing;

// Half of the reports at standstill, ours always 5 m ahead: the place differs, not the time.
TEST(TimeShift, AHaltIsNoTimeShift) {
  std::vector<TimedReport> ours;
  std::vector<TimedReport> certified;
  for (int i = 0; i < 40; ++i) {
    const double speed_kmh = i < 20 ? 100 : 0;
    const double front_m = -std::min(i, 20) * 100 / 3.6;
    ours.push_back(report(i, kA, front_m - 5, speed_kmh, false));
    certified.push_back(report(i, kA, front_m, speed_kmh, false));
  }
  EXPECT_NEAR(time_shift(pair_up(ours, certified, Axes(), kGapNs).pairs).shift_s, 0, 1e-3);
}

TEST(TimeShift, LateStampsShowInTheSpeed) {
  std::vector<TimedReport> ours;
  std::vector<TimedReport> certified;
  double way_m = 0;
  for (int i = 0; i < 60; ++i) {
    const double speed_kmh = 5 * (10 + i % 20);
    way_m += speed_kmh / 3.6;
    ours.push_back(report(i, kA, way_m, speed_kmh));
    certified.push_back(report(i, kA, way_m - 0.5 * speed_kmh / 3.6, speed_kmh));  // where it was half a second ago
  }
  const auto shift = time_shift(pair_up(ours, certified, Axes(), kGapNs).pairs);
  EXPECT_NEAR(shift.shift_s, 0.5, 0.01);
  EXPECT_LT(shift.sigma_s, 0.01);
  EXPECT_TRUE(std::isnan(time_shift(std::vector<Lag>{}).shift_s));
}

// An error that a leg keeps is one error, however many reports repeat it.
TEST(TimeShift, LegsErrAsOne) {
  core::Random random(1);
  int beyond = 0;
  for (int turn = 0; turn < 300; ++turn) {
    std::vector<Lag> lags;
    for (size_t leg = 0; leg < 40; ++leg) {
      const double error_m = random.normal(0, 3);
      const double speed_mps = 20 + 20 * random.uniform();
      for (int i = 0; i < 30; ++i) lags.push_back({leg, speed_mps, error_m});
    }
    const auto shift = time_shift(lags);
    beyond += std::abs(shift.shift_s) > 3 * shift.sigma_s;
  }
  EXPECT_LE(beyond, 6);
}

/// One group, `doubt_m` to both sides, now fast, now slow, `late_s` late.
std::vector<TimedReport> ride(double doubt_m, double late_s) {
  std::vector<TimedReport> reports;
  double way_m = 0;
  for (int i = 0; i < 60; ++i) {
    const double speed_kmh = 5 * (10 + i % 20);
    way_m += speed_kmh / 3.6;
    auto timed = report(i, kA, way_m - late_s * speed_kmh / 3.6, speed_kmh);
    timed.fields.l_doubtover = timed.fields.l_doubtunder = static_cast<uint32_t>(10 * doubt_m);
    reports.push_back(timed);
  }
  return reports;
}

// Half a second is 15 m.
TEST(Doubts, StampsMatterBesideWhatIsCompared) {
  const auto doubts = [](double doubt_m, double offset_s) {
    return doubts_of(pair_up(ride(doubt_m, 0), ride(doubt_m, 0.5), Axes(), kGapNs), std::nullopt, offset_s);
  };
  ASSERT_TRUE(doubts(15, 0).stamps.has_value());
  EXPECT_NEAR(doubts(15, 0).stamps->shift_s, 0.5, 0.01);
  EXPECT_NEAR(doubts(15, 0).stamps->offset_s, -0.5, 0.01);
  EXPECT_NEAR(doubts(15, 2).stamps->offset_s, 1.5, 0.01) << "what was put right already counts";
  EXPECT_FALSE(doubts(15, 0).stamps->by_truth);
  EXPECT_FALSE(doubts(200, 0).stamps.has_value());
}

// Ours are late and the certified ones right: with the truth that is no reason to put the certified ones "right".
TEST(Doubts, TheTruthSaysWhoseStampsAreOff) {
  std::vector<dataset::TruthRow> rows;
  double way_m = 0;
  for (int i = 0; i < 60; ++i) {
    way_m += 5 * (10 + i % 20) / 3.6;
    rows.emplace_back();
    rows.back().stamp_ns = i * core::kNsPerSecond;
    rows.back().distance_m = way_m;
  }
  const double begin_m = rows.front().distance_m;
  const evaluation::Truth truth(rows, std::nullopt, std::nullopt);
  const Judge judge{&truth, begin_m};
  const auto doubts = [&](double ours_s, double certified_s) {
    return doubts_of(pair_up(ride(5, ours_s), ride(5, certified_s), Axes(), kGapNs), judge, 0);
  };
  EXPECT_FALSE(doubts(0.5, 0).stamps.has_value());
  ASSERT_TRUE(doubts(0.5, 0.5).stamps.has_value());
  EXPECT_TRUE(doubts(0.5, 0.5).stamps->by_truth);
  EXPECT_NEAR(doubts(0.5, 0.5).stamps->offset_s, -0.5, 0.01);
}

TEST(Doubts, OursMayReportMoreOftenButNotMoreSeldom) {
  const auto seldom = [](double ours_s, double certified_s) {
    Doubts doubts;
    doubts.ours_every_s = ours_s;
    doubts.certified_every_s = certified_s;
    return doubts.ours_seldom();
  };
  EXPECT_TRUE(seldom(6, 1));
  EXPECT_FALSE(seldom(1, 6));
  EXPECT_FALSE(seldom(6.5, 6));
  EXPECT_FALSE(seldom(NAN, 1)) << "only reports of the same time are paired";
}

}  // namespace
}  // namespace railfix::compare
