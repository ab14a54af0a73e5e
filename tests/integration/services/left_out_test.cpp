// What fusion leaves out of its inputs the operator reads in its status.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <utility>

#include "core/time.hpp"
#include "core/units.hpp"
#include "messaging/topics.hpp"
#include "support/lock_step.hpp"
#include "track/map.hpp"

namespace railfix::left_out_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
namespace topics = messaging::topics;

constexpr int64_t kDomain = 78;
constexpr int64_t kBeginNs = 1'700'000'000'000'000'000;
constexpr int64_t kStepNs = 100'000'000;
constexpr double kPulsesPerMetre = 40;

class FusionLeavesOut : public ::testing::Test, protected test::InLockStep {
 protected:
  FusionLeavesOut() : InLockStep("left-out-" + std::to_string(getpid()), kDomain) {}

  void SetUp() override {
    start("fusion", {});
    ASSERT_TRUE(connected());
  }
  /// The wheel turns, and the IMU feels this acceleration at a time beside the wheel's.
  void run(int steps, double accel_mps2, double imu_ahead_s) {
    for (int i = 0; i < steps; ++i) {
      now_ns_ += kStepNs;
      msg::WheelSample wheel;
      wheel.stamp_ns(now_ns_);
      wheel.pulses(pulses_ += 40);
      wheel.pulses_per_metre(kPulsesPerMetre);
      wheel_.write(wheel);
      msg::ImuSample imu;
      imu.stamp_ns(now_ns_ + core::to_ns(imu_ahead_s));
      imu.accel_x_mps2(accel_mps2);
      imu_.write(imu);
      give_turns({"fusion"}, now_ns_);
    }
  }
  [[nodiscard]] std::string reason() {
    const int64_t wall_ns = core::wall_ns();
    EXPECT_TRUE(run_until([&] { return status("fusion").stamp_ns() > wall_ns; }));
    return status("fusion").reason().c_str();
  }

  int64_t now_ns_ = kBeginNs;

 private:
  messaging::Writer<msg::WheelSample> wheel_{participant_, topics::wheel_sample};
  messaging::Writer<msg::ImuSample> imu_{participant_, topics::imu_sample};
  int64_t pulses_ = 0;
};

TEST_F(FusionLeavesOut, ValuesThatAreNoNumbers) {
  run(20, 0, 0);
  EXPECT_EQ(reason().find("left out"), std::string::npos) << reason();
  run(5, std::nan(""), 0);
  run(1, 0, 0);  // which says it with the next state
  EXPECT_THAT(reason(), HasSubstr("5 of imu_sample were left out: their values are no numbers"));
  run(120, 0, 0);
  EXPECT_EQ(reason().find("left out"), std::string::npos) << "twelve seconds later: " << reason();
}

TEST_F(FusionLeavesOut, WhatComesTooLateAndWhatIsFarAhead) {
  run(50, 0, 0);
  run(1, 0, -4);
  run(1, 0, 0);
  EXPECT_THAT(reason(), HasSubstr("1 of imu_sample were left out: they came later than fusion.history_s"));
  run(1, 0, 3600);
  run(1, 0, 0);
  EXPECT_THAT(reason(), HasSubstr("1 of imu_sample were left out: their clock is ahead of the other sensors'"));
}

/// A line of 2 km northwards, on edge 1 of fusion's map.
class FusionOnAMap : public FusionLeavesOut {
 protected:
  ~FusionOnAMap() override { std::filesystem::remove(map_file_); }

  void SetUp() override {
    track::Map map;
    map.edges = {{1, "line", 1, 2, "", track::Alignment::chained({1000, 0, 0}, {{2000, 0, 0}})}};
    map.nodes = {{1, track::NodeKind::end, "", 1000, 0}, {2, track::NodeKind::end, "", 1000, 2000}};
    core::ok_or_throw(map.save(map_file_));
    start("fusion", {"fusion.map=" + map_file_.string()});
    ASSERT_TRUE(connected());
  }
  /// Of a matcher on whose map the edge lies there.
  void find(double northing_m, double heading_rad) {
    msg::PositionFix fix;
    fix.stamp_ns(now_ns_);
    fix.kind(msg::FIX_NETWORK);
    fix.edge(1);
    fix.offset_m(500);
    fix.direction(msg::DIRECTION_FORWARD);
    fix.sigma_m(2);
    fix.probability(0.99999);
    fix.easting_m(1000);
    fix.northing_m(northing_m);
    fix.heading_rad(heading_rad);
    fixes_.write(fix);
    run(1, 0, 0);
  }

 private:
  const std::filesystem::path map_file_ = std::filesystem::temp_directory_path() / (train_ + ".map");
  messaging::Writer<msg::PositionFix> fixes_{participant_, topics::position_fix};
};

TEST_F(FusionOnAMap, PlacesOnAnotherOne) {
  run(20, 0, 0);
  for (const auto& [northing_m, heading_rad] : {std::pair{7000.0, 0.0}, std::pair{500.0, core::kPi}}) {
    find(northing_m, heading_rad);
    EXPECT_THAT(reason(), HasSubstr("position_fix were left out: map_matcher has another map than fusion.map"));
    EXPECT_THAT(reason(), HasSubstr("place on the map not known"));
  }
  find(500, 0);
  EXPECT_THAT(reason(), Not(HasSubstr("place on the map not known")));
}

}  // namespace
}  // namespace railfix::left_out_test
