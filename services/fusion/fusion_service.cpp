#include "fusion/fusion_service.hpp"

#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "core/time.hpp"
#include "fusion/fusion_messages.hpp"
#include "track/same_map.hpp"

namespace railfix::fusion {
namespace {

using messaging::topics::camera_calibration;
using messaging::topics::data_clock;
using messaging::topics::gnss_fix;
using messaging::topics::imu_sample;
using messaging::topics::odometry_step;
using messaging::topics::position_fix;
using messaging::topics::train_pose;
using messaging::topics::train_state;
using messaging::topics::wheel_sample;

constexpr std::chrono::milliseconds kTickPeriod{50};
constexpr int64_t kKeepPeriodNs = 250'000'000;
constexpr uint64_t kNumbersUnheard = 100;  // at least as many as the one before may have used since it was heard last
constexpr double kSameRideS = 0.5;         // data and the host's clock go on alike
constexpr int64_t kCatchUpNs = 2 * core::kNsPerSecond;
constexpr double kSameBeginS = 0.5;  // a replay that is looped begins where it began before
constexpr double kOutOfOrderS = 2.0;
constexpr double kStandsMps = 1.0;

Fusion make_fusion(const FusionConfig& config, const std::shared_ptr<const track::Map>& map,
                   const std::optional<SavedScales>& saved) {
  std::optional<track::EdgePosition> start;
  if (config.start != "unknown") {
    if (!map)
      throw core::BadInput("fusion.start is a place on a map, but fusion.map is empty: give a map or start: unknown");
    start = core::value_or_throw(map->parse_position(config.start));
  }
  return core::value_or_throw(Fusion::create(config.parameters, map, start, saved));
}

// Which of two fusions is to be heard: the one that knows its place, or that has more to measure with.
int fitness_of(const TrainEstimate& estimate, bool has_map) {
  if (estimate.integrity == Integrity::unusable) return 0;
  return 1 + (estimate.track_known || !has_map ? 2 : 0) + (estimate.integrity == Integrity::ok ? 1 : 0);
}

}  // namespace

FusionService::FusionService(const FusionConfig& config, service::Context& context)
    : config_(config),
      context_(context),
      writer_(context.writer(train_state)),
      pose_writer_(context.writer(train_pose)),
      scale_file_(config.scales_file, context.log()),
      pose_(config.parameters.gnss_map_sigma_m),
      kept_for_(config.map + ' ' + config.start + '\n') {
  context_.health().flows(service::Flow::steady);
  if (!config.map.empty()) {
    map_ = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(config.map)));
  }
  fusion_.emplace(make_fusion(config, map_, scale_file_.saved()));
  believes_start_ = map_ && config.start != "unknown";
  listen(config);
  context_.on<msg::DataClock>(data_clock, [this](const msg::DataClock& m) { keep_time(m); });
  context_.every(kTickPeriod, [this] { tick(); });
  if (!context_.common().lock_step) {
    known_ = from_notes(kept_for_, context_.kept());
    share_charge();
  }
  context_.at_restart([this](int64_t data_ns) { restart(data_ns); });
  context_.health().ready();
}

void FusionService::share_charge() {
  context_.share_charge({[this] { return fitness_; }, [this](bool taken) { charge_changed(taken); }});
  context_.on<msg::TrainState>(train_state, [this](const msg::TrainState& state) { hear(state); });
}

void FusionService::charge_changed(bool taken) {
  learnt_ = taken;  // whoever is in charge now knows more than one that had to give it away
  if (taken && seq_ > 0) seq_ += kNumbersUnheard;
  // Readers have waited long enough for a state.
  if (taken && latest_ && latest_->stamp_ns() > heard_ns_) send(*latest_);
}

void FusionService::hear(const msg::TrainState& state) {
  if (context_.in_charge()) return;
  const bool clock_set_back = core::seconds(heard_ns_ - state.stamp_ns()) > kOutOfOrderS;
  if (state.stamp_ns() <= heard_ns_ && !clock_set_back) return;
  heard_ns_ = state.stamp_ns();
  if (believes_start_) forget_start();
  seq_ = std::max(seq_, state.seq());
  if (!latest_ || known_ || !std::isfinite(state.distance_m())) return;
  // The travelled distance must not jump at a take-over.
  const double speed_mps = std::isfinite(latest_->speed_mps()) ? latest_->speed_mps() : 0;
  const double since_s = core::seconds(state.stamp_ns() - latest_->stamp_ns());
  const double ahead_m = state.distance_m() - (latest_->distance_m() + speed_mps * since_s);
  distance_offset_m_ += ahead_m;
  latest_->distance_m(latest_->distance_m() + ahead_m);  // several may be heard before the next one of this fusion
  if (learnt_ || !map_ || state.track_known() == 0 || state.integrity() == msg::INTEGRITY_UNUSABLE) return;
  if (tell_other_map(state)) return;
  if (!place_at(map_, known_place_of(state, false), state.stamp_ns(), config_.parameters.interval_factor))
    return;  // soon
  learnt_ = true;
  known_ = KnownState{state};
  begin_anew();
}

bool FusionService::tell_other_map(const msg::TrainState& state) {
  if (track::lies_there(*map_, messaging::place_of(state), messaging::pose_of(state))) return false;
  if (!std::exchange(other_map_told_, true)) {
    context_.log().warn(
        "the fusion in charge has another map than fusion.map: its place is not taken over; give both the same file");
  }
  return true;
}

void FusionService::keep(const msg::TrainState& state) {
  if (context_.common().lock_step || std::abs(state.stamp_ns() - kept_ns_) < kKeepPeriodNs) return;
  kept_ns_ = state.stamp_ns();
  context_.keep(to_notes(kept_for_, {state, in_doubt_, core::monotonic_ns()}));
}

// A known state is wanted at the time of the first state of the fusion that is to go on from it. False: that fusion has
// only just been made, or has been told its place, and this state is of the one that did not know; or it is not certain
// yet whether the place is of this ride.
bool FusionService::take_over(const TrainEstimate& first) {
  const msg::TrainState state = known_->state;
  const double age_s = core::seconds(first.stamp_ns - state.stamp_ns());
  if (known_->noted_ns) {
    // Of the same ride: neither the clock nor a replay has jumped since, nor has another one begun.
    const double noted_s = core::seconds(core::monotonic_ns() - *known_->noted_ns);
    if (catches_up(noted_s - age_s)) return false;
    known_->noted_ns.reset();
    const bool same_time = age_s >= 0 && std::abs(age_s - noted_s) <= kSameRideS;
    if (!same_time || age_s > kOldestPlaceS) {
      known_.reset();
      // Only what is played begins where it began before: a train has gone on, and its clock was set. What is played
      // goes on, too, where it is slow or was paused.
      const bool goes_on = !is_played() || (age_s >= 0 && age_s <= noted_s);
      const bool under_way = believes_start_ && (same_time || goes_on);
      if (under_way) forget_start();
      return !under_way;
    }
    seq_ = std::max(seq_, state.seq() + kNumbersUnheard);
    // Where the one before had given its start up, too: nothing else makes a place unknown that was told.
    if (map_ && (state.track_known() != 0 || believes_start_)) {
      begin_anew();
      return false;
    }
  }
  const double speed_mps = std::isfinite(state.speed_mps()) ? state.speed_mps() : 0;
  distance_offset_m_ = state.distance_m() + speed_mps * age_s - first.distance_m;
  bool placed = false;
  if (begun_anew_) {
    const auto known = known_place_of(state, known_->in_doubt);
    if (const auto place = place_at(map_, known, first.stamp_ns, config_.parameters.interval_factor)) {
      fusion_->add(*place);
      placed = true;
    } else {
      learnt_ = false;
    }
  }
  begun_anew_ = false;
  known_.reset();
  return !placed;
}

// Measurements that waited while this process began say too small an age of the notes. How old they are is seen when
// the last one must have been used, and not before: a clock that was set forward looks right for a moment on the way.
bool FusionService::catches_up(double behind_s) {
  if (is_played() || (!behind_since_ns_ && behind_s <= kSameRideS)) return false;
  const int64_t now_ns = core::monotonic_ns();
  if (!behind_since_ns_) behind_since_ns_ = now_ns;
  return now_ns - *behind_since_ns_ < kCatchUpNs;
}

// What is known of the place comes from another fusion: what this one believes of it is forgotten.
void FusionService::begin_anew() {
  forget_start();
  begun_anew_ = true;
}

void FusionService::forget_start() {
  fusion_.emplace(core::value_or_throw(Fusion::create(config_.parameters, map_, std::nullopt, scale_file_.saved())));
  believes_start_ = false;
}

// A train that already runs left its start before this computer was switched on.
bool FusionService::stands_at_start(const TrainEstimate& estimate) {
  if (start_seen_ || !std::isfinite(estimate.speed_mps)) return true;
  start_seen_ = true;
  return is_played() || std::abs(estimate.speed_mps) < kStandsMps;
}

// Until a speed is known it may be a train that already runs.
TrainEstimate FusionService::said_of(const TrainEstimate& measured) const {
  if (!believes_start_ || start_seen_ || is_played()) return measured;
  TrainEstimate said = measured;
  said.track_known = false;
  said.path.reset();
  said.track_probability = 0;
  said.lat_deg = said.lon_deg = said.easting_m = said.northing_m = said.heading_rad = std::nan("");
  said.integrity = Integrity::unusable;
  said.reason = "whether the train stands at fusion.start is not known before its speed is";
  return said;
}

// Whatever the stamps say: the sensors' host may have another clock than this one.
bool FusionService::is_played() const {
  return data_time_ || context_.common().lock_step;
}

// The train stood at the configured start when the data began, and nowhere else in it.
void FusionService::restart(int64_t data_ns) {
  FusionConfig config = config_;
  const bool from_start = begun_ns_ && std::abs(core::seconds(data_ns - *begun_ns_)) < kSameBeginS;
  if (!from_start) config.start = "unknown";
  believes_start_ = map_ && config.start != "unknown";
  fusion_.emplace(make_fusion(config, map_, scale_file_.saved()));
  latest_.reset();
  known_.reset();
  begun_anew_ = learnt_ = in_doubt_ = false;
  fitness_ = 0;
  heard_ns_ = 0;
  distance_offset_m_ = 0;
  left_out_ = {};
  pose_ = TrainPose(config.parameters.gnss_map_sigma_m);
  data_time_.reset();
}

void FusionService::listen(const FusionConfig& config) {
  if (config.use_wheel) {
    context_.on<msg::WheelSample>(wheel_sample, [this](const msg::WheelSample& m) {
      const WheelInput sample{m.stamp_ns(), m.pulses(), m.pulses_per_metre()};
      if (!scale_file_.fits(sample)) fusion_->drop_saved_scales();
      use(sample, m.grabbed_ns());
    });
  }
  if (config.use_imu) {
    context_.on<msg::ImuSample>(imu_sample, [this](const msg::ImuSample& m) {
      pose_.add(body_sample_of(m));
      use(ImuInput{m.stamp_ns(), m.accel_x_mps2(), m.rate_z_rps()}, m.grabbed_ns());
    });
  }
  if (config.use_gnss) context_.on<msg::GnssFix>(gnss_fix, [this](const msg::GnssFix& m) { use_gnss(m); });
  if (config.use_camera) {
    context_.on<msg::OdometryStep>(odometry_step,
                                   [this](const msg::OdometryStep& m) { use(input_of(m), m.grabbed_ns()); });
    context_.on<msg::CameraCalibration>(camera_calibration, [this](const msg::CameraCalibration& m) {
      if (!scale_file_.fits(m)) fusion_->drop_saved_scales();
    });
  }
  if (config.use_fixes) {
    context_.on<msg::PositionFix>(position_fix, [this](const msg::PositionFix& m) { use(m); });
  }
}

void FusionService::use(const msg::PositionFix& fix) {
  if (map_ && !track::lies_there(*map_, messaging::place_of(fix), messaging::pose_of(fix))) {
    leave_out(position_fix.name, "map_matcher has another map than fusion.map: give both services the same file");
    return;
  }
  use(input_of(fix), 0);
}

void FusionService::use_gnss(const msg::GnssFix& sample) {
  if (!map_) return;
  if (map_->crs.empty()) {
    if (!no_projection_told_) context_.log().warn("GNSS is not used: the map has no coordinate system (crs)");
    no_projection_told_ = true;
    return;
  }
  GnssInput input{.stamp_ns = sample.stamp_ns(), .easting_m = 0, .northing_m = 0, .hdop = 0, .fix = sample.fix()};
  if (input.fix != msg::GNSS_NONE) {
    const auto place = map_->from_geo({sample.lat_deg(), sample.lon_deg()});
    const double nan = std::numeric_limits<double>::quiet_NaN();
    input.easting_m = place ? place->x() : nan;
    input.northing_m = place ? place->y() : nan;
    input.hdop = sample.hdop();
    if (!extent_) extent_.emplace(*map_);
    if (extent_->is_far_off(input.easting_m, input.northing_m)) {
      leave_out(gnss_fix.name, "they lie more than 50 km off the map: latitude and longitude may be exchanged");
      return;
    }
  }
  use(input, sample.grabbed_ns());
}

void FusionService::use(const Event& event, int64_t grabbed_ns) {
  context_.health().input();
  if (!begun_ns_) begun_ns_ = stamp_of(event);
  const FusionCounts before = fusion_->counts();
  const auto estimate = fusion_->add(event);
  note_left_out(event, before);
  if (estimate) publish(*estimate, grabbed_ns);
}

void FusionService::note_left_out(const Event& event, const FusionCounts& before) {
  const FusionCounts& now = fusion_->counts();
  const char* why = now.nonsense > before.nonsense     ? service::LeftOut::kNoSense
                    : now.too_late > before.too_late   ? "they came later than fusion.history_s behind the newest"
                    : now.jumped > before.jumped       ? "their clock is ahead of the other sensors'"
                    : now.elsewhere > before.elsewhere ? "they say a track where the train is not"
                                                       : nullptr;
  if (why != nullptr) leave_out(topic_of(event), why);
}

void FusionService::leave_out(const std::string& topic, const char* why) {
  left_out_.add(topic, why, fusion_->latest_stamp_ns().value_or(0));
  if (!latest_) context_.health().degraded(left_out());
}

std::string FusionService::left_out() const {
  return left_out_.sentence(fusion_->latest_stamp_ns().value_or(0));
}

void FusionService::keep_time(const msg::DataClock& clock) {
  data_time_.emplace(clock, core::wall_ns(), core::monotonic_ns());
  if (clock.ended() != 0) return;
  if (const auto estimate = fusion_->tick(clock.data_ns())) publish(*estimate, 0);
}

// When nothing comes any more the interval must still grow.
void FusionService::tick() {
  if (data_time_ ? data_time_->stands() : context_.common().lock_step) return;
  const auto latest_ns = fusion_->latest_stamp_ns();
  if (!latest_ns) return;
  const int64_t monotonic_ns = core::monotonic_ns();
  if (*latest_ns != newest_stamp_ns_) {
    newest_stamp_ns_ = *latest_ns;
    newest_came_ns_ = monotonic_ns;
  }
  // In the clock of the sensors' host, whatever this one's says.
  const int64_t now_ns = data_time_ ? data_time_->at(monotonic_ns) : newest_stamp_ns_ + monotonic_ns - newest_came_ns_;
  if (const auto estimate = fusion_->tick(now_ns)) publish(*estimate, 0);
}

void FusionService::publish(const TrainEstimate& measured, int64_t grabbed_ns) {
  if (believes_start_ && !stands_at_start(measured)) {
    forget_start();
    return;
  }
  if (known_ && !take_over(measured)) return;
  scale_file_.follow(*fusion_, measured);
  const TrainEstimate estimate = said_of(measured);
  msg::TrainState message = message_of(estimate);
  message.grabbed_ns(grabbed_ns);
  message.distance_m(message.distance_m() + distance_offset_m_);
  in_doubt_ = estimate.place_in_doubt;
  fitness_ = fitness_of(estimate, map_ != nullptr);
  if (latest_ && latest_->track_known() != 0 && !estimate.track_known) context_.log().warn(estimate.reason);
  latest_ = message;
  if (context_.in_charge()) {
    send(message);
    if (estimate.track_known) publish_pose(estimate);
  }
  std::string why = estimate.reason;
  if (const auto unused = left_out(); !unused.empty()) why += (why.empty() ? "" : "; ") + unused;
  if (why.empty()) {
    context_.health().active();
  } else {
    context_.health().degraded(why);
  }
}

void FusionService::send(const msg::TrainState& state) {
  msg::TrainState message = state;
  message.seq(++seq_);
  if (!writer_.write(message)) context_.health().dropped(1);
  context_.health().output(message.grabbed_ns());
  keep(message);
}

void FusionService::publish_pose(const TrainEstimate& estimate) {
  const bool imu_healthy = !fusion_->estimator()->watch(Source::imu).isolated;
  if (!pose_writer_.write(message_of(pose_.at(estimate, *estimate.path, imu_healthy)))) context_.health().dropped(1);
}

}  // namespace railfix::fusion
