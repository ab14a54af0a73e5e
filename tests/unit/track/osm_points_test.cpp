// On which side of the track signals of OpenStreetMap stand, and which are no masts.
#include "import_fixture.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// A track to the east of two ways, and the node with the signal S.
struct Line {
  int signal_at = 2;
  std::string first = "[1,2,3]";
  std::string second = "[3,4,5]";
  std::string more{};
};

class OsmPointsTest : public ImportTest {
 protected:
  [[nodiscard]] Map map_of(const std::string& signal, const Line& line) const {
    std::string text;
    for (int i = 1; i <= 5; ++i) {
      text += R"({"type":"node","id":)" + std::to_string(i) + R"(,"lat":48,"lon":)" + std::to_string(15 + 0.002 * i) +
              (i == line.signal_at ? R"(,"tags":{"railway":"signal","ref":"S")" + signal + "}" : "") + "},";
    }
    const auto way = [](int id, const std::string& nodes) {
      return R"({"type":"way","id":)" + std::to_string(id) + R"(,"tags":{"railway":"rail"},"nodes":)" + nodes + "}";
    };
    return core::value_or_throw(build_map({write("a.json", R"({"elements":[)" + text + way(1, line.first) + "," +
                                                               way(2, line.second) + line.more + "]}")},
                                          {}))
        .map;
  }
  /// "" where there is none.
  [[nodiscard]] std::string side_of(const std::string& position, const Line& line = {}) const {
    const Map map = map_of(R"(,"railway:signal:position":")" + position + "\"", line);
    std::string out;
    for (const Landmark& mark : map.landmarks) {
      if (mark.kind != LandmarkKind::mast) continue;
      EXPECT_EQ(mark.name, "S");
      // The line runs east: left is north, whichever way its edge counts.
      const double heading_rad = map.edge(mark.edge)->alignment.at(mark.offset_m).pose.heading_rad;
      const double north_m = mark.lateral_m * (std::sin(heading_rad) > 0 ? 1 : -1);
      out += north_m > 0 ? "north" : north_m < 0 ? "south" : "?";
    }
    return out;
  }
};

TEST_F(OsmPointsTest, TheSideIsThatOfTheWayAsDrawn) {
  EXPECT_EQ(side_of("left"), "north");
  EXPECT_EQ(side_of("right"), "south");
  EXPECT_EQ(side_of("left", {.first = "[3,2,1]"}), "south");
  EXPECT_EQ(side_of("right", {.first = "[3,2,1]", .second = "[5,4,3]"}), "north");
  for (const char* direction : {"forward", "backward", "both"}) {
    const Map map =
        map_of(std::string(R"(,"railway:signal:position":"left","railway:signal:direction":")") + direction + "\"", {});
    ASSERT_EQ(map.landmarks.size(), 1U);
    EXPECT_EQ(map.landmarks[0].lateral_m, 3) << direction;
  }
}

TEST_F(OsmPointsTest, AtTheEndOfATrackToo) {
  EXPECT_EQ(side_of("left", {.signal_at = 1}), "north");
  EXPECT_EQ(side_of("left", {.signal_at = 1, .first = "[3,2,1]"}), "south");
  EXPECT_EQ(side_of("left", {.signal_at = 5}), "north");
}

TEST_F(OsmPointsTest, WhereWaysMeetThatAreDrawnAgainstEachOtherNoneIsSaid) {
  EXPECT_EQ(side_of("left", {.signal_at = 3}), "north");
  EXPECT_EQ(side_of("left", {.signal_at = 3, .first = "[3,2,1]", .second = "[5,4,3]"}), "south");
  EXPECT_EQ(side_of("left", {.signal_at = 3, .first = "[3,2,1]"}), "?");
  EXPECT_THAT(
      map_of(R"(,"railway:signal:position":"left")", {.signal_at = 3, .first = "[3,2,1]"}).problems,
      Contains(testing::StartsWith("1 signals stand where ways meet that are drawn against each other, the first "
                                   "one is node 3 of way/1 at latitude 48.000000")));
  const std::string branch = R"(,{"type":"node","id":6,"lat":48.0002,"lon":15.01},
{"type":"way","id":3,"tags":{"railway":"rail"},"nodes":)";
  EXPECT_EQ(side_of("left", {.signal_at = 3, .more = branch + "[3,6]}"}), "north");
  EXPECT_EQ(side_of("left", {.signal_at = 3, .more = branch + "[6,3]}"}), "?");
}

TEST_F(OsmPointsTest, NoSideIsGuessed) {
  EXPECT_EQ(side_of("left;right"), "?");
  EXPECT_EQ(side_of("catenary_mast"), "?");
  EXPECT_THAT(map_of(R"(,"railway:signal:position":"left;right")", {}).problems,
              Contains(HasSubstr("\"left;right\" of node 2 of way/1")));
  const Map map = map_of("", {});
  ASSERT_EQ(map.landmarks.size(), 1U);
  EXPECT_EQ(map.landmarks[0].lateral_m, 0);
  EXPECT_THAT(map.problems, Not(Contains(HasSubstr("signals"))));
}

TEST_F(OsmPointsTest, WhatHangsOverTheTrackOrLiesLowIsNoMast) {
  for (const char* position : {"bridge", "overhead", "in_track", "ground"})
    EXPECT_EQ(side_of(position), "") << position;
  const std::string dwarf = R"(,"railway:signal:position":"left","railway:signal:minor:height":"dwarf")";
  const Map map = map_of(dwarf, {});
  EXPECT_THAT(map.landmarks, IsEmpty());
  EXPECT_THAT(map.problems,
              Contains(HasSubstr("1 signals hang over the track, stand in it or are dwarfs, the first one is "
                                 "node 2 of way/1")));
  EXPECT_EQ(map_of(dwarf + R"(,"railway:signal:main:height":"normal")", {}).landmarks.size(), 1U);
  EXPECT_EQ(map_of(dwarf + R"(,"railway:signal:main":"DE-ESO:ks")", {}).landmarks.size(), 1U);
}

}  // namespace
}  // namespace railfix::track
