// DDS side of the map matcher: sightings, track views and odometry in, position_fix out; train_state gives the search
// window.
#pragma once

#include <memory>
#include <optional>

#include "map_matcher/followed_path.hpp"
#include "map_matcher/inputs.hpp"
#include "map_matcher/landmark_matcher.hpp"
#include "map_matcher/locate/gnss_search.hpp"
#include "map_matcher/locate/network_locator.hpp"
#include "map_matcher/map_matcher_config.hpp"
#include "map_matcher/shape/curvature_matcher.hpp"
#include "map_matcher/shape/curve_exit_matcher.hpp"
#include "map_matcher/step_chain.hpp"
#include "map_matcher/track_choice/gyro_turn.hpp"
#include "map_matcher/track_choice/track_chooser.hpp"
#include "service/left_out.hpp"
#include "service/service.hpp"

namespace railfix::map_matcher {

class MapMatcherService {
 public:
  using Config = MapMatcherConfig;
  MapMatcherService(const MapMatcherConfig& config, service::Context& context);

 private:
  void restart();
  /// False, and counted, where an input makes no sense.
  template <typename Input>
  [[nodiscard]] bool takes(const char* topic, const Input& input);
  void use(const msg::TrainState& state);
  void use(const msg::OdometryStep& step);
  void use(const msg::TrackView& view);
  void use(const msg::LandmarkSighting& sighting);
  core::Status follow(const msg::TrainState& state);
  void forget_place();
  void stand(int64_t from_ns, int64_t to_ns);
  /// The window at a stamp, extrapolated from the last state; nothing when the place is not known or the state is too
  /// old.
  [[nodiscard]] std::optional<Prior> prior_at(int64_t stamp_ns) const;
  /// What the last step adds to the one before it, as the camera saw it.
  [[nodiscard]] std::optional<Turn> turn_of_camera() const;
  /// The same from the gyro, for as long as the camera cannot say.
  [[nodiscard]] std::optional<Turn> turn_of_gyro(int64_t from_ns, int64_t to_ns) const;
  const std::shared_ptr<const NetworkIndex>& index();
  void look_for_place(const msg::OdometryStep& step);
  void look_for_place(const msg::GnssFix& fix);
  void publish_place(const std::vector<LocatedPlace>& places, uint8_t kind, int64_t stamp_ns, int64_t grabbed_ns);
  /// What is known of a place that is not known.
  [[nodiscard]] std::string placeless() const;
  void follow_turning(const msg::OdometryStep& step);
  void follow_without_camera();
  [[nodiscard]] TrackWindow window_at(const Prior& prior) const;
  void move(const Turn& turn, int64_t to_ns);
  void move_without_camera(int64_t to_ns);
  /// How probable it is that the train is somewhere else on the map; 0 where that is less probable than not.
  [[nodiscard]] double place_doubt() const;
  void say_track(double odometer_m, int64_t grabbed_ns);
  void publish(const Fix& fix, uint8_t kind, int64_t grabbed_ns);
  /// Unless this one stands by.
  void send(const msg::PositionFix& fix, int64_t grabbed_ns);

  MapMatcherConfig config_;
  service::Context& context_;
  messaging::Writer<msg::PositionFix> writer_;
  std::shared_ptr<const track::Map> map_;
  std::shared_ptr<const track::Ways> ways_;
  std::optional<FollowedPath> followed_;
  std::optional<LandmarkMatcher> landmarks_;
  std::optional<CurvatureMatcher> curvature_;
  std::optional<CurveExitMatcher> exits_;  // instead of it, where the configuration says so
  GyroTurn gyro_;
  std::optional<msg::TrainState> state_;
  std::optional<msg::OdometryStep> step_;
  StepChain chain_;  // of all steps so far
  service::LeftOut left_out_;
  int64_t rails_seen_ns_ = 0;
  std::optional<TrackChooser> chooser_;
  std::shared_ptr<const NetworkIndex> index_;  // from when it is first needed on
  std::optional<NetworkLocator> locator_;      // only while the place is not known, or no position
  std::optional<GnssSearch> gnss_;             // only while the place is not known
  bool of_gnss_ = false;                       // it has told the place
  double located_m_ = 0;                       // odometer at the last search
  double matched_m_ = 0;                       // odometer at the last match
  int64_t moved_ns_ = 0;                       // the chooser has come to this time
  /// What was said of the track last.
  struct SaidTrack {
    uint32_t edge = 0;
    bool known = false;
    int64_t stamp_ns = 0;
    double odometer_m = 0;
    double there = 1;  // the share of place_doubt() in the probability
  };
  SaidTrack said_track_;
};

}  // namespace railfix::map_matcher
