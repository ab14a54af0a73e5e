#include "run_tables.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>
#include <limits>

#include "mcap/writer.hpp"
#include "messaging/topics.hpp"

namespace railfix::tool {

namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

class RunTables : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("railfix-tables-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    writer_ = mcap::Writer::create(folder_ / "recording.mcap", {}).value();
  }
  void TearDown() override { fs::remove_all(folder_); }

  template <class T>
  void record(const messaging::Topic<T>& topic, const T& sample) {
    record(topic.name, messaging::serialize(sample));
  }
  void record(const std::string& topic, const std::vector<uint8_t>& cdr) {
    const uint16_t channel = writer_->add_channel(0, topic, "cdr", {}).value();
    ++time_ns_;
    ASSERT_TRUE(writer_->write({channel, 0, time_ns_, time_ns_, cdr}).ok());
  }
  TablesReport exported() {
    EXPECT_TRUE(writer_->close().ok());
    auto report = export_tables(folder_ / "recording.mcap", folder_ / "out");
    EXPECT_TRUE(report.ok()) << report.error().message;
    return report.value();
  }
  [[nodiscard]] std::vector<std::string> lines(const std::string& table) const {
    std::ifstream file(folder_ / "out" / table);
    EXPECT_TRUE(file) << table;
    std::vector<std::string> all;
    for (std::string line; std::getline(file, line);) all.push_back(line);
    return all;
  }

  fs::path folder_;
  std::unique_ptr<mcap::Writer> writer_;
  int64_t time_ns_ = 0;
};

TEST_F(RunTables, TrackViewAndRails) {
  msg::TrackView view;
  view.stamp_ns(100);
  view.roll_rad(0.5);
  view.pitch_rad(0.25);
  view.yaw_rad(-0.125);
  view.lateral_m(0.75);
  view.height_m(2.5);
  view.curvature_per_m(0.001);
  view.vertical_curvature_per_m(kNan);
  size_t index = 0;
  for (size_t row = 0; row < 7; ++row) {
    for (size_t column = row; column < 7; ++column, ++index) {
      view.covariance()[index] = row == column ? static_cast<double>((row + 1) * (row + 1)) : -9.0;
    }
  }
  view.covariance()[27] = 0;  // not known
  view.seen_left(1);
  view.seen_right(1);
  view.left_points(2);
  view.left_u_px()[0] = 10.5F;
  view.left_v_px()[0] = 20;
  view.left_u_px()[1] = 11;
  view.left_v_px()[1] = 21;
  view.right_points(1);
  view.right_u_px()[0] = 30;
  view.right_v_px()[0] = 40;
  record(topics::track_view, view);
  view.stamp_ns(200);
  view.seen_right(0);
  record(topics::track_view, view);
  view.stamp_ns(300);
  view.seen_left(0);
  record(topics::track_view, view);
  EXPECT_EQ(exported().rows, 8U);
  EXPECT_THAT(
      lines("track_view.csv"),
      ElementsAre(
          "stamp_ns,seen,roll_rad,pitch_rad,yaw_rad,lateral_m,height_m,curvature_per_m,vertical_curvature_per_m,"
          "roll_rad_sigma,pitch_rad_sigma,yaw_rad_sigma,lateral_m_sigma,height_m_sigma,curvature_per_m_sigma,"
          "vertical_curvature_per_m_sigma",
          "100,1,0.5,0.25,-0.125,0.75,2.5,0.001,,1,2,3,4,5,6,", "200,0,0.5,0.25,-0.125,0.75,2.5,0.001,,1,2,3,4,5,6,",
          "300,0,,,,,,,,,,,,,,"));
  EXPECT_THAT(lines("rails.csv"), ElementsAre("stamp_ns,rail,u_px,v_px", "100,L,10.5,20", "100,L,11,21", "100,R,30,40",
                                              "200,L,10.5,20", "200,L,11,21"));
}

TEST_F(RunTables, OdometrySightingsAndFixes) {
  msg::OdometryStep step;
  step.stamp_ns(5);
  step.valid(1);
  step.distance_m(12.5);
  step.speed_mps(3);
  step.lateral_speed_mps(0.5);
  step.yaw_rate_rps(-0.25);
  step.step_sigma_m(0.001);
  step.mode(msg::ODOMETRY_TRACK);
  record(topics::odometry_step, step);
  step.stamp_ns(6);
  step.valid(0);
  step.mode(msg::ODOMETRY_BLIND);
  record(topics::odometry_step, step);
  msg::LandmarkSighting sighting;
  sighting.stamp_ns(7);
  sighting.kind(msg::SIGHTING_PORTAL_OUT);
  sighting.distance_ahead_m(4.5);
  sighting.lateral_m(-1);
  sighting.sigma_m(0.25);
  sighting.confidence(0.5);
  record(topics::landmark_sighting, sighting);
  msg::PositionFix fix;
  fix.stamp_ns(8);
  fix.kind(msg::FIX_NETWORK);
  fix.edge(17);
  fix.offset_m(100.25);
  fix.direction(msg::DIRECTION_REVERSE);
  fix.sigma_m(2);
  fix.probability(0.875);
  record(topics::position_fix, fix);
  exported();
  EXPECT_THAT(lines("odometry.csv"),
              ElementsAre("stamp_ns,valid,distance_m,speed_mps,lateral_speed_mps,yaw_rate_rps,step_sigma_m,mode",
                          "5,1,12.5,3,0.5,-0.25,0.001,track", "6,0,12.5,,,,,blind"));
  EXPECT_THAT(lines("sightings.csv"), ElementsAre("stamp_ns,kind,distance_ahead_m,lateral_m,sigma_m,confidence",
                                                  "7,portal_out,4.5,-1,0.25,0.5"));
  EXPECT_THAT(lines("position_fix.csv"), ElementsAre("stamp_ns,kind,edge,offset_m,direction,sigma_m,probability",
                                                     "8,network,17,100.25,-,2,0.875"));
}

TEST_F(RunTables, StateIsEmptyWhereTheTrackIsNotKnown) {
  msg::TrainState state;
  state.stamp_ns(9);
  state.edge(3);
  state.offset_m(50.5);
  state.direction(msg::DIRECTION_FORWARD);
  state.track_known(1);
  state.distance_m(7);
  state.speed_mps(2);
  state.over_m(1.5);
  state.under_m(1.25);
  state.sigma_m(0.5);
  state.integrity(msg::INTEGRITY_DEGRADED);
  state.lat_deg(kNan);
  state.lon_deg(kNan);
  state.easting_m(1000);
  state.northing_m(2000);
  state.heading_rad(0.25);
  state.track_probability(0.75);
  record(topics::train_state, state);
  state.track_known(0);
  record(topics::train_state, state);
  exported();
  EXPECT_THAT(
      lines("train_state.csv"),
      ElementsAre("stamp_ns,edge,offset_m,direction,track_known,distance_m,speed_mps,over_m,under_m,sigma_m,integrity,"
                  "lat_deg,lon_deg,easting_m,northing_m,heading_rad,track_probability",
                  "9,3,50.5,+,1,7,2,1.5,1.25,0.5,degraded,,,1000,2000,0.25,0.75",
                  "9,,,,0,7,2,1.5,1.25,0.5,degraded,,,,,,0.75"));
}

TEST_F(RunTables, PoseIsEmptyWhereTheMapSaysNothing) {
  msg::TrainPose pose;
  pose.stamp_ns(9);
  pose.easting_m(1000);
  pose.northing_m(2000);
  pose.height_m(kNan);
  pose.along_sigma_m(0.5);
  pose.across_sigma_m(0.25);
  pose.height_sigma_m(kNan);
  pose.heading_rad(1.5);
  pose.pitch_rad(0.125);
  pose.roll_rad(-0.25);
  pose.heading_sigma_rad(0.0625);
  pose.pitch_sigma_rad(0.375);
  pose.roll_sigma_rad(0.75);
  pose.orientation(msg::ORIENTATION_IMU);
  record(topics::train_pose, pose);
  exported();
  EXPECT_THAT(lines("train_pose.csv"),
              ElementsAre("stamp_ns,easting_m,northing_m,height_m,along_sigma_m,across_sigma_m,height_sigma_m,"
                          "heading_rad,pitch_rad,roll_rad,heading_sigma_rad,pitch_sigma_rad,roll_sigma_rad,orientation",
                          "9,1000,2000,,0.5,0.25,,1.5,0.125,-0.25,0.0625,0.375,0.75,imu"));
}

TEST_F(RunTables, ReportsAndStatusInTheTimeOfTheData) {
  msg::ServiceStatus status;
  status.stamp_ns(1'700'000'000'000'000'000);
  status.service("fusion");
  status.host("co,ach");
  status.state(msg::STATE_ACTIVE);
  status.frames_in(10);
  status.latency_p50_ms(1.5);
  record(topics::service_status, status);
  msg::DataClock clock;
  clock.data_ns(1000);
  record(topics::data_clock, clock);
  msg::TrainPositionReport report;
  report.stamp_ns(2000);
  report.nid_lrbg(16777215);
  report.d_lrbg_m(kNan);
  report.l_doubtover_m(2.5);
  report.l_doubtunder_m(kNan);
  report.v_train_kmh(35);
  report.q_dirlrbg(2);
  report.q_dlrbg(1);
  report.q_dirtrain(1);
  report.message_bytes(3);
  report.message()[0] = 0x88;
  report.message()[2] = 0x0F;
  record(topics::train_position_report, report);
  report.nid_lrbg(5);
  report.d_lrbg_m(12);
  record(topics::train_position_report, report);
  record(topics::service_status, status);
  record("service_status", {0, 1, 0, 0, 1});
  const auto done = exported();
  EXPECT_THAT(
      lines("tpr.csv"),
      ElementsAre(
          "stamp_ns,nid_lrbg,d_lrbg_m,q_dirlrbg,q_dlrbg,l_doubtover_m,l_doubtunder_m,v_train_kmh,q_dirtrain,hex",
          "2000,,,2,1,2.5,,35,1,88000f", "2000,5,12,2,1,2.5,,35,1,88000f"));
  EXPECT_THAT(
      lines("status.csv"),
      ElementsAre(
          "stamp_ns,service,host,state,frames_in,frames_out,dropped,latency_p50_ms,latency_p99_ms,cpu_percent,rss_mb",
          "1000,fusion,co_ach,active,10,0,0,1.5,0,0,0", "2000,fusion,co_ach,active,10,0,0,1.5,0,0,0"));
  EXPECT_THAT(done.problems, ElementsAre(HasSubstr("1 samples of service_status")));
}

TEST_F(RunTables, WithoutARecordingThereIsASentence) {
  const auto report = export_tables(folder_ / "none.mcap", folder_ / "out");
  ASSERT_FALSE(report.ok());
  EXPECT_THAT(report.error().message, HasSubstr("cannot be read"));
}

}  // namespace

}  // namespace railfix::tool
