// Keeps a camera, a receiver or another device going in a thread of its own: connects it, takes what it gives, and
// connects it again when it is gone or silent.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <string>
#include <thread>

#include "core/result.hpp"

namespace railfix::core {

class DeviceFeed {
 public:
  /// All but `cancel` are called in the feed's thread.
  struct Device {
    std::function<Result<std::string>()> connect;  // the text says what was found
    /// Takes what comes within this time, and says whether anything did; an error when the device is gone.
    std::function<Result<bool>(std::chrono::milliseconds patience)> take;
    std::function<void()> disconnect;
    std::function<void()> cancel;             // connect and take return soon, now and from now on
    std::function<std::string()> why_silent;  // a sentence for a technician
    std::function<void(const std::string& what)> connected;
    std::function<void(const std::string& why)> gone;  // also when connecting fails; each reason once
  };
  DeviceFeed(Device device, double silent_s, double reconnect_s);
  ~DeviceFeed();
  DeviceFeed(const DeviceFeed&) = delete;
  DeviceFeed& operator=(const DeviceFeed&) = delete;

 private:
  void run();
  bool connect();
  void deliver();
  void tell_gone(const std::string& why);
  bool sleep_s(double seconds);  // false: stopped
  [[nodiscard]] bool stopped();
  const Device device_;
  const double silent_s_;
  const double reconnect_s_;
  std::string told_;  // since something came
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stopped_ = false;
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace railfix::core
