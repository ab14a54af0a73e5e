// Frames of a u-blox receiver, made by hand from the protocol's description.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace railfix::test {

struct UbxMeasurement {
  uint8_t type;
  int32_t value;  // 24 bits
};

inline std::string little_endian(uint32_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text.push_back(static_cast<char>(value >> 8U * static_cast<unsigned>(i)));
  return text;
}

inline std::string ubx_frame(uint8_t kind, uint8_t id, const std::string& payload) {
  const std::string body = std::string{static_cast<char>(kind), static_cast<char>(id)} +
                           little_endian(static_cast<uint32_t>(payload.size()), 2) + payload;
  uint8_t a = 0;
  uint8_t b = 0;
  for (const char byte : body) {
    a = static_cast<uint8_t>(a + static_cast<uint8_t>(byte));
    b = static_cast<uint8_t>(b + a);
  }
  return "\xB5\x62" + body + static_cast<char>(a) + static_cast<char>(b);
}

/// UBX-ESF-MEAS.
inline std::string ubx_measurements(uint32_t tag_ms, const std::vector<UbxMeasurement>& measurements) {
  std::string payload = little_endian(tag_ms, 4) + little_endian(static_cast<uint32_t>(measurements.size()) << 11U, 2) +
                        little_endian(0, 2);
  for (const auto& one : measurements)
    payload += little_endian((static_cast<uint32_t>(one.value) & 0xFFFFFFU) | uint32_t{one.type} << 24U, 4);
  return ubx_frame(0x10, 0x02, payload);
}

/// Rates in 2^-12 degrees/s and accelerations in 2^-10 m/s^2 of the axes x, y, z.
inline std::vector<UbxMeasurement> ubx_imu(const int32_t (&rates)[3], const int32_t (&accelerations)[3]) {
  return {
      {14, rates[0]},         {16, accelerations[0]},          {13, rates[1]}, {17, accelerations[1]}, {5, rates[2]},
      {18, accelerations[2]}, {12, 2500 /* its temperature */}};
}

inline UbxMeasurement ubx_ticks(uint32_t ticks, bool backward) {
  return {10, static_cast<int32_t>((ticks & 0x7FFFFFU) | (backward ? 0x800000U : 0U))};
}

}  // namespace railfix::test
