// railfix-make-landmark-line --seed N --out line.map: a short line with as many frogs, masts, bridges, portals and
// platforms as fit, for `railfix simulate --map`. Places, sides and radii are drawn from the seed.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "core/random.hpp"
#include "core/units.hpp"
#include "track/frog.hpp"
#include "track/map.hpp"

namespace railfix {
namespace {

using track::Element;
using track::LandmarkKind;

constexpr double kStationM = 130;  // from a switch to the next one
constexpr double kPlainM = 110;
constexpr double kBranchM = 60;

track::PlanPose turned(track::PlanPose pose) {
  pose.heading_rad += core::kPi;
  return pose;
}

class LandmarkLine {
 public:
  explicit LandmarkLine(uint64_t seed) : random_(seed) { map.name = "landmarks " + std::to_string(seed); }
  track::Map map;

  /// Balises all along instead of a pair on each stretch of plain track: `every_m` apart, give or take a half.
  void build(int stations, double every_m) {
    track::PlanPose pose{0, 0, 0.4};
    uint32_t from = node(track::NodeKind::end, pose);
    for (int i = 0; i < stations; ++i) {
      from = plain(from, pose, i);
      from = station(from, pose);
    }
    plain(from, pose, stations);
    if (every_m > 0) lay_balises(every_m);
  }

 private:
  void lay_balises(double every_m) {
    std::erase_if(map.landmarks, [](const track::Landmark& l) { return l.kind == LandmarkKind::balise; });
    std::vector<track::Landmark> frogs = map.landmarks;
    std::erase_if(frogs, [](const track::Landmark& l) { return l.kind != LandmarkKind::frog; });
    for (const uint32_t id : main_edges_) {
      const double length_m = map.edges[id - 1].alignment.length_m();
      for (double s = between(0.3, 1.0) * every_m; s < length_m; s += between(0.5, 1.5) * every_m) {
        // No balise lies where the other track's rail runs between ours: from a switch to its frog.
        const bool under_rail = std::any_of(frogs.begin(), frogs.end(), [&](const track::Landmark& frog) {
          if (frog.edge != id) return false;
          return frog.offset_m < 0.5 * length_m ? s < frog.offset_m + 2 : s > frog.offset_m - 2;
        });
        if (!under_rail) landmark(LandmarkKind::balise, id, s, 0);
      }
    }
    for (size_t i = 0; i < map.landmarks.size(); ++i) map.landmarks[i].id = static_cast<uint32_t>(i + 1);
  }

  double between(double low, double high) { return low + (high - low) * random_.uniform(); }
  double side() { return random_.uniform() < 0.5 ? -1.0 : 1.0; }
  uint32_t node(track::NodeKind kind, const track::PlanPose& pose) {
    const auto id = static_cast<uint32_t>(map.nodes.size() + 1);
    map.nodes.push_back({id, kind, "node " + std::to_string(id), pose.easting_m, pose.northing_m});
    return id;
  }
  uint32_t edge(uint32_t from, uint32_t to, track::Alignment alignment) {
    const auto id = static_cast<uint32_t>(map.edges.size() + 1);
    map.edges.push_back({id, "edge " + std::to_string(id), from, to, "1", std::move(alignment)});
    return id;
  }
  void landmark(LandmarkKind kind, uint32_t on_edge, double offset_m, double lateral_m) {
    const auto id = static_cast<uint32_t>(map.landmarks.size() + 1);
    map.landmarks.push_back({id, kind, on_edge, offset_m, lateral_m, 0.02, track::to_string(kind)});
  }

  // A curve with cant, then a bridge or a tunnel on the straight behind it.
  uint32_t plain(uint32_t from, track::PlanPose& pose, int index) {
    const double curvature = side() / between(500, 900);
    const double cant_m = std::copysign(between(0.02, 0.1), curvature);
    const auto alignment = track::Alignment::chained(
        pose, {{15, 0, curvature}, {15, curvature, curvature}, {15, curvature, 0}, {65, 0, 0}}, {},
        {{0, 0}, {15, cant_m}, {30, cant_m}, {45, 0}, {kPlainM, 0}});
    pose = alignment.at(kPlainM).pose;
    const uint32_t to = node(track::NodeKind::joint, pose);
    const uint32_t id = edge(from, to, alignment);
    main_edges_.push_back(id);
    const bool tunnel = index % 2 == 1;
    if (tunnel) {
      landmark(LandmarkKind::portal_in, id, 50, 0);
      landmark(LandmarkKind::portal_out, id, 50 + between(40, 55), 0);
    } else {
      landmark(LandmarkKind::bridge, id, between(60, 80), 0);
    }
    for (const double s : {between(12, 20), between(34, 40)})
      landmark(LandmarkKind::mast, id, s, side() * between(2.7, 4));
    const double balise_m = between(5, 45);
    landmark(LandmarkKind::balise, id, balise_m, 0);
    landmark(LandmarkKind::balise, id, balise_m + 3, 0);
    return to;
  }

  // A branch leaves behind the first switch, another joins before the last one; a platform on the other side.
  uint32_t station(uint32_t from, track::PlanPose& pose) {
    const double branch_side = side();
    const auto main = track::Alignment::chained(pose, {{kStationM, 0, 0}}, {}, {});
    const auto begin = pose;
    pose = main.at(kStationM).pose;
    map.nodes[from - 1].kind = track::NodeKind::railway_switch;
    const uint32_t to = node(track::NodeKind::railway_switch, pose);
    const uint32_t before = static_cast<uint32_t>(map.edges.size());
    const uint32_t id = edge(from, to, main);
    main_edges_.push_back(id);
    const uint32_t leaves = branch(from, begin, branch_side, main, id, false);
    map.connections.push_back({from, before, id, false});
    map.connections.push_back({from, before, leaves, true});
    const uint32_t joins = branch(to, turned(pose), -branch_side, main, id, true);
    map.connections.push_back({to, id, id + 3, false});  // the plain track that follows
    map.connections.push_back({to, joins, id + 3, true});
    const double edge_m = -branch_side * 1.67;
    landmark(LandmarkKind::platform, id, between(25, 40), edge_m);
    landmark(LandmarkKind::platform, id, between(80, 95), edge_m);
    landmark(LandmarkKind::mast, id, between(5, 15), -branch_side * between(2.7, 4));
    landmark(LandmarkKind::mast, id, between(45, 70), -branch_side * between(4.7, 5.5));
    landmark(LandmarkKind::mast, id, between(105, 120), -branch_side * between(2.7, 4));
    return to;
  }

  uint32_t branch(uint32_t at, const track::PlanPose& pose, double branch_side, const track::Alignment& main,
                  uint32_t main_edge, bool joins) {
    const double radius_m = between(200, 500);
    const double arc_m = std::min(kBranchM, radius_m * between(0.10, 0.13));
    const double curvature = branch_side / radius_m;
    const auto alignment =
        track::Alignment::chained(pose, {{arc_m, curvature, curvature}, {kBranchM - arc_m + 1, 0, 0}}, {}, {});
    const uint32_t end = node(track::NodeKind::end, alignment.at(alignment.length_m()).pose);
    const uint32_t id = edge(at, end, alignment);
    const auto frog = track::frog_place({&main, !joins}, {&alignment, true}).value();
    const double seen_side = joins ? -branch_side : branch_side;  // along the main track
    landmark(LandmarkKind::frog, main_edge, frog.on_straight_m, seen_side * 0.5 * track::kGaugeM);
    return id;
  }

  core::Random random_;
  std::vector<uint32_t> main_edges_;
};

}  // namespace
}  // namespace railfix

int main(int argc, char** argv) {
  CLI::App app("A line full of landmarks, as a compiled map");
  uint64_t seed = 1;
  int stations = 3;
  double balises_every_m = 0;
  std::string out;
  app.add_option("--seed", seed, "Draws places, sides and radii");
  app.add_option("--stations", stations, "Stations of 240 m each")->check(CLI::Range(1, 100));
  app.add_option("--balises-every-m", balises_every_m, "Balises all along, so far apart (0 = a pair between stations)")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--out", out, "Compiled map")->required();
  CLI11_PARSE(app, argc, argv);
  railfix::LandmarkLine line(seed);
  line.build(stations, balises_every_m);
  const auto status = line.map.save(out);
  if (!status.ok()) {
    std::fprintf(stderr, "%s\n", status.error().message.c_str());
    return 2;
  }
  return 0;
}
