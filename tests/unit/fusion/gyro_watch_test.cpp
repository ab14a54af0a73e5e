// The gyro against the camera, second by second.
#include "fusion/gyro_watch.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/time.hpp"

namespace railfix::fusion {
namespace {

using Fault = GyroWatch::Fault;

/// 20 m/s on a straight line; a gyro at 100 Hz, a camera at 30.
class Ride {
 public:
  struct Second {
    double bias_rps = 0.001;
    double noise_rps = 0.003;
    bool sees = true;
    bool rests = false;
    double track_rps = 0;  // of the track that is followed, which the train may not be on
  };
  Fault run(int seconds, const Second& how) {
    for (int i = 0; i < seconds; ++i) run_second(how);
    return watch_.fault();
  }
  /// Seconds of these in which it was not believed.
  int denied(int seconds, const Second& how) {
    int denied = 0;
    for (int i = 0; i < seconds; ++i) denied += run(1, how) == Fault::none ? 0 : 1;
    return denied;
  }
  GyroWatch& watch() { return watch_; }

 private:
  void run_second(const Second& how) {
    double sum_rps = 0;
    for (int i = 0; i < 100; ++i) {
      const double rate_rps = how.bias_rps + how.noise_rps * random_.normal();
      watch_.add(now_ns_ + i * 10'000'000, rate_rps);
      sum_rps += rate_rps;
    }
    for (int i = 1; how.sees && i <= 30; ++i) {
      const int64_t stamp_ns = now_ns_ + i * 33'000'000;
      watch_.add({stamp_ns, seen_ns_, 0.66, 0.001, true, 3e-4 * random_.normal(), 3e-4});
      seen_ns_ = stamp_ns;
    }
    now_ns_ += core::kNsPerSecond;
    const GyroWatch::Turned turned{1, how.rests ? 0.0 : 20.0, sum_rps / 100, 0.004, how.track_rps};
    how.rests ? watch_.rest(turned) : watch_.judge(turned, now_ns_);
  }
  core::Random random_{7};
  GyroWatch watch_;
  int64_t now_ns_ = 1'700'000'000'000'000'000;
  int64_t seen_ns_ = 0;
};

TEST(GyroWatch, BelievesOneThatIsWellWhateverTrackIsFollowed) {
  Ride ride;
  EXPECT_EQ(ride.denied(60, {}), 0);
  EXPECT_EQ(ride.denied(60, {.track_rps = 0.05}), 0) << "the camera agrees: the track is wrong";
  EXPECT_EQ(ride.denied(60, {.bias_rps = 0.001, .sees = false}), 0);
}

TEST(GyroWatch, AnErrorAgainstTheCameraIsFoundAndDarknessDoesNotHealIt) {
  Ride ride;
  ride.run(60, {});
  EXPECT_EQ(ride.run(5, {.bias_rps = 0.05}), Fault::contradicted);
  EXPECT_EQ(ride.run(40, {.bias_rps = 0.05, .sees = false}), Fault::contradicted);
  EXPECT_EQ(ride.run(20, {}), Fault::none) << "well again, and seen";
}

TEST(GyroWatch, WhereTheTrackSpeaksForItTheCameraIsWrong) {
  Ride ride;
  ride.run(60, {});
  EXPECT_EQ(ride.denied(20, {.bias_rps = 0.051, .track_rps = 0.05}), 0);
}

TEST(GyroWatch, OneThatIsStuckIsFoundWhileTheTrainRuns) {
  Ride ride;
  ride.run(60, {});
  EXPECT_EQ(ride.denied(30, {.bias_rps = 0.02, .noise_rps = 0, .rests = true}), 0);
  EXPECT_LE(ride.denied(30, {}), 1) << "what it said at rest is no bias";
  EXPECT_EQ(ride.run(3, {.bias_rps = 0, .noise_rps = 0}), Fault::stuck);
  EXPECT_EQ(ride.run(20, {}), Fault::none);
}

TEST(GyroWatch, OneThatScattersIsFound) {
  Ride ride;
  ride.run(60, {});
  EXPECT_EQ(ride.run(2, {.noise_rps = 0.1}), Fault::scatters);
}

TEST(GyroWatch, ABiasThatIsLearntAtRestIsNotHeldAgainstIt) {
  Ride ride;
  ride.run(60, {});
  ride.run(300, {.bias_rps = 0.02, .rests = true});
  EXPECT_EQ(ride.denied(60, {.bias_rps = 0.02}), 0);
}

TEST(GyroWatch, ASmallBiasThatLastsIsLearntAnew) {
  Ride ride;
  ride.run(60, {});
  EXPECT_EQ(ride.run(10, {.bias_rps = 0.02}), Fault::contradicted);
  EXPECT_EQ(ride.run(120, {.bias_rps = 0.02}), Fault::none);
}

TEST(GyroWatch, ATurnThatIsNoNumberIsNotTold) {
  Ride ride;
  ride.run(60, {});
  ride.watch().add({1, 0, 0.66, 0.001, true, NAN, 3e-4});
  ride.watch().add({2, 1, 0.66, 0.001, true, 0, INFINITY});
  EXPECT_EQ(ride.denied(20, {}), 0);
  EXPECT_EQ(ride.run(5, {.bias_rps = 0.05}), Fault::contradicted);
}

TEST(GyroWatch, AnImuWithoutAGyroIsNamedNowhere) {
  Ride ride;
  EXPECT_EQ(ride.run(5, {.bias_rps = 0, .noise_rps = 0}), Fault::absent);
}

}  // namespace
}  // namespace railfix::fusion
