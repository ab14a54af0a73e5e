// Bytes from a TCP peer or a serial line. Nothing here waits longer than it was told to.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "core/result.hpp"

namespace railfix::sensor_gateway {

/// An IP address and a port, "127.0.0.1:2947" or "[::1]:2947". A name would have to be looked up, which may hang.
struct Address {
  std::string ip;
  std::string port;
};
/// False for names and for what is neither.
bool is_address(const Address& address);
bool is_baud(int64_t baud);

/// Used by one thread. Errors are the bare reason; who has opened the line knows what is at its other end.
class ByteLine {
 public:
  ByteLine();
  ~ByteLine();
  ByteLine(const ByteLine&) = delete;
  ByteLine& operator=(const ByteLine&) = delete;

  core::Status connect(const Address& address);
  /// For reading, and for nobody else.
  core::Status open_serial(const std::string& device, int64_t baud);
  core::Status write(std::string_view text);
  /// How many bytes came; 0 = none in time.
  core::Result<size_t> read(std::span<uint8_t> bytes, std::chrono::milliseconds patience);
  void close();
  /// Makes everything return soon, now and from now on. Any thread.
  void cancel();

 private:
  /// False when nothing happened in time or it was cancelled.
  [[nodiscard]] bool wait_for(short events, std::chrono::milliseconds patience) const;
  int file_ = -1;
  int cancelled_;  // eventfd
};

}  // namespace railfix::sensor_gateway
