// Real DDS inside one process: typed, loaned, raw and late.
#include <gtest/gtest.h>
#include <unistd.h>

#include "core/time.hpp"
#include "messaging/topics.hpp"

namespace railfix::messaging {
namespace {

constexpr int64_t kPatienceNs = 10 * core::kNsPerSecond;

class Exchange : public ::testing::Test {
 protected:
  Exchange() : participant_(options("train-" + std::to_string(getpid()))) {}
  static ParticipantOptions options(const std::string& train) {
    ParticipantOptions options;
    options.train_id = train;
    options.domain = 77;
    return options;
  }
  template <class Condition>
  bool run_until(Condition condition) {
    const int64_t deadline_ns = core::monotonic_ns() + kPatienceNs;
    while (!condition()) {
      if (core::monotonic_ns() > deadline_ns) return false;
      queue_.run_one(core::monotonic_ns() + 10'000'000);
    }
    return true;
  }
  Queue queue_;
  Participant participant_;
};

TEST_F(Exchange, TypedSamplesArriveInOrderAndComplete) {
  std::vector<msg::OdometryStep> got;
  Reader<msg::OdometryStep> reader(participant_, topics::odometry_step, "", queue_,
                                   [&](const msg::OdometryStep& step) { got.push_back(step); });
  Writer<msg::OdometryStep> writer(participant_, topics::odometry_step);
  ASSERT_TRUE(run_until([&] { return writer.matched_readers() == 1 && reader.matched_writers() == 1; }));
  for (int i = 0; i < 20; ++i) {
    msg::OdometryStep step;
    step.stamp_ns(i);
    step.distance_m(0.5 * i);
    step.mode(msg::ODOMETRY_KEYFRAME);
    ASSERT_TRUE(writer.write(step));
  }
  ASSERT_TRUE(run_until([&] { return got.size() == 20; }));
  for (int i = 0; i < 20; ++i) {
    EXPECT_EQ(got[static_cast<size_t>(i)].stamp_ns(), i);
    EXPECT_EQ(got[static_cast<size_t>(i)].distance_m(), 0.5 * i);
    EXPECT_EQ(got[static_cast<size_t>(i)].mode(), msg::ODOMETRY_KEYFRAME);
  }
}

TEST_F(Exchange, TwoParticipantsAgreeWhenTheyAreConnected) {
  Participant other(options("train-" + std::to_string(getpid())));
  Queue other_queue;
  Reader<msg::PositionFix> reader(other, topics::position_fix, "", other_queue, [](const msg::PositionFix&) {});
  Reader<msg::GnssFix> gnss(other, topics::gnss_fix, "", other_queue, [](const msg::GnssFix&) {});
  Writer<msg::PositionFix> writer(participant_, topics::position_fix);
  ASSERT_TRUE(run_until([&] {
    const auto mine = participant_.connections();
    const auto theirs = other.connections();
    return mine.endpoints == 1 && mine.remote_endpoints == 2 && theirs.endpoints == 2 && theirs.remote_endpoints == 1 &&
           mine.pairs == 1 && mine.matches + theirs.matches == 2 * mine.pairs;
  }));
}

TEST_F(Exchange, PicturesAreFilledInPlace) {
  uint64_t seen = 0;
  uint8_t last_pixel = 0;
  Reader<msg::CameraFrame> reader(participant_, topics::camera_frame, "cam0", queue_,
                                  [&](const msg::CameraFrame& frame) {
                                    ++seen;
                                    last_pixel = frame.data()[frame.width_px() * frame.height_px() - 1];
                                  });
  Writer<msg::CameraFrame> writer(participant_, topics::camera_frame, "cam0");
  ASSERT_TRUE(run_until([&] { return writer.matched_readers() == 1 && reader.matched_writers() == 1; }));
  for (uint8_t i = 1; i <= 5; ++i) {
    ASSERT_TRUE(writer.write_in_place([&](msg::CameraFrame& frame) {
      frame.seq(i);
      frame.width_px(1280);
      frame.height_px(1024);
      std::fill_n(frame.data().begin(), 1280 * 1024, i);
    }));
    ASSERT_TRUE(run_until([&] { return seen == i; })) << "picture " << int{i};
    EXPECT_EQ(last_pixel, i);
  }
}

TEST_F(Exchange, LateJoinersGetTheCalibration) {
  Writer<msg::CameraCalibration> writer(participant_, topics::camera_calibration);
  msg::CameraCalibration calibration;
  calibration.camera("cam0");
  calibration.fu_px(1152);
  ASSERT_TRUE(writer.write(calibration));
  double fu_px = 0;
  Reader<msg::CameraCalibration> reader(participant_, topics::camera_calibration, "", queue_,
                                        [&](const msg::CameraCalibration& got) { fu_px = got.fu_px(); });
  EXPECT_TRUE(run_until([&] { return fu_px == 1152; }));
}

TEST_F(Exchange, TrainsDoNotHearEachOther) {
  Participant other(options("other-" + std::to_string(getpid())));
  Queue other_queue;
  int heard = 0;
  int mine = 0;
  Reader<msg::PositionFix> foreign(other, topics::position_fix, "", other_queue,
                                   [&](const msg::PositionFix&) { ++heard; });
  Reader<msg::PositionFix> own(participant_, topics::position_fix, "", queue_,
                               [&](const msg::PositionFix&) { ++mine; });
  Writer<msg::PositionFix> writer(participant_, topics::position_fix);
  ASSERT_TRUE(run_until([&] { return writer.matched_readers() >= 1; }));
  ASSERT_TRUE(writer.write(msg::PositionFix()));
  ASSERT_TRUE(run_until([&] { return mine == 1; }));
  while (other_queue.run_one(0)) {
  }
  EXPECT_EQ(heard, 0);
  EXPECT_EQ(foreign.matched_writers(), 0);
}

TEST_F(Exchange, TheStrongerWriterOfAnExclusiveTopicIsHeard) {
  auto strong_options = options("train-" + std::to_string(getpid()));
  strong_options.ownership_strength = 20;
  Participant strong(strong_options);
  std::vector<uint64_t> heard;
  Reader<msg::TrainState> reader(participant_, topics::train_state, "", queue_,
                                 [&](const msg::TrainState& state) { heard.push_back(state.seq()); });
  Writer<msg::TrainState> weak_writer(participant_, topics::train_state);
  Writer<msg::TrainState> strong_writer(strong, topics::train_state);
  ASSERT_TRUE(run_until([&] {
    return reader.matched_writers() == 2 && weak_writer.matched_readers() == 1 && strong_writer.matched_readers() == 1;
  }));
  msg::TrainState state;
  state.seq(1000);
  ASSERT_TRUE(strong_writer.write(state));
  ASSERT_TRUE(run_until([&] { return !heard.empty(); }));
  state.seq(1);
  ASSERT_TRUE(weak_writer.write(state));
  state.seq(1001);
  ASSERT_TRUE(strong_writer.write(state));
  ASSERT_TRUE(run_until([&] { return heard.size() >= 2; }));
  EXPECT_EQ(heard, (std::vector<uint64_t>{1000, 1001}));
  // The strong one falls silent (neither writes nor asserts): after its lease the weak one is heard.
  state.seq(2);
  EXPECT_TRUE(run_until([&] {
    weak_writer.write(state);
    return heard.back() == 2;
  }));
}

TEST_F(Exchange, AWriterKnowsWhoIsHeardAndItsStrengthCanChange) {
  auto other_options = options("train-" + std::to_string(getpid()));
  other_options.ownership_strength = 20;
  Participant other(other_options);
  uint64_t heard = 0;
  Reader<msg::TrainState> reader(participant_, topics::train_state, "", queue_,
                                 [&](const msg::TrainState& state) { heard = state.seq(); });
  Writer<msg::TrainState> writer(participant_, topics::train_state);
  Writer<msg::TrainState> other_writer(other, topics::train_state);
  EXPECT_EQ(writer.owner(), Owner::unknown);
  EXPECT_EQ(other_writer.owner(), Owner::unknown);
  const auto both_write_until = [&](uint64_t expected) {
    msg::TrainState state;
    return run_until([&] {
      state.seq(1);
      writer.write(state);
      state.seq(2);
      other_writer.write(state);
      const auto own = writer.owner();
      const auto others = other_writer.owner();
      return heard == expected && own == (expected == 1 ? Owner::self : Owner::other) &&
             others == (expected == 2 ? Owner::self : Owner::other);
    });
  };
  EXPECT_TRUE(both_write_until(2)) << "20 against 10";
  writer.set_ownership_strength(30);
  EXPECT_TRUE(both_write_until(1)) << "20 against 30";
  writer.set_ownership_strength(5);
  EXPECT_TRUE(both_write_until(2)) << "20 against 5";
}

TEST_F(Exchange, AnInterfaceThatIsNotHereIsNamedWithThoseThatAre) {
  auto wrong = options("train");
  wrong.interfaces = {"lo", "no-such-interface"};
  try {
    Participant participant(wrong);
    FAIL() << "joined over an interface that is not here";
  } catch (const core::BadInput& error) {
    EXPECT_NE(std::string(error.what()).find("no-such-interface is not here"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("lo (127.0.0.1)"), std::string::npos) << error.what();
  }
}

TEST_F(Exchange, AServiceThatFallsSilentIsNamed) {
  std::string gone;
  int heard = 0;
  Reader<msg::ServiceStatus> reader(participant_, topics::service_status, "", queue_,
                                    [&](const msg::ServiceStatus& status, const SampleInfo& info) {
                                      if (info.valid) {
                                        ++heard;
                                      } else {
                                        gone = status.service().c_str();
                                      }
                                    });
  Participant frozen(options("train-" + std::to_string(getpid())));
  Participant healthy(options("train-" + std::to_string(getpid())));
  Writer<msg::ServiceStatus> frozen_writer(frozen, topics::service_status);
  Writer<msg::ServiceStatus> healthy_writer(healthy, topics::service_status);
  msg::ServiceStatus status;
  status.service("fusion");
  ASSERT_TRUE(frozen_writer.write(status));
  status.service("odometry");
  ASSERT_TRUE(healthy_writer.write(status));
  ASSERT_TRUE(run_until([&] { return heard == 2; }));
  EXPECT_TRUE(run_until([&] {
    healthy.assert_liveliness();
    return !gone.empty();
  }));
  EXPECT_EQ(gone, "fusion");
}

TEST(Serialize, RoundTripsAndRefusesShortBytes) {
  msg::ServiceStatus status;
  status.service("fusion");
  status.host("coach");
  status.frames_in(12345);
  const auto cdr = serialize(status);
  msg::ServiceStatus back;
  ASSERT_TRUE(deserialize(cdr, back));
  EXPECT_EQ(back.frames_in(), 12345U);
  EXPECT_EQ(std::string(back.host().c_str()), "coach");
  for (size_t length = 0; length < 20; ++length) {
    EXPECT_FALSE(deserialize(std::vector<uint8_t>(cdr.begin(), cdr.begin() + static_cast<long>(length)), back))
        << length;
  }
}

}  // namespace
}  // namespace railfix::messaging
