// Configuration of the sensor_gateway: section `sensor_gateway`.
#pragma once

#include <string>

#include "sensor_gateway/live_sensor.hpp"
#include "service/config.hpp"

namespace railfix::sensor_gateway {

struct SensorGatewayConfig {
  std::string source;
  std::string clock = "follow";
  std::string start = "command";
  std::string at_end = "idle";
  bool imu = true;
  bool wheel = true;
  bool gnss = true;
  double lead_s = 1;
  LiveConfig live;

  [[nodiscard]] bool is_live() const { return source == "live"; }
  [[nodiscard]] core::Status check() const {
    if (!is_live()) return {};
    if (clock == "own") {
      return core::Error{
          "sensor_gateway.clock is own, which is for played data; live sensors have this computer's time: leave it "
          "out"};
    }
    const auto sensors = make_live_sensors(live);
    return sensors.ok() ? core::Status() : sensors.error();
  }

  void describe(service::Fields& fields) {
    fields.text(
        "source", source,
        "Dataset folder, whose missing tables are sensors that the train does not have; or `live`: the sensors of "
        "the group live.");
    fields.choice(
        "clock", clock, {"follow", "own"},
        "follow: play along with data_clock of the frame_grabber; own: no camera, play at the recorded rate and "
        "publish data_clock.");
    fields.choice("start", start, {"command", "immediately"},
                  "With clock own: begin at the control command `start`, or at once.");
    fields.choice("at_end", at_end, {"idle", "finish"}, "Behind the end of the data: stay, or end the program.");
    fields.flag("imu", imu, "Play mav0/imu0.");
    fields.flag("wheel", wheel, "Play mav0/wheel0.");
    fields.flag("gnss", gnss, "Play mav0/gnss0.");
    fields.number("lead_s", lead_s, {0, 60}, "s", "Samples from so long before the first picture are played, too.");
    fields.group("live", "The sensors of a train that runs.", [this](service::Fields& f) { describe_live(f); });
  }

 private:
  void describe_live(service::Fields& f) {
    f.text("gnss", live.gnss,
           "GNSS receiver: gpsd://ADDRESS:PORT, or gpsd://ADDRESS:PORT/DEVICE where gpsd has several; empty = none.");
    f.number("gnss_latency_ms", live.gnss_latency_ms, {0, 2000}, "ms",
             "From a position to the arrival of its report; taken off the stamps where nobody keeps this computer's "
             "clock.");
    f.text("imu", live.imu, "IMU of a u-blox receiver on a serial line: ubx:DEVICE; empty = none.");
    f.text("imu_axes", live.imu_axes,
           "Which of the IMU's axes point forward, left and up: x, y or z, with - where it points the other way.");
    f.text("wheel", live.wheel, "Wheel pulses of a u-blox receiver: ubx:DEVICE, which may be the IMU's; empty = none.");
    f.number("wheel_pulses_per_metre", live.wheel_pulses_per_metre, {0, 100000}, "1/m",
             "Pulses of the wheel in a metre; must be given with a wheel.");
    f.flag("wheel_reversed", live.wheel_reversed, "Pulses that the receiver calls forward are backward.");
    f.integer("baud", live.baud, {9600, 921600}, "1/s", "Of serial lines; USB takes any.");
    f.number("line_latency_ms", live.line_latency_ms, {0, 1000}, "ms",
             "From a measurement of IMU or wheel to the arrival of its message when nothing delays it; taken off the "
             "stamps.");
    f.number("silent_s", live.silent_s, {0.2, 600}, "s", "A sensor without a sample for so long is connected anew.");
    f.number("reconnect_s", live.reconnect_s, {0.1, 600}, "s", "Pause between attempts to connect.");
  }
};

}  // namespace railfix::sensor_gateway
