// DDS side of the map matcher: sightings, track views and odometry in, position_fix out; train_state gives the search
// window.
#pragma once

#include <memory>
#include <string>

#include "map_matcher/map_matcher.hpp"
#include "map_matcher/map_matcher_config.hpp"
#include "service/left_out.hpp"
#include "service/service.hpp"

namespace railfix::map_matcher {

class MapMatcherService {
 public:
  using Config = MapMatcherConfig;
  MapMatcherService(const MapMatcherConfig& config, service::Context& context);

 private:
  void listen(const MapMatcherConfig& config);
  /// False, and counted, where an input makes no sense.
  template <typename Input>
  [[nodiscard]] bool takes(const char* topic, const Input& input);
  void use(const msg::TrainState& state);
  void use(const msg::OdometryStep& step);
  void use(const msg::TrackView& view);
  void use(const msg::LandmarkSighting& sighting);
  void use(const msg::GnssFix& fix);
  /// Unless this one stands by.
  void say(const PlaceFixes& fixes, int64_t grabbed_ns);

  service::Context& context_;
  messaging::Writer<msg::PositionFix> writer_;
  std::shared_ptr<const track::Map> map_;
  MapMatcher matcher_;
  service::LeftOut left_out_;
  int64_t state_ns_ = 0;  // of the last state
};

}  // namespace railfix::map_matcher
