// Marks at the nodes where OpenStreetMap edges meet or end.
#include "import_fixture.hpp"
#include "track/import/build.hpp"
#include "track/path.hpp"

namespace railfix::track {
namespace {

/// A line from west to east (ways 1 and 2) with a switch in its middle (node 3) and a branch to the east (way 3).
class OsmNodeMarksTest : public ImportTest {
 protected:
  struct Tags {
    std::string west{};
    std::string east{};
    std::string branch{};
    std::string at_switch = R"("railway":"switch")";
    std::string at_end{};
  };

  [[nodiscard]] std::shared_ptr<const Map> map_of(const Tags& tags) const {
    const auto node = [](int id, double lat, double lon, const std::string& says) {
      return R"({"type":"node","id":)" + std::to_string(id) + R"(,"lat":)" + std::to_string(lat) + R"(,"lon":)" +
             std::to_string(lon) + R"(,"tags":{)" + says + "}},";
    };
    const auto way = [](int id, const std::string& nodes, const std::string& says) {
      return R"({"type":"way","id":)" + std::to_string(id) + R"(,"nodes":)" + nodes + R"(,"tags":{"railway":"rail")" +
             (says.empty() ? "" : ",") + says + "}}";
    };
    const std::string text = R"({"elements":[)" + node(1, 48, 15, tags.at_end) + node(2, 48, 15.002, "") +
                             node(3, 48, 15.004, tags.at_switch) + node(4, 48, 15.006, "") + node(5, 48, 15.008, "") +
                             node(6, 48.0001, 15.006, "") + node(7, 48.0003, 15.008, "") +
                             way(1, "[1,2,3]", tags.west) + "," + way(2, "[3,4,5]", tags.east) + "," +
                             way(3, "[3,6,7]", tags.branch) + "]}";
    return std::make_shared<const Map>(
        core::value_or_throw(build_map({write("a.json", text)},
                                       {.landmarks = {"portal_in", "portal_out", "mast", "level_crossing", "balise"}}))
            .map);
  }

  /// What a train meets from the west end to the end of a leg, with metres along.
  static std::vector<std::string> met(const std::shared_ptr<const Map>& map, const std::string& leg) {
    const auto id = [&](const std::string& name) {
      return std::find_if(map->edges.begin(), map->edges.end(), [&](const Edge& e) { return e.name == name; })->id;
    };
    const Path path = core::value_or_throw(Path::follow(map, {id("way/1"), 0, Direction::forward}, 2000, 0, {id(leg)}));
    std::vector<std::string> out;
    for (const PathLandmark& mark : path.landmarks())
      out.push_back(to_string(mark.kind) + " " + std::to_string(std::lround(mark.distance_m)));
    return out;
  }
};

TEST_F(OsmNodeMarksTest, ATunnelThatBeginsAtASwitchHasItsPortal) {
  const std::string tunnel = R"("tunnel":"yes","tunnel:name":"T")";
  using Marks = std::vector<std::string>;
  const auto east = map_of({.east = tunnel});
  ASSERT_EQ(east->landmarks.size(), 1U);
  EXPECT_EQ(met(east, "way/2"), Marks{"portal_in 298"});
  EXPECT_EQ(met(east, "way/3"), Marks{});
  EXPECT_EQ(east->landmarks[0].name, "T");
  EXPECT_EQ(east->edge(east->landmarks[0].edge)->name, "way/2");
  const auto west = map_of({.west = tunnel});
  EXPECT_EQ(west->landmarks.size(), 1U);
  EXPECT_EQ(met(west, "way/2"), Marks{"portal_out 298"});
  EXPECT_EQ(met(west, "way/3"), Marks{"portal_out 298"});
  // The branch leaves a tunnel that goes on.
  const auto leaves = map_of({.west = tunnel, .east = tunnel});
  EXPECT_EQ(met(leaves, "way/2"), Marks{});
  EXPECT_EQ(met(leaves, "way/3"), Marks{"portal_out 298"});
  const auto both = map_of({.east = tunnel, .branch = tunnel});
  EXPECT_EQ(met(both, "way/2"), Marks{"portal_in 298"});
  EXPECT_EQ(met(both, "way/3"), Marks{"portal_in 298"});
  EXPECT_TRUE(map_of({.west = tunnel, .east = tunnel, .branch = tunnel})->landmarks.empty());
}

TEST_F(OsmNodeMarksTest, WhatStandsAtTheEndOfAnEdgeIsKeptOnce) {
  const std::string crossing = R"("railway":"level_crossing","name":"LX")";
  const auto at_end = map_of({.at_end = crossing});
  ASSERT_EQ(at_end->landmarks.size(), 1U);
  EXPECT_EQ(at_end->landmarks[0].name, "LX");
  EXPECT_EQ(met(at_end, "way/2"), std::vector<std::string>{"level_crossing 0"});
  for (const std::string& tag : {crossing, std::string(R"("railway":"switch","railway:balise":"yes")")}) {
    const auto at_switch = map_of({.at_switch = tag});
    ASSERT_EQ(at_switch->landmarks.size(), 1U);
    EXPECT_EQ(met(at_switch, "way/2").size(), 1U);
    EXPECT_EQ(met(at_switch, "way/3").size(), 1U) << "on the edge that both legs share";
  }
}

}  // namespace
}  // namespace railfix::track
