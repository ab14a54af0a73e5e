#include "messaging/topics.hpp"

#include "messaging/onboard_topic.hpp"

namespace railfix::messaging {

const std::vector<TopicInfo>& all_topics() {
  using namespace topics;
  static const std::vector<TopicInfo> table{info_of(camera_frame),
                                            info_of(camera_preview),
                                            info_of(camera_calibration),
                                            info_of(imu_sample),
                                            info_of(wheel_sample),
                                            info_of(gnss_fix),
                                            info_of(track_view),
                                            info_of(landmark_sighting),
                                            info_of(odometry_step),
                                            info_of(position_fix),
                                            info_of(train_state),
                                            info_of(train_pose),
                                            info_of(train_position_report),
                                            info_of(onboard_status),
                                            info_of(service_status),
                                            info_of(log_record),
                                            info_of(recorder_status),
                                            info_of(player_status),
                                            info_of(service_control),
                                            info_of(service_reply),
                                            info_of(data_clock),
                                            info_of(data_progress)};
  return table;
}

const TopicInfo* find_topic(const std::string& name) {
  const std::string base = name.substr(0, name.find('/'));
  for (const auto& topic : all_topics()) {
    if (topic.name == base) return &topic;
  }
  return nullptr;
}

}  // namespace railfix::messaging
