// How far from its place the train may be, and whether it turns as the track does there.
#include "fusion/map_place.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kPointsOffM = 5.0;  // from where the map has them, or the wheels behind the foot
constexpr double kHeldByGnssS = 5.0;
constexpr double kLostAtLeastM = 100.0;
constexpr double kLostAtMostM = 500.0;
constexpr double kTurnSigmas = 4.0;
constexpr double kTurnSigmasOfTwo = 2.0;  // without the worst second

}  // namespace

void MapPlace::start_on(std::shared_ptr<const track::Path> path, const TrainMotion& motion) {
  known_.path = std::move(path);
  tell(ToldBy::start, motion);
  doubt_points_behind(motion);
}

void MapPlace::tell(ToldBy by, const TrainMotion& motion) {
  known_.told.tell(by, motion.distance_m(), motion.filter().path_sigma_m());
}

// The train may stand in front of points that the place which was told lies behind.
void MapPlace::doubt_points_behind(const TrainMotion& motion) {
  const double here_m = motion.filter().path_distance_m();
  known_.track_doubt.begin_at(here_m - known_to_m(motion) - kPointsOffM);
  known_.track_doubt.move(*known_.path, here_m);
}

void MapPlace::follow_on(const std::shared_ptr<const track::Path>& path,
                         const std::shared_ptr<const track::Path>& longer) {
  if (known_.path == path) known_.path = longer;
}

void MapPlace::move(double way_m, const TrainMotion& motion) {
  if (!known_.path) return;
  auto& doubt = known_.track_doubt;
  doubt.move(*known_.path, motion.filter().path_distance_m());
  const bool turns_otherwise = doubt.turns_otherwise() && !gnss_proven();
  known_.wrong_place.move(way_m, {turns_otherwise, doubt.turns_otherwise_now(), gnss_denies(), is_off_map(motion)});
}

void MapPlace::set_clock(int64_t stamp_ns) {
  for (auto* watch : {&gnss_.watch, &landmarks_, &curves_}) watch->set_clock(stamp_ns);
}

// What GNSS said against a wheel stays held: the wheel may have slid, and then the distance is as wrong as the place
// was.
void MapPlace::give_up(Against because) {
  known_ = {};
  known_.given_up = because;
  claimed_ = {};
  gnss_.watch = {};
  gnss_.agreed = 0;
  gnss_.contradicts_direction = false;
  landmarks_ = {};
  curves_ = {};
  refused_.reset();
  off_path_.reset();
  corrected_ = false;
}

void MapPlace::doubt(const Sides& beyond, const TrainMotion& motion) {
  const auto known = interval(motion);
  if (beyond.behind_m > 0) claimed_.behind_m = centre_m(motion) - known.rear_m + beyond.behind_m;
  if (beyond.ahead_m > 0) claimed_.ahead_m = known.front_m - centre_m(motion) + beyond.ahead_m;
}

void MapPlace::refer_back(double since_reference_m, const TrainMotion& motion) {
  known_.fix_m = known_.reference_m = motion.distance_m() - since_reference_m;
}

double MapPlace::centre_m(const TrainMotion& motion) const {
  return known_.path ? motion.filter().path_distance_m() : motion.distance_m();
}

double MapPlace::sigma_m(const TrainMotion& motion) const {
  return known_.path ? std::hypot(motion.filter().path_sigma_m(), parameters_->place_shared_sigma_m)
                     : motion.filter().sigma(StateIndex::distance);
}

double MapPlace::since_fix_m(const TrainMotion& motion) const {
  return std::abs(motion.distance_m() - known_.fix_m);
}

double MapPlace::since_reference_m(const TrainMotion& motion) const {
  return std::abs(motion.distance_m() - known_.reference_m);
}

Interval MapPlace::interval(const TrainMotion& motion) const {
  const double known_m = known_to_m(motion) + motion.odometers_apart_m() + motion.unchecked_m();
  const double bound_m = std::max(known_m, lost_to_m(motion));
  const Sides ways = known_.other_ways.held();
  Sides held{bound_m + ways.behind_m, bound_m + ways.ahead_m};
  held.hold(claimed_);
  held.hold(gnss_.held);
  const double here_m = centre_m(motion);
  return {here_m - held.behind_m - motion.gap_m() - motion.silent_m(), here_m + held.ahead_m};
}

Interval MapPlace::widened(const Interval& interval, const TrainMotion& motion) const {
  const bool held = gnss_proven() && gnss_.watch.used_within(kHeldByGnssS, motion.filter().stamp_ns());
  const double most_m = held ? gnss_bound_m(motion) : std::numeric_limits<double>::infinity();
  const Sides more = motion.unwatched();
  return {interval.rear_m - std::min(more.behind_m, most_m), interval.front_m + std::min(more.ahead_m, most_m)};
}

double MapPlace::known_to_m(const TrainMotion& motion) const {
  return parameters_->interval_factor * sigma_m(motion) + parameters_->interval_floor_m +
         parameters_->interval_drift * since_fix_m(motion);
}

// Where a map lacks a piece of track the place is off by that from there on. So far that it is no position, and that
// the matcher, which has few landmarks to choose from then, finds the train there.
double MapPlace::lost_to_m(const TrainMotion& motion) const {
  if (!known_.wrong_place.lost()) return 0;
  const double budgets_m = parameters_->unusable_budgets * parameters_->allowed_m(since_reference_m(motion));
  return std::clamp(budgets_m, kLostAtLeastM, kLostAtMostM);
}

double MapPlace::doubted_m(const FixContext& context, const TrainMotion& motion) const {
  const auto sure = interval(motion);
  const auto promised = context.unwidened ? sure : widened(sure, motion);
  const double here_m = centre_m(motion);
  return std::max(here_m - promised.rear_m, promised.front_m - here_m) - known_to_m(motion) + context.excess_m;
}

// Wherever in its interval it is.
bool MapPlace::is_off_map(const TrainMotion& motion) const {
  const auto& path = *known_.path;
  const double here_m = motion.filter().path_distance_m();
  if (here_m >= path.begin_m() && here_m <= path.end_m()) return false;
  const auto known = widened(interval(motion), motion);
  return known.rear_m > path.end_m() || known.front_m < path.begin_m();
}

void MapPlace::use(const YawRate& rate, TrainMotion& motion) {
  auto& filter = motion.filter();
  const double speed_mps = filter.speed_mps();
  const double speed_sigma_mps = filter.sigma(StateIndex::speed);
  const double gyro_sigma_rps = parameters_->gyro_sigma_rps;
  const double period_s = parameters_->gyro_period_s;
  if (rate.just_failed) known_.track_doubt.changed();  // it has spoken against the track
  if (!rate.believed) {
    known_.turned_way.clear();
    return;
  }
  if (motion.stands()) {
    filter.offer_yaw_rate(rate.rps, 0, 0, gyro_sigma_rps, parameters_->gate_gyro);
    return;
  }
  if (!known_.path || filter.path_sigma_m() > TrainMotion::kCurvatureSigmaM || speed_sigma_mps > 1) {
    known_.turned_way.clear();
    return;
  }
  const double here_m = filter.path_distance_m();
  known_.turned_way.add({here_m - speed_mps * period_s, here_m,
                         (rate.rps - filter.value(StateIndex::gyro_bias)) * period_s, gyro_sigma_rps * period_s,
                         period_s});
  // The mean belongs to the middle of its period.
  const auto point = known_.path->at(here_m - 0.5 * speed_mps * period_s);
  // A tenth of the curvature covers the map's error, which is the same for a whole curve.
  const double sigma_rps =
      gyro_sigma_rps + std::abs(point.curvature_per_m) * (0.1 * std::abs(speed_mps) + speed_sigma_mps);
  const auto offer = filter.offer_yaw_rate(rate.rps, point.curvature_per_m, point.curvature_rate_per_m2, sigma_rps,
                                           parameters_->gate_gyro);
  const bool bends = std::abs(speed_mps * point.curvature_per_m) > parameters_->gate_gyro * sigma_rps;
  known_.track_doubt.turned(offer.used, bends);
  compare_turns(motion);
}

// Where no switch was run over there is no other leg, and where the place is in doubt its turns say nothing. One mast
// may stand beside both legs: as long as the points are among what is remembered, having seen it says less than the
// turns.
void MapPlace::compare_turns(const TrainMotion& motion) {
  const auto points_m = known_.track_doubt.divided_at_m();
  const bool passed = points_m && known_.turned_way.holds(*points_m);
  if (known_.wrong_place.lost() || (!known_.track_doubt.divided() && !passed)) return;
  const auto& filter = motion.filter();
  const auto known = widened(interval(motion), motion);
  const double half_m = 0.5 * (known.front_m - known.rear_m);
  const double place_m = std::max(filter.path_sigma_m(), half_m / parameters_->interval_factor);
  const auto misfit = known_.turned_way.misfit(*known_.path, {filter.sigma(StateIndex::gyro_bias), place_m});
  if (misfit.most > kTurnSigmas && misfit.without_worst > kTurnSigmasOfTwo) known_.track_doubt.turned_elsewhere();
}

}  // namespace railfix::fusion
