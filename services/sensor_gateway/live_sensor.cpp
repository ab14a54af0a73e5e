#include "sensor_gateway/live_sensor.hpp"

#include <set>

namespace railfix::sensor_gateway {

core::Result<std::vector<std::unique_ptr<LiveSensor>>> make_live_sensors(const LiveConfig& config) {
  std::vector<std::unique_ptr<LiveSensor>> sensors;
  std::set<std::string> lines{config.imu, config.wheel};  // one line may carry both
  lines.erase("");
  if (lines.empty() && config.gnss.empty()) {
    return core::Error{
        "sensor_gateway.source is live, but no sensor is named; give live.gnss, live.imu or live.wheel, or take "
        "sensor_gateway out of the train's services"};
  }
  if (!config.gnss.empty()) {
    auto made = make_gpsd_receiver(config.gnss, config);
    if (!made.ok()) return made.error();
    sensors.push_back(std::move(made).value());
  }
  for (const auto& line : lines) {
    auto made = make_ubx_receiver(line, config);
    if (!made.ok()) return made.error();
    sensors.push_back(std::move(made).value());
  }
  return sensors;
}

}  // namespace railfix::sensor_gateway
