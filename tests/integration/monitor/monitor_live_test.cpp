// The real monitor between real DDS writers and clients that are not ours.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "support/network.hpp"
#include "support/npm.hpp"
#include "support/program.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int64_t kPeriodNs = 50'000'000;
constexpr int64_t kPatienceNs = 90 * core::kNsPerSecond;
constexpr size_t kPictureBytes = 250'000;

/// Writes what a train would, and answers as its recorder.
class Train {
 public:
  explicit Train(const std::string& name)
      : participant_(test::network(name, 79)),
        status_(participant_, topics::service_status),
        state_(participant_, topics::train_state),
        view_(participant_, topics::track_view),
        frame_(participant_, topics::camera_frame, "cam0"),
        preview_(participant_, topics::camera_preview, "cam0"),
        calibration_(participant_, topics::camera_calibration),
        log_(participant_, topics::log_record),
        report_(participant_, topics::train_position_report),
        request_(participant_, topics::service_control),
        reply_(participant_, topics::service_reply),
        requests_(participant_, topics::service_control, "", queue_,
                  std::function([this](const msg::ControlRequest& request) { answer(request); })),
        replies_(participant_, topics::service_reply, "", queue_, std::function([this](const msg::ControlReply& reply) {
                   if (std::string(reply.service().c_str()) == "monitor") address_ = reply.text().c_str();
                 })) {
    msg::CameraCalibration calibration;
    calibration.camera("cam0");
    calibration.width_px(640);
    calibration.height_px(512);
    calibration.fu_px(600);
    calibration.fv_px(600);
    calibration_.write(calibration);
  }

  /// One twentieth of a second of the train's life.
  void live() {
    const int64_t now_ns = core::wall_ns();
    write_state(now_ns);
    write_picture(now_ns);
    msg::ServiceStatus status;
    status.service("fusion");
    status.host("cab");
    status.state(service_state);
    status.reason(service_state == msg::STATE_FAILED ? "no map" : "");
    status_.write(status);
    msg::LogRecord record;
    record.stamp_ns(now_ns);
    record.service("fusion");
    record.level(3);
    record.text("a word");
    log_.write(record);
    msg::TrainPositionReport report;
    report.nid_lrbg(0xFFFFFF);
    report.message_bytes(2);
    report.message()[0] = 0x88;
    report.message()[1] = 0xAB;
    report_.write(report);
    const int64_t end_ns = core::monotonic_ns() + kPeriodNs;
    while (queue_.run_one(end_ns)) {
    }
  }
  template <class Condition>
  bool live_until(Condition condition) {
    const int64_t deadline_ns = core::monotonic_ns() + kPatienceNs;
    while (!condition()) {
      if (core::monotonic_ns() > deadline_ns) return false;
      live();
    }
    return true;
  }

  /// Where the monitor's page is, once it has answered.
  std::string address() {
    msg::ControlRequest request;
    request.request_id(1);
    request.service("monitor");
    request.command("address");
    live_until([&] {
      request_.write(request);
      return !address_.empty();
    });
    return address_;
  }
  [[nodiscard]] int preview_readers() const { return preview_.matched_readers(); }
  [[nodiscard]] int frame_readers() const { return frame_.matched_readers(); }

  uint8_t service_state = msg::STATE_ACTIVE;
  int64_t late_ns = 0;  // of the positions

 private:
  void write_state(int64_t now_ns) {
    msg::TrainState state;
    state.stamp_ns(now_ns - late_ns);
    state.speed_mps(12.5);
    state.acceleration_mps2(std::numeric_limits<double>::quiet_NaN());
    state.lat_deg(47.4);
    state.lon_deg(8.5);
    state.track_known(1);
    state_.write(state);
  }
  void write_picture(int64_t now_ns) {
    msg::TrackView view;
    view.stamp_ns(now_ns);
    view.height_m(2.5);
    view.seen_left(1);
    view.seen_right(1);
    view.left_points(2);
    view.right_points(2);
    view_.write(view);
    msg::CameraPreview preview;
    preview.stamp_ns(now_ns);
    preview.width_px(320);
    preview.height_px(256);
    std::vector<uint8_t> jpeg(kPictureBytes, 0x4A);
    jpeg[0] = 0xFF;
    jpeg[1] = 0xD8;
    preview.jpeg(std::move(jpeg));
    preview_.write(preview);
  }
  void answer(const msg::ControlRequest& request) {
    if (std::string(request.service().c_str()) != "recorder") return;
    msg::ControlReply reply;
    reply.request_id(request.request_id());
    reply.service("recorder");
    reply.done(true);
    reply.text(std::string(request.command().c_str()) + " " + request.argument().c_str());
    reply_.write(reply);
  }

  messaging::Participant participant_;
  messaging::Queue queue_;
  messaging::Writer<msg::ServiceStatus> status_;
  messaging::Writer<msg::TrainState> state_;
  messaging::Writer<msg::TrackView> view_;
  messaging::Writer<msg::CameraFrame> frame_;
  messaging::Writer<msg::CameraPreview> preview_;
  messaging::Writer<msg::CameraCalibration> calibration_;
  messaging::Writer<msg::LogRecord> log_;
  messaging::Writer<msg::TrainPositionReport> report_;
  messaging::Writer<msg::ControlRequest> request_;
  messaging::Writer<msg::ControlReply> reply_;
  messaging::Reader<msg::ControlRequest> requests_;
  messaging::Reader<msg::ControlReply> replies_;
  std::string address_;
};

class MonitorLiveTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    npm_ = test::npm_is_there();
    if (npm_) {
      ASSERT_EQ(test::install_script(kSource, "client.mjs", kWork), "");
    }
  }
  void SetUp() override {
    if (!npm_) GTEST_SKIP() << "skipped: npm is not there";
    static int number = 0;
    name_ = "monitor-test-" + std::to_string(getpid()) + "-" + std::to_string(number++);
    train_ = std::make_unique<Train>(name_);
  }
  void start(std::vector<std::string> settings = {}, const std::string& host = "127.0.0.1",
             const std::string& scheme = "http") {
    for (const char* setting : {"monitor.port=0", "monitor.foxglove_port=0", "monitor.expected=[]", "common.domain=79",
                                "monitor.picture_hz=30"}) {
      settings.emplace_back(setting);
    }
    settings.push_back("common.train_id=" + name_);
    monitor_.emplace(test::with_settings("railfix-monitor", settings),
                     test::Program::Options{kWork / "monitor.log", {}, {}});
    const std::string address = train_->address();
    const std::string before = scheme + "://" + host + ":";
    ASSERT_TRUE(address.starts_with(before)) << address << test::slurp(kWork / "monitor.log");
    port_ = address.substr(before.size(), address.size() - before.size() - 1);
  }
  /// Runs the client while the train lives on; gives what it said.
  std::string client(const std::string& action, const std::string& argument = "") {
    std::vector<std::string> arguments{"/usr/bin/env", "node", "client.mjs", action, port_};
    if (!argument.empty()) arguments.push_back(argument);
    test::Program program(arguments, {kWork / "said", {}, kWork});
    EXPECT_TRUE(train_->live_until([&] { return program.exit_code().has_value(); })) << action << " never ended";
    const auto said = test::slurp(kWork / "said");
    return said.substr(0, said.empty() ? 0 : said.size() - 1);
  }

  inline static const fs::path kSource = fs::path(RAILFIX_SOURCE_DIR) / "tests" / "integration" / "monitor";
  inline static const fs::path kWork = MONITOR_CLIENT_WORK;
  inline static bool npm_ = false;
  std::string name_;
  std::string port_;
  std::unique_ptr<Train> train_;
  std::optional<test::Program> monitor_;
};

TEST_F(MonitorLiveTest, ShowsTheTrainAndReadsPicturesOnlyWhileSomebodyLooks) {
  start();
  EXPECT_EQ(train_->preview_readers(), 0);
  bool read = false;
  test::Program viewer({"/usr/bin/env", "node", "client.mjs", "live", port_, name_}, {kWork / "said", {}, kWork});
  EXPECT_TRUE(train_->live_until([&] {
    read = read || train_->preview_readers() == 1;
    return viewer.exit_code().has_value();
  }));
  EXPECT_EQ(test::slurp(kWork / "said"), "ok\n");
  EXPECT_TRUE(read);
  EXPECT_TRUE(train_->live_until([&] { return train_->preview_readers() == 0; })) << "nobody looks any more";
  EXPECT_EQ(train_->frame_readers(), 0) << "full pictures are never read";
}

TEST_F(MonitorLiveTest, LetsInWhoMayAndSaysNoToOthers) {
  start({"monitor.token=secret"});
  EXPECT_EQ(client("refused", "403 /api/live origin=http://example.com"), "ok");
  EXPECT_EQ(client("refused", "400 / other.protocol"), "ok");
  EXPECT_EQ(client("refused", "400 /"), "ok");
  EXPECT_THAT(client("get", "/api/about"), HasSubstr("\"control\":\"token\""));
  EXPECT_THAT(client("get", "/../../etc/passwd"), ::testing::StartsWith("404"));
  EXPECT_THAT(client("get", "/api/map"), ::testing::StartsWith("404\nno map is in use"));
}

TEST_F(MonitorLiveTest, ListensOnlyWhereItIsTold) {
  start({"monitor.address=127.0.0.2"}, "127.0.0.2");
  EXPECT_EQ(client("reach", "127.0.0.2"), "reached");
  EXPECT_EQ(client("reach", "127.0.0.1"), "not reached");
  EXPECT_THAT(test::slurp(kWork / "monitor.log"), ::testing::Not(HasSubstr("everybody")));
}

TEST_F(MonitorLiveTest, SaysWhatItMeansToListenForOthers) {
  start({"monitor.address=0.0.0.0", "monitor.token=secret"}, "localhost");
  EXPECT_THAT(test::slurp(kWork / "monitor.log"),
              ::testing::AllOf(HasSubstr("everybody who reaches 0.0.0.0 sees the page"),
                               HasSubstr("control asks for the token, which travels as it is")));
}

TEST_F(MonitorLiveTest, SaysWhoMayControlWithoutAToken) {
  start({"monitor.address=0.0.0.0"}, "localhost");
  EXPECT_THAT(test::slurp(kWork / "monitor.log"), HasSubstr("control only from this computer at localhost, because "
                                                            "neither monitor.token nor monitor.token_file is set"));
  EXPECT_THAT(client("get", "/api/about"), HasSubstr("\"control\":\"open\""));
  EXPECT_THAT(client("get_from_elsewhere", "/api/about"), HasSubstr("\"control\":\"no_token\""));
}

TEST_F(MonitorLiveTest, SaysThatNobodyMayControl) {
  start({"monitor.control=false", "monitor.token=secret"});
  EXPECT_THAT(client("get", "/api/about"), HasSubstr("\"control\":\"off\""));
  EXPECT_THAT(client("get_from_elsewhere", "/api/about"), HasSubstr("\"control\":\"off\""));
}

TEST_F(MonitorLiveTest, TakesTheWordForControlFromAFile) {
  const auto word = kWork / "word";
  std::ofstream(word) << "secret\n";
  start({"monitor.address=0.0.0.0", "monitor.token_file=" + word.string()}, "localhost");
  EXPECT_THAT(client("get", "/api/about"), HasSubstr("\"control\":\"token\""));
  EXPECT_THAT(test::slurp(kWork / "monitor.log"),
              ::testing::AllOf(HasSubstr("control asks for the token"), ::testing::Not(HasSubstr("secret"))));
}

TEST_F(MonitorLiveTest, SpeaksTlsWithTheCertificateThatItIsGiven) {
  const std::string certificate = (kWork / "certificate.pem").string();
  const std::string key = (kWork / "key.pem").string();
  ASSERT_EQ(std::system(("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 1 -subj "
                         "/CN=monitor -addext subjectAltName=IP:127.0.0.1 -keyout '" +
                         key + "' -out '" + certificate + "' 2> '" + (kWork / "openssl.log").string() + "'")
                            .c_str()),
            0);
  start({"monitor.tls_certificate=" + certificate, "monitor.tls_key=" + key}, "127.0.0.1", "https");
  EXPECT_EQ(client("tls", certificate), "ok");
  EXPECT_EQ(client("reach", "127.0.0.1"), "not reached") << "nothing without TLS";
  const auto refused = test::run_program(
      test::with_settings("railfix-monitor", {"monitor.port=0", "monitor.foxglove_port=0", "common.domain=79",
                                              "common.train_id=" + name_ + "-other",
                                              "monitor.tls_certificate=" + certificate, "monitor.tls_key=/etc/hosts"}),
      30);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("monitor.tls_key /etc/hosts is no key in PEM that fits the certificate"));
}

TEST_F(MonitorLiveTest, SpeaksBothSubprotocolsOfFoxglove) {
  start();
  EXPECT_EQ(client("foxglove", "foxglove.websocket.v1"), "ok");
  EXPECT_EQ(client("foxglove", "foxglove.sdk.v1"), "ok");
  EXPECT_EQ(client("foxglove", "foxglove.websocket.v1,foxglove.sdk.v1"), "ok") << "as Lichtblick asks";
}

TEST_F(MonitorLiveTest, SaysWhenTheTrainIsNotWell) {
  start();
  const auto says = [&](const std::string& wanted) {
    return train_->live_until([&] { return client("get", "/healthz") == wanted; });
  };
  EXPECT_TRUE(says("200\nok\n"));
  train_->late_ns = 5'020'000'000;
  EXPECT_TRUE(says("503\nThe position that comes now is 5.0 s old: fusion is late, or the computers' clocks differ\n"));
  train_->late_ns = 0;
  train_->service_state = msg::STATE_FAILED;
  EXPECT_TRUE(says("503\nfusion has failed: no map\n"));
}

TEST_F(MonitorLiveTest, LetsGoOfAViewerThatTakesNothing) {
  start({"monitor.slow_client_s=1", "monitor.client_queue_mb=1"});
  EXPECT_EQ(client("slow"), "ok");
  EXPECT_THAT(test::slurp(kWork / "monitor.log"), HasSubstr("a viewer was disconnected: took nothing for 1 s"));
}

TEST_F(MonitorLiveTest, MetricsAlertsAndSettingsPassPromtool) {
  const fs::path own = fs::path(RAILFIX_SOURCE_DIR) / "build" / "tools" / "promtool";
  const std::string promtool = fs::exists(own) ? own.string() : "promtool";
  if (std::system((promtool + " --version > /dev/null 2>&1").c_str()) != 0)
    GTEST_SKIP() << "skipped: promtool is not there";
  const auto deploy = fs::path(RAILFIX_SOURCE_DIR) / "deploy" / "monitoring";
  const auto check = [&](const std::string& what) {
    const std::string command = "cd '" + deploy.string() + "' && " + promtool + " " + what + " > '" +
                                (kWork / "promtool.log").string() + "' 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << what << "\n" << test::slurp(kWork / "promtool.log");
  };
  check("check config prometheus.yml");
  check("check rules alerts.yml");
  check("test rules alerts_test.yml");
  start();
  std::string said;
  EXPECT_TRUE(train_->live_until([&] {
    said = client("get", "/metrics");
    return said.find("railfix_topic_samples_total{topic=\"track_view\"}") != std::string::npos;
  })) << "who reads /metrics looks";
  ASSERT_THAT(said, ::testing::StartsWith("200\n"));
  EXPECT_THAT(said, HasSubstr("railfix_topic_dropped_total{topic=\"train_state\"} 0\n"));
  EXPECT_THAT(said, HasSubstr("railfix_topic_rejected_total{topic=\"train_state\"} 0\n"));
  EXPECT_THAT(said, HasSubstr("railfix_topic_deadlines_missed_total{topic=\"train_state\"}"));
  std::ofstream(kWork / "metrics.txt") << said.substr(4);
  check("check metrics < '" + (kWork / "metrics.txt").string() + "'");
}

TEST_F(MonitorLiveTest, TakesTheNextPortWhenItsOwnIsTaken) {
  start();
  const std::string taken = port_;
  const auto refused = test::run_program(
      test::with_settings("railfix-monitor", {"monitor.port=" + taken, "monitor.port_search=0", "common.domain=79",
                                              "common.train_id=" + name_ + "-other"}),
      30);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("port " + taken + " of 127.0.0.1 is taken; set monitor.port to a free one"));
}

}  // namespace
}  // namespace railfix
