#include "map_matcher/map_matcher_service.hpp"

#include "map_matcher/matcher_messages.hpp"

namespace railfix::map_matcher {
namespace {

std::shared_ptr<const track::Map> load(const std::string& file) {
  if (file.empty()) return nullptr;
  return std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(file)));
}

}  // namespace

MapMatcherService::MapMatcherService(const MapMatcherConfig& config, service::Context& context)
    : context_(context),
      writer_(context.writer(messaging::topics::position_fix)),
      map_(load(config.map)),
      matcher_(config.parameters, map_) {
  listen(config);
  context_.at_restart([this](int64_t) {
    matcher_.restart();
    left_out_ = {};
    state_ns_ = 0;
  });
  context_.share_charge();
  context_.health().ready();
}

void MapMatcherService::listen(const MapMatcherConfig& config) {
  namespace topics = messaging::topics;
  if (config.use_imu) {
    context_.on<msg::ImuSample>(topics::imu_sample, [this](const msg::ImuSample& m) {
      const auto input = input_of(m);
      if (takes("imu_sample", input)) matcher_.add(input);
    });
  }
  if (config.use_gnss) context_.on<msg::GnssFix>(topics::gnss_fix, [this](const msg::GnssFix& m) { use(m); });
  context_.on<msg::TrainState>(topics::train_state, [this](const msg::TrainState& m) { use(m); });
  context_.on<msg::TrackView>(topics::track_view, [this](const msg::TrackView& m) { use(m); });
  context_.on<msg::LandmarkSighting>(topics::landmark_sighting, [this](const msg::LandmarkSighting& m) { use(m); });
  context_.on<msg::OdometryStep>(topics::odometry_step, [this](const msg::OdometryStep& m) { use(m); });
}

template <typename Input>
bool MapMatcherService::takes(const char* topic, const Input& input) {
  if (has_sense(input)) return true;
  left_out_.add(topic, service::LeftOut::kNoSense, state_ns_);
  return false;
}

void MapMatcherService::use(const msg::TrainState& state) {
  const auto input = input_of(state);
  if (input.track_known && !takes("train_state", input)) {
    context_.health().degraded(left_out_.sentence(state_ns_));
    return;
  }
  context_.health().input();
  state_ns_ = state.stamp_ns();
  say(matcher_.add(input), 0);
  std::string why = matcher_.trouble();
  if (const auto left_out = left_out_.sentence(state_ns_); !left_out.empty()) {
    why += (why.empty() ? "" : "; ") + left_out;
  }
  if (why.empty()) {
    context_.health().active();
  } else {
    context_.health().degraded(why);
  }
}

void MapMatcherService::use(const msg::OdometryStep& step) {
  const auto input = input_of(step);
  if (takes("odometry_step", input)) say(matcher_.add(input), step.grabbed_ns());
}

void MapMatcherService::use(const msg::TrackView& view) {
  if (view.seen_left() == 0 || view.seen_right() == 0) return;
  const auto input = input_of(view);
  if (takes("track_view", input)) matcher_.add(input);
}

void MapMatcherService::use(const msg::LandmarkSighting& sighting) {
  const auto input = input_of(sighting);
  if (!takes("landmark_sighting", input)) return;
  context_.health().input();
  say(matcher_.add(input), sighting.grabbed_ns());
}

void MapMatcherService::use(const msg::GnssFix& fix) {
  if (fix.fix() == msg::GNSS_NONE || !matcher_.wants_gnss()) return;
  const auto plane = map_->from_geo({fix.lat_deg(), fix.lon_deg()});
  if (!plane) return;
  const GnssInput input{plane->x(), plane->y(), fix.hdop(), fix.stamp_ns()};
  if (takes("gnss_fix", input)) say(matcher_.add(input), fix.grabbed_ns());
}

void MapMatcherService::say(const PlaceFixes& fixes, int64_t grabbed_ns) {
  if (!context_.in_charge()) return;
  for (const auto& fix : fixes) {
    if (!writer_.write(message_of(*map_, fix))) context_.health().dropped(1);
    context_.health().output(grabbed_ns);
  }
}

}  // namespace railfix::map_matcher
