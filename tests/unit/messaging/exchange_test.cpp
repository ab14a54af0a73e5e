// Real DDS inside one process: typed, loaned, raw and late.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <string>
#include <thread>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "messaging/unheard.hpp"
#include "support/held_discovery.hpp"

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

// A second reader that is matched just while a picture waits to be sent had Fast DDS keep that picture for ever, and
// the seventeenth after it found no memory. Here pictures wait, because previews keep the thread busy that sends both.
TEST_F(Exchange, NoPictureIsRefusedWhileReadersComeAndGo) {
  constexpr int kComeAndGo = 10;
  constexpr auto kPeriod = std::chrono::milliseconds(10);
  const auto ignore = [](const auto&) {};
  Participant other(options("train-" + std::to_string(getpid())));
  Queue other_queue;
  Reader<msg::CameraPreview> previews(other, topics::camera_preview, "cam0", other_queue, ignore);
  std::atomic<int> heard = 0;
  Reader<msg::CameraFrame> stays(other, topics::camera_frame, "cam0", other_queue,
                                 [&](const msg::CameraFrame&) { ++heard; });
  Writer<msg::CameraPreview> preview_writer(participant_, topics::camera_preview, "cam0");
  Writer<msg::CameraFrame> writer(participant_, topics::camera_frame, "cam0");
  ASSERT_TRUE(run_until([&] { return preview_writer.matched_readers() == 1 && writer.matched_readers() == 1; }));
  std::atomic<bool> over = false;
  std::thread busy([&] {
    msg::CameraPreview preview;
    preview.jpeg().resize(2'000'000);
    while (!over) preview_writer.write(preview);
  });
  int written = 0;
  int refused = 0;
  const auto write_until_read_by = [&](int readers) {
    EXPECT_TRUE(run_until([&] {
      ++(writer.write_in_place([](msg::CameraFrame& frame) { frame.seq(1); }) ? written : refused);
      while (other_queue.run_one(core::monotonic_ns())) continue;
      std::this_thread::sleep_for(kPeriod);
      return writer.matched_readers() == readers;
    }));
  };
  for (int i = 0; i < kComeAndGo; ++i) {
    {
      Reader<msg::CameraFrame> comes(other, topics::camera_frame, "cam0", other_queue, ignore);
      write_until_read_by(2);
    }
    for (int k = 0; k < 17; ++k) write_until_read_by(1);
  }
  over = true;
  busy.join();
  EXPECT_EQ(refused, 0);
  EXPECT_GT(heard, written / 2) << "of " << written;
}

/// The files of shared memory that this process has open.
std::set<std::string> shared_memory() {
  std::set<std::string> files;
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) {
    if (const size_t at = line.find("/dev/shm/"); at != std::string::npos) files.insert(line.substr(at));
  }
  return files;
}

// As one that left before the writer's process came to hear of it, or whose container has a /dev/shm of its own: Fast
// DDS would send it the next picture for ever.
TEST_F(Exchange, AReaderWithoutItsMemoryDoesNotHoldTheCameraBack) {
  const std::set<std::string> before = shared_memory();
  Reader<msg::CameraFrame> reader(participant_, topics::camera_frame, "cam0", queue_, [](const msg::CameraFrame&) {});
  int removed = 0;
  for (const auto& file : shared_memory()) removed += !before.contains(file) && std::filesystem::remove(file) ? 1 : 0;
  ASSERT_EQ(removed, 1);
  Participant other(options("train-" + std::to_string(getpid())));
  Writer<msg::CameraFrame> writer(other, topics::camera_frame, "cam0");
  // One that is announced later is matched: the other one has been heard of by then.
  Reader<msg::CameraFrame> sound(participant_, topics::camera_frame, "cam0", queue_, [](const msg::CameraFrame&) {});
  ASSERT_TRUE(run_until([&] { return reader.matched_writers() == 1 && writer.matched_readers() > 0; }));
  EXPECT_EQ(writer.matched_readers(), 1);
  for (int i = 0; i < 40; ++i) EXPECT_TRUE(writer.write_in_place([](msg::CameraFrame& frame) { frame.seq(1); })) << i;
}

// Everybody may read another user's files, and a reader is called by writing to its own.
TEST_F(Exchange, AReaderOfAnotherUserDoesNotHoldTheCameraBackAndIsNamed) {
  constexpr uid_t kNobody = 65534;
  if (geteuid() != 0) GTEST_SKIP() << "skipped: only root may become another user";
  Reader<msg::CameraFrame> reader(participant_, topics::camera_frame, "cam0", queue_, [](const msg::CameraFrame&) {});
  ASSERT_EQ(seteuid(kNobody), 0);
  {
    Participant other(options("train-" + std::to_string(getpid())));
    Writer<msg::CameraFrame> writer(other, topics::camera_frame, "cam0");
    EXPECT_TRUE(run_until([&] { return !unreached_readers(other).empty(); }));
    EXPECT_THAT(unreached_readers(other),
                testing::ElementsAre("camera_frame/cam0 does not reach tool@local: run it as the same user and with "
                                     "this one's /dev/shm"));
    for (int i = 0; i < 40; ++i) EXPECT_TRUE(writer.write_in_place([](msg::CameraFrame& frame) { frame.seq(1); })) << i;
    EXPECT_EQ(writer.matched_readers(), 0);
  }
  ASSERT_EQ(seteuid(0), 0);
}

// What comes for the discovery is handed on one message after the other, each under this lock.
TEST_F(Exchange, WhoWaitsForItselfInTheDiscoverySaysSo) {
  std::optional<test::HeldDiscovery> held(participant_);
  int64_t now_ns = 100 * core::kNsPerSecond;
  const auto goes_on_after_s = [&](double seconds) {
    bool goes_on = true;
    for (const int64_t until_ns = now_ns + core::to_ns(seconds); now_ns < until_ns;) {
      now_ns += core::kNsPerSecond / 10;
      goes_on = participant_.discovery_goes_on(now_ns);
    }
    return goes_on;
  };
  EXPECT_TRUE(goes_on_after_s(4));
  ++*participant_.impl().handed_on;
  EXPECT_TRUE(goes_on_after_s(4)) << "busy, but with one message after the other";
  EXPECT_FALSE(goes_on_after_s(2));
  now_ns += 20 * core::kNsPerSecond;
  EXPECT_TRUE(goes_on_after_s(0.1)) << "stopped itself meanwhile";
  EXPECT_FALSE(goes_on_after_s(6));
  held.reset();
  EXPECT_TRUE(participant_.discovery_goes_on(now_ns));
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

TEST_F(Exchange, OfTwoWritersOfAnExclusiveTopicTheOneThatIsHeardGoesOn) {
  Participant other(options("train-" + std::to_string(getpid())));
  std::vector<uint64_t> heard;
  Reader<msg::TrainState> reader(participant_, topics::train_state, "", queue_,
                                 [&](const msg::TrainState& state) { heard.push_back(state.seq()); });
  Writer<msg::TrainState> first(participant_, topics::train_state);
  Writer<msg::TrainState> second(other, topics::train_state);
  ASSERT_TRUE(run_until(
      [&] { return reader.matched_writers() == 2 && first.matched_readers() == 1 && second.matched_readers() == 1; }));
  msg::TrainState state;
  const auto write = [&](Writer<msg::TrainState>& writer, uint64_t seq) {
    state.seq(seq);
    return writer.write(state);
  };
  ASSERT_TRUE(run_until([&] { return write(second, 2) && !heard.empty(); }));
  // Both write; the first to be heard has no pause.
  const size_t enough = heard.size() + 20;
  ASSERT_TRUE(run_until([&] { return write(second, 2) && write(first, 1) && heard.size() >= enough; }));
  // A machine that stands still for longer than the reader's patience lets the other one in; then that one goes on.
  const auto changes = [&] {
    int count = 0;
    for (size_t i = 1; i < heard.size(); ++i) count += heard[i] != heard[i - 1] ? 1 : 0;
    return count;
  };
  EXPECT_LT(changes(), 10) << "with both heard nearly every sample is a change";
  const uint64_t stays = heard.back();
  auto& falls_silent = stays == 2 ? second : first;
  auto& goes_on = stays == 2 ? first : second;
  EXPECT_TRUE(run_until([&] { return write(goes_on, 3) && heard.back() == 3; })) << "it fell silent";
  EXPECT_TRUE(falls_silent.matched_readers() == 1);
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

// Two releases in one train, in the middle of an upgrade: nonsense must not be taken for a position.
TEST_F(Exchange, AWriterOfAnotherLayoutIsNotHeardAndNamed) {
  auto other = info_of(topics::train_state);
  other.idl = "sensors";  // stands for train_state as another release has it
  std::set<uint64_t> heard;
  Reader<msg::TrainState> reader(participant_, topics::train_state, "", queue_,
                                 [&](const msg::TrainState& state) { heard.insert(state.seq()); });
  Participant theirs(options("train-" + std::to_string(getpid())));
  AnyWriter wrong(theirs, other, "");
  Writer<msg::TrainState> right(theirs, topics::train_state);
  ASSERT_TRUE(run_until([&] { return reader.matched_writers() == 2; }));
  msg::TrainState lie;
  lie.seq(666);
  msg::TrainState truth;
  for (const uint64_t seq : {1U, 2U, 3U}) {
    ASSERT_TRUE(wrong.write(&lie));
    truth.seq(seq);
    ASSERT_TRUE(run_until([&] { return right.write(truth) && heard.contains(seq); }));
  }
  EXPECT_THAT(heard, ::testing::ElementsAre(1U, 2U, 3U));
  EXPECT_THAT(unheard_writers(participant_),
              ::testing::ElementsAre(
                  "train_state of tool@local is not heard: its release has another layout of this topic (IDL); "
                  "bring both to one release"));
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
