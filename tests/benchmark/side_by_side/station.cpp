#include "side_by_side/station.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace railfix::measure {
namespace {

using track::LandmarkKind;

constexpr double kApartM = 4;
constexpr double kRadiusM = 190;
constexpr double kMastAsideM = 3;
constexpr double kPairM = 3;
constexpr double kSurveyedM = 0.1;
constexpr uint32_t kCountry = 85;

class Builder {
 public:
  explicit Builder(const StationPlan& plan) : plan_(plan), cuts_(static_cast<size_t>(plan.tracks)) {
    const double turned_rad = std::acos(1 - 0.5 * kApartM / kRadiusM);
    arc_m_ = kRadiusM * turned_rad;
    over_m_ = 2 * kRadiusM * std::sin(turned_rad);
  }

  Station build(core::Random& random) {
    for (const auto& crossover : plan_.crossovers) add_crossover(crossover);
    for (int track = 0; track < plan_.tracks; ++track) add_track(track);
    if (plan_.mast_every_m > 0) add_masts(random);
    if (plan_.balise_every_m > 0) add_balises(random);
    return {std::make_shared<const track::Map>(std::move(map_)), std::move(edges_)};
  }

 private:
  struct Cut {
    uint32_t node = 0;
    uint32_t crossover = 0;  // its edge
    bool facing = true;      // for a train that runs north
  };

  uint32_t node(double east_m, double north_m, track::NodeKind kind) {
    const auto id = static_cast<uint32_t>(map_.nodes.size() + 1);
    map_.nodes.push_back({id, kind, "", east_m, north_m});
    return id;
  }
  uint32_t edge(uint32_t from, uint32_t to, track::Alignment alignment) {
    const auto id = static_cast<uint32_t>(map_.edges.size() + 1);
    map_.edges.push_back({id, "edge " + std::to_string(id), from, to, "", std::move(alignment)});
    return id;
  }
  void add_crossover(const Crossover& crossover) {
    const double from_m = kApartM * crossover.from;
    const double bend = (crossover.to > crossover.from ? -1 : 1) / kRadiusM;
    const double end_m = crossover.at_m + over_m_;
    const uint32_t begin = node(from_m, crossover.at_m, track::NodeKind::railway_switch);
    const uint32_t end = node(kApartM * crossover.to, end_m, track::NodeKind::railway_switch);
    const uint32_t id =
        edge(begin, end,
             track::Alignment::chained({from_m, crossover.at_m, 0}, {{arc_m_, bend, bend}, {arc_m_, -bend, -bend}}));
    cuts_[static_cast<size_t>(crossover.from)][crossover.at_m] = {begin, id, true};
    cuts_[static_cast<size_t>(crossover.to)][end_m] = {end, id, false};
  }
  void add_track(int track) {
    const double east_m = kApartM * track;
    auto& edges = edges_.emplace_back();
    uint32_t from = node(east_m, 0, track::NodeKind::end);
    double from_m = 0;
    const auto add = [&](uint32_t to, double to_m) {
      edges.push_back(edge(from, to, track::Alignment::chained({east_m, from_m, 0}, {{to_m - from_m, 0, 0}})));
      from = to;
      from_m = to_m;
    };
    for (const auto& [at_m, cut] : cuts_[static_cast<size_t>(track)]) add(cut.node, at_m);
    add(node(east_m, plan_.length_m, track::NodeKind::end), plan_.length_m);
    size_t before = 0;
    for (const auto& [at_m, cut] : cuts_[static_cast<size_t>(track)]) {
      map_.connections.push_back({cut.node, edges[before], edges[before + 1], false});
      map_.connections.push_back({cut.node, edges[cut.facing ? before : before + 1], cut.crossover, true});
      ++before;
    }
  }
  track::EdgePosition place(int track, double at_m) const {
    const auto& cuts = cuts_[static_cast<size_t>(track)];
    const auto after = cuts.upper_bound(at_m);
    const auto index = static_cast<size_t>(std::distance(cuts.begin(), after));
    return {edges_[static_cast<size_t>(track)][index], at_m - (index == 0 ? 0 : std::prev(after)->first)};
  }
  uint32_t put(LandmarkKind kind, int track, double at_m, double lateral_m) {
    const auto id = static_cast<uint32_t>(map_.landmarks.size() + 1);
    const auto there = place(track, at_m);
    map_.landmarks.push_back({id, kind, there.edge, there.offset_m, lateral_m, kSurveyedM, ""});
    return id;
  }
  void add_masts(core::Random& random) {
    for (double m = 30; m < plan_.length_m; m += plan_.mast_every_m * random.uniform(0.9, 1.1)) {
      for (int track = 0; track < plan_.tracks; ++track) put(LandmarkKind::mast, track, m, kMastAsideM);
    }
  }
  void add_balises(core::Random& random) {
    for (int track = 0; track < plan_.tracks; ++track) {
      for (double m = random.uniform(100, 200); m + kPairM < plan_.length_m;
           m += plan_.balise_every_m * random.uniform(0.6, 1.4)) {
        const auto there = place(track, m);
        const std::vector<uint32_t> balises{put(LandmarkKind::balise, track, m, 0),
                                            put(LandmarkKind::balise, track, m + kPairM, 0)};
        const auto number = static_cast<uint32_t>(map_.balise_groups.size() + 1);
        map_.balise_groups.push_back({kCountry, number, there.edge, there.offset_m, true, false, 1, balises});
      }
    }
  }

  const StationPlan& plan_;
  double arc_m_ = 0;   // of a crossover's half
  double over_m_ = 0;  // its length along the tracks
  track::Map map_;
  std::vector<std::map<double, Cut>> cuts_;
  std::vector<std::vector<uint32_t>> edges_;
};

}  // namespace

Station station(const StationPlan& plan, core::Random& random) {
  return Builder(plan).build(random);
}

std::vector<track::Run> way_through(const Station& station, int track, double takes, core::Random& random) {
  const track::Ways ways(*station.map);
  std::vector<track::Run> way{{station.map->edge(station.edges[static_cast<size_t>(track)].front()), true}};
  for (;;) {
    const auto& next = ways.after(way.back());
    if (next.empty()) return way;
    way.push_back(next[next.size() > 1 && random.uniform() < takes ? 1 : 0]);
  }
}

}  // namespace railfix::measure
