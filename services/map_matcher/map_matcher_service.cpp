#include "map_matcher/map_matcher_service.hpp"

#include <cmath>

#include "core/time.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kPathAheadM = 30000;
constexpr double kPathBehindM = 5000;
constexpr double kPathLeftM = 3000;  // the path is followed anew when less of it is left
constexpr double kOldStateS = 2.0;
constexpr double kYawNoise = 3e-4;  // turning of the car body within one step, rad
constexpr double kShortestStepM = 0.05;
constexpr int kCurvatureVariance = 25;  // place of the curvature's variance in TrackView.covariance

}  // namespace

MapMatcherService::MapMatcherService(const MapMatcherConfig& config, service::Context& context)
    : config_(config), context_(context), writer_(context.writer(messaging::topics::position_fix)) {
  if (!config.map.empty()) {
    map_ = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(config.map)));
  }
  namespace topics = messaging::topics;
  context_.on<msg::TrainState>(topics::train_state, [this](const msg::TrainState& m) { use(m); });
  context_.on<msg::TrackView>(topics::track_view, [this](const msg::TrackView& m) { use(m); });
  context_.on<msg::LandmarkSighting>(topics::landmark_sighting, [this](const msg::LandmarkSighting& m) { use(m); });
  context_.on<msg::OdometryStep>(topics::odometry_step, [this](const msg::OdometryStep& m) { use(m); });
  context_.health().ready();
}

void MapMatcherService::use(const msg::TrainState& state) {
  context_.health().input();
  state_ = state;
  if (!map_ || state.track_known() == 0) {
    context_.health().degraded(map_ ? "the place on the map is not known yet" : "no map is configured");
    return;
  }
  context_.health().active();
  follow(state);
}

void MapMatcherService::follow(const msg::TrainState& state) {
  if (path_) {
    const auto place_m = path_->distance_of(state.edge(), state.offset_m());
    const bool ends = place_m && path_->end_m() > 0.5 * kPathAheadM && path_->end_m() - *place_m < kPathLeftM;
    if (place_m && !ends) return;
  }
  const auto direction =
      state.direction() == msg::DIRECTION_REVERSE ? track::Direction::reverse : track::Direction::forward;
  auto path = track::Path::follow(map_, {state.edge(), state.offset_m(), direction}, kPathAheadM, kPathBehindM);
  if (!path.ok()) {
    context_.health().degraded(path.error().message);
    return;
  }
  path_ = std::make_shared<const track::Path>(std::move(path).value());
  landmarks_.emplace(config_.landmarks, path_);
  curvature_.emplace(config_.curvature, path_);
}

std::optional<Prior> MapMatcherService::prior_at(int64_t stamp_ns) const {
  if (!state_ || !path_ || state_->track_known() == 0) return std::nullopt;
  const double dt_s = core::seconds(stamp_ns - state_->stamp_ns());
  const auto place_m = path_->distance_of(state_->edge(), state_->offset_m());
  if (!place_m || std::abs(dt_s) > kOldStateS) return std::nullopt;
  const double way_m = std::isnan(state_->speed_mps()) ? 0.0 : state_->speed_mps() * dt_s;
  return Prior{*place_m + way_m, state_->over_m(), state_->under_m(), state_->distance_m() + way_m};
}

void MapMatcherService::use(const msg::OdometryStep& step) {
  step_ = step;
  if (!curvature_ || !config_.use_curvature) return;
  if (step.valid() == 0 || step.mode() == msg::ODOMETRY_BLIND) {
    curvature_->forget();
    return;
  }
  // Only steps from picture to picture: those against one key frame overlap.
  const double step_m = step.step_m();
  if (step.mode() == msg::ODOMETRY_TRACK && std::abs(step_m) > kShortestStepM &&
      std::abs(step.speed_mps()) > config_.least_speed_mps) {
    curvature_->add(step.distance_m() - 0.5 * step_m, step.yaw_rad() / step_m,
                    std::hypot(step.yaw_sigma_rad(), kYawNoise) / std::abs(step_m));
  }
  if (std::abs(step.distance_m() - matched_m_) < config_.match_every_m) return;
  matched_m_ = step.distance_m();
  const auto prior = prior_at(step.stamp_ns());
  if (!prior) return;
  if (const auto fix = curvature_->match(step.stamp_ns(), step.distance_m(), *prior)) {
    publish(*fix, msg::FIX_CURVATURE, step.grabbed_ns());
  }
}

void MapMatcherService::use(const msg::TrackView& view) {
  if (!curvature_ || !config_.use_curvature || !step_ || step_->valid() == 0) return;
  if (view.seen_left() == 0 || view.seen_right() == 0) return;
  const double dt_s = core::seconds(view.stamp_ns() - step_->stamp_ns());
  const double variance = view.covariance()[kCurvatureVariance];
  if (!(variance > 0) || std::abs(dt_s) > kOldStateS || std::abs(step_->speed_mps()) < config_.least_speed_mps) return;
  const double odometer_m = step_->distance_m() + step_->speed_mps() * dt_s + config_.view_ahead_m;
  curvature_->add(odometer_m, view.curvature_per_m(), std::sqrt(variance));
}

void MapMatcherService::use(const msg::LandmarkSighting& sighting) {
  context_.health().input();
  const auto prior = prior_at(sighting.stamp_ns());
  if (!landmarks_ || !config_.use_landmarks || !prior) return;
  const auto fix =
      landmarks_->add({sighting.stamp_ns(), static_cast<track::LandmarkKind>(sighting.kind()),
                       sighting.distance_ahead_m(), sighting.lateral_m(), sighting.sigma_m(), sighting.confidence()},
                      *prior);
  if (fix) publish(*fix, msg::FIX_LANDMARK, sighting.grabbed_ns());
}

void MapMatcherService::publish(const Fix& fix, uint8_t kind, int64_t grabbed_ns) {
  const auto place = path_->position_at(fix.path_distance_m);
  msg::PositionFix message;
  message.stamp_ns(fix.stamp_ns);
  message.offset_m(place.offset_m);
  message.sigma_m(fix.sigma_m);
  message.probability(fix.probability);
  message.edge(place.edge);
  message.landmark(fix.landmark);
  message.kind(kind);
  message.direction(place.direction == track::Direction::reverse ? msg::DIRECTION_REVERSE : msg::DIRECTION_FORWARD);
  if (!writer_.write(message)) context_.health().dropped(1);
  context_.health().output(grabbed_ns);
}

}  // namespace railfix::map_matcher
