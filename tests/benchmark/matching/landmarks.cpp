// Association of sightings with mapped landmarks, on lines where the map is not quite right: sightings are missed or
// false, balises are missing on the map or on the line, masts were moved.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/random.hpp"
#include "core/result.hpp"
#include "map_matcher/landmark_matcher.hpp"
#include "matching.hpp"

namespace railfix::measure {
namespace {

using track::LandmarkKind;

constexpr double kLineM = 20000;
constexpr double kAheadM = 6.0;
constexpr double kSightingSigmaM = 0.15;
constexpr double kMissed = 0.15;
constexpr double kFalsePerM = 0.0005;
constexpr double kNotOnMap = 0.03;   // of the balises
constexpr double kNotOnLine = 0.03;  // of the mapped balises
constexpr double kMoved = 0.03;      // of the masts, by 1 to 6 m
constexpr double kRightM = 1.0;
constexpr double kSure = 0.95;

struct Thing {
  LandmarkKind kind;
  double real_m = NAN;  // NaN = only on the map
  double mapped_m = NAN;
};

/// Pairs of balises every kilometre or so, masts every 40 to 65 m.
std::vector<Thing> things_of(core::Random& random, double masts_mapped) {
  std::vector<Thing> things;
  for (double m = 200; m < kLineM; m += random.uniform(400, 1600)) {
    for (const double balise_m : {m, m + 3}) {
      Thing thing{LandmarkKind::balise, balise_m, balise_m + 0.1 * random.normal()};
      const double luck = random.uniform();
      if (luck < kNotOnMap) thing.mapped_m = NAN;
      if (luck > 1 - kNotOnLine) thing.real_m = NAN;
      things.push_back(thing);
    }
  }
  for (double m = 100; m < kLineM; m += random.uniform(40, 65)) {
    Thing thing{LandmarkKind::mast, m, m + 0.1 * random.normal()};
    if (random.uniform() < kMoved) thing.real_m += (random.uniform() < 0.5 ? -1 : 1) * random.uniform(1, 6);
    if (masts_mapped < 1 && random.uniform() > masts_mapped) thing.mapped_m = NAN;
    things.push_back(thing);
  }
  return things;
}

std::shared_ptr<const track::Path> path_of(const std::vector<Thing>& things) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{kLineM + 100, 0, 0}})});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, kLineM + 100}};
  for (const Thing& thing : things) {
    if (std::isnan(thing.mapped_m)) continue;
    const double lateral_m = thing.kind == LandmarkKind::mast ? 3 : 0;
    const auto id = static_cast<uint32_t>(map->landmarks.size() + 1);
    map->landmarks.push_back({id, thing.kind, 1, thing.mapped_m, lateral_m, 0.1, ""});
  }
  return std::make_shared<const track::Path>(
      core::value_or_throw(track::Path::follow(map, {1, 0, track::Direction::forward}, kLineM + 100, 0)));
}

struct Seen {
  double place_m = 0;
  LandmarkKind kind = LandmarkKind::unknown;
  bool on_map = false;  // at about its place
  bool moved = false;   // the map has it elsewhere
};

std::vector<Seen> sightings_of(const std::vector<Thing>& things, core::Random& random) {
  std::vector<Seen> seen;
  for (const Thing& thing : things) {
    if (std::isnan(thing.real_m) || random.uniform() < kMissed) continue;
    seen.push_back({thing.real_m, thing.kind, std::abs(thing.real_m - thing.mapped_m) < kRightM,
                    std::abs(thing.real_m - thing.mapped_m) >= kRightM});
  }
  for (const auto kind : {LandmarkKind::balise, LandmarkKind::mast}) {
    for (double m = 0; m < kLineM; m += 10) {
      if (random.uniform() < 10 * kFalsePerM) seen.push_back({m + random.uniform(0, 10), kind, false, false});
    }
  }
  std::sort(seen.begin(), seen.end(), [](const Seen& a, const Seen& b) { return a.place_m < b.place_m; });
  return seen;
}

/// Of one kind of landmark.
struct Count {
  int mapped = 0;  // sightings of what the map has
  int others = 0;  // false ones, moved or unmapped landmarks
  int sure = 0;    // fixes
  int right = 0;
  int wrong = 0;        // ... of which
  int wrong_false = 0;  // not on the map at all, or seen where nothing is
  int wrong_other = 0;  // another one was named
  int wrong_moved = 0;  // standing elsewhere than the map says
  int doubted = 0;      // sightings after which the place is more probably wrong than not
  double promised = 0;  // sum of 1 - probability

  void print(const char* what) const {
    std::printf(
        "%-8s %5d sightings of mapped, %4d of others: sure %.1f %% of the mapped, %d wrong (promised %.1f), "
        "%.1f %% of the sure: false or unmapped %d, moved %d, another one named %d; place doubted at %d\n",
        what, mapped, others, 100.0 * right / std::max(mapped, 1), wrong, promised, 100.0 * wrong / std::max(sure, 1),
        wrong_false, wrong_moved, wrong_other, doubted);
  }
};

/// told_off_m: the state is of a place so far away, as after a wrong start.
void run_line(core::Random& random, double masts_mapped, double interval_m, double told_off_m, Count& balises,
              Count& masts) {
  const auto things = things_of(random, masts_mapped);
  map_matcher::LandmarkMatcher matcher({}, path_of(things));
  const double scale = 1 + 0.007 * random.normal();
  for (const Seen& seen : sightings_of(things, random)) {
    const double foot_m = seen.place_m - kAheadM;
    const double off_m = told_off_m + interval_m * std::clamp(random.normal() / 3, -1.0, 1.0);
    const double lateral_m = seen.kind == LandmarkKind::mast ? 3 : 0;
    const map_matcher::Sighting sighting{1,         seen.kind,       kAheadM + kSightingSigmaM * random.normal(),
                                         lateral_m, kSightingSigmaM, 0.95};
    const auto fix = matcher.add(sighting, {foot_m + off_m, interval_m, interval_m, foot_m * scale});
    Count& count = seen.kind == LandmarkKind::balise ? balises : masts;
    ++(seen.on_map ? count.mapped : count.others);
    count.doubted += matcher.doubt() > 0.5 ? 1 : 0;
    if (!fix || fix->probability < kSure) continue;
    const bool right = std::abs(fix->path_distance_m - foot_m) < kRightM;
    ++count.sure;
    count.right += right ? 1 : 0;
    count.wrong += right ? 0 : 1;
    if (!right) ++(seen.moved ? count.wrong_moved : seen.on_map ? count.wrong_other : count.wrong_false);
    count.promised += 1 - fix->probability;
  }
}

}  // namespace

int measure_landmarks(const MatchingOptions& options) {
  const int count = options.count > 0 ? options.count : 20;
  for (const double told_off_m : {0.0, 2170.0}) {
    for (const double interval_m : {5.0, 20.0, 60.0}) {
      if (told_off_m > 0 && interval_m > 20) continue;
      core::Random random(options.seed * 101 + 7);
      Count balises;
      Count masts;
      for (int i = 0; i < count; ++i) run_line(random, options.masts_mapped, interval_m, told_off_m, balises, masts);
      std::printf("interval of the state +-%.0f m, %.0f m off, %d lines of %.0f km\n", interval_m, told_off_m, count,
                  kLineM / 1000);
      balises.print("balises");
      masts.print("masts");
    }
  }
  return 0;
}

}  // namespace railfix::measure
