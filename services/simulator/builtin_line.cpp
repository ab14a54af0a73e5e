#include "simulator/builtin_line.hpp"

#include <cmath>

#include "simulator/line_builder.hpp"

namespace railfix::simulator {
namespace {

using track::LandmarkKind;

constexpr double kMastSpacingM = 60.0;
constexpr double kSecondFromM = 1000.0;
constexpr double kSecondToM = 2130.0;
constexpr double kSecondLateralM = 4.2;

void furnish(LineBuilder& builder) {
  const auto& edges = builder.map.edges;
  builder.landmark(LandmarkKind::platform, 2, 120.0, -kPlatformLateralM, "platform 1 west end");
  builder.landmark(LandmarkKind::platform, 2, 340.0, -kPlatformLateralM, "platform 1 east end");
  builder.landmark(LandmarkKind::bridge, 1, 860.0, 0.0, "road bridge");
  builder.landmark(LandmarkKind::portal_in, 3, 760.0, 0.0, "tunnel west portal");
  builder.landmark(LandmarkKind::portal_out, 3, 910.0, 0.0, "tunnel east portal");
  for (const double offset : {200.0, 600.0, 1000.0, 1320.0}) builder.balise_group(1, offset);
  builder.balise_group(2, 230.0);
  for (const double offset : {60.0, 460.0, 740.0, 1100.0, 1500.0, 1900.0}) builder.balise_group(3, offset);
  for (uint32_t id = 1; id <= 3; ++id) {
    int number = 0;
    for (double s = 30.0; s < edges[id - 1].alignment.length_m(); s += kMastSpacingM, ++number) {
      if (id == 3 && s > 750.0 && s < 920.0) continue;
      const bool beside_second = id == 3 && s > kSecondFromM - 40.0;
      const double left = beside_second ? kSecondLateralM + 3.1 : 3.3;
      const double lateral = id == 2 ? -6.6 : (number % 2 == 0 ? -3.3 : left);
      builder.landmark(LandmarkKind::mast, id, s, lateral, "mast " + std::to_string(id) + "-" + std::to_string(number));
    }
  }
}

}  // namespace

track::Map builtin_line() {
  LineBuilder builder;
  builder.map.name = "built-in line";
  builder.map.source = "made by railfix simulate";
  builder.map.crs = "EPSG:2056";
  const track::PlanPose start{2683000.0, 1248000.0, 1.1};
  const auto west = Drawing()
                        .straight(350)
                        .curve(600, 80, 200, 0.08)
                        .straight(150)
                        .curve(-1000, 60, 250, 0.05)
                        .straight(150)
                        .from(start, {{0, 440.0, 0}, {300, 440.0, 60}, {1100, 444.0, 60}, {1380, 444.0, 0}});
  const auto west_end = west.at(west.length_m()).pose;
  const auto station = Drawing().straight(460).from(west_end, {{0, 444.0, 0}, {460, 444.0, 0}});
  const auto station_end = station.at(station.length_m()).pose;
  const auto east = Drawing()
                        .straight(120)
                        .curve(-400, 100, 220, 0.12)
                        .straight(100)
                        .curve(800, 60, 300, 0.07)
                        .straight(300)
                        .curve(-1500, 50, 200, 0.03)
                        .straight(500)
                        .from(station_end, {{0, 444.0, 0}, {300, 444.0, 80}, {1300, 434.0, 80}, {2160, 434.0, 0}});
  const auto begin = builder.node(track::NodeKind::end, "west end", start);
  const auto first = builder.node(track::NodeKind::railway_switch, "switch 1", west_end);
  const auto second = builder.node(track::NodeKind::railway_switch, "switch 2", station_end);
  const auto end = builder.node(track::NodeKind::end, "east end", east.at(east.length_m()).pose);
  builder.edge("main_west", begin, first, west);
  builder.edge("main_station", first, second, station);
  builder.edge("main_east", second, end, east);
  builder.loop("loop", 2, 1.0);
  builder.second_track("second_east", 3, kSecondFromM, kSecondToM, kSecondLateralM);
  builder.map.connections = {{first, 1, 2, false}, {first, 1, 4, true}, {second, 2, 3, false}, {second, 4, 3, true}};
  furnish(builder);
  return std::move(builder.map);
}

core::Result<track::Map> builtin_line(const std::string& name) {
  if (name == "default") return builtin_line();
  if (name == "long") return long_line();
  return core::Error{"there is no built-in line \"" + name + "\"; write default or long"};
}

}  // namespace railfix::simulator
