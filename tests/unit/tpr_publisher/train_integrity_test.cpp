#include "tpr_publisher/train_integrity.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/time.hpp"

namespace railfix::tpr_publisher {
namespace {

int64_t at(double run_s) {
  return core::to_ns(1000 + run_s);
}

/// 10 m/s from 0 m, ten places a second, until run_s; the min safe front end lies 5 m behind.
TrainIntegrity running_until(double run_s) {
  TrainIntegrity integrity;
  for (int i = 0; i <= static_cast<int>(run_s * 10); ++i) integrity.follow({at(i * 0.1), i * 1.0, 5.0});
  return integrity;
}

void expect_nothing(const TrainIntegrity::Said& said) {
  EXPECT_EQ(said.q_length, 0U);
  EXPECT_FALSE(said.l_trainint.has_value());
}

TEST(TrainIntegrity, SaysNothingBeforeItIsTold) {
  expect_nothing(running_until(5).said(50));
}

TEST(TrainIntegrity, CountsFromTheRearEndAtTheTimeOfTheConfirmation) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDevice, at(2), 200);  // at 20 m
  const auto said = integrity.said(50);
  EXPECT_EQ(said.q_length, etcs::kConfirmedByDevice);
  EXPECT_EQ(said.l_trainint, 235U);  // 50 - (20 - 5 - 200)
  integrity.follow({at(6), 60.2, 5});
  EXPECT_EQ(integrity.said(60.2).l_trainint, 246U);  // rounded up
}

TEST(TrainIntegrity, TakesThePlaceBeforeATimeBetweenTwo) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDriver, at(2.07), 200);
  EXPECT_EQ(integrity.said(50).l_trainint, 235U);
}

TEST(TrainIntegrity, WaitsForThePlaceOfATimeThatIsStillToCome) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDriver, at(5.05), 200);
  expect_nothing(integrity.said(50));
  integrity.follow({at(5.1), 51, 5});
  EXPECT_EQ(integrity.said(51).l_trainint, 206U);
}

TEST(TrainIntegrity, SaysNothingWhereItCannotKnow) {
  auto integrity = running_until(20);
  integrity.hear(etcs::kConfirmedByDevice, at(5), 200);  // longer ago than what is kept
  expect_nothing(integrity.said(200));
  integrity.hear(etcs::kConfirmedByDevice, at(19), 0);  // no length
  expect_nothing(integrity.said(200));
  integrity.hear(etcs::kConfirmedByDevice, at(19), 40000);  // longer than the field can say
  expect_nothing(integrity.said(200));
  integrity.follow({at(21), 210, INFINITY});
  integrity.hear(etcs::kConfirmedByDevice, at(21), 200);  // no bound behind
  expect_nothing(integrity.said(210));
}

TEST(TrainIntegrity, LossIsSaidWithoutALength) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDevice, at(2), 200);
  integrity.hear(3, at(2), 200);
  EXPECT_EQ(integrity.said(50).q_length, 3U);
  EXPECT_FALSE(integrity.said(50).l_trainint.has_value());
}

TEST(TrainIntegrity, AWayThatIsNotKnownForgetsTheConfirmation) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDriver, at(5), 200);
  ASSERT_EQ(integrity.said(50).l_trainint, 205U);
  integrity.lose_way();
  for (int i = 0; i < 10; ++i) integrity.follow({at(45 + i * 0.1), i * 1.0, 5});
  expect_nothing(integrity.said(9));  // not 205 m, which would be the whole train 45 m behind where it was complete
  EXPECT_TRUE(integrity.forgotten());
  integrity.hear(etcs::kConfirmedByDriver, at(5), 200);  // said every second: not a new confirmation
  expect_nothing(integrity.said(9));
  integrity.hear(etcs::kConfirmedByDriver, at(45.9), 200);
  EXPECT_EQ(integrity.said(9).l_trainint, 205U);
  EXPECT_FALSE(integrity.forgotten());
}

TEST(TrainIntegrity, AConfirmationFromBeforeTheWayWasLostHasNoPlace) {
  auto integrity = running_until(5);
  integrity.lose_way();
  integrity.follow({at(4), 0, 5});  // the clock was set back, too
  integrity.hear(etcs::kConfirmedByDevice, at(3.9), 200);
  expect_nothing(integrity.said(0));
  EXPECT_FALSE(integrity.forgotten());
}

TEST(TrainIntegrity, ALossStandsUntilALaterConfirmationHasAPlace) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDriver, at(5), 200);
  integrity.hear(etcs::kIntegrityLost, at(5.02), 200);
  EXPECT_EQ(integrity.said(50).q_length, etcs::kIntegrityLost);
  integrity.hear(etcs::kConfirmedByDriver, at(5.05), 200);
  EXPECT_EQ(integrity.said(50).q_length, etcs::kIntegrityLost);
  integrity.follow({at(5.1), 51, 5});
  EXPECT_EQ(integrity.said(51).l_trainint, 206U);
}

TEST(TrainIntegrity, ConfirmationsThatComeFasterThanPlacesDoNotKeepEachOtherWaiting) {
  auto integrity = running_until(5);
  for (int i = 0; i < 20; ++i) {
    integrity.hear(etcs::kConfirmedByDevice, at(5.15 + i * 0.1), 200);
    integrity.follow({at(5.05 + i * 0.1), 50.5 + i, 5});  // later than what is heard next
  }
  EXPECT_LE(integrity.said(69.5).l_trainint, 208U);
}

TEST(TrainIntegrity, BackingAndRoundingTogetherMakeNoShorterTrain) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDevice, at(5), 200);  // at 50 m, rear end at -155 m
  EXPECT_EQ(integrity.said(25, 5).l_trainint, 210U);
}

TEST(TrainIntegrity, ATrainShorterThanTheStepOfTheReportHasALength) {
  TrainIntegrity integrity;
  integrity.follow({at(1), 10, 0});
  integrity.hear(etcs::kConfirmedByDevice, at(1), 2);
  const auto said = integrity.said(10, -5);  // Q_SCALE 10 m: the front end that is reported lies 5 m behind
  EXPECT_EQ(said.q_length, etcs::kConfirmedByDevice);
  EXPECT_EQ(said.l_trainint, 0U);
}

TEST(TrainIntegrity, AnotherLengthNeedsAnotherConfirmation) {
  for (const auto& [then_m, now_m] : {std::pair(400.0, 100.0), std::pair(0.0, 200.0)}) {
    auto integrity = running_until(5);
    integrity.hear(etcs::kConfirmedByDriver, at(3), then_m);
    integrity.hear(etcs::kConfirmedByDriver, at(3), now_m);
    expect_nothing(integrity.said(50));
    integrity.hear(etcs::kConfirmedByDriver, at(3), then_m);
    expect_nothing(integrity.said(50));
    integrity.hear(etcs::kConfirmedByDriver, at(5), now_m);
    EXPECT_EQ(integrity.said(50).l_trainint, now_m + 5);
  }
}

TEST(TrainIntegrity, OneThatIsUsedUpIsFollowedByTheNextOne) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDevice, at(4), 200);
  ASSERT_EQ(integrity.said(50).q_length, etcs::kConfirmedByDevice);
  integrity.use_up();
  expect_nothing(integrity.said(50));
  integrity.hear(etcs::kConfirmedByDevice, at(4), 200);  // said every second
  expect_nothing(integrity.said(50));
  integrity.hear(etcs::kConfirmedByDevice, at(5), 200);
  EXPECT_EQ(integrity.said(50).l_trainint, 205U);
  integrity.use_up();
  integrity.hear(etcs::kIntegrityLost, at(5), 200);
  EXPECT_EQ(integrity.said(50).q_length, etcs::kIntegrityLost);
}

TEST(TrainIntegrity, BackingMakesNoShorterTrain) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDevice, at(5), 200);
  EXPECT_EQ(integrity.said(30).l_trainint, 205U);
}

TEST(TrainIntegrity, APlaceThatIsNotOnTheMapHasNoRearEnd) {
  auto integrity = running_until(5);
  integrity.follow({at(5.1), 51, 5, false});
  integrity.hear(etcs::kConfirmedByDriver, at(5.1), 200);
  expect_nothing(integrity.said(51));
  integrity.follow({at(5.2), 52, 5, true});
  expect_nothing(integrity.said(52));
  integrity.hear(etcs::kConfirmedByDriver, at(5.2), 200);
  EXPECT_EQ(integrity.said(52).l_trainint, 205U);
}

// Whether the place was wrong before or the way since: the rear end stays where it was.
TEST(TrainIntegrity, AFrontEndThatIsCorrectedForwardHasALongerTrain) {
  for (const auto& [moved_m, length_m] : {std::pair(8.0, 213U), std::pair(60.0, 265U), std::pair(-60.0, 205U)}) {
    auto integrity = running_until(5);
    integrity.hear(etcs::kConfirmedByDevice, at(5), 200);
    integrity.follow({at(5.1), 50, 20, true, moved_m});
    integrity.follow({at(5.2), 50, 5});
    EXPECT_EQ(integrity.said(50).l_trainint, length_m) << moved_m;
  }
}

TEST(TrainIntegrity, APlaceThatWasLostNeedsAnotherConfirmation) {
  auto integrity = running_until(5);
  integrity.hear(etcs::kConfirmedByDevice, at(5), 200);
  integrity.follow({at(5.1), 51, 5, true, HUGE_VAL});
  integrity.follow({at(5.2), 52, 5});
  expect_nothing(integrity.said(52));
  EXPECT_TRUE(integrity.forgotten());
  integrity.hear(etcs::kConfirmedByDevice, at(5.15), 200);
  EXPECT_EQ(integrity.said(52).l_trainint, 206U);
  EXPECT_FALSE(integrity.forgotten());
}

// The other one's report may come here before the place that it was made of.
TEST(TrainIntegrity, WhatAnotherOneHasReportedIsUsedUp) {
  TrainIntegrity integrity;
  integrity.follow({at(1), 0, 0, true});
  integrity.hear(etcs::kConfirmedByDriver, at(1), 100);
  ASSERT_EQ(integrity.said(0).q_length, etcs::kConfirmedByDriver);
  integrity.hear(etcs::kConfirmedByDriver, at(2), 100);
  integrity.use_up_until(at(1.5));
  EXPECT_EQ(integrity.said(0).q_length, etcs::kNoIntegrityInformation) << "the first; the second has no place yet";
  integrity.follow({at(2.5), 10, 0, true});
  EXPECT_EQ(integrity.said(10).q_length, etcs::kConfirmedByDriver) << "the second";
  integrity.use_up_until(at(1.5));
  EXPECT_EQ(integrity.said(10).q_length, etcs::kConfirmedByDriver) << "a late word of the first";
  integrity.hear(etcs::kConfirmedByDriver, at(3), 100);
  integrity.hear(etcs::kConfirmedByDriver, at(3.1), 100);
  integrity.use_up_until(at(3.2));
  EXPECT_EQ(integrity.said(10).q_length, etcs::kNoIntegrityInformation);
  integrity.follow({at(3.3), 18, 0, true});
  EXPECT_EQ(integrity.said(18).q_length, etcs::kNoIntegrityInformation) << "nor once it has its place";
}

}  // namespace
}  // namespace railfix::tpr_publisher
