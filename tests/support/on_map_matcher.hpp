// A test that is the train of a real map_matcher and gives it its turns of lock step: it writes the states, odometry
// steps and sightings of a ride at a steady speed, and keeps what the matcher says.
#pragma once

#include <unistd.h>

#include <filesystem>
#include <string>
#include <vector>

#include "messaging/direction.hpp"
#include "support/lock_step.hpp"
#include "track/map.hpp"

namespace railfix::test {

/// Tick 0 is where the data begin.
class OnMapMatcher : public InLockStep {
 protected:
  static constexpr double kPeriodS = 0.1;
  struct Ride {
    double speed_mps = 0;
    double begin_m = 0;  // of the way at tick 0
  };

  OnMapMatcher(const std::string& name, int64_t domain, const Ride& ride)
      : InLockStep(name + "-" + std::to_string(getpid()), domain), ride_(ride) {}
  ~OnMapMatcher() { std::filesystem::remove(map_file_); }

  /// With `map_matcher.key=value` settings besides the map; false when it does not come up.
  bool start_matcher(const track::Map& map, std::vector<std::string> settings = {}) {
    core::ok_or_throw(map.save(map_file_));
    settings.push_back("map_matcher.map=" + map_file_.string());
    start("map_matcher", settings);
    return connected();
  }

  [[nodiscard]] static int64_t stamp_ns(int64_t tick) {
    return core::to_ns(1000 + kPeriodS * static_cast<double>(tick));
  }
  /// Where the train is then.
  [[nodiscard]] double way_m(int64_t stamp_ns) const {
    return ride_.begin_m + ride_.speed_mps * core::seconds(stamp_ns - OnMapMatcher::stamp_ns(0));
  }
  [[nodiscard]] double way_m() const { return way_m(stamp_ns(tick_)); }

  /// The state of this tick at a place of the map, promised to so much on either side.
  [[nodiscard]] msg::TrainState state(const track::EdgePosition& place, double promised_m) const {
    msg::TrainState state;
    state.stamp_ns(stamp_ns(tick_));
    state.edge(place.edge);
    state.offset_m(place.offset_m);
    state.direction(messaging::direction_of(place.direction));
    state.distance_m(way_m());
    state.speed_mps(ride_.speed_mps);
    state.over_m(promised_m);
    state.under_m(promised_m);
    state.sigma_m(promised_m / 5);
    state.visual_scale(1);
    state.sources(msg::SOURCE_CAMERA);
    state.track_known(1);
    state.track_probability(1);
    return state;
  }
  /// The step from the tick before to this one, of an odometry that has seen no turning.
  [[nodiscard]] msg::OdometryStep step() const {
    msg::OdometryStep step;
    step.stamp_ns(stamp_ns(tick_));
    step.reference_stamp_ns(stamp_ns(tick_ - 1));
    step.step_m(ride_.speed_mps * kPeriodS);
    step.step_sigma_m(0.01);
    step.yaw_sigma_rad(1e-4);
    step.distance_m(way_m());
    step.speed_mps(ride_.speed_mps);
    step.mode(msg::ODOMETRY_TRACK);
    step.valid(1);
    return step;
  }
  /// The matcher uses what was written, and what it says of that is heard.
  void match() {
    give_turns({"map_matcher"}, stamp_ns(tick_));
    hear_all("position_fix", said_);
  }

  int64_t tick_ = 0;
  std::vector<msg::PositionFix> said_;
  messaging::Writer<msg::TrainState> states_{participant_, messaging::topics::train_state};
  messaging::Writer<msg::OdometryStep> steps_{participant_, messaging::topics::odometry_step};
  messaging::Writer<msg::LandmarkSighting> sightings_{participant_, messaging::topics::landmark_sighting};

 private:
  const Ride ride_;
  const std::filesystem::path map_file_ = std::filesystem::temp_directory_path() / (train_ + ".map");
  messaging::Reader<msg::PositionFix> fixes_{participant_, messaging::topics::position_fix, "", queue_,
                                             [this](const msg::PositionFix& fix) { said_.push_back(fix); }};
};

}  // namespace railfix::test
