// What comes from live sensors: lines of gpsd, and bytes of a u-blox receiver. The first byte of the input chooses
// which, and into what pieces the rest is cut.
#include <algorithm>
#include <cmath>

#include "fuzz/fuzz_target.hpp"
#include "sensor_gateway/gpsd_reports.hpp"
#include "sensor_gateway/ubx_readings.hpp"
#include "support/ubx_frames.hpp"

namespace railfix::sensor_gateway {
namespace {

using Bytes = std::span<const uint8_t>;

/// Everything that the parser finds, when the bytes come in pieces of this size.
template <class Parser>
auto all_of(Parser& parser, Bytes bytes, size_t piece) {
  auto found = parser.read({}, 0);
  for (size_t at = 0; at < bytes.size(); at += piece) {
    for (auto& one : parser.read(bytes.subspan(at, std::min(piece, bytes.size() - at)), 0)) found.push_back(one);
  }
  return found;
}

void gpsd(Bytes bytes, size_t piece) {
  for (const char* device : {"", "/dev/ttyACM0"}) {
    GpsdReports whole(device);
    GpsdReports cut(device);
    const auto reports = all_of(whole, bytes, bytes.size() + 1);
    fuzz::require(reports.size() == all_of(cut, bytes, piece).size(), "pieces change no report");
    for (const auto& [utc_ns, row] : reports) {
      if (row.fix == 0) continue;
      fuzz::require(utc_ns && std::abs(row.lat_deg) <= 90 && std::abs(row.lon_deg) <= 180, "a position is on earth");
      fuzz::require(std::isfinite(row.hdop) && row.hdop > 0, "a position has its quality");
    }
    fuzz::require(!whole.why_silent().empty(), "it says why nothing comes");
  }
}

void ubx(Bytes bytes, size_t piece) {
  UbxReadings whole(50);
  UbxReadings cut(50);
  const auto samples = all_of(whole, bytes, bytes.size() + 1);
  fuzz::require(samples.size() == all_of(cut, bytes, piece).size(), "pieces change no sample");
  int64_t pulses = 0;
  for (const auto& sample : samples) {
    if (const auto* imu = std::get_if<dataset::ImuRow>(&sample)) {
      for (const double rate_rps : imu->rate_rps) fuzz::require(std::abs(rate_rps) <= 36, "24 bits of a rate");
      for (const double accel_mps2 : imu->accel_mps2) fuzz::require(std::abs(accel_mps2) <= 8192, "24 bits");
    }
    if (const auto* wheel = std::get_if<dataset::WheelRow>(&sample)) {
      fuzz::require(std::abs(wheel->pulses - pulses) <= UbxReadings::kLeap, "no step is longer than a leap");
      pulses = wheel->pulses;
    }
  }
  // Whatever was before, a frame is found behind as many bytes as the longest one that is believed.
  const std::string good = std::string(4200, '\0') + test::ubx_measurements(1, test::ubx_imu({1, 2, 3}, {4, 5, 6})) +
                           test::ubx_measurements(2, test::ubx_imu({1, 2, 3}, {4, 5, 6}));
  fuzz::require(!all_of(whole, {reinterpret_cast<const uint8_t*>(good.data()), good.size()}, good.size()).empty(),
                "a good frame is found again");
}

}  // namespace
}  // namespace railfix::sensor_gateway

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace railfix::sensor_gateway;
  if (size == 0) return 0;
  const Bytes bytes(data + 1, size - 1);
  const size_t piece = 1 + data[0] / 2;
  if (data[0] % 2 == 0) {
    gpsd(bytes, piece);
  } else {
    ubx(bytes, piece);
  }
  return 0;
}
