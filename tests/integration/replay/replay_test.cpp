// `railfix replay` as a real process, led over DDS by this test as a dashboard would lead it.
#include <gmock/gmock.h>

#include "mcap/writer.hpp"
#include "messaging/topics.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"

namespace railfix::replay_test {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using ::testing::HasSubstr;

constexpr int kDomain = 87;
constexpr int64_t kBegin = 1'700'000'000 * core::kNsPerSecond;
constexpr int kViews = 200;
constexpr int64_t kViewNs = 50'000'000;
constexpr double kLengthS = (kViews - 1) * 0.05;

class Replay : public ::testing::Test, protected test::OnTrain {
 protected:
  Replay()
      : OnTrain("replay-" + std::to_string(getpid()), kDomain),
        folder_(fs::temp_directory_path() / ("railfix-" + train_)),
        control_(participant_, topics::service_control),
        view_reader_(
            listen(topics::track_view, [this](const msg::TrackView& view) { views_.push_back(view.stamp_ns()); })) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    listen(topics::player_status, [this](const msg::PlayerStatus& status) { status_ = status; });
    listen(topics::service_reply, [this](const msg::ControlReply& reply) { reply_ = reply; });
    listen(topics::camera_calibration, [this](const msg::CameraCalibration& calibration) {
      focal_px_[calibration.camera().c_str()] = calibration.fu_px();
    });
    listen(topics::data_clock, [this](const msg::DataClock& clock) { clock_ = clock; });
    source();
  }
  ~Replay() override { fs::remove_all(folder_); }

  // Ten seconds of views; two cameras, the calibration of one of them changes in the middle.
  void source() const {
    auto writer = mcap::Writer::create(file(), {}).value();
    const auto channel = [&](const std::string& topic, const messaging::Type& type) {
      return writer->add_channel(writer->add_schema(type.name(), "omgidl", "").value(), topic, "cdr", {}).value();
    };
    const auto write = [&](uint16_t id, int64_t time_ns, const std::vector<uint8_t>& cdr) {
      EXPECT_TRUE(writer->write({id, 0, kBegin + time_ns, kBegin + time_ns, cdr}).ok());
    };
    const uint16_t calibrations = channel("camera_calibration", messaging::type_of<msg::CameraCalibration>());
    const auto calibrate = [&](const char* camera, double focal_px, int64_t time_ns) {
      msg::CameraCalibration calibration;
      calibration.camera(camera);
      calibration.fu_px(focal_px);
      write(calibrations, time_ns, messaging::serialize(calibration));
    };
    calibrate("cam0", 100, 0);
    calibrate("cam1", 300, 0);
    const uint16_t views = channel("track_view", messaging::type_of<msg::TrackView>());
    for (int i = 0; i < kViews; ++i) {
      msg::TrackView view;
      view.stamp_ns(i);
      write(views, i * kViewNs, messaging::serialize(view));
      if (i == kViews / 2) calibrate("cam0", 200, i * kViewNs);
    }
    const auto closed = writer->close();
    EXPECT_TRUE(closed.ok());
  }
  [[nodiscard]] fs::path file() const { return folder_ / "source.mcap"; }

  std::unique_ptr<test::Program> replay(const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"railfix", "replay",   file().string(),        "--train",
                                       train_,    "--domain", std::to_string(kDomain)};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return std::make_unique<test::Program>(arguments, test::Program::Options{folder_ / "out", folder_ / "err", {}});
  }
  bool state_is(uint8_t state) {
    return run_until([&] { return status_ && status_->state() == state; });
  }
  /// Gives the reply's text.
  std::string tell(const std::string& command, const std::string& argument = "") {
    EXPECT_TRUE(run_until([this] { return control_.matched_readers() > 0; }));
    reply_.reset();
    msg::ControlRequest request;
    request.request_id(++request_);
    request.service("player");
    request.command(command);
    request.argument(argument);
    control_.write(request);
    EXPECT_TRUE(run_until([this] { return reply_ && reply_->request_id() == request_; })) << command;
    return reply_ ? reply_->text().c_str() : "";
  }
  [[nodiscard]] double at_s() const { return core::seconds(status_->at_ns() - status_->from_ns()); }

  fs::path folder_;
  messaging::Writer<msg::ControlRequest> control_;
  const messaging::Reader<msg::TrackView>& view_reader_;
  std::optional<msg::PlayerStatus> status_;
  std::optional<msg::ControlReply> reply_;
  std::optional<msg::DataClock> clock_;
  std::vector<int64_t> views_;
  std::map<std::string, double> focal_px_;
  uint64_t request_ = 0;
};

TEST_F(Replay, IsLedOverDds) {
  auto player = replay({"--controlled", "--paused"});
  ASSERT_TRUE(state_is(msg::PLAYER_PAUSED));
  ASSERT_TRUE(run_until([this] { return view_reader_.matched_writers() > 0; }));
  EXPECT_EQ(status_->file(), file().string());
  EXPECT_NEAR(core::seconds(status_->to_ns() - status_->from_ns()), kLengthS, 1e-6);
  EXPECT_TRUE(views_.empty());

  for (size_t step = 1; step <= 2; ++step) {
    tell("step");
    ASSERT_TRUE(run_until([&] { return views_.size() == step; }));
  }
  EXPECT_EQ(views_, (std::vector<int64_t>{0, 1}));

  ASSERT_TRUE(run_until([this] { return clock_ && clock_->data_ns() > 1; })) << "the data's time, behind the second";
  const msg::DataClock stands = *clock_;
  ASSERT_TRUE(run_until([&] { return clock_->wall_ns() > stands.wall_ns() + 200'000'000; }));
  EXPECT_EQ(clock_->data_ns(), stands.data_ns()) << "stands while the recording stands";

  tell("seek", "6");
  ASSERT_TRUE(run_until([this] { return focal_px_["cam0"] == 200; })) << "the calibration of 5 s still holds at 6 s";
  EXPECT_EQ(focal_px_["cam1"], 300);
  tell("seek", "2");
  ASSERT_TRUE(run_until([this] { return focal_px_["cam0"] == 100; }));
  EXPECT_EQ(views_.size(), 2U) << "standing values only";
  tell("step");
  ASSERT_TRUE(run_until([this] { return views_.size() == 3; }));
  EXPECT_EQ(views_.back(), 40);

  EXPECT_EQ(tell("rate", "2"), "rate 2");
  tell("seek", "8");
  tell("play");
  ASSERT_TRUE(state_is(msg::PLAYER_ENDED));
  EXPECT_EQ(status_->rate(), 2);
  EXPECT_NEAR(at_s(), kLengthS, 1e-6);
  ASSERT_TRUE(run_until([this] { return views_.size() == 3 + 40; }));
  EXPECT_EQ(views_.back(), kViews - 1);
  ASSERT_TRUE(run_until([this] { return clock_->ended() == 1; }));
  EXPECT_EQ(clock_->data_ns(), kViews - 1);

  EXPECT_EQ(player->exit_code(), std::nullopt) << "waits for commands at the end";
  EXPECT_EQ(player->end(SIGTERM), 0);
  EXPECT_THAT(test::slurp(folder_ / "out"), HasSubstr("later than due: p50"));
}

TEST_F(Replay, PausesLoopsAndSaysWhatItDoesNotUnderstand) {
  auto player = replay({"--loop", "--from", "9", "--rate", "4"});
  ASSERT_TRUE(run_until([this] { return std::ranges::count(views_, kViews - 1) >= 2; })) << "begins again";
  EXPECT_EQ(*std::ranges::min_element(views_), 180) << "where --from says";
  EXPECT_EQ(focal_px_["cam0"], 200);
  EXPECT_EQ(status_->looped(), 1);

  tell("pause");
  ASSERT_TRUE(state_is(msg::PLAYER_PAUSED));
  const int64_t stood_ns = status_->at_ns();
  const int64_t said_ns = status_->stamp_ns();
  ASSERT_TRUE(run_until([&] { return status_->stamp_ns() > said_ns + 300'000'000; })) << "goes on telling";
  EXPECT_EQ(status_->at_ns(), stood_ns);

  EXPECT_THAT(tell("seek", "99"), HasSubstr("seek needs seconds from 0 to 0.95"));
  EXPECT_FALSE(reply_->done());
  EXPECT_THAT(tell("rate", "fast"), HasSubstr("rate needs a number"));
  EXPECT_THAT(tell("jump"), HasSubstr("it knows: loop, pause, play, rate, seek, step, stop"));

  EXPECT_EQ(tell("loop", "off"), "loop off");
  tell("play");
  EXPECT_EQ(player->wait_for_end(), 0) << "ends at the end, without --loop and --controlled";
}

TEST_F(Replay, PublishesUnderAnotherName) {
  std::vector<int64_t> old;
  messaging::Reader<msg::TrackView> old_reader(participant_, topics::track_view, "old", queue_,
                                               [&](const msg::TrackView& view) { old.push_back(view.stamp_ns()); });
  messaging::Writer<msg::TrackView> running(participant_, topics::track_view);
  auto player = replay(
      {"--remap", "track_view=track_view/old", "--without", "camera_calibration", "--from", "9", "--paused", "--json"});
  ASSERT_TRUE(run_until([&] { return old_reader.matched_writers() > 0; }));
  tell("play");
  EXPECT_TRUE(run_until([&] { return old.size() == 20 && player->exit_code(); }));
  EXPECT_EQ(player->wait_for_end(), 0) << test::slurp(folder_ / "err");
  EXPECT_TRUE(views_.empty());
  EXPECT_TRUE(focal_px_.empty());
  EXPECT_THAT(test::slurp(folder_ / "out"), HasSubstr("\"topics\": 1"));
}

TEST_F(Replay, RefusesWhatCannotBeMeant) {
  const auto refused = [this](const std::vector<std::string>& more) {
    auto player = replay(more);
    EXPECT_EQ(player->wait_for_end(), 2);
    return test::slurp(folder_ / "err");
  };
  EXPECT_THAT(refused({"--remap", "track_view=imu_sample"}), HasSubstr("imu_sample is a topic of another type"));
  EXPECT_THAT(refused({"--remap", "imu_sample=x"}), HasSubstr("has no topic imu_sample"));
  EXPECT_THAT(refused({"--lock-step", "fusoin"}), HasSubstr("--lock-step fusoin is no service"));
  EXPECT_THAT(refused({"--from", "3", "--to", "2"}), HasSubstr("--to must be behind --from"));
}

}  // namespace
}  // namespace railfix::replay_test
