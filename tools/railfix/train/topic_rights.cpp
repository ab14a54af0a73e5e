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
      {"track_detector", {"track_view", "landmark_sighting"}},
      {"odometry", {"odometry_step"}},
      {"map_matcher", {"position_fix"}},
      {"fusion", {"train_state", "train_pose"}},
      {"tpr_publisher", {"train_position_report"}},
      {"recorder", {"recorder_status"}},
      {"monitor", {"service_control"}},
      {"onboard", {"onboard_status"}},
      {kOperator, {"service_control", "player_status"}}};
  static const std::vector<std::string> none;
  const auto found = topics.find(service);
  return found == topics.end() ? none : found->second;
}

}  // namespace railfix::tool
