// A recorder on a train of its own, for the tests.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "core/time.hpp"
#include "recorder/recorder.hpp"

namespace railfix::recorder {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

inline constexpr int64_t kPatienceNs = 20 * core::kNsPerSecond;
inline constexpr uint32_t kWidthPx = 320;
inline constexpr uint32_t kHeightPx = 200;

template <class Condition>
bool wait_until(const Condition& condition) {
  messaging::Queue idle;
  const int64_t deadline_ns = core::monotonic_ns() + kPatienceNs;
  while (!condition()) {
    if (core::monotonic_ns() > deadline_ns) return false;
    idle.run_one(core::monotonic_ns() + 5'000'000);
  }
  return true;
}

class RecorderTest : public ::testing::Test {
 protected:
  RecorderTest()
      : folder_(fs::temp_directory_path() / ("railfix-recorder-thread-" + std::to_string(::getpid()))),
        participant_(options()) {
    fs::remove_all(folder_);
    config_.folder = folder_.string();
    config_.keep_free_mb = 0;
  }
  ~RecorderTest() override { fs::remove_all(folder_); }

  /// Another participant of the same train.
  static messaging::ParticipantOptions options() {
    messaging::ParticipantOptions options;
    options.train_id = "recorder-" + std::to_string(::getpid());
    options.domain = 78;
    return options;
  }
  std::unique_ptr<Recorder> recorder() {
    return std::make_unique<Recorder>(
        config_, participant_, std::map<std::string, std::string>{{"train_id", "demo"}, {"version", "test"}},
        [this](int64_t stamp_ns) { last_picture_ns_ = stamp_ns; }, free_space_);
  }
  static void fill(msg::CameraFrame& frame, uint64_t seq) {
    frame.stamp_ns(1000 + static_cast<int64_t>(seq));
    frame.grabbed_ns(5);
    frame.seq(seq);
    frame.width_px(kWidthPx);
    frame.height_px(kHeightPx);
    frame.exposure_s(0.001F);
    frame.health(msg::PICTURE_DARK);
    for (size_t i = 0; i < kWidthPx * kHeightPx; ++i) frame.data()[i] = static_cast<uint8_t>(i % kWidthPx / 2 + seq);
  }

  fs::path folder_;
  messaging::Participant participant_;
  RecorderConfig config_;
  FreeSpace free_space_ = free_bytes;  // asked in the recorder's thread
  std::atomic<int64_t> last_picture_ns_ = 0;
};

}  // namespace railfix::recorder
