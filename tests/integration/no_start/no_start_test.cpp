// map_matcher without its usual inputs, as a program over DDS; this test is the rest of the train and gives the turns
// of lock step. Nobody knows where the train stands: the place is found from the way it bends, and fusion starts from
// there. Nobody sees anything: without a single odometry step the gyro tells which leg of a switch was taken.
#include <gtest/gtest.h>

#include <map>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"
#include "support/lock_step.hpp"
#include "support/sensed_ride.hpp"
#include "track/path.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;

constexpr int kDomain = 84;
constexpr uint32_t kEdge = 5;
constexpr double kFromM = 300;
constexpr double kToM = 2300;
constexpr double kStepM = 1.6;
constexpr double kScale = 1.012;  // measured metres are too many
constexpr int64_t kStepNs = 100'000'000;
constexpr int64_t kBeginNs = 1'700'000'000'000'000'000;

// Twelve lines that bend differently, far from each other.
track::Map made_map() {
  core::Random random(8);
  track::Map map;
  map.crs = "EPSG:2056";
  for (uint32_t id = 1; id <= 12; ++id) {
    std::vector<track::Element> elements;
    for (double sum_m = 0; sum_m < 3000;) {
      const double curvature = (random.uniform() < 0.5 ? -1 : 1) / random.uniform(300, 1000);
      for (const auto& e :
           {track::Element{random.uniform(80, 300), 0, 0}, track::Element{60, 0, curvature},
            track::Element{random.uniform(80, 250), curvature, curvature}, track::Element{60, curvature, 0}}) {
        elements.push_back(e);
        sum_m += e.length_m;
      }
    }
    map.nodes.push_back({2 * id - 1, track::NodeKind::end, "", 0, 0});
    map.nodes.push_back({2 * id, track::NodeKind::end, "", 0, 0});
    map.edges.push_back(
        {id, "line", 2 * id - 1, 2 * id, "", track::Alignment::chained({2600000 + 5000.0 * id, 1200000, 0}, elements)});
  }
  return map;
}

class MatcherInLockStep : public ::testing::Test, protected test::InLockStep {
 protected:
  MatcherInLockStep() : InLockStep("no-start-" + std::to_string(getpid()), kDomain) {
    listen(topics::train_state, [this](const msg::TrainState& s) { states_.push_back(s); });
    listen(topics::position_fix, [this](const msg::PositionFix& f) { fixes_.push_back(f); });
  }
  ~MatcherInLockStep() override { fs::remove(map_file_); }

  const fs::path map_file_ = fs::temp_directory_path() / ("railfix-" + train_ + ".map");
  std::vector<msg::TrainState> states_;
  std::vector<msg::PositionFix> fixes_;
};

/// A train on one of the lines, whose camera and gyro feel how it turns.
class NoStart : public MatcherInLockStep {
 protected:
  void ride(const std::string& start_told, double to_m, bool gnss = false) {
    const track::Map map = made_map();
    ASSERT_TRUE(map.save(map_file_).ok());
    messaging::Writer<msg::OdometryStep> steps(participant_, topics::odometry_step);
    messaging::Writer<msg::ImuSample> inertial(participant_, topics::imu_sample);
    messaging::Writer<msg::GnssFix> receiver(participant_, topics::gnss_fix);
    start("map_matcher", {"map_matcher.map=" + map_file_.string(), "map_matcher.locate_every_m=100"});
    start("fusion", {"fusion.map=" + map_file_.string(), "fusion.start=" + start_told});
    ASSERT_TRUE(connected());

    testing::RideErrors errors;
    errors.odometer_scale = kScale - 1;
    errors.turn_bias_rps = errors.turn_noise_rps = 0;
    errors.step_turn_noise_rad = 3e-4;
    errors.bogies_behind_m = errors.bogie_distance_m = 0;  // curvature fixes know nothing of a body that turns late
    const auto& alignment = map.edge(kEdge)->alignment;
    const testing::VehicleHeading heading([&](double m) { return alignment.curvature_at(m); }, 0, 3000, errors);
    testing::RideSensors sensors(errors, 4);
    double distance_m = 0;
    int64_t stamp_ns = kBeginNs;
    for (double at_m = kFromM; at_m < to_m; at_m += kStepM) {
      stamp_ns += kStepNs;
      const auto sensed = sensors.step(heading, 0, at_m, at_m + kStepM, core::seconds(kStepNs));
      distance_m += sensed.way_m;
      truth_m_[stamp_ns] = at_m + kStepM;
      ASSERT_TRUE(inertial.write(felt(stamp_ns, sensed.turn_rad)));
      if (gnss && stamp_ns % 1'000'000'000 == 0) receiver.write(received(map, stamp_ns));
      ASSERT_TRUE(steps.write(step(stamp_ns, sensed, distance_m)));
      give_turns({"map_matcher", "fusion"}, stamp_ns);
    }
    hear_all("train_state", states_);
  }
  [[nodiscard]] static msg::ImuSample felt(int64_t stamp_ns, double turn_rad) {
    msg::ImuSample sample;
    sample.stamp_ns(stamp_ns);
    sample.accel_x_mps2(1e-6 * static_cast<double>(stamp_ns / kStepNs % 7));  // no two alike, as from a real one
    sample.rate_z_rps(turn_rad / core::seconds(kStepNs));
    return sample;
  }
  /// Some metres off; every fifth time the receiver has no position.
  [[nodiscard]] msg::GnssFix received(const track::Map& map, int64_t stamp_ns) const {
    const auto pose = map.edge(kEdge)->alignment.at(truth_m_.at(stamp_ns)).pose;
    const auto geo = map.to_geo(pose.easting_m + 3, pose.northing_m - 2).value();
    msg::GnssFix fix;
    fix.stamp_ns(stamp_ns);
    if (stamp_ns / 1'000'000'000 % 5 == 0) {
      fix.lat_deg(std::nan(""));
      fix.lon_deg(std::nan(""));
      fix.hdop(std::nan(""));
      fix.fix(msg::GNSS_NONE);
      return fix;
    }
    fix.lat_deg(geo.lat_deg);
    fix.lon_deg(geo.lon_deg);
    fix.hdop(1);
    fix.fix(msg::GNSS_SINGLE);
    return fix;
  }
  [[nodiscard]] static msg::OdometryStep step(int64_t stamp_ns, const testing::SensedStep& sensed, double distance_m) {
    msg::OdometryStep step;
    step.stamp_ns(stamp_ns);
    step.reference_stamp_ns(stamp_ns - kStepNs);
    step.step_m(sensed.way_m);
    step.step_sigma_m(0.005);
    step.yaw_rad(sensed.turn_rad);
    step.yaw_sigma_rad(sensed.turn_sigma_rad);
    step.distance_m(distance_m);
    step.speed_mps(sensed.way_m / core::seconds(kStepNs));
    step.mode(msg::ODOMETRY_TRACK);
    step.valid(1);
    return step;
  }
  void expect_right(const msg::TrainState& state) const {
    ASSERT_EQ(state.edge(), kEdge);
    EXPECT_EQ(state.direction(), msg::DIRECTION_FORWARD);
    const double error_m = truth_m_.at(state.stamp_ns()) - state.offset_m();
    EXPECT_LE(error_m, state.under_m());
    EXPECT_GE(error_m, -state.over_m());
  }

  std::map<int64_t, double> truth_m_;
};

TEST_F(NoStart, ThePlaceIsFoundOnTheMapAndFusionStartsThere) {
  ride("unknown", kToM);
  size_t unknown = 0;
  size_t known = 0;
  for (const auto& state : states_) {
    if (state.track_known() == 0) {
      ++unknown;
      EXPECT_EQ(known, 0U) << "the place was known and forgotten";
      continue;
    }
    ++known;
    expect_right(state);
  }
  EXPECT_GT(unknown, 400U) << "found sooner than anybody can know";
  EXPECT_GT(known, 100U) << "not found within " << kToM - kFromM << " m";
  ASSERT_FALSE(fixes_.empty());
  EXPECT_EQ(fixes_.front().kind(), msg::FIX_NETWORK);
  EXPECT_GT(fixes_.front().probability(), 0.999);
}

// The operator has chosen another line.
TEST_F(NoStart, AStartThatWasToldWronglyIsGivenUpAndThePlaceIsFound) {
  ride("9:500:+", 2900);
  const auto told = [](const msg::TrainState& state) { return state.track_known() != 0; };
  const auto given_up = std::ranges::find_if_not(states_, told);
  ASSERT_NE(given_up, states_.end());
  EXPECT_NEAR(given_up->distance_m(), 1500, 400);
  const auto found = std::find_if(given_up, states_.end(), told);
  ASSERT_NE(found, states_.end());
  EXPECT_EQ((given_up - 1)->integrity(), msg::INTEGRITY_UNUSABLE);
  EXPECT_GT(states_.end() - found, 100);
  for (auto state = found; state != states_.end(); ++state) {
    ASSERT_NE(state->track_known(), 0);
    expect_right(*state);
  }
}

TEST_F(NoStart, GnssSaysItWithinSomeHundredMetres) {
  ride("unknown", kFromM + 600, true);
  const auto known = std::ranges::find_if(states_, [](const auto& state) { return state.track_known() != 0; });
  ASSERT_NE(known, states_.end());
  EXPECT_LT(known->distance_m(), 350);
  for (auto state = known; state != states_.end(); ++state) {
    ASSERT_NE(state->track_known(), 0);
    expect_right(*state);
  }
  EXPECT_GE(states_.back().track_probability(), 0.999);
  for (const auto* service : {"fusion", "map_matcher"})
    EXPECT_EQ(std::string(status(service).reason().c_str()).find("gnss_fix"), std::string::npos) << service;
}

// 300 m straight, then a switch: edge 2 goes straight on, edge 3 bends to the left.
track::Map switch_map() {
  constexpr double kSwitchM = 300;
  track::Map map;
  const auto edge = [&](uint32_t id, uint32_t from, uint32_t to, double begin_m, std::vector<track::Element> elements) {
    map.edges.push_back({id, "", from, to, "", track::Alignment::chained({begin_m, 0, core::kPi / 2}, elements)});
  };
  edge(1, 1, 2, 0, {{kSwitchM, 0, 0}});
  edge(2, 2, 3, kSwitchM, {{400, 0, 0}});
  edge(3, 2, 4, kSwitchM, {{400, 1.0 / 300, 1.0 / 300}});
  for (const auto& [id, kind] : {std::pair{1U, track::NodeKind::end},
                                 {2U, track::NodeKind::railway_switch},
                                 {3U, track::NodeKind::end},
                                 {4U, track::NodeKind::end}}) {
    map.nodes.push_back({id, kind, "", 0, 0});
  }
  map.connections = {{2, 1, 2, false}, {2, 1, 3, true}};
  return map;
}

using NoCamera = MatcherInLockStep;
TEST_F(NoCamera, TheGyroTellsTheLegWithoutAnOdometryStep) {
  constexpr double kSpeedMps = 15;
  constexpr double kGyroBiasRps = 0.002;
  constexpr double kEndM = 400;
  constexpr int kStandingSteps = 50;
  const track::Map map = switch_map();
  ASSERT_TRUE(map.save(map_file_).ok());
  messaging::Writer<msg::TrainState> state_writer(participant_, topics::train_state);
  messaging::Writer<msg::ImuSample> imu_writer(participant_, topics::imu_sample);
  start("map_matcher", {"map_matcher.map=" + map_file_.string()});
  ASSERT_TRUE(connected());

  core::Random random(3);
  double at_m = 200;
  uint64_t seq = 0;
  while (at_m < kEndM) {
    const int64_t stamp_ns = kBeginNs + static_cast<int64_t>(++seq) * kStepNs;
    const bool stands = seq <= kStandingSteps;
    const double begin_m = at_m;
    if (!stands) at_m += kSpeedMps * core::seconds(kStepNs);
    for (int i = 1; i <= 5; ++i) {
      const bool bends = begin_m + (at_m - begin_m) * i / 5 > 300;
      msg::ImuSample sample;
      sample.stamp_ns(stamp_ns - kStepNs + i * kStepNs / 5);
      sample.rate_z_rps((stands || !bends ? 0 : kSpeedMps / 300) + kGyroBiasRps + 0.002 * random.normal());
      ASSERT_TRUE(imu_writer.write(sample));
    }
    // Fusion follows the straight leg until it is told otherwise.
    const bool told = !fixes_.empty() && fixes_.back().edge() == 3 && fixes_.back().probability() > 0.999;
    msg::TrainState state;
    state.stamp_ns(stamp_ns);
    state.edge(at_m < 300 ? 1 : told ? 3 : 2);
    state.offset_m(at_m < 300 ? at_m : at_m - 300);
    state.direction(msg::DIRECTION_FORWARD);
    state.track_known(1);
    state.standstill(stands ? 1 : 0);
    state.speed_mps(stands ? 0 : kSpeedMps);
    state.distance_m(at_m);
    state.over_m(4);
    state.under_m(4);
    state.sigma_m(1);
    ASSERT_TRUE(state_writer.write(state));
    give_turns({"map_matcher"}, stamp_ns);
    hear_all("position_fix", fixes_);
  }
  ASSERT_FALSE(fixes_.empty());
  EXPECT_EQ(fixes_.back().edge(), 3U);
  EXPECT_GT(fixes_.back().probability(), 0.999);
  for (const auto& fix : fixes_) {
    EXPECT_EQ(fix.kind(), msg::FIX_TRACK);
    EXPECT_FALSE(fix.edge() == 2 && fix.probability() >= 0.999) << "the other leg was declared";
  }
}

}  // namespace
}  // namespace railfix
