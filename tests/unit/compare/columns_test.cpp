#include "compare/columns.hpp"

#include <gtest/gtest.h>

#include "unit/compare/made_up_reports.hpp"

namespace railfix::compare {
namespace {

using namespace testing;

/// At 20 m/s from the group on, from 0 to 100 s.
evaluation::Truth steady() {
  std::vector<dataset::TruthRow> rows(2);
  rows[1].stamp_ns = 100 * core::kNsPerSecond;
  rows[1].distance_m = 2000;
  return {rows, std::nullopt, std::nullopt};
}

TEST(Columns, APromiseNeedsNoPartnerButATruthAndAnInterval) {
  const auto truth = steady();
  auto vague = report(40, kA, 800);
  vague.fields.l_doubtover = etcs::kUnknownDistance;
  auto wrong = report(50, kA, 900);  // at least 893 m is wrong, however far ahead
  wrong.fields.l_doubtunder = etcs::kUnknownDistance;
  wrong.fields.d_lrbg = 12000;
  // Between two certified reports; where nothing is known; wrong although half open; after the truth.
  const auto pairing = pair_up({report(5, kA, 150), vague, wrong, report(101, kA, 0)},
                               {report(0, kA, 0), report(90, kA, 1700)}, Axes(), kGapNs);
  const auto columns = columns_of(pairing, Judge{&truth, 0});
  EXPECT_TRUE(columns.lengths.empty());
  std::vector<double> ours;
  std::vector<double> certified;
  for (const auto& sample : columns.outside) {
    if (std::isfinite(sample.ours)) ours.push_back(sample.ours);
    if (std::isfinite(sample.certified)) certified.push_back(sample.certified);
  }
  EXPECT_EQ(ours, (std::vector<double>{1, 1}));
  EXPECT_EQ(certified, (std::vector<double>{0, 1}));
}

// E is on the siding, which D is passed beside; C lies before the switch. The group 9 is on no map.
TEST(Columns, AGroupOfAnotherTrackIsABrokenPromiseWhereTheOtherSideIsRight) {
  const auto truth = steady();
  const Axes line(track::Path::follow(balise_map(), forward(1, 0), 1900, 0).value());
  // At 70 s, on edge 2 at 400 m: 200 m beyond D, 700 m beyond C; on the siding 300 m beyond E.
  const auto judged_beside = [&](uint32_t group, uint32_t certified_group, double certified_m, bool behind = true,
                                 bool turned = false, double ours_before_s = 55) {
    auto certified = std::vector{report(55, kC, 400), report(69, certified_group, certified_m - 20)};
    if (turned) certified.insert(certified.begin() + 1, report(62, certified_group, 100, 72, false));
    if (behind) certified.push_back(report(71, certified_group, certified_m + 20));
    auto off_line = report(70, group, -300, 72, false);  // drawn towards the switch
    return columns_of(pair_up({report(ours_before_s, kC, 20 * ours_before_s - 700), off_line}, certified, line, kGapNs),
                      Judge{&truth, 0});
  };
  const auto judged = [&](uint32_t group, double certified_m) { return judged_beside(group, kD, certified_m); };
  const auto broken = [](const Columns& found) {
    size_t count = 0;
    for (const auto& sample : found.outside) count += sample.ours > 0;
    return count;
  };
  EXPECT_EQ(broken(judged(kE, 200)), 1U);
  EXPECT_EQ(judged(kE, 200).ours_other_track, 1U);
  EXPECT_EQ(broken(judged(kE, 300)), 0U) << "perhaps it is the line that is wrong";
  EXPECT_EQ(broken(judged(85U << 14U | 9U, 200)), 0U) << "nobody knows where that is";
  EXPECT_EQ(broken(judged_beside(kE, kD, 200, false)), 0U) << "perhaps the next one is on the siding";
  EXPECT_EQ(broken(judged_beside(kE, kC, 700)), 0U) << "passed before the switch";
  EXPECT_EQ(broken(judged_beside(kE, kD, 200, true, true)), 0U) << "turned back, and come over the switch";
  EXPECT_EQ(broken(judged_beside(kE, kD, 200, true, false, 50)), 0U) << "perhaps so in a silence";
}

TEST(Columns, AStandstillIsItsFirstAndItsLast) {
  std::vector<TimedReport> reports;
  for (int i = 0; i < 10; ++i) reports.push_back(report(i, kA, 20 * i));
  for (int i = 10; i < 90; ++i) reports.push_back(report(i, kA, 200, 0));
  for (int i = 90; i < 100; ++i) reports.push_back(report(i, kA, 200 + 20 * (i - 90)));
  const auto columns = columns_of(pair_up(reports, reports, Axes(), kGapNs), std::nullopt);
  EXPECT_EQ(columns.lengths.size(), 22U);
  EXPECT_EQ(columns.available.size(), 22U);
}

// Ours is lost for a while at the platform.
TEST(Columns, WhatChangesAtStandstillIsSeen) {
  std::vector<TimedReport> ours;
  std::vector<TimedReport> certified;
  for (int i = 0; i < 60; ++i) {
    certified.push_back(report(i, kA, 200, 0));
    ours.push_back(i < 20 || i >= 40 ? certified.back() : lost(i));
  }
  const auto columns = columns_of(pair_up(ours, certified, Axes(), kGapNs), std::nullopt);
  std::vector<double> known;
  for (const auto& sample : columns.available) known.push_back(sample.ours);
  EXPECT_EQ(known, (std::vector<double>{1, 1, 0, 0, 1, 1}));
}

}  // namespace
}  // namespace railfix::compare
