// Services beside a replay that is moved: the real fusion begins anew where the data goes on.
#include <gmock/gmock.h>

#include "integration/replay/recorded_ride.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"

namespace railfix::restart_test {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int kDomain = 88;
constexpr double kMiddleS = 10;

class MovedReplay : public ::testing::Test, protected test::OnTrain {
 protected:
  MovedReplay()
      : OnTrain("moved-" + std::to_string(getpid()), kDomain), control_(participant_, topics::service_control) {
    listen(topics::train_state, [this](const msg::TrainState& state) { states_.push_back(state); });
    listen(topics::player_status, [this](const msg::PlayerStatus& status) { player_ = status; });
    listen(topics::service_reply, [this](const msg::ControlReply& reply) { replied_ = reply.request_id(); });
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    test::write_map(folder_ / "line.map");
    test::record_ride(folder_ / "ride.mcap");
  }
  ~MovedReplay() override { fs::remove_all(folder_); }

  std::unique_ptr<test::Program> program(const std::vector<std::string>& arguments) {
    const std::string name = "said-" + std::to_string(++programs_);
    return std::make_unique<test::Program>(arguments,
                                           test::Program::Options{folder_ / name, folder_ / (name + "-errors"), {}});
  }
  void tell(const std::string& command, const std::string& argument = "") {
    msg::ControlRequest request;
    request.request_id(++request_);
    request.service("player");
    request.command(command);
    request.argument(argument);
    control_.write(request);
    EXPECT_TRUE(run_until([this] { return replied_ == request_; })) << command;
  }
  /// Has the player moved to `into_s`, and waits for the first state of there; those before it are dropped.
  void move_to(double into_s) {
    tell("seek", std::to_string(into_s));
    tell("play");
    const auto earlier = [](const auto& a, const auto& b) { return b.stamp_ns() < a.stamp_ns(); };
    auto first = states_.end();
    ASSERT_TRUE(run_until([&] {
      first = std::ranges::adjacent_find(states_, earlier);
      return first != states_.end();
    })) << "the states do not go back";
    states_.erase(states_.begin(), std::next(first));
  }
  [[nodiscard]] bool ended() const { return player_ && player_->state() == msg::PLAYER_ENDED; }
  static double into_s(const msg::TrainState& state) { return core::seconds(state.stamp_ns() - test::kBegin); }

  fs::path folder_ = fs::temp_directory_path() / ("railfix-" + train_);
  messaging::Writer<msg::ControlRequest> control_;
  std::vector<msg::TrainState> states_;
  std::optional<msg::PlayerStatus> player_;
  uint64_t replied_ = 0;
  uint64_t request_ = 0;
  int programs_ = 0;
};

TEST_F(MovedReplay, BeginsAnewWhereTheDataGoesOn) {
  const std::string domain = std::to_string(kDomain);
  const auto fusion = program(
      test::with_settings("railfix-fusion", {"common.train_id=" + train_, "common.domain=" + domain,
                                             "fusion.map=" + (folder_ / "line.map").string(), "fusion.start=1:100:+"}));
  const auto replay = program({"railfix", "replay", (folder_ / "ride.mcap").string(), "--without", "train_state",
                               "--train", train_, "--domain", domain, "--rate", "2", "--controlled"});
  ASSERT_TRUE(run_until([this] { return ended() && !states_.empty() && into_s(states_.back()) > 19; }));
  EXPECT_EQ(states_.back().track_known(), 1);
  EXPECT_NEAR(states_.back().offset_m(), 100 + test::kFrames * test::kStepM, 10);

  // Back to the beginning, where it stood at fusion.start.
  move_to(0);
  ASSERT_TRUE(run_until([this] { return into_s(states_.back()) > 4; }));
  EXPECT_LT(into_s(states_.front()), 1);
  EXPECT_NEAR(states_.front().offset_m(), 100, 30);
  EXPECT_TRUE(std::ranges::is_sorted(states_, {}, [](const auto& state) { return state.stamp_ns(); }));
  EXPECT_EQ(states_.back().track_known(), 1);
  EXPECT_EQ(states_.back().integrity(), msg::INTEGRITY_DEGRADED) << "the start was told, and nothing confirms it";
  EXPECT_LT(states_.back().over_m() + states_.back().under_m(), 20);

  // Into the middle, where nobody has said where it is: unknown, and not still at the start.
  ASSERT_TRUE(run_until([this] { return ended(); }));
  move_to(kMiddleS);
  ASSERT_TRUE(run_until([this] { return into_s(states_.back()) > kMiddleS + 4; }));
  EXPECT_NEAR(into_s(states_.front()), kMiddleS, 1);
  EXPECT_EQ(states_.back().track_known(), 0);
  EXPECT_TRUE(std::ranges::is_sorted(states_, {}, [](const auto& state) { return state.stamp_ns(); }));
}

}  // namespace
}  // namespace railfix::restart_test
