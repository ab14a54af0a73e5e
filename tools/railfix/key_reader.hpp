// Single keys from a terminal, without Enter.
#pragma once

#include <termios.h>

#include <atomic>
#include <functional>
#include <string>
#include <thread>

namespace railfix::tool {

class KeyReader {
 public:
  /// Calls back in a thread of its own with "q", " ", "left", "right", "up", "down", ... Does nothing where standard
  /// input is no terminal. The terminal is as before when it goes.
  explicit KeyReader(std::function<void(const std::string& key)> on_key);
  ~KeyReader();
  KeyReader(const KeyReader&) = delete;
  KeyReader& operator=(const KeyReader&) = delete;
  [[nodiscard]] bool reads() const { return thread_.joinable(); }

 private:
  void read();
  std::function<void(const std::string& key)> on_key_;
  termios before_{};
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

}  // namespace railfix::tool
