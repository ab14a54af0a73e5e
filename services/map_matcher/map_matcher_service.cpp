#include "map_matcher/map_matcher_service.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/time.hpp"
#include "map_matcher/matcher_messages.hpp"
#include "track/same_map.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kRailsFreshS = 0.5;
constexpr double kShortestStepM = 0.05;
constexpr double kLeastWayM = 1e-5;       // standing still turns nothing
constexpr double kTrackEveryS = 1.0;      // the track is said again after this time ...
constexpr double kOpenTrackEveryM = 2.0;  // ... or, while it is not known, this way
constexpr double kNoCameraS = 0.5;        // without an odometry step
constexpr double kCountM = 20.0;
constexpr double kLostS = 30.0;      // after so long unseen the track is chosen anew
constexpr double kRateShare = 0.75;  // of the curvature's sigma comes from its unknown rate

// A fusion that was started anew may count the travelled distance from elsewhere.
bool counts_on(const msg::TrainState& before, const msg::TrainState& state) {
  const double expected_m = state.speed_mps() * core::seconds(state.stamp_ns() - before.stamp_ns());
  return std::abs(state.distance_m() - before.distance_m() - expected_m) <= kCountM + 0.5 * std::abs(expected_m);
}

}  // namespace

MapMatcherService::MapMatcherService(const MapMatcherConfig& config, service::Context& context)
    : config_(config), context_(context), writer_(context.writer(messaging::topics::position_fix)), gyro_(config.gyro) {
  if (!config.map.empty()) {
    map_ = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(config.map)));
    ways_ = std::make_shared<const track::Ways>(*map_);
    followed_.emplace(map_, ways_);
    if (config.choose_track) chooser_.emplace(config.track_parameters(), map_, ways_);
  }
  namespace topics = messaging::topics;
  if (config.use_imu) {
    context_.on<msg::ImuSample>(topics::imu_sample, [this](const msg::ImuSample& m) {
      if (takes("imu_sample", input_of(m))) gyro_.add(m.stamp_ns(), m.rate_z_rps());
    });
  }
  if (config.use_gnss && map_) {
    context_.on<msg::GnssFix>(topics::gnss_fix, [this](const msg::GnssFix& m) { look_for_place(m); });
  }
  context_.on<msg::TrainState>(topics::train_state, [this](const msg::TrainState& m) { use(m); });
  context_.on<msg::TrackView>(topics::track_view, [this](const msg::TrackView& m) { use(m); });
  context_.on<msg::LandmarkSighting>(topics::landmark_sighting, [this](const msg::LandmarkSighting& m) { use(m); });
  context_.on<msg::OdometryStep>(topics::odometry_step, [this](const msg::OdometryStep& m) { use(m); });
  context_.at_restart([this](int64_t) { restart(); });
  context_.share_charge();
  context_.health().ready();
}

// What was matched so far is of another place.
void MapMatcherService::forget_place() {
  if (followed_) followed_->forget();
  landmarks_.reset();
  curvature_.reset();
  exits_.reset();
  if (chooser_) chooser_.emplace(config_.track_parameters(), map_, ways_);
  moved_ns_ = 0;
  said_track_ = {};
  of_gnss_ = false;
}

void MapMatcherService::restart() {
  forget_place();
  locator_.reset();
  gnss_.reset();
  gyro_ = GyroTurn(config_.gyro);
  state_.reset();
  step_.reset();
  chain_ = {};
  rails_seen_ns_ = 0;
  located_m_ = 0;
  matched_m_ = 0;
  left_out_ = {};
}

template <typename Input>
bool MapMatcherService::takes(const char* topic, const Input& input) {
  if (has_sense(input)) return true;
  left_out_.add(topic, service::LeftOut::kNoSense, state_ ? state_->stamp_ns() : 0);
  return false;
}

void MapMatcherService::use(const msg::TrainState& state) {
  if (state.track_known() != 0 && !takes("train_state", input_of(state))) {
    context_.health().degraded(left_out_.sentence(state_ ? state_->stamp_ns() : 0));
    return;
  }
  context_.health().input();
  const auto before = std::exchange(state_, state);
  if (before && before->standstill() != 0 && state.standstill() != 0) stand(before->stamp_ns(), state.stamp_ns());
  if (!map_ || state.track_known() == 0) {
    if (before && before->track_known() != 0) forget_place();
    const auto left_out = left_out_.sentence(state.stamp_ns());
    const auto unknown = placeless();
    context_.health().degraded(left_out.empty() ? unknown : unknown + "; " + left_out);
    return;
  }
  gnss_.reset();
  if (!track::lies_there(*map_, place_of(state), state.easting_m(), state.northing_m())) {
    restart();  // what was matched so far is of another map as well
    context_.health().degraded("train_state is of another map than map_matcher.map: give both services the same file");
    return;
  }
  if (landmarks_ && before && !counts_on(*before, state)) landmarks_->forget();
  if (const auto followed = follow(state); !followed.ok()) {
    context_.health().degraded(followed.error().message);
  } else if (const auto left_out = left_out_.sentence(state.stamp_ns()); !left_out.empty()) {
    context_.health().degraded(left_out);
  } else if (place_doubt() > 0) {
    context_.health().degraded("the sightings fit the map nowhere near the place that train_state says");
  } else {
    context_.health().active();
  }
  if (chooser_) follow_without_camera();
}

// Whoever follows the gyro now must not have its constant error changed below it.
void MapMatcherService::stand(int64_t from_ns, int64_t to_ns) {
  if (!chooser_ || chooser_->sensor() != TurnSensor::gyro) {
    gyro_.stood(from_ns, to_ns);
  } else if (const auto turn = gyro_.between(from_ns, to_ns)) {
    chooser_->stand(*turn);
  }
}

core::Status MapMatcherService::follow(const msg::TrainState& state) {
  const auto way = followed_->follow(placed(state));
  if (!way.ok()) return way.error();
  if (way.value() == FollowedPath::Way::same) return {};
  const auto& path = followed_->path();
  if (way.value() == FollowedPath::Way::other_track) {
    landmarks_->change_path(path);
    curvature_->change_path(path);
  } else {
    landmarks_.emplace(config_.landmarks, path);
    curvature_.emplace(config_.curvature_parameters(), path);
  }
  if (config_.curve_method == "exits") exits_.emplace(config_.exit_parameters(), path);
  return {};
}

std::optional<Prior> MapMatcherService::prior_at(int64_t stamp_ns) const {
  if (!state_ || !followed_ || state_->track_known() == 0) return std::nullopt;
  return followed_->prior_at(stamp_ns, placed(*state_));
}

void MapMatcherService::use(const msg::OdometryStep& step) {
  if (!takes("odometry_step", input_of(step))) return;
  chain_.add(input_of(step));
  if (map_ && config_.locate) look_for_place(step);
  if (chooser_) follow_turning(step);
  step_ = step;
  if (!curvature_ || !config_.use_curvature) return;
  if (chain_.broken()) {
    curvature_->forget();
    if (exits_) exits_->forget();
    return;
  }
  // Where the rails are seen they tell the shape: pictures turn as the track ahead does (by 10 to 13 m, measured), not
  // as the body behind. Only steps from picture to picture: those against one key frame overlap.
  const double step_m = step.step_m();
  const bool rails_seen = std::abs(core::seconds(step.stamp_ns() - rails_seen_ns_)) < kRailsFreshS;
  if (!rails_seen && step.mode() == msg::ODOMETRY_TRACK && std::abs(step_m) > kShortestStepM &&
      std::abs(step.speed_mps()) > config_.least_speed_mps) {
    const double at_m = chain_.odometer_m() - 0.5 * step_m;
    const double sigma_per_m = std::hypot(step.yaw_sigma_rad(), kYawNoiseRad) / std::abs(step_m);
    curvature_->add(at_m, step.yaw_rad() / step_m, sigma_per_m, CurvatureOf::body);
    if (exits_) exits_->add(at_m, step.yaw_rad() / step_m, CurvatureOf::body);
  }
  // The exit of a curve is a minimum, which would be missed between.
  if (!exits_ && std::abs(chain_.odometer_m() - matched_m_) < config_.match_every_m) return;
  matched_m_ = chain_.odometer_m();
  const auto prior = prior_at(step.stamp_ns());
  if (!prior || place_doubt() > 0) return;  // in the wide window of a place in doubt some curve always fits
  const auto fix = exits_ ? exits_->match(step.stamp_ns(), chain_.odometer_m(), *prior)
                          : curvature_->match(step.stamp_ns(), chain_.odometer_m(), *prior);
  if (fix) publish(*fix, msg::FIX_CURVATURE, step.grabbed_ns());
}

std::optional<Turn> MapMatcherService::turn_of_camera() const {
  auto turn = chain_.turn();
  if (turn) turn->bias_rad = config_.camera_bias_per_m * std::abs(turn->way_m);
  return turn;
}

std::optional<Turn> MapMatcherService::turn_of_gyro(int64_t from_ns, int64_t to_ns) const {
  if (!state_ || !std::isfinite(state_->speed_mps())) return std::nullopt;
  if (std::abs(core::seconds(to_ns - state_->stamp_ns())) > FollowedPath::kOldStateS) return std::nullopt;
  auto turn = gyro_.between(from_ns, to_ns);
  if (turn) turn->way_m = state_->speed_mps() * core::seconds(to_ns - from_ns);
  return turn;
}

// A place that is no position may soon be given up: the way is measured already, and searched for then.
void MapMatcherService::look_for_place(const msg::OdometryStep& step) {
  const bool placed = state_ && state_->track_known() != 0;
  if (!state_ || (placed && state_->integrity() != msg::INTEGRITY_UNUSABLE)) {
    locator_.reset();
    return;
  }
  if (!locator_) {
    locator_.emplace(config_.locator_parameters(), index());
    located_m_ = chain_.odometer_m();
  }
  auto turn = turn_of_camera();
  if (!turn && step_ && core::seconds(step.stamp_ns() - step_->stamp_ns()) < FollowedPath::kOldStateS)
    turn = turn_of_gyro(step_->stamp_ns(), step.stamp_ns());
  if (!turn) {
    if (step_) locator_->forget();
    return;
  }
  if (std::abs(turn->way_m) > kLeastWayM) locator_->move(turn->way_m, turn->turn_rad, turn->sigma_rad);
  if (placed || std::abs(chain_.odometer_m() - located_m_) < config_.locate_every_m) return;
  located_m_ = chain_.odometer_m();
  const Location location = locator_->locate();
  if (!location.certain()) return;
  of_gnss_ = false;
  publish_place(location.places, msg::FIX_NETWORK, step.stamp_ns(), step.grabbed_ns());
}

// The odometer is fusion's, which runs on by whatever sensor there is.
void MapMatcherService::look_for_place(const msg::GnssFix& fix) {
  if (!config_.locate || fix.fix() == 0 || !state_ || state_->track_known() != 0) return;
  const double since_s = core::seconds(fix.stamp_ns() - state_->stamp_ns());
  const auto plane = map_->from_geo({fix.lat_deg(), fix.lon_deg()});
  if (!plane || !takes("gnss_fix", GnssInput{plane->x(), plane->y(), fix.hdop()})) return;
  if (!std::isfinite(state_->speed_mps()) || std::abs(since_s) > FollowedPath::kOldStateS) return;
  if (!gnss_) gnss_.emplace(config_.gnss, index());
  const double speed_mps = state_->speed_mps();
  gnss_->add({plane->x(), plane->y(), fix.hdop()}, state_->distance_m() + speed_mps * since_s, speed_mps);
  const auto found = gnss_->place();
  if (!found) return;
  of_gnss_ = true;
  publish_place({{found->place, config_.locator.certain, found->sigma_m}}, msg::FIX_GNSS, fix.stamp_ns(),
                fix.grabbed_ns());
}

void MapMatcherService::publish_place(const std::vector<LocatedPlace>& places, uint8_t kind, int64_t stamp_ns,
                                      int64_t grabbed_ns) {
  auto message = message_of(places);
  message.stamp_ns(stamp_ns);
  message.kind(kind);
  message.sigma_m(places.front().sigma_m);
  send(message, grabbed_ns);
}

std::string MapMatcherService::placeless() const {
  if (!map_) return "no map is configured";
  std::string said = "the place on the map is not known yet";
  const auto tracks = gnss_ ? gnss_->tracks() : std::nullopt;
  if (tracks == 0U) said += "; no track on the map where GNSS says the train is";
  if (tracks > 1U) said += "; GNSS cannot tell which of " + std::to_string(*tracks) + " tracks it is on";
  return said;
}

const std::shared_ptr<const NetworkIndex>& MapMatcherService::index() {
  if (!index_) index_ = std::make_shared<const NetworkIndex>(map_);
  return index_;
}

void MapMatcherService::follow_turning(const msg::OdometryStep& step) {
  if (!step_ || !prior_at(step.stamp_ns())) return;
  auto turn = moved_ns_ == step_->stamp_ns() ? turn_of_camera() : std::nullopt;
  if (turn) {
    turn->way_m *= state_->visual_scale();
    move(*turn, step.stamp_ns());
  } else {
    move_without_camera(step.stamp_ns());
  }
  say_track(chain_.odometer_m(), step.grabbed_ns());
}

// The doubt that was said comes back in the state; counted again it would never end.
TrackWindow MapMatcherService::window_at(const Prior& prior) const {
  const auto place = followed_->path()->position_at(prior.path_distance_m);
  const double probability = std::min(1.0, state_->track_probability() / said_track_.there);
  return {place, prior.over_m, prior.under_m, state_->sigma_m(), probability, !(state_->speed_mps() < 0)};
}

// Without a camera fusion's states lead: they come ten times a second.
void MapMatcherService::follow_without_camera() {
  if (step_ && core::seconds(state_->stamp_ns() - step_->stamp_ns()) < kNoCameraS) return;
  if (!prior_at(state_->stamp_ns())) return;
  move_without_camera(state_->stamp_ns());
  say_track(state_->distance_m(), 0);
}

void MapMatcherService::move(const Turn& turn, int64_t to_ns) {
  if (std::abs(turn.way_m) > kLeastWayM) chooser_->move(turn);
  moved_ns_ = to_ns;
}

// From where the chooser has come to, whoever had led it there.
void MapMatcherService::move_without_camera(int64_t to_ns) {
  const double dt_s = core::seconds(to_ns - moved_ns_);
  // A clock that was set back leaves it in the future.
  if (moved_ns_ == 0 || dt_s > kLostS || dt_s < -FollowedPath::kOldStateS) {
    if (moved_ns_ != 0) chooser_.emplace(config_.track_parameters(), map_, ways_);
    moved_ns_ = to_ns;
    return;
  }
  if (dt_s <= 0 || !std::isfinite(state_->speed_mps())) return;
  if (const auto turn = turn_of_gyro(moved_ns_, to_ns)) {
    move(*turn, to_ns);
    return;
  }
  chooser_->move_blind(state_->speed_mps() * dt_s);
  moved_ns_ = to_ns;
}

// What GNSS holds is there, if it was not GNSS that had told it: then the map or the sightings are wrong.
double MapMatcherService::place_doubt() const {
  if (!landmarks_ || (!of_gnss_ && (state_->sources() & msg::SOURCE_GNSS) != 0)) return 0;
  return landmarks_->place_doubt();
}

// The chooser is where it was moved to: a step that comes late does not take it back.
void MapMatcherService::say_track(double odometer_m, int64_t grabbed_ns) {
  const int64_t stamp_ns = moved_ns_;
  const auto prior = prior_at(stamp_ns);
  if (!prior) return;
  chooser_->follow(window_at(*prior));
  const auto choice = chooser_->choice();
  if (!choice) return;
  const auto& best = choice->options.front();
  const double since_m = std::abs(odometer_m - said_track_.odometer_m);
  const double there = 1 - place_doubt();  // and not elsewhere on the map
  const bool known = choice->known && there == 1;
  const bool changed = best.place.edge != said_track_.edge || known != said_track_.known;
  const bool due = core::seconds(stamp_ns - said_track_.stamp_ns) > kTrackEveryS;
  if (!changed && !due && (choice->known || since_m < kOpenTrackEveryM)) return;
  said_track_ = {best.place.edge, known, stamp_ns, odometer_m, there};
  auto message = message_of(choice->options);
  message.probability(there * message.probability());
  for (double& probability : message.alternative_probability()) probability *= there;
  message.stamp_ns(stamp_ns);
  message.kind(msg::FIX_TRACK);
  message.sigma_m(std::numeric_limits<double>::infinity());
  message.fits_nowhere(there < 1 ? 1 : 0);
  send(message, grabbed_ns);
}

void MapMatcherService::use(const msg::TrackView& view) {
  if (view.seen_left() == 0 || view.seen_right() == 0 || !takes("track_view", input_of(view))) return;
  const double variance = input_of(view).variance;
  rails_seen_ns_ = view.stamp_ns();
  if (chooser_ && prior_at(view.stamp_ns())) chooser_->see(view.curvature_per_m(), std::sqrt(variance));
  if (!curvature_ || !config_.use_curvature || !step_ || step_->valid() == 0) return;
  const double dt_s = core::seconds(view.stamp_ns() - step_->stamp_ns());
  if (std::abs(dt_s) > FollowedPath::kOldStateS || std::abs(step_->speed_mps()) < config_.least_speed_mps) return;
  // A short view does not tell how the curvature changes: it is that of the middle of what is seen, and at the foot it
  // is unsure by as much as the rate may make of that way. A long view tells both, and the curvature is that at the
  // foot.
  const double sigma_per_m = std::sqrt(variance);
  const double ahead_m = std::min(config_.view_ahead_m, kRateShare * sigma_per_m / config_.view_rate_sigma_per_m2);
  const double odometer_m = chain_.odometer_m() + step_->speed_mps() * dt_s + ahead_m;
  curvature_->add(odometer_m, view.curvature_per_m(), sigma_per_m, CurvatureOf::rails);
  if (exits_) exits_->add(odometer_m, view.curvature_per_m(), CurvatureOf::rails);
}

void MapMatcherService::use(const msg::LandmarkSighting& sighting) {
  if (!takes("landmark_sighting", input_of(sighting))) return;
  context_.health().input();
  if (locator_) locator_->sight(input_of(sighting));
  const auto prior = prior_at(sighting.stamp_ns());
  if (!landmarks_ || !config_.use_landmarks || !prior) return;
  if (chooser_) chooser_->sight(input_of(sighting));
  const auto fix = landmarks_->add(input_of(sighting), *prior);
  if (fix) publish(*fix, msg::FIX_LANDMARK, sighting.grabbed_ns());
}

void MapMatcherService::publish(const Fix& fix, uint8_t kind, int64_t grabbed_ns) {
  const auto place = followed_->path()->position_at(fix.path_distance_m);
  msg::PositionFix message;
  message.stamp_ns(fix.stamp_ns);
  message.offset_m(place.offset_m);
  message.sigma_m(fix.sigma_m);
  message.probability(fix.probability);
  message.edge(place.edge);
  message.landmark(fix.landmark);
  message.kind(kind);
  message.direction(direction_of(place.direction));
  send(message, grabbed_ns);
}

void MapMatcherService::send(const msg::PositionFix& fix, int64_t grabbed_ns) {
  if (!context_.in_charge()) return;
  if (!writer_.write(fix)) context_.health().dropped(1);
  context_.health().output(grabbed_ns);
}

}  // namespace railfix::map_matcher
