// Min safe rear end and max safe front end as trackside works them out of a report.
#include <gtest/gtest.h>

#include "core/time.hpp"
#include "tpr_publisher/tpr_publisher.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix::tpr_publisher {
namespace {

using testing::balise_map;
using testing::forward;

constexpr int64_t kStart = 1'700'000'000'000'000'000;
constexpr double kPeriodS = 1 / 30.0;
constexpr double kLateS = 0.05;  // a state comes so long after its stamp
constexpr double kGroupM = 100;  // A on edge 1, Q_LOCACC 5 m
constexpr double kLengthM = 200;

Settings quiet_settings() {
  Settings settings;
  settings.report.foot_to_front_m = 2;
  settings.parameters.t_cycloc = etcs::kNoCycleTime;
  settings.parameters.m_loc = etcs::kReportNotAtGroups;
  return settings;
}

class SafeEnds : public ::testing::Test {
 protected:
  std::optional<Report> run_to(double offset_m) {
    TrainPosition position;
    position.stamp_ns = kStart + core::to_ns(run_s_);
    position.foot = forward(1, offset_m);
    position.track_known = true;
    position.track_probability = 1;
    position.speed_mps = 1;
    position.distance_m = offset_m;
    position.over_m = position.under_m = 3;
    now_ns_ = position.stamp_ns + core::to_ns(kLateS);
    run_s_ += kPeriodS;
    return publisher_.update(position, now_ns_).report;
  }
  void hear(uint32_t q_integrity) {
    onboard_.stamp_ns = onboard_.integrity_ns = now_ns_;
    onboard_.q_integrity = q_integrity;
    onboard_.train_length_m = kLengthM;
    core::ok_or_throw(publisher_.set_onboard(onboard_, now_ns_));
  }
  void begin_with(const Settings& settings) { publisher_ = TprPublisher(balise_map(), settings); }

  TprPublisher publisher_{balise_map(), quiet_settings()};
  Onboard onboard_;
  double run_s_ = 0;
  int64_t now_ns_ = kStart;
};

struct Ends {
  double front_m;
  double min_safe_rear_m;
  double max_safe_front_m;
  double min_safe_front_m;
};

Ends told(const etcs::TrainPositionReport& report) {
  const double step_m = etcs::scale_m(report.q_scale);
  const double front_m = report.d_lrbg * step_m;
  return {front_m, front_m - report.l_trainint.value_or(0), front_m + report.l_doubtunder * step_m,
          front_m - report.l_doubtover * step_m};
}

TEST_F(SafeEnds, WhatTheDriverConfirmsIsInTheReportThatItForces) {
  run_to(150);
  run_to(150);
  hear(etcs::kConfirmedByDriver);
  EXPECT_FALSE(run_to(150).has_value());  // of a time before that
  const auto report = run_to(150);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->reason, Reason::integrity_confirmed);
  EXPECT_EQ(report->fields.q_length, etcs::kConfirmedByDriver);
  EXPECT_EQ(report->fields.l_trainint, 208U);  // Q_LOCACC 5 m, 3 m of doubt
}

TEST_F(SafeEnds, AConfirmationStandsUntilTheNextOneHasAPlace) {
  auto settings = quiet_settings();
  settings.parameters.d_cycloc = 1;
  begin_with(settings);
  run_to(150);
  hear(etcs::kConfirmedByDevice);
  run_to(150);
  run_to(150);
  hear(etcs::kConfirmedByDevice);
  const auto report = run_to(160);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->fields.q_length, etcs::kConfirmedByDevice);
  EXPECT_EQ(report->fields.l_trainint, 218U);
  hear(etcs::kIntegrityLost);
  EXPECT_EQ(run_to(160)->fields.q_length, etcs::kIntegrityLost);  // at once
}

TEST_F(SafeEnds, TheRoundingOfDLrbgDoesNotMoveTheRearEndForward) {
  for (uint32_t q_scale = 0; q_scale <= 2; ++q_scale) {
    auto settings = quiet_settings();
    settings.report.finest_q_scale = q_scale;
    begin_with(settings);
    onboard_ = {};
    const double offset_m = kGroupM + 53.0;
    run_to(offset_m);
    hear(etcs::kConfirmedByDriver);
    std::optional<Report> report;
    for (int i = 0; i < 3 && !report; ++i) report = run_to(offset_m);
    ASSERT_TRUE(report.has_value());
    EXPECT_LE(told(report->fields).min_safe_rear_m, 55.0 - 8.0 - kLengthM) << "Q_SCALE " << q_scale;
  }
}

TEST_F(SafeEnds, ALocationIsPassedByTheMaxSafeFrontEndThatIsReported) {
  run_to(120);
  etcs::ReportParameters wanted = quiet_settings().parameters;
  wanted.locations = {{150, 1}};
  core::ok_or_throw(publisher_.set_parameters(wanted));
  std::optional<Report> report;
  for (double offset_m = 121; !report && offset_m < 300; offset_m += 0.1) report = run_to(offset_m);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->reason, Reason::location);
  EXPECT_NEAR(told(report->fields).max_safe_front_m, 150, 0.21);
}

TEST_F(SafeEnds, ALocationIsPassedByTheMinSafeRearEndOfTheTrainAsTheOnboardUnitSaysItIs) {
  run_to(120);
  etcs::ReportParameters wanted = quiet_settings().parameters;
  wanted.locations = {{50, 0}};
  core::ok_or_throw(publisher_.set_parameters(wanted));
  EXPECT_NE(publisher_.left_out(now_ns_), "");  // nobody has said how long the train is
  hear(etcs::kNoIntegrityInformation);
  EXPECT_EQ(publisher_.left_out(now_ns_), "");
  onboard_.train_length_m = 0;  // taken back, as while wagons are coupled
  core::ok_or_throw(publisher_.set_onboard(onboard_, now_ns_));
  EXPECT_NE(publisher_.left_out(now_ns_), "");
  hear(etcs::kNoIntegrityInformation);
  std::optional<Report> report;
  for (double offset_m = 121; !report && offset_m < 400; offset_m += 0.1) report = run_to(offset_m);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->reason, Reason::location);
  EXPECT_NEAR(told(report->fields).min_safe_front_m - kLengthM, 50, 0.21);
}

}  // namespace
}  // namespace railfix::tpr_publisher
