#include "monitor/foxglove_messages.hpp"

#include <google/protobuf/descriptor.pb.h>

#include <cmath>

#include "core/time.hpp"
#include "idl/foxglove.pb.h"

namespace railfix::monitor {
namespace {

using nlohmann::json;

void set_time(google::protobuf::Timestamp* time, int64_t stamp_ns) {
  time->set_seconds(stamp_ns / core::kNsPerSecond);
  time->set_nanos(static_cast<int32_t>(stamp_ns % core::kNsPerSecond));
}

// The files that describe a message, those that it needs first.
void add_file(const google::protobuf::FileDescriptor& file, google::protobuf::FileDescriptorSet& set) {
  for (const auto& known : set.file()) {
    if (known.name() == file.name()) return;
  }
  for (int i = 0; i < file.dependency_count(); ++i) add_file(*file.dependency(i), set);
  file.CopyTo(set.add_file());
}

template <class Message>
FoxgloveChannel drawn_channel(const std::string& topic, bool newest_only) {
  google::protobuf::FileDescriptorSet set;
  add_file(*Message::descriptor()->file(), set);
  return {topic, "protobuf", Message::descriptor()->full_name(), set.SerializeAsString(), "protobuf", newest_only};
}

void add_line(foxglove::ImageAnnotations& annotations, const json& points, int64_t stamp_ns) {
  if (points.size() < 2) return;
  auto* line = annotations.add_points();
  set_time(line->mutable_timestamp(), stamp_ns);
  line->set_type(foxglove::PointsAnnotation::LINE_STRIP);
  for (const auto& point : points) {
    auto* to = line->add_points();
    to->set_x(point[0].get<double>());
    to->set_y(point[1].get<double>());
  }
  auto* colour = line->mutable_outline_color();
  colour->set_r(1);
  colour->set_g(0.8);
  colour->set_a(1);
  line->set_thickness(3);
}

}  // namespace

FoxgloveChannel cdr_channel(const std::string& topic, const std::string& type, const std::string& idl) {
  return {topic, "cdr", type, idl, "omgidl", topic.starts_with("camera_preview/")};
}

std::vector<FoxgloveChannel> drawn_channels(const std::set<std::string>& cameras) {
  std::vector<FoxgloveChannel> channels{drawn_channel<foxglove::LocationFix>(kFoxglovePlace, false),
                                        drawn_channel<foxglove::Log>(kFoxgloveLog, false)};
  for (const auto& camera : cameras) {
    channels.push_back(drawn_channel<foxglove::CompressedImage>(foxglove_picture(camera), true));
    channels.push_back(drawn_channel<foxglove::ImageAnnotations>(foxglove_rails(camera), true));
  }
  return channels;
}

std::string compressed_image(const msg::CameraPreview& preview, const std::string& camera) {
  foxglove::CompressedImage image;
  set_time(image.mutable_timestamp(), preview.stamp_ns());
  image.set_frame_id(camera);
  image.set_format("jpeg");
  image.set_data(preview.jpeg().data(), preview.jpeg().size());
  return image.SerializeAsString();
}

std::string image_annotations(const json& view) {
  foxglove::ImageAnnotations annotations;
  const auto stamp_ns = view["stamp_ns"].get<int64_t>();
  if (view["rails"].is_object()) {
    add_line(annotations, view["rails"]["left"], stamp_ns);
    add_line(annotations, view["rails"]["right"], stamp_ns);
  }
  for (const auto& landmark : view["landmarks"]) {
    auto* text = annotations.add_texts();
    set_time(text->mutable_timestamp(), stamp_ns);
    text->mutable_position()->set_x(landmark["x"].get<double>());
    text->mutable_position()->set_y(landmark["y"].get<double>());
    const auto name = landmark["name"].get<std::string>();
    text->set_text(name.empty() ? landmark["kind"].get<std::string>() : name);
    text->set_font_size(12);
    for (auto set :
         {&foxglove::Color::set_r, &foxglove::Color::set_g, &foxglove::Color::set_b, &foxglove::Color::set_a}) {
      (text->mutable_text_color()->*set)(1);
    }
  }
  return annotations.SerializeAsString();
}

std::string location_fix(const msg::TrainState& state, const msg::TrainPose* pose) {
  if (!std::isfinite(state.lat_deg()) || !std::isfinite(state.lon_deg()) || state.track_known() == 0) return "";
  foxglove::LocationFix fix;
  set_time(fix.mutable_timestamp(), state.stamp_ns());
  fix.set_frame_id("train");
  fix.set_latitude(state.lat_deg());
  fix.set_longitude(state.lon_deg());
  if (pose != nullptr && std::isfinite(pose->height_m())) fix.set_altitude(pose->height_m());
  // A circle of the sigma along the track, which is the larger one.
  const double variance_m2 = state.sigma_m() * state.sigma_m();
  for (int i = 0; i < 9; ++i) fix.add_position_covariance(i % 4 == 0 ? variance_m2 : 0);
  fix.set_position_covariance_type(foxglove::LocationFix::APPROXIMATED);
  return fix.SerializeAsString();
}

std::string foxglove_log(const msg::LogRecord& record) {
  foxglove::Log log;
  set_time(log.mutable_timestamp(), record.stamp_ns());
  // trace, debug, info, warning, error, critical
  constexpr std::array kLevels{foxglove::Log::DEBUG,   foxglove::Log::DEBUG, foxglove::Log::INFO,
                               foxglove::Log::WARNING, foxglove::Log::ERROR, foxglove::Log::FATAL};
  log.set_level(kLevels[std::min<size_t>(record.level(), kLevels.size() - 1)]);
  log.set_message(record.text().c_str());
  log.set_name(record.service().c_str());
  return log.SerializeAsString();
}

}  // namespace railfix::monitor
