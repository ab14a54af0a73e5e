// A process that is killed and started again hears those that ran on: real processes, ended by SIGKILL.
#include <gtest/gtest.h>

#include <fstream>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "support/network.hpp"
#include "support/program.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int kDomain = 71;
constexpr int kKills = 10;  // with the shared-memory transport one restart in 10 to 30 heard nothing for ever
constexpr int64_t kPatienceNs = 60 * core::kNsPerSecond;
constexpr int64_t kPeriodNs = 20'000'000;

class KilledReader : public ::testing::Test {
 protected:
  KilledReader() : participant_(test::network(train_, kDomain)), states_(participant_, topics::train_state) {}
  ~KilledReader() override { fs::remove(out_); }

  [[nodiscard]] std::vector<std::string> listener() const {
    return {"railfix", "topics", "echo",     "train_state",          "--json",
            "--train", train_,   "--domain", std::to_string(kDomain)};
  }
  /// Writes states until the listener has printed one.
  bool heard() {
    const int64_t deadline_ns = core::monotonic_ns() + kPatienceNs;
    while (core::monotonic_ns() < deadline_ns) {
      msg::TrainState state;
      state.stamp_ns(core::wall_ns());
      states_.write(state);
      std::error_code failed;
      if (fs::file_size(out_, failed) > 0 && !failed) return true;
      queue_.run_one(core::monotonic_ns() + kPeriodNs);
    }
    return false;
  }

  const std::string train_ = "killed-" + std::to_string(getpid());
  const fs::path out_ = fs::temp_directory_path() / (train_ + ".json");
  messaging::Queue queue_;
  messaging::Participant participant_;
  messaging::Writer<msg::TrainState> states_;
};

TEST_F(KilledReader, HearsAgainHoweverOftenItIsKilled) {
  for (int i = 0; i < kKills; ++i) {
    fs::remove(out_);
    test::Program listener(this->listener(), {out_, "/dev/null", {}});
    ASSERT_TRUE(heard()) << "after " << i << " kills the new process got no samples";
    listener.end(SIGKILL);
  }
}

// What one process breaks in a queue that others write to, they never notice (eProsima/Fast-DDS#4728).
TEST_F(KilledReader, ProcessesShareNoQueues) {
  test::Program listener(this->listener(), {out_, "/dev/null", {}});
  ASSERT_TRUE(heard());
  std::ifstream maps("/proc/self/maps");
  for (std::string line; std::getline(maps, line);) EXPECT_EQ(line.find("fastrtps_"), std::string::npos) << line;
}

}  // namespace
}  // namespace railfix
