// Real services in lock step, a replay that leads them, and an ear for every position they give.
#pragma once

#include <gmock/gmock.h>

#include "integration/replay/lock_step_ear.hpp"
#include "support/program.hpp"

namespace railfix::test {

class LockStepTrain {
 public:
  LockStepTrain(std::string train, int domain) : train_(std::move(train)), domain_(std::to_string(domain)) {}

  /// Runs until this train goes. `service` is the program's name without "railfix-".
  void start(const std::string& service, std::vector<std::string> settings) {
    settings.insert(settings.end(), {"common.train_id=" + train_, "common.domain=" + domain_, "common.log_level=error",
                                     "common.lock_step=true"});
    services_.push_back(std::make_unique<Program>(with_settings("railfix-" + service, settings)));
  }
  /// Plays the recording to its end; `turns` are the services that take turns before the ear ("odometry,fusion").
  /// Expects that the replay ends well and says on standard error what is asked for.
  void replay(const std::filesystem::path& recording, const std::string& turns, const std::string& says) {
    const auto folder = recording.parent_path();
    Program replay({"railfix", "replay", recording.string(), "--lock-step", turns + "," + LockStepEar::kName, "--train",
                    train_, "--domain", domain_},
                   {folder / "out", folder / "err", {}});
    EXPECT_TRUE(ear_.listen_until_the_end()) << slurp(folder / "err");
    EXPECT_EQ(replay.wait_for_end(), 0) << slurp(folder / "err");
    EXPECT_THAT(slurp(folder / "err"), ::testing::HasSubstr(says));
  }
  [[nodiscard]] const LockStepEar& ear() const { return ear_; }

 private:
  std::string train_;
  std::string domain_;
  LockStepEar ear_{train_, std::stoi(domain_)};
  std::vector<std::unique_ptr<Program>> services_;
};

}  // namespace railfix::test
