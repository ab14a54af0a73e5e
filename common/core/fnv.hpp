// FNV-1a, 64 bit: tells texts and files apart; no protection against anybody.
#pragma once

#include <array>
#include <cinttypes>
#include <cstdio>
#include <string>
#include <string_view>

namespace railfix::core {

class Fnv {
 public:
  void add(char byte) { value_ = (value_ ^ static_cast<unsigned char>(byte)) * 0x100000001b3U; }
  void add(std::string_view text) {
    for (const char c : text) add(c);
  }
  [[nodiscard]] uint64_t value() const { return value_; }
  /// In 16 digits.
  [[nodiscard]] std::string hex() const {
    std::array<char, 17> text{};
    std::snprintf(text.data(), text.size(), "%016" PRIx64, value_);
    return text.data();
  }

 private:
  uint64_t value_ = 0xcbf29ce484222325U;
};

}  // namespace railfix::core
