#include "fusion/fusion.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "core/time.hpp"
#include "core/within.hpp"
#include "track/declared.hpp"

namespace railfix::fusion {

using core::positive;
using core::up_to;
using core::within;

namespace {

constexpr double kPathAheadM = 300000;
constexpr double kPathBehindM = 50000;
constexpr double kPathLeftM = 20000;  // it is followed on when less of it is left, ...
constexpr double kPathAgainM = 5000;  // ... and tried again so much further on where it could not be
constexpr double kBesideM = 50.0;     // beyond the interval: what is further off is no track beside the train
constexpr double kNoCameraS = 0.3;
constexpr int64_t kSnapshotNs = 50'000'000;
constexpr int64_t kSlipUnseenNs = 1'200'000'000;  // a slip may have grown for so long before it is found
constexpr double kMeanSpeedS = 1.0;               // over longer times a mean speed says little of the speed now

// Beyond what any train has, squares run over.
bool has_sense(const ImuInput& e) {
  return up_to(e.accel_x_mps2, 1e3) && up_to(e.rate_z_rps, 1e3);
}
bool has_sense(const WheelInput& e) {
  return positive(e.pulses_per_metre, 1e6) && up_to(static_cast<double>(e.pulses), 1e15);
}
bool has_sense(const PictureInput&) {
  return true;
}
bool has_sense(const OdometryInput& e) {
  return up_to(e.step_m, 1e6) && up_to(e.step_sigma_m, 1e6) && (!e.valid || e.reference_stamp_ns != e.stamp_ns);
}
bool has_sense(const GnssInput& e) {
  return up_to(e.easting_m, 1e9) && up_to(e.northing_m, 1e9) && up_to(e.hdop, 1e6);
}
bool has_sense(const FixInput& e) {
  const bool known = e.kind >= FixKind::curvature && e.kind <= FixKind::gnss;
  return known && (e.kind == FixKind::track || up_to(e.sigma_m, 1e7)) && up_to(e.offset_m, 1e9) &&
         within(e.probability, 0, 1) && up_to(e.otherwise.behind_m, 1e7) && up_to(e.otherwise.ahead_m, 1e7);
}

// Two fixes may have one stamp; everything else has one measurement for each stamp.
std::tuple<int64_t, size_t, int, uint32_t> order_of(const Event& event) {
  const auto* fix = std::get_if<FixInput>(&event);
  return {stamp_of(event), event.index(), fix ? static_cast<int>(fix->kind) : 0, fix ? fix->landmark : 0};
}

}  // namespace

core::Result<Fusion> Fusion::create(const FusionParameters& parameters, std::shared_ptr<const track::Map> map,
                                    const std::optional<track::EdgePosition>& start,
                                    const std::optional<SavedScales>& saved) {
  if (!start || !map) return Fusion(parameters, std::move(map), nullptr, saved);
  auto path = track::Path::follow(map, *start, kPathAheadM, kPathBehindM);
  if (!path.ok()) return path.error();
  return Fusion(parameters, std::move(map), std::make_shared<const track::Path>(std::move(path).value()), saved);
}

Fusion::Fusion(const FusionParameters& parameters, std::shared_ptr<const track::Map> map,
               std::shared_ptr<const track::Path> path, const std::optional<SavedScales>& saved)
    : parameters_(std::make_shared<const FusionParameters>(parameters)),
      map_(std::move(map)),
      path_(std::move(path)),
      saved_(saved) {
  if (saved) lag_room_.begin_with(saved->camera_lag, parameters);
}

void Fusion::begin_before(const Event& event) {
  // The first step counts from a picture before it: begin there.
  const auto* step = std::get_if<OdometryInput>(&event);
  const bool from_reference = step && step->reference_stamp_ns < step->stamp_ns &&
                              core::seconds(step->stamp_ns - step->reference_stamp_ns) < parameters_->max_jump_s;
  const int64_t begin_ns = (from_reference ? step->reference_stamp_ns : stamp_of(event)) - 1;
  const auto scales = saved_ ? std::optional(aged(*saved_, begin_ns, *parameters_)) : std::nullopt;
  now_.emplace(parameters_.get(), scales, path_, begin_ns);
  snapshots_.push_back(*now_);
}

SavedScalesAre Fusion::saved_scales() const {
  return now_ ? now_->saved_scales() : saved_ ? SavedScalesAre::on_trial : SavedScalesAre::none;
}

void Fusion::drop_saved_scales() {
  saved_.reset();
  lag_room_.forget_earlier_trips();
  if (now_) now_->drop_saved();
  if (before_behind_) before_behind_->drop_saved();
  for (auto& snapshot : snapshots_) snapshot.drop_saved();
}

std::optional<OdometerScales> Fusion::learnt_scales() const {
  return now_ ? now_->learnt() : std::nullopt;
}

std::optional<CameraLag::Lag> Fusion::camera_lag() const {
  return lag_room_.to_keep(*parameters_);
}

std::optional<TrainEstimate> Fusion::add(Event event) {
  if (!std::visit([](const auto& input) { return has_sense(input); }, event)) {
    ++counts_.nonsense;
    return std::nullopt;
  }
  if (is_early(event)) {
    wait_with(std::get<GnssInput>(event));
    return std::nullopt;
  }
  if (!now_) begin_with(event);
  const int64_t oldest_ns = snapshots_.front().stamp_ns();
  const auto [stamp, believed, first] = stamps_.judge(event, now_->stamp_ns(), oldest_ns, parameters_->max_jump_s);
  if (stamp == Stamp::ahead) return hear_ahead(event, believed);
  if (!stamps_.holds_behind()) before_behind_.reset();
  if (stamp == Stamp::behind && first) {
    catch_up();
    before_behind_ = *now_;
  }
  if (stamp == Stamp::behind && believed) return set_clock_back(event.index());
  if (stamp_of(event) <= oldest_ns) {
    ++counts_.too_late;
    return std::nullopt;
  }
  const auto estimate = use(std::move(event));
  if (!early_.empty()) use_waiting();
  return estimate;
}

std::optional<TrainEstimate> Fusion::use(Event event) {
  if (auto* fix = std::get_if<FixInput>(&event)) {
    catch_up();
    start_position(*fix);
    if (!change_track(*fix)) {
      ++counts_.elsewhere;
      return std::nullopt;
    }
  }
  look_beside(event);
  if (const auto* wheel = std::get_if<WheelInput>(&event)) {
    last_wheel_ = *wheel;
    lag_room_.add(*wheel);
  }
  if (auto* step = std::get_if<OdometryInput>(&event)) {
    lag_room_.add(*step);
    anchor(*step);
    remember_reference(*step);
  }
  follow_path_on();
  return insert(event);
}

std::optional<TrainEstimate> Fusion::tick(int64_t now_ns) {
  if (!now_) return std::nullopt;
  // Before an odometer has measured there is nothing to go on with, and its first measurements may be late.
  const bool moved =
      std::ranges::any_of(kOdometers, [&](Source one) { return now_->main().sensors().has_ever_measured(one); });
  const double patience_s = moved ? parameters_->output_period_s : parameters_->sensor_timeout_s;
  if (core::seconds(now_ns - last_output_ns_) < patience_s) return std::nullopt;
  if (now_ns <= now_->stamp_ns()) return std::nullopt;
  catch_up();
  ScaleTrial ahead = *now_;
  ahead.predict_to(now_ns);
  return give(ahead.estimate());
}

std::optional<int64_t> Fusion::latest_stamp_ns() const {
  if (!now_) return std::nullopt;
  return now_->stamp_ns();
}

const Estimator* Fusion::estimator() {
  catch_up();
  return now_ ? &now_->main() : nullptr;
}

void Fusion::start_position(FixInput& fix) const {
  const bool of_begin = fix.kind == FixKind::network || fix.kind == FixKind::gnss;
  if (now_->main().place().path() || !map_ || !of_begin || fix.probability < kBeginProbability) return;
  auto path = track::Path::follow(map_, {fix.edge, fix.offset_m, fix.direction}, kPathAheadM, kPathBehindM);
  if (path.ok()) fix.new_path = std::make_shared<const track::Path>(std::move(path).value());
}

// Of every fix that could confirm a start, whoever needs it: one that comes late is used at its own time.
void Fusion::look_beside(Event& event) {
  auto* gnss = std::get_if<GnssInput>(&event);
  auto* fix = std::get_if<FixInput>(&event);
  const bool confirms = gnss != nullptr || (fix != nullptr && fix->kind != FixKind::track);
  if (!map_ || !confirms) return;
  if (!beside_) beside_.emplace(map_);
  if (gnss != nullptr) {
    gnss->tells_track = !beside_->many_at(gnss->easting_m, gnss->northing_m);
  } else if (map_->edge(fix->edge) != nullptr) {
    const auto* landmark = fix->kind == FixKind::landmark ? map_->landmark(fix->landmark) : nullptr;
    fix->tells_track = landmark != nullptr ? !beside_->has_alike(*landmark)
                                           : !beside_->any_at({fix->edge, fix->offset_m, fix->direction});
  }
}

// The place along the track stays; only the edges below it become others. Over which ones the train came is not said:
// where several lead there the place may be another by what their lengths differ. False: that track is not beside the
// train, but elsewhere on its way or on the map, and who says so is lost.
bool Fusion::change_track(FixInput& fix) {
  const auto& path = now_->main().place().path();
  if (fix.kind != FixKind::track || !path) return true;
  if (map_->edge(fix.edge) == nullptr) return false;
  const auto& filter = now_->main().filter();
  const double here_m = filter.path_distance_m() - filter.speed_mps() * core::seconds(filter.stamp_ns() - fix.stamp_ns);
  const auto known = now_->main().interval();
  const double reach_m = kBesideM + known.front_m - known.rear_m;  // who says it may be at the other end
  const track::EdgePosition place{fix.edge, fix.offset_m, fix.direction};
  const auto runs_here = [&](const track::Path& way) {
    const auto place_m = way.route().distance_of(place, here_m);
    return place_m && std::abs(*place_m - here_m) < reach_m;
  };
  if (path->distance_of(place, here_m)) return runs_here(*path);
  // Round a loop the path may run over it the other way, elsewhere; a train does not turn round where it is.
  const auto turned_m = path->distance_of({fix.edge, fix.offset_m, track::Direction::unknown}, here_m);
  if (turned_m && std::abs(*turned_m - here_m) < reach_m) return false;
  if (fix.probability < track::kDeclaredProbability) return true;
  if (!ways_) ways_.emplace(*map_);
  auto way = track::rerouted(*path, *ways_, place, here_m, kPathAheadM, kPathBehindM);
  if (!way || !runs_here(way->path)) return false;
  const double place_m = *way->path.route().distance_of(place, here_m);
  for (const double otherwise_m : way->otherwise_m) {
    if (std::abs(otherwise_m - here_m) > reach_m) continue;
    fix.otherwise.hold({otherwise_m - place_m, place_m - otherwise_m});
  }
  fix.new_path = std::make_shared<const track::Path>(std::move(way->path));
  return true;
}

// A train may run further than the path was followed at the start, backwards as well. What is behind and below it
// stays.
void Fusion::follow_path_on() {
  const auto path = now_->main().place().path();
  if (!path) return;
  const double here_m = now_->main().filter().path_distance_m();
  if (std::min(path->end_m() - here_m, here_m - path->begin_m()) > kPathLeftM) return;
  if (followed_on_at_m_ && std::abs(here_m - *followed_on_at_m_) < kPathAgainM) return;
  followed_on_at_m_ = here_m;
  if (!ways_) ways_.emplace(*map_);
  auto longer = track::followed_on(*path, *ways_, here_m, kPathAheadM, kPathBehindM);
  if (!longer) return;
  const auto shared = std::make_shared<const track::Path>(std::move(*longer));
  now_->follow_on(path, shared);
  if (before_behind_) before_behind_->follow_on(path, shared);
  for (auto& snapshot : snapshots_) snapshot.follow_on(path, shared);
}

// At rest odometry keeps its reference picture, and that may be older than fusion, or of the clock before: then the
// first step that counts from it is taken off the next ones, which count from the first one's picture so.
void Fusion::anchor(OdometryInput& step) {
  const auto knows = [&](int64_t picture_ns) {
    return picture_ns < step.stamp_ns &&
           (now_->main().filter().has_clone(picture_ns) || picture_ns > snapshots_.front().stamp_ns());
  };
  if (!step.valid || knows(step.reference_stamp_ns)) return;
  if (anchor_ && anchor_->reference_stamp_ns == step.reference_stamp_ns && knows(anchor_->stamp_ns)) {
    step.reference_stamp_ns = anchor_->stamp_ns;
    step.step_m -= anchor_->step_m;
    step.step_sigma_m = std::hypot(step.step_sigma_m, anchor_->step_sigma_m);
    return;
  }
  anchor_ = step;
  const double since_s = core::seconds(step.stamp_ns - step.reference_stamp_ns);
  step.valid = since_s > 0 && since_s < kMeanSpeedS;
}

void Fusion::remember_reference(const OdometryInput& step) {
  if (!step.valid || now_->main().filter().has_clone(step.reference_stamp_ns)) return;
  if (step.reference_stamp_ns > snapshots_.front().stamp_ns()) insert(PictureInput{step.reference_stamp_ns});
}

std::optional<TrainEstimate> Fusion::insert(const Event& event) {
  const auto place = std::lower_bound(events_.begin(), events_.end(), event,
                                      [](const Event& a, const Event& b) { return order_of(a) < order_of(b); });
  if (place != events_.end() && order_of(*place) == order_of(event)) {
    ++counts_.repeated;
    return std::nullopt;
  }
  if (!std::holds_alternative<PictureInput>(event)) ++counts_.used;
  if (const auto* step = std::get_if<OdometryInput>(&event))
    last_odometry_ns_ = std::max(last_odometry_ns_, step->stamp_ns);
  const bool wanted = due(event);
  // Before the insertion, which may move the deque's begin.
  const auto mine = place - events_.begin();
  const bool late = place != events_.end();
  events_.insert(place, event);
  if (late) replay_from_ns_ = std::min(replay_from_ns_.value_or(stamp_of(event)), stamp_of(event));
  // Of many late ones in a row, as of a sensor that was away, the time is replayed once.
  if (late && !wanted) return std::nullopt;
  const auto estimate = replay_from_ns_ ? catch_up(wanted ? mine : -1) : run_from(mine, wanted ? mine : -1);
  return estimate ? give(*estimate) : std::nullopt;
}

std::optional<TrainEstimate> Fusion::catch_up(std::ptrdiff_t wanted) {
  if (!replay_from_ns_) return std::nullopt;
  const auto next = rewind_before(undo_slips_since(*replay_from_ns_));
  replay_from_ns_.reset();
  return run_from(next, wanted);
}

// Gives the state after the wanted event.
std::optional<TrainEstimate> Fusion::run_from(std::ptrdiff_t next, std::ptrdiff_t wanted) {
  std::optional<TrainEstimate> estimate;
  while (next < static_cast<std::ptrdiff_t>(events_.size())) {
    run(events_[static_cast<size_t>(next)]);
    if (next == wanted) estimate = now_->estimate();
    ++next;
    if (now_->slip_began() && take_slip_back()) next = rewind_before(slips_.back().block.from_ns);
  }
  forget_old();
  return estimate;
}

void Fusion::run(const Event& event) {
  now_->apply(event);
  if (snapshots_.back().stamp_ns() == now_->stamp_ns()) {
    snapshots_.back() = *now_;
  } else if (now_->stamp_ns() - snapshots_.back().stamp_ns() >= kSnapshotNs) {
    snapshots_.push_back(*now_);
  }
}

// False: it is taken back already, and was found again while the time was replayed.
bool Fusion::take_slip_back() {
  const int64_t found_ns = now_->stamp_ns();
  if (!slips_.empty() && slips_.back().block.until_ns >= found_ns) return false;
  slips_.push_back({{found_ns - kSlipUnseenNs, found_ns}, now_->slipping()});
  return true;
}

// With a measurement of that stamp slips may be found at other moments: those since then are forgotten. Gives the stamp
// from which on the time is to be replayed.
int64_t Fusion::undo_slips_since(int64_t stamp_ns) {
  while (!slips_.empty() && slips_.back().block.until_ns >= stamp_ns) {
    stamp_ns = std::min(stamp_ns, slips_.back().block.from_ns);
    slips_.pop_back();
  }
  return stamp_ns;
}

// Gives the index of the first event that is to be used again.
std::ptrdiff_t Fusion::rewind_before(int64_t stamp_ns) {
  while (snapshots_.size() > 1 && snapshots_.back().stamp_ns() >= stamp_ns) snapshots_.pop_back();
  now_ = snapshots_.back();
  for (const auto& slip : slips_) {
    if (slip.block.until_ns > now_->stamp_ns()) now_->block_wheel(slip.block, slip.slipping);
  }
  const auto again = std::find_if(events_.begin(), events_.end(),
                                  [&](const Event& event) { return stamp_of(event) > now_->stamp_ns(); });
  return again - events_.begin();
}

void Fusion::forget_old() {
  const int64_t oldest_ns = now_->stamp_ns() - core::to_ns(parameters_->history_s);
  while (snapshots_.size() > 1 && snapshots_[1].stamp_ns() <= oldest_ns) snapshots_.pop_front();
  std::erase_if(slips_, [&](const FoundSlip& slip) { return slip.block.until_ns <= snapshots_.front().stamp_ns(); });
  while (!events_.empty() && stamp_of(events_.front()) <= snapshots_.front().stamp_ns()) events_.pop_front();
}

bool Fusion::due(const Event& event) const {
  if (std::holds_alternative<OdometryInput>(event)) return true;
  if (std::holds_alternative<PictureInput>(event)) return false;
  const int64_t stamp_ns = stamp_of(event);
  const bool camera = last_odometry_ns_ != 0 && core::seconds(stamp_ns - last_odometry_ns_) < kNoCameraS;
  return !camera && core::seconds(stamp_ns - last_output_ns_) >= parameters_->output_period_s;
}

std::optional<TrainEstimate> Fusion::give(TrainEstimate estimate) {
  if (estimate.stamp_ns <= last_output_ns_) return std::nullopt;
  last_output_ns_ = estimate.stamp_ns;
  if (const auto names = stamps_.left_out(now_->stamp_ns()); !names.empty())
    estimate.degrade("left out, its stamps are seconds from those of the odometers: " + names);
  lag_room_.widen(estimate, *parameters_);
  return estimate;
}

}  // namespace railfix::fusion
