#include "tpr_publisher/report_trigger.hpp"

#include <gmock/gmock.h>

#include "core/time.hpp"

namespace railfix::tpr_publisher {
namespace {

using core::kNsPerSecond;

class Trigger : public ::testing::Test {
 protected:
  /// Reports at the moment when something is due; says what.
  std::optional<Reason> step() {
    const auto reason = trigger.due(moment);
    if (reason) trigger.sent(moment);
    return reason;
  }
  void run(double duration_s, double distance_m) {
    moment.now_ns += core::to_ns(duration_s);
    moment.front_m += distance_m;
    moment.max_safe_front_m = moment.front_m + 10;
    moment.min_safe_front_m = moment.front_m - 20;
    if (moment.beyond_lrbg_m) *moment.beyond_lrbg_m += distance_m;
    if (moment.beyond_origin_m) *moment.beyond_origin_m += distance_m;
  }
  static etcs::ReportParameters parameters() {
    etcs::ReportParameters parameters;
    parameters.t_cycloc = 6;
    return parameters;
  }
  void ask(const etcs::ReportParameters& parameters) { trigger.set_parameters(parameters); }
  void ask_every_50_m() {
    auto wanted = parameters();
    wanted.t_cycloc = etcs::kNoCycleTime;
    wanted.q_scale = 2;
    wanted.d_cycloc = 5;
    ask(wanted);
  }

  ReportTrigger trigger{parameters(), 100};
  Moment moment;
};

TEST_F(Trigger, TheFirstMomentReports) {
  EXPECT_EQ(step(), Reason::start);
  EXPECT_EQ(step(), std::nullopt);
}

TEST_F(Trigger, ReportsEveryTCyclocSeconds) {
  step();
  for (int cycle = 0; cycle < 3; ++cycle) {
    run(5.99, 100);
    EXPECT_EQ(step(), std::nullopt);
    run(0.01, 0);
    EXPECT_EQ(step(), Reason::cycle_time);
  }
}

TEST_F(Trigger, AClockThatWasSetBackSilencesNobody) {
  step();
  run(-3600, 0);
  EXPECT_EQ(step(), Reason::cycle_time);
  run(5.99, 100);
  EXPECT_EQ(step(), std::nullopt);
  run(0.01, 0);
  EXPECT_EQ(step(), Reason::cycle_time);
}

TEST_F(Trigger, ReportsEveryDCyclocMetresEitherWay) {
  ask_every_50_m();
  step();
  run(100, 49);
  EXPECT_EQ(step(), std::nullopt);
  run(1, 1);
  EXPECT_EQ(step(), Reason::cycle_distance);
  run(1, -50);
  EXPECT_EQ(step(), Reason::cycle_distance);
}

// A train that is moved to and fro, and one that stands and whose place trembles.
TEST_F(Trigger, DCyclocCountsTheWayThatWasRun) {
  ask_every_50_m();
  step();
  int reports = 0;
  for (int i = 0; i < 300; ++i) {
    run(0.1, i / 50 % 2 == 0 ? 0.8 : -0.8);
    reports += step() == Reason::cycle_distance ? 1 : 0;
  }
  EXPECT_EQ(reports, 4) << "240 m";
  for (int i = 0; i < 3000; ++i) {
    run(0.1, i % 2 == 0 ? 0.3 : -0.3);
    EXPECT_EQ(step(), std::nullopt);
  }
}

TEST_F(Trigger, InfiniteCyclesNeverReport) {
  ask(etcs::ReportParameters{});
  step();
  run(1e5, 1e6);
  EXPECT_EQ(step(), std::nullopt);
}

TEST_F(Trigger, StandstillReachedAndLeft) {
  step();
  moment.standstill = true;
  EXPECT_EQ(step(), Reason::standstill);
  EXPECT_EQ(step(), std::nullopt);
  moment.standstill = false;
  EXPECT_EQ(step(), Reason::moving);
}

TEST_F(Trigger, TheSameBaliseGroupPassedOnceMore) {
  step();
  moment.nid_lrbg = 7;
  EXPECT_EQ(step(), Reason::balise_group);
  ++moment.passed_again;
  EXPECT_EQ(step(), Reason::balise_group);
  EXPECT_EQ(step(), std::nullopt);
}

TEST_F(Trigger, EveryNewBaliseGroupUnlessNotWanted) {
  step();
  moment.nid_lrbg = 7;
  EXPECT_EQ(step(), Reason::balise_group);
  moment.nid_lrbg = etcs::kUnknownBaliseGroup;
  EXPECT_EQ(step(), Reason::balise_group) << "what was said must not stand";
  EXPECT_EQ(step(), std::nullopt);
  moment.nid_lrbg = 7;
  EXPECT_EQ(step(), std::nullopt) << "one that comes and goes fills no store";
  run(1, 0);
  EXPECT_EQ(step(), Reason::balise_group) << "found again: trackside need not wait for the cycle";
  EXPECT_EQ(step(), std::nullopt);
  auto wanted = parameters();
  wanted.m_loc = etcs::kReportNotAtGroups;
  ask(wanted);
  moment.nid_lrbg = 8;
  EXPECT_EQ(step(), std::nullopt);
}

TEST_F(Trigger, AnLrbgThatComesAndGoesFillsNoStore) {
  moment.nid_lrbg = 7;
  step();
  int reports = 0;
  for (int i = 0; i < 180; ++i) {  // 3 s
    const bool is_lost = i % 2 == 0;
    moment.nid_lrbg = is_lost ? etcs::kUnknownBaliseGroup : 7;
    if (is_lost) ++moment.taken_back;
    run(1.0 / 60, 0);
    reports += step() ? 1 : 0;
  }
  EXPECT_GE(reports, 3);
  EXPECT_LE(reports, 7);
}

// As at a track_probability that trembles about 0.999 behind a switch with a group on its leg.
TEST_F(Trigger, AGroupThatIsTakenBackAndTakenAgainFillsNoStore) {
  moment.nid_lrbg = 7;
  step();
  for (const uint32_t m_loc : {etcs::kReportAtGroups, etcs::kReportNotAtGroups}) {
    auto wanted = parameters();
    wanted.m_loc = m_loc;
    ask(wanted);
    int reports = 0;
    for (int i = 0; i < 200; ++i) {  // 10 s
      const bool taken_back = i % 2 != 0;
      moment.nid_lrbg = taken_back ? 7 : 8;
      if (taken_back) ++moment.taken_back;
      run(0.05, 0);
      reports += step() ? 1 : 0;
    }
    EXPECT_LE(reports, 21) << m_loc;
  }
}

TEST_F(Trigger, AGroupOfAnotherTrackIsSaidAtOnceWhateverMLoc) {
  auto wanted = parameters();
  wanted.m_loc = etcs::kReportNotAtGroups;
  ask(wanted);
  moment.nid_lrbg = 7;
  moment.q_dirlrbg = etcs::kNominal;
  step();
  ++moment.taken_back;
  EXPECT_EQ(step(), std::nullopt) << "it is the same one again";
  run(1, 0);
  moment.nid_lrbg = 8;
  EXPECT_EQ(step(), Reason::balise_group);
  run(1, 0);
  ++moment.taken_back;
  moment.q_dirlrbg = etcs::kReverse;
  EXPECT_EQ(step(), Reason::balise_group) << "the train looks the other way";
  EXPECT_EQ(step(), std::nullopt);
}

TEST_F(Trigger, NowReportsAtOnce) {
  step();
  auto wanted = parameters();
  wanted.m_loc = etcs::kReportNow;
  ask(wanted);
  EXPECT_EQ(step(), Reason::start);
  EXPECT_EQ(step(), std::nullopt);
}

TEST_F(Trigger, LocationsCountFromTheBaliseGroup) {
  auto wanted = parameters();
  wanted.t_cycloc = etcs::kNoCycleTime;
  wanted.locations = {{20, 1}, {100, 1}, {50, 0}};  // 20 m and 120 m: front end; 170 m: rear end of the 100 m train
  ask(wanted);
  step();
  moment.nid_lrbg = 7;
  moment.beyond_lrbg_m = 30;
  run(0, 0);
  EXPECT_EQ(step(), Reason::balise_group);  // the first location lies behind already
  run(1, 79);                               // 109 m, max safe front end 119 m
  EXPECT_EQ(step(), std::nullopt);
  run(1, 1.5);
  EXPECT_EQ(step(), Reason::location);
  run(1, 170);  // 280.5 m, min safe rear end 160.5 m
  EXPECT_EQ(step(), std::nullopt);
  run(1, 10);
  EXPECT_EQ(step(), Reason::location);
  run(1, 500);
  EXPECT_EQ(step(), std::nullopt);
}

/// Packet 58 with one location, 500 m beyond group 7 for the front end; nothing else calls for a report.
class TriggerWithLocation : public Trigger {
 protected:
  TriggerWithLocation() {
    wanted.t_cycloc = etcs::kNoCycleTime;
    wanted.m_loc = etcs::kReportNotAtGroups;
    wanted.locations = {{500, 1}};
  }
  etcs::ReportParameters wanted;
};

TEST_F(TriggerWithLocation, CountsFromTheGroupOfThePacketNotFromThePresentOne) {
  trigger.set_parameters(wanted, 7);
  step();  // no LRBG yet
  EXPECT_EQ(trigger.origin(), 7U);
  EXPECT_EQ(trigger.origin_m(), std::nullopt);
  moment.nid_lrbg = 8;
  moment.beyond_lrbg_m = 20;
  moment.beyond_origin_m = 420;
  run(1, 0);
  EXPECT_EQ(step(), Reason::balise_group);
  EXPECT_EQ(trigger.origin_m(), -420);
  run(1, 69);  // 489 m, max safe front end 499 m
  EXPECT_EQ(step(), std::nullopt);
  run(1, 2);
  EXPECT_EQ(step(), Reason::location);
}

TEST_F(TriggerWithLocation, IsLeftOutWhereNobodyKnowsIt) {
  trigger.set_parameters(wanted, etcs::kUnknownBaliseGroup);
  EXPECT_TRUE(trigger.locations_left_out());
  EXPECT_TRUE(trigger.locations_given_up());
}

TEST_F(TriggerWithLocation, WaitsForAGroupThatIsNotBehindTheTrainYet) {
  moment.nid_lrbg = 8;
  moment.beyond_lrbg_m = 20;
  step();
  trigger.set_parameters(wanted, 7);  // trackside's antenna has passed it, our estimate has not
  EXPECT_FALSE(trigger.locations_left_out());
  run(1, 490);
  EXPECT_EQ(step(), std::nullopt);
  EXPECT_TRUE(trigger.locations_left_out());
  EXPECT_FALSE(trigger.locations_given_up());
  moment.nid_lrbg = 7;
  moment.beyond_lrbg_m = 3;
  EXPECT_EQ(step(), std::nullopt);
  EXPECT_FALSE(trigger.locations_left_out());
  run(1, 488);  // max safe front end 501 m
  EXPECT_EQ(step(), Reason::location);
}

TEST_F(TriggerWithLocation, IsGivenUpWhenItsGroupDoesNotCome) {
  trigger.set_parameters(wanted, 7);
  moment.nid_lrbg = 8;
  moment.beyond_lrbg_m = 20;
  step();
  run(1, 500);
  EXPECT_EQ(step(), std::nullopt);
  EXPECT_FALSE(trigger.locations_given_up());
  run(1, 1);
  EXPECT_EQ(step(), std::nullopt);
  EXPECT_TRUE(trigger.locations_given_up());
  EXPECT_EQ(trigger.origin(), std::nullopt);
}

TEST_F(TriggerWithLocation, FollowsACorrectionOfThePlace) {
  ask(wanted);
  moment.nid_lrbg = 7;
  moment.beyond_lrbg_m = 100;
  step();
  run(1, 300);
  *moment.beyond_lrbg_m += 30;  // the train was 30 m further on than the way said
  EXPECT_EQ(step(), std::nullopt);
  run(1, 59);  // 489 m, max safe front end 499 m
  EXPECT_EQ(step(), std::nullopt);
  run(1, 2);
  EXPECT_EQ(step(), Reason::location);
}

TEST_F(TriggerWithLocation, CountsFromThePassageOfThePacketWhenALoopLeadsBackToItsGroup) {
  ask(wanted);
  moment.nid_lrbg = 7;
  moment.beyond_lrbg_m = 10;
  step();
  EXPECT_EQ(trigger.origin_m(), -10);
  run(10, 390);
  moment.beyond_lrbg_m = 0;  // once round
  EXPECT_EQ(step(), std::nullopt);
  run(1, 89);  // 489 m from the first passage, max safe front end 499 m
  EXPECT_EQ(step(), std::nullopt);
  run(1, 2);
  EXPECT_EQ(step(), Reason::location);
}

TEST_F(TriggerWithLocation, TheWayToItsGroupMayBeMoreInDoubtThanThatToTheLrbg) {
  trigger.set_parameters(wanted, 7);
  moment.nid_lrbg = 8;
  moment.beyond_lrbg_m = 20;
  moment.beyond_origin_m = 300;
  moment.origin_doubt_m = 40;
  run(1, 0);
  step();
  run(1, 149);  // 449 m, max safe front end 459 m, or 499 m over the longer way
  EXPECT_EQ(step(), std::nullopt);
  run(1, 2);
  EXPECT_EQ(step(), Reason::location);
}

TEST_F(TriggerWithLocation, WhereNobodyKnowsTheMaxSafeFrontEndItIsReported) {
  step();
  ask(wanted);
  moment.nid_lrbg = 7;
  moment.beyond_lrbg_m = 10;
  moment.max_safe_front_m = HUGE_VAL;
  run(1, 0);
  moment.max_safe_front_m = HUGE_VAL;
  EXPECT_EQ(step(), Reason::balise_group);
  run(1, 0);
  EXPECT_EQ(step(), std::nullopt) << "with that report";
}

TEST_F(TriggerWithLocation, BehindAGroupThatTheFootHasNotPassedItIsNotPassedLongAgo) {
  wanted.locations = {{5, 1}};
  moment.nid_lrbg = 8;
  moment.beyond_lrbg_m = 300;
  step();
  trigger.set_parameters(wanted, 7);
  moment.beyond_origin_m = -1;  // max safe front end 9 m beyond it
  run(1, 0);
  EXPECT_EQ(step(), Reason::location);
}

TEST_F(TriggerWithLocation, OfAPacketThatHasWaitedItIsNotPassedLongAgo) {
  step();
  moment.nid_lrbg = 7;
  moment.beyond_lrbg_m = 495;
  run(1, 0);
  trigger.set_parameters(wanted, 7, true);
  EXPECT_EQ(trigger.due(moment), Reason::balise_group);
  moment.nid_lrbg = etcs::kUnknownBaliseGroup;
  moment.beyond_lrbg_m.reset();
  EXPECT_EQ(trigger.due(moment), Reason::location);
}

TEST_F(TriggerWithLocation, IsFoundAgainWhenTheDistanceBeganAgain) {
  ask(wanted);
  moment.nid_lrbg = 7;
  moment.beyond_lrbg_m = 100;
  run(0, 8700);
  moment.beyond_lrbg_m = 100;
  step();
  EXPECT_EQ(trigger.origin(), 7U);
  moment.front_m = 0;  // fusion is back, 300 m farther
  moment.nid_lrbg = 8;
  moment.beyond_lrbg_m = 50;
  moment.beyond_origin_m = 400;
  run(40, 0);
  trigger.lose_way();
  EXPECT_EQ(step(), std::nullopt);
  run(2, 91);  // 491 m, max safe front end 501 m
  EXPECT_EQ(step(), Reason::location);
  moment.front_m = 0;  // and once more: passed is passed
  moment.beyond_origin_m = 600;
  run(40, 0);
  trigger.lose_way();
  EXPECT_EQ(step(), std::nullopt);
}

TEST_F(TriggerWithLocation, IsReportedWhenItWasPassedMeanwhile) {
  ask(wanted);
  moment.nid_lrbg = 7;
  moment.beyond_lrbg_m = 100;
  step();
  trigger.lose_way();
  moment.beyond_lrbg_m = 700;
  run(40, 0);
  EXPECT_EQ(step(), Reason::location);
}

TEST_F(Trigger, ADistanceThatBeganAgainIsReportedForDCycloc) {
  auto wanted = parameters();
  wanted.t_cycloc = etcs::kNoCycleTime;
  wanted.d_cycloc = 1000;
  ask(wanted);
  run(0, 500);
  step();
  moment.front_m = 0;
  run(40, 0);
  trigger.lose_way();
  EXPECT_EQ(step(), Reason::cycle_distance);
  EXPECT_EQ(step(), std::nullopt);
}

TEST_F(Trigger, TheOnboardUnitCallsForReports) {
  step();
  const auto expect_once = [&](Reason reason) {
    EXPECT_EQ(step(), reason);
    EXPECT_EQ(step(), std::nullopt);
  };
  ++moment.mode_changes;
  expect_once(Reason::mode);
  ++moment.level_changes;
  expect_once(Reason::level);
  moment.onboard.q_integrity = 1;  // a device may confirm every second: no report for that
  EXPECT_EQ(step(), std::nullopt);
  moment.onboard.q_integrity = 3;
  expect_once(Reason::integrity_lost);
  moment.onboard.q_integrity = 2;
  moment.onboard.integrity_ns = 5;
  expect_once(Reason::integrity_confirmed);
  moment.onboard.integrity_ns = 6;  // confirmed again
  expect_once(Reason::integrity_confirmed);
  for (const auto reason : {Reason::border, Reason::session, Reason::error}) {
    ++moment.wants;
    moment.wanted_because = reason;
    expect_once(reason);
  }
}

TEST_F(Trigger, StaysDueUntilSent) {
  step();
  moment.nid_lrbg = 7;
  EXPECT_EQ(trigger.due(moment), Reason::balise_group);
  EXPECT_EQ(trigger.due(moment), Reason::balise_group);
  trigger.sent(moment);
  EXPECT_EQ(trigger.due(moment), std::nullopt);
}

TEST_F(Trigger, ATCyclocOfZeroReportsEverySecond) {
  auto wanted = parameters();
  wanted.t_cycloc = 0;
  ask(wanted);
  step();
  for (int cycle = 0; cycle < 3; ++cycle) {
    run(0.99, 80);
    EXPECT_EQ(step(), std::nullopt);
    run(0.01, 0);
    EXPECT_EQ(step(), Reason::cycle_time);
  }
}

TEST_F(Trigger, ADCyclocOfZeroReportsEveryMetreButNotMoreThanOnceASecond) {
  auto wanted = parameters();
  wanted.t_cycloc = etcs::kNoCycleTime;
  wanted.d_cycloc = 0;
  ask(wanted);
  step();
  run(0.99, 80);
  EXPECT_EQ(step(), std::nullopt);
  run(0.01, 0);
  EXPECT_EQ(step(), Reason::cycle_distance);
  run(5, 0.9);  // creeps
  EXPECT_EQ(step(), std::nullopt);
  run(0.1, 0.1);
  EXPECT_EQ(step(), Reason::cycle_distance);
  run(1000, 0);  // at rest
  EXPECT_EQ(step(), std::nullopt);
  trigger.lose_way();
  EXPECT_EQ(step(), Reason::cycle_distance);
  run(0.5, 0);
  trigger.lose_way();
  EXPECT_EQ(step(), std::nullopt);
}

TEST_F(TriggerWithLocation, IsUsedWhateverTheCycles) {
  wanted.t_cycloc = wanted.d_cycloc = 0;
  trigger.set_parameters(wanted, 7);
  moment.nid_lrbg = 7;
  moment.beyond_lrbg_m = 480;
  step();
  run(0.1, 15);  // 495 m, max safe front end 505 m
  EXPECT_EQ(step(), Reason::location);
}

}  // namespace
}  // namespace railfix::tpr_publisher
