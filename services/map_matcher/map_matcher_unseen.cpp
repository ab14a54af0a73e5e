// What the map matcher does where no camera measures: gyro and fusion's speed lead the matchers, the choice of the
// track and the search.
#include <cmath>
#include <utility>

#include "core/time.hpp"
#include "map_matcher/map_matcher.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kNoCameraS = 0.5;  // without an odometry step
constexpr double kLostS = 30.0;     // after so long unseen the track is chosen anew

}  // namespace

// The gyro tells the shape then, along fusion's way. Where it does not, what came before cannot be joined to what
// comes.
void MapMatcher::match_shape_without_camera(int64_t to_ns, PlaceFixes& fixes) {
  const double since_s = core::seconds(to_ns - shaped_ns_);
  const bool goes_on = std::abs(since_s) < FollowedPath::kOldStateS;  // otherwise the clock was set, or nobody measured
  if (goes_on && since_s <= 0) return;
  const auto turn = goes_on ? turn_of_gyro(shaped_ns_, to_ns) : std::nullopt;
  shaped_ns_ = to_ns;
  if (!turn) {
    curvature_->forget();
    if (exits_) exits_->forget();
    return;
  }
  unseen_m_ += turn->way_m;
  if (std::abs(turn->way_m) > parameters_.least_speed_mps * turn->duration_s) {
    curvature_->add(shape_m(), *turn);
    if (exits_) exits_->add(shape_m() - 0.5 * turn->way_m, turn->turn_rad / turn->way_m, CurvatureOf::body);
  }
  match_shape(to_ns, fixes);
}

// Odometry says something of each picture, blind or not.
bool MapMatcher::has_pictures() const {
  return step_ && std::abs(core::seconds(state_->placed.stamp_ns - step_->stamp_ns)) < kNoCameraS;
}

std::optional<Turn> MapMatcher::turn_of_gyro(int64_t from_ns, int64_t to_ns) const {
  if (!state_ || !std::isfinite(state_->placed.speed_mps)) return std::nullopt;
  if (std::abs(core::seconds(to_ns - state_->placed.stamp_ns)) > FollowedPath::kOldStateS) return std::nullopt;
  auto turn = gyro_.between(from_ns, to_ns);
  if (turn) turn->way_m = state_->placed.speed_mps * core::seconds(to_ns - from_ns);
  return turn;
}

// By gyro and fusion's speed. Behind a longer silence the way begins anew.
void MapMatcher::search_without_camera(PlaceFixes& fixes) {
  const int64_t stamp_ns = state_->placed.stamp_ns;
  const int64_t from_ns = std::exchange(searched_ns_, stamp_ns);
  if (has_pictures()) return;
  if (from_ns == 0 || stamp_ns <= from_ns || core::seconds(stamp_ns - from_ns) > FollowedPath::kOldStateS) return;
  search_by(turn_of_gyro(from_ns, stamp_ns), stamp_ns, fixes);
}

// Without a camera fusion's states lead: they come ten times a second.
void MapMatcher::follow_without_camera(PlaceFixes& fixes) {
  const int64_t stamp_ns = state_->placed.stamp_ns;
  if (!prior_at(stamp_ns)) return;
  move_without_camera(stamp_ns);
  say_track(fixes);
}

// From where the chooser has come to, whoever had led it there.
void MapMatcher::move_without_camera(int64_t to_ns) {
  const double dt_s = core::seconds(to_ns - moved_ns_);
  // A clock that was set back leaves it in the future.
  if (moved_ns_ == 0 || dt_s > kLostS || dt_s < -FollowedPath::kOldStateS) {
    if (moved_ns_ != 0) chooser_.emplace(parameters_.track_parameters(), map_, ways_);
    moved_ns_ = to_ns;
    return;
  }
  const double speed_mps = state_->placed.speed_mps;
  if (dt_s <= 0 || !std::isfinite(speed_mps)) return;
  if (const auto turn = turn_of_gyro(moved_ns_, to_ns)) {
    move(*turn, to_ns);
    return;
  }
  chooser_->move_blind(speed_mps * dt_s);
  moved_ns_ = to_ns;
}

}  // namespace railfix::map_matcher
