#include "support/train/verdict.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "support/train/matching.hpp"
#include "track/declared.hpp"

namespace railfix::train {
namespace {

constexpr double kFollowedM = 1e4;  // a state elsewhere is not followed any further
constexpr double kJudgedEveryS = 0.1;

// Words by which the state's reason names a sensor.
const char* name_in_reason(Sensor sensor) {
  switch (sensor) {
    case Sensor::camera:
      return "camera";
    case Sensor::wheel:
      return "wheel";
    case Sensor::accelerometer:
    case Sensor::gyro:
      return "IMU";
    case Sensor::gnss:
      return "GNSS";
    case Sensor::fix:
    case Sensor::shape:
      return "fix";
    case Sensor::clock:
      return "clock";
    default:
      return "";
  }
}

bool only_told(const std::string& reason) {
  return reason.find("GNSS alone has told the place") != std::string::npos ||
         reason.find("the place was only told") != std::string::npos;
}

class Judge {
 public:
  Judge(const TrainSimulation& simulation, double after_m, const Watcher& watcher)
      : simulation_(simulation), after_m_(after_m), watcher_(watcher) {
    verdict_.way_m = simulation.way_m();
  }

  /// Fusion counts its way from the first measurement on, the ride from its own beginning.
  void begin_with(const Arrival& first) {
    const auto* step = std::get_if<fusion::OdometryInput>(&first.event);
    const int64_t stamp_ns = fusion::stamp_of(first.event);
    const int64_t begin_ns = step ? std::min(step->reference_stamp_ns, stamp_ns) : stamp_ns;
    counted_from_m_ = simulation_.truth_at(begin_ns, first.arrival_s).distance_m;
  }

  void see(const fusion::TrainEstimate& state, double arrival_s) {
    const auto truth = simulation_.truth_at(state.stamp_ns, arrival_s);
    const double error_m = state.track_known ? simulation_.error_m(state.position, truth).value_or(1e6)
                                             : state.distance_m - (truth.distance_m - counted_from_m_);
    const double excess_m = std::max(error_m - state.over_m, -error_m - state.under_m);
    error_m_ = state.track_known ? std::clamp(error_m, -kFollowedM, kFollowedM) : 0;
    ++verdict_.states;
    const bool ok = state.integrity == fusion::Integrity::ok;
    if (!(excess_m <= 0)) {
      ++verdict_.outside;
      verdict_.outside_ok += ok ? 1 : 0;
      verdict_.outside_again += verdict_.placeless > 0 ? 1 : 0;
      verdict_.outside_usable += state.integrity != fusion::Integrity::unusable ? 1 : 0;
    }
    verdict_.placeless += state.track_known ? 0 : 1;
    verdict_.worst_excess_m = std::max(verdict_.worst_excess_m, excess_m);
    const double length_m = std::max(state.over_m, state.under_m);
    verdict_.wider_of_last += length_m > 5 + 0.05 * state.since_reference_m ? 1 : 0;
    if (length_m > 5 + 0.05 * state.since_sure_m) judge_width(state, ok);
    verdict_.not_ok += ok ? 0 : 1;
    verdict_.width_sum_m += state.over_m + state.under_m;
    judge_track(state, ok, truth.distance_m);
    const auto& fault = simulation_.plan().fault;
    const bool named = state.reason.find(name_in_reason(fault.sensor)) != std::string::npos;
    if (fault.sensor != Sensor::none && fault.active(arrival_s) && named) ++verdict_.told;
    if (truth.distance_m >= after_m_) verdict_.errors_m.push_back(static_cast<float>(std::abs(error_m)));
    if (watcher_) watcher_(state, error_m);
  }

  Verdict take() { return std::move(verdict_); }
  /// Of the last state.
  [[nodiscard]] double error_m() const { return error_m_; }

 private:
  void judge_width(const fusion::TrainEstimate& state, bool ok) {
    ++verdict_.wider;
    verdict_.wider_unsaid += ok ? 1 : 0;
    verdict_.wider_placeless += state.track_known ? 0 : 1;
    verdict_.wider_first += state.track_known && only_told(state.reason) ? 1 : 0;
    verdict_.wider_alone += state.reason == "interval wider than allowed" ? 1 : 0;
  }

  void judge_track(const fusion::TrainEstimate& state, bool ok, double way_m) {
    const bool other = state.track_known && !simulation_.on_way(state.position);
    const bool sure = other && ok && state.track_probability >= track::kDeclaredProbability;
    verdict_.other_leg += other ? 1 : 0;
    verdict_.other_leg_sure += sure ? 1 : 0;
    if (!sure || !sure_since_) sure_since_ = sure ? std::optional(SureSince{state.stamp_ns, way_m}) : std::nullopt;
    if (!sure) return;
    verdict_.other_leg_sure_s =
        std::max(verdict_.other_leg_sure_s, core::seconds(state.stamp_ns - sure_since_->stamp_ns));
    verdict_.other_leg_sure_m = std::max(verdict_.other_leg_sure_m, std::abs(way_m - sure_since_->way_m));
  }

  double error_m_ = 0;
  double counted_from_m_ = 0;
  const TrainSimulation& simulation_;
  double after_m_;
  const Watcher& watcher_;
  Verdict verdict_;
  struct SureSince {
    int64_t stamp_ns;
    double way_m;
  };
  std::optional<SureSince> sure_since_;  // a leg is declared that the train did not take
};

}  // namespace

void Verdict::add(const Verdict& other) {
  way_m += other.way_m;
  states += other.states;
  outside += other.outside;
  worst_excess_m = std::max(worst_excess_m, other.worst_excess_m);
  outside_ok += other.outside_ok;
  outside_usable += other.outside_usable;
  outside_again += other.outside_again;
  placeless += other.placeless;
  wider_of_last += other.wider_of_last;
  wider += other.wider;
  wider_unsaid += other.wider_unsaid;
  wider_placeless += other.wider_placeless;
  wider_first += other.wider_first;
  wider_alone += other.wider_alone;
  not_ok += other.not_ok;
  told += other.told;
  other_leg += other.other_leg;
  other_leg_sure += other.other_leg_sure;
  other_leg_sure_s = std::max(other_leg_sure_s, other.other_leg_sure_s);
  other_leg_sure_m = std::max(other_leg_sure_m, other.other_leg_sure_m);
  width_sum_m += other.width_sum_m;
  errors_m.insert(errors_m.end(), other.errors_m.begin(), other.errors_m.end());
}

Verdict judge(const TrainSimulation& simulation, fusion::Fusion& fusion, double after_m, const Watcher& watcher) {
  Judge judge(simulation, after_m, watcher);
  const auto matcher = matching_of(simulation);
  double tick_s = 0;
  bool began = false;
  for (const auto& arrival : simulation.arrivals) {
    if (arrival.arrival_s > simulation.duration_s()) break;
    for (; tick_s < arrival.arrival_s; tick_s += kJudgedEveryS) {
      const auto state = fusion.tick(simulation.stamp_ns(tick_s));
      if (!state) continue;
      judge.see(*state, tick_s);
      if (!matcher) continue;
      for (const auto& fix : matcher->run_on(*state, tick_s)) fusion.add(fix);
    }
    if (const auto* imu = std::get_if<fusion::ImuInput>(&arrival.event); matcher && imu != nullptr) matcher->feel(*imu);
    const auto* gnss = std::get_if<fusion::GnssInput>(&arrival.event);
    if (matcher && gnss != nullptr) matcher->hear(*gnss, arrival.arrival_s);
    auto event = arrival.event;
    if (auto* fix = std::get_if<fusion::FixInput>(&event); fix != nullptr && fix->kind == fusion::FixKind::track)
      *fix = simulation.said_of_track(*fix, judge.error_m(), arrival.arrival_s);
    const auto state = fusion.add(event);
    if (!began && fusion.estimator() != nullptr) {
      judge.begin_with(arrival);
      began = true;
    }
    if (!state) continue;
    judge.see(*state, arrival.arrival_s);
    const auto* step = std::get_if<fusion::OdometryInput>(&arrival.event);
    if (!matcher || step == nullptr) continue;
    for (const auto& fix : matcher->see(*step, *state, arrival.arrival_s)) {
      if (const auto behind = fusion.add(fix)) judge.see(*behind, arrival.arrival_s);
    }
  }
  return judge.take();
}

double quantile(std::vector<float>& values, double share) {
  if (values.empty()) return 0;
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<size_t>(place)];
}

}  // namespace railfix::train
