#include "frame_grabber/live_feed.hpp"

#include <cstdio>

#include "core/time.hpp"

namespace railfix::frame_grabber {
namespace {

constexpr std::chrono::milliseconds kPatience{100};
constexpr int kMostWaiting = 4;

}  // namespace

LiveFeed::LiveFeed(std::unique_ptr<LiveCamera> camera, const LiveConfig& config, LiveEvents events)
    : camera_(std::move(camera)), config_(config), events_(std::move(events)), thread_([this] { run(); }) {}

LiveFeed::~LiveFeed() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }
  camera_->cancel();
  thread_.join();
}

bool LiveFeed::sleep_s(double seconds) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return stopped_.load(); });
}

void LiveFeed::run() {
  while (!stopped_) {
    if (connect()) deliver();
    camera_->disconnect();
    if (!sleep_s(config_.reconnect_s)) return;
  }
}

bool LiveFeed::connect() {
  const auto connected = camera_->connect();
  if (!connected.ok()) {
    tell_gone(connected.error().message);
    return false;
  }
  events_.connected(connected.value());
  return true;
}

void LiveFeed::deliver() {
  int64_t last_ns = core::monotonic_ns();
  while (!stopped_) {
    auto next = camera_->next(kPatience);
    if (!next.ok()) return tell_gone(next.error().message);
    if (next.value()) {
      told_.clear();
      last_ns = core::monotonic_ns();
      hand_over(std::move(*std::move(next).value()));
    } else if (core::seconds(core::monotonic_ns() - last_ns) > config_.silent_s) {
      char text[200];
      std::snprintf(text, sizeof text, " sends no picture for %.1f s; check cable and power%s, it is tried again",
                    config_.silent_s, config_.trigger.empty() ? "" : ", and that its trigger fires");
      return tell_gone(camera_->name() + text);
    }
  }
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

void LiveFeed::tell_gone(const std::string& why) {
  if (why == told_) return;
  told_ = why;
  events_.gone(why);
}

}  // namespace railfix::frame_grabber
