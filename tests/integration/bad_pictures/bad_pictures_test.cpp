// What track_detector and odometry, as programs, make of pictures that frame_grabber says are bad: the test is the
// camera.
#include <gmock/gmock.h>

#include <cstring>
#include <map>
#include <opencv2/imgproc.hpp>

#include "core/time.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"
#include "unit/track_detector/synthetic_picture.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace topics = messaging::topics;

constexpr int kDomain = 86;
constexpr int64_t kPeriodNs = 50'000'000;
constexpr double kPerPictureM = 0.4;
constexpr double kTextureDepthM = 0.18;
const geometry::Intrinsics kCamera{575, 575, 319.5, 255.5, 0, 0, 0, 0, 640, 512};
const geometry::CameraPose kMount{0, 0.15, 0, 0, 2.5};
constexpr size_t kRollVariance = 0;
constexpr size_t kPitchVariance = 7;

/// Two rails over ground with blotches, `distance_m` into the run.
cv::Mat picture(double distance_m) {
  static const cv::Mat ground = [] {
    cv::Mat tile(2048, 512, CV_8UC1);
    cv::RNG random(5);
    random.fill(tile, cv::RNG::UNIFORM, 30, 170);
    cv::GaussianBlur(tile, tile, {}, 1.5);
    cv::normalize(tile, tile, 40, 140, cv::NORM_MINMAX);
    return tile;
  }();
  constexpr double kTexelM = 0.02;
  const geometry::View view(kCamera, kMount);
  cv::Mat grey(kCamera.height_px, kCamera.width_px, CV_8UC1, cv::Scalar(150));
  for (int v = 0; v < grey.rows; ++v) {
    for (int u = 0; u < grey.cols; ++u) {
      const auto head = view.on_plane({u, v}, 0);
      if (!head || head->x() > 60) continue;
      const auto low = view.on_plane({u, v}, -kTextureDepthM);
      const double blur_m = head->x() / kCamera.fu_px;
      double rail = 0;
      for (const double side : {1.0, -1.0})
        rail += track_detector::test::covered(side * head->y(), 1.435 / 2, 0.07, blur_m);
      const int row = static_cast<int>((low->x() + distance_m) / kTexelM) % ground.rows;
      const int column = static_cast<int>(low->y() / kTexelM + 4000) % ground.cols;
      grey.at<uint8_t>(v, u) = static_cast<uint8_t>(ground.at<uint8_t>(row, column) * (1 - rail) + 200 * rail);
    }
  }
  return grey;
}

class BadPictures : public ::testing::Test, protected test::OnTrain {
 protected:
  BadPictures()
      : OnTrain("bad-" + std::to_string(getpid()), kDomain),
        calibrations_(participant_, topics::camera_calibration),
        frames_(participant_, topics::camera_frame, "cam0"),
        detector_(test::with_settings("railfix-track-detector", settings({}))),
        odometry_(test::with_settings("railfix-odometry",
                                      settings({"odometry.max_wait_ms=1000", "odometry.texture_depth_m=0.18"}))) {
    listen(topics::track_view, [this](const msg::TrackView& view) { views_[view.frame_seq()] = view; });
    listen(topics::odometry_step, [this](const msg::OdometryStep& step) { steps_[step.frame_seq()] = step; });
    listen(topics::service_status, [this](const msg::ServiceStatus& one) { status_[one.service().c_str()] = one; });
  }

  [[nodiscard]] std::vector<std::string> settings(std::vector<std::string> more) const {
    more.insert(more.end(),
                {"common.train_id=" + train_, "common.domain=" + std::to_string(kDomain), "common.log_level=error"});
    return more;
  }
  void SetUp() override {
    msg::CameraCalibration c;
    c.camera("cam0");
    c.fu_px(kCamera.fu_px);
    c.fv_px(kCamera.fv_px);
    c.cu_px(kCamera.cu_px);
    c.cv_px(kCamera.cv_px);
    c.height_m(kMount.height_m);
    c.pitch_rad(kMount.pitch_rad);
    c.width_px(640);
    c.height_px(512);
    c.mount_known(true);
    calibrations_.write(c);
    // Pictures until both answer: then everybody has found everybody.
    ASSERT_TRUE(run_until([this] {
      send(0);
      for (int i = 0; i < 20 && !answered(); ++i) queue_.run_one(core::monotonic_ns() + 20'000'000);
      return answered() && steps_[seq_].valid() != 0;
    }));
  }
  void send(uint32_t health, int64_t later_ns = kPeriodNs) {
    stamp_ns_ += later_ns;
    distance_m_ += kPerPictureM;
    ++seq_;
    const cv::Mat grey = picture(distance_m_);
    ASSERT_TRUE(frames_.write_in_place([&](msg::CameraFrame& frame) {
      std::memcpy(frame.data().data(), grey.data, grey.total());
      frame.stamp_ns(stamp_ns_);
      frame.grabbed_ns(core::wall_ns());
      frame.seq(seq_);
      frame.width_px(640);
      frame.height_px(512);
      frame.exposure_s(0.001F);
      frame.health(health);
    }));
  }
  [[nodiscard]] bool answered() const { return views_.contains(seq_) && steps_.contains(seq_); }
  /// The answers to one more picture.
  void show(uint32_t health, int64_t later_ns = kPeriodNs) {
    send(health, later_ns);
    ASSERT_TRUE(run_until([this] { return answered(); })) << "no answer to " << seq_;
  }
  [[nodiscard]] const msg::TrackView& view() { return views_[seq_]; }
  [[nodiscard]] const msg::OdometryStep& step() { return steps_[seq_]; }
  [[nodiscard]] bool says(const std::string& service, const std::string& words) {
    return run_until([&] { return std::string(status_[service].reason().c_str()).find(words) != std::string::npos; });
  }

  messaging::Writer<msg::CameraCalibration> calibrations_;
  messaging::Writer<msg::CameraFrame> frames_;
  test::Program detector_;
  test::Program odometry_;
  std::map<uint64_t, msg::TrackView> views_;
  std::map<uint64_t, msg::OdometryStep> steps_;
  std::map<std::string, msg::ServiceStatus> status_;
  uint64_t seq_ = 0;
  int64_t stamp_ns_ = 1'700'000'000 * core::kNsPerSecond;
  double distance_m_ = 0;
};

TEST_F(BadPictures, DoubtfulOnesAreMeasuredWithWiderSigmas) {
  // On a busy computer odometry may have to do without a view now and then: its sigma is another one then.
  constexpr int kPictures = 3;
  double good_step_m = 1e9;
  for (int i = 0; i < kPictures; ++i) {
    show(0);
    ASSERT_TRUE(view().seen_left() && view().seen_right() && step().valid());
    good_step_m = std::min(good_step_m, step().step_sigma_m());
  }
  const double good_roll = view().covariance()[kRollVariance];
  const double good_pitch = view().covariance()[kPitchVariance];
  for (const uint32_t health :
       {msg::PICTURE_DARK, msg::PICTURE_SATURATED, msg::PICTURE_COVERED, msg::PICTURE_BLURRED}) {
    double step_m = 0;
    for (int i = 0; i < kPictures; ++i) {
      show(health);
      ASSERT_TRUE(view().seen_left() && view().seen_right() && step().valid()) << health;
      EXPECT_NEAR(view().covariance()[kRollVariance], 9 * good_roll, good_roll) << health;
      EXPECT_GT(view().covariance()[kPitchVariance], 4 * good_pitch) << health;
      step_m = std::max(step_m, step().step_sigma_m());
    }
    EXPECT_GT(step_m, 2 * good_step_m) << health;
  }
}

TEST_F(BadPictures, FrozenOnesAreNotMeasured) {
  show(msg::PICTURE_FROZEN);
  EXPECT_FALSE(view().seen_left() || view().seen_right());
  EXPECT_NEAR(view().height_m(), kMount.height_m, 1e-9) << "the mount, where nothing is seen";
  EXPECT_GT(view().covariance()[kPitchVariance], 1e-6);
  EXPECT_FALSE(step().valid());
  EXPECT_EQ(step().mode(), msg::ODOMETRY_BLIND);
  for (int i = 0; i < 25; ++i) show(msg::PICTURE_FROZEN);
  EXPECT_TRUE(says("track_detector", "rails not seen: the camera sends the same picture again"));
  EXPECT_TRUE(says("odometry", "blind: the camera sends the same picture again"));
}

TEST_F(BadPictures, OnesOutOfOrderAreNotMeasuredAndDisturbNothing) {
  show(0);
  show(msg::PICTURE_OUT_OF_ORDER, -3 * kPeriodNs);
  EXPECT_FALSE(view().seen_left() || view().seen_right());
  EXPECT_FALSE(step().valid());
  show(0, 5 * kPeriodNs);
  EXPECT_TRUE(view().seen_left() && view().seen_right());
  EXPECT_TRUE(step().valid());
}

}  // namespace
}  // namespace railfix
