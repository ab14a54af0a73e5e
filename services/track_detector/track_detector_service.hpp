// camera_frame, camera_calibration, imu_sample in; track_view out, one for every picture, and landmark_sighting.
#pragma once

#include <memory>
#include <optional>

#include "service/service.hpp"
#include "track_detector/imu_roll.hpp"
#include "track_detector/landmark_finder.hpp"
#include "track_detector/mount_watch.hpp"
#include "track_detector/track_detector_config.hpp"

namespace railfix::track_detector {

class TrackDetectorService {
 public:
  using Config = TrackDetectorConfig;
  TrackDetectorService(const Config& config, service::Context& context);

 private:
  void calibrated(const msg::CameraCalibration& calibration);
  void restart();
  [[nodiscard]] std::string unusable() const;
  void pictured(const msg::CameraFrame& frame);
  void detect(const msg::CameraFrame& frame);
  void publish(const TrackObservation& observation, const msg::CameraFrame& frame);
  void find_landmarks(const cv::Mat& grey, const TrackObservation& observation, const msg::CameraFrame& frame);
  void tell(const TrackObservation& observation, int64_t stamp_ns);

  Config config_;
  service::Context& context_;
  messaging::Writer<msg::TrackView> writer_;
  messaging::Writer<msg::LandmarkSighting> sighting_writer_;
  std::unique_ptr<TrackDetector> detector_;  // nothing before the calibration is known
  std::unique_ptr<ImuRoll> imu_roll_;
  std::unique_ptr<MountWatch> watch_;
  std::unique_ptr<LandmarkFinder> finder_;
  std::optional<msg::CameraCalibration> calibration_;
  const char* why_unusable_ = nullptr;  // the calibration; null while there is none
  TrackObservation observation_;
  bool mount_known_ = false;
  uint64_t last_seq_ = 0;
  int64_t last_stamp_ns_ = 0;
  int64_t last_seen_ns_ = 0;
  std::string drift_;  // of the mount, as told last
  int64_t drift_ns_ = 0;
};

}  // namespace railfix::track_detector
