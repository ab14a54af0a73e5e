// frame_grabber as a program with a live camera, and what it sends.
#pragma once

#include <gmock/gmock.h>

#include "support/on_train.hpp"
#include "support/program.hpp"
#include "unit/dataset/temporary_folder.hpp"

namespace railfix {

class LiveCamera : public railfix::testing::TemporaryFolder, protected test::OnTrain {
 protected:
  static constexpr int kDomain = 83;
  LiveCamera() : OnTrain("live-" + std::to_string(getpid()), kDomain) {
    listen(
        messaging::topics::camera_frame, [this](const msg::CameraFrame& frame) { take(frame); }, "cam0");
    listen(messaging::topics::service_status, [this](const msg::ServiceStatus& status) { status_ = status; });
    listen(messaging::topics::camera_calibration, [this](const msg::CameraCalibration& one) { calibration_ = one; });
  }

  struct Frame {
    uint64_t seq;
    int64_t stamp_ns;
    int64_t grabbed_ns;
    uint32_t width_px;
    uint32_t height_px;
    uint32_t health;
    float exposure_s;
  };
  void take(const msg::CameraFrame& f) {
    frames_.push_back({f.seq(), f.stamp_ns(), f.grabbed_ns(), f.width_px(), f.height_px(), f.health(), f.exposure_s()});
  }
  std::unique_ptr<test::Program> grabber(const std::string& source, std::vector<std::string> more) {
    std::vector<std::string> sets{"common.train_id=" + train_, "common.domain=" + std::to_string(kDomain),
                                  "common.log_level=error", "frame_grabber.source=" + source};
    sets.insert(sets.end(), more.begin(), more.end());
    return std::make_unique<test::Program>(test::with_settings("railfix-frame-grabber", sets));
  }
  [[nodiscard]] std::string reason() const { return status_.reason().c_str(); }
  void expect_growing_stamps() const {
    for (size_t i = 1; i < frames_.size(); ++i) {
      EXPECT_GT(frames_[i].stamp_ns, frames_[i - 1].stamp_ns) << i;
      EXPECT_GT(frames_[i].seq, frames_[i - 1].seq) << i;
    }
  }

  std::vector<Frame> frames_;
  msg::ServiceStatus status_;
  std::optional<msg::CameraCalibration> calibration_;
};

}  // namespace railfix
