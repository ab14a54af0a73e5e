// Heights out of the gradients of railML, and where it says none.
#include <map>

#include "import_fixture.hpp"
#include "railml_text.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class RailmlHeights : public ImportTest {
 protected:
  [[nodiscard]] Map map_of(const std::string& text) const {
    return core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  }
};

double height(const Map& map, size_t edge, double offset_m) {
  return map.edges.at(edge).alignment.at(offset_m).elevation_m;
}

std::string gradient_curve(const std::string& attributes, const std::string& place) {
  return "<gradientCurve " + attributes + "><linearLocation>" + place + "</linearLocation></gradientCurve>";
}

TEST_F(RailmlHeights, ASlopeEndsWhereTheFileSays) {
  const Map map =
      map_of(railml3(gradient_curve("id=\"g\" gradient=\"5\"", on("n1", "posBegin=\"100\" posEnd=\"300\""))));
  for (const auto& [at_m, height_m] : {std::pair(0.0, 0.0), {100.0, 0.0}, {200.0, 0.5}, {300.0, 1.0}, {900.0, 1.0}})
    EXPECT_NEAR(height(map, 0, at_m), height_m, 1e-9) << at_m;
  EXPECT_THAT(map.problems,
              Contains("track n1 has no gradient on 800.00 m of its 1000.00 m; it is level there: a guess"));
  EXPECT_NEAR(height(map, 1, 400), 1.0, 1e-9) << "heights run on";
  for (const auto& [at_m, is_known] : {std::pair(50.0, false), {200.0, true}, {400.0, false}})
    EXPECT_EQ(map.edges[0].alignment.grade_known_at(at_m), is_known) << at_m;
  EXPECT_FALSE(map.edges[1].alignment.grade_known_at(400)) << "no source says that it is level";
  const auto relative = Contains(HasSubstr("they are no heights above the sea"));
  EXPECT_THAT(map.problems, relative);
  EXPECT_THAT(map_of(railml3("")).problems, Not(relative));
}

TEST_F(RailmlHeights, AGradientOnAnotherIsLeftOutAndTold) {
  const Map map =
      map_of(railml3(gradient_curve("id=\"g\" gradient=\"5\"", on("n1", "")) +
                     gradient_curve("id=\"h\" gradient=\"10\"", on("n1", "posBegin=\"200\" posEnd=\"300\""))));
  EXPECT_NEAR(height(map, 0, 1000), 5, 1e-9);
  EXPECT_THAT(map.problems, Contains("<gradientCurve> \"h\" begins on another gradient of track n1; left out"));
}

TEST_F(RailmlHeights, SlopesHoldOverSeveralNetElementsAndAgainstThem) {
  const Map map = map_of(railml3(gradient_curve("id=\"g\" gradient=\"5\"", on("n1", "") + on("n2", "")) +
                                 gradient_curve("id=\"h\" gradient=\"4\"", on("n3", "keepsOrientation=\"false\""))));
  EXPECT_NEAR(height(map, 1, 800), 9, 1e-9);
  EXPECT_NEAR(height(map, 2, 500), 3, 1e-9);
  EXPECT_THAT(map.problems, Not(Contains(HasSubstr("gradient"))));
}

// 0 to 20 per mille over 200 m: as a parabola, half the rise of a sharp change.
TEST_F(RailmlHeights, AnArcLeadsFromOneSlopeToTheNext) {
  const auto slope = [](const std::string& gradient, const std::string& place) {
    return gradient_curve("curveType=\"straight\" gradient=\"" + gradient + "\"", on("n1", place));
  };
  const std::string before = slope("0", "posBegin=\"0\" posEnd=\"400\"");
  const std::string after = slope("20", "posBegin=\"600\" posEnd=\"1000\"");
  const auto arc = [](const std::string& attributes) {
    return gradient_curve("id=\"arc\" curveType=\"arc\" " + attributes, on("n1", "posBegin=\"400\" posEnd=\"600\""));
  };
  for (const std::string& text : {before + arc("") + after, arc("deltaGradient=\"20\"") + before + after,
                                  before + arc("radius=\"-10000\"") + slope("20", "posBegin=\"601\" posEnd=\"1000\""),
                                  arc("deltaGradient=\"20\"") + after}) {
    const Map map = map_of(railml3(text));
    const double base_m = height(map, 0, 0);
    for (const auto& [at_m, height_m] : {std::pair(400.0, 0.0), {500.0, 0.5}, {600.0, 2.0}, {1000.0, 10.0}})
      EXPECT_NEAR(height(map, 0, at_m) - base_m, height_m, 0.025) << text << at_m;
    EXPECT_NEAR(map.edges[0].alignment.at(500).vertical_curvature_per_m, 1e-4, 1e-9) << text;
    EXPECT_THAT(map.problems, Not(Contains(HasSubstr("\"arc\""))));
  }
  EXPECT_THAT(map_of(railml3(arc("") + after)).problems,
              Contains("<gradientCurve> \"arc\" has no gradient, and no slopes that it lies between; track n1 is level "
                       "there: a guess"));
}

/// t1 climbs at 5 per mille up to 1500 m and falls at 12.5 from there on; t2 leaves it at 1000 m and comes back at
/// 2000 m, where t1 is 3.75 m lower. t3 leaves t2 at the place put in.
std::string loop(const std::string& of_t2, const std::string& switch_on_t2) {
  return R"(<railml version="2.4"><infrastructure><tracks><track id="t2"><trackTopology>
<trackBegin id="b2" pos="0"><connection id="c2" ref="c1"/></trackBegin><trackEnd id="e2" pos="1000"><connection id="c3" ref="c4"/></trackEnd>
<connections>)" +
         switch_on_t2 + "</connections></trackTopology><trackElements>" + of_t2 + R"(</trackElements></track>
<track id="t1"><trackTopology><trackBegin id="b1" pos="0"/><trackEnd id="e1" pos="3000"/><connections>
<switch id="s1" pos="1000"><connection id="c1" ref="c2" course="left" orientation="outgoing"/></switch>
<switch id="s2" pos="2000"><connection id="c4" ref="c3" course="right" orientation="incoming"/></switch></connections></trackTopology>
<trackElements><gradientChanges><gradientChange id="g1" pos="0" slope="5.0"/><gradientChange id="g2" pos="1500" slope="-12.5"/>
</gradientChanges></trackElements></track>
<track id="t3"><trackTopology><trackBegin id="b3" pos="0"><connection id="c5" ref="c6"/></trackBegin><trackEnd id="e3" pos="80"/></trackTopology></track>
</tracks></infrastructure></railml>)";
}

TEST_F(RailmlHeights, ATrackWithoutGradientsClimbsEvenlyBetweenHeightsThatAreKnown) {
  const Map map = map_of(loop("", ""));
  EXPECT_NEAR(height(map, 0, 0), 5.0, 1e-9);
  EXPECT_NEAR(height(map, 0, 400), 3.5, 1e-9);
  EXPECT_NEAR(height(map, 0, 1000), 1.25, 1e-9);
  EXPECT_THAT(map.problems,
              Contains("track t2 has no gradients; it climbs evenly from 5.00 m to 1.25 m, where others put its ends"));
}

TEST_F(RailmlHeights, EvenlyOverTheSwitchesToo) {
  const Map map = map_of(loop(
      "", R"(<switch id="s3" pos="400"><connection id="c6" ref="c5" course="left" orientation="outgoing"/></switch>)"));
  ASSERT_EQ(map.edges.size(), 6U);
  std::map<std::string, std::pair<double, double>> ends;
  for (const Edge& edge : map.edges)
    ends[edge.name] = {edge.alignment.at(0).elevation_m, edge.alignment.at(edge.alignment.length_m()).elevation_m};
  const auto near = [](double begin_m, double end_m) {
    return testing::Pair(testing::DoubleNear(begin_m, 1e-3), testing::DoubleNear(end_m, 1e-3));
  };
  EXPECT_THAT(ends["t2"], near(5.0, 3.5));
  EXPECT_THAT(ends["t2#2"], near(3.5, 1.25));
  EXPECT_THAT(ends["t3"], near(3.5, 3.5)) << "nobody says how the siding goes on";
}

TEST_F(RailmlHeights, GradientsOfItsOwnHold) {
  const Map map =
      map_of(loop(R"(<gradientChanges><gradientChange id="g3" pos="0" slope="-3.75"/></gradientChanges>)", ""));
  EXPECT_NEAR(height(map, 0, 0) - height(map, 0, 1000), 3.75, 1e-9);
  EXPECT_THAT(map.problems, Not(Contains(testing::AnyOf(HasSubstr("no gradients"), HasSubstr("heights step")))));
}

TEST_F(RailmlHeights, GradientsThatDoNotMeetAreTold) {
  const Map map = map_of(loop(R"(<gradientChanges><gradientChange id="g3" pos="0" slope="5"/></gradientChanges>)", ""));
  EXPECT_THAT(map.problems, Contains(HasSubstr("by its gradients; heights step there")));
}

}  // namespace
}  // namespace railfix::track
