// Grades of OpenStreetMap ways and heights of nodes.
#include "track/import/osm/osm_heights.hpp"
#include "import_fixture.hpp"
#include "track/import/build.hpp"
#include "track/path.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

/// What a way and the nodes at its ends say.
struct Piece {
  std::string incline;
  bool against = false;  // drawn from east to west
};

/// Ways 1, 2, ... of 300 m each, one after the other to the east on the equator, with a point every 100 m; node 1 in
/// the west, 4 where ways 1 and 2 meet, and so on.
class OsmHeightsTest : public ImportTest {
 protected:
  static constexpr double kDegPerM = 1 / 111319.4908;

  [[nodiscard]] Map map_of(const std::vector<Piece>& pieces, const std::map<int, std::string>& elevations = {},
                           const std::string& more = "") const {
    std::string elements;
    for (int node = 1; node <= 3 * static_cast<int>(pieces.size()) + 1; ++node) {
      const auto ele = elevations.find(node);
      elements += R"({"type":"node","id":)" + std::to_string(node) + R"(,"lat":0,"lon":)" +
                  std::to_string(15 + 100 * (node - 1) * kDegPerM) +
                  (ele == elevations.end() ? "" : R"(,"tags":{"ele":")" + ele->second + "\"}") + "},";
    }
    for (size_t i = 0; i < pieces.size(); ++i) {
      std::string nodes;
      for (size_t k = 0; k < 4; ++k)
        nodes += (k > 0 ? "," : "") + std::to_string(3 * i + 1 + (pieces[i].against ? 3 - k : k));
      elements += (i > 0 ? "," : "") + std::string(R"({"type":"way","id":)") + std::to_string(i + 1) +
                  R"(,"tags":{"railway":"rail")" +
                  (pieces[i].incline.empty() ? "" : R"(,"incline":")" + pieces[i].incline + "\"") + R"(},"nodes":[)" +
                  nodes + "]}";
    }
    return core::value_or_throw(
               build_map({write("a.json", R"({"elements":[)" + elements + more + "]}")}, {.crs = "local"}))
        .map;
  }

  /// Height and grade (per mille) along the first edge.
  static std::vector<std::string> seen(const Map& map, std::initializer_list<double> offsets_m) {
    std::vector<std::string> out;
    const Alignment& track = map.edges.at(0).alignment;
    for (const double offset_m : offsets_m) {
      const TrackPoint at = track.at(offset_m);
      char text[40];
      std::snprintf(text, sizeof text, "%.1f %.1f", at.elevation_m + 1e-6, 1e3 * at.grade + 1e-6);
      out.emplace_back(text);
    }
    return out;
  }
};

TEST_F(OsmHeightsTest, InclinesHaveUnits) {
  for (const auto& [text, grade] : std::map<std::string, double>{{"12‰", 0.012},
                                                                 {"1.2%", 0.012},
                                                                 {"-0.5 %", -0.005},
                                                                 {"+3 ‰", 0.003},
                                                                 {"0", 0},
                                                                 {"0%", 0},
                                                                 {"1°", 0.017455},
                                                                 {"480‰", 0.48}}) {
    ASSERT_TRUE(grade_of(text)) << text;
    EXPECT_NEAR(*grade_of(text), grade, 1e-6) << text;
  }
  for (const char* text : {"", "up", "down", "12", "1,2%", "yes", "%", "60%", "-1200‰", "+-3%", "nan%", "1:40", "91°"})
    EXPECT_FALSE(grade_of(text)) << text;
  EXPECT_EQ(elevation_of("412.5"), 412.5);
  EXPECT_EQ(elevation_of("412 m"), 412);
  for (const char* text : {"", "412 ft", "4120000", "-600", "abc", "nan", "412,5"})
    EXPECT_FALSE(elevation_of(text)) << text;
}

TEST_F(OsmHeightsTest, InclinesAreGradesOfTheEdgeWhicheverWayItsWaysAreDrawn) {
  const Map map = map_of({{"12‰"}, {}, {"-0.5 %", true}});
  ASSERT_EQ(map.edges.size(), 1U);
  EXPECT_THAT(seen(map, {100, 450, 740}), ElementsAre("1.2 12.0", "3.6 0.0", "4.3 5.0"));
  EXPECT_THAT(
      map.problems,
      Contains("a grade (incline) is on 0.60 of 0.90 km of track; elsewhere the track is taken to climb evenly, "
               "and all of it is a guess that no service uses"));
  EXPECT_THAT(map.problems, Contains(HasSubstr("they are no heights above the sea")));
  EXPECT_THAT(map.problems, Not(Contains(HasSubstr("climbs evenly"))));
  ASSERT_TRUE(map.save(in_folder("a.map")).ok());
  const auto loaded = std::make_shared<const Map>(core::value_or_throw(Map::load(in_folder("a.map"))));
  EXPECT_THAT(seen(*loaded, {100, 450, 740}), ElementsAre("1.2 12.0", "3.6 0.0", "4.3 5.0"));
  const Path path = core::value_or_throw(Path::follow(loaded, {1, 900, Direction::reverse}, 900, 0));
  EXPECT_FALSE(path.grade_known_at(100)) << "the steepest part of a way, as somebody wrote it down";
  EXPECT_FALSE(path.grade_known_at(450));
  EXPECT_NEAR(path.at(100).grade, -0.005, 1e-9);
}

TEST_F(OsmHeightsTest, TracksWithoutBothHaveNoProfile) {
  const Map map = map_of({{}, {}});
  EXPECT_TRUE(map.edges.at(0).alignment.profile().empty());
  EXPECT_THAT(map.problems, Not(Contains(HasSubstr("height"))));
  const Map elsewhere = map_of({{"5‰"}}, {}, R"(,{"type":"node","id":90,"lat":0.01,"lon":15},
{"type":"node","id":91,"lat":0.01,"lon":15.01},{"type":"way","id":9,"tags":{"railway":"rail"},"nodes":[90,91]})");
  EXPECT_FALSE(elsewhere.edges.at(0).alignment.profile().empty());
  EXPECT_TRUE(elsewhere.edges.at(1).alignment.profile().empty());
}

TEST_F(OsmHeightsTest, HeightsOfNodesPutGradesAboveTheSea) {
  const Map map = map_of({{"10‰"}, {}, {"-10‰"}}, {{1, "412"}, {8, "418"}});
  EXPECT_THAT(seen(map, {0, 150, 450, 750}), ElementsAre("412.0 10.0", "413.5 10.0", "417.0 13.3", "417.5 -10.0"));
  EXPECT_THAT(map.problems, Not(Contains(HasSubstr("above the sea"))));
  EXPECT_THAT(map.problems,
              Contains(HasSubstr("track way/2 has no gradients; it climbs evenly from 415.00 m to 419.00 m")));
  EXPECT_THAT(map.problems, Not(Contains(HasSubstr("where the inclines put it"))));
}

TEST_F(OsmHeightsTest, GradesWithoutAHeightLieWhereWhatIsNotKnownClimbsEvenly) {
  const Map map = map_of({{}, {"10‰"}, {}}, {{1, "400"}, {10, "410"}});
  EXPECT_THAT(seen(map, {100, 400, 800}), ElementsAre("401.2 11.7", "404.5 10.0", "408.8 11.7"));
  EXPECT_THAT(map.problems,
              Contains("1 stretches with incline hold no node with a height (ele): how high they lie is a guess"));
}

TEST_F(OsmHeightsTest, WhereTheyContradictInclinesCount) {
  const Map map = map_of({{"10‰"}}, {{1, "412"}, {2, "413"}, {4, "425"}});
  EXPECT_THAT(seen(map, {0, 150, 299}), ElementsAre("412.0 10.0", "413.5 10.0", "415.0 10.0"));
  EXPECT_THAT(
      map.problems,
      Contains("node 4 of way/1 at latitude 0.000000, longitude 15.002695 has a height (ele) of 425.00 m, 10.00 "
               "m above where the inclines put it, in the middle of what all nodes with one say; the inclines count"));
}

TEST_F(OsmHeightsTest, HeightsAloneAreNoGrades) {
  const Map map = map_of({{}, {}}, {{1, "400"}, {7, "406"}});
  EXPECT_THAT(seen(map, {300}), ElementsAre("403.0 10.0"));
  EXPECT_THAT(seen(map_of({{}, {}}, {{1, "400"}, {7, "400"}}), {300}), ElementsAre("400.0 0.0"));
}

TEST_F(OsmHeightsTest, AnInclineOfAWayWhoseNodesAreNotThereIsNone) {
  const Map map = map_of({{}}, {}, R"(,{"type":"way","id":9,"tags":{"railway":"rail","incline":"5‰"},"nodes":[4,99]})");
  EXPECT_TRUE(map.edges.at(0).alignment.profile().empty());
  EXPECT_THAT(map.problems, Contains(HasSubstr("way 9 names 1 node that the data do not hold")));
}

TEST_F(OsmHeightsTest, WhatIsNotReadIsTold) {
  const Map map = map_of({{"up"}, {"12"}, {"steep"}, {"down"}}, {{2, "12 ft"}});
  EXPECT_TRUE(map.edges.at(0).alignment.profile().empty());
  EXPECT_THAT(map.problems,
              Contains("2 inclines are no number of %, per mille or degrees that a track can have, the first "
                       "one is \"12\" of way 2; left out"));
  EXPECT_THAT(map.problems,
              Contains("2 inclines say only which way the track climbs, not how much, the first one is \"up\" "
                       "of way 1; left out"));
  EXPECT_THAT(
      map.problems,
      Contains("1 heights of nodes (ele) are no number of metres at which a track can lie, the first one is \"12 "
               "ft\" of node 2 of way/1 at latitude 0.000000, longitude 15.000898; left out"));
}

}  // namespace
}  // namespace railfix::track
