// What railML says of cant and of places over several net elements, and what it says wrongly.
#include <functional>
#include <regex>

#include "core/whole_file.hpp"
#include "import_fixture.hpp"
#include "railml_text.hpp"
#include "track/import/build.hpp"
#include "track/path.hpp"
#include "track/projection.hpp"

namespace railfix::track {
namespace {

using testing::HasSubstr;
using RailmlTest = ImportTest;

TEST_F(RailmlTest, CantHoldsFromOneRadiusChangeToTheNextOverCutsToo) {
  for (const char* switch_pos : {"200", "300", "500", "800", "900"}) {
    const auto built = core::value_or_throw(build_map({write("a.railml", railml2(switch_pos))}, {}));
    const auto map = std::make_shared<const Map>(built.map);
    const Path main = core::value_or_throw(Path::follow(map, {1, 0, Direction::forward}, 2000, 0));
    ASSERT_NEAR(main.end_m(), 1000, 1e-6);
    for (const auto& [at_m, cant_m] : {std::pair(0.0, 0.0),
                                       {150.0, 0.0},
                                       {299.0, 0.0},
                                       {301.0, 0.1},
                                       {499.0, 0.1},
                                       {501.0, 0.1},
                                       {799.0, 0.1},
                                       {801.0, 0.0},
                                       {999.0, 0.0}})
      EXPECT_NEAR(main.at(at_m).cant_m, cant_m, 1e-9) << at_m << " m, switch at " << switch_pos;
  }
}

TEST_F(RailmlTest, ADrawingIsPutNowhereOnTheEarth) {
  const auto file = write("a.railml", railml2("500"));
  BuildOptions somewhere;
  somewhere.crs = "EPSG:32632";
  const auto refused = build_map({file}, somewhere);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().message, HasSubstr("lies nowhere in EPSG:32632; leave --crs out"));
  const auto drawn = core::value_or_throw(build_map({file}, {}));
  EXPECT_THAT(drawn.map.problems, testing::Contains(HasSubstr("the map is a drawing")));
  EXPECT_THAT(drawn.map.problems, testing::Not(testing::Contains(HasSubstr("give --crs"))));
}

// What is said for both directions holds until something is said for one.
TEST_F(RailmlTest, ASpeedForOneDirectionEndsOneForBoth) {
  std::string text = railml2("500");
  const size_t begin = text.find("<trackElements>") + std::string("<trackElements>").size();
  text.insert(begin,
              "<speedChanges><speedChange id=\"a\" pos=\"0\" dir=\"both\" vMax=\"60\"/>"
              "<speedChange id=\"b\" pos=\"50\" dir=\"up\" vMax=\"100\"/>"
              "<speedChange id=\"c\" pos=\"450\" dir=\"both\" vMax=\"60\"/></speedChanges>");
  const auto map = core::value_or_throw(build_map({write("s.railml", text)}, {})).map;
  std::map<Direction, double> kmh_at_60_m;
  for (const auto& limit : map.edges[0].speed_limits) {
    if (limit.from_m < 60 && limit.to_m > 60) kmh_at_60_m[limit.direction] = std::round(3.6 * limit.speed_mps);
  }
  EXPECT_THAT(kmh_at_60_m,
              testing::ElementsAre(testing::Pair(Direction::forward, 100), testing::Pair(Direction::reverse, 60)));
}

TEST_F(RailmlTest, ChangesBeyondTheirTrackAreLeftOutAndTold) {
  std::string text = railml2("500");
  const size_t end = text.find("<trackElements>");
  ASSERT_NE(end, std::string::npos);
  text.insert(end + std::string("<trackElements>").size(),
              "<speedChanges><speedChange id=\"far\" pos=\"14500\" dir=\"up\" vMax=\"20\"/></speedChanges>"
              "<gradientChanges><gradientChange id=\"steep\" pos=\"282100\" slope=\"5\"/></gradientChanges>");
  const auto map = core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  const size_t radii = text.find("<radiusChanges>") + std::string("<radiusChanges>").size();
  text.insert(radii, "<radiusChange id=\"before\" pos=\"-900\" radius=\"500\"/>");
  const auto bent = core::value_or_throw(build_map({write("b.railml", text)}, {})).map;
  EXPECT_THAT(bent.problems, testing::Contains("<radiusChange> \"before\" is not on its track; it is left out"));
  EXPECT_EQ(bent.edges[0].alignment.at(1).curvature_per_m, map.edges[0].alignment.at(1).curvature_per_m);
  EXPECT_THAT(map.problems, testing::IsSupersetOf({"<speedChange> \"far\" is not on its track; it is left out",
                                                   "<gradientChange> \"steep\" is not on its track; it is left out"}));
}

// As exporters write it that know several namespaces.
TEST_F(RailmlTest, ElementsMayHaveThePrefixOfTheFilesOwnNamespace) {
  const auto prefixed = [](const std::string& text) {
    const std::string opened = std::regex_replace(text, std::regex("<(\\w)"), "<rail:$1");
    return std::regex_replace(opened, std::regex("</"), "</rail:");
  };
  const auto bytes = [&](const std::string& text) {
    const auto file = in_folder("a.map");
    EXPECT_TRUE(core::value_or_throw(build_map({write("a.xml", text)}, {})).map.save(file).ok());
    return core::value_or_throw(core::read_whole(file));
  };
  EXPECT_EQ(bytes(prefixed(railml2("500"))), bytes(railml2("500")));
  const auto bad = build_map({write("a.xml", prefixed(railml2("500", "1,0")))}, {});
  ASSERT_FALSE(bad.ok());
  EXPECT_THAT(bad.error().message, HasSubstr("line 4: <radiusChange>"));
}

TEST_F(RailmlTest, ThingsOverSeveralNetElementsHaveTwoEnds) {
  const std::string over_n1_n2 =
      on("n1", "posBegin=\"600\" posEnd=\"1000\"") + on("n2", "posBegin=\"0\" posEnd=\"300\"");
  const std::string text = railml3(crossing("id=\"long\" constructionType=\"tunnel\"", over_n1_n2) +
                                   crossing("id=\"short\" constructionType=\"tunnel\"",
                                            on("n3", "intrinsicCoordBegin=\"0.4\" intrinsicCoordEnd=\"0.6\"")) +
                                   crossing("id=\"road\"", over_n1_n2) + "<platformEdge id=\"p\"><linearLocation>" +
                                   on("n2", "keepsOrientation=\"false\" posBegin=\"0\" posEnd=\"150\"") +
                                   on("n1", "keepsOrientation=\"false\" posBegin=\"900\" posEnd=\"1000\"") +
                                   "</linearLocation></platformEdge>");
  const Map map = core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  using Kind = LandmarkKind;
  EXPECT_THAT(marks_of(map, {Kind::portal_in, Kind::portal_out}),
              testing::UnorderedElementsAre("portal_in long at 600.0 on 1", "portal_out long at 300.0 on 2",
                                            "portal_out long at 0.0 on 3", "portal_in short at 200.0 on 3",
                                            "portal_out short at 300.0 on 3"))
      << "the leg that leaves the tunnel at its switch has a portal, too";
  EXPECT_THAT(marks_of(map, {Kind::platform}),
              testing::ElementsAre("platform p at 900.0 on 1", "platform p at 150.0 on 2"));
  EXPECT_THAT(marks_of(map, {Kind::bridge}), testing::ElementsAre("bridge road at 950.0 on 1"));
}

// A tunnel with a switch in it, and one over two tracks side by side.
TEST_F(RailmlTest, TunnelsEndOnEveryTrackThatLeavesThem) {
  const std::string fork = on("n1", "posBegin=\"900\"") + on("n2", "posEnd=\"50\"") + on("n3", "posEnd=\"60\"");
  const std::string beside = on("n2", "posBegin=\"100\" posEnd=\"200\"") + on("n3", "posBegin=\"100\" posEnd=\"200\"");
  const std::string tunnel = " constructionType=\"tunnel\"";
  const std::string text = railml3(crossing("id=\"fork\"" + tunnel, fork) + crossing("id=\"beside\"" + tunnel, beside));
  const Map map = core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  EXPECT_THAT(marks_of(map, {LandmarkKind::portal_in, LandmarkKind::portal_out}),
              testing::UnorderedElementsAre("portal_in fork at 900.0 on 1", "portal_out fork at 50.0 on 2",
                                            "portal_out fork at 60.0 on 3", "portal_in beside at 100.0 on 2",
                                            "portal_out beside at 200.0 on 2", "portal_in beside at 100.0 on 3",
                                            "portal_out beside at 200.0 on 3"));
}

TEST_F(RailmlTest, NumbersThatCannotBeReadAreRefused) {
  const auto message = [&](const std::string& text) {
    const auto built = build_map({write("bad.railml", text)}, {});
    return built.ok() ? std::string("was built") : built.error().message;
  };
  EXPECT_THAT(message(railml2("500", "100,0")),
              HasSubstr("line 4: <radiusChange> needs a number in the attribute \"superelevation\", not \"100,0\""));
  const auto tunnel_from = [](const std::string& pos) {
    return railml3("\n" + crossing("constructionType=\"tunnel\"", on("n1", "posBegin=\"" + pos + "\"")));
  };
  EXPECT_THAT(message(tunnel_from("600,0")),
              HasSubstr("line 7: <associatedNetElement> needs a number in the attribute \"posBegin\", not \"600,0\""));
  EXPECT_THAT(message(tunnel_from("1-2")), HasSubstr("not \"1-2\""));
  EXPECT_EQ(message(tunnel_from(" +600.0 ")), "was built");
  EXPECT_EQ(message(tunnel_from("")), "was built");
}

TEST_F(RailmlTest, NamesOfThingsThatAreNotThereAreTold) {
  const std::string text =
      railml3(crossing("id=\"t\" constructionType=\"tunnel\"", on("nX", "posBegin=\"100\"")) +
              "<signalIS id=\"s\"><spotLocation netElementRef=\"nY\" pos=\"1\"/></signalIS>"
              "<balise id=\"b\" baliseGroupRef=\"gX\"><spotLocation netElementRef=\"n1\" pos=\"70\"/></balise>"
              "<switchIS id=\"w\" branchCourse=\"right\"><leftBranch "
              "netRelationRef=\"r12\"/><rightBranch netRelationRef=\"rX\"/></switchIS>");
  const Map map = core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  EXPECT_THAT(
      map.problems,
      testing::IsSupersetOf(
          {"<balise> \"b\" names the balise group \"gX\", which does not exist; it is kept as a landmark",
           "<overCrossing> \"t\" names the net element \"nX\", which does not exist; it is left out there",
           "<signalIS> \"s\" names the net element \"nY\", which does not exist; it is left out there",
           "<switchIS> \"w\" names the net relation \"rX\", which does not exist; its <rightBranch> is left out"}));
  EXPECT_THAT(marks_of(map, {LandmarkKind::balise}), testing::ElementsAre("balise b at 70.0 on 1"));
}

TEST_F(RailmlTest, AGroupOverTwoNetElementsKeepsTheBalisesOfTheFirst) {
  const auto balise = [](const std::string& id, const std::string& net_element, const std::string& pos) {
    return "<balise id=\"" + id + "\" baliseGroupRef=\"g\"><spotLocation netElementRef=\"" + net_element + "\" pos=\"" +
           pos + "\"/></balise>";
  };
  const std::string text = railml3(balise("b1", "n1", "995") + balise("b2", "n1", "998") + balise("b3", "n2", "1") +
                                   "<baliseGroup id=\"g\"><etcs countryID=\"97\" groupID=\"77\"/></baliseGroup>");
  const Map map = core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  EXPECT_THAT(marks_of(map, {LandmarkKind::balise}),
              testing::ElementsAre("balise b1 at 995.0 on 1", "balise b2 at 998.0 on 1", "balise b3 at 1.0 on 2"));
  ASSERT_EQ(map.balise_groups.size(), 1U);
  EXPECT_EQ(map.balise_groups[0].edge, 1U);
  std::vector<std::string> in_group;
  for (const uint32_t id : map.balise_groups[0].balises) in_group.push_back(map.landmark(id)->name);
  EXPECT_THAT(in_group, testing::ElementsAre("b1", "b2"));
  EXPECT_THAT(map.problems,
              testing::Contains("balise group \"g\" lies on two net elements; only its balises on \"n1\" are kept in "
                                "it, the others as landmarks"));
}

// Switches at 200, 500 and 900 m cut the track, whose pieces do not follow one another in the map.
TEST_F(RailmlTest, PlacesCountOnOverTheSwitchesOfATrack) {
  std::string text = railml2("500");
  const auto switch_at = [](const std::string& pos) {
    return "<switch id=\"w" + pos + "\" pos=\"" + pos + "\"><connection id=\"c" + pos +
           "\" ref=\"none\" orientation=\"outgoing\" course=\"left\"/></switch>";
  };
  text.insert(text.find("</connections>"), switch_at("200") + switch_at("900"));
  const auto file = in_folder("a.map");
  ASSERT_TRUE(core::value_or_throw(build_map({write("a.railml", text)}, {})).map.save(file).ok());
  const Map map = core::value_or_throw(Map::load(file));
  std::vector<std::string> names;
  for (const Edge& edge : map.edges) names.push_back(edge.name);
  EXPECT_THAT(names, testing::ElementsAre("t1", "t2", "t1#2", "t1#3", "t1#4"));
  for (const auto& [text_at, edge, offset_m] : {std::tuple("t1:150", 1U, 150.0),
                                                {"t1:450:-", 3U, 250.0},
                                                {"t1:550", 4U, 50.0},
                                                {"t1:1000", 5U, 100.0},
                                                {"t1#3:10", 4U, 10.0},
                                                {"t2:300", 2U, 300.0}}) {
    const auto place = map.parse_position(text_at);
    ASSERT_TRUE(place.ok()) << place.error().message;
    EXPECT_EQ(place.value().edge, edge) << text_at;
    EXPECT_NEAR(place.value().offset_m, offset_m, 1e-9) << text_at;
  }
  EXPECT_THAT(map.parse_position("t1:1001").error().message, HasSubstr("which is 1000.0"));
}

TEST_F(RailmlTest, SwitchesWithoutABranchAreTold) {
  std::string text = railml2("500");
  text.insert(text.find("</connections>"),
              "<switch id=\"w2\" name=\"W2\" pos=\"700\"></switch><switch id=\"w3\" pos=\"1000\"><connection id=\"c9\" "
              "ref=\"c8\" orientation=\"incoming\"/></switch>");
  const std::string end = "<trackEnd id=\"e2\" pos=\"300\"/>";
  text.replace(text.find(end), end.size(),
               "<trackEnd id=\"e2\" pos=\"300\"><connection id=\"c8\" ref=\"c9\"/></trackEnd>");
  const std::vector<std::string> problems = core::value_or_throw(build_map({write("a.railml", text)}, {})).map.problems;
  const std::string no_switch = " connects its track with no other; it is left out";
  EXPECT_THAT(problems, testing::IsSupersetOf({"<switch> \"W2\"" + no_switch, "<switch> \"w3\"" + no_switch,
                                               std::string("connections \"c8\" and \"c9\" meet at a switch at the very "
                                                           "end of its track, behind which there is none; they are "
                                                           "left out")}));
  EXPECT_THAT(problems, testing::Not(testing::Contains("<switch> \"w1\"" + no_switch)));
  text = railml3("<switchIS id=\"w\" branchCourse=\"left\"><name name=\"W1\"/></switchIS>");
  EXPECT_THAT(core::value_or_throw(build_map({write("b.railml", text)}, {})).map.problems,
              testing::Contains("<switchIS> \"W1\" has no branch over a net relation; it is left out"));
}

TEST_F(RailmlTest, PlacesBeyondTheirNetElementAreTold) {
  const std::string text = railml3("<balise id=\"b\"><spotLocation netElementRef=\"n1\" pos=\"70000\"/></balise>");
  EXPECT_THAT(core::value_or_throw(build_map({write("a.railml", text)}, {})).map.problems,
              testing::Contains(testing::AllOf(testing::StartsWith("<balise> \"b\" lies at 70000"),
                                               testing::EndsWith("it is left out there"))));
}

TEST_F(RailmlTest, TheMiddleDoesNotDependOnTheOrderOfTheStretches) {
  const auto bridge = [&](const std::string& first, const std::string& second) {
    const std::string text = railml3(crossing("id=\"b\"", on("n1", first) + on("n1", second)));
    return marks_of(core::value_or_throw(build_map({write("a.railml", text)}, {})).map, {LandmarkKind::bridge});
  };
  const std::string near = "posBegin=\"40\" posEnd=\"60\"";
  const std::string far = "posBegin=\"60\" posEnd=\"100\"";
  EXPECT_EQ(bridge(near, far), bridge(far, near));
  EXPECT_THAT(bridge(far, near), testing::ElementsAre(HasSubstr(" at 70.0 on 1")));
}

TEST_F(RailmlTest, CantOfNoKnownSideIsTold) {
  const auto built = [&](const std::string& changes) {
    std::string text = railml2("500");
    const size_t from = text.find("<radiusChanges>");
    text.replace(from, text.find("</radiusChanges>") - from, "<radiusChanges>" + changes);
    return core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  };
  const Map map = built(
      R"(<radiusChange id="r1" pos="100" radius="0" superelevation="30"/><radiusChange id="r2" pos="200" radius="-500" superelevation="-60"/>
<radiusChange id="r3" pos="300" radius="500" superelevation="-70"/><radiusChange id="r4" pos="400" radius="0" superelevation="0"/>)");
  EXPECT_THAT(
      map.problems,
      testing::IsSupersetOf(
          {"<radiusChange> \"r2\" of track t1 has superelevation -60 mm, as 1 more, below 0: the schema does not say "
           "what the sign means, so the outer rail is taken as the higher one",
           "<radiusChange> \"r1\" of track t1 has superelevation 30 mm on a straight: which rail is higher is not "
           "said; no cant begins there"}));
  EXPECT_EQ(map.edges[0].alignment.at(150).cant_m, 0);
  EXPECT_NEAR(map.edges[0].alignment.at(250).cant_m, 0.06, 1e-12);
  EXPECT_NEAR(map.edges[0].alignment.at(350).cant_m, -0.07, 1e-12);
  EXPECT_THAT(built(R"(<radiusChange id="r" pos="200" radius="-500" superelevation="60"/>)").problems,
              testing::Not(testing::Contains(HasSubstr("superelevation"))));
}

TEST_F(RailmlTest, CantOfRailml3IsLeftOutAndTold) {
  const std::string text =
      railml3(R"(<superelevationCurves><superelevationCurve id="sc1" superelevation="60"/></superelevationCurves>)");
  EXPECT_THAT(core::value_or_throw(build_map({write("b.railml", text)}, {})).map.problems,
              testing::Contains("<superelevationCurve> \"sc1\" says something of cant, perhaps as others do: railML 3 "
                                "has no word for it and does not say its unit and sign; all of it is left out, cant is "
                                "read from railML 2, ERJU and LandXML"));
}

TEST_F(RailmlTest, CoordinatesThatNoMapHasAreRefused) {
  const auto at = [](const std::string& share, const std::string& x) {
    return "<intrinsicCoordinate intrinsicCoord=\"" + share +
           "\"><geometricCoordinate positioningSystemRef=\"g\" x=\"" + x + "\" y=\"5500000\"/></intrinsicCoordinate>";
  };
  std::string text = railml3("");
  const std::string plain = "<netElement id=\"n1\" length=\"1000\"/>";
  text.replace(text.find(plain), plain.size(),
               "<netElement id=\"n1\" length=\"1000\"><associatedPositioningSystem>" + at("0", "500000") +
                   at("1", "1e308") + "</associatedPositioningSystem></netElement>");
  text.insert(text.find("<infrastructure>"),
              "<common><positioning><geometricPositioningSystem id=\"g\" crsDefinition=\"EPSG:25832\"/></positioning>"
              "</common>");
  const auto built = build_map({write("far.railml", text)}, {});
  ASSERT_FALSE(built.ok());
  EXPECT_THAT(built.error().message,
              HasSubstr("<geometricCoordinate> has coordinates that no map has; they are metres, "
                        "and below 100,000,000"));
}

TEST_F(RailmlTest, ImpossibleValuesAreLeftOutAndTold) {
  std::string text = railml2("500", "90000");
  text.insert(
      text.find("</trackElements>"),
      "<tunnels><tunnel id=\"tu\" pos=\"700\" length=\"-300\"/></tunnels><bridges><brigde id=\"br\" pos=\"80\" "
      "length=\"-20\"/></bridges><platformEdges><platformEdge id=\"pe\" pos=\"90\" length=\"-1\"/></platformEdges>"
      "<speedChanges><speedChange id=\"v1\" pos=\"0\" dir=\"up\" vMax=\"120\"/><speedChange id=\"v2\" pos=\"100\" "
      "dir=\"up\" vMax=\"12000\"/><speedChange id=\"v3\" pos=\"150\" dir=\"up\" vMax=\"-5\"/></speedChanges>");
  const Map map = core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  EXPECT_THAT(
      map.problems,
      testing::IsSupersetOf(
          {"<radiusChange> \"r1\" of track t1 has superelevation 90000 mm, which no track has; no cant begins there",
           "<tunnel> \"tu\" of track t1 has length -300 m; it is left out",
           "<brigde> \"br\" of track t1 has length -20 m; it is left out",
           "<platformEdge> \"pe\" of track t1 has length -1 m; it is left out",
           "<speedChange> \"v2\" of track t1 has vMax 12000 km/h, which no train runs; no limit begins there",
           "<speedChange> \"v3\" of track t1 has vMax -5 km/h, which no train runs; no limit begins there"}));
  EXPECT_TRUE(map.landmarks.empty());
  EXPECT_EQ(map.edges[0].alignment.at(400).cant_m, 0);
  ASSERT_EQ(map.edges[0].speed_limits.size(), 1U);
  EXPECT_NEAR(map.edges[0].speed_limits[0].to_m, 100, 1e-9) << "what holds behind is not known";
  text = railml3("<speedSection id=\"v\" maxSpeed=\"12000\"><linearLocation>" + on("n1", "") +
                 "</linearLocation></speedSection>");
  EXPECT_THAT(core::value_or_throw(build_map({write("b.railml", text)}, {})).map.problems,
              testing::Contains("<speedSection> \"v\" has maxSpeed 12000 km/h, which no train runs; it is left out"));
}

/// 1000 m, points every 100 m as `point` writes them.
std::string railml3_along(const std::string& system, const std::function<std::string(double)>& point) {
  std::string coordinates;
  for (int at = 0; at <= 1000; at += 100) {
    coordinates += "<intrinsicCoordinate intrinsicCoord=\"" + std::to_string(1e-3 * at) +
                   "\">\n<geometricCoordinate positioningSystemRef=\"s\" " + point(at) + "/></intrinsicCoordinate>";
  }
  return "<railML version=\"3.2\"><common><positioning><geometricPositioningSystems><geometricPositioningSystem "
         "id=\"s\" "
         "crsDefinition=\"" +
         system +
         "\"/></geometricPositioningSystems></positioning></common><infrastructure><topology><netElements><netElement "
         "id=\"n\" length=\"1000\"><associatedPositioningSystem>" +
         coordinates + "</associatedPositioningSystem></netElement></netElements></topology></infrastructure></railML>";
}

// As those of railML 2 are: in a plane around the first of them. x is the longitude.
TEST_F(RailmlTest, DegreesOfRailml3ArePutIntoAPlane) {
  const auto projection = core::value_or_throw(Projection::open("EPSG:25832"));
  const auto degrees = [&](double at_m) {
    const GeoPoint geo = projection.to_geo(500000 + 0.6 * at_m, 5300000 + 0.8 * at_m).value();
    char text[80];
    std::snprintf(text, sizeof text, "x=\"%.9f\" y=\"%.9f\"", geo.lon_deg, geo.lat_deg);
    return std::string(text);
  };
  for (const char* system : {"EPSG:4326", "urn:ogc:def:crs:EPSG::4258", "WGS84"}) {
    const Map map = core::value_or_throw(build_map({write("a.railml", railml3_along(system, degrees))}, {})).map;
    EXPECT_NEAR(map.edges.at(0).alignment.length_m(), 1000.4, 0.05) << "on the ellipsoid, not in UTM";
    const GeoPoint end = map.to_geo(map.nodes.at(1).easting_m, map.nodes.at(1).northing_m).value();
    const GeoPoint wanted = projection.to_geo(500600, 5300800).value();
    EXPECT_NEAR(end.lat_deg, wanted.lat_deg, 1e-7);
    EXPECT_NEAR(end.lon_deg, wanted.lon_deg, 1e-7);
  }
  const auto message = [&](const std::string& text) {
    return build_map({write("b.railml", text)}, {}).error().message;
  };
  EXPECT_THAT(
      message(railml3_along("EPSG:4326", [](double at) { return "x=\"7\" y=\"" + std::to_string(91 + at) + "\""; })),
      HasSubstr("line 2: <geometricCoordinate> says latitude 91.000000 and longitude 7.000000; they go from -90 to "
                "90 and from -180 to 180: latitude and longitude may be swapped"));
  EXPECT_THAT(message(railml3_along("nowhere", degrees)), HasSubstr("is not a coordinate system in metres"));
}

// By its first element, wherever it stands and however it is written.
TEST_F(RailmlTest, XmlIsKnownByItsFirstElement) {
  const auto message = [&](const std::string& text) {
    const auto built = build_map({write("a.xml", text)}, {});
    return built.ok() ? std::string("was built") : built.error().message;
  };
  const auto utf16 = [](const std::string& text) {
    std::string out = "\xff\xfe";
    for (const char letter : text) out += {letter, '\0'};
    return out;
  };
  const std::string head = "<?xml version=\"1.0\" encoding=\"UTF-16\"?>\n";
  EXPECT_EQ(message("<!-- " + std::string(20000, '.') + " <osm> <LandXML> -->" + railml2("500")), "was built");
  EXPECT_EQ(message("\xef\xbb\xbf" + railml2("500")), "was built");
  EXPECT_EQ(message("\n\n" + railml2("500")), "was built");
  EXPECT_THAT(message("<!-- \xfc --><osm version=\"0.6\"/>"), HasSubstr("XML parsing error at line 1"));
  EXPECT_THAT(message("<r:railml xmlns:r=\"x\" version=\"2.4\"/>"), HasSubstr("holds no <track>"));
  EXPECT_EQ(message("<?xml version=\"1.0\" encoding=\"windows-1252\"?>\n<!-- \xfc -->" + railml2("500")), "was built");
  EXPECT_EQ(message(utf16(head + railml2("500"))), "was built");
  EXPECT_THAT(message(utf16(head + railml2("500", "1,0"))), HasSubstr("line 5: <radiusChange>"));
  EXPECT_THAT(message("<svg/>"), HasSubstr("not LandXML, railML, OpenStreetMap nor an ERJU"));
  EXPECT_THAT(message("<eng xmlns=\"https://erju.org/eng\"/>"), HasSubstr("its first element is <eng>"));
  EXPECT_THAT(message("no XML"), HasSubstr("not sound XML"));
}

}  // namespace
}  // namespace railfix::track
