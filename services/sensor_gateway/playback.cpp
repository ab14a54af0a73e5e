#include "sensor_gateway/playback.hpp"

#include <algorithm>

namespace railfix::sensor_gateway {
namespace {

template <class Row>
bool is_next(const std::vector<Row>& rows, size_t index, int64_t stamp_ns) {
  return index < rows.size() && rows[index].stamp_ns == stamp_ns;
}

template <class Row>
size_t first_from(const std::vector<Row>& rows, int64_t data_ns) {
  const auto first = std::ranges::find_if(rows, [=](const Row& row) { return row.stamp_ns >= data_ns; });
  return static_cast<size_t>(first - rows.begin());
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

void Playback::go_to(int64_t data_ns) {
  imu_ = first_from(sensors_.imu, data_ns);
  wheel_ = first_from(sensors_.wheel, data_ns);
  gnss_ = first_from(sensors_.gnss, data_ns);
}

}  // namespace railfix::sensor_gateway
