#include "core/device_feed.hpp"

#include <utility>

#include "core/time.hpp"

namespace railfix::core {
namespace {

constexpr std::chrono::milliseconds kPatience{100};

}  // namespace

DeviceFeed::DeviceFeed(Device device, double silent_s, double reconnect_s)
    : device_(std::move(device)), silent_s_(silent_s), reconnect_s_(reconnect_s), thread_([this] { run(); }) {}

DeviceFeed::~DeviceFeed() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }
  device_.cancel();
  thread_.join();
}

bool DeviceFeed::stopped() {
  const std::lock_guard lock(mutex_);
  return stopped_;
}

bool DeviceFeed::sleep_s(double seconds) {
  std::unique_lock lock(mutex_);
  return !changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return stopped_; });
}

void DeviceFeed::run() {
  do {
    if (connect()) deliver();
    device_.disconnect();
  } while (sleep_s(reconnect_s_));
}

bool DeviceFeed::connect() {
  const auto connected = device_.connect();
  if (stopped()) return false;  // what is cancelled has no news
  if (connected.ok()) {
    device_.connected(connected.value());
  } else {
    tell_gone(connected.error().message);
  }
  return connected.ok();
}

void DeviceFeed::deliver() {
  int64_t last_ns = monotonic_ns();
  while (!stopped()) {
    const auto taken = device_.take(kPatience);
    if (!taken.ok()) return tell_gone(taken.error().message);
    if (taken.value()) {
      told_.clear();
      last_ns = monotonic_ns();
    } else if (seconds(monotonic_ns() - last_ns) > silent_s_) {
      return tell_gone(device_.why_silent());
    }
  }
}

void DeviceFeed::tell_gone(const std::string& why) {
  if (why == told_) return;
  told_ = why;
  device_.gone(why);
}

}  // namespace railfix::core
