// A train in one process: the real fusion, map_matcher and tpr_publisher in a loop, through the messages that they send
// each other, against where the train really is.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "support/failing_gyro.hpp"
#include "track/map.hpp"
#include "track/ways.hpp"

namespace railfix::measure {

struct Stretch {
  double from_m = 0;
  double to_m = 0;
};

/// Distances are those of the way, from the begin of its first run.
struct Ride {
  std::shared_ptr<const track::Map> map;
  std::vector<track::Run> way;
  double begin_m = 100;
  double end_m = 0;
  std::optional<track::EdgePosition> told;  // where the train is said to start; nothing: nobody knows
  double speed_mps = 25;
  double camera_scale = 0;           // of the odometry's steps
  std::vector<Stretch> dark;         // nothing is seen there
  std::vector<double> matcher_anew;  // map_matcher is started anew there
  bool gyro = true;
  testing::GyroFault gyro_fault = testing::GyroFault::none;
  double gyro_fault_rps = 0;  // the error, or the noise of a sample
  Stretch gyro_fails;         // there
  bool gnss = false;
  double detection = 0.95;
  uint64_t seed = 1;
};

struct Tally {
  size_t states = 0;
  size_t declared = 0;  // track known and usable
  size_t ok = 0;
  size_t outside = 0;       // declared, and the interval does not hold the train
  size_t wrong = 0;         // declared, and the track is another one
  size_t wrong_ok = 0;      // ... and ok
  size_t reports = 0;       // that name a balise group
  size_t false_ones = 0;    // of these: not on the way, not passed, or the distance does not hold the train
  double undeclared_m = 0;  // longest way

  void add(const Tally& other);
  [[nodiscard]] std::string text() const;
};

Tally run(const Ride& ride);

}  // namespace railfix::measure
