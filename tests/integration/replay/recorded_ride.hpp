// A made-up line, and a recording of a ride along it: no pictures, but what odometry and track_detector said.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "core/random.hpp"
#include "core/time.hpp"
#include "mcap/writer.hpp"
#include "messaging/topics.hpp"
#include "track/map.hpp"

namespace railfix::test {

inline constexpr int64_t kBegin = 1'700'000'000 * core::kNsPerSecond;
inline constexpr int kFrames = 600;
inline constexpr int64_t kFrameNs = 33'333'333;
inline constexpr int kImuPerFrame = 3;
inline constexpr double kStepM = 0.7;
inline constexpr double kAheadM = 3;
inline constexpr double kMastsEveryM = 60;

inline void write_map(const std::filesystem::path& file) {
  track::Map map;
  map.edges = {{1, "line", 1, 2, "", track::Alignment::chained({0, 0, 1}, {{3000, 0, 0}})}};
  map.nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 3000, 0}};
  for (uint32_t i = 1; i * kMastsEveryM < 3000; ++i) {
    map.landmarks.push_back({i, track::LandmarkKind::mast, 1, i * kMastsEveryM, 3, 0.05, ""});
  }
  core::ok_or_throw(map.save(file));
}

class Recorded {
 public:
  explicit Recorded(const std::filesystem::path& file) : writer_(mcap::Writer::create(file, {}).value()) {}

  template <class T>
  void add(const messaging::Topic<T>& topic, T sample, int64_t stamp_ns) {
    const auto& type = messaging::type_of<T>();
    const auto schema = writer_->add_schema(type.name(), "omgidl", "").value();
    sample.stamp_ns(stamp_ns);
    const auto id = writer_->add_channel(schema, topic.name, "cdr", {}).value();
    // Later than the data, as in life.
    const int64_t log_ns = stamp_ns + 20'000'000;
    EXPECT_TRUE(writer_->write({id, 0, log_ns, log_ns, messaging::serialize(sample)}).ok());
  }
  void close() {
    const auto closed = writer_->close();
    EXPECT_TRUE(closed.ok());
  }

 private:
  std::unique_ptr<mcap::Writer> writer_;
};

// A ride along the map, with noise; odometry 0.5 % wrong, masts every 60 m. And a train_state of that day, which must
// not be heard beside that of now.
inline void record_ride(const std::filesystem::path& file) {
  core::Random random(7);
  namespace topics = messaging::topics;
  Recorded recorded(file);
  double at_m = 100;
  for (int i = 0; i < kFrames; ++i) {
    const int64_t stamp_ns = kBegin + i * kFrameNs;
    for (int k = 0; k < kImuPerFrame; ++k) {
      msg::ImuSample imu;
      imu.accel_x_mps2(0.02 * random.normal());
      imu.accel_z_mps2(9.81);
      imu.rate_z_rps(0.002 * random.normal());
      recorded.add(topics::imu_sample, imu, stamp_ns - (kImuPerFrame - 1 - k) * kFrameNs / kImuPerFrame);
    }
    msg::OdometryStep step;
    step.reference_stamp_ns(stamp_ns - kFrameNs);
    step.step_m(1.005 * kStepM + 0.003 * random.normal());
    step.step_sigma_m(0.004);
    step.yaw_sigma_rad(0.001);
    step.distance_m(1.005 * (at_m - 100));
    step.speed_mps(kStepM / core::seconds(kFrameNs));
    step.mode(msg::ODOMETRY_TRACK);
    step.valid(1);
    recorded.add(topics::odometry_step, step, stamp_ns);
    const double before_m = at_m + kAheadM;
    if (std::floor((before_m + kStepM) / kMastsEveryM) > std::floor(before_m / kMastsEveryM)) {
      msg::LandmarkSighting sighting;
      const double mast_m = kMastsEveryM * std::floor((before_m + kStepM) / kMastsEveryM);
      sighting.distance_ahead_m(mast_m - at_m + 0.05 * random.normal());
      sighting.lateral_m(3);
      sighting.sigma_m(0.1);
      sighting.confidence(0.95);
      sighting.kind(msg::SIGHTING_MAST);
      recorded.add(topics::landmark_sighting, sighting, stamp_ns);
    }
    recorded.add(topics::train_state, msg::TrainState(), stamp_ns);
    at_m += kStepM;
  }
  recorded.close();
}

}  // namespace railfix::test
