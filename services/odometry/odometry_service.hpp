// camera_frame, camera_calibration, track_view in; odometry_step out.
#pragma once

#include <memory>
#include <vector>

#include "odometry/odometry_config.hpp"
#include "odometry/picture_views.hpp"
#include "service/service.hpp"

namespace railfix::odometry {

class OdometryService {
 public:
  using Config = OdometryConfig;
  OdometryService(const Config& config, service::Context& context);

 private:
  struct Waiting {  // a picture whose track_view has not come
    int64_t stamp_ns = 0;
    int64_t grabbed_ns = 0;
    uint64_t frame_seq = 0;
    uint32_t health = 0;
    float exposure_s = 0;  // 0 = not known
    int64_t until_ns = 0;  // monotonic
    cv::Mat grey;
  };
  void calibrated(const msg::CameraCalibration& calibration);
  void restart();
  void pictured(const msg::CameraFrame& frame);
  void measure(const Waiting& waiting, const msg::TrackView* view);
  void take_pose(const Waiting& waiting, const msg::TrackView* view, MousePicture& picture);
  void publish(const MouseStep& step, const Waiting& waiting);
  void tell(const MouseStep& step, uint32_t picture_health);
  void watch_stamps(const MouseStep& step, const Waiting& waiting);
  cv::Mat spare();

  Config config_;
  service::Context& context_;
  messaging::Writer<msg::OdometryStep> writer_;
  geometry::Intrinsics intrinsics_;
  geometry::CameraPose mount_;
  bool mount_known_ = false;
  std::vector<uint8_t> calibration_;   // as it was said
  std::unique_ptr<TrainMouse> mouse_;  // nothing before the calibration is known
  PictureViews<Waiting, msg::TrackView> views_;
  std::vector<cv::Mat> spare_;  // picture buffers to use again
  geometry::CameraPose last_pose_;
  int64_t last_pose_ns_ = 0;
  double curvature_per_m_ = 0;
  double vertical_curvature_per_m_ = 0;
  MouseStep last_step_;
  uint64_t last_seq_ = 0;
  int64_t last_valid_ns_ = 0;
  uint64_t last_measured_seq_ = 0;
  int64_t last_measured_ns_ = 0;
  double last_off_m_ = 0;
  int64_t out_of_order_ns_ = 0;  // when pictures were in the wrong order last, 0 = never
};

}  // namespace railfix::odometry
