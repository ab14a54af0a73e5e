// Every topic of Railfix, once: name, type, quality of service, and how many samples may wait in front of a handler.
// Two that few need stand in onboard_topic.hpp and charge_topic.hpp.
#pragma once

#include <string>
#include <vector>

#include "idl/camera.h"
#include "idl/odometry.h"
#include "idl/operation.h"
#include "idl/pose.h"
#include "idl/position.h"
#include "idl/recorder.h"
#include "idl/sensors.h"
#include "idl/track.h"
#include "messaging/messaging.hpp"

namespace railfix::messaging {

namespace topics {

inline constexpr int64_t kMs = 1'000'000;

// Raw pictures stay on one host. Readers take best effort: a slow reader must not hold the camera back.
inline constexpr Topic<msg::CameraFrame> camera_frame{
    "camera_frame",
    "camera",
    {.reliable = false, .depth = 16, .deadline_ns = 0, .data_sharing = true, .asynchronous = true},
    4};
inline constexpr Topic<msg::CameraPreview> camera_preview{
    "camera_preview", "camera", {.reliable = false, .writer_reliable = false, .depth = 1, .asynchronous = true}, 4};
inline constexpr Topic<msg::CameraCalibration> camera_calibration{
    "camera_calibration", "camera", {.transient_local = true, .depth = 1, .max_instances = 8}, 8};

inline constexpr Topic<msg::ImuSample> imu_sample{"imu_sample", "sensors", {.depth = 400}, 4000};
inline constexpr Topic<msg::WheelSample> wheel_sample{"wheel_sample", "sensors", {.depth = 100}, 1000};
inline constexpr Topic<msg::GnssFix> gnss_fix{"gnss_fix", "sensors", {.depth = 10}, 100};

inline constexpr Topic<msg::TrackView> track_view{"track_view", "track", {.depth = 32}, 64};
inline constexpr Topic<msg::LandmarkSighting> landmark_sighting{"landmark_sighting", "track", {.depth = 100}, 100};
inline constexpr Topic<msg::OdometryStep> odometry_step{"odometry_step", "odometry", {.depth = 32}, 64};
inline constexpr Topic<msg::PositionFix> position_fix{"position_fix", "position", {.depth = 100}, 100};

// Of several fusions, or tpr_publishers, one is in charge and alone sends (common/service/charge.hpp).
inline constexpr Topic<msg::TrainState> train_state{
    "train_state", "position", {.depth = 16, .exclusive = true, .deadline_ns = 200 * kMs}, 64};
inline constexpr Topic<msg::TrainPose> train_pose{"train_pose", "position", {.depth = 16, .exclusive = true}, 64};
inline constexpr Topic<msg::TrainPositionReport> train_position_report{
    "train_position_report", "position", {.transient_local = true, .depth = 32}, 64};

inline constexpr Topic<msg::ServiceStatus> service_status{
    "service_status", "operation", {.transient_local = true, .depth = 1, .max_instances = 64}, 256};
inline constexpr Topic<msg::LogRecord> log_record{"log_record", "operation", {.depth = 256, .asynchronous = true}, 256};
inline constexpr Topic<msg::RecorderStatus> recorder_status{
    "recorder_status", "operation", {.transient_local = true, .depth = 1}, 16};
inline constexpr Topic<msg::PlayerStatus> player_status{
    "player_status", "operation", {.transient_local = true, .depth = 1}, 16};
inline constexpr Topic<msg::ControlRequest> service_control{"service_control", "operation", {.depth = 16}, 16};
inline constexpr Topic<msg::ControlReply> service_reply{"service_reply", "operation", {.depth = 16}, 16};
inline constexpr Topic<msg::DataClock> data_clock{"data_clock", "operation", {.depth = 32}, 64};
inline constexpr Topic<msg::DataProgress> data_progress{"data_progress", "operation", {.depth = 64}, 256};

}  // namespace topics

/// All but in_charge, type erased, for tools that handle every topic (recorder, replay, `railfix topics`).
const std::vector<TopicInfo>& all_topics();
/// Nullptr when there is none of this name; an instance ("camera_frame/cam0") finds its topic.
const TopicInfo* find_topic(const std::string& name);
/// All profiles as Fast DDS XML: the text of deploy/qos/railfix_qos.xml.
std::string qos_xml();

/// One sample as CDR with its four-byte encapsulation header, and back (nothing when the bytes are not such a sample).
template <class T>
std::vector<uint8_t> serialize(const T& sample) {
  return type_of<T>().serialize(&sample);
}
template <class T>
bool deserialize(const std::vector<uint8_t>& cdr, T& sample) {
  return type_of<T>().deserialize(cdr, &sample);
}

}  // namespace railfix::messaging
