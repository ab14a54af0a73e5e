#include "map_matcher/map_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/time.hpp"
#include "core/train_limits.hpp"
#include "track/same_map.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kRailsFreshS = 0.5;
constexpr double kShortestStepM = 0.05;
constexpr double kTrackEveryS = 1.0;      // the track is said again after this time ...
constexpr double kOpenTrackEveryM = 2.0;  // ... or, while it is not known, this way
constexpr double kCountM = 20.0;
constexpr double kCreepMps = 0.3;     // slower than that the sign of a speed may be its noise
constexpr double kWorthSaying = 0.5;  // probability of the track beside
constexpr double kHardBrakeMps2 = 1.5;
constexpr double kOtherWayM = 0.1;      // the camera's way is another than fusion's from this on ...
constexpr double kOtherWayShare = 0.2;  // ... and this share of it
constexpr double kRateShare = 0.75;     // of the curvature's sigma comes from its unknown rate

// What was nearest a while ago, from where the train is at that stamp: search and chooser know no earlier places.
Sighting sighted_at(int64_t stamp_ns, double speed_mps, Sighting sighting) {
  const double since_s = core::seconds(stamp_ns - sighting.stamp_ns);
  if (!std::isfinite(speed_mps) || std::abs(since_s) > FollowedPath::kOldStateS) return sighting;
  sighting.stamp_ns = stamp_ns;
  sighting.distance_ahead_m -= speed_mps * since_s;
  return sighting;
}

// A fusion that was started anew may count the travelled distance from elsewhere.
bool counts_on(const PlacedTrain& before, const PlacedTrain& state) {
  const double since_s = core::seconds(state.stamp_ns - before.stamp_ns);
  const double moved_m = state.distance_m - before.distance_m;
  if (!std::isfinite(state.speed_mps)) return std::abs(moved_m) <= kCountM + core::kFastestTrainMps * std::abs(since_s);
  const double expected_m = state.speed_mps * since_s;
  return std::abs(moved_m - expected_m) <= kCountM + 0.5 * std::abs(expected_m);
}

PlaceFix fix_of(FixKind kind, int64_t stamp_ns, const std::vector<LocatedPlace>& places) {
  PlaceFix fix{kind, stamp_ns, {}, places.front().sigma_m};
  for (const auto& place : places) fix.options.push_back({place.place, place.probability});
  return fix;
}

}  // namespace

MapMatcher::MapMatcher(const MapMatcherParameters& parameters, std::shared_ptr<const track::Map> map)
    : parameters_(parameters),
      map_(std::move(map)),
      search_(parameters.search_parameters(), map_),
      gyro_(parameters.gyro) {
  if (!map_) return;
  ways_ = std::make_shared<const track::Ways>(*map_);
  followed_.emplace(map_, ways_);
  if (!parameters.choose_track) return;
  chooser_.emplace(parameters.track_parameters(), map_, ways_);
  tracks_beside_ = std::make_shared<const track::TracksBeside>(map_);
  beside_.emplace(parameters.landmarks, tracks_beside_);
}

// What was matched so far is of another place.
void MapMatcher::forget_place() {
  if (followed_) followed_->forget();
  landmarks_.reset();
  silence_ = {};
  curvature_.reset();
  exits_.reset();
  forget_track();
}

void MapMatcher::forget_track() {
  if (chooser_) chooser_.emplace(parameters_.track_parameters(), map_, ways_);
  if (beside_) beside_->begin_anew();
  moved_ns_ = 0;
  said_track_ = {};
}

void MapMatcher::restart() {
  forget_place();
  search_.forget();
  gyro_ = GyroTurn(parameters_.gyro);
  state_.reset();
  step_.reset();
  chain_ = {};
  rails_seen_ns_ = 0;
  searched_ns_ = 0;
  shaped_ns_ = 0;
  matched_m_ = 0;
  unseen_m_ = 0;
}

PlaceFixes MapMatcher::add(const StateInput& state) {
  const auto before = std::exchange(state_, state);
  if (before && before->standstill && state.standstill) stand(before->placed.stamp_ns, state.placed.stamp_ns);
  if (!state.track_known && before && before->track_known) forget_place();
  search_.follow(state.track_known, state.usable);
  const bool anew = before && !counts_on(before->placed, state.placed);
  if (landmarks_ && anew) landmarks_->forget(state.placed.distance_m);
  if (before && core::seconds(state.placed.stamp_ns - before->placed.stamp_ns) > FollowedPath::kOldStateS)
    silence_.begin_way();
  const auto path = followed_ ? followed_->path() : nullptr;
  trouble_ = trouble_at(state);
  if (anew && followed_ && followed_->path() != path) forget_track();  // somebody has told another one
  PlaceFixes fixes;
  if (!state_) return fixes;
  if (map_ && parameters_.locate) search_without_camera(fixes);
  if (!state.track_known || has_pictures()) return fixes;
  if (chooser_) follow_without_camera(fixes);
  if (curvature_ && parameters_.use_curvature) match_shape_without_camera(state.placed.stamp_ns, fixes);
  return fixes;
}

std::string MapMatcher::trouble_at(const StateInput& state) {
  if (!map_ || !state.track_known) return placeless();
  if (!track::lies_there(*map_, state.placed.place, state.pose)) {
    restart();  // what was matched so far is of another map as well
    return "train_state is of another map than map_matcher.map: give both services the same file";
  }
  if (const auto followed = follow(state); !followed.ok()) return followed.error().message;
  listen_for_silence(state);
  if (place_doubt() > 0) return "the sightings fit the map nowhere near the place that train_state says";
  if (beside_ && beside_->probability() > kWorthSaying) {
    return "balises or frogs are sighted where a track beside has them and the one that train_state says has none: the "
           "train was told on the wrong track, or the map lacks them";
  }
  return silence_.trouble();
}

void MapMatcher::listen_for_silence(const StateInput& state) {
  if (!parameters_.use_landmarks) return;
  const auto prior = prior_at(state.placed.stamp_ns);
  if (!prior) return silence_.begin_way();
  const bool rails_in_sight = std::abs(core::seconds(state.placed.stamp_ns - rails_seen_ns_)) < kRailsFreshS;
  silence_.run_on(*followed_->path(), prior->path_distance_m, rails_in_sight);
}

std::string MapMatcher::placeless() const {
  if (!map_) return "no map is configured";
  std::string said = "the place on the map is not known yet";
  const auto tracks = search_.tracks();
  if (tracks == 0U) said += "; no track on the map where GNSS says the train is";
  if (tracks > 1U) said += "; GNSS cannot tell which of " + std::to_string(*tracks) + " tracks it is on";
  return said;
}

// Whoever follows the gyro now must not have its constant error changed below it.
void MapMatcher::stand(int64_t from_ns, int64_t to_ns) {
  if (!chooser_ || chooser_->sensor() != TurnSensor::gyro) {
    gyro_.stood(from_ns, to_ns);
  } else if (const auto turn = gyro_.at_rest(from_ns, to_ns)) {
    chooser_->stand(*turn);
  }
}

core::Status MapMatcher::follow(const StateInput& state) {
  const auto way = followed_->follow(state.placed);
  if (!way.ok()) return way.error();
  if (way.value() == FollowedPath::Way::same) return {};
  const auto& path = followed_->path();
  if (way.value() == FollowedPath::Way::other_path) {
    landmarks_->change_path(path);
    curvature_->change_path(path);
  } else {
    landmarks_.emplace(parameters_.landmarks, path, state.placed.distance_m);
    silence_.begin_way();
    curvature_.emplace(parameters_.curvature_parameters(), path);
  }
  if (parameters_.curve_method == "exits") exits_.emplace(parameters_.exit_parameters(), path);
  return {};
}

std::optional<Prior> MapMatcher::prior_at(int64_t stamp_ns) const {
  if (!state_ || !followed_ || !state_->track_known) return std::nullopt;
  return followed_->prior_at(stamp_ns, state_->placed);
}

// Fusion knows from the other sensors whether the camera measures: a picture that stands still says that the train
// does.
bool MapMatcher::trusts_camera() const {
  return !state_ || state_->camera_agrees;
}

// Fusion takes a moment to tell, in which the way would be lost.
bool MapMatcher::trusts(const StepInput& step) const {
  if (!trusts_camera()) return false;
  if (!state_ || !step.measured) return true;
  const double step_s = core::seconds(step.stamp_ns - step.reference_stamp_ns);
  const double since_s = std::abs(core::seconds(step.stamp_ns - state_->placed.stamp_ns));
  if (since_s > FollowedPath::kOldStateS) return true;
  const double expected_m = state_->placed.speed_mps * step_s;
  const double faster_mps = kHardBrakeMps2 * (since_s + 0.5 * step_s);
  const double most_m = kOtherWayM + kOtherWayShare * std::abs(expected_m) + faster_mps * step_s;
  const bool is_other = std::abs(step.step_m * state_->visual_scale - expected_m) > most_m;  // no speed tells nothing
  return !is_other;
}

PlaceFixes MapMatcher::add(const StepInput& said) {
  PlaceFixes fixes;
  StepInput step = said;
  step.measured = said.measured && trusts(said);
  chain_.add(step);
  if (map_ && parameters_.locate) search(step, fixes);
  if (chooser_) follow_turning(step, fixes);
  step_ = step;
  if (curvature_ && parameters_.use_curvature) match_shape(step, fixes);
  return fixes;
}

void MapMatcher::match_shape(const StepInput& step, PlaceFixes& fixes) {
  if (chain_.broken()) {
    match_shape_without_camera(step.stamp_ns, fixes);
    return;
  }
  shaped_ns_ = step.stamp_ns;
  // Where the rails are seen they tell the shape: the body turns some way behind the foot, how far depends on the car.
  const bool rails_seen = std::abs(core::seconds(step.stamp_ns - rails_seen_ns_)) < kRailsFreshS;
  if (!rails_seen && step.frame_to_frame && std::abs(step.step_m) > kShortestStepM &&
      std::abs(step.speed_mps) > parameters_.least_speed_mps) {
    const double at_m = shape_m() - 0.5 * step.step_m;
    const double sigma_per_m = std::hypot(step.yaw_sigma_rad, kYawNoiseRad) / std::abs(step.step_m);
    curvature_->add(at_m, step.yaw_rad / step.step_m, sigma_per_m, CurvatureOf::body);
    if (exits_) exits_->add(at_m, step.yaw_rad / step.step_m, CurvatureOf::body);
  }
  match_shape(step.stamp_ns, fixes);
}

void MapMatcher::match_shape(int64_t stamp_ns, PlaceFixes& fixes) {
  // The exit of a curve is a minimum, which would be missed between.
  if (!exits_ && std::abs(shape_m() - matched_m_) < parameters_.match_every_m) return;
  matched_m_ = shape_m();
  const auto prior = prior_at(stamp_ns);
  if (!prior || place_doubt() > 0) return;  // in the wide window of a place in doubt some curve always fits
  const auto fix = exits_ ? exits_->match(stamp_ns, shape_m(), *prior) : curvature_->match(stamp_ns, shape_m(), *prior);
  if (fix) say(*fix, FixKind::curvature, fixes);
}

std::optional<Turn> MapMatcher::turn_of_camera() const {
  auto turn = chain_.turn();
  if (turn) turn->bias_rad = parameters_.camera_bias_per_m * std::abs(turn->way_m);
  return turn;
}

void MapMatcher::search(const StepInput& step, PlaceFixes& fixes) {
  auto turn = turn_of_camera();
  if (!turn && step_ && core::seconds(step.stamp_ns - step_->stamp_ns) < FollowedPath::kOldStateS)
    turn = turn_of_gyro(step_->stamp_ns, step.stamp_ns);
  search_by(turn, step.stamp_ns, fixes);
}

void MapMatcher::search_by(const std::optional<Turn>& turn, int64_t stamp_ns, PlaceFixes& fixes) {
  const auto places = search_.move(turn);
  if (!places.empty()) fixes.push_back(fix_of(FixKind::network, stamp_ns, places));
}

// The odometer is fusion's, which runs on by whatever sensor there is.
PlaceFixes MapMatcher::add(const GnssInput& position) {
  if (!wants_gnss()) return {};
  const auto& train = state_->placed;
  const double since_s = core::seconds(position.stamp_ns - train.stamp_ns);
  if (!std::isfinite(train.speed_mps) || std::abs(since_s) > FollowedPath::kOldStateS) return {};
  const double odometer_m = train.distance_m + train.speed_mps * since_s;
  const auto place =
      search_.hear({position.easting_m, position.northing_m, position.hdop}, odometer_m, train.speed_mps);
  if (!place) return {};
  return {fix_of(FixKind::gnss, position.stamp_ns, {*place})};
}

void MapMatcher::follow_turning(const StepInput& step, PlaceFixes& fixes) {
  if (!step_ || !prior_at(step.stamp_ns)) return;
  auto turn = moved_ns_ == step_->stamp_ns ? turn_of_camera() : std::nullopt;
  if (turn) {
    turn->way_m *= state_->visual_scale;
    move(*turn, step.stamp_ns);
  } else {
    move_without_camera(step.stamp_ns);
  }
  say_track(fixes);
}

// The doubt that was said comes back in the state; counted again it would never end.
TrackWindow MapMatcher::window_at(const Prior& prior) const {
  const auto place = followed_->path()->position_at(prior.path_distance_m);
  const double probability = std::min(1.0, state_->track_probability / said_track_.there);
  const double speed_mps = state_->placed.speed_mps;
  return {.place = place,
          .over_m = prior.over_m,
          .under_m = prior.under_m,
          .sigma_m = state_->sigma_m,
          .probability = probability,
          .forwards = !(speed_mps < -kCreepMps),
          .stands = !(std::abs(speed_mps) > kCreepMps)};
}

void MapMatcher::move(const Turn& turn, int64_t to_ns) {
  if (std::abs(turn.way_m) > kLeastWayM) chooser_->move(turn);
  moved_ns_ = to_ns;
}

// What GNSS holds is there, if it was not GNSS that had told it: then the map or the sightings are wrong.
double MapMatcher::place_doubt() const {
  if (!landmarks_ || (!search_.of_gnss() && state_->gnss_agrees)) return 0;
  return landmarks_->place_doubt();
}

// Where the track is open, or another one is to be followed, the chooser has weighed them; where the place is in doubt
// the window is elsewhere.
void MapMatcher::compare_with_beside(const Sighting& sighting, const Prior& prior) {
  if (!chooser_ || !lies_in_track(sighting.kind, sighting.lateral_m)) return;
  const auto choice = chooser_->choice();
  if (choice && choice->known && place_doubt() == 0 && is_followed(choice->options.front().place))
    beside_->sight(*followed_->path(), sighting, prior);
}

// It was matched on the followed track alone: taken for that one's, what lies on another track would move the place.
double MapMatcher::share_of_followed(uint32_t landmark) const {
  const auto* seen = map_->landmark(landmark);
  if (!chooser_ || seen == nullptr) return 1;
  const double beside = beside_->probability();
  const bool doubted = beside > 0 && !tracks_beside_->has_alike(*seen);
  return chooser_->share_of(*seen) * (doubted ? 1 - beside : 1);
}

bool MapMatcher::is_followed(const track::EdgePosition& place) const {
  return followed_->path()->distance_of(place.edge, place.offset_m).has_value();
}

// The chooser is where it was moved to: a step that comes late does not take it back.
void MapMatcher::say_track(PlaceFixes& fixes) {
  const int64_t stamp_ns = moved_ns_;
  const auto prior = prior_at(stamp_ns);
  if (!prior) return;
  chooser_->follow(window_at(*prior));
  const auto choice = chooser_->choice();
  if (!choice) return;
  const auto& best = choice->options.front();
  const double since_m = std::abs(prior->travelled_m - said_track_.travelled_m);
  const double doubt = place_doubt();
  const double there = (1 - doubt) * (1 - beside_->probability());
  const bool known = choice->known && there == 1;
  const bool changed = best.place.edge != said_track_.edge || known != said_track_.known;
  const bool due = std::abs(core::seconds(stamp_ns - said_track_.stamp_ns)) > kTrackEveryS;  // clocks are set back
  if (!changed && !due && (choice->known || since_m < kOpenTrackEveryM)) return;
  said_track_ = {best.place.edge, known, stamp_ns, prior->travelled_m, there};
  PlaceFix fix{FixKind::track, stamp_ns, choice->options, std::numeric_limits<double>::infinity()};
  fix.options.insert(fix.options.begin() + 1, choice->elsewhere.begin(), choice->elsewhere.end());
  for (auto& option : fix.options) option.probability *= there;
  if (doubt > 0) fix.sightings_fit = SightingsFit::nowhere;
  fixes.push_back(std::move(fix));
}

void MapMatcher::add(const ViewInput& view) {
  rails_seen_ns_ = view.stamp_ns;
  const double sigma_per_m = std::sqrt(view.variance);
  if (chooser_ && trusts_camera() && prior_at(view.stamp_ns)) chooser_->see(view.curvature_per_m, sigma_per_m);
  if (!curvature_ || !parameters_.use_curvature || !step_ || !step_->measured) return;
  const double dt_s = core::seconds(view.stamp_ns - step_->stamp_ns);
  if (std::abs(dt_s) > FollowedPath::kOldStateS || std::abs(step_->speed_mps) < parameters_.least_speed_mps) return;
  // A short view does not tell how the curvature changes: it is that of the middle of what is seen, and at the foot it
  // is unsure by as much as the rate may make of that way. A long view tells both, and the curvature is that at the
  // foot.
  const double ahead_m =
      std::min(parameters_.view_ahead_m, kRateShare * sigma_per_m / parameters_.view_rate_sigma_per_m2);
  const double odometer_m = shape_m() + step_->speed_mps * dt_s + ahead_m;
  curvature_->add(odometer_m, view.curvature_per_m, sigma_per_m, CurvatureOf::rails);
  if (exits_) exits_->add(odometer_m, view.curvature_per_m, CurvatureOf::rails);
}

PlaceFixes MapMatcher::add(const Sighting& sighting) {
  search_.sight(step_ ? sighted_at(step_->stamp_ns, step_->speed_mps, sighting) : sighting);
  const auto prior = prior_at(sighting.stamp_ns);
  if (!landmarks_ || !parameters_.use_landmarks || !prior) return {};
  if (chooser_) chooser_->sight(sighted_at(moved_ns_, state_->placed.speed_mps, sighting));
  silence_.sight(*followed_->path(), sighting, *prior);
  compare_with_beside(sighting, *prior);
  PlaceFixes fixes;
  if (auto fix = landmarks_->add(sighting, *prior)) {
    fix->probability *= share_of_followed(fix->landmark);
    say(*fix, FixKind::landmark, fixes);
  }
  return fixes;
}

void MapMatcher::say(const Fix& fix, FixKind kind, PlaceFixes& fixes) const {
  const auto place = followed_->path()->position_at(fix.path_distance_m);
  fixes.push_back({kind, fix.stamp_ns, {{place, fix.probability}}, fix.sigma_m, fix.landmark, fix.sightings_fit});
}

}  // namespace railfix::map_matcher
