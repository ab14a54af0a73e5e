#include "tpr_publisher/position_report.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "unit/tpr_publisher/balise_map.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;
using etcs::kNominal;
using etcs::kReverse;
using etcs::kUnknownDistance;
using etcs::kUnknownSide;

class PositionReport : public ::testing::Test {
 protected:
  PositionReport() {
    position.track_known = true;
    position.track_probability = 1;
    position.speed_mps = 20;
    position.over_m = 5;
    position.under_m = 7;
    settings.finest_q_scale = 1;
  }
  [[nodiscard]] const track::BaliseGroup* group(uint32_t nid_lrbg) const {
    for (const auto& candidate : map->balise_groups) {
      if (candidate.nid_lrbg() == nid_lrbg) return &candidate;
    }
    return nullptr;
  }
  [[nodiscard]] etcs::TrainPositionReport report(Motion motion = Motion::forward) const {
    return make_report(position, reference, motion, settings, 1'000'000'000);
  }
  std::shared_ptr<const track::Map> map = balise_map();
  TrainPosition position;
  ReportSettings settings;
  std::optional<Reference> reference = Reference{group(kA), nullptr, true, true, 50};
};

TEST_F(PositionReport, TellsDistanceSidesAndDoubt) {
  settings.foot_to_front_m = 3;
  const auto fields = report();
  EXPECT_EQ(fields.nid_packet, 0U);
  EXPECT_EQ(fields.nid_lrbg, kA);
  EXPECT_EQ(fields.q_scale, 1U);
  EXPECT_EQ(fields.d_lrbg, 53U);
  EXPECT_EQ(fields.q_dirlrbg, kNominal);
  EXPECT_EQ(fields.q_dlrbg, kNominal);
  EXPECT_EQ(fields.q_dirtrain, kNominal);
  EXPECT_EQ(fields.l_doubtover, 10U);   // 5 + Q_LOCACC 5
  EXPECT_EQ(fields.l_doubtunder, 12U);  // 7 + Q_LOCACC 5
  EXPECT_EQ(fields.v_train, 14U);       // 72 km/h
  EXPECT_EQ(fields.t_train, 100U);
}

// SUBSET-026 4.0.0 3.6.4.1.5: SM, and SB without train data where the consist length is known.
TEST_F(PositionReport, ManoeuvresAndStandByWithoutTrainDataWidenTheInterval) {
  constexpr uint32_t kStandBy = 6;
  constexpr uint32_t kSupervisedManoeuvre = 17;
  settings.train_over_m = 30;
  settings.train_under_m = 40;
  const auto doubts = [&] { return std::pair(report().l_doubtover, report().l_doubtunder); };
  const std::pair<uint32_t, uint32_t> plain{10, 12};
  const std::pair<uint32_t, uint32_t> wider{40, 52};
  settings.m_mode = kStandBy;
  EXPECT_EQ(doubts(), plain) << "Baseline 3 knows no allowance";
  settings.baseline = etcs::Baseline::b4;
  EXPECT_EQ(doubts(), wider);
  settings.train_data = true;
  EXPECT_EQ(doubts(), plain);
  settings.m_mode = kSupervisedManoeuvre;
  EXPECT_EQ(doubts(), wider);
  settings.train_under_m = -1;
  EXPECT_EQ(doubts(), std::pair(40U, uint32_t{kUnknownDistance}));
  settings.train_data = false;
  settings.train_over_m = -1;
  settings.m_mode = kStandBy;
  EXPECT_EQ(doubts(), plain) << "every start of a mission";
  settings.m_mode = 0;
  EXPECT_EQ(doubts(), plain);
}

TEST_F(PositionReport, SidesFollowTheGroupsNominalDirection) {
  struct Case {
    bool nominal_along;
    double foot_m;
    Motion motion;
    uint32_t q_dirlrbg, q_dlrbg, q_dirtrain;
  };
  for (const Case& c : {Case{true, 20, Motion::forward, kNominal, kNominal, kNominal},
                        Case{true, -20, Motion::forward, kNominal, kReverse, kNominal},
                        Case{true, 20, Motion::backward, kNominal, kNominal, kReverse},
                        Case{false, 20, Motion::forward, kReverse, kReverse, kReverse},
                        Case{false, -20, Motion::forward, kReverse, kNominal, kReverse},
                        Case{false, 20, Motion::backward, kReverse, kReverse, kNominal},
                        Case{true, 20, Motion::unknown, kNominal, kNominal, kUnknownSide}}) {
    reference->nominal_along = c.nominal_along;
    reference->foot_m = c.foot_m;
    const auto fields = report(c.motion);
    EXPECT_EQ(fields.d_lrbg, 20U);
    EXPECT_EQ(fields.q_dirlrbg, c.q_dirlrbg);
    EXPECT_EQ(fields.q_dlrbg, c.q_dlrbg);
    EXPECT_EQ(fields.q_dirtrain, c.q_dirtrain);
  }
}

TEST_F(PositionReport, RoundingNeverShrinksTheInterval) {
  core::Random random(5);
  for (int i = 0; i < 20000; ++i) {
    settings.finest_q_scale = static_cast<uint32_t>(random.next() % 3);
    reference->foot_m = random.uniform(-3000, 3000);
    settings.foot_to_front_m = random.uniform(-10, 10);
    position.over_m = random.uniform(0, 60);
    position.under_m = random.uniform(0, 60);
    const auto fields = report();
    ASSERT_EQ(fields.q_scale, settings.finest_q_scale);
    const double step_m = etcs::scale_m(fields.q_scale);
    const double front_m = reference->foot_m + settings.foot_to_front_m;
    const double reported_m = (fields.q_dlrbg == kNominal ? 1 : -1) * (fields.d_lrbg * step_m);
    const double over_m = reported_m - fields.l_doubtover * step_m;
    const double under_m = reported_m + fields.l_doubtunder * step_m;
    ASSERT_NEAR(reported_m, front_m, 0.5 * step_m + 1e-9);
    ASSERT_LE(over_m, front_m - position.over_m - 5 + 1e-9);
    ASSERT_GE(under_m, front_m + position.under_m + 5 - 1e-9);
    ASSERT_GE(over_m, front_m - position.over_m - 5 - 1.0 * step_m - 1e-6);  // and is not wider than the step makes it
    ASSERT_LE(under_m, front_m + position.under_m + 5 + 1.0 * step_m + 1e-6);
  }
}

TEST_F(PositionReport, TakesACoarserStepWhenTheFinestDoesNotFit) {
  settings.finest_q_scale = 0;
  EXPECT_EQ(report().q_scale, 0U);
  reference->foot_m = 4000;
  EXPECT_EQ(report().q_scale, 1U);
  EXPECT_EQ(report().d_lrbg, 4000U);
  reference->foot_m = 50;
  position.under_m = 40000;
  EXPECT_EQ(report().q_scale, 2U);
  EXPECT_EQ(report().l_doubtunder, 4001U);
}

TEST_F(PositionReport, SaysUnknownForWhatDoesNotFitAtAll) {
  settings.finest_q_scale = 0;
  position.over_m = NAN;
  position.under_m = HUGE_VAL;
  auto fields = report();
  EXPECT_EQ(fields.q_scale, 0U);  // a coarser step would not help
  EXPECT_EQ(fields.d_lrbg, 500U);
  EXPECT_EQ(fields.l_doubtover, kUnknownDistance);
  EXPECT_EQ(fields.l_doubtunder, kUnknownDistance);
  reference->foot_m = 330000;
  fields = report();
  EXPECT_EQ(fields.d_lrbg, kUnknownDistance);
  EXPECT_EQ(fields.l_doubtover, kUnknownDistance);
  EXPECT_EQ(fields.nid_lrbg, kA);
}

TEST_F(PositionReport, SaysUnknownWithoutAPlace) {
  const auto expect_unknown = [&] {
    const auto fields = report();
    EXPECT_EQ(fields.nid_packet, 0U);
    EXPECT_EQ(fields.nid_lrbg, etcs::kUnknownBaliseGroup);
    EXPECT_EQ(fields.d_lrbg, kUnknownDistance);
    EXPECT_EQ(fields.q_dirlrbg, kUnknownSide);
    EXPECT_EQ(fields.q_dlrbg, kUnknownSide);
    EXPECT_EQ(fields.l_doubtover, kUnknownDistance);
    EXPECT_EQ(fields.l_doubtunder, kUnknownDistance);
    EXPECT_EQ(fields.q_dirtrain, kUnknownSide);
    EXPECT_EQ(fields.v_train, 14U);
  };
  position.track_known = false;
  expect_unknown();
  position.track_known = true;
  position.usable = false;
  expect_unknown();
  position.usable = true;
  position.foot.direction = track::Direction::unknown;
  expect_unknown();
  position.foot.direction = track::Direction::forward;
  reference.reset();
  expect_unknown();
}

TEST_F(PositionReport, ASingleBaliseGivesPacket1) {
  reference = Reference{group(kC), group(kB), true, true, 30};
  auto fields = report();
  EXPECT_EQ(fields.nid_packet, 1U);
  EXPECT_EQ(fields.nid_prvlrbg, kB);
  EXPECT_EQ(fields.q_dirlrbg, kNominal);
  EXPECT_EQ(fields.q_dlrbg, kNominal);
  reference->from_previous_along = false;  // came backwards from B: that way is nominal
  fields = report(Motion::backward);
  EXPECT_EQ(fields.q_dirlrbg, kReverse);
  EXPECT_EQ(fields.q_dlrbg, kReverse);
  EXPECT_EQ(fields.q_dirtrain, kNominal);
}

TEST_F(PositionReport, AGroupOfUnknownSizeClaimsNoDirectionOfItsOwn) {
  auto unknown_size = *group(kA);
  unknown_size.balises.clear();
  reference = Reference{&unknown_size, nullptr, true, true, 30};
  EXPECT_EQ(report().nid_packet, 1U);
  EXPECT_EQ(report().q_dirlrbg, kUnknownSide);
  unknown_size.balises = {0, 0};  // two that are not among the map's landmarks
  EXPECT_EQ(report().nid_packet, 0U);
  unknown_size.balises = {0};
  EXPECT_EQ(report().nid_packet, 1U);
}

TEST_F(PositionReport, ASingleBaliseAloneHasNoDirections) {
  reference = Reference{group(kC), nullptr, true, true, 30};
  const auto fields = report();
  EXPECT_EQ(fields.nid_packet, 1U);
  EXPECT_EQ(fields.nid_prvlrbg, etcs::kUnknownBaliseGroup);
  EXPECT_EQ(fields.d_lrbg, 30U);
  EXPECT_EQ(fields.q_dirlrbg, kUnknownSide);
  EXPECT_EQ(fields.q_dlrbg, kUnknownSide);
  EXPECT_EQ(fields.q_dirtrain, kUnknownSide);
}

TEST_F(PositionReport, SpeedIsRoundedToFiveKilometresAnHour) {
  EXPECT_EQ(v_train(2.4 / 3.6, false, etcs::Baseline::b3), 0U);
  EXPECT_EQ(v_train(2.6 / 3.6, false, etcs::Baseline::b3), 1U);
  EXPECT_EQ(v_train(-142 / 3.6, false, etcs::Baseline::b3), 28U);
  EXPECT_EQ(v_train(143 / 3.6, false, etcs::Baseline::b3), 29U);
  EXPECT_EQ(v_train(700 / 3.6, false, etcs::Baseline::b3), 120U);
  EXPECT_EQ(v_train(0.1, true, etcs::Baseline::b3), 0U);
  EXPECT_EQ(v_train(0.1, true, etcs::Baseline::b4), 127U);
  EXPECT_EQ(v_train(0.1, false, etcs::Baseline::b4), 0U);
}

TEST_F(PositionReport, TrainborneTimeNeverSaysUnknown) {
  EXPECT_EQ(t_train(42949672940'000'000), 4294967294U);
  EXPECT_EQ(t_train(42949672950'000'000), 0U);
  EXPECT_NE(t_train(1'700'000'000'123'456'789), etcs::kUnknownTime);
}

}  // namespace
}  // namespace railfix::tpr_publisher
