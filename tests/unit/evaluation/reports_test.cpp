// Position reports beside the truth on the dataset's map.
#include "evaluation/reports.hpp"

#include <gmock/gmock.h>

#include <sstream>

#include "etcs/train_position_report.hpp"
#include "evaluation/evaluation.hpp"
#include "made_truth.hpp"

namespace railfix::evaluation {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;

constexpr uint32_t kFarAway = 4;
constexpr uint32_t kNextTrack = 5;
constexpr uint32_t kSingle = 6;

/// The train runs north from (5000, 7000) for 1000 m; its track lies from 300 m before that to 500 m beyond. One group
/// each: 1 before the truth begins, 2 and 6 on the way, 3 beyond its end, 4 on a line 6 km away, 5 on the next track.
ReportGround ground() {
  auto map = std::make_shared<track::Map>();
  const auto edge = [&](uint32_t id, double easting_m, double northing_m) {
    map->edges.push_back({id, std::to_string(id), 2 * id - 1, 2 * id, "",
                          track::Alignment::chained({easting_m, northing_m, 0}, {{1800, 0, 0}})});
    map->nodes.push_back({2 * id - 1, track::NodeKind::end, "", easting_m, northing_m});
    map->nodes.push_back({2 * id, track::NodeKind::end, "", easting_m, northing_m + 1800});
  };
  edge(1, 5000, 6700);
  edge(2, 11000, 6700);
  edge(3, 5004.5, 6700);
  map->balise_groups = {{0, 1, 1, 100, true, true, 1, {}},          {0, 2, 1, 700, false, true, 1, {}},
                        {0, 3, 1, 1500, true, true, 1, {}},         {0, kFarAway, 2, 700, true, true, 1, {}},
                        {0, kNextTrack, 3, 700, true, true, 1, {}}, {0, kSingle, 1, 800, true, false, 1, {0}}};
  return {map, 0};
}

/// As a train says it that is right: nominal along its way, the front end beyond the group.
ReportRow said(double time_s, uint32_t nid_lrbg, double d_lrbg_m) {
  return {.stamp_ns = static_cast<int64_t>(time_s * 1e9),
          .nid_lrbg = nid_lrbg,
          .d_lrbg_m = d_lrbg_m,
          .doubt_over_m = 5,
          .doubt_under_m = 5,
          .q_dirlrbg = etcs::kNominal,
          .q_dlrbg = etcs::kNominal,
          .q_dirtrain = etcs::kNominal};
}
/// ... past a group whose nominal direction is against it.
ReportRow against(ReportRow row) {
  row.q_dirlrbg = row.q_dlrbg = row.q_dirtrain = etcs::kReverse;
  return row;
}

ReportResult judged(const std::vector<ReportRow>& rows, const ReportGround& on = ground(), const MadeTruth& made = {}) {
  return judge_reports(made.make(), rows, on);
}

// At 20 s the train is at 400 m: 600 m beyond group 1, at group 2, 1,200 - 400 m before group 3.
TEST(JudgedReports, ThatAreRightAreNotWrong) {
  auto ahead = said(20, 3, 800);
  ahead.q_dlrbg = etcs::kReverse;  // before the group
  const auto result = judged({said(20, 1, 600), against(said(30, 2, 200)), ahead, said(30, kSingle, 104)});
  EXPECT_EQ(result.judged, 4U);
  EXPECT_EQ(result.wrong, 0U);
  EXPECT_THAT(result.not_judged, IsEmpty());
}

TEST(JudgedReports, OfAGroupElsewhereAreWrong) {
  const auto result = judged({said(20, kFarAway, 300), said(30, kNextTrack, 200)});
  EXPECT_EQ(result.judged, 2U);
  EXPECT_EQ(result.wrong, 2U);
  EXPECT_EQ(result.wrong_group, 2U);
}

TEST(JudgedReports, OfTheOtherDirectionAreWrong) {
  auto backwards = against(said(30, 2, 200));
  backwards.q_dirtrain = etcs::kNominal;
  const auto result = judged({said(30, 2, 200), backwards, against(said(30, kSingle, 100))});
  EXPECT_EQ(result.judged, 3U);  // what nominal is of a single balise the group before it says
  EXPECT_EQ(result.wrong, 2U);
  EXPECT_EQ(result.wrong_direction, 2U);
  EXPECT_EQ(result.wrong_interval, 0U);
}

TEST(JudgedReports, WhoseIntervalDoesNotHoldTheFrontEndAreWrong) {
  auto before = against(said(30, 2, 200));
  before.q_dlrbg = etcs::kNominal;  // the front end would be 200 m before the group
  auto wide = against(said(30, 2, 206));
  wide.doubt_over_m = kUnknown;
  const auto result =
      judged({against(said(30, 2, 204)), against(said(30, 2, 206)), against(said(30, 2, 194)), before, wide});
  EXPECT_EQ(result.judged, 5U);
  EXPECT_EQ(result.wrong, 3U);
  EXPECT_EQ(result.wrong_interval, 3U);
  auto in_front = ground();
  in_front.foot_to_front_m = 10;
  EXPECT_EQ(judged({against(said(30, 2, 200)), against(said(30, 2, 210))}, in_front).wrong_interval, 1U);
}

TEST(JudgedReports, WhatCannotBeJudgedIsSaid) {
  auto elsewhere = said(20, kFarAway, 9000);
  auto nameless = said(20, 1, 600);
  nameless.nid_lrbg.reset();
  ReportRow unknown;
  unknown.stamp_ns = 20 * kSecond;
  const auto result = judged({elsewhere, nameless, said(20, 77, 5), said(60, 1, 600), unknown});
  EXPECT_EQ(result.reports, 5U);
  EXPECT_EQ(result.with_position, 4U);
  EXPECT_EQ(result.judged, 0U);
  EXPECT_THAT(result.not_judged, ElementsAre(Pair("at a time without a true place", 1U),
                                             Pair("of a group that the dataset's map does not have", 1U),
                                             Pair("of a group that the true way does not lead to", 1U),
                                             Pair("without the group in the table", 1U)));
  EXPECT_THAT(judged({said(20, 1, 600)}, {}).not_judged,
              ElementsAre(Pair("because the dataset has no map that can be read", 1U)));
}

TEST(JudgedReports, AreToldAsTextAndJson) {
  RunTables run;
  run.reports = {said(20, kFarAway, 300), said(20, 1, 600), said(20, 77, 5)};
  const auto evaluation = evaluate(MadeTruth().make(), run, ground());
  std::ostringstream text;
  print(evaluation, text);
  EXPECT_THAT(text.str(), HasSubstr("1 of 2 judged; group elsewhere 1, direction 0, interval without the front end 0"));
  EXPECT_THAT(text.str(), HasSubstr("not judged              1 of a group that the dataset's map does not have"));
  EXPECT_EQ(to_json(evaluation)["reports"]["wrong"], 1);
  EXPECT_EQ(to_json(evaluation)["reports"]["judged"], 2);
}

}  // namespace
}  // namespace railfix::evaluation
