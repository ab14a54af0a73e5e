#include "tpr_publisher/tpr_publisher.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "unit/tpr_publisher/publisher_fixture.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

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

TEST(TprPublisher, SilenceOfTheStateIsSaidWhetherAReportIsDueOrNot) {
  TprPublisher publisher(balise_map(), settings());
  EXPECT_THAT(publisher.tick(kStart).refusal, HasSubstr("no train_state yet"));
  ASSERT_TRUE(publisher.update(at(forward(1, 450), 0, 20), kStart).report.has_value());
  EXPECT_EQ(publisher.tick(kStart + core::to_ns(0.9)).refusal, "");
  const std::string old = "the last train_state is 5.0 s old, the limit is 1 s.";
  EXPECT_EQ(publisher.tick(kStart + 5 * core::kNsPerSecond).refusal, "No position report can be sent: " + old);
  EXPECT_EQ(publisher.update(at(forward(1, 450), 0, 20), kStart + 5 * core::kNsPerSecond).refusal,
            "No position report can be sent: " + old)
      << "nor of one that comes so late";
  EXPECT_THAT(publisher.tick(kStart + 7 * core::kNsPerSecond).refusal,
              HasSubstr("not sent: the last train_state is 7.0 s"));
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

/// Q_DIRTRAIN of the report that a state causes, ten a second; 99 where it causes none.
class SaidDirection {
 public:
  uint32_t operator()(double offset_m, double speed_mps, bool standstill) {
    auto position = at(forward(1, offset_m), run_s_, speed_mps);
    position.standstill = standstill;
    const auto outcome = publisher_.update(position, position.stamp_ns);
    run_s_ += 0.1;
    return outcome.report ? outcome.report->fields.q_dirtrain : 99;
  }

 private:
  TprPublisher publisher_{balise_map(), settings()};
  double run_s_ = 0;
};

TEST(TprPublisher, TheSpeedsNoiseAtRestIsNoMovement) {
  SaidDirection direction;
  direction(150, 2, false);
  for (int i = 0; i < 10; ++i) direction(150.2 + (i % 2) * 0.01, i % 2 == 0 ? -0.03 : 0.03, false);
  EXPECT_EQ(direction(150.2, 0, true), etcs::kNominal);
  for (int i = 1; i <= 5; ++i) direction(150.2 - 0.012 * i, -0.12, true);  // begins to back
  EXPECT_EQ(direction(150.13, -0.12, false), etcs::kReverse);
}

// As with a dark camera and a wheel that has slipped: the estimate goes back, the train does not.
TEST(TprPublisher, ACorrectionWhileItBrakesIsNoMovementBack) {
  SaidDirection direction;
  direction(150, 2, false);
  direction(150.2, 0.5, false);
  direction(150.13, -0.4, false);
  direction(150.05, -0.3, false);
  EXPECT_EQ(direction(150.05, 0, true), etcs::kNominal);
  for (int i = 1; i <= 5; ++i) direction(150.05 - 0.02 * i, -0.2, false);
  EXPECT_EQ(direction(149.95, 0, true), etcs::kReverse) << "it rested before";
}

// As by GNSS at a station: what the estimate went back there is no way that the train backs when it starts.
TEST(TprPublisher, ACorrectionAtRestIsNoMovement) {
  for (const double corrected_m : {-3.0, -0.9, 0.9, 3.0}) {
    SaidDirection direction;
    direction(150, 2, false);
    direction(150.2, 0.5, false);
    const int steps = std::abs(corrected_m) > 1 ? 1 : 60;  // at once, or fix by fix
    for (int i = 0; i <= steps; ++i) direction(150.2 + corrected_m * i / steps, i % 2 == 0 ? -0.001 : 0.001, true);
    uint32_t said = 99;
    for (int i = 1; i <= 20 && said == 99; ++i)
      said = direction(150.2 + corrected_m + 0.012 * i, i == 1 ? -0.01 : 0.12, false);
    EXPECT_EQ(said, etcs::kNominal) << corrected_m;
    direction(150.5 + corrected_m, 0, true);
    for (int i = 1; i <= 3; ++i) direction(150.5 + corrected_m - 0.02 * i, -0.2, true);
    EXPECT_EQ(direction(150.42 + corrected_m, -0.2, false), etcs::kReverse) << corrected_m;
  }
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

// 3.16.3.3.2: whoever receives it orders reports by it.
TEST(TprPublisher, TrainborneTimeGoesOnWhenTheClockIsSetBack) {
  TprPublisher publisher(balise_map(), settings());
  std::vector<uint32_t> t_train;
  for (const double run_s : {0.0, 7.0, -20.0, -13.0, -6.0}) {
    const auto position = at(forward(1, 150), run_s, 0);
    const auto report = publisher.update(position, position.stamp_ns).report;
    ASSERT_TRUE(report.has_value()) << run_s;
    EXPECT_EQ(report->sent_ns, position.stamp_ns);
    t_train.push_back(report->fields.t_train - tpr_publisher::t_train(kStart));
  }
  EXPECT_EQ(t_train, (std::vector<uint32_t>{0, 700, 701, 1401, 2101}));
}

// Two hosts whose clocks are 0.9 s apart: whoever takes over is not out of order.
TEST(TprPublisher, TrainborneTimeGoesOnWhereAnotherOneReported) {
  TprPublisher publisher(balise_map(), settings());
  const auto t_train = [](double run_s) { return tpr_publisher::t_train(kStart + core::to_ns(run_s)); };
  publisher.watch(at(forward(1, 150), 0, 0), kStart);
  publisher.hear_trainborne(t_train(0.9), kStart);
  publisher.hear_trainborne(t_train(0.4), kStart);
  publisher.hear_trainborne(etcs::kUnknownTime, kStart);
  std::vector<uint32_t> said;
  for (const double run_s : {0.1, 6.1}) {
    const auto position = at(forward(1, 150), run_s, 0);
    said.push_back(publisher.update(position, position.stamp_ns).report.value().fields.t_train);
  }
  EXPECT_THAT(said, ElementsAre(t_train(0.91), t_train(6.91)));
}

TEST(TprPublisher, TrainborneTimeGoesOnWhereAProcessBeforeReported) {
  TprPublisher publisher(balise_map(), settings());
  EXPECT_EQ(publisher.trainborne_ns(), 0);
  publisher.go_on_after(kStart + core::to_ns(3600));
  const auto report = publisher.update(at(forward(1, 150), 0, 0), kStart).report.value();
  EXPECT_EQ(report.fields.t_train, tpr_publisher::t_train(kStart + core::to_ns(3600.01)));
  EXPECT_EQ(publisher.trainborne_ns(), kStart + core::to_ns(3600.01));
}

// 4.0.0 3.6.5.2.5: also when another one than the one that is in charge now has said it.
TEST(TprPublisher, AConfirmationThatAnotherOneReportedIsNotReportedAgain) {
  auto four = settings();
  four.report.baseline = etcs::Baseline::b4;
  for (const bool heard : {false, true}) {
    TprPublisher standby(balise_map(), four);
    standby.watch(at(forward(1, 150), 0, 10), kStart);
    Onboard onboard;
    onboard.stamp_ns = kStart + core::to_ns(0.2);
    onboard.integrity_ns = kStart + core::to_ns(0.1);
    onboard.q_integrity = etcs::kConfirmedByDriver;
    onboard.train_length_m = 100;
    ASSERT_TRUE(standby.set_onboard(onboard, onboard.stamp_ns).ok());
    if (heard) standby.hear_confirmed(kStart + core::to_ns(0.2));  // of a state that has not come here yet
    standby.watch(at(forward(1, 152), 0.2, 10), kStart + core::to_ns(0.2));
    const auto report = standby.update(at(forward(1, 160), 1, 10), kStart + core::to_ns(1)).report.value();
    EXPECT_EQ(report.fields.q_length, heard ? etcs::kNoIntegrityInformation : etcs::kConfirmedByDriver);
  }
}

TEST(TprPublisher, TrainborneTimeIsNotBeforeThePosition) {
  TprPublisher publisher(balise_map(), settings());
  for (const double run_s : {0.0, 7.0}) {
    const auto position = at(forward(1, 150), run_s, 0);
    const auto report = publisher.update(position, position.stamp_ns - core::to_ns(0.9)).report;
    ASSERT_TRUE(report.has_value());
    EXPECT_EQ(report->fields.t_train, tpr_publisher::t_train(position.stamp_ns));
  }
}

// Corrected to the track beside, which a map_matcher was as sure of.
TEST(TprPublisher, AnotherTrackIsSaidAtOnce) {
  auto seldom = settings();
  seldom.parameters.m_loc = etcs::kReportNotAtGroups;
  TprPublisher publisher(balise_map(), seldom);
  ASSERT_EQ(publisher.update(at(forward(1, 750), 0, 20), kStart).report.value().fields.nid_lrbg, kC);
  auto position = at(reverse(3, 80), 0.1, 20);
  position.distance_m = 752;
  auto report = publisher.update(position, position.stamp_ns).report;
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->reason, Reason::balise_group);
  EXPECT_EQ(report->fields.nid_lrbg, kE);
  position = at(forward(3, 450), 1.2, 20);  // the camera looks the other way there
  position.distance_m = 774;
  report = publisher.update(position, position.stamp_ns).report;
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->fields.nid_lrbg, kE);
  EXPECT_EQ(report->fields.q_dirlrbg, uint32_t{etcs::kNominal});
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
