// FNV-1a, 64 bit: tells texts and files apart; no protection against anybody.
#pragma once

#include <cstdint>
#include <string_view>

namespace railfix::core {

class Fnv {
 public:
  void add(char byte) { value_ = (value_ ^ static_cast<unsigned char>(byte)) * 0x100000001b3U; }
  void add(std::string_view text) {
    for (const char c : text) add(c);
  }
  [[nodiscard]] uint64_t value() const { return value_; }

 private:
  uint64_t value_ = 0xcbf29ce484222325U;
};

}  // namespace railfix::core
