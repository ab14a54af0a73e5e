// What time it is: GNSS that waits, stamps far ahead, clocks that are set.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/time.hpp"
#include "fusion/fusion.hpp"

namespace railfix::fusion {
namespace {

constexpr size_t kMostEarly = 50;
constexpr double kStoodM = 0.3;
constexpr double kSlowMps = 0.5;
constexpr double kFewPeriodsS = 1.5;
constexpr double kShortestPeriodS = 0.01;

/// Of the kind that decided what time it is.
int64_t first_stamp_of(const std::vector<Event>& events, size_t kind) {
  int64_t first_ns = std::numeric_limits<int64_t>::max();
  for (const auto& event : events) {
    if (event.index() == kind) first_ns = std::min(first_ns, stamp_of(event));
  }
  return first_ns;
}

/// Of one sensor's samples.
double period_of(const std::vector<Event>& events, size_t kind) {
  int64_t first_ns = 0;
  int64_t last_ns = 0;
  int count = 0;
  for (const auto& event : events) {
    if (event.index() != kind) continue;
    if (count++ == 0) first_ns = stamp_of(event);
    last_ns = stamp_of(event);
  }
  return count < 2 ? 0 : core::seconds(last_ns - first_ns) / (count - 1);
}

}  // namespace

// GNSS never says what time it is where something measures motion: it waits for that.
bool Fusion::is_early(const Event& event) const {
  if (!std::holds_alternative<GnssInput>(event)) return false;
  const auto is_soon_after = [&](int64_t begin_ns) {
    return core::seconds(stamp_of(event) - begin_ns) < parameters_->max_jump_s;
  };
  if (!now_) return early_.empty() || is_soon_after(early_.front().stamp_ns);
  const int64_t newest_ns = stamps_.newest_motion_ns();
  return newest_ns != 0 && stamp_of(event) > newest_ns && is_soon_after(newest_ns);
}

void Fusion::wait_with(const GnssInput& gnss) {
  early_.push_back(gnss);
  if (early_.size() > kMostEarly) early_.pop_front();
}

void Fusion::begin_with(const Event& event) {
  if (!std::holds_alternative<GnssInput>(event)) return begin_before(event);
  // It has waited in vain: nothing measures motion.
  const auto waiting = std::exchange(early_, {});
  begin_before(waiting.front());
  for (const auto& gnss : waiting) add(gnss);
}

void Fusion::use_waiting() {
  const int64_t newest_ns = stamps_.newest_motion_ns();
  const int64_t wild_ns = newest_ns + core::to_ns(parameters_->max_jump_s);
  std::deque<GnssInput> due;
  std::erase_if(early_, [&](const GnssInput& gnss) {
    if (gnss.stamp_ns <= newest_ns) due.push_back(gnss);
    return gnss.stamp_ns <= newest_ns || gnss.stamp_ns > wild_ns;
  });
  for (const auto& gnss : due) add(gnss);
}

// A single wild stamp must not carry the train away; a clock that was really set is followed, and so is time that went
// by with nothing measured.
std::optional<TrainEstimate> Fusion::hear_ahead(const Event& event, bool believed) {
  if (!believed) {
    ++counts_.jumped;
    return std::nullopt;
  }
  std::vector<Event> held = stamps_.take_held(Stamp::ahead);
  counts_.jumped -= held.size() - 1;
  catch_up();
  if (const auto time_s = time_since_counted(held)) return set_clock(held, event.index(), *time_s);
  const auto first = std::ranges::find(held, event.index(), &Event::index);
  auto last = use(*first);
  held.erase(first);
  for (const auto& other : held) {
    if (auto estimate = add(other)) last = std::move(estimate);
  }
  return last;
}

// What counts way over the gap tells how long it was: after a few periods' way the clock was set, and after more the
// train ran on while nothing was heard.
std::optional<double> Fusion::time_since_counted(const std::vector<Event>& held) const {
  const auto& main = now_->main();
  std::optional<double> way_m;
  for (const auto& event : held) {
    const auto* wheel = std::get_if<WheelInput>(&event);
    const auto* step = std::get_if<OdometryInput>(&event);
    if (wheel && last_wheel_ && !main.watch(Source::wheel).isolated) {
      way_m = static_cast<double>(wheel->pulses - last_wheel_->pulses) / wheel->pulses_per_metre;
    } else if (step && step->valid && main.filter().has_clone(step->reference_stamp_ns)) {
      way_m = step->step_m;
    }
    if (way_m) break;
  }
  if (!way_m) return std::nullopt;
  const double speed_mps = main.filter().speed_mps();
  if (std::abs(speed_mps) < kSlowMps) return std::abs(*way_m) < kStoodM ? std::optional(0.0) : std::nullopt;
  const double time_s = *way_m / speed_mps;
  return time_s > -kStoodM / std::abs(speed_mps) && time_s < kFewPeriodsS ? std::optional(time_s) : std::nullopt;
}

// What the samples did to the state before the new clock was believed is undone.
std::optional<TrainEstimate> Fusion::set_clock_back(size_t decided_by) {
  now_ = std::move(before_behind_);
  const auto held = stamps_.take_held(Stamp::behind);
  return set_clock(held, decided_by, period_of(held, decided_by));
}

// The state goes on in the new time, and nothing that is held is lost.
std::optional<TrainEstimate> Fusion::set_clock(const std::vector<Event>& held, size_t decided_by, double since_s) {
  ++counts_.clock_resets;
  snapshots_.clear();
  if (stamps_.newest_motion_ns() == 0) {
    now_.reset();  // GNSS or a fix alone had begun it: in their time the train was elsewhere
  } else {
    now_->rebase_clock(first_stamp_of(held, decided_by) - core::to_ns(std::max(since_s, kShortestPeriodS)));
    snapshots_.push_back(*now_);
  }
  events_.clear();
  slips_.clear();
  replay_from_ns_.reset();
  stamps_ = {};
  before_behind_.reset();
  early_.clear();
  anchor_.reset();
  last_output_ns_ = last_odometry_ns_ = 0;
  std::optional<TrainEstimate> last;
  for (const auto& event : held) {
    if (auto estimate = add(event)) last = std::move(estimate);
  }
  return last;
}

}  // namespace railfix::fusion
