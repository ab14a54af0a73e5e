// What map_matcher says of the track, rightly or wrongly.
#include <algorithm>
#include <cmath>
#include <limits>

#include "support/train/simulation.hpp"

namespace railfix::train {
namespace {

using fusion::FixInput;
using fusion::FixKind;

// Behind the points a leg is declared: up to 30 m behind the frog, or a little before it.
constexpr std::pair kDeclaredM{20.0, 60.0};
constexpr double kBeyondM = 1000;    // the estimate may be in front of the train
constexpr double kPointsEndM = 5.0;  // a leg that comes back is no other track any more
constexpr double kTrackEveryS = 1.0;
constexpr double kOpenTrackEveryM = 2.0;

}  // namespace

void TrainSimulation::find_points() {
  const track::Ways ways(*map);
  for (const auto& one : path_->switches()) {
    if (!one.ahead || one.distance_m < 0 || one.distance_m > way_m() + kBeyondM) continue;
    const auto run_at = [&](double distance_m) {
      const auto place = path_->position_at(distance_m);
      return track::Run{map->edge(place.edge), place.direction != track::Direction::reverse};
    };
    const auto own = run_at(one.distance_m + 0.01);
    for (const auto& other : ways.after(run_at(one.distance_m - 0.01))) {
      if (other == own) continue;
      points_.push_back({one.distance_m, other});
      break;
    }
  }
}

// The fault is at the first points behind its begin, or the last ones before; it lasts while the other leg is declared.
void TrainSimulation::make_declarations() {
  auto random = stream(seed_, 15);
  for (size_t i = 0; i < points_.size(); ++i) {
    Declaration one{random.uniform(kDeclaredM.first, kDeclaredM.second), 0, random.uniform(0.5, 0.95),
                    random.uniform() < 0.2, 1 - std::pow(10, -random.uniform(3, 5))};
    declarations_.push_back(one);
  }
  auto& fault = plan_.fault;
  const auto end = std::ranges::find_if(points_, [&](const Points& one) { return one.distance_m > way_m(); });
  if (fault.kind != FaultKind::wrong_branch || end == points_.begin()) return;
  const auto behind = std::find_if(points_.begin(), end,
                                   [&](const Points& one) { return drive_.time_at(one.distance_m) > fault.begin_s; });
  const auto wrong = behind == end ? std::prev(behind) : behind;
  auto& one = declarations_[static_cast<size_t>(wrong - points_.begin())];
  one.wrong_until_m =
      std::min(one.after_m + 20 * std::pow(100, random.uniform()), wrong->other.length_m() - kPointsEndM);
  fault.begin_s = drive_.time_at(wrong->distance_m + one.after_m);
  fault.end_s = drive_.time_at(wrong->distance_m + one.wrong_until_m);
  misled_landmarks_ = random.uniform() < 0.5;
}

TrainSimulation::SaidTrack TrainSimulation::track_at(double way_m, double error_m) const {
  const auto next = std::ranges::upper_bound(points_, way_m, {}, [](const Points& one) { return one.distance_m; });
  const auto own = path_->position_at(way_m + error_m);
  if (next == points_.begin()) return {own, kSureProbability, true};
  const auto i = static_cast<size_t>(next - points_.begin()) - 1;
  const auto& one = declarations_[i];
  const auto& other = points_[i].other;
  const double behind_m = way_m - points_[i].distance_m;
  const bool known = behind_m >= one.after_m || behind_m > other.length_m() - kPointsEndM;
  const bool wrong = known ? behind_m < one.wrong_until_m : one.leans_wrong;
  const double into_m = behind_m + error_m;
  const auto there = other.at(std::clamp(into_m, 0.0, other.length_m()));
  return {wrong && into_m > 0 ? there : own, known ? one.declared : one.leaning, known};
}

FixInput TrainSimulation::said_of_track(const FixInput& fix, double error_m, double arrival_s) const {
  if (faulty(Sensor::fix, FaultKind::stuck, arrival_s)) return fix;
  const auto place = track_at(truth_at(fix.stamp_ns, arrival_s).distance_m, error_m).place;
  FixInput said = fix;
  said.edge = place.edge;
  said.offset_m = place.offset_m;
  said.direction = place.direction;
  return said;
}

// Once a second, when the word changes, and every 2 m while the track is not known: as map_matcher does.
void TrainSimulation::make_track_fixes() {
  std::optional<SaidTrack> said;
  double said_s = 0;
  double said_m = 0;
  std::optional<track::EdgePosition> stuck;
  for (int i = 1; i * kPictureS <= duration_s(); ++i) {
    const double t = i * kPictureS;
    const double way_m = drive_.at(t).distance_m;
    auto track = track_at(way_m);
    const bool changed = !said || track.place.edge != said->place.edge || track.known != said->known;
    if (!changed && t - said_s <= kTrackEveryS && (track.known || way_m - said_m < kOpenTrackEveryM)) continue;
    said = track;
    said_s = t;
    said_m = way_m;
    if (faulty(Sensor::fix, FaultKind::stuck, t)) track.place = *(stuck = stuck.value_or(track.place));
    add(Sensor::fix, t,
        FixInput{stamp_ns(t), track.place.edge, track.place.offset_m, std::numeric_limits<double>::infinity(),
                 track.probability, 0, FixKind::track, track.place.direction, nullptr});
  }
}

}  // namespace railfix::train
