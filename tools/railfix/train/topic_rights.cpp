#include "train/topic_rights.hpp"

#include <map>

namespace railfix::tool {

const std::vector<std::string>& topics_written_by_all() {
  static const std::vector<std::string> topics{"service_status", "log_record", "service_reply", "data_progress"};
  return topics;
}

const std::vector<std::string>& topics_written_by(const std::string& service) {
  static const std::map<std::string, std::vector<std::string>> topics{
      {"frame_grabber", {"camera_frame/*", "camera_preview/*", "camera_calibration", "data_clock"}},
      {"sensor_gateway", {"imu_sample", "wheel_sample", "gnss_fix"}},
      {"track_detector", {"track_view", "landmark_sighting", "in_charge"}},
      {"odometry", {"odometry_step", "in_charge"}},
      {"map_matcher", {"position_fix", "in_charge"}},
      {"fusion", {"train_state", "train_pose", "in_charge"}},
      {"tpr_publisher", {"train_position_report", "in_charge"}},
      {"recorder", {"recorder_status"}},
      {"monitor", {"service_control"}},
      {"onboard", {"onboard_status"}},
      {kOperator, {"service_control", "player_status"}}};
  static const std::vector<std::string> none;
  const auto found = topics.find(service);
  return found == topics.end() ? none : found->second;
}

std::vector<std::string> topics_read_by(const std::string& service) {
  static const std::map<std::string, std::vector<std::string>> topics{
      {"frame_grabber", {}},
      {"sensor_gateway", {}},
      {"track_detector", {"camera_frame/*", "camera_calibration", "imu_sample"}},
      {"odometry", {"camera_frame/*", "camera_calibration", "track_view"}},
      {"map_matcher", {"landmark_sighting", "track_view", "odometry_step", "imu_sample", "gnss_fix", "train_state"}},
      {"fusion", {"odometry_step", "camera_calibration", "imu_sample", "wheel_sample", "gnss_fix", "position_fix"}},
      {"tpr_publisher", {"train_state", "onboard_status"}},
      {"onboard", {}}};
  const auto found = topics.find(service);
  if (found == topics.end()) return {"*"};  // recorder, monitor, the operator's tools
  std::vector<std::string> read = found->second;
  for (const auto& more : {topics_written_by(service), topics_written_by_all()})
    read.insert(read.end(), more.begin(), more.end());
  read.insert(read.end(), {"service_control", "data_clock"});
  return read;
}

}  // namespace railfix::tool
