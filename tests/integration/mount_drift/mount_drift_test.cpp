// A camera that is knocked by half a degree on the way: frame_grabber and track_detector as programs, over DDS.
#include <gmock/gmock.h>

#include <map>

#include "core/time.hpp"
#include "core/units.hpp"
#include "messaging/connected.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"
#include "unit/dataset/temporary_folder.hpp"
#include "unit/track_detector/synthetic_picture.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace topics = messaging::topics;

constexpr int kDomain = 84;
constexpr double kPatienceS = 120;
constexpr int kGood = 60;      // pictures, one a second
constexpr int kKnocked = 110;  // behind them
constexpr double kKnockRad = 0.5 / 57.29578;
const geometry::Intrinsics kCamera{575, 575, 319.5, 255.5, 0, 0, 0, 0, 640, 512};

class MountDrift : public testing::TemporaryFolder, protected test::OnTrain {
 protected:
  MountDrift() : OnTrain("drift-" + std::to_string(getpid()), kDomain) {
    listen(topics::track_view, [this](const msg::TrackView& view) {
      drifted_[view.stamp_ns() / core::kNsPerSecond] = view.mount_drifted() != 0;
    });
    listen(topics::service_status, [this](const msg::ServiceStatus& one) { status_[one.service().c_str()] = one; });
  }

  void SetUp() override {
    TemporaryFolder::SetUp();
    std::string list = "#timestamp [ns],filename\n";
    const cv::Mat good = picture(0);
    const cv::Mat knocked = picture(kKnockRad);
    std::filesystem::create_directories(root_ / "mav0/cam0/data");
    for (int i = 0; i < kGood + kKnocked; ++i) {
      cv::Mat one = (i < kGood ? good : knocked).clone();
      one.at<uint8_t>(0, i) ^= 1U;  // no two pictures of a camera are the same
      const std::string name = std::to_string(i) + ".pgm";
      cv::imwrite((root_ / "mav0/cam0/data" / name).string(), one);
      list += std::to_string((i + 1) * core::kNsPerSecond) + "," + name + "\n";
    }
    write("mav0/cam0/data.csv", list);
    write("mav0/cam0/sensor.yaml",
          "resolution: [640, 512]\nintrinsics: [575, 575, 319.5, 255.5]\n"
          "mount: {height_m: 2.6, pitch_rad: 0.1, yaw_rad: 0, roll_rad: 0, lateral_m: 0}\n");
  }
  static cv::Mat picture(double knock_rad) {
    track_detector::test::Scene scene;
    scene.shape.camera = {0, 0.1 + knock_rad, 0, 0, 2.6};
    return track_detector::test::render(scene, kCamera);
  }
  [[nodiscard]] test::Program service(const std::string& program, std::vector<std::string> settings) const {
    settings.insert(settings.end(), {"common.train_id=" + train_, "common.domain=" + std::to_string(kDomain),
                                     "common.log_level=error"});
    return test::Program(test::with_settings(program, settings));
  }
  [[nodiscard]] std::string reason() { return status_["track_detector"].reason().c_str(); }

  std::map<int64_t, bool> drifted_;  // by picture
  std::map<std::string, msg::ServiceStatus> status_;
};

TEST_F(MountDrift, IsToldWithNumbersAndWhatToDo) {
  messaging::Writer<msg::ControlRequest> control(participant_, topics::service_control);
  const auto detector = service("railfix-track-detector", {"common.lock_step=true"});
  const auto grabber =
      service("railfix-frame-grabber", {"frame_grabber.source=" + root_.string(), "frame_grabber.pace=lossless",
                                        "frame_grabber.wait_for=[track_detector]"});
  ASSERT_TRUE(run_until(
      [this] { return status_.size() == 2 && messaging::all_connected(participant_.connections(), status_); }));
  msg::ControlRequest request;
  request.service("frame_grabber");
  request.command("start");
  control.write(request);
  ASSERT_TRUE(run_until([this] { return drifted_.contains(kGood + kKnocked); }, kPatienceS))
      << "the last picture did not come; " << reason();
  (void)run_until(
      [this] { return reason().find("pitch by +0.4") != std::string::npos || !drifted_.at(kGood + kKnocked); });
  for (const auto& [picture, drift] : drifted_) {
    if (picture <= kGood) {
      EXPECT_FALSE(drift) << "false alarm at picture " << picture;
    }
  }
  EXPECT_TRUE(drifted_.at(kGood + kKnocked));
  EXPECT_THAT(reason(), HasSubstr("the camera has moved in its mount: pitch by +0.4"));
  EXPECT_THAT(reason(), HasSubstr("run railfix calibrate mount again"));
}

}  // namespace
}  // namespace railfix
