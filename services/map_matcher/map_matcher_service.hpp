// DDS side of the map matcher: sightings, track views and odometry in, position_fix out; train_state gives the search
// window.
#pragma once

#include <memory>
#include <optional>

#include "map_matcher/curvature_matcher.hpp"
#include "map_matcher/landmark_matcher.hpp"
#include "map_matcher/map_matcher_config.hpp"
#include "service/service.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {

class MapMatcherService {
 public:
  using Config = MapMatcherConfig;
  MapMatcherService(const MapMatcherConfig& config, service::Context& context);

 private:
  void use(const msg::TrainState& state);
  void use(const msg::OdometryStep& step);
  void use(const msg::TrackView& view);
  void use(const msg::LandmarkSighting& sighting);
  void follow(const msg::TrainState& state);
  /// The window at a stamp, extrapolated from the last state; nothing when the place is not known or the state is too
  /// old.
  [[nodiscard]] std::optional<Prior> prior_at(int64_t stamp_ns) const;
  void publish(const Fix& fix, uint8_t kind, int64_t grabbed_ns);

  MapMatcherConfig config_;
  service::Context& context_;
  messaging::Writer<msg::PositionFix> writer_;
  std::shared_ptr<const track::Map> map_;
  std::shared_ptr<const track::Path> path_;
  std::optional<LandmarkMatcher> landmarks_;
  std::optional<CurvatureMatcher> curvature_;
  std::optional<msg::TrainState> state_;
  std::optional<msg::OdometryStep> step_;
  double matched_m_ = 0;  // odometer at the last match
};

}  // namespace railfix::map_matcher
