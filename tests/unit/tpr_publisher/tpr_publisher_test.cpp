#include "tpr_publisher/tpr_publisher.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/time.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int64_t kStart = 1'700'000'000'000'000'000;

Settings settings() {
  Settings settings;
  settings.parameters.t_cycloc = 6;
  settings.report.nid_engine = 4711;
  settings.report.foot_to_front_m = 2;
  return settings;
}

TrainPosition at(const track::EdgePosition& foot, double run_s, double speed_mps) {
  TrainPosition position;
  position.stamp_ns = kStart + core::to_ns(run_s);
  position.foot = foot;
  position.track_known = true;
  position.track_probability = 1;
  position.speed_mps = speed_mps;
  position.distance_m = foot.offset_m;
  position.over_m = position.under_m = 3;
  position.standstill = speed_mps == 0;
  return position;
}

TEST(TprPublisher, ARunGivesTheReportsOfTheRules) {
  TprPublisher publisher(balise_map(), settings());
  std::vector<Reason> reasons;
  std::vector<uint32_t> groups;
  for (int i = 0; i <= 1700; ++i) {  // 50 Hz, 20 m/s from 50 m to 650 m, then 4 s at rest
    const double run_s = i * 0.02;
    const bool moving = run_s < 30;
    const auto position = at(forward(1, 50 + 20 * std::min(run_s, 30.0)), run_s, moving ? 20 : 0);
    const auto outcome = publisher.update(position, position.stamp_ns + 40'000'000);
    ASSERT_EQ(outcome.refusal, "");
    if (!outcome.report) continue;
    reasons.push_back(outcome.report->reason);
    groups.push_back(outcome.report->fields.nid_lrbg);
    ASSERT_EQ(etcs::decode(outcome.report->message, etcs::Baseline::b3).value(), outcome.report->fields);
    EXPECT_EQ(outcome.report->fields.nid_engine, 4711U);
    EXPECT_EQ(outcome.report->sent_ns - outcome.report->stamp_ns, 40'000'000);
  }
  EXPECT_THAT(reasons, ElementsAre(Reason::start, Reason::balise_group, Reason::cycle_time, Reason::cycle_time,
                                   Reason::balise_group, Reason::cycle_time, Reason::cycle_time, Reason::standstill));
  EXPECT_THAT(groups, ElementsAre(etcs::kUnknownBaliseGroup, kA, kA, kA, kB, kB, kB, kB));
}

TEST(TprPublisher, OldPositionsAreNotReported) {
  TprPublisher publisher(balise_map(), settings());
  const auto position = at(forward(1, 450), 0, 20);
  auto outcome = publisher.update(position, position.stamp_ns + core::kNsPerSecond);
  EXPECT_FALSE(outcome.report.has_value());
  EXPECT_THAT(outcome.refusal, HasSubstr("1.0 s old, the limit is 1 s"));
  outcome = publisher.update(position, position.stamp_ns - 5 * core::kNsPerSecond);
  EXPECT_THAT(outcome.refusal, HasSubstr("5.0 s in the future"));
  outcome = publisher.update(position, position.stamp_ns + 1'000'000'000 * core::kNsPerSecond);
  EXPECT_THAT(outcome.refusal, HasSubstr("of another time")) << "an age of 30 years helps nobody";
  outcome = publisher.update(position, position.stamp_ns + core::kNsPerSecond - 1);  // still due
  ASSERT_TRUE(outcome.report.has_value());
  EXPECT_EQ(outcome.report->reason, Reason::start);
}

TEST(TprPublisher, SilenceOfTheStateIsSaidWhenAReportIsDue) {
  TprPublisher publisher(balise_map(), settings());
  EXPECT_THAT(publisher.tick(kStart).refusal, HasSubstr("no train_state yet"));
  ASSERT_TRUE(publisher.update(at(forward(1, 450), 0, 20), kStart).report.has_value());
  EXPECT_EQ(publisher.tick(kStart + 5 * core::kNsPerSecond).refusal, "");  // nothing due
  EXPECT_THAT(publisher.tick(kStart + 7 * core::kNsPerSecond).refusal, HasSubstr("7.0 s old"));
  EXPECT_FALSE(publisher.tick(kStart + 7 * core::kNsPerSecond).report.has_value());
}

TEST(TprPublisher, ALostTrackLosesTheReference) {
  TprPublisher publisher(balise_map(), settings());
  auto position = at(forward(1, 450), 0, 20);
  EXPECT_EQ(publisher.update(position, position.stamp_ns).report->fields.nid_lrbg, kB);
  position = at(forward(1, 570), 6, 20);
  position.track_known = false;
  EXPECT_EQ(publisher.update(position, position.stamp_ns).report->fields.nid_lrbg, etcs::kUnknownBaliseGroup);
}

TEST(TprPublisher, DirectionOfMovementIsKeptAtStandstill) {
  TprPublisher publisher(balise_map(), settings());
  EXPECT_EQ(publisher.update(at(forward(1, 150), 0, 0), kStart).report->fields.q_dirtrain, etcs::kUnknownSide);
  auto position = at(forward(1, 149), 1, -2);
  EXPECT_EQ(publisher.update(position, position.stamp_ns).report->fields.q_dirtrain, etcs::kReverse);
  position = at(forward(1, 149), 2, 0);
  EXPECT_EQ(publisher.update(position, position.stamp_ns).report->fields.q_dirtrain, etcs::kReverse);
}

TEST(TprPublisher, TheSpeedsNoiseAtRestIsNoMovement) {
  TprPublisher publisher(balise_map(), settings());
  double run_s = 0;
  const auto direction = [&](double offset_m, double speed_mps, bool standstill) {
    auto position = at(forward(1, offset_m), run_s, speed_mps);
    position.standstill = standstill;
    const auto outcome = publisher.update(position, position.stamp_ns);
    run_s += 0.1;
    return outcome.report ? outcome.report->fields.q_dirtrain : 99;
  };
  direction(150, 2, false);
  for (int i = 0; i < 10; ++i) direction(150.2 + (i % 2) * 0.01, i % 2 == 0 ? -0.03 : 0.03, false);
  EXPECT_EQ(direction(150.2, 0, true), etcs::kNominal);
  for (int i = 1; i <= 5; ++i) direction(150.2 - 0.012 * i, -0.12, true);  // begins to back
  EXPECT_EQ(direction(150.13, -0.12, false), etcs::kReverse);
}

TEST(TprPublisher, ADirectionOfBeforeAGapIsNotKnownAtStandstill) {
  TprPublisher publisher(balise_map(), settings());
  publisher.update(at(forward(1, 150), 0, 20), kStart);
  const auto later = at(forward(1, 150), 60, 0);
  const auto outcome = publisher.update(later, later.stamp_ns);
  ASSERT_TRUE(outcome.report.has_value());
  EXPECT_EQ(outcome.report->fields.q_dirtrain, etcs::kUnknownSide);
}

TEST(TprPublisher, AReferenceThatIsTakenBackIsSaidAtOnce) {
  TprPublisher publisher(balise_map(), settings());
  publisher.update(at(forward(1, 450), 0, 20), kStart);
  auto position = at(forward(1, 454), 0.2, 20);
  position.track_probability = 0.5;  // no switch is near
  const auto outcome = publisher.update(position, position.stamp_ns);
  ASSERT_TRUE(outcome.report.has_value());
  EXPECT_EQ(outcome.report->reason, Reason::balise_group);
  EXPECT_EQ(outcome.report->fields.nid_lrbg, etcs::kUnknownBaliseGroup);
  EXPECT_EQ(outcome.report->fields.l_doubtunder, etcs::kUnknownDistance);
}

TEST(TprPublisher, NumbersThatAreNoneAreRefused) {
  TprPublisher publisher(balise_map(), settings());
  auto position = at(forward(1, 150), 0, 20);
  position.speed_mps = HUGE_VAL;
  EXPECT_THAT(publisher.update(position, kStart).refusal, HasSubstr("not a number"));
  position.speed_mps = 20;
  position.distance_m = NAN;
  EXPECT_THAT(publisher.update(position, kStart).refusal, HasSubstr("not a number"));
  position = at(forward(1, NAN), 0, 20);
  position.distance_m = 0;
  EXPECT_EQ(publisher.update(position, kStart).report->fields.nid_lrbg, etcs::kUnknownBaliseGroup);
}

TEST(TprPublisher, AnUnknownSpeedIsNoStandstill) {
  TprPublisher publisher(balise_map(), settings());
  ASSERT_TRUE(publisher.update(at(forward(1, 350), 0, 20), kStart).report.has_value());
  auto position = at(forward(1, 390), 2, 20);
  position.speed_mps = NAN;
  EXPECT_EQ(publisher.update(position, position.stamp_ns).refusal, "");  // nothing is due
  position = at(forward(1, 410), 3, 20);
  position.speed_mps = NAN;
  const auto outcome = publisher.update(position, position.stamp_ns);  // over a group
  EXPECT_FALSE(outcome.report.has_value());
  EXPECT_THAT(outcome.refusal, HasSubstr("the speed is not known"));
  position = at(forward(1, 430), 4, 20);  // still due when it is known again
  const auto late = publisher.update(position, position.stamp_ns);
  ASSERT_TRUE(late.report.has_value());
  EXPECT_EQ(late.report->reason, Reason::balise_group);
  EXPECT_EQ(late.report->fields.nid_lrbg, kB);
  EXPECT_EQ(late.report->fields.v_train, 14U);
}

TEST(TprPublisher, TheOnboardUnitSetsModeLevelAndIntegrity) {
  TprPublisher publisher(balise_map(), settings());
  ASSERT_TRUE(publisher.update(at(forward(1, 450), 0, 20), kStart).report.has_value());
  Onboard onboard;
  onboard.stamp_ns = kStart + core::to_ns(0.5);
  ASSERT_TRUE(publisher.set_onboard(onboard, onboard.stamp_ns).ok());
  EXPECT_FALSE(publisher.update(at(forward(1, 460), 0.5, 20), onboard.stamp_ns).report.has_value());  // nothing new
  onboard.m_mode = 1;
  onboard.m_level = etcs::kLevelNtc;
  onboard.nid_ntc = 9;
  onboard.q_integrity = 1;
  onboard.integrity_ns = kStart + core::to_ns(0.5);
  onboard.train_length_m = 120;
  ASSERT_TRUE(publisher.set_onboard(onboard, onboard.stamp_ns).ok());
  auto position = at(forward(1, 470), 1, 20);
  const auto report = publisher.update(position, position.stamp_ns).report;
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->reason, Reason::mode);
  EXPECT_EQ(report->fields.m_mode, 1U);
  EXPECT_EQ(report->fields.nid_ntc, 9U);
  EXPECT_EQ(report->fields.q_length, 1U);
  EXPECT_EQ(report->fields.l_trainint, 138U);  // 10 m since, 3 m of doubt, 5 m of Q_LOCACC, 120 m
  EXPECT_EQ(etcs::decode(report->message, etcs::Baseline::b3).value(), report->fields);

  EXPECT_FALSE(publisher.onboard_silent(onboard.stamp_ns + core::to_ns(3)));
  position = at(forward(1, 600), 7, 20);
  EXPECT_TRUE(publisher.onboard_silent(position.stamp_ns));
  const auto silent = publisher.update(position, position.stamp_ns).report;
  ASSERT_TRUE(silent.has_value());
  EXPECT_EQ(silent->fields.m_mode, 1U);
  EXPECT_EQ(silent->fields.q_length, 0U);

  onboard.m_mode = 17;  // 4.0.0 only
  EXPECT_THAT(publisher.set_onboard(onboard, onboard.stamp_ns).error().message, HasSubstr("M_MODE"));
}

/// Beyond group B; 60 positions a second, before each of which the on-board unit says the same again.
class TrainWithOnboard : public ::testing::Test {
 protected:
  static constexpr double kPeriodS = 1 / 60.0;

  void step(double run_s, double distance_m, bool track_known = true) {
    auto position = at(forward(1, 450), run_s, 0);
    position.distance_m = distance_m;
    position.track_known = track_known;
    now_ns = position.stamp_ns;
    onboard.stamp_ns = now_ns + ahead_ns;
    core::ok_or_throw(publisher.set_onboard(onboard, now_ns));
    const auto outcome = publisher.update(position, now_ns);
    if (outcome.report) reported = outcome.report->fields;
  }
  void confirm(double at_s) {
    onboard.q_integrity = kByDriver;
    onboard.integrity_ns = kStart + core::to_ns(at_s) + ahead_ns;
    onboard.train_length_m = 200;
  }
  TprPublisher publisher{balise_map(), settings()};
  Onboard onboard;
  int64_t ahead_ns = 0;  // the on-board unit's clock
  std::optional<etcs::TrainPositionReport> reported;
  int64_t now_ns = kStart;
};

/// Stands 8700 m from where its distance began, confirmed after a second.
class ConfirmedTrain : public TrainWithOnboard {
 protected:
  static constexpr double kNextS = 1 + kPeriodS;

  ConfirmedTrain() {
    for (int i = 0; i < 60; ++i) step(i * kPeriodS, 8700);
    confirm(1);
    step(1, 8700);
  }
  etcs::TrainPositionReport next_report(double run_s, double distance_m, bool track_known = true) {
    reported.reset();
    for (int i = 0; !reported && i < 420; ++i) step(run_s + i * kPeriodS, distance_m, track_known);
    return reported.value();
  }
};

TEST_F(ConfirmedTrain, SaysItsLength) {
  EXPECT_EQ(reported->l_trainint, 208U);
  const auto report = next_report(kNextS, 8700);
  EXPECT_EQ(report.q_length, kByDriver);
  EXPECT_EQ(report.l_trainint, 208U);
  EXPECT_EQ(publisher.left_out(now_ns), "");
}

TEST_F(ConfirmedTrain, SaysNothingWhenTheDistanceBeganAgain) {
  const auto report = next_report(45, 0);
  EXPECT_EQ(report.q_length, 0U);
  EXPECT_FALSE(report.l_trainint.has_value());
  EXPECT_THAT(publisher.left_out(now_ns), HasSubstr("confirm it again"));
}

TEST_F(ConfirmedTrain, SaysNothingWhenTheDistanceJumpsWithoutAPause) {
  EXPECT_EQ(next_report(kNextS, 8200).q_length, 0U);
}

TEST_F(ConfirmedTrain, SaysNothingWhenTheWayWasGuessed) {
  // fusion goes on from its notes, with the distance that the train would have gone at an even speed
  EXPECT_EQ(next_report(21, 8700).q_length, 0U);
}

TEST_F(ConfirmedTrain, SaysNothingWhenTheClockWasSetBack) {
  EXPECT_EQ(next_report(-30, 8700).q_length, 0U);
}

TEST_F(ConfirmedTrain, SaysNothingWithoutABaliseGroup) {
  const auto report = next_report(kNextS, 8700, false);
  EXPECT_EQ(report.nid_lrbg, etcs::kUnknownBaliseGroup);
  EXPECT_EQ(report.q_length, 0U);
  EXPECT_FALSE(report.l_trainint.has_value());
}

/// At 40 m/s.
class RunningTrain : public TrainWithOnboard {
 protected:
  /// The last report on the way.
  etcs::TrainPositionReport run_until(double end_s) {
    for (; run_s_ < end_s; run_s_ += kPeriodS) step(run_s_, 40 * run_s_);
    return reported.value();
  }

 private:
  double run_s_ = 0;
};

TEST_F(RunningTrain, TheClockOfTheOnboardUnitIsNotTakenForThePlaceOfALaterTime) {
  ahead_ns = 30 * core::kNsPerSecond;
  run_until(10);
  EXPECT_THAT(publisher.left_out(now_ns), HasSubstr("30.0 s ahead"));
  confirm(10);
  EXPECT_EQ(run_until(45).q_length, 0U);
  EXPECT_EQ(reported->m_mode, onboard.m_mode);
  ahead_ns = 0;  // synchronised, but the confirmation is still of the other time
  EXPECT_EQ(run_until(55).q_length, 0U);
  EXPECT_THAT(publisher.left_out(now_ns), HasSubstr("confirm it again"));
  confirm(55);
  EXPECT_EQ(run_until(55.1).q_length, kByDriver);
  EXPECT_LE(*reported->l_trainint, 215U);
  EXPECT_EQ(publisher.left_out(now_ns), "");
  onboard.q_integrity = kIntegrityLost;
  ahead_ns = 30 * core::kNsPerSecond;
  EXPECT_EQ(run_until(57).q_length, kIntegrityLost) << "a loss has no time";
}

TEST_F(RunningTrain, ALittleAheadIsTakenOut) {
  ahead_ns = core::to_ns(0.8);
  run_until(10);
  confirm(10);
  run_until(20);
  const double since_m = 40 * core::seconds(static_cast<int64_t>(reported->t_train) * 10'000'000 -
                                            (kStart + core::to_ns(10)) % (int64_t{etcs::kUnknownTime} * 10'000'000));
  EXPECT_NEAR(*reported->l_trainint, since_m + 208, 2);
}

TEST_F(RunningTrain, OneWhoIsAheadAndDiesIsSilent) {
  Onboard ahead;
  ahead.stamp_ns = kStart + 30 * core::kNsPerSecond;
  ASSERT_TRUE(publisher.set_onboard(ahead, kStart).ok());
  EXPECT_FALSE(publisher.onboard_silent(kStart + core::to_ns(3)));
  EXPECT_TRUE(publisher.onboard_silent(kStart + core::to_ns(3.1)));
  EXPECT_TRUE(publisher.onboard_silent(kStart - core::to_ns(3.1))) << "this host's clock was set back";
}

TEST(TprPublisher, LocationsOfPacket58CountFromItsGroup) {
  TprPublisher publisher(balise_map(), settings());
  etcs::ReportParameters parameters;
  parameters.locations = {{500, 1}};
  ASSERT_TRUE(publisher.set_parameters(parameters, kB).ok());  // at 400 m: the location is at 900 m
  auto position = at(forward(1, 750), 0, 20);
  position.distance_m = 3;
  ASSERT_EQ(publisher.update(position, position.stamp_ns).report->fields.nid_lrbg, kC);
  EXPECT_EQ(publisher.origin(), kB);
  EXPECT_EQ(publisher.left_out(position.stamp_ns), "");
  position = at(forward(1, 888), 0.9, 20);
  position.distance_m = 141;
  EXPECT_FALSE(publisher.update(position, position.stamp_ns).report.has_value());
  position = at(forward(1, 891), 30, 20);  // fusion was away and begins again at 0
  position.distance_m = 0;
  const auto report = publisher.update(position, position.stamp_ns).report;
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->reason, Reason::location);

  ASSERT_TRUE(publisher.set_parameters(parameters, kE).ok());  // on another track
  position = at(forward(1, 892), 30.1, 20);
  position.distance_m = 1;
  EXPECT_FALSE(publisher.update(position, position.stamp_ns).report.has_value());
  EXPECT_THAT(publisher.left_out(position.stamp_ns), HasSubstr("locations of packet 58"));
}

TEST(TprPublisher, WhatAnotherOnboardUnitLeftBehindIsOvertaken) {
  TprPublisher publisher(balise_map(), settings());
  const auto after = [](double s) { return kStart + core::to_ns(s); };
  EXPECT_FALSE(publisher.onboard_overtaken(kStart, after(0.1)));  // the first one, whatever it is
  Onboard onboard;
  onboard.stamp_ns = after(1);
  ASSERT_TRUE(publisher.set_onboard(onboard, after(1.1)).ok());
  EXPECT_TRUE(publisher.onboard_overtaken(kStart, after(1.2)));
  EXPECT_FALSE(publisher.onboard_overtaken(after(2), after(2.1)));
  EXPECT_FALSE(publisher.onboard_overtaken(kStart, after(4.1))) << "its clock was set back";
  onboard.stamp_ns = after(30);  // ahead: the next one of another writer is not older than when it came
  ASSERT_TRUE(publisher.set_onboard(onboard, after(5)).ok());
  EXPECT_FALSE(publisher.onboard_overtaken(after(5.5), after(5.6)));
}

TEST(TprPublisher, Packet58ForTheOtherDirectionIsRefused) {
  TprPublisher publisher(balise_map(), settings());
  etcs::ReportParameters parameters;
  parameters.q_dir = etcs::kNominal;
  EXPECT_THAT(publisher.set_parameters(parameters).error().message, HasSubstr("not known yet"));
  ASSERT_TRUE(publisher.update(at(forward(1, 150), 0, 20), kStart).report.has_value());  // along A's nominal direction
  EXPECT_TRUE(publisher.set_parameters(parameters).ok());
  parameters.q_dir = etcs::kReverse;
  EXPECT_THAT(publisher.set_parameters(parameters).error().message, HasSubstr("other direction"));
}

TEST(TprPublisher, WithoutAMapTheReferenceIsUnknown) {
  TprPublisher publisher(nullptr, settings());
  EXPECT_EQ(publisher.update(at(forward(1, 450), 0, 20), kStart).report->fields.nid_lrbg, etcs::kUnknownBaliseGroup);
}

TEST(TprPublisher, SettingsThatCannotBeEncodedAreRefusedAtOnce) {
  auto wrong = settings();
  wrong.report.m_mode = 16;  // exists in 4.0.0 only
  EXPECT_THROW(TprPublisher(nullptr, wrong), core::BadInput);
}

}  // namespace
}  // namespace railfix::tpr_publisher
