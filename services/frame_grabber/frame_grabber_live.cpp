// The part of the service that deals with live cameras.
#include "core/time.hpp"
#include "frame_grabber/frame_grabber_service.hpp"

namespace railfix::frame_grabber {

/// The camera may be switched on later than the train: nothing here waits for it.
void FrameGrabberService::prepare_live() {
  if (!config_.calibration.empty()) {
    const auto calibration = core::value_or_throw(dataset::read_calibration(config_.calibration));
    size_ = {calibration.intrinsics.width_px, calibration.intrinsics.height_px};
    publish_calibration(calibration);
  }
  LiveEvents events;
  events.connected = [this](const std::string& what) {
    context_.post([this, what] {
      context_.log().info("{}", what);
      bad_packets_ = 0;
    });
  };
  events.gone = [this](const std::string& why) { context_.post([this, why] { context_.health().degraded(why); }); };
  events.picture = [this](RawPicture picture) {
    context_.post([this, picture = std::move(picture)] { shoot(picture); });
  };
  events.lost = [this](uint64_t pictures) { context_.post([this, pictures] { context_.health().dropped(pictures); }); };
  context_.health().ready();
  feed_ = std::make_unique<LiveFeed>(std::move(live_camera_), config_.live_config(), std::move(events));
}

void FrameGrabberService::shoot(const RawPicture& picture) {
  const int64_t grabbed_ns = core::wall_ns();
  context_.health().input();
  if (picture.lost > 0) context_.health().dropped(picture.lost);
  say_packets(picture.bad_packets);
  no_host_time_ = picture.no_host_time;
  const auto text = [](const cv::Size& size) { return std::to_string(size.width) + "x" + std::to_string(size.height); };
  if (static_cast<size_t>(picture.size.area()) > msg::CAMERA_MAX_PIXELS) {
    context_.health().degraded("the camera sends " + text(picture.size) +
                               " pixels, more than camera_frame carries; set live.width_px and live.height_px");
    context_.health().dropped(1);
  } else if (!size_.empty() && picture.size != size_) {
    context_.health().degraded("the camera sends " + text(picture.size) + " pixels, " +
                               (config_.calibration.empty()
                                    ? "where its first picture had " + text(size_) +
                                          "; start frame_grabber anew, or set live.width_px and live.height_px"
                                    : "but its calibration is for " + text(size_) +
                                          "; give its own calibration, or set live.width_px and live.height_px"));
    context_.health().dropped(1);
  } else {
    if (size_.empty()) {
      size_ = picture.size;
      publish_calibration(std::nullopt);
    }
    publish(picture, grabbed_ns);
  }
  if (feed_) feed_->finished();
}

/// Each doubling once: a bad cable must not fill the log.
void FrameGrabberService::say_packets(uint64_t bad_packets) {
  if (bad_packets <= 2 * bad_packets_) return;
  bad_packets_ = bad_packets;
  context_.log().warn(
      "{} network packets of the camera were lost; check the cable, and live.packet_size against the "
      "network card's MTU",
      bad_packets);
}

}  // namespace railfix::frame_grabber
