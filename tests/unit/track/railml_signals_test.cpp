// On which side of the track the masts of railML signals stand.
#include "import_fixture.hpp"
#include "railml_text.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::HasSubstr;

class RailmlSignals : public ImportTest {
 protected:
  [[nodiscard]] Map map_of(const std::string& text) const {
    return core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  }
  static std::string signal3(const std::string& at_track, const std::string& spot, const std::string& beside) {
    return "<signalIS id=\"s\"><spotLocation netElementRef=\"n1\" pos=\"250\" " + spot + "><linearCoordinate " +
           beside + "/></spotLocation><signalConstruction " + at_track + "/></signalIS>";
  }
  static std::string signals2(const std::string& signals) {
    std::string text = railml2("500");
    return text.insert(text.find("</track>"), "<ocsElements><signals>" + signals +
                                                  "</signals><stopPosts><stopPost id=\"p\" pos=\"900\" "
                                                  "dir=\"down\" nor:side=\"right\"/></stopPosts></ocsElements>");
  }
  static double lateral_m(const Map& map, const std::string& name) {
    const auto found = std::ranges::find_if(
        map.landmarks, [&](const Landmark& mark) { return mark.kind == LandmarkKind::mast && mark.name == name; });
    return found == map.landmarks.end() ? NAN : found->lateral_m;
  }
};

TEST_F(RailmlSignals, OneForBothDirectionsHasItsSideInEach) {
  const Map map = map_of(
      railml3("<signalIS id=\"s\"><spotLocation netElementRef=\"n1\" pos=\"100\" applicationDirection=\"normal\"/>"
              "<spotLocation netElementRef=\"n1\" pos=\"300\" applicationDirection=\"reverse\"/>"
              "<signalConstruction/><signalConstruction positionAtTrack=\"right\"/></signalIS>"));
  ASSERT_EQ(map.landmarks.size(), 2U);
  EXPECT_EQ(map.landmarks[0].lateral_m, -3);
  EXPECT_EQ(map.landmarks[1].lateral_m, 3);
}

TEST_F(RailmlSignals, OfRailml3StandWhereTrainsThatHeedThemSeeThem) {
  const std::string normal = "applicationDirection=\"normal\"";
  const std::string reverse = "applicationDirection=\"reverse\"";
  const std::string left = "positionAtTrack=\"left\"";
  const std::string right = "positionAtTrack=\"right\"";
  struct Said {
    std::string at_track, spot, beside;
    double side;
  };
  for (const Said& said : {Said{right, normal, "", -1},
                           {left, normal, "", 1},
                           {right, reverse, "", 1},
                           {left, reverse, "", -1},
                           {right, reverse, "lateralSide=\"left\"", 1},
                           {right, normal, "lateralSide=\"right\"", -1},
                           {"", normal, "lateralSide=\"right\"", -1},
                           {"", "", "lateralSide=\"left\"", 1},
                           {"positionAtTrack=\"above\"", normal, "", 0},
                           {"", normal, "lateralSide=\"both\"", 0},
                           {"", reverse, "", 0}}) {
    SCOPED_TRACE(said.at_track + " " + said.spot + " " + said.beside);
    const Map map = map_of(railml3(signal3(said.at_track, said.spot, said.beside)));
    EXPECT_EQ(lateral_m(map, "s"), 3.0 * said.side);
    EXPECT_THAT(map.problems, testing::Not(Contains(HasSubstr("left open"))));
  }
}

TEST_F(RailmlSignals, OfRailml3WhoseSideIsNotSureAreTold) {
  const std::string open = "; on which side it stands is left open";
  const auto expect_open = [&](const std::string& signal, const std::string& told) {
    const Map map = map_of(railml3(signal));
    EXPECT_EQ(lateral_m(map, "s"), 0);
    EXPECT_THAT(map.problems, Contains(told + open));
  };
  expect_open(signal3("positionAtTrack=\"left\"", "applicationDirection=\"normal\"", "lateralSide=\"right\""),
              "<signalIS> \"s\" has one side as positionAtTrack and the other as lateralSide");
  expect_open(signal3("positionAtTrack=\"left\"", "applicationDirection=\"both\"", ""),
              "<signalIS> \"s\" has positionAtTrack and no spotLocation that applies in one direction, in which it "
              "would be seen");
  const std::string against = signal3("", "applicationDirection=\"reverse\"", "lateralSide=\"right\"");
  expect_open(against + against,
              "<signalIS> \"s\", as 1 more, has lateralSide alone, which not all see the same way in reverse; "
              "positionAtTrack would say it");
}

TEST_F(RailmlSignals, OfRailml3WithoutALocationAreTold) {
  const Map map = map_of(railml3("<signalIS id=\"s\"><signalConstruction/></signalIS>"));
  EXPECT_THAT(map.problems, Contains("<signalIS> \"s\" has no location; it is left out"));
  EXPECT_TRUE(map.landmarks.empty());
}

TEST_F(RailmlSignals, OfRailml2StandOnTheSideThatAnExtensionSays) {
  // Cut at the switch at 500 m, and seen along the track whoever heeds them.
  const Map map = map_of(signals2(R"(<signal id="a" pos="100" dir="up" nor:side="right"/>
<signal id="b" pos="700" dir="down" nor:side="left"/><signal id="c" pos="800"/><signal id="d" pos="820" virtual="true" nor:side="left"/>)"));
  EXPECT_EQ(lateral_m(map, "a"), -3.0);
  EXPECT_EQ(lateral_m(map, "b"), 3.0);
  EXPECT_EQ(lateral_m(map, "c"), 0);
  EXPECT_EQ(lateral_m(map, "p"), -3.0);
  EXPECT_TRUE(std::isnan(lateral_m(map, "d"))) << "nothing stands there";
  EXPECT_THAT(map.problems, testing::Not(Contains(HasSubstr("left open"))));
}

TEST_F(RailmlSignals, OfRailml2WithADistanceAloneAreTold) {
  const Map map =
      map_of(signals2(R"(<signal id="a" pos="100" trackDist="3.1"/><signal id="b" pos="200" trackDist="-3.1"/>
<signal id="c" pos="300" trackDist="3.1" nor:side="left"/>)"));
  EXPECT_EQ(lateral_m(map, "a"), 0);
  EXPECT_THAT(map.problems,
              Contains("<signal> \"a\" of track t1 has trackDist 3.1 m, as 1 more, and no side that the schema would "
                       "know; on which side it stands is left open"));
}

}  // namespace
}  // namespace railfix::track
