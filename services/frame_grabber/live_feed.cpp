#include "frame_grabber/live_feed.hpp"

#include <cstdio>

namespace railfix::frame_grabber {
namespace {

constexpr int kMostWaiting = 4;

}  // namespace

LiveFeed::LiveFeed(std::unique_ptr<LiveCamera> camera, const LiveConfig& config, LiveEvents events)
    : camera_(std::move(camera)),
      config_(config),
      events_(std::move(events)),
      feed_(device(), config.silent_s, config.reconnect_s) {}

core::DeviceFeed::Device LiveFeed::device() {
  return {.connect = [this] { return camera_->connect(); },
          .take = [this](std::chrono::milliseconds patience) { return take(patience); },
          .disconnect = [this] { camera_->disconnect(); },
          .cancel = [this] { camera_->cancel(); },
          .why_silent = [this] { return why_silent(); },
          .connected = events_.connected,
          .gone = events_.gone};
}

core::Result<bool> LiveFeed::take(std::chrono::milliseconds patience) {
  auto next = camera_->next(patience);
  if (!next.ok()) return next.error();
  if (!next.value()) {
    if (const uint64_t lost = camera_->take_lost(); lost > 0) events_.lost(lost);
    return false;
  }
  hand_over(std::move(*std::move(next).value()));
  return true;
}

std::string LiveFeed::why_silent() const {
  if (const std::string why = camera_->why_silent(); !why.empty())
    return camera_->name() + " " + why + "; it is tried again";
  char text[200];
  std::snprintf(text, sizeof text, " sends no picture for %.1f s; check cable and power%s, it is tried again",
                config_.silent_s, config_.trigger.empty() ? "" : ", and that its trigger fires");
  return camera_->name() + text;
}

void LiveFeed::hand_over(RawPicture picture) {
  if (waiting_ >= kMostWaiting) {
    lost_ += picture.lost + 1;
    return;
  }
  picture.lost += lost_;
  lost_ = 0;
  ++waiting_;
  events_.picture(std::move(picture));
}

}  // namespace railfix::frame_grabber
