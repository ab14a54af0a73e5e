#include "dataset/calibration.hpp"

#include <gmock/gmock.h>

#include "temporary_folder.hpp"

namespace railfix::dataset {
namespace {

using ::testing::HasSubstr;

class CalibrationTest : public railfix::testing::TemporaryFolder {};

const char* const kEuroc = R"(# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)
T_BS:
  cols: 4
  rows: 4
  data: [0.0, -1.0, 0.0, -0.02, 1.0, 0.0, 0.0, -0.06, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
)";

TEST_F(CalibrationTest, ReadsAnEurocFile) {
  const auto read = read_calibration(write("sensor.yaml", kEuroc));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read.value().intrinsics.width_px, 752);
  EXPECT_EQ(read.value().intrinsics.fv_px, 457.296);
  EXPECT_EQ(read.value().intrinsics.p2, 1.76187114e-05);
  EXPECT_EQ(read.value().rate_hz, 20);
  EXPECT_FALSE(read.value().mount.has_value());
}

TEST_F(CalibrationTest, WhatTheParserWouldLeaveOutIsRefused) {
  const auto refusal = [this](const std::string& more) {
    const auto read = read_calibration(write("sensor.yaml", kEuroc + more));
    return read.ok() ? "" : read.error().message;
  };
  EXPECT_EQ(refusal("rate_hz: 60\n"),
            (root_ / "sensor.yaml").string() + ": rate_hz is given twice, lines 8 and 14; remove one");
  EXPECT_THAT(refusal("mount:\n  height_m: 2\n  height_m: 3\n"), HasSubstr("mount.height_m is given twice"));
  EXPECT_THAT(refusal("---\nrate_hz: 60\n"), HasSubstr("a second document begins in line 14"));
}

TEST_F(CalibrationTest, WhatIsWrittenReadsBackTheSame) {
  CameraCalibration written;
  written.intrinsics = {1234.5, 1233.25, 639.5, 511.5, -0.1, 0.01, 1e-4, -2e-5, 1280, 1024};
  written.rate_hz = 60;
  written.mount = geometry::CameraPose{0.01, 0.12345678901234567, -0.02, 0.03, 2.4};
  written.mount_sigma = geometry::CameraPose{0, 0.0002, 0.0003, 0.004, 0.005};
  written.intrinsics_sigma = geometry::Intrinsics{0.5, 0.6, 0.7, 0.8, 1e-3, 2e-3, 3e-5, 4e-5, 0, 0};
  ASSERT_TRUE(write_calibration(root_ / "camera.yaml", written).ok());
  const auto read = read_calibration(root_ / "camera.yaml");
  ASSERT_TRUE(read.ok()) << read.error().message;
  ASSERT_TRUE(read.value().mount.has_value());
  EXPECT_EQ(read.value().mount->pitch_rad, 0.12345678901234567);
  EXPECT_EQ(read.value().mount->roll_rad, 0.01);
  EXPECT_EQ(read.value().mount->yaw_rad, -0.02);
  EXPECT_EQ(read.value().mount->lateral_m, 0.03);
  EXPECT_EQ(read.value().mount->height_m, 2.4);
  EXPECT_EQ(read.value().intrinsics.k1, -0.1);
  EXPECT_EQ(read.value().intrinsics.height_px, 1024);
  ASSERT_TRUE(read.value().mount_sigma && read.value().intrinsics_sigma);
  EXPECT_EQ(read.value().mount_sigma->roll_rad, 0);
  EXPECT_EQ(read.value().mount_sigma->height_m, 0.005);
  EXPECT_EQ(read.value().intrinsics_sigma->cv_px, 0.8);
  EXPECT_EQ(read.value().intrinsics_sigma->p2, 4e-5);
}

TEST_F(CalibrationTest, ErrorsNameFileAndKey) {
  const auto message = [&](const std::string& content) {
    const auto read = read_calibration(write("sensor.yaml", content));
    return read.ok() ? std::string("no error") : read.error().message;
  };
  const std::string good = "resolution: [8, 6]\nintrinsics: [5, 5, 4, 3]\n";
  EXPECT_EQ(message(good), "no error");
  EXPECT_THAT(message("resolution: [8, 6]\n"), HasSubstr("sensor.yaml key 'intrinsics': is missing"));
  EXPECT_THAT(message("intrinsics: [5, 5, 4, 3]\n"), HasSubstr("key 'resolution': is missing"));
  EXPECT_THAT(message("resolution: [8, 6]\nintrinsics: [5, 7550000000000002, 4, 3]\n"),
              HasSubstr("key 'intrinsics': fu and fv are in pixels"));
  EXPECT_THAT(message("resolution: [8.5, 6]\nintrinsics: [5, 5, 4, 3]\n"), HasSubstr("key 'resolution'"));
  EXPECT_THAT(message(good + "camera_model: omni\n"), HasSubstr("key 'camera_model': is 'omni'"));
  EXPECT_THAT(message(good + "distortion_model: equidistant\n"), HasSubstr("key 'distortion_model'"));
  EXPECT_THAT(message(good + "distortion_coefficients: [1, 2]\n"), HasSubstr("key 'distortion_coefficients'"));
  EXPECT_THAT(message(good + "mount: {height_m: 2, pitch_rad: x, yaw_rad: 0}\n"), HasSubstr("key 'mount.pitch_rad'"));
  EXPECT_THAT(message(good + "mount: {height_m: 2}\n"), HasSubstr("key 'mount.pitch_rad': is missing"));
  EXPECT_THAT(message("resolution: [8, 6\n"), HasSubstr("sensor.yaml line "));
  EXPECT_THAT(message("just words"), HasSubstr("sensor.yaml"));
  EXPECT_THAT(read_calibration(root_ / "none.yaml").error().message, HasSubstr("none.yaml cannot be opened"));
}

TEST_F(CalibrationTest, FindsWhatLiesWithThePictures) {
  EXPECT_FALSE(find_calibration(root_).value().has_value());
  write("kitti/calib.txt", "P0: 718.8 0 607.1 0 0 718.8 185.2 0 0 0 1 0\nP1: 0\n");
  const auto kitti = find_calibration(root_ / "kitti");
  ASSERT_TRUE(kitti.ok() && kitti.value());
  EXPECT_EQ(kitti.value()->intrinsics.cu_px, 607.1);
  EXPECT_EQ(kitti.value()->intrinsics.cv_px, 185.2);
  write("seq/mav0/cam0/sensor.yaml", std::string("%YAML:1.0\n") + kEuroc);
  const auto euroc = find_calibration(root_ / "seq");
  ASSERT_TRUE(euroc.ok() && euroc.value());
  EXPECT_EQ(euroc.value()->intrinsics.width_px, 752);
  write("broken/calib.txt", "P0: 718.8 0\n");
  EXPECT_THAT(find_calibration(root_ / "broken").error().message, HasSubstr("12 numbers"));
}

}  // namespace
}  // namespace railfix::dataset
