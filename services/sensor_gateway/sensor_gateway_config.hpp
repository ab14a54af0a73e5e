// Configuration of the sensor_gateway: section `sensor_gateway`.
#pragma once

#include <string>

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

  void describe(service::Fields& fields) {
    fields.text("source", source,
                "Dataset folder; tables that it does not have are sensors that the train does not have.");
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
  }
};

}  // namespace railfix::sensor_gateway
