// What a fuzz target is made of: libFuzzer or mutate.cpp calls LLVMFuzzerTestOneInput with every input.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace railfix::fuzz {

/// A broken promise ends the program, so that the fuzzer keeps the input.
inline void require(bool holds, const char* promise) {
  if (holds) return;
  std::fprintf(stderr, "fuzz: broken promise: %s\n", promise);
  std::abort();
}

/// The input as a source of choices: the same input gives the same choices; zeros behind its end.
class Choices {
 public:
  explicit Choices(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  uint32_t next() {
    uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value = value << 8U | byte();
    return value;
  }
  uint8_t byte() { return position_ < bytes_.size() ? bytes_[position_++] : uint8_t{0}; }
  [[nodiscard]] std::span<const uint8_t> rest() const { return bytes_.subspan(position_); }

 private:
  std::span<const uint8_t> bytes_;
  size_t position_ = 0;
};

}  // namespace railfix::fuzz
