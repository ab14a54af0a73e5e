// Where the train is, as landmarks and the search of the network tell, rightly or wrongly.
#include <algorithm>
#include <cmath>
#include <optional>

#include "support/train/simulation.hpp"

namespace railfix::train {
namespace {

using fusion::FixInput;
using fusion::FixKind;
using track::LandmarkKind;

constexpr double kLocateEveryM = 500;
constexpr double kSightedAheadM = 6;
constexpr double kMissed = 0.15;
constexpr double kFalsePerM = 0.0005;  // of each kind
constexpr double kSightingSigmaM = 0.15;
constexpr uint32_t kSure = 5;  // so many landmarks tell map_matcher that the train is nowhere else

fusion::SightingsFit fit_of(uint32_t landmarks) {
  return landmarks < kSure ? fusion::SightingsFit::not_told : fusion::SightingsFit::here;
}

}  // namespace

/// Errors of one place after the other.
class TrainSimulation::PlaceErrors {
 public:
  PlaceErrors(const TrainSimulation& simulation, double usual_false_share)
      : simulation_(simulation), usual_false_share_(usual_false_share) {}

  double next(core::Random& random, double t, double sigma_m) {
    const auto& fault = simulation_.plan_.fault;
    const auto faulty = [&](FaultKind kind) { return simulation_.faulty(Sensor::fix, kind, t); };
    const double sign = random.uniform() < 0.5 ? -1 : 1;
    const double false_m = sign * random.uniform(3, 60);
    const double noise_m = sigma_m * random.normal();
    const double share = faulty(FaultKind::outliers) ? 0.3 : usual_false_share_;
    double wrong_m = random.uniform() < share ? false_m : 0;
    wrong_m += (faulty(FaultKind::noise) ? fault.size : 1) * noise_m + simulation_.offset_of(Sensor::fix, t);
    if (fault.is(Sensor::fix, FaultKind::wrong_landmark) && t > fault.begin_s && !wrong_once_) {
      wrong_m += fault.size;
      wrong_once_ = true;
    }
    if (fault.is(Sensor::fix, FaultKind::wrong_sighting) && t > fault.begin_s) {
      const bool wrong = since_fault_++ % 2 == 0 && (since_fault_ == 1 || t < fault.end_s);
      wrong_m += wrong ? fault.size : 0;
    }
    return wrong_m;
  }

 private:
  const TrainSimulation& simulation_;
  double usual_false_share_;
  bool wrong_once_ = false;
  int since_fault_ = 0;
};

void TrainSimulation::make_fixes() {
  auto random = stream(seed_, 14);
  const auto& fault = plan_.fault;
  PlaceErrors errors(*this, plan_.false_fix_share);
  uint32_t id = 0;
  std::optional<track::EdgePosition> stuck;
  double place_m = plan_.landmark_spacing_m;
  while (place_m < way_m()) {
    const double t = drive_.time_at(place_m) + 0.003;
    const double wrong_m = errors.next(random, t, plan_.fix_sigma_m);
    const bool sure = fault.is(Sensor::fix, FaultKind::wrong_sighting) && t > fault.begin_s;
    auto place = path_->position_at(drive_.at(t).distance_m + wrong_m);
    if (faulty(Sensor::fix, FaultKind::stuck, t)) place = *(stuck = stuck.value_or(place));
    ++id;
    if (!misled_landmarks_ || !faulty(Sensor::fix, FaultKind::wrong_branch, t)) {
      add(Sensor::fix, t,
          FixInput{stamp_ns(t), place.edge, place.offset_m, plan_.fix_sigma_m,
                   sure ? kSureProbability : plan_.fix_probability, id, FixKind::landmark, place.direction, nullptr,
                   fit_of(id)});
    }
    place_m += plan_.landmark_spacing_m * (1 + plan_.landmark_spread * random.uniform(-1, 1));
  }
}

void TrainSimulation::make_fixes_of_map() {
  auto random = stream(seed_, 14);
  uint32_t landmarks = 0;
  for (const auto& mark : path_->landmarks()) {
    const auto wanted =
        std::ranges::find(plan_.map_landmarks, mark.kind, &std::pair<track::LandmarkKind, double>::first);
    const double noise = random.normal();
    if (wanted == plan_.map_landmarks.end() || mark.distance_m < 1 || mark.distance_m > way_m()) continue;
    const double t = drive_.time_at(mark.distance_m) + 0.003;
    const auto place = path_->position_at(drive_.at(t).distance_m + wanted->second * noise);
    add(Sensor::fix, t,
        FixInput{stamp_ns(t), place.edge, place.offset_m, wanted->second, plan_.fix_probability, mark.landmark->id,
                 FixKind::landmark, place.direction, nullptr, fit_of(++landmarks)});
  }
}

// Found after 0.4 to 3 km, to 3 to 25 m; said again every 500 m, with much the same error, until fusion knows the
// place.
void TrainSimulation::make_network_fixes() {
  auto random = stream(seed_, 18);
  const double sigma_m = 3 * std::pow(8, random.uniform());
  const double wrong_m = sigma_m * random.normal();
  const double probability = random.uniform(fusion::kBeginProbability, 1);
  for (double place_m = random.uniform(400, 3000); place_m < way_m(); place_m += kLocateEveryM) {
    const double t = drive_.time_at(place_m) + 0.003;
    const auto place = path_->position_at(place_m + wrong_m);
    add(Sensor::fix, t,
        FixInput{stamp_ns(t), place.edge, place.offset_m, sigma_m, probability, 0, FixKind::network, place.direction,
                 nullptr});
  }
}

// What stands beside the way, some of it missed, and some that is nothing.
void TrainSimulation::make_sightings(const std::vector<Thing>& things) {
  auto random = stream(seed_, 20);
  std::vector<std::pair<double, Thing>> seen;
  for (const auto& thing : things) {
    const auto place_m = path_->distance_of(thing.edge, thing.offset_m);
    if (random.uniform() < kMissed || !place_m) continue;
    seen.emplace_back(*place_m, thing);
  }
  for (const auto kind : {LandmarkKind::balise, LandmarkKind::mast}) {
    for (double m = 0; m < way_m(); m += 10) {
      if (random.uniform() < 10 * kFalsePerM)
        seen.emplace_back(m + random.uniform(0, 10), Thing{kind, 0, 0, kind == LandmarkKind::mast ? kMastBesideM : 0});
    }
  }
  std::ranges::sort(seen, {}, &std::pair<double, Thing>::first);
  PlaceErrors errors(*this, 0);
  double stuck_m = NAN;
  for (const auto& [place_m, thing] : seen) {
    if (place_m - kSightedAheadM < 1 || place_m - kSightedAheadM > way_m()) continue;
    const double t = drive_.time_at(place_m - kSightedAheadM) + 0.003;
    double ahead_m = place_m - drive_.at(t).distance_m + errors.next(random, t, kSightingSigmaM);
    if (faulty(Sensor::fix, FaultKind::stuck, t)) ahead_m = stuck_m = std::isnan(stuck_m) ? ahead_m : stuck_m;
    if (!sees(t) || faulty(Sensor::fix, FaultKind::dropout, t)) continue;
    const bool late = faulty(Sensor::fix, FaultKind::delay, t);
    const double seen_s = t + lag_of(Sensor::camera, t);
    sightings.push_back({std::max(t, seen_s) + (late ? plan_.fault.size : 0),
                         {stamp_ns(seen_s), thing.kind, ahead_m, thing.lateral_m, kSightingSigmaM, 0.95}});
  }
  std::ranges::stable_sort(sightings, {}, &SightingArrival::arrival_s);
}

}  // namespace railfix::train
