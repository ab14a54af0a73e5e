#include "key_reader.hpp"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <map>
#include <string_view>

namespace railfix::tool {

namespace {

constexpr int kLookMs = 100;

// ECMA-48 cursor keys, as terminals send them.
std::string name_of(std::string_view bytes) {
  static const std::map<std::string_view, const char*> names{
      {"\x1b[A", "up"}, {"\x1b[B", "down"}, {"\x1b[C", "right"}, {"\x1b[D", "left"}};
  const auto known = names.find(bytes);
  return known == names.end() ? std::string(bytes.substr(0, 1)) : known->second;
}

}  // namespace

KeyReader::KeyReader(std::function<void(const std::string& key)> on_key) : on_key_(std::move(on_key)) {
  // In the background a program that touches its terminal would be stopped.
  if (isatty(STDIN_FILENO) != 1 || tcgetpgrp(STDIN_FILENO) != getpgrp()) return;
  if (tcgetattr(STDIN_FILENO, &before_) != 0) return;
  termios raw = before_;
  raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  if (tcsetattr(STDIN_FILENO, TCSANOW, &raw) != 0) return;
  thread_ = std::thread([this] { read(); });
}

KeyReader::~KeyReader() {
  if (!thread_.joinable()) return;
  ended_ = true;
  thread_.join();
  tcsetattr(STDIN_FILENO, TCSANOW, &before_);
}

void KeyReader::read() {
  while (!ended_) {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    if (poll(&input, 1, kLookMs) <= 0) continue;
    std::array<char, 16> bytes{};
    const ssize_t count = ::read(STDIN_FILENO, bytes.data(), bytes.size());
    if (count <= 0) return;
    on_key_(name_of({bytes.data(), static_cast<size_t>(count)}));
  }
}

}  // namespace railfix::tool
