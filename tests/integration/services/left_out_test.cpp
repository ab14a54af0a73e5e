// What fusion leaves out of its inputs the operator reads in its status.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "support/lock_step.hpp"

namespace railfix::left_out_test {
namespace {

using ::testing::HasSubstr;
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

 private:
  messaging::Writer<msg::WheelSample> wheel_{participant_, topics::wheel_sample};
  messaging::Writer<msg::ImuSample> imu_{participant_, topics::imu_sample};
  int64_t now_ns_ = kBeginNs;
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

}  // namespace
}  // namespace railfix::left_out_test
