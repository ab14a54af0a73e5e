#include "tpr_publisher/told_parameters.hpp"

#include <gmock/gmock.h>

#include "unit/tpr_publisher/publisher_fixture.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// A train between A and B, along A's nominal direction; the cycle of the keys is 6 s, that of packets 60 s.
class ToldParametersTest : public ::testing::Test {
 protected:
  static std::vector<uint8_t> packet(uint32_t q_dir, std::vector<etcs::ReportLocation> locations = {}) {
    etcs::ReportParameters parameters;
    parameters.q_dir = q_dir;
    parameters.t_cycloc = 60;
    parameters.locations = std::move(locations);
    return etcs::encode(parameters).value();
  }
  /// Whether a packet is used from now on.
  bool follow_train() {
    const auto position = at(forward(1, 150), run_s, 0);
    reported = publisher.update(position, position.stamp_ns).report.has_value();
    return told.follow();
  }
  /// At 40 m/s; whether that is reported as a location.
  bool go_to(double offset_m) {
    const auto position = at(forward(1, offset_m), run_s += 0.1, 40);
    const auto report = publisher.update(position, position.stamp_ns).report;
    told.follow();
    return report && report->reason == Reason::location;
  }
  /// Where between the two it is, 0 = nowhere.
  double location_reported_m(double from_m, double to_m) {
    for (double m = from_m; m < to_m; m += 4)
      if (go_to(m)) return m;
    return 0;
  }
  /// Played data begins anew, or a process does.
  void begin_anew() {
    publisher = TprPublisher(balise_map(), settings());
    told.begin_anew();
  }
  /// T_CYCLOC that is followed: does the one of the keys make a report?
  bool follows_keys() {
    for (int i = 0; i < 7; ++i) {
      run_s += 0.9;
      follow_train();
      if (reported) return true;
    }
    return false;
  }
  TprPublisher publisher{balise_map(), settings()};
  ToldParameters told{publisher};
  double run_s = 0;
  bool reported = false;
};

TEST_F(ToldParametersTest, OneForTheTrainsDirectionWaitsUntilThatIsKnown) {
  const auto nominal = packet(etcs::kNominal);
  EXPECT_FALSE(told.hear(nominal, true));
  EXPECT_THAT(told.refusal(), HasSubstr("packet 58 of onboard_status is not used: Packet 58 is for one direction"));
  EXPECT_EQ(told.notes(), "");
  EXPECT_TRUE(follow_train()) << "also while the on-board unit is silent";
  EXPECT_EQ(told.refusal(), "");
  EXPECT_FALSE(told.hear(nominal, true)) << "it stands in every onboard_status";
  EXPECT_FALSE(follows_keys());
}

TEST_F(ToldParametersTest, OneForOneDirectionIsUsedOnWhenDataBeginsAnew) {
  follow_train();
  EXPECT_TRUE(told.hear(packet(etcs::kNominal), true));
  begin_anew();
  EXPECT_EQ(told.refusal(), "");
  EXPECT_FALSE(told.hear(packet(etcs::kNominal), true));
  follow_train();
  EXPECT_FALSE(follows_keys());
}

TEST_F(ToldParametersTest, OneForOneDirectionIsUsedOnByALaterProcess) {
  EXPECT_TRUE(told.remember(etcs::to_hex(packet(etcs::kReverse)))) << "reverse to the LRBG that was; A is another one";
  EXPECT_EQ(told.refusal(), "");
  follow_train();
  EXPECT_FALSE(follows_keys());
}

TEST_F(ToldParametersTest, OneForBothDirectionsIsUsedAtOnce) {
  EXPECT_TRUE(told.hear(packet(etcs::kUnknownSide), true));
  begin_anew();
  EXPECT_EQ(told.refusal(), "");
  follow_train();
  EXPECT_FALSE(follows_keys());
}

TEST_F(ToldParametersTest, WhatDoesNotFitLeavesTheOneBeforeAndItsNotes) {
  const auto first = packet(etcs::kNominal, {{5000, 1}});
  follow_train();
  EXPECT_TRUE(told.hear(first, true));
  EXPECT_EQ(told.notes(), etcs::to_hex(first));
  follow_train();
  follow_train();
  const auto notes = etcs::to_hex(first) + ' ' + std::to_string(kA);
  EXPECT_EQ(told.notes(), notes);

  EXPECT_FALSE(told.hear(packet(etcs::kReverse), true));
  EXPECT_THAT(told.refusal(), HasSubstr("other direction"));
  follow_train();
  EXPECT_EQ(told.notes(), notes) << "of the one that is used, not of the one that was refused";
  begin_anew();
  follow_train();
  EXPECT_THAT(told.refusal(), StartsWith("packet 58 of onboard_status is not used: ")) << "the newer one still waits";
  EXPECT_EQ(told.notes(), notes);
  EXPECT_FALSE(follows_keys());

  EXPECT_TRUE(told.hear(packet(etcs::kUnknownSide), true));
  EXPECT_EQ(told.refusal(), "");
}

TEST_F(ToldParametersTest, OneForTheOtherDirectionStaysRefusedAtAGroupThatLooksTheOtherWay) {
  follow_train();
  EXPECT_FALSE(told.hear(packet(etcs::kReverse), true));
  run_s = 1;
  const auto beyond_b = at(forward(1, 450), run_s, 0);
  const auto report = publisher.update(beyond_b, beyond_b.stamp_ns).report;
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->fields.q_dirlrbg, etcs::kReverse);
  EXPECT_FALSE(told.follow());
  EXPECT_FALSE(told.hear(packet(etcs::kReverse), true));
  EXPECT_THAT(told.refusal(), HasSubstr("other direction"));
}

TEST_F(ToldParametersTest, WhatCannotBeReadIsToldAndNotKept) {
  const std::vector<uint8_t> cut{0x3A, 0x80};
  EXPECT_FALSE(told.hear(cut, true));
  EXPECT_THAT(told.refusal(), HasSubstr("ends inside"));
  EXPECT_FALSE(follow_train());
  EXPECT_THAT(told.refusal(), HasSubstr("ends inside"));
  EXPECT_EQ(told.notes(), "");
  for (const char* notes : {"", "nonsense", "3A8", "3A80"}) EXPECT_FALSE(told.remember(notes)) << notes;
  EXPECT_EQ(told.notes(), "");
  EXPECT_FALSE(told.hear({}, true)) << "an onboard_status without one takes nothing back";
}

// SUBSET-026 3.6.2.2.1: the trackside answers to a report that referred to A; the train is beyond B when it comes,
// which looks the other way.
TEST_F(ToldParametersTest, APacketRefersToTheGroupThatItsMessageNames) {
  follow_train();
  run_s = 1;
  for (double m = 154; m < 405; m += 4) go_to(m);
  EXPECT_FALSE(told.hear(packet(etcs::kReverse, {{650, 1}}), true, kA));
  EXPECT_THAT(told.refusal(), HasSubstr("other direction"));
  const auto nominal = packet(etcs::kNominal, {{650, 1}});
  EXPECT_TRUE(told.hear(nominal, true, kA));
  EXPECT_FALSE(told.hear(nominal, true, kA)) << "it stands in every onboard_status";
  EXPECT_EQ(told.notes(), etcs::to_hex(nominal) + ' ' + std::to_string(kA));
  EXPECT_NEAR(location_reported_m(406, 990), 750 - 2 - 8, 4)
      << "the max safe front end may be 8 m in front of the front end";
  EXPECT_TRUE(told.hear(nominal, true, kC)) << "the same bits of another message";
}

// Trackside's antenna has read B when the estimate is still 8 m in front of it.
TEST_F(ToldParametersTest, LocationsWaitForAGroupThatTheEstimateHasNotPassed) {
  for (double m = 152; m <= 392; m += 4) go_to(m);
  const auto located = packet(etcs::kUnknownSide, {{100, 1}});
  EXPECT_TRUE(told.hear(located, true, kB));
  EXPECT_NEAR(location_reported_m(396, 600), 500 - 2 - 8, 4);
}

TEST_F(ToldParametersTest, LocationsThatAreOverAreNotRemembered) {
  go_to(404);
  const auto located = packet(etcs::kUnknownSide, {{100, 1}});
  EXPECT_TRUE(told.hear(located, true, kE));  // a group that the train does not come to
  for (double m = 408; m <= 900; m += 4) go_to(m);
  EXPECT_EQ(told.notes(), etcs::to_hex(located) + ' ' + std::to_string(kE));
  for (double m = 904; m <= 916; m += 4) go_to(m);
  const auto notes = told.notes();
  EXPECT_EQ(notes, etcs::to_hex(located) + ' ' + std::to_string(kE) + " over");

  TprPublisher later_publisher(balise_map(), settings());
  ToldParameters later(later_publisher);
  EXPECT_TRUE(later.remember(notes));
  EXPECT_FALSE(later.hear(located, false, kE)) << "it stands in every onboard_status";
  EXPECT_EQ(later_publisher.origin(), std::nullopt);
  EXPECT_EQ(later.notes(), notes);
}

// Of a single balise nobody knows the train's direction before it has passed it.
TEST_F(ToldParametersTest, LocationsOfAPacketThatWaitedForTheDirectionAreNotPassedLongAgo) {
  for (double m = 500; m <= 692; m += 4) go_to(m);
  EXPECT_FALSE(told.hear(packet(etcs::kNominal, {{10, 1}}), true, kC));
  EXPECT_NEAR(location_reported_m(696, 800), 704, 4.1);
}

// The group of the packet lies behind where this process began; the place is corrected, or lost for a while.
TEST_F(ToldParametersTest, LocationsFollowAPlaceThatIsCorrected) {
  for (const bool lost : {false, true}) {
    publisher = TprPublisher(balise_map(), settings());
    double correction_m = 0;
    const auto go_to = [&](double offset_m, bool track_known = true) {
      auto position = at(forward(1, offset_m), run_s += 0.1, 40);
      position.distance_m = offset_m - correction_m;
      position.track_known = track_known;
      const auto report = publisher.update(position, position.stamp_ns).report;
      return report && report->reason == Reason::location;
    };
    for (double m = 450; m <= 480; m += 4) go_to(m);
    etcs::ReportParameters parameters;
    parameters.t_cycloc = etcs::kNoCycleTime;
    parameters.locations = {{500, 1}};
    ASSERT_TRUE(publisher.set_parameters(parameters, kA).ok());
    for (double m = 484; m <= 500; m += 4) go_to(m, !lost || m < 492);
    correction_m = 40;
    double reported_at_m = 0;
    for (double m = 544; m < 700 && reported_at_m == 0; m += 4) reported_at_m = go_to(m) ? m : 0;
    EXPECT_NEAR(reported_at_m, 600 - 2 - 8, 4) << lost;
  }
}

TEST_F(ToldParametersTest, TheSameBitsOnceMoreAreAPacketWhereThatIsCounted) {
  follow_train();
  etcs::ReportParameters now;
  now.m_loc = etcs::kReportNow;
  const auto bits = etcs::encode(now).value();
  const auto hear = [&](uint32_t count) {
    const bool taken = told.hear(bits, true, kA, count);
    run_s += 0.1;
    follow_train();
    EXPECT_EQ(reported, taken) << count;
    return taken;
  };
  EXPECT_TRUE(hear(7));
  EXPECT_FALSE(hear(7)) << "it stands in every onboard_status";
  EXPECT_FALSE(told.hear({}, true, kA, 8)) << "counted before the bits are there";
  EXPECT_TRUE(hear(8));
  EXPECT_FALSE(hear(1)) << "who counts began anew";
  EXPECT_TRUE(hear(2));
  EXPECT_FALSE(hear(0)) << "not counted";
  EXPECT_FALSE(hear(9)) << "by somebody else who counts";
}

TEST_F(ToldParametersTest, TheSameBitsFromOneThatBeganAnewAreAPacket) {
  follow_train();
  const auto bits = packet(etcs::kUnknownSide, {{100, 1}});
  EXPECT_TRUE(told.hear(bits, true, kA, 1));
  EXPECT_FALSE(told.hear(bits, true, kA, 1));
  EXPECT_FALSE(told.hear({}, true, 0, 0)) << "it has none yet";
  EXPECT_TRUE(told.hear(bits, true, kA, 1));
  EXPECT_FALSE(told.hear(bits, true, kA, 1));
}

TEST_F(ToldParametersTest, DeletedOnesGiveThoseOfTheKeysBack) {
  follow_train();
  EXPECT_FALSE(told.hear_deleted());
  EXPECT_TRUE(told.hear(packet(etcs::kUnknownSide), true));
  EXPECT_FALSE(follows_keys());
  EXPECT_TRUE(told.hear_deleted());
  EXPECT_EQ(told.notes(), "");
  EXPECT_TRUE(follows_keys());
  EXPECT_TRUE(told.hear(packet(etcs::kUnknownSide), true)) << "sent again";
}

TEST_F(ToldParametersTest, LocationsOfOneThatCameUnheardHaveNoPlace) {
  const auto located = packet(etcs::kUnknownSide, {{50, 1}});
  EXPECT_TRUE(told.hear(located, false));
  follow_train();
  EXPECT_EQ(publisher.origin(), std::nullopt);
  EXPECT_EQ(told.notes(), etcs::to_hex(located));
  EXPECT_THAT(publisher.left_out(kStart), HasSubstr("locations of packet 58"));
}

}  // namespace
}  // namespace railfix::tpr_publisher
