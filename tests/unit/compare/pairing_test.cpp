#include "compare/pairing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "compare/other_fields.hpp"
#include "core/time.hpp"
#include "unit/compare/made_up_reports.hpp"

namespace railfix::compare {
namespace {

using namespace testing;

TEST(Axes, PlaceAReportOnItsGroup) {
  const auto placed = Axes().place(report(1, kA, 50)).value();
  EXPECT_EQ(placed.axis, kA);
  EXPECT_NEAR(placed.front_m, 50, 1e-9);
  EXPECT_NEAR(placed.low_m, 47, 1e-9);
  EXPECT_NEAR(placed.high_m, 57, 1e-9);
  EXPECT_NEAR(placed.speed_mps, 70 / 3.6, 1e-9);
  const auto against = Axes().place(report(1, kA, -50, 72, false)).value();
  EXPECT_NEAR(against.front_m, -50, 1e-9);
  EXPECT_NEAR(against.low_m, -57, 1e-9);  // its front end looks the other way
  EXPECT_NEAR(against.high_m, -47, 1e-9);
  EXPECT_LT(against.speed_mps, 0);
}

TEST(Axes, WhatIsUnknownHasNoPlaceOrNoBound) {
  auto unknown = report(1, etcs::kUnknownBaliseGroup, 50);
  EXPECT_FALSE(Axes().place(unknown).has_value());
  EXPECT_FALSE(Axes().place(report(1, kA | etcs::kUnknownNidBg, 50)).has_value()) << "NID_BG 16383 of its country";
  unknown = report(1, kA, 50);
  unknown.fields.q_dlrbg = etcs::kUnknownSide;
  EXPECT_FALSE(Axes().place(unknown).has_value());
  unknown = report(1, kA, 50);
  unknown.fields.l_doubtover = etcs::kUnknownDistance;
  EXPECT_EQ(Axes().place(unknown)->low_m, -HUGE_VAL);
  unknown = report(1, kA, 50);
  unknown.fields.q_dirlrbg = etcs::kUnknownSide;
  EXPECT_NEAR(Axes().place(unknown)->low_m, 43, 1e-9);
}

TEST(Axes, PlaceAReportOnTheLine) {
  const auto path = track::Path::follow(balise_map(), forward(1, 0), 900, 0);
  const Axes line(path.value());
  EXPECT_NEAR(line.place(report(1, kA, 50))->front_m, 150, 1e-9);
  const auto reverse_group = line.place(report(1, kB, -50, 72, false)).value();  // B's nominal direction runs back
  EXPECT_NEAR(reverse_group.front_m, 450, 1e-9);
  EXPECT_NEAR(reverse_group.low_m, 447, 1e-9);
  EXPECT_NEAR(reverse_group.high_m, 457, 1e-9);
  EXPECT_GT(reverse_group.speed_mps, 0);
  EXPECT_FALSE(line.place(report(1, kE, 50)).has_value());  // on the siding
}

// A single-balise group has no direction of its own: C's on the map counts for packet 0 only.
TEST(Axes, InPacketOneTheWayFromTheGroupBeforeIsNominal) {
  const Axes line(track::Path::follow(balise_map(), forward(1, 0), 1900, 0).value());
  const auto along = line.place(report_from(kB, report(1, kC, 50))).value();
  EXPECT_NEAR(along.front_m, 750, 1e-9);
  EXPECT_GT(along.speed_mps, 0);
  const auto against = line.place(report_from(kD, report(1, kC, 50))).value();  // comes back from D at 1200 m
  EXPECT_NEAR(against.front_m, 650, 1e-9);
  EXPECT_NEAR(against.low_m, 643, 1e-9);
  EXPECT_NEAR(against.high_m, 653, 1e-9);
  EXPECT_LT(against.speed_mps, 0);
  EXPECT_EQ(against.running, -1);
  EXPECT_FALSE(line.place(report_from(kE, report(1, kC, 50))).has_value()) << "E is on the siding";
  EXPECT_FALSE(line.place(report_from(kC, report(1, kC, 50))).has_value());
}

TEST(Axes, InPacketOneWithoutAGroupBeforeNothingIsKnown) {
  const auto nowhere = report_from(etcs::kUnknownBaliseGroup, report(1, kC, 50));
  EXPECT_FALSE(interval_known(nowhere.fields));
  EXPECT_FALSE(Axes().place(nowhere).has_value());
  EXPECT_TRUE(interval_known(report_from(kE, report(1, kC, 50)).fields)) << "whatever our map has";
}

TEST(Axes, WithoutALineEachPairOfGroupsIsItsOwn) {
  const auto axis = [](const TimedReport& report) { return Axes().place(report)->axis; };
  EXPECT_EQ(axis(report_from(kB, report(1, kC, 50))), axis(report_from(kB, report(2, kC, 60))));
  EXPECT_NE(axis(report_from(kB, report(1, kC, 50))), axis(report_from(kD, report(1, kC, 50))));
  EXPECT_NE(axis(report_from(kB, report(1, kC, 50))), axis(report(1, kC, 50)));
}

TEST(Pairing, CarriesBySpeedNotByAStraightLine) {
  // From 20 to 35 km/h in 10 s: 76.4 m; a straight line would say 30.6 m after 4 s.
  const std::vector<TimedReport> ours{report(0, kA, 0, 20), report(10, kA, 76.4, 35)};
  const double true_m = 20 / 3.6 * 4 + 0.5 * 15 / 36.0 * 16;
  const auto pairing = pair_up(ours, {report(4, kA, true_m, 25)}, Axes(), kGapNs);
  ASSERT_EQ(pairing.pairs.size(), 1U);
  EXPECT_NEAR(pairing.pairs[0].difference_m(), 0, 0.1);
  EXPECT_NEAR(pairing.pairs[0].carried_m, 2.5 / 3.6 * 10 * 0.24, 1e-9);
  EXPECT_TRUE(pairing.pairs[0].overlap());
}

TEST(Pairing, NeedsOursBeforeAndBehindOnTheSameAxis) {
  const std::vector<TimedReport> ours{report(0, kA, 0), report(10, kA, 200), report(12, kB, 0), report(40, kB, 500)};
  const auto pairing = pair_up(ours,
                               {report(-1, kA, 0), report(10, kA, 203), report(11, kA, 220), report(12, kB, 1),
                                report(30, kB, 400), report(41, kB, 520)},
                               Axes(), kGapNs);
  ASSERT_EQ(pairing.pairs.size(), 2U);
  EXPECT_EQ(pairing.alone, 4U);
  EXPECT_EQ(pairing.legs, 2U);
  EXPECT_NEAR(pairing.pairs[0].difference_m(), -3, 1e-9);
  EXPECT_EQ(pairing.pairs[0].carried_m, 0);
  EXPECT_EQ(pairing.pairs[1].leg, 1U);
}

TEST(Pairing, TellsWhoHadAKnownInterval) {
  auto no_interval = report(40, kA, 500);
  no_interval.fields.l_doubtover = etcs::kUnknownDistance;
  const auto pairing = pair_up({report(0, kA, 0), no_interval, lost(60)},
                               {report(-1, kA, 0), report(1, kA, 20), report(15, kA, 300), report(16, kA, 320),
                                report(41, kA, 520), lost(50), report(60, kB, 0)},
                               Axes(), kGapNs);
  std::vector<int> seen;
  for (const auto& at : pairing.availability)
    seen.push_back(static_cast<int>(100 * at.leg) + (at.ours ? 10 : 0) + (at.certified ? 1 : 0));
  EXPECT_EQ(seen, (std::vector<int>{1, 11, 11, 1, 1, 0, 101}));
  EXPECT_EQ(pairing.certified.placed.size(), 6U);
}

TEST(Pairing, AReportThatSaysUnknownEndsWhatTheOneBeforeSaid) {
  const auto pairing = pair_up({report(0, kA, 0), lost(5), report(10, kA, 200)},
                               {report(0, kA, 0), report(4, kA, 80), report(5, kA, 100), report(6, kA, 120),
                                report(10, kA, 200), report(12, kA, 240)},
                               Axes(), kGapNs);
  std::vector<bool> ours;
  for (const auto& at : pairing.availability) ours.push_back(at.ours);
  EXPECT_EQ(ours, (std::vector<bool>{true, true, false, false, true, true}));
  ASSERT_EQ(pairing.pairs.size(), 2U) << "nothing is carried over it";
  EXPECT_EQ(pairing.pairs[1].stamp_ns, 10 * core::kNsPerSecond);
  EXPECT_EQ(pairing.alone, 4U);
}

TEST(Pairing, AHoleInTheMapIsNoFaultOfTheReports) {
  const Axes line(track::Path::follow(balise_map(), forward(1, 0), 900, 0).value());
  const auto pairing =
      pair_up({report(0, kA, 0), lost(10), report(20, kE, 0)},
              {report(0, kA, 0), report(10, kE, 0), report(20, kE, 100), report(30, kA, 0)}, line, kGapNs);
  std::vector<int> seen;
  for (const auto& at : pairing.availability)
    seen.push_back(static_cast<int>(100 * at.leg) + (at.ours ? 10 : 0) + (at.certified ? 1 : 0));
  EXPECT_EQ(seen, (std::vector<int>{11, 101, 111, 211}));
  EXPECT_EQ(pairing.ours.off_line.size(), 1U);
  EXPECT_EQ(pairing.ours.placed.size(), 1U);
  EXPECT_EQ(pairing.certified.off_line.size(), 2U);
  EXPECT_EQ(pairing.certified.placed.size(), 2U);
  EXPECT_EQ(pairing.legs, 1U);
}

TEST(Pairing, ATrainTurnedRoundIsSeenWhereBothSayHowItLooks) {
  const auto turned = [](etcs::Side ours, etcs::Side certified) {
    auto own = report(0, kA, 50);
    auto other = own;
    own.fields.q_dirlrbg = ours;
    other.fields.q_dirlrbg = certified;
    return pair_up({own}, {other}, Axes(), kGapNs).pairs.at(0).turned();
  };
  EXPECT_TRUE(turned(etcs::kNominal, etcs::kReverse));
  EXPECT_FALSE(turned(etcs::kReverse, etcs::kReverse));
  EXPECT_FALSE(turned(etcs::kUnknownSide, etcs::kReverse));
  const Axes line(track::Path::follow(balise_map(), forward(1, 0), 900, 0).value());
  EXPECT_EQ(line.place(report(1, kB, -50, 72, false))->facing, 1) << "B's nominal direction runs back";
}

TEST(Pairing, ATrainThatRunsTheOtherWayIsSeenWhereBothSayThatItRuns) {
  const auto apart = [](etcs::Side ours, etcs::Side certified, double certified_kmh) {
    auto own = report(0, kA, 50, 72);
    auto other = report(0, kA, 50, certified_kmh);
    own.fields.q_dirtrain = ours;
    other.fields.q_dirtrain = certified;
    return pair_up({own}, {other}, Axes(), kGapNs).pairs.at(0).runs_apart();
  };
  EXPECT_TRUE(apart(etcs::kNominal, etcs::kReverse, 70));
  EXPECT_TRUE(apart(etcs::kReverse, etcs::kNominal, 5));
  EXPECT_FALSE(apart(etcs::kReverse, etcs::kReverse, 70));
  EXPECT_FALSE(apart(etcs::kUnknownSide, etcs::kReverse, 70));
  EXPECT_FALSE(apart(etcs::kNominal, etcs::kReverse, 0)) << "one that stands runs no way";
}

TEST(Pairing, DifferencesAreInRunningDirection) {
  const auto pairing = pair_up({report(0, kA, -100, 72, false)}, {report(0, kA, -103, 72, false)}, Axes(), kGapNs);
  EXPECT_NEAR(pairing.pairs.at(0).difference_m(), -3, 1e-9);  // the certified one is farther on
}

TEST(Pairing, ATrainThatStandsStillRanSomeWay) {
  auto certified = report(0, kA, -103, 0, false);
  EXPECT_NEAR(pair_up({report(0, kA, -108, 0, false)}, {certified}, Axes(), kGapNs).pairs.at(0).difference_m(), 5,
              1e-9);
  certified.fields.q_dirtrain = etcs::kUnknownSide;  // it looks the same way
  EXPECT_NEAR(pair_up({report(0, kA, -108, 0, false)}, {certified}, Axes(), kGapNs).pairs.at(0).difference_m(), 5,
              1e-9);
}

TEST(Pairing, IntervalsThatDoNotMeetAreSeen) {
  const auto pairing = pair_up({report(0, kA, 100)}, {report(0, kA, 111)}, Axes(), kGapNs);
  EXPECT_FALSE(pairing.pairs.at(0).overlap());  // 97 to 107 and 108 to 118
}

TEST(Pairing, LegsAreThoseOfTheCertifiedReports) {
  const auto pairing = pair_up({report(-5, kA, 0), report(9, kA, 180), report(10, kB, 0), report(50, kC, 0)},
                               {report(0, kA, 0), report(10, kB, 0), report(20, kB, 200)}, Axes(), kGapNs);
  std::vector<size_t> legs;
  for (const auto& [leg, report] : pairing.ours.placed) legs.push_back(leg);
  EXPECT_EQ(legs, (std::vector<size_t>{0, 0, 1, 1})) << "also of those that have no partner";
}

TEST(Pairing, StaysAreOfOnePlace) {
  std::vector<TimedReport> certified{report(0, kA, 0),     report(1, kA, 20, 0), report(2, kA, 20.5, 0),
                                     report(3, kA, 30, 0), report(4, kA, 30, 0), report(5, kB, 30, 0)};
  std::vector<size_t> stays;
  for (const auto& pair : pair_up(certified, certified, Axes(), kGapNs).pairs) stays.push_back(pair.stay);
  EXPECT_EQ(stays, (std::vector<size_t>{0, 1, 1, 3, 3, 5}));
}

// A burst behind a group does not hide the silence that follows it; a stay over night is no cycle.
TEST(Pairing, HowOftenASideReportsIsWhatAMomentSees) {
  std::vector<TimedReport> ours;
  std::vector<TimedReport> certified;
  for (int t = 0; t <= 120; ++t) {
    if (t % 12 < 3) ours.push_back(report(t, kA, t));
    if (t % 2 == 0) certified.push_back(report(t, kA, t));
  }
  ours.push_back(report(40000, kA, 200));
  certified.push_back(report(40000, kA, 200));
  const auto pairing = pair_up(ours, certified, Axes(), kGapNs);
  EXPECT_NEAR(pairing.ours.every_s, (1 + 1 + 100) / 12.0, 1e-9);
  EXPECT_NEAR(pairing.certified.every_s, 2, 1e-9);
  EXPECT_TRUE(std::isnan(pair_up({ours[0]}, certified, Axes(), kGapNs).ours.every_s));
}

// Ours report twice while the train brakes to a halt between them: nothing that was said is wrong.
TEST(Pairing, ATrainMayBrakeAtAnyTimeBetweenTwoReports) {
  const auto one = [](double certified_kmh) {
    return pair_up({report(0, kA, 0, 60), report(10, kA, 80, 0)}, {report(5, kA, 60, certified_kmh)}, Axes(), kGapNs)
        .pairs.at(0);
  };
  EXPECT_FALSE(one(0).speeds_apart());
  EXPECT_FALSE(one(60).speeds_apart());
  EXPECT_NEAR(one(0).faster_kmh, 30, 1e-9);
  EXPECT_TRUE(one(80).speeds_apart());
  EXPECT_NEAR(one(80).speed_apart_kmh, 20, 1e-9);
}

TEST(OtherFields, AreCountedWhereTheyDiffer) {
  std::vector<TimedReport> ours;
  std::vector<TimedReport> certified;
  for (int i = 0; i < 10; ++i) {
    ours.push_back(report(i, kA, 20 * i));
    certified.push_back(report(i + 0.5, kA, 20 * i + 10));
    if (i < 3) ours.back().fields.m_mode = 2;
    if (i < 2) ours.back().fields.m_level = etcs::kLevel1;
    if (i < 5) ours.back().fields.q_length = etcs::kConfirmedByDevice;
    if (i < 4) certified.back().fields.q_length = etcs::kConfirmedByDevice;
    if (i < 5) ours.back().fields.l_trainint = 203;
    if (i < 4) certified.back().fields.l_trainint = 210;
  }
  const auto other = other_fields_of(pair_up(ours, certified, Axes(), kGapNs).pairs);
  EXPECT_EQ(other.modes, 3U);
  EXPECT_EQ(other.levels, 2U);
  EXPECT_EQ(other.integrity, 1U);
  EXPECT_EQ(other.both_lengths, 4U);
  EXPECT_NEAR(other.longer_m, 3, 0.1) << "it has run 10 m since";
}

/// Ours at each certified report with a position.
std::vector<Beside> beside(const std::vector<TimedReport>& ours, const std::vector<TimedReport>& certified,
                           const Axes& axes) {
  std::vector<Beside> found;
  for (const auto& at : pair_up(ours, certified, axes, kGapNs).beside) found.push_back(at.ours);
  return found;
}

TEST(Pairing, WhatCannotBeComparedIsNoSilence) {
  const Axes line(track::Path::follow(balise_map(), forward(1, 0), 900, 0).value());
  const std::vector<TimedReport> certified{report(0, kA, 0), report(1, kA, 20), report(2, kA, 40), report(3, kB, 0),
                                           report(4, kB, 20)};
  // E is on the siding.
  EXPECT_EQ(
      beside({report(0, kA, 0), report(1, kE, 0), report(2, kE, 20), lost(3), report(5, kB, 40)}, certified, line),
      (std::vector<Beside>{Beside::paired, Beside::off_line, Beside::off_line, Beside::unknown, Beside::unknown}));
  // Now here, now there: on the line whenever the certified system reports.
  EXPECT_EQ(beside({report(0.9, kA, 18), report(1.5, kE, 0), report(1.9, kA, 38), report(2.5, kE, 0)},
                   {report(1, kA, 20), report(2, kA, 40)}, line),
            (std::vector<Beside>{Beside::off_line, Beside::off_line}));
  // Without a map each group is alone; ours comes to B a report later, or says C instead.
  EXPECT_EQ(beside({report(0, kA, 0), report(2, kA, 40), report(3, kA, 60), report(4, kB, 20)}, certified, Axes()),
            (std::vector<Beside>{Beside::paired, Beside::paired, Beside::paired, Beside::passing, Beside::paired}));
  EXPECT_EQ(beside({report(0, kA, 0), report(1, kC, 20), report(4, kC, 80)}, certified, Axes()),
            (std::vector<Beside>{Beside::paired, Beside::other_group, Beside::other_group, Beside::other_group,
                                 Beside::other_group}));
}

TEST(Pairing, WhatIsNotCarriedIsSilence) {
  const std::vector<TimedReport> certified{report(0, kA, 0), report(1, kA, 20), report(10, kA, 200),
                                           report(18, kA, 360)};
  EXPECT_EQ(beside({report(0, kA, 0), report(17, kA, 340), report(18, kA, 360)}, certified, Axes()),
            (std::vector<Beside>{Beside::paired, Beside::silent, Beside::silent, Beside::paired}));
  EXPECT_EQ(beside({report(0, kA, 0), lost(2), report(18, kA, 360)}, certified, Axes()),
            (std::vector<Beside>{Beside::paired, Beside::silent, Beside::unknown, Beside::paired}));
}

// Ours begins 20 s later and ends 20 s sooner.
TEST(Pairing, WhatLiesBeyondOurLogIsNoFaultOfTheSystem) {
  std::vector<TimedReport> ours;
  std::vector<TimedReport> certified;
  for (int i = 0; i < 100; ++i) {
    certified.push_back(report(i, kA, 20 * i));
    if (i >= 20 && i < 80) ours.push_back(certified.back());
  }
  const auto pairing = pair_up(ours, certified, Axes(), kGapNs);
  EXPECT_EQ(pairing.outside_ours, 10U) << "by more than is carried";
  EXPECT_EQ(pairing.availability.size(), 90U);
  EXPECT_EQ(pairing.alone, 30U);
}

// Live: nothing came from ours any more while it was listened to.
TEST(Pairing, ASideThatFallsSilentWhileItIsListenedToIsNotKnown) {
  std::vector<TimedReport> ours;
  std::vector<TimedReport> certified;
  for (int i = 0; i < 100; ++i) {
    certified.push_back(report(i, kA, 20 * i));
    if (i < 40) ours.push_back(certified.back());
  }
  const auto known = [&](std::optional<int64_t> until_ns) {
    const auto pairing = pair_up(ours, certified, Axes(), kGapNs, until_ns);
    return std::pair(pairing.availability.size(), std::ranges::count(pairing.availability, true, &Availability::ours));
  };
  EXPECT_EQ(known(std::nullopt), std::pair(55UL, 55L));
  EXPECT_EQ(known(99 * core::kNsPerSecond), std::pair(100UL, 55L));
  EXPECT_EQ(known(0), std::pair(55UL, 55L)) << "its last report was heard";
}

// E is on the siding, B and C are on the line: only what is nominal at C is not known.
TEST(Pairing, WhoCameToTheLineByAnotherWayIsNotOnAnotherTrack) {
  const Axes line(track::Path::follow(balise_map(), forward(1, 0), 1900, 0).value());
  EXPECT_FALSE(line.names_other_track(report_from(kE, report(0, kC, 20)).fields));
  EXPECT_TRUE(line.names_other_track(report_from(kC, report(0, kE, 20)).fields));
  const std::vector<TimedReport> plain{report(0, kC, 0), report(1, kC, 20), report(2, kC, 40)};
  std::vector<TimedReport> came;
  for (const auto& one : plain) came.push_back(report_from(kE, one));
  EXPECT_EQ(beside(came, plain, line), (std::vector<Beside>(3, Beside::silent)));
  EXPECT_EQ(beside(plain, came, line), (std::vector<Beside>(3, Beside::silent)));
  EXPECT_TRUE(pair_up(came, plain, line, kGapNs).ours.off_line.empty());
}

/// Every second for `length_s`, but for those that are left out.
template <class Left>
std::vector<TimedReport> every_second(int length_s, Left left_out) {
  std::vector<TimedReport> reports;
  for (int i = 0; i < length_s; ++i) {
    if (!left_out(i)) reports.push_back(report(i, kA, i));
  }
  return reports;
}

TEST(Pairing, ASilenceCountsWholeAndANightBetweenRidesForNobody) {
  const auto gaps = [](auto left_out, auto certified_left_out) {
    const auto pairing =
        pair_up(every_second(100'000, left_out), every_second(100'000, certified_left_out), Axes(), kGapNs);
    return std::pair(pairing.ours.every_s, pairing.certified.every_s);
  };
  const auto night = [](int i) { return i > 1000 && i < 99'000; };
  EXPECT_EQ(gaps(night, night), (std::pair(1.0, 1.0)));
  const auto seldom = gaps([&](int i) { return night(i) || i % 20 > 3; }, night);  // 1, 1, 1 and 17 s
  EXPECT_NEAR(seldom.first, (3 + 17 * 17) / 20.0, 0.2);
  EXPECT_EQ(seldom.second, 1);
  const auto once = gaps([&](int i) { return night(i) || i % 20 > 0; }, night);
  EXPECT_NEAR(once.first, 20, 0.2);
}

}  // namespace
}  // namespace railfix::compare
