// Which way over a switch of OpenStreetMap is the straight one.
#include <set>

#include "import_fixture.hpp"
#include "track/import/build.hpp"
#include "track/projection.hpp"

namespace railfix::track {
namespace {

constexpr const char* kMain = R"("name":"Westbahn","usage":"main")";
constexpr const char* kCrossover = R"("service":"crossover")";
constexpr const char* kYard = R"("service":"yard")";

/// Points as drawn, metres east and north of the switch.
using Drawn = std::vector<std::pair<double, double>>;

class OsmStraightWayTest : public ImportTest {
 protected:
  struct Way {
    int id = 0;
    std::string tags;
    Drawn points;
  };

  /// One point is one node, and the origin is the switch.
  [[nodiscard]] std::shared_ptr<const Map> map_of(const std::vector<Way>& ways) const {
    const Projection utm = core::value_or_throw(Projection::open("EPSG:32633"));
    Drawn seen;
    std::string nodes;
    std::string lines;
    for (const Way& way : ways) {
      std::string ids;
      for (const auto& point : way.points) {
        const auto found = std::ranges::find(seen, point);
        const auto id = found - seen.begin() + 1;
        ids += (ids.empty() ? "" : ",") + std::to_string(id);
        if (found != seen.end()) continue;
        seen.push_back(point);
        const GeoPoint place = *utm.to_geo(500000 + point.first, 5340000 + point.second);
        char text[200];
        std::snprintf(text, sizeof text, R"({"type":"node","id":%td,"lat":%.9f,"lon":%.9f,"tags":{%s}},)", id,
                      place.lat_deg, place.lon_deg, point == Drawn::value_type() ? R"("railway":"switch")" : "");
        nodes += text;
      }
      lines += std::string(lines.empty() ? "" : ",") + R"({"type":"way","id":)" + std::to_string(way.id) +
               R"(,"nodes":[)" + ids + R"(],"tags":{"railway":"rail",)" + way.tags + "}}";
    }
    const auto file = write("a.json", R"({"elements":[)" + nodes + lines + "]}");
    return std::make_shared<const Map>(core::value_or_throw(build_map({file}, {.crs = "EPSG:32633"})).map);
  }

  /// Names of the edges that the straight way over the switch joins.
  static std::vector<std::string> straight_way(const Map& map) {
    std::vector<std::string> out;
    for (const Connection& way : map.connections) {
      const Node& node = map.nodes[way.node - 1];
      if (way.diverging || std::hypot(node.easting_m - 500000, node.northing_m - 5340000) > 0.1) continue;
      for (const uint32_t edge : {way.edge_a, way.edge_b}) out.push_back(map.edge(edge)->name);
    }
    std::ranges::sort(out);
    return out;
  }
};

using testing::ElementsAre;

// Nodes 7, 16, 21 and 23 of Sankt Poelten: 5 cm of drawing on 3.7 m are 0.8 degrees.
TEST_F(OsmStraightWayTest, FirstMetresDrawnAskewDoNotMakeTheLineDiverge) {
  const auto map = map_of({{1, kMain, {{-100, 0}, {0, 0}}},
                           {2, kMain, {{0, 0}, {3.7, 0.15}, {60, 0.1}, {150, 0}}},
                           {3, kCrossover, {{0, 0}, {20, -0.1}, {60, -2}, {150, -8}}}});
  EXPECT_THAT(straight_way(*map), ElementsAre("way/1", "way/2"));
}

TEST_F(OsmStraightWayTest, MetresOfTheChainsBeyondCountWhereTheFirstIsShort) {
  const auto map = map_of({{1, kMain, {{-100, 0}, {0, 0}}},
                           {2, kMain, {{0, 0}, {4, 0.2}, {60, 0.1}, {150, 0}}},
                           {3, kCrossover, {{0, 0}, {20, -0.1}, {60, -4}}},
                           {4, kYard, {{4, 0.2}, {40, 3}, {80, 8}}}});
  EXPECT_THAT(straight_way(*map), ElementsAre("way/1", "way/2"));
}

// Two pieces of a way that has no name are no line.
TEST_F(OsmStraightWayTest, AWayWithoutANameGoesOn) {
  const auto map = map_of(
      {{1, kYard, {{-100, 0}, {0, 0}, {30, 0.9}, {100, 3.5}}}, {2, kYard, {{0, 0}, {30, 0.2}, {60, -1}, {150, -4}}}});
  EXPECT_THAT(straight_way(*map), ElementsAre("way/1", "way/1#2"));
}

TEST_F(OsmStraightWayTest, ARunningLineWithoutANameGoesOn) {
  const auto map = map_of({{1, R"("usage":"branch")", {{-100, 0}, {0, 0}}},
                           {2, R"("usage":"branch")", {{0, 0}, {30, 0.9}, {150, 4.5}}},
                           {3, R"("usage":"branch","service":"spur")", {{0, 0}, {30, 0.2}, {60, -1}, {150, -4}}}});
  EXPECT_THAT(straight_way(*map), ElementsAre("way/1", "way/2"));
}

// The chain up to the switch may have run on another line most of the way.
TEST_F(OsmStraightWayTest, TheLineIsTheOneThatIsNamedAtTheSwitch) {
  const std::string other = R"("name":"Neue Westbahn","usage":"main")";
  const auto map = map_of({{1, kMain, {{-200, 0}, {-150, 0}, {-100, 0}, {-50, 0}}},
                           {5, other, {{-50, 0}, {0, 0}}},
                           {2, other, {{0, 0}, {30, 0.2}, {150, 1}}},
                           {3, kMain, {{0, 0}, {30, -0.4}, {150, -2}}}});
  EXPECT_THAT(straight_way(*map), ElementsAre("way/1", "way/2"));
}

// A way may be drawn along the branch of a sharp turnout: 1:9, R 190 m has bent by 4.5 degrees after 30 m.
TEST_F(OsmStraightWayTest, AWayThatTurnsOffSharplyDoesNotMakeTheStraightTrackDiverge) {
  const auto map =
      map_of({{1, kYard, {{-100, 0}, {0, 0}, {15, 0.6}, {30, 2.4}, {60, 8}}}, {2, kYard, {{0, 0}, {30, 0}, {150, 0}}}});
  EXPECT_THAT(straight_way(*map), ElementsAre("way/1", "way/2"));
}

TEST_F(OsmStraightWayTest, TheMainLinesOfSanktPoeltenGoStraightOn) {
  const std::filesystem::path extract = shared_data("network/osm/sankt_poelten.json");
  if (!std::filesystem::exists(extract)) GTEST_SKIP() << "no " << extract;
  const Map map = core::value_or_throw(build_map({extract}, {})).map;
  std::set<std::pair<std::string, std::string>> straight;
  for (const Connection& way : map.connections) {
    if (way.diverging) continue;
    straight.emplace(map.edge(way.edge_a)->name, map.edge(way.edge_b)->name);
    straight.emplace(map.edge(way.edge_b)->name, map.edge(way.edge_a)->name);
  }
  for (const auto& [stem, leg] : {std::pair("way/28610172", "way/28610172#2"),
                                  {"way/32427276", "way/406254368"},
                                  {"way/50464224", "way/50464224#2"},
                                  {"way/50464224#3", "way/1042191270"},
                                  {"way/378131942", "way/193754180"},
                                  {"way/466402005#2", "way/679808614"},
                                  {"way/1053771357", "way/1053771352"}})
    EXPECT_TRUE(straight.contains({stem, leg})) << stem << " " << leg;
}

}  // namespace
}  // namespace railfix::track
