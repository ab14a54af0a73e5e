// railML 2.4, railML 3.2 and the ERJU digital map.
#include <algorithm>
#include <cmath>
#include <functional>

#include "core/random.hpp"
#include "import_fixture.hpp"
#include "plans.hpp"
#include "track/import/build.hpp"
#include "track/path.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::HasSubstr;

const Node* node_named(const Map& map, const std::string& name) {
  const auto found = std::find_if(map.nodes.begin(), map.nodes.end(), [&](const Node& n) { return n.name == name; });
  return found == map.nodes.end() ? nullptr : &*found;
}

size_t count_of(const Map& map, LandmarkKind kind) {
  return static_cast<size_t>(
      std::count_if(map.landmarks.begin(), map.landmarks.end(), [&](const Landmark& m) { return m.kind == kind; }));
}

size_t ways_at(const Map& map, uint32_t node) {
  return static_cast<size_t>(std::count_if(map.connections.begin(), map.connections.end(),
                                           [&](const Connection& way) { return way.node == node; }));
}

class PlanImport : public ImportTest {
 protected:
  /// Unzips the example of that name; empty where data or unzip are missing.
  [[nodiscard]] std::vector<std::filesystem::path> unzipped(const std::string& name) const {
    const std::filesystem::path zip = shared_data("network/railml/" + name);
    const std::string command =
        "unzip -q -o \"" + zip.string() + "\" -d \"" + in_folder("").string() + "\" > /dev/null 2>&1";
    if (!std::filesystem::exists(zip) || std::system(command.c_str()) != 0) return {};  // NOLINT(cert-env33-c)
    std::vector<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(in_folder(""))) {
      if (entry.path().extension() == ".xml") files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    return files;
  }
};

TEST_F(PlanImport, Railml2KeepsWhatThePlanSays) {
  const Map map = core::value_or_throw(build_map({write("a.railml", kRailml2)}, {})).map;
  EXPECT_NEAR(length_of(map), 1400, 1e-6);
  ASSERT_EQ(map.edges.size(), 4U);  // main in three pieces, siding
  const Node* w1 = node_named(map, "W1");
  const Node* w2 = node_named(map, "W2");
  ASSERT_TRUE(w1 != nullptr && w2 != nullptr);
  EXPECT_EQ(w1->kind, NodeKind::railway_switch);
  EXPECT_EQ(ways_at(map, w1->id), 2U);
  EXPECT_EQ(ways_at(map, w2->id), 2U);
  ASSERT_EQ(map.balise_groups.size(), 1U);
  EXPECT_EQ(map.balise_groups[0].nid_lrbg(), 97U << 14U | 1234U);
  EXPECT_NEAR(map.balise_groups[0].offset_m, 200, 1e-6);
  EXPECT_EQ(map.balise_groups[0].balises.size(), 2U);
  EXPECT_EQ(level_crossing_of(map), std::pair(std::string("Mill Lane"), 100.0));
  using Kind = LandmarkKind;
  EXPECT_THAT(marks_of(map, {Kind::bridge, Kind::underbridge, Kind::mast, Kind::platform}),
              testing::ElementsAre("underbridge B at 50.0 on 1", "underbridge C at 90.0 on 1", "bridge D at 125.0 on 1",
                                   "mast S at 280.0 on 1", "platform P at 100.0 on 3", "platform P at 250.0 on 3"));
  EXPECT_THAT(marks_of(map, {Kind::portal_in, Kind::portal_out}),
              testing::ElementsAre("portal_in T at 120.0 on 4", "portal_out T at 220.0 on 4"));
  EXPECT_GT(map.landmarks_on(3).front()->lateral_m, 1);  // the platform stands to the left
  // The whole main track: its curve, cant and height.
  const auto shared = std::make_shared<const Map>(map);
  const Path path = core::value_or_throw(Path::follow(shared, {1, 0, Direction::forward}, 2000, 0));
  EXPECT_NEAR(path.end_m(), 1000, 1e-6);
  EXPECT_NEAR(path.curvature_at(900), -1.0 / 500, 1e-12);
  EXPECT_NEAR(path.at(900).cant_m, -0.06, 1e-9);
  EXPECT_NEAR(path.at(1000 - 1e-6).elevation_m, 2.0 - 6.0, 1e-3);
  // Speeds: of the changes that all trains heed, up to the next one on the track, over the pieces that switches cut.
  const auto speed = [&](double from_begin_m, Direction running) {
    const EdgePosition place = path.position_at(from_begin_m);
    return limit_kmh(map, place.edge, place.offset_m, running);
  };
  for (const auto& [at, kmh] : {std::pair(10.0, 80.0), {499.0, 80.0}, {501.0, 120.0}, {999.0, 120.0}})
    EXPECT_NEAR(speed(at, Direction::forward), kmh, 1e-9) << at;
  for (const auto& [at, kmh] : {std::pair(950.0, 0.0), {899.0, 60.0}, {500.0, 60.0}, {201.0, 60.0}, {150.0, 0.0}})
    EXPECT_NEAR(speed(at, Direction::reverse), kmh, 1e-9) << at;
  // And over the siding: straight way first, as long as the file says.
  const Path over = core::value_or_throw(Path::follow(shared, {1, 0, Direction::forward}, 2000, 0, {4, 2}));
  EXPECT_NEAR(over.end_m(), 1000, 1e-6);
  EXPECT_THAT(map.problems, Contains(HasSubstr("laid out as a drawing")));
}

TEST_F(PlanImport, WhatIsThereTwiceIsTold) {
  using testing::Not;
  EXPECT_THAT(core::value_or_throw(build_map({write("good.railml", kRailml2)}, {})).map.problems,
              Not(Contains(HasSubstr("twice"))));
  // The same id at two places: both stay, and the file is told to be wrong.
  std::string text = kRailml2;
  const std::string second = "<balise id=\"x2\" pos=\"203\"/>";
  text.replace(text.find(second), second.size(), second + "<balise id=\"x1\" pos=\"280\"/>");
  const Map map = core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  EXPECT_THAT(map.problems,
              Contains("the id \"x1\" is there twice, for <balise> \"x1\" at 200 m and for <balise> \"x1\" at 280 m"));
  EXPECT_THAT(marks_of(map, {LandmarkKind::balise}),
              testing::ElementsAre("balise x1 at 200.0 on 1", "balise x2 at 203.0 on 1", "balise x1 at 280.0 on 1"));
  ASSERT_EQ(map.balise_groups.size(), 1U);
  EXPECT_NEAR(map.balise_groups[0].offset_m, 200, 1e-9);
  // Two at one place, in no group.
  text = kRailml2;
  text.replace(text.find(second), second.size(),
               second + "<balise id=\"x3\" pos=\"250\"/><balise id=\"x4\" pos=\"250.2\"/>");
  EXPECT_THAT(core::value_or_throw(build_map({write("b.railml", text)}, {})).map.problems,
              Contains(HasSubstr("balises \"x3\" and \"x4\" are at the same place, edge 1 (")));
  // In railML 3 too.
  text = kRailml3;
  text.replace(text.find("id=\"b3\""), 7, "id=\"b1\"");
  EXPECT_THAT(core::value_or_throw(build_map({write("c.xml", text)}, {})).map.problems,
              Contains(HasSubstr("the id \"b1\" is there twice")));
}

/// 400 m straight to the north-east and a left arc of 500 m radius over 400 m; a siding of 200 m leaves at 300 m.
/// Points every 20 m as `coord` writes them.
std::string railml2_with_coordinates(const std::string& attributes,
                                     const std::function<std::string(const Eigen::Vector2d&)>& coord) {
  const Alignment line =
      Alignment::chained({500000, 5300000, core::kPi / 4}, {{400, 0, 0}, {400, 1.0 / 500, 1.0 / 500}});
  const auto place = [&](double at_m, double beside_m) {
    const PlanPose pose = line.at(at_m).pose;
    const Eigen::Vector2d right(std::cos(pose.heading_rad), -std::sin(pose.heading_rad));
    return "<geoCoord coord=\"" + coord(Eigen::Vector2d(pose.easting_m, pose.northing_m) + beside_m * right) + "\"" +
           attributes + "/>";
  };
  std::string mappings;
  for (int at = 20; at < 800; at += 20)
    mappings += "<geoMapping id=\"m" + std::to_string(at) + "\" pos=\"" + std::to_string(1000 + at) + "\">" +
                place(at, 0) + "</geoMapping>";
  return R"(<railml xmlns="https://www.railml.org/schemas/2018" version="2.4"><infrastructure id="i"><tracks>
<track id="t1" name="main"><trackTopology><trackBegin id="b1" pos="1000"><openEnd id="o1"/>)" +
         place(0, 0) + R"(</trackBegin><trackEnd id="e1" pos="1800"><bufferStop id="o2"/>)" + place(800, 0) +
         R"(</trackEnd><connections><switch id="w1" name="W1" pos="1310"><connection id="c1" ref="c3" orientation="outgoing" course="right"/>
</switch></connections></trackTopology><trackElements><geoMappings>)" +
         mappings + R"(</geoMappings></trackElements><ocsElements><signals><signal id="s1" name="S1" pos="1500">)" +
         place(500, 3) + R"(</signal></signals></ocsElements></track>
<track id="t2" name="siding"><trackTopology><trackBegin id="b2" pos="0"><connection id="c3" ref="c1"/></trackBegin>
<trackEnd id="e2" pos="200"><bufferStop id="o3"/></trackEnd></trackTopology></track></tracks></infrastructure></railml>)";
}

TEST_F(PlanImport, Railml2CoordinatesMakeTheTrack) {
  const auto projection = core::value_or_throw(Projection::open("EPSG:25833"));
  const auto metres = [](const Eigen::Vector2d& at) {
    char text[80];
    std::snprintf(text, sizeof text, "%.4f %.4f", at.x(), at.y());
    return std::string(text);
  };
  const auto degrees = [&](const Eigen::Vector2d& at) {
    const auto geo = projection.to_geo(at.x(), at.y()).value();
    char text[80];
    std::snprintf(text, sizeof text, "%.9f %.9f 250.0", geo.lat_deg, geo.lon_deg);
    return std::string(text);
  };
  const std::string plain = railml2_with_coordinates(" epsgCode=\"urn:ogc:def:crs:EPSG::25833\"", metres);
  const Map map = core::value_or_throw(build_map({write("a.railml", plain)}, {})).map;
  EXPECT_EQ(map.crs, "EPSG:25833");
  const auto path =
      core::value_or_throw(Path::follow(std::make_shared<const Map>(map), {1, 0, Direction::forward}, 2000, 0));
  EXPECT_NEAR(path.end_m(), 800, 0.05);
  EXPECT_NEAR(path.at(0).pose.easting_m, 500000, 0.01);
  EXPECT_NEAR(path.at(300).pose.northing_m, 5300000 + 300 * std::cos(core::kPi / 4), 0.02);
  EXPECT_NEAR(path.curvature_at(200), 0, 1e-5);
  EXPECT_NEAR(path.curvature_at(600), 1.0 / 500, 1e-5);
  EXPECT_EQ(ways_at(map, node_named(map, "W1")->id), 2U);
  EXPECT_NEAR(node_named(map, "W1")->easting_m, 500000 + 310 * std::sin(core::kPi / 4), 0.02);
  // WGS 84 without a word: the same line, now true to scale (UTM's middle meridian shortens by 0.4 m per km).
  const Map geo = core::value_or_throw(build_map({write("b.railml", railml2_with_coordinates("", degrees))}, {})).map;
  const auto there = geo.to_geo(geo.nodes[0].easting_m, geo.nodes[0].northing_m).value();
  EXPECT_NEAR(there.lat_deg, projection.to_geo(500000, 5300000)->lat_deg, 1e-7);
  EXPECT_NEAR(length_of(geo), 1000 + 800 * 0.0004, 0.1);
  const std::string mixed = std::string(plain).replace(plain.find("25833"), 5, "25832");
  EXPECT_THAT(build_map({write("c.railml", mixed)}, {}).error().message, HasSubstr("EPSG:25832"));
}

TEST_F(PlanImport, Railml3KeepsWhatThePlanSays) {
  const Map map = core::value_or_throw(build_map({write("a.xml", kRailml3)}, {})).map;
  EXPECT_EQ(map.crs, "EPSG:25832");
  ASSERT_EQ(map.edges.size(), 3U);
  EXPECT_NEAR(length_of(map), 700, 1e-6);
  const Node* points = node_named(map, "W7");
  ASSERT_NE(points, nullptr);
  EXPECT_NEAR(points->easting_m, 500300, 0.01);
  ASSERT_EQ(map.connections.size(), 2U);
  EXPECT_FALSE(map.connections[0].diverging);
  EXPECT_EQ(std::max(map.connections[0].edge_a, map.connections[0].edge_b), 2U);
  EXPECT_TRUE(map.connections[1].diverging);
  using Kind = LandmarkKind;
  EXPECT_THAT(
      marks_of(map, {Kind::mast, Kind::balise, Kind::portal_in, Kind::portal_out}),
      testing::ElementsAre("balise b1 at 200.0 on 1", "balise b2 at 203.0 on 1", "mast s2 at 250.0 on 1",
                           "balise b3 at 20.0 on 2", "portal_in o1 at 50.0 on 2", "portal_out o1 at 150.0 on 2"));
  EXPECT_THAT(marks_of(map, {Kind::bridge, Kind::underbridge, Kind::platform}),
              testing::ElementsAre("bridge o2 at 25.0 on 3", "underbridge u1 at 50.0 on 3", "platform p1 at 100.0 on 3",
                                   "platform p1 at 180.0 on 3"));
  EXPECT_EQ(map.landmarks_on(3).back()->lateral_m, 0);  // nobody says on which side the platform lies
  ASSERT_EQ(map.balise_groups.size(), 1U);
  EXPECT_EQ(map.balise_groups[0].nid_lrbg(), 97U << 14U | 77U);
  EXPECT_EQ(map.balise_groups[0].balises.size(), 2U);
  EXPECT_NEAR(map.balise_groups[0].offset_m, 200, 1e-6);
  EXPECT_NEAR(map.edges[1].alignment.at(100).elevation_m - map.edges[1].alignment.at(0).elevation_m, 0.5, 1e-6);
  EXPECT_EQ(level_crossing_of(map).first, "Mill Lane");
  EXPECT_NEAR(level_crossing_of(map).second, 120, 0.01);
  EXPECT_NEAR(limit_kmh(map, 1, 100, Direction::forward), 100, 1e-9);
  EXPECT_NEAR(limit_kmh(map, 1, 100, Direction::reverse), 100, 1e-9);
  EXPECT_EQ(limit_kmh(map, 1, 20, Direction::forward), 0);
  EXPECT_EQ(limit_kmh(map, 2, 100, Direction::forward), 0);  // for tilting trains only
  EXPECT_EQ(limit_kmh(map, 3, 100, Direction::forward), 0);
  EXPECT_NEAR(limit_kmh(map, 3, 100, Direction::reverse), 40, 1e-9);
}

// The same infrastructure in both generations.
TEST_F(PlanImport, Railml3ClothoidsLeadFromOneArcToTheNext) {
  const char* text =
      R"(<railML xmlns="https://www.railml.org/schemas/3.2" version="3.2"><infrastructure><topology><netElements>
<netElement id="n" length="1000"/></netElements></topology><geometry><horizontalCurves>
<horizontalCurve id="c1" curveType="clothoid"><linearLocation><associatedNetElement netElementRef="n" posBegin="100" posEnd="200"/></linearLocation></horizontalCurve>
<horizontalCurve id="c2" curveType="arc" radius="500"><linearLocation><associatedNetElement netElementRef="n" posBegin="200" posEnd="400"/></linearLocation></horizontalCurve>
<horizontalCurve id="c3" curveType="blossCurve" radius="500"><linearLocation><associatedNetElement netElementRef="n" posBegin="400" posEnd="500"/></linearLocation></horizontalCurve>
<horizontalCurve id="c4" curveType="arc" radius="-250"><linearLocation><associatedNetElement netElementRef="n" posBegin="500" posEnd="600"/></linearLocation></horizontalCurve>
<horizontalCurve id="c5" curveType="clothoid"><linearLocation><associatedNetElement netElementRef="n" posBegin="800" posEnd="900"/></linearLocation></horizontalCurve>
</horizontalCurves></geometry></infrastructure></railML>)";
  const Map map = core::value_or_throw(build_map({write("a.xml", text)}, {})).map;
  const Alignment& track = map.edges[0].alignment;
  for (const auto& [at, curvature] : {std::pair(50.0, 0.0),
                                      {150.0, -1.0 / 1000},
                                      {300.0, -1.0 / 500},
                                      {450.0, 1.0 / 1000},
                                      {550.0, 1.0 / 250},
                                      {700.0, 0.0},
                                      {850.0, 0.0}})
    EXPECT_NEAR(track.curvature_at(at), curvature, 1e-12) << at;
  EXPECT_THAT(map.problems, Contains(HasSubstr("c5")));
}

TEST_F(PlanImport, TheExamplesOfBothGenerationsAgree) {
  struct Example {
    const char* zip;
    double length_m;
    int switches;
    size_t platform_ends;
    std::vector<size_t> balises;   // of 2.4 and 3.2, which has none
    size_t masts;                  // signals and stop posts, without the virtual ones
    std::vector<ptrdiff_t> right;  // of those, in 2.4 and 3.2, which says it of stop posts too
    ptrdiff_t left;                // V2, which trains in reverse heed, to their right
  };
  for (const Example& example : {Example{"Simplest Example-2.4.zip", 1630, 2, 2, {5, 0}, 4, {2, 2}, 0},
                                 {"Simple Example+RTC.zip", 6900, 3, 8, {7, 0}, 26, {2, 4}, 1}}) {
    SCOPED_TRACE(example.zip);
    const std::vector<std::filesystem::path> files = unzipped(example.zip);
    if (files.empty()) GTEST_SKIP() << "skipped: no " << example.zip << ", or no unzip";
    ASSERT_EQ(files.size(), 2U);
    for (size_t i = 0; i < files.size(); ++i) {
      SCOPED_TRACE(files[i].filename().string());
      const Map map = core::value_or_throw(build_map({files[i]}, {})).map;
      EXPECT_NEAR(length_of(map), example.length_m, 1e-3);
      EXPECT_EQ(std::count_if(map.nodes.begin(), map.nodes.end(),
                              [](const Node& node) { return node.kind == NodeKind::railway_switch; }),
                example.switches);
      EXPECT_THAT(map.problems, testing::Not(Contains(HasSubstr("twice"))));
      EXPECT_EQ(count_of(map, LandmarkKind::underbridge), 1U);
      EXPECT_EQ(count_of(map, LandmarkKind::bridge), 0U);
      EXPECT_EQ(count_of(map, LandmarkKind::portal_in), 1U);
      EXPECT_EQ(count_of(map, LandmarkKind::portal_out), 1U);
      EXPECT_EQ(count_of(map, LandmarkKind::level_crossing), 1U);
      EXPECT_EQ(count_of(map, LandmarkKind::platform), example.platform_ends);
      EXPECT_EQ(count_of(map, LandmarkKind::balise), example.balises[i]);
      EXPECT_EQ(count_of(map, LandmarkKind::mast), example.masts);
      const auto beside = [&](double left) {
        return std::ranges::count_if(map.landmarks, [&](const Landmark& mark) {
          return mark.kind == LandmarkKind::mast && mark.lateral_m * left > 0;
        });
      };
      EXPECT_EQ(beside(-1), example.right[i]);
      EXPECT_EQ(beside(1), example.left);
      EXPECT_TRUE(std::none_of(map.problems.begin(), map.problems.end(), [](const std::string& problem) {
        return problem.find("cannot be reached") != std::string::npos;
      }));
    }
    std::filesystem::remove(files[0]);
    std::filesystem::remove(files[1]);
  }
}

// A side that is not said is not made up: half of those made up would be wrong.
TEST_F(PlanImport, PlatformsStandWhereTheFileSaysOrOnNeitherSide) {
  const auto lateral_m = [&](std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    const Map map = core::value_or_throw(build_map({write("a.xml", text)}, {})).map;
    const auto found = std::find_if(map.landmarks.begin(), map.landmarks.end(),
                                    [](const Landmark& mark) { return mark.kind == LandmarkKind::platform; });
    return found == map.landmarks.end() ? NAN : found->lateral_m;
  };
  const std::string of_2 = " side=\"left\"";
  EXPECT_EQ(lateral_m(kRailml2, of_2, of_2), kPlatformEdgeM);
  EXPECT_EQ(lateral_m(kRailml2, of_2, " side=\"right\""), -kPlatformEdgeM);
  EXPECT_EQ(lateral_m(kRailml2, of_2, ""), 0);
  const std::string of_3 = R"(<associatedNetElement netElementRef="n3" posBegin="100" posEnd="180"/>)";
  const auto with_side = [&](const std::string& side) {
    return of_3.substr(0, of_3.size() - 2) + "><linearCoordinateBegin lateralSide=\"" + side +
           "\"/></associatedNetElement>";
  };
  EXPECT_EQ(lateral_m(kRailml3, of_3, with_side("left")), kPlatformEdgeM);
  EXPECT_EQ(lateral_m(kRailml3, of_3, with_side("right")), -kPlatformEdgeM);
  EXPECT_EQ(lateral_m(kRailml3, of_3, with_side("both")), 0);
}

TEST_F(PlanImport, SaysWhatIsWrongInOneSentence) {
  const auto message = [&](std::string text, const std::string& from, const std::string& to) {
    const size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    const auto built = build_map({write("bad.xml", text)}, {});
    return built.ok() ? std::string("was built") : built.error().message;
  };
  EXPECT_THAT(message(kRailml2, "version=\"2.4\"", "version=\"4.0\""), HasSubstr("railML 2.x and 3.x can be read"));
  EXPECT_THAT(message(kRailml2, "pos=\"1000\"", "pos=\"-5\""), HasSubstr("between 0 and 1000 km"));
  EXPECT_THAT(message(kRailml2, "radius=\"500\"", "radius=\"5\""), HasSubstr("less than 10 m"));
  EXPECT_THAT(message(kRailml2, "slope=\"5\"", "slope=\"x\""), HasSubstr("needs a number in the attribute \"slope\""));
  EXPECT_THAT(message(kRailml2, "groupID=\"1234\"", "groupID=\"99999\""), HasSubstr("ETCS cannot carry"));
  for (const char* not_whole : {"12.5", "16382.1", "-0.5"}) {
    const std::string said = "identity that ETCS cannot carry: NID_C is a whole number";
    const std::string bad = "\"" + std::string(not_whole) + "\"";
    EXPECT_THAT(message(kRailml2, "groupID=\"1234\"", "groupID=" + bad), HasSubstr(said));
    EXPECT_THAT(message(kRailml3, "countryID=\"97\"", "countryID=" + bad), HasSubstr(said));
    EXPECT_THAT(message(kInfra, "nid_c=\"97\"", "nid_c=" + bad), HasSubstr(said));
    EXPECT_THAT(message(kInfra, "nid_bg=\"5050\"", "nid_bg=" + bad), HasSubstr(said));
  }
  EXPECT_THAT(message(kRailml2, "groupID=\"1234\"", "groupID=\"16383\""), HasSubstr("ETCS cannot carry"));
  EXPECT_THAT(message(kRailml2, "groupID=\"1234\"", "groupID=\"1234.0\""), HasSubstr("was built"));
  EXPECT_THAT(message(kRailml2, "</tracks>", ""), HasSubstr("not sound XML"));
  EXPECT_THAT(message(kRailml3, "elementB ref=\"n2\"", "elementB ref=\"n9\""), HasSubstr("does not exist"));
  EXPECT_THAT(message(kRailml3, "length=\"300\"", "length=\"-3\""), HasSubstr("between 0 and 1000 km"));
  EXPECT_THAT(message(kInfra, "nid_c=\"97\"", "nid_c=\"9700\""), HasSubstr("ETCS cannot carry"));
  EXPECT_THAT(message(kInfra, "trackEdge=\"T2\" pos=\"13000\"", "trackEdge=\"T9\" pos=\"13000\""), HasSubstr("\"T9\""));
  EXPECT_THAT(message(kInfra, "trackEdgeLength=\"500000\"", ""), HasSubstr("trackEdgeLength"));
  const auto alone = build_map({write("m.xml", "<mapMgmt xmlns=\"https://erju.org/map\"/>")}, {});
  ASSERT_FALSE(alone.ok());
  EXPECT_THAT(alone.error().message, HasSubstr("infra"));
}

TEST_F(PlanImport, NoDamageToAFileCrashesIt) {
  core::Random random(12);
  for (const char* whole : {kRailml2, kRailml3, kInfra}) {
    for (int i = 0; i < 120; ++i) {
      std::string bad = whole;
      if (i % 3 == 0) bad.resize(random.next() % bad.size());
      for (int k = 0; k < 3 && !bad.empty(); ++k) bad[random.next() % bad.size()] = static_cast<char>(random.next());
      const auto built = build_map({write("bad.xml", bad)}, {});
      if (!built.ok()) {
        EXPECT_FALSE(built.error().message.empty());
      } else {
        for (const Edge& edge : built.value().map.edges)
          EXPECT_TRUE(std::isfinite(edge.alignment.at(1).pose.easting_m));
      }
    }
  }
}

}  // namespace
}  // namespace railfix::track
