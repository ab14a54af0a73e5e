#include <gmock/gmock.h>

#include <cmath>

#include "dataset/dataset.hpp"
#include "temporary_folder.hpp"

namespace railfix::dataset {
namespace {

using ::testing::HasSubstr;

class TablesTest : public railfix::testing::TemporaryFolder {
 protected:
  [[nodiscard]] std::string sensors_error() const {
    const auto sensors = read_sensors(root_);
    return sensors.ok() ? "no error" : sensors.error().message;
  }
};

TEST_F(TablesTest, SensorsOfADataset) {
  write("mav0/imu0/data.csv", "#timestamp [ns],w_x,w_y,w_z [rad/s],a_x,a_y,a_z [m/s^2]\n5,0.1,0.2,0.3,1,2,9.81\n");
  write("mav0/wheel0/data.csv", "#timestamp [ns],pulses\n5,-3\n6,7\n");
  write("mav0/wheel0/sensor.yaml", "pulses_per_metre: 36.5\n");
  write("mav0/gnss0/data.csv", "#timestamp [ns],lat_deg,lon_deg,alt_m,hdop,fix\n7,46.7,9.4,900,1.2,4\n8,,,,,0\n");
  for (const auto& path : {root_, root_ / "mav0"}) {
    const auto read = read_sensors(path);
    ASSERT_TRUE(read.ok()) << read.error().message;
    const Sensors& sensors = read.value();
    ASSERT_EQ(sensors.imu.size(), 1U);
    EXPECT_EQ(sensors.imu[0].rate_rps[2], 0.3);
    EXPECT_EQ(sensors.imu[0].accel_mps2[2], 9.81);
    ASSERT_EQ(sensors.wheel.size(), 2U);
    EXPECT_EQ(sensors.wheel[0].pulses, -3);
    EXPECT_EQ(sensors.pulses_per_metre, 36.5);
    ASSERT_EQ(sensors.gnss.size(), 2U);
    EXPECT_EQ(sensors.gnss[0].lon_deg, 9.4);
    EXPECT_EQ(sensors.gnss[1].fix, 0);
    EXPECT_TRUE(std::isnan(sensors.gnss[1].lat_deg));
  }
}

TEST_F(TablesTest, EurocNamesOfTheImu) {
  write(
      "mav0/imu0/data.csv",
      "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],"
      "a_RS_S_z [m s^-2]\n5,1,2,3,4,5,6\n");
  EXPECT_EQ(read_sensors(root_).value().imu.at(0).accel_mps2[1], 5);
}

TEST_F(TablesTest, MissingTablesAreEmpty) {
  const auto sensors = read_sensors(root_);
  ASSERT_TRUE(sensors.ok());
  EXPECT_TRUE(sensors.value().imu.empty() && sensors.value().wheel.empty() && sensors.value().gnss.empty());
}

TEST_F(TablesTest, SensorsAloneAreToldFromMissingOrBrokenPictures) {
  EXPECT_FALSE(has_sensors_alone(root_)) << "nothing is there";
  write("mav0/wheel0/data.csv", "#timestamp [ns],pulses\n5,-3\n");
  EXPECT_TRUE(has_sensors_alone(root_));
  write("mav0/cam0/data.csv", "#timestamp [ns],filename\n");
  EXPECT_TRUE(has_sensors_alone(root_)) << "as railfix simulate --no-pictures leaves it";
  write("mav0/cam0/data.csv", "#timestamp [ns],filename\n1\n");
  EXPECT_FALSE(has_sensors_alone(root_)) << "a broken list is not none";
  write("mav0/cam0/data.csv", "#timestamp [ns],filename\n1,a.png\n");
  EXPECT_FALSE(has_sensors_alone(root_));
}

TEST_F(TablesTest, BrokenRowsNameFileAndLine) {
  const std::string imu = "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n1,0,0,0,0,0,9\n";
  write("mav0/imu0/data.csv", imu + "2,0,0,nan,0,0,9\n");
  EXPECT_THAT(sensors_error(), HasSubstr("imu0/data.csv line 3: has no finite number in column w_z"));
  write("mav0/imu0/data.csv", imu + "2,0,0,0,0,9\n");
  EXPECT_THAT(sensors_error(), HasSubstr("imu0/data.csv line 3: has 6 values"));
  write("mav0/imu0/data.csv", imu + "0,0,0,0,0,0,9\n");
  EXPECT_THAT(sensors_error(), HasSubstr("line 3: has a timestamp before"));
  write("mav0/imu0/data.csv", "#timestamp [ns],w_x,w_y,w_z,a_x,a_y\n");
  EXPECT_THAT(sensors_error(), HasSubstr("line 1: has no column 'a_z'"));
  write("mav0/imu0/data.csv", imu);
  EXPECT_EQ(sensors_error(), "no error");
  write("mav0/wheel0/data.csv", "#timestamp [ns],pulses\n5,3\n");
  EXPECT_THAT(sensors_error(), HasSubstr("wheel0/sensor.yaml cannot be opened"));
  write("mav0/wheel0/sensor.yaml", "pulses_per_metre: 0\n");
  EXPECT_THAT(sensors_error(), HasSubstr("key 'pulses_per_metre': must be positive"));
  write("mav0/wheel0/sensor.yaml", "pulses_per_metre: 10\n");
  write("mav0/gnss0/data.csv", "#timestamp [ns],lat_deg,lon_deg,alt_m,hdop,fix\n7,146.7,9.4,900,1.2,4\n");
  EXPECT_THAT(
      sensors_error(),
      HasSubstr("gnss0/data.csv line 2: has a latitude or longitude that is no place on Earth: they may be swapped"));
  write("mav0/gnss0/data.csv", "#timestamp [ns],lat_deg,lon_deg,alt_m,hdop,fix\n7,146.7,99.4,900,1.2,4\n");
  EXPECT_THAT(sensors_error(), ::testing::Not(HasSubstr("swapped")));
}

TEST_F(TablesTest, TruthByNameInAnyOrderAndSpelling) {
  for (const char* header :
       {"timestamp,distance,speed,camera height,vertical curvature,easting,pitch",
        "stamp_ns,distance_m,speed_mps,camera_height_m,vertical_curvature_per_m,easting_m,pitch_rad",
        "#timestamp [ns],distance [m],speed [m/s],camera_height,vertical_curvature [1/m],easting [m],pitch [rad]"}) {
    const auto read =
        read_truth(write("truth/track.csv", std::string(header) + "\n10,1.5,20,2.4,1e-4,700000,0.05\n20,2,20,,,,\n"));
    ASSERT_TRUE(read.ok()) << header << ": " << read.error().message;
    ASSERT_EQ(read.value().size(), 2U);
    const TruthRow& row = read.value()[0];
    EXPECT_EQ(row.stamp_ns, 10);
    EXPECT_EQ(row.distance_m, 1.5);
    EXPECT_EQ(row.camera.height_m, 2.4);
    EXPECT_EQ(row.camera.pitch_rad, 0.05);
    EXPECT_EQ(row.vertical_curvature_per_m, 1e-4);
    EXPECT_EQ(row.easting_m, 700000);
    EXPECT_TRUE(std::isnan(row.northing_m));
    EXPECT_TRUE(std::isnan(read.value()[1].easting_m));
  }
  EXPECT_THAT(read_truth(write("t.csv", "timestamp,speed\n")).error().message, HasSubstr("no column 'distance'"));
  EXPECT_THAT(read_truth(write("t.csv", "timestamp,distance\n1,\n")).error().message, HasSubstr("t.csv line 2"));
}

TEST_F(TablesTest, TruthThatNoTrainRunsIsRefused) {
  const auto second_row = [&](const std::string& cells) {
    return read_truth(write("t.csv", "timestamp,distance,speed\n0,50,20\n1000000000," + cells + "\n2000000000,0,20\n"));
  };
  EXPECT_TRUE(second_row("-150,20").ok());
  for (const char* cells : {"1e6,20", "-1e6,20", "1e308,20", "60,1e308"})
    EXPECT_THAT(second_row(cells).error().message, HasSubstr("t.csv line 3: ")) << cells;
}

TEST_F(TablesTest, TruthLandmarks) {
  const auto read =
      read_truth_landmarks(write("l.csv", "kind,distance [m],lateral [m]\nbalise,12.5,0\nmast,30,-3.2\n"));
  ASSERT_TRUE(read.ok());
  ASSERT_EQ(read.value().size(), 2U);
  EXPECT_EQ(read.value()[1].kind, "mast");
  EXPECT_EQ(read.value()[1].distance_m, 30);
  EXPECT_EQ(read.value()[1].lateral_m, -3.2);
  EXPECT_THAT(read_truth_landmarks(write("l.csv", "kind,distance\n,5\n")).error().message,
              HasSubstr("line 2: has no kind"));
}

TEST_F(TablesTest, FindsTheMapOfADataset) {
  EXPECT_EQ(find_map(root_), std::nullopt);
  write("map/README.txt", "notes");
  EXPECT_EQ(find_map(root_), std::nullopt);
  const auto railml = write("map/b.railml", "");
  write("map/a.csv", "");
  EXPECT_EQ(find_map(root_), railml);
}

TEST_F(TablesTest, AFixIsOneOfGnss) {
  const auto fix_read = [this](const std::string& fix) {
    write("mav0/gnss0/data.csv", "#timestamp [ns],lat_deg,lon_deg,alt_m,hdop,fix\n7,46.7,9.4,900,1.2," + fix + "\n");
    return read_sensors(root_);
  };
  EXPECT_EQ(fix_read("5").value().gnss.at(0).fix, 5);
  EXPECT_EQ(fix_read("2").value().gnss.at(0).fix, 1) << "differential";
  EXPECT_EQ(fix_read("6").value().gnss.at(0).fix, 0) << "dead reckoned";
  for (const std::string wrong : {"260", "-1", "9"}) {
    ASSERT_FALSE(fix_read(wrong).ok()) << wrong;
    EXPECT_THAT(fix_read(wrong).error().message, HasSubstr("line 2: has a fix (" + wrong + ") that is none of"));
  }
}

}  // namespace
}  // namespace railfix::dataset
