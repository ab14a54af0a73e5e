// What time it is: GNSS that waits, stamps far ahead, clocks that are set.
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/time.hpp"
#include "fusion/fusion.hpp"

namespace railfix::fusion {
namespace {

constexpr double kStoodM = 1.0;
constexpr int64_t kSpacingNs = 10'000'000;  // of samples, about

/// Of the kind that decided what time it is.
int64_t first_stamp_of(const std::vector<Event>& events, size_t kind) {
  int64_t first_ns = std::numeric_limits<int64_t>::max();
  for (const auto& event : events) {
    if (event.index() == kind) first_ns = std::min(first_ns, stamp_of(event));
  }
  return first_ns;
}

}  // namespace

// GNSS never says what time it is: it waits for what measures motion.
bool Fusion::is_early(const Event& event) const {
  if (!std::holds_alternative<GnssInput>(event)) return false;
  if (!now_) return true;
  const int64_t newest_ns = stamps_.newest_motion_ns();
  const double early_s = core::seconds(stamp_of(event) - newest_ns);
  return newest_ns != 0 && early_s > 0 && early_s < parameters_->max_jump_s;
}

void Fusion::use_waiting() {
  while (!early_.empty() && early_.front().stamp_ns <= stamps_.newest_motion_ns()) {
    const GnssInput gnss = early_.front();
    early_.pop_front();
    add(gnss);
  }
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
  if (clock_was_set(held, event.index())) return set_clock(held, event.index());
  const auto first = std::ranges::find(held, event.index(), &Event::index);
  auto last = use(*first);
  held.erase(first);
  for (const auto& other : held) {
    if (auto estimate = add(other)) last = std::move(estimate);
  }
  return last;
}

// What counts way over the gap tells: a train that would have run far and has hardly moved has a clock that was set.
bool Fusion::clock_was_set(const std::vector<Event>& held, size_t decided_by) const {
  const auto& main = now_->main();
  const double gap_s = core::seconds(first_stamp_of(held, decided_by) - now_->stamp_ns());
  const double most_m = kStoodM + 0.5 * std::abs(main.filter().speed_mps()) * gap_s;
  for (const auto& event : held) {
    if (const auto* wheel = std::get_if<WheelInput>(&event)) {
      if (!last_wheel_ || main.watch(Source::wheel).isolated) continue;
      return std::abs(static_cast<double>(wheel->pulses - last_wheel_->pulses)) < most_m * wheel->pulses_per_metre;
    }
    const auto* step = std::get_if<OdometryInput>(&event);
    if (step && step->valid && main.knows_picture(step->reference_stamp_ns)) return std::abs(step->step_m) < most_m;
  }
  return false;
}

// The state goes on in the new time, and nothing that is held is lost.
std::optional<TrainEstimate> Fusion::set_clock(const std::vector<Event>& held, size_t decided_by) {
  ++counts_.clock_resets;
  now_->rebase_clock(first_stamp_of(held, decided_by) - kSpacingNs);
  events_.clear();
  snapshots_.assign(1, *now_);
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
