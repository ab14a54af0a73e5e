#include "map_matcher/track_choice/gyro_turn.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "map_matcher/inputs.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kHistoryS = 10.0;
// The same, which a train that runs never feels. Fusion takes its accelerometer for stuck alike.
constexpr int kStuckRepeats = 9;  // and for ...
constexpr double kStuckS = 0.15;  // ... so long
constexpr double kLeastBiasRps = 1e-6;
constexpr double kScatterS = 0.5;    // over which the scatter is taken
constexpr double kScattersMore = 2;  // of the variance that is promised: a body's vibration is no noise

}  // namespace

void GyroTurn::add(int64_t stamp_ns, double rate_rps) {
  if (!has_sense(GyroInput{rate_rps})) return;
  double heading_rad = 0;
  if (!samples_.empty()) {
    const double dt_s = core::seconds(stamp_ns - samples_.back().stamp_ns);
    if (dt_s <= 0 || dt_s > parameters_.longest_gap_s) {
      samples_.clear();
    } else {
      heading_rad = samples_.back().heading_rad + rate_rps * dt_s;
    }
  }
  samples_.push_back({stamp_ns, heading_rad});
  watch(stamp_ns, rate_rps);
  while (core::seconds(stamp_ns - samples_.front().stamp_ns) > kHistoryS) samples_.pop_front();
}

void GyroTurn::watch(int64_t stamp_ns, double rate_rps) {
  if (samples_.size() < 2) {
    rate_ = {};
    scatter_ = 0;
  } else {
    const double dt_s = core::seconds(stamp_ns - samples_[samples_.size() - 2].stamp_ns);
    const double step_rps = rate_rps - rate_.value();
    scatter_ += (0.5 * step_rps * step_rps * dt_s - scatter_) * std::min(1.0, dt_s / kScatterS);
  }
  rate_.add(rate_rps, stamp_ns);
  if (!rate_.lasts(kStuckRepeats, kStuckS)) return;
  for (auto sample = samples_.rbegin(); sample != samples_.rend() && !sample->is_stuck; ++sample) {
    if (sample->stamp_ns < rate_.since_ns()) break;
    sample->is_stuck = true;
  }
}

bool GyroTurn::is_stuck(int64_t from_ns, int64_t to_ns) const {
  const auto first = std::ranges::upper_bound(samples_, from_ns, {}, &Sample::stamp_ns);
  const auto last = std::ranges::lower_bound(samples_, to_ns, {}, &Sample::stamp_ns);
  return std::any_of(first, last == samples_.end() ? last : std::next(last),
                     [](const Sample& s) { return s.is_stuck; }) ||
         (first == samples_.end() && samples_.back().is_stuck);
}

// A sample may be missing at the end: what comes last in data that is played is not here yet.
std::optional<double> GyroTurn::heading_at(int64_t stamp_ns) const {
  const auto after = std::lower_bound(samples_.begin(), samples_.end(), stamp_ns,
                                      [](const Sample& s, int64_t ns) { return s.stamp_ns < ns; });
  if (samples_.size() < 2 || (after == samples_.begin() && after->stamp_ns != stamp_ns)) return std::nullopt;
  if (after == samples_.begin()) return after->heading_rad;
  const bool beyond = after == samples_.end();
  const Sample& b = beyond ? samples_.back() : *after;
  const Sample& a = beyond ? samples_[samples_.size() - 2] : *(after - 1);
  if (beyond && core::seconds(stamp_ns - b.stamp_ns) > parameters_.longest_gap_s) return std::nullopt;
  const double share = core::seconds(stamp_ns - a.stamp_ns) / core::seconds(b.stamp_ns - a.stamp_ns);
  return a.heading_rad + share * (b.heading_rad - a.heading_rad);
}

double GyroTurn::bias_variance_at(int64_t stamp_ns) const {
  const double most = parameters_.bias_rps * parameters_.bias_rps;
  if (!bias_variance_) return most;
  const double walked_s = std::abs(core::seconds(stamp_ns - learnt_ns_));  // a clock may have been set back
  return std::min(most, *bias_variance_ + parameters_.bias_walk_rps * parameters_.bias_walk_rps * walked_s);
}

std::optional<Turn> GyroTurn::between(int64_t from_ns, int64_t to_ns) const {
  auto turn = at_rest(from_ns, to_ns);
  if (turn && is_stuck(from_ns, to_ns)) turn.reset();
  return turn;
}

// One with coarse steps says the same for long.
std::optional<Turn> GyroTurn::at_rest(int64_t from_ns, int64_t to_ns) const {
  const auto from = heading_at(from_ns);
  const auto to = heading_at(to_ns);
  if (!from || !to || to_ns <= from_ns) return std::nullopt;
  const double dt_s = core::seconds(to_ns - from_ns);
  const double promised = parameters_.noise_rad * parameters_.noise_rad;
  Turn turn;
  turn.turn_rad = *to - *from - bias_rps_ * dt_s;
  turn.sigma_rad = std::sqrt((scatter_ > kScattersMore * promised ? scatter_ : promised) * dt_s);
  turn.jump_rad = parameters_.jump_rps * dt_s;
  const double bias_variance = std::max(bias_variance_at(to_ns), kLeastBiasRps * kLeastBiasRps);
  turn.bias_rad = std::sqrt(bias_variance) * dt_s;
  turn.bias_walk = parameters_.bias_walk_rps * parameters_.bias_walk_rps * dt_s / bias_variance;
  turn.sensor = TurnSensor::gyro;
  turn.duration_s = dt_s;
  return turn;
}

void GyroTurn::stood(int64_t from_ns, int64_t to_ns) {
  const auto turn = at_rest(from_ns, to_ns);
  if (!turn) return;
  const double dt_s = core::seconds(to_ns - from_ns);
  const double prior = bias_variance_at(to_ns);
  const double noise = turn->sigma_rad * turn->sigma_rad / (dt_s * dt_s);
  const double gain = prior / (prior + noise);
  bias_rps_ += gain * turn->turn_rad / dt_s;
  bias_variance_ = (1 - gain) * prior;
  learnt_ns_ = to_ns;
}

}  // namespace railfix::map_matcher
