// What the map says of where the train is: landmarks and the track's shape are matched near the place that fusion
// knows, the track behind switches is chosen, and a place that nobody knows is searched for. No DDS and no clock.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "map_matcher/beside_doubt.hpp"
#include "map_matcher/followed_path.hpp"
#include "map_matcher/inputs.hpp"
#include "map_matcher/landmark_matcher.hpp"
#include "map_matcher/landmark_silence.hpp"
#include "map_matcher/locate/place_search.hpp"
#include "map_matcher/map_matcher_parameters.hpp"
#include "map_matcher/shape/curvature_matcher.hpp"
#include "map_matcher/shape/curve_exit_matcher.hpp"
#include "map_matcher/step_chain.hpp"
#include "map_matcher/track_choice/gyro_turn.hpp"
#include "map_matcher/track_choice/track_chooser.hpp"

namespace railfix::map_matcher {

enum class FixKind : uint8_t { landmark, curvature, track, network, gnss };

/// A position_fix. Of places and tracks that are weighed against each other the others follow the best one.
struct PlaceFix {
  FixKind kind = FixKind::landmark;
  int64_t stamp_ns = 0;
  std::vector<TrackOption> options;  // one at least, best first
  double sigma_m = 0;                // along the track; infinite for a track
  uint32_t landmark = 0;
  SightingsFit sightings_fit = SightingsFit::not_told;
};
using PlaceFixes = std::vector<PlaceFix>;

/// REQUIRES of every input: has_sense() (a state: where its place is known).
class MapMatcher {
 public:
  /// Without a map (nullptr) nothing is ever said.
  MapMatcher(const MapMatcherParameters& parameters, std::shared_ptr<const track::Map> map);

  PlaceFixes add(const StateInput& state);
  PlaceFixes add(const StepInput& said);
  PlaceFixes add(const Sighting& sighting);
  PlaceFixes add(const GnssInput& position);
  /// Of rails that are seen.
  void add(const ViewInput& view);
  void add(const GyroInput& sample) { gyro_.add(sample.stamp_ns, sample.rate_rps); }
  /// All that was matched so far is of another ride.
  void restart();
  /// Why nothing is matched, or what is does not fit, since the last state; empty = nothing is wrong.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }
  /// A GNSS position would help.
  [[nodiscard]] bool wants_gnss() const { return map_ && parameters_.locate && search_.searches(); }

 private:
  void forget_place();
  void forget_track();
  [[nodiscard]] std::string trouble_at(const StateInput& state);
  [[nodiscard]] std::string placeless() const;
  core::Status follow(const StateInput& state);
  /// Of landmarks that are not sighted.
  void listen_for_silence(const StateInput& state);
  void stand(int64_t from_ns, int64_t to_ns);
  /// The window at a stamp, extrapolated from the last state; nothing when the place is not known or the state is too
  /// old.
  [[nodiscard]] std::optional<Prior> prior_at(int64_t stamp_ns) const;
  /// What the last step adds to the one before it, as the camera saw it.
  [[nodiscard]] std::optional<Turn> turn_of_camera() const;
  /// The same from the gyro, for as long as the camera cannot say.
  [[nodiscard]] std::optional<Turn> turn_of_gyro(int64_t from_ns, int64_t to_ns) const;
  void search(const StepInput& step, PlaceFixes& fixes);
  void search_by(const std::optional<Turn>& turn, int64_t stamp_ns, PlaceFixes& fixes);
  [[nodiscard]] bool has_pictures() const;
  [[nodiscard]] bool trusts_camera() const;
  [[nodiscard]] bool trusts(const StepInput& step) const;
  void match_shape(const StepInput& step, PlaceFixes& fixes);
  void match_shape_without_camera(int64_t to_ns, PlaceFixes& fixes);
  void match_shape(int64_t stamp_ns, PlaceFixes& fixes);
  /// Odometer of the shape's matchers: the camera's way, and fusion's where that sees nothing.
  [[nodiscard]] double shape_m() const { return chain_.odometer_m() + unseen_m_; }
  void follow_turning(const StepInput& step, PlaceFixes& fixes);
  void search_without_camera(PlaceFixes& fixes);
  void follow_without_camera(PlaceFixes& fixes);
  [[nodiscard]] TrackWindow window_at(const Prior& prior) const;
  void move(const Turn& turn, int64_t to_ns);
  void move_without_camera(int64_t to_ns);
  /// How probable it is that the train is somewhere else on the map; 0 where that is less probable than not.
  [[nodiscard]] double place_doubt() const;
  [[nodiscard]] bool is_followed(const track::EdgePosition& place) const;
  /// How probable it is that the landmark is that of the followed track, by what is known of the track.
  [[nodiscard]] double share_of_followed(uint32_t landmark) const;
  /// Of a train on a declared track: is it the one beside?
  void compare_with_beside(const Sighting& sighting, const Prior& prior);
  void say_track(PlaceFixes& fixes);
  void say(const Fix& fix, FixKind kind, PlaceFixes& fixes) const;

  MapMatcherParameters parameters_;
  std::shared_ptr<const track::Map> map_;
  std::shared_ptr<const track::Ways> ways_;
  PlaceSearch search_;
  std::optional<FollowedPath> followed_;
  std::optional<LandmarkMatcher> landmarks_;
  LandmarkSilence silence_;
  std::shared_ptr<const track::TracksBeside> tracks_beside_;
  std::optional<BesideDoubt> beside_;
  std::optional<CurvatureMatcher> curvature_;
  std::optional<CurveExitMatcher> exits_;  // instead of it, where the parameters say so
  GyroTurn gyro_;
  std::optional<StateInput> state_;
  std::optional<StepInput> step_;
  StepChain chain_;  // of all steps so far
  int64_t rails_seen_ns_ = 0;
  std::optional<TrackChooser> chooser_;
  double matched_m_ = 0;     // shape_m() at the last match
  double unseen_m_ = 0;      // way that no camera measured
  int64_t shaped_ns_ = 0;    // the shape's matchers have come to this time
  int64_t moved_ns_ = 0;     // the chooser has come to this time
  int64_t searched_ns_ = 0;  // ... and the search, where no camera leads it
  std::string trouble_;
  /// What was said of the track last.
  struct SaidTrack {
    uint32_t edge = 0;
    bool known = false;
    int64_t stamp_ns = 0;
    double travelled_m = 0;
    double there = 1;  // and not elsewhere on the map or on the track beside
  };
  SaidTrack said_track_;
};

}  // namespace railfix::map_matcher
