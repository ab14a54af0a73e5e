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

/// Legs of ten reports each, behind groups in turns; `change` makes ours of the nth report of a leg.
template <class Change>
Doubts doubts_where(size_t legs, Change change) {
  std::vector<TimedReport> ours;
  std::vector<TimedReport> certified;
  for (size_t leg = 0; leg < legs; ++leg) {
    for (size_t n = 0; n < 10; ++n) {
      const auto one = report(static_cast<double>(10 * leg + n), leg % 2 == 0 ? kA : kB, 20.0 * static_cast<double>(n));
      certified.push_back(one);
      ours.push_back(one);
      change(leg, n, ours.back().fields);
    }
  }
  return doubts_of(pair_up(ours, certified, Axes(), kGapNs), std::nullopt, 0);
}

TEST(Doubts, ATrainThatIsTurnedRoundInSomeReportsOfALegIsOne) {
  const auto turned = [](size_t legs, size_t of_leg, size_t every) {
    return doubts_where(legs,
                        [&](size_t leg, size_t n, etcs::TrainPositionReport& fields) {
                          if (leg % every == 0 && n >= 4 && n < 4 + of_leg) fields.q_dirlrbg = etcs::kReverse;
                        })
        .turned;
  };
  EXPECT_EQ(turned(40, 4, 1), 40U);
  EXPECT_EQ(turned(40, 2, 40), 1U) << "two of one leg";
  EXPECT_EQ(turned(40, 1, 1), 40U) << "one of ten";
  EXPECT_EQ(turned(40, 1, 40), 0U) << "one of 400 proves nothing";
  EXPECT_EQ(turned(40, 0, 1), 0U);
}

TEST(Doubts, ATrainThatRunsTheOtherWayInSomeReportsOfALegIsOne) {
  const auto doubts = doubts_where(40, [](size_t, size_t n, etcs::TrainPositionReport& fields) {
    if (n < 4) fields.q_dirtrain = etcs::kReverse;
  });
  EXPECT_EQ(doubts.runs_apart, 40U);
}

// Ours say it one report late.
TEST(Doubts, AChangeOfTheCabMayBeSaidOneReportApart) {
  std::vector<TimedReport> ours;
  std::vector<TimedReport> certified;
  for (int i = 0; i < 20; ++i) {
    ours.push_back(report(i, kA, 50, 0, i <= 10));
    certified.push_back(report(i, kA, 50, 0, i < 10));
  }
  EXPECT_EQ(doubts_of(pair_up(ours, certified, Axes(), kGapNs), std::nullopt, 0).turned, 0U);
  ours[11] = ours[12] = ours[10];
  ours[11].stamp_ns = certified[11].stamp_ns;
  ours[12].stamp_ns = certified[12].stamp_ns;
  EXPECT_EQ(doubts_of(pair_up(ours, certified, Axes(), kGapNs), std::nullopt, 0).turned, 1U);
}

TEST(Doubts, ASpeedThatIsFartherOffThanBothMayBeIsOne) {
  const auto apart = [](uint32_t steps) {
    return doubts_where(40,
                        [&](size_t, size_t n, etcs::TrainPositionReport& fields) {
                          if (n < 4) fields.v_train += steps;
                        })
        .speeds_apart;
  };
  EXPECT_EQ(apart(2), 0U) << "rounded, and each 3 km/h off";
  EXPECT_EQ(apart(4), 40U);
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
  EXPECT_FALSE(seldom(NAN, NAN)) << "only reports of the same time are paired";
}

// Of each leg of ten.
TEST(Doubts, AnotherTrackOrGroupInSomeReportsOfALegIsOne) {
  const auto doubts = [](size_t of_leg, size_t every, const Axes& axes) {
    std::vector<TimedReport> ours;
    std::vector<TimedReport> certified;
    for (size_t i = 0; i < 400; ++i) {
      certified.push_back(
          report(static_cast<double>(i), i / 10 % 2 == 0 ? kA : kC, 20.0 * static_cast<double>(i % 10)));
      ours.push_back(certified.back());
      if (i / 10 % every == 0 && i % 10 >= 4 && i % 10 < 4 + of_leg) ours.back().fields.nid_lrbg = kE;
    }
    return doubts_of(pair_up(ours, certified, axes, kGapNs), std::nullopt, 0);
  };
  const Axes line(track::Path::follow(balise_map(), forward(1, 0), 900, 0).value());
  EXPECT_EQ(doubts(4, 1, line).off_line, 40U);
  EXPECT_EQ(doubts(2, 40, line).off_line, 1U);
  EXPECT_EQ(doubts(1, 1, line).off_line, 40U) << "one of ten";
  EXPECT_EQ(doubts(1, 40, line).off_line, 0U) << "one of 400 proves nothing";
  EXPECT_EQ(doubts(4, 1, Axes()).other_groups, 40U);
  EXPECT_EQ(doubts(4, 1, Axes()).off_line, 0U);
  EXPECT_EQ(doubts(0, 1, line).off_line + doubts(0, 1, Axes()).other_groups, 0U);
}

TEST(Doubts, ASilenceOfOneReportInTwentyIsNone) {
  const auto silent = [](size_t reports, size_t heard) {
    Doubts doubts;
    doubts.silent = reports;
    doubts.heard = heard;
    return doubts.ours_silent();
  };
  EXPECT_FALSE(silent(0, 0));
  EXPECT_FALSE(silent(5, 100));
  EXPECT_TRUE(silent(6, 100));
}

TEST(Doubts, LogsOfOtherTimesAreOne) {
  std::vector<TimedReport> certified;
  for (int i = 0; i < 1000; ++i) certified.push_back(report(i, kA, i));
  const auto other_times = [&](int from) {
    const auto pairing = pair_up({certified.begin() + from, certified.end()}, certified, Axes(), kGapNs);
    return doubts_of(pairing, std::nullopt, 0).other_times();
  };
  EXPECT_FALSE(other_times(20));
  EXPECT_TRUE(other_times(200));
}

}  // namespace
}  // namespace railfix::compare
