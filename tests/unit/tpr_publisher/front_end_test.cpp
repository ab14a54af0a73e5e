// The active cab at the end out of which the camera looks, or at the other one.
#include "tpr_publisher/front_end.hpp"

#include <gmock/gmock.h>

#include <algorithm>

#include "core/time.hpp"
#include "tpr_publisher/tpr_publisher.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix::tpr_publisher::front_end_test {
namespace {

using namespace testing;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int64_t kStart = 1'700'000'000'000'000'000;
constexpr double kFrontM = 2;
constexpr double kRearM = 98;

Settings settings(double foot_to_rear_m = kRearM) {
  Settings settings;
  settings.parameters.t_cycloc = 6;
  settings.report.foot_to_front_m = kFrontM;
  settings.foot_to_rear_m = foot_to_rear_m;
  return settings;
}

// One train of two cabs: a camera in either of them would see the same ride.
class Ride {
 public:
  Ride(bool camera_looks_ahead, const Settings& settings)
      : ahead_(camera_looks_ahead), publisher_(balise_map(), settings) {}

  // The camera's foot on edge 1; the train's speed towards the end of the edge.
  Outcome run(double foot_m, double speed_mps) {
    run_s_ += 0.5;
    TrainPosition position;
    position.stamp_ns = kStart + core::to_ns(run_s_);
    position.foot = ahead_ ? forward(1, foot_m) : reverse(1, foot_m);
    position.track_known = true;
    position.track_probability = 1;
    position.distance_m = ahead_ ? foot_m : -foot_m;
    position.speed_mps = ahead_ ? speed_mps : -speed_mps;
    position.standstill = speed_mps == 0;
    position.over_m = ahead_ ? 3 : 4;
    position.under_m = ahead_ ? 4 : 3;
    return publisher_.update(position, position.stamp_ns);
  }
  void hear(Onboard onboard) {
    onboard.stamp_ns = kStart + core::to_ns(run_s_);
    if (onboard.q_integrity != 0) onboard.integrity_ns = onboard.stamp_ns;
    core::ok_or_throw(publisher_.set_onboard(onboard, onboard.stamp_ns));
  }
  TprPublisher& publisher() { return publisher_; }

 private:
  bool ahead_;
  TprPublisher publisher_;
  double run_s_ = 0;
};

Onboard with(ActiveCab cab) {
  Onboard onboard;
  onboard.active_cab = cab;
  return onboard;
}

// Camera A looks ahead, camera B back; they stand 100 m apart, each 2 m from its end of the train.
TEST(FrontEnd, ReportsDoNotDependOnTheEndOutOfWhichTheCameraLooks) {
  constexpr double kApartM = kRearM - kFrontM;
  for (const bool driven_ahead : {true, false}) {
    Ride a(true, settings());
    Ride b(false, settings());
    auto said_to_a = with(driven_ahead ? ActiveCab::camera : ActiveCab::other);
    auto said_to_b = with(driven_ahead ? ActiveCab::other : ActiveCab::camera);
    int compared = 0;
    for (double at_m = 250; at_m < 1000; at_m += 10) {
      said_to_b.reports_wanted = ++said_to_a.reports_wanted;
      a.hear(said_to_a);
      b.hear(said_to_b);
      const auto by_a = a.run(at_m, 20);
      const auto by_b = b.run(at_m - kApartM, 20);
      const auto map = balise_map();
      const bool on_a_group = std::ranges::any_of(map->balise_groups, [&](const track::BaliseGroup& group) {
        return group.edge == 1 && group.offset_m >= at_m - kApartM && group.offset_m <= at_m;
      });
      if (on_a_group) continue;  // either camera passes the groups where it is itself
      ASSERT_TRUE(by_a.report && by_b.report) << at_m;
      EXPECT_EQ(by_a.report->fields, by_b.report->fields) << at_m;
      ++compared;
    }
    EXPECT_GT(compared, 40);
  }
}

TEST(FrontEnd, TheOtherEndIsTheFrontWhileItsCabIsActive) {
  Ride ride(true, settings());
  ride.hear(with(ActiveCab::camera));
  ride.run(390, 20);
  const auto ahead = ride.run(500, 20).report->fields;  // B, nominal against the edge, at 400
  EXPECT_EQ(ahead.nid_lrbg, kB);
  EXPECT_EQ(ahead.d_lrbg, 1020U);
  EXPECT_EQ(ahead.q_dirlrbg, etcs::kReverse);
  EXPECT_EQ(ahead.q_dlrbg, etcs::kReverse);
  EXPECT_EQ(ahead.q_dirtrain, etcs::kReverse);
  EXPECT_EQ(ahead.l_doubtover, 80U);  // Q_LOCACC 5 m and 3 m
  EXPECT_EQ(ahead.l_doubtunder, 90U);
  ride.run(500, 0);
  ride.hear(with(ActiveCab::other));
  const auto turned = ride.run(500, 0);
  ASSERT_TRUE(turned.report.has_value()) << "the trackside has to learn at once that the front is elsewhere";
  EXPECT_EQ(turned.report->reason, Reason::start);
  const auto& back = turned.report->fields;
  EXPECT_EQ(back.nid_lrbg, kB);
  EXPECT_EQ(back.d_lrbg, 20U);  // 98 m behind the foot
  EXPECT_EQ(back.q_dirlrbg, etcs::kNominal);
  EXPECT_EQ(back.q_dlrbg, etcs::kReverse);  // still beyond B
  EXPECT_EQ(back.q_dirtrain, etcs::kReverse);
  EXPECT_EQ(back.l_doubtover, 90U);
  EXPECT_EQ(back.l_doubtunder, 80U);
  const auto leaves = ride.run(490, -20);
  EXPECT_EQ(leaves.report->reason, Reason::moving);
  EXPECT_EQ(leaves.report->fields.d_lrbg, 80U);  // the front is on the other side of B now
  EXPECT_EQ(leaves.report->fields.q_dlrbg, etcs::kNominal);
  EXPECT_EQ(leaves.report->fields.q_dirtrain, etcs::kNominal);
}

TEST(FrontEnd, NobodyKnowsTheFrontOfATrainOfTwoCabsBeforeOneIsSaid) {
  Ride ride(true, settings());
  ride.run(390, 20);
  EXPECT_EQ(ride.run(450, 0).report->fields.nid_lrbg, etcs::kUnknownBaliseGroup);
  EXPECT_THAT(ride.publisher().front_unknown(), HasSubstr("not said yet"));
  ride.hear(with(ActiveCab::camera));
  const auto said = ride.run(450, 0).report;
  ASSERT_TRUE(said.has_value()) << "a group is known from now on";
  EXPECT_EQ(said->fields.nid_lrbg, kB);
  EXPECT_THAT(ride.publisher().front_unknown(), IsEmpty());
  ride.hear(with(ActiveCab::not_said));  // the driver walks
  EXPECT_THAT(ride.publisher().front_unknown(), IsEmpty());
}

TEST(FrontEnd, AnEndThatNobodyMeasuredIsNoFront) {
  Ride ride(true, settings(-1));
  ride.run(390, 20);
  EXPECT_EQ(ride.run(450, 0).report->fields.nid_lrbg, kB) << "one cab: it is the camera's";
  ride.hear(with(ActiveCab::other));
  const auto other = ride.run(450, 0).report;
  ASSERT_TRUE(other.has_value());
  EXPECT_EQ(other->reason, Reason::start);
  EXPECT_EQ(other->fields.nid_lrbg, etcs::kUnknownBaliseGroup);
  EXPECT_THAT(ride.publisher().front_unknown(), HasSubstr("foot_to_rear_m is not set"));
}

TEST(FrontEnd, WhatWasAskedAndConfirmedForTheOldFrontIsOver) {
  Ride ride(true, settings());
  auto onboard = with(ActiveCab::camera);
  onboard.q_integrity = 2;
  onboard.train_length_m = 110;
  ride.run(390, 20);
  ride.run(410, 20);
  etcs::ReportParameters parameters;
  parameters.t_cycloc = 6;
  parameters.locations = {{500, 1}};
  ASSERT_TRUE(ride.publisher().set_parameters(parameters).ok());
  ride.hear(onboard);
  EXPECT_EQ(ride.run(410, 0).report->fields.q_length, 2U);
  EXPECT_THAT(ride.publisher().left_out(kStart + core::kNsPerSecond), IsEmpty());
  auto other = onboard;
  other.active_cab = ActiveCab::other;
  other.integrity_ns = 0;
  other.q_integrity = 0;
  ride.hear(other);
  EXPECT_EQ(ride.run(410, 0).report->fields.q_length, 0U);
  EXPECT_THAT(ride.publisher().left_out(kStart + core::kNsPerSecond), HasSubstr("the cab was changed"));
  ride.run(390, 0);
  other.q_integrity = 2;
  ride.hear(other);  // confirmed again: the rear end is the camera's now
  const auto again = ride.run(390, 0).report->fields;
  EXPECT_EQ(again.l_trainint, 119U);  // 110 m, 4 m that the train may be further back along its new axis, Q_LOCACC 5 m
}

TEST(FrontEnd, ATrainThatBeginsInTheOtherCabRefersToTheGroupBehindThat) {
  for (const bool said_first : {true, false}) {
    Ride ride(true, settings());
    if (said_first) ride.hear(with(ActiveCab::other));
    ride.run(300, 0);
    if (!said_first) ride.hear(with(ActiveCab::other));
    auto wanted = with(ActiveCab::other);
    wanted.reports_wanted = 1;
    ride.hear(wanted);
    const auto fields = ride.run(300, 0).report->fields;
    EXPECT_EQ(fields.nid_lrbg, kB) << "A lies ahead of it";
    EXPECT_EQ(fields.d_lrbg, 1980U);
    EXPECT_EQ(fields.q_dlrbg, etcs::kNominal);
    EXPECT_EQ(fields.q_dirlrbg, etcs::kNominal);
  }
}

TEST(FrontEnd, LocationsStandWhenAProcessBeganAgainAndHearsWhichCabIsActive) {
  Ride ride(true, settings());
  etcs::ReportParameters parameters;
  parameters.t_cycloc = etcs::kNoCycleTime;
  parameters.m_loc = etcs::kReportNotAtGroups;
  parameters.locations = {{300, 1}};
  ASSERT_TRUE(ride.publisher().set_parameters(parameters, kC).ok());
  ride.run(600, -20);
  ride.hear(with(ActiveCab::other));
  ride.run(600, -20);  // the front 198 m beyond C
  double reported_at_m = 0;
  for (double at_m = 590; at_m > 420 && reported_at_m == 0; at_m -= 10) {
    const auto report = ride.run(at_m, -20).report;
    if (report && report->reason == Reason::location) reported_at_m = at_m;
  }
  EXPECT_NEAR(reported_at_m, 510, 15) << "the max safe front end may be 10 m ahead";
}

// The front's antenna reads B when the foot is still 98 m in front of it.
TEST(FrontEnd, LocationsCountFromAGroupThatTheFootHasNotPassed) {
  Ride ride(true, settings());
  ride.hear(with(ActiveCab::other));
  ride.run(600, -20);
  ride.run(498, -20);
  etcs::ReportParameters parameters;
  parameters.t_cycloc = etcs::kNoCycleTime;
  parameters.locations = {{60, 1}};
  ASSERT_TRUE(ride.publisher().set_parameters(parameters, kB).ok());
  double reported_at_m = 0;
  for (double at_m = 497; at_m > 420 && reported_at_m == 0; at_m -= 1) {
    const auto report = ride.run(at_m, -20).report;
    if (report && report->reason == Reason::location) reported_at_m = at_m;
  }
  EXPECT_NEAR(reported_at_m, 438 + 5 + 3, 2) << "Q_LOCACC and the doubt ahead of it";
}

}  // namespace
}  // namespace railfix::tpr_publisher::front_end_test
