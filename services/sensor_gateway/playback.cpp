#include "sensor_gateway/playback.hpp"

namespace railfix::sensor_gateway {
namespace {

template <class Row>
bool is_next(const std::vector<Row>& rows, size_t index, int64_t stamp_ns) {
  return index < rows.size() && rows[index].stamp_ns == stamp_ns;
}

template <class Row>
void skip(const std::vector<Row>& rows, size_t& index, int64_t data_ns) {
  while (index < rows.size() && rows[index].stamp_ns < data_ns) ++index;
}

}  // namespace

std::optional<int64_t> Playback::next_ns() const {
  std::optional<int64_t> next;
  const auto consider = [&next](const auto& rows, size_t index) {
    if (index < rows.size() && (!next || rows[index].stamp_ns < *next)) next = rows[index].stamp_ns;
  };
  consider(sensors_.imu, imu_);
  consider(sensors_.wheel, wheel_);
  consider(sensors_.gnss, gnss_);
  return next;
}

void Playback::play_until(int64_t data_ns, const Sinks& sinks) {
  for (auto next = next_ns(); next && *next <= data_ns; next = next_ns()) {
    if (is_next(sensors_.imu, imu_, *next)) {
      sinks.imu(sensors_.imu[imu_++]);
    } else if (is_next(sensors_.wheel, wheel_, *next)) {
      sinks.wheel(sensors_.wheel[wheel_++]);
    } else {
      sinks.gnss(sensors_.gnss[gnss_++]);
    }
  }
}

void Playback::skip_to(int64_t data_ns) {
  skip(sensors_.imu, imu_, data_ns);
  skip(sensors_.wheel, wheel_, data_ns);
  skip(sensors_.gnss, gnss_, data_ns);
}

}  // namespace railfix::sensor_gateway
