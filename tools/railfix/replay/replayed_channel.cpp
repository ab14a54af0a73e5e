#include "replay/replayed_channel.hpp"

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

namespace railfix::tool {

namespace {

/// The topic under its name of now: what stands behind the slash is DDS's instance.
messaging::TopicInfo renamed(messaging::TopicInfo topic, const std::string& name) {
  topic.name = name.substr(0, name.find('/'));
  return topic;
}
std::string instance_of(const std::string& name) {
  const size_t slash = name.find('/');
  return slash == std::string::npos ? "" : name.substr(slash + 1);
}

void fill(msg::CameraFrame& frame, const msg::CameraPreview& picture, const cv::Mat& pixels) {
  frame.stamp_ns(picture.stamp_ns());
  frame.grabbed_ns(picture.grabbed_ns());
  frame.seq(picture.seq());
  frame.width_px(static_cast<uint32_t>(pixels.cols));
  frame.height_px(static_cast<uint32_t>(pixels.rows));
  frame.exposure_s(picture.exposure_s());
  frame.health(picture.health());
  std::copy(pixels.datastart, pixels.dataend, frame.data().begin());
}

}  // namespace

ReplayedChannel::ReplayedChannel(messaging::Participant& participant, const messaging::TopicInfo& topic,
                                 std::string written_as, bool as_jpeg)
    : type_(*topic.type),
      written_as_(std::move(written_as)),
      as_jpeg_(as_jpeg),
      sample_(topic.type->make()),
      writer_(participant, renamed(topic, written_as_), instance_of(written_as_)) {}

bool ReplayedChannel::prepare(PreparedSample& sample) const {
  if (!as_jpeg_) return true;
  msg::CameraPreview picture;
  if (!messaging::deserialize(sample.cdr, picture) || picture.jpeg().empty()) return false;
  sample.pixels = cv::imdecode(picture.jpeg(), cv::IMREAD_GRAYSCALE);
  if (sample.pixels.empty() || sample.pixels.total() > msg::CAMERA_MAX_PIXELS) return false;
  picture.jpeg().clear();
  sample.cdr = messaging::serialize(picture);
  return true;
}

bool ReplayedChannel::send(const PreparedSample& sample) {
  if (!as_jpeg_) return type_.deserialize(sample.cdr, sample_.get()) && writer_.write(sample_.get());
  msg::CameraPreview picture;
  return messaging::deserialize(sample.cdr, picture) && writer_.write_in_place([&](void* frame) {
    fill(*static_cast<msg::CameraFrame*>(frame), picture, sample.pixels);
  });
}

}  // namespace railfix::tool
