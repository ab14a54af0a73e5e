// A train on two computers: the sensors' side in the cab, where this process is, too.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "support/program.hpp"
#include "support/run_until.hpp"
#include "support/two_hosts.hpp"

namespace railfix {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using test::TwoHosts;

inline constexpr int kDomain = 91;
inline constexpr uint32_t kWidthPx = 1920;
inline constexpr uint32_t kHeightPx = 1200;

// This process is in the cab: Fast DDS takes all participants of a process for one computer's.
class TwoHostsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!hosts_.ready()) GTEST_SKIP() << "skipped: two network namespaces need root and the program ip (iproute2)";
    cab_ = join_in_cab(train_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::unique_ptr<messaging::Participant> join_in_cab(const std::string& train) {
    return hosts_.on(TwoHosts::cab, [&] {
      return std::make_unique<messaging::Participant>(TwoHosts::network(TwoHosts::cab, train, kDomain));
    });
  }
  std::unique_ptr<test::Program> start(TwoHosts::Host host, const std::string& program,
                                       const std::vector<std::string>& more = {}) {
    std::vector<std::string> settings{"common.train_id=" + train_,
                                      "common.domain=" + std::to_string(kDomain),
                                      "common.log_level=error",
                                      std::string("common.host=") + (host == TwoHosts::cab ? "cab" : "coach"),
                                      std::string("common.interfaces=[") + TwoHosts::kInterface[host] + "]",
                                      std::string("common.peers=[") + TwoHosts::kAddress[1 - host] + "]"};
    settings.insert(settings.end(), more.begin(), more.end());
    return hosts_.on(host, [&] { return std::make_unique<test::Program>(test::with_settings(program, settings)); });
  }
  // `railfix topics hz` in the coach; what it says goes into a file.
  std::unique_ptr<test::Program> count_in_coach(const std::string& topic, const fs::path& file) {
    return hosts_.on(TwoHosts::coach, [&] {
      return std::make_unique<test::Program>(std::vector<std::string>{"railfix", "topics", "hz", topic, "--train",
                                                                      train_, "--domain", std::to_string(kDomain)},
                                             test::Program::Options{file, {}, {}});
    });
  }
  template <class Condition>
  bool run_until(Condition condition) {
    return test::run_until(queue_, condition);
  }

  const std::string train_ = "two-hosts-" + std::to_string(getpid());
  const fs::path folder_ = fs::temp_directory_path() / train_;
  TwoHosts hosts_;
  messaging::Queue queue_;
  std::unique_ptr<messaging::Participant> cab_;
};

// Motion as the camera would measure it, 30 times a second, with a picture of full size each time.
class Camera {
 public:
  explicit Camera(messaging::Participant& participant)
      : frames_(participant, topics::camera_frame, "cam0"), steps_(participant, topics::odometry_step) {}
  static constexpr double kSpeedMps = 10;
  /// Travelled at the picture of this stamp; nothing when there was none.
  [[nodiscard]] std::optional<double> way_m(int64_t stamp_ns) const {
    const auto found = ways_m_.find(stamp_ns);
    return found == ways_m_.end() ? std::nullopt : std::optional(found->second);
  }
  /// At the last picture.
  [[nodiscard]] double way_m() const { return way_m_; }
  [[nodiscard]] bool heard() const { return frames_.matched_readers() > 0 && steps_.matched_readers() > 0; }
  [[nodiscard]] int listeners() const { return steps_.matched_readers(); }
  void shoot() {
    ++seq_;
    frames_.write_in_place([&](msg::CameraFrame& frame) {
      frame.seq(seq_);
      frame.width_px(kWidthPx);
      frame.height_px(kHeightPx);
      std::fill_n(frame.data().begin(), kWidthPx * kHeightPx, static_cast<uint8_t>(seq_));
    });
    step();
  }
  void step() {
    const int64_t now_ns = core::wall_ns();
    msg::OdometryStep step;
    step.stamp_ns(now_ns);
    step.reference_stamp_ns(last_ns_);
    step.step_m(last_ns_ == 0 ? 0 : speed_mps(now_ns) * core::seconds(now_ns - last_ns_));
    step.step_sigma_m(0.01);
    step.valid(last_ns_ == 0 ? 0 : 1);
    step.mode(msg::ODOMETRY_KEYFRAME);
    steps_.write(step);
    way_m_ += step.step_m();
    ways_m_[now_ns] = way_m_;
    last_ns_ = now_ns;
  }

 private:
  /// It stands at first, as a train does whose fusion believes `fusion.start`.
  [[nodiscard]] double speed_mps(int64_t now_ns) const {
    const double since_s = core::seconds(now_ns - ways_m_.begin()->first);
    return std::clamp((since_s - kStandsS) * kAccelerationMps2, 0.0, kSpeedMps);
  }
  static constexpr double kStandsS = 0.5;
  static constexpr double kAccelerationMps2 = 2;
  messaging::Writer<msg::CameraFrame> frames_;
  messaging::Writer<msg::OdometryStep> steps_;
  uint64_t seq_ = 0;
  int64_t last_ns_ = 0;
  double way_m_ = 0;
  std::map<int64_t, double> ways_m_;
};

}  // namespace railfix
