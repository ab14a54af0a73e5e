// The sets of sources that docs/sources.md compares: what is left when some are taken away.
#pragma once

namespace railfix::train {

struct SensorSet {
  const char* name;
  bool camera, wheel, imu, gnss, curvature, landmarks;
};

// "curvature": turning against the map's shape; the gyro that measures it is counted to it, the accelerometer to "imu".
inline constexpr SensorSet kSensorSets[] = {
    {"all", true, true, true, true, true, true},
    {"all but GNSS", true, true, true, false, true, true},
    {"all but GNSS and curvature", true, true, true, false, false, true},
    {"all but GNSS and landmarks", true, true, true, false, true, false},
    {"curvature and landmarks off: camera, wheel, IMU", true, true, true, false, false, false},
    {"camera, landmarks", true, false, false, false, false, true},
    {"wheel, IMU, landmarks", false, true, true, false, false, true},
    {"wheel, IMU, curvature", false, true, true, false, true, false},
    {"GNSS, IMU", false, false, true, true, false, false},
    {"wheel and IMU only", false, true, true, false, false, false},
    {"camera alone", true, false, false, false, false, false},
    {"wheel alone", false, true, false, false, false, false},
    {"GNSS alone", false, false, false, true, false, false},
    {"IMU alone", false, false, true, false, false, false},
    {"curvature alone", false, false, false, false, true, false},
    {"landmarks alone", false, false, false, false, false, true},
};

}  // namespace railfix::train
