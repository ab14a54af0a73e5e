#include <algorithm>
#include <array>
#include <cmath>

#include "core/random.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/line_builder.hpp"

namespace railfix::simulator {
namespace {

using track::LandmarkKind;

constexpr int kBlocks = 10;
constexpr double kOpenM = 2500.0;  // at least, of open line between stations
constexpr double kStationM = 560.0;
constexpr double kMastSpacingM = 60.0;
constexpr double kMastClearM = 12.0;  // no mast so near to a bridge or portal
constexpr double kMastLateralM = 3.3;
constexpr double kMostTurnRad = 1.0;  // of the line's heading, so that it never meets itself

struct Curve {
  double radius_m, transition_m, cant_m;
};
constexpr std::array<Curve, 9> kCurves{{{300, 90, 0.13},
                                        {400, 100, 0.12},
                                        {500, 80, 0.10},
                                        {600, 80, 0.08},
                                        {800, 70, 0.07},
                                        {1000, 60, 0.05},
                                        {1300, 60, 0.04},
                                        {1600, 50, 0.03},
                                        {2000, 50, 0.02}}};

// What stands beside one open stretch: where, and how far out the masts must be there.
struct Stretch {
  std::vector<double> second_left;  // lateral of parallel tracks, at most one a side
  std::vector<double> second_right;
  double second_from_m = 0, second_to_m = 0;
  std::vector<double> keep_clear;  // bridges and portals
  double tunnel_from_m = 0, tunnel_to_m = 0;
};

class LongLine {
 public:
  track::Map make() {
    builder_.map.name = "built-in long line";
    builder_.map.source = "made by railfix simulate";
    builder_.map.crs = "EPSG:2056";
    for (int block = 1; block <= kBlocks; ++block) {
      add_open(block);
      add_station(block);
    }
    const auto last = builder_.node(track::NodeKind::end, "east end", end_);
    builder_.map.edges.back().to_node = last;
    for (int block = 1; block <= kBlocks; ++block) furnish_open(block);
    for (int block = 1; block < kBlocks; ++block) furnish_station(block);  // behind the last one the line ends
    return std::move(builder_.map);
  }

 private:
  // Straights and curves in turn; a curve turns back when the heading has left the line's general direction.
  void add_open(int block) {
    Drawing drawing;
    drawing.straight(random_.uniform(120, 300));
    while (drawing.length_m() < kOpenM) {
      const auto& curve = kCurves[static_cast<size_t>(random_.uniform() * kCurves.size())];
      const double arc_m = random_.uniform(100, std::min(450.0, 0.9 * curve.radius_m));
      const double turn_rad = (arc_m + curve.transition_m) / curve.radius_m;
      double side = random_.uniform() < 0.5 ? 1.0 : -1.0;
      if (std::abs(turned_rad_ + side * turn_rad) > kMostTurnRad) side = turned_rad_ > 0.0 ? -1.0 : 1.0;
      turned_rad_ += side * turn_rad;
      drawing.curve(side * curve.radius_m, curve.transition_m, arc_m, curve.cant_m);
      drawing.straight(random_.uniform(60, 350));
    }
    drawing.straight(60.0);
    const double length_m = drawing.length_m();
    std::vector<track::GradePoint> profile{{0, height_m_, 0}, {200, height_m_, 80}};
    for (double s = 800.0; s < length_m - 700.0; s += 700.0) {
      height_m_ += random_.uniform(-10.0, 10.0);
      profile.push_back({s, height_m_, 100});
    }
    height_m_ += random_.uniform(-6.0, 6.0);
    profile.push_back({length_m - 250.0, height_m_, 80});
    profile.push_back({length_m, height_m_, 0});
    append("open_" + std::to_string(block), drawing.from(end_, std::move(profile)));
  }
  void add_station(int block) {
    const auto station = Drawing().straight(kStationM).from(end_, {{0, height_m_, 0}, {kStationM, height_m_, 0}});
    append("station_" + std::to_string(block), station);
  }
  void append(const std::string& name, track::Alignment alignment) {
    auto& map = builder_.map;
    const auto kind = map.nodes.empty() ? track::NodeKind::end : track::NodeKind::railway_switch;
    const auto node =
        builder_.node(kind, map.nodes.empty() ? "west end" : "switch " + std::to_string(map.nodes.size()), end_);
    if (!map.edges.empty()) {
      map.edges.back().to_node = node;
      const auto id = map.edges.back().id;
      map.connections.push_back({node, id, id + 1, false});
    }
    end_ = alignment.at(alignment.length_m()).pose;
    builder_.edge(name, node, 0, std::move(alignment));
  }

  void furnish_open(int block) {
    const auto id = static_cast<uint32_t>(2 * block - 1);
    const double length_m = builder_.map.edges[id - 1].alignment.length_m();
    Stretch stretch;
    add_bridges_and_tunnel(block, id, length_m, stretch);
    add_second_tracks(block, id, length_m, stretch);
    for (double s = 180.0; s < length_m - 60.0; s += random_.uniform(250, 550))
      builder_.balise_group(id, std::round(s));
    int number = 0;
    for (double s = 30.0; s < length_m; s += kMastSpacingM, ++number) add_masts(id, s, number, stretch);
  }
  void add_bridges_and_tunnel(int block, uint32_t id, double length_m, Stretch& stretch) {
    const std::string name = std::to_string(block);
    for (const double s : {0.15 * length_m, 0.88 * length_m}) {
      stretch.keep_clear.push_back(std::round(s));
      builder_.landmark(LandmarkKind::bridge, id, std::round(s), 0.0, "bridge " + name);
    }
    if (block % 3 == 1) return;
    stretch.tunnel_from_m = std::round(random_.uniform(0.25, 0.4) * length_m);
    stretch.tunnel_to_m = std::round(stretch.tunnel_from_m + random_.uniform(120, 600));
    builder_.landmark(LandmarkKind::portal_in, id, stretch.tunnel_from_m, 0.0, "tunnel " + name + " west portal");
    builder_.landmark(LandmarkKind::portal_out, id, stretch.tunnel_to_m, 0.0, "tunnel " + name + " east portal");
    stretch.keep_clear.push_back(stretch.tunnel_from_m);
    stretch.keep_clear.push_back(stretch.tunnel_to_m);
  }
  // Double track left or right, and triple track; some run through the tunnel, some begin behind it.
  void add_second_tracks(int block, uint32_t id, double length_m, Stretch& stretch) {
    if (block % 2 == 0) return;
    stretch.second_from_m = block % 3 == 0 ? 200.0 : std::max(stretch.tunnel_to_m + 100.0, 300.0);
    stretch.second_to_m = length_m - 150.0;
    const double lateral_m = 3.8 + 0.1 * static_cast<double>(block % 8);
    const std::string name = "second_" + std::to_string(block);
    if (block % 4 == 1) stretch.second_left.push_back(lateral_m);
    if (block % 4 == 3 || block == 5) stretch.second_right.push_back(-lateral_m);
    for (const double left : stretch.second_left)
      builder_.second_track(name + "_left", id, stretch.second_from_m, stretch.second_to_m, left);
    for (const double right : stretch.second_right)
      builder_.second_track(name + "_right", id, stretch.second_from_m, stretch.second_to_m, right);
  }
  // One side in turn on single track, both sides beside several tracks.
  void add_masts(uint32_t id, double s, int number, const Stretch& stretch) {
    if (s > stretch.tunnel_from_m - kMastClearM && s < stretch.tunnel_to_m + kMastClearM && stretch.tunnel_to_m > 0.0)
      return;
    for (const double place : stretch.keep_clear) {
      if (std::abs(s - place) < kMastClearM) return;
    }
    const bool beside = s > stretch.second_from_m - 30.0 && s < stretch.second_to_m + 30.0;
    double left = kMastLateralM;
    double right = -kMastLateralM;
    if (beside) {
      for (const double lateral : stretch.second_left) left += lateral;
      for (const double lateral : stretch.second_right) right += lateral;
    }
    const bool both = left - right > 2.0 * kMastLateralM + 1.0;
    const std::string name = "mast " + std::to_string(id) + "-" + std::to_string(number);
    if (both || number % 2 == 1) builder_.landmark(LandmarkKind::mast, id, s, left, name + (both ? " left" : ""));
    if (both || number % 2 == 0) builder_.landmark(LandmarkKind::mast, id, s, right, name + (both ? " right" : ""));
  }
  void furnish_station(int block) {
    const auto id = static_cast<uint32_t>(2 * block);
    const double side = block % 2 == 0 ? -1.0 : 1.0;
    const std::string name = std::to_string(block);
    const auto loop = builder_.loop("loop_" + name, id, side);
    const auto& of = builder_.map.edges[id - 1];
    builder_.map.connections.push_back({of.from_node, id - 1, loop, true});
    builder_.map.connections.push_back({of.to_node, loop, id + 1, true});
    const double platform = -side * kPlatformLateralM;
    const double from_m = 110.0 + 10.0 * block;
    builder_.landmark(LandmarkKind::platform, id, from_m, platform, "station " + name + " platform west end");
    builder_.landmark(LandmarkKind::platform, id, from_m + 200.0, platform, "station " + name + " platform east end");
    builder_.balise_group(id, 90.0);
    builder_.balise_group(id, 400.0);
    int number = 0;
    for (double s = 30.0; s < kStationM; s += kMastSpacingM, ++number) {
      builder_.landmark(LandmarkKind::mast, id, s, -side * 6.6,
                        "mast " + std::to_string(id) + "-" + std::to_string(number));
    }
  }

  LineBuilder builder_;
  core::Random random_{2016};
  track::PlanPose end_{2690000.0, 1240000.0, 0.9};
  double height_m_ = 450.0;
  double turned_rad_ = 0.0;
};

}  // namespace

track::Map long_line() {
  return LongLine().make();
}

}  // namespace railfix::simulator
