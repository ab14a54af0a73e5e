// What the on-board unit says of mode, level and train integrity, and how long it is believed.
#include <gmock/gmock.h>

#include <cmath>

#include "unit/tpr_publisher/publisher_fixture.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;
using ::testing::HasSubstr;

TEST(OnboardUnit, SetsModeLevelAndIntegrity) {
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

TEST(OnboardUnit, AModeThereAndBackBetweenTwoPositionsIsReported) {
  TprPublisher publisher(balise_map(), settings());
  ASSERT_TRUE(publisher.update(at(forward(1, 450), 0, 20), kStart).report.has_value());
  Onboard onboard;
  onboard.stamp_ns = kStart;
  for (const uint32_t m_mode : {1U, 0U}) {
    onboard.m_mode = m_mode;
    ASSERT_TRUE(publisher.set_onboard(onboard, kStart).ok());
  }
  const auto report = publisher.update(at(forward(1, 452), 0.1, 20), kStart + core::to_ns(0.1)).report;
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->reason, Reason::mode);
  EXPECT_EQ(report->fields.m_mode, 0U);
}

// From the last one that was heard, not from the last report.
TEST(OnboardUnit, TheFirstWantOfOneThatBeganAnewIsReported) {
  TprPublisher publisher(balise_map(), settings());
  double run_s = 0;
  const auto reported = [&](uint32_t wanted, Reason because) -> std::optional<Reason> {
    Onboard onboard;
    onboard.stamp_ns = kStart + core::to_ns(run_s += 0.1);
    onboard.reports_wanted = wanted;
    onboard.wanted_because = because;
    core::ok_or_throw(publisher.set_onboard(onboard, onboard.stamp_ns));
    const auto report = publisher.update(at(forward(1, 450), run_s, 0), onboard.stamp_ns).report;
    return report ? std::optional(report->reason) : std::nullopt;
  };
  EXPECT_EQ(reported(0, Reason{}), Reason::start);
  EXPECT_EQ(reported(1, Reason::border), Reason::border);
  EXPECT_EQ(reported(1, Reason::border), std::nullopt);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(reported(0, Reason{}), std::nullopt) << "it began anew";
  EXPECT_EQ(reported(1, Reason::session), Reason::session);
  EXPECT_EQ(reported(2, Reason::error), Reason::error);
  EXPECT_EQ(reported(1, Reason::session), Reason::session) << "anew, and it has not said 0";
}

// A mode of 4.0.0 from the on-board unit of a train that reports in 3.x.
TEST(OnboardUnit, AModeThatCannotBeSaidTakesNothingAlong) {
  TprPublisher publisher(balise_map(), settings());
  ASSERT_TRUE(publisher.update(at(forward(1, 450), 0, 20), kStart).report.has_value());
  Onboard onboard;
  onboard.stamp_ns = kStart;
  onboard.m_mode = 17;
  onboard.m_level = etcs::kLevel1;
  onboard.q_integrity = etcs::kIntegrityLost;
  onboard.reports_wanted = 1;
  onboard.wanted_because = Reason::border;
  std::vector<Reason> reasons;
  etcs::TrainPositionReport fields;
  for (int i = 1; i < 5; ++i) {
    EXPECT_THAT(publisher.set_onboard(onboard, kStart).error().message, HasSubstr("M_MODE"));
    const auto position = at(forward(1, 450 + i), 0.05 * i, 20);
    const auto report = publisher.update(position, position.stamp_ns).report;
    if (!report) continue;
    reasons.push_back(report->reason);
    fields = report->fields;
  }
  EXPECT_THAT(reasons, ::testing::ElementsAre(Reason::level)) << "one report says all of it";
  EXPECT_EQ(fields.m_level, uint32_t{etcs::kLevel1});
  EXPECT_EQ(fields.q_length, uint32_t{etcs::kIntegrityLost});
  EXPECT_EQ(fields.m_mode, 0U);
}

TEST(OnboardUnit, Level3IsLevel2In4) {
  auto four = settings();
  four.report.baseline = etcs::Baseline::b4;
  TprPublisher publisher(balise_map(), four);
  ASSERT_TRUE(publisher.mode_assumed());
  Onboard onboard;
  onboard.stamp_ns = kStart;
  onboard.m_mode = 2;
  onboard.m_level = etcs::kLevel3;
  ASSERT_TRUE(publisher.set_onboard(onboard, kStart).ok());
  EXPECT_FALSE(publisher.mode_assumed());
  const auto fields = publisher.update(at(forward(1, 450), 0, 20), kStart).report.value().fields;
  EXPECT_EQ(fields.m_mode, 2U);
  EXPECT_EQ(fields.m_level, uint32_t{etcs::kLevel2});
}

TEST(OnboardUnit, AnNtcIsOfLevelNtcOnly) {
  TprPublisher publisher(balise_map(), settings());
  ASSERT_TRUE(publisher.update(at(forward(1, 450), 0, 20), kStart).report.has_value());
  Onboard onboard;
  onboard.stamp_ns = kStart;
  const auto reports = [&](double run_s) {
    core::ok_or_throw(publisher.set_onboard(onboard, kStart));
    return publisher.update(at(forward(1, 450 + 20 * run_s), run_s, 20), kStart + core::to_ns(run_s)).report;
  };
  onboard.nid_ntc = 9;
  EXPECT_FALSE(reports(0.1).has_value());
  onboard.m_level = etcs::kLevelNtc;
  EXPECT_EQ(reports(0.2).value().reason, Reason::level);
  onboard.nid_ntc = 10;
  EXPECT_EQ(reports(0.3).value().reason, Reason::level);
}

/// Beyond group B; 60 positions a second, before each of which the on-board unit says the same again.
class TrainWithOnboard : public ::testing::Test {
 protected:
  static constexpr double kPeriodS = 1 / 60.0;

  void step(double run_s, double distance_m, bool track_known = true) {
    auto position = at(forward(1, foot_m), run_s, 0);
    position.distance_m = distance_m;
    position.track_known = track_known;
    now_ns = position.stamp_ns;
    onboard.stamp_ns = now_ns + ahead_ns;
    core::ok_or_throw(publisher.set_onboard(onboard, now_ns));
    const auto outcome = publisher.update(position, now_ns);
    if (outcome.report) reported = outcome.report->fields;
  }
  void confirm(double at_s) {
    onboard.q_integrity = etcs::kConfirmedByDriver;
    onboard.integrity_ns = kStart + core::to_ns(at_s) + ahead_ns;
    onboard.train_length_m = 200;
  }
  void begin_with_4() {
    auto four = settings();
    four.report.baseline = etcs::Baseline::b4;
    four.report.train_over_m = 30;
    four.report.train_under_m = 40;
    publisher = TprPublisher(balise_map(), four);
  }
  TprPublisher publisher{balise_map(), settings()};
  Onboard onboard;
  int64_t ahead_ns = 0;  // the on-board unit's clock
  double foot_m = 450;
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
  EXPECT_EQ(report.q_length, etcs::kConfirmedByDriver);
  EXPECT_EQ(report.l_trainint, 208U);
  EXPECT_EQ(publisher.left_out(now_ns), "");
}

// SUBSET-026 4.0.0 3.6.5.2, table 2c [5].
TEST_F(TrainWithOnboard, In4AConfirmationIsReportedOnce) {
  begin_with_4();
  for (int i = 0; i < 60; ++i) step(i * kPeriodS, 8700);
  confirm(1);
  step(1, 8700);
  EXPECT_EQ(reported->l_trainint, 208U);
  reported.reset();
  for (int i = 1; !reported && i < 420; ++i) step(1 + i * kPeriodS, 8700);
  EXPECT_EQ(reported.value().q_length, 0U);
}

// Table 2c [8]: a device confirms, then the train backs before the next report.
TEST_F(TrainWithOnboard, In4ATrainThatHasBackedIsNotComplete) {
  begin_with_4();
  for (int i = 0; i < 60; ++i) step(i * kPeriodS, 8700);
  confirm(1);
  onboard.q_integrity = etcs::kConfirmedByDevice;
  for (int i = 0; i < 60; ++i) step(1 + i * kPeriodS, 8700);
  const auto back = [&](int i) {
    auto position = at(forward(1, 450), 2 + i * kPeriodS, -1);
    position.distance_m = 8700 - i * kPeriodS;
    return publisher.update(position, position.stamp_ns).report;
  };
  std::optional<Report> report;
  for (int i = 0; i < 420; ++i) {
    onboard.stamp_ns = kStart + core::to_ns(2 + i * kPeriodS);
    core::ok_or_throw(publisher.set_onboard(onboard, onboard.stamp_ns));
    if (auto next = back(i)) report = std::move(next);
  }
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->fields.q_length, 0U);
}

// 3.6.4.1.5, 3.6.5.2.4: vehicles behind the engine belong to the min safe rear end.
TEST_F(TrainWithOnboard, InASupervisedManoeuvreTheRearEndLiesFartherBehind) {
  begin_with_4();
  onboard.m_mode = 17;
  for (int i = 0; i < 60; ++i) step(i * kPeriodS, 8700);
  confirm(1);
  step(1, 8700);
  EXPECT_EQ(reported->l_trainint, 238U);
}

TEST_F(ConfirmedTrain, IsLongerWhenItsFrontEndIsCorrectedForward) {
  foot_m += 60;
  EXPECT_EQ(next_report(kNextS, 8700).l_trainint, 268U);
}

// 3.6.5.2.7: nor later, when the place is known, from where it was not.
TEST_F(TrainWithOnboard, ATrainThatWasConfirmedAtAnUnknownPlaceHasNoLength) {
  for (int i = 0; i < 60; ++i) step(i * kPeriodS, 8700, false);
  confirm(1);
  step(1, 8700, false);
  for (int i = 1; i < 420; ++i) step(1 + i * kPeriodS, 8700);
  ASSERT_EQ(reported->nid_lrbg, kB);
  EXPECT_EQ(reported->q_length, 0U);
  EXPECT_FALSE(reported->l_trainint.has_value());
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
  EXPECT_EQ(run_until(55.1).q_length, etcs::kConfirmedByDriver);
  EXPECT_LE(*reported->l_trainint, 215U);
  EXPECT_EQ(publisher.left_out(now_ns), "");
  onboard.q_integrity = etcs::kIntegrityLost;
  ahead_ns = 30 * core::kNsPerSecond;
  EXPECT_EQ(run_until(57).q_length, etcs::kIntegrityLost) << "a loss has no time";
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

TEST(OnboardUnit, WhatAnotherOneLeftBehindIsOvertaken) {
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

/// Stands beyond group B; T_CYCLOC is 6 s, and who says nothing for 3 s is silent.
class SilentOnboard : public ::testing::Test {
 protected:
  void say_after(double run_s, uint32_t q_integrity) {
    Onboard onboard;
    onboard.stamp_ns = kStart + core::to_ns(run_s);
    onboard.q_integrity = q_integrity;
    onboard.integrity_ns = kStart;
    onboard.train_length_m = 120;
    core::ok_or_throw(publisher.set_onboard(onboard, onboard.stamp_ns));
  }
  std::optional<Report> report_after(double run_s) {
    const auto position = at(forward(1, 450), run_s, 0);
    return publisher.update(position, position.stamp_ns).report;
  }
  TprPublisher publisher{balise_map(), settings()};
};

TEST_F(SilentOnboard, ALossThatIsHeardAgainAfterASilenceIsReportedAgain) {
  say_after(2.9, etcs::kIntegrityLost);
  EXPECT_EQ(report_after(3).value().fields.q_length, etcs::kIntegrityLost);
  const auto silent = report_after(9).value();
  EXPECT_EQ(silent.reason, Reason::cycle_time);
  EXPECT_EQ(silent.fields.q_length, etcs::kNoIntegrityInformation);
  say_after(9.5, etcs::kIntegrityLost);
  const auto heard = report_after(9.6);
  ASSERT_TRUE(heard.has_value());
  EXPECT_EQ(heard->reason, Reason::integrity_lost);
  EXPECT_EQ(heard->fields.q_length, etcs::kIntegrityLost);
}

TEST_F(SilentOnboard, WhatWasNotTakenBackIsNotSaidAgain) {
  say_after(2.9, etcs::kIntegrityLost);
  EXPECT_EQ(report_after(3).value().fields.q_length, etcs::kIntegrityLost);
  EXPECT_FALSE(report_after(8).has_value());
  say_after(8.5, etcs::kIntegrityLost);
  EXPECT_FALSE(report_after(8.6).has_value());
}

}  // namespace
}  // namespace railfix::tpr_publisher
