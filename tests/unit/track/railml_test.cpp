// What railML says of cant and of places over several net elements, and what it says wrongly.
#include <regex>

#include "core/whole_file.hpp"
#include "import_fixture.hpp"
#include "track/import/build.hpp"
#include "track/path.hpp"

namespace railfix::track {
namespace {

using testing::HasSubstr;
using RailmlTest = ImportTest;

// 1000 m with a left curve from 300 m to 800 m; a branch leaves to the right at the place put in.
std::string railml2(const std::string& switch_pos, const std::string& cant = "100") {
  return R"(<railml version="2.4"><infrastructure><tracks>
<track id="t1"><trackTopology><trackBegin id="b1" pos="0"/><trackEnd id="e1" pos="1000"/><connections>
<switch id="w1" pos=")" +
         switch_pos +
         R"("><connection id="c1" ref="c2" orientation="outgoing" course="right"/></switch></connections></trackTopology>
<trackElements><radiusChanges><radiusChange id="r1" pos="300" radius="-500" superelevation=")" +
         cant + R"("/>
<radiusChange id="r2" pos="800" radius="0"/></radiusChanges></trackElements></track>
<track id="t2"><trackTopology><trackBegin id="b2" pos="0"><connection id="c2" ref="c1"/></trackBegin><trackEnd id="e2" pos="300"/>
</trackTopology></track></tracks></infrastructure></railml>)";
}

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

// n1 (1000 m) leads into n2 (800 m) or, over a switch, into n3 (500 m).
std::string railml3(const std::string& infrastructure) {
  return R"(<railML version="3.2"><infrastructure><topology><netElements>
<netElement id="n1" length="1000"/><netElement id="n2" length="800"/><netElement id="n3" length="500"/></netElements><netRelations>
<netRelation id="r12" navigability="Both" positionOnA="1" positionOnB="0"><elementA ref="n1"/><elementB ref="n2"/></netRelation>
<netRelation id="r13" navigability="Both" positionOnA="1" positionOnB="0"><elementA ref="n1"/><elementB ref="n3"/></netRelation>
<netRelation id="r23" navigability="None" positionOnA="0" positionOnB="0"><elementA ref="n2"/><elementB ref="n3"/></netRelation>
</netRelations></topology><functionalInfrastructure>)" +
         infrastructure + "</functionalInfrastructure></infrastructure></railML>";
}

std::string on(const std::string& net_element, const std::string& attributes) {
  return "<associatedNetElement netElementRef=\"" + net_element + "\" " + attributes + "/>";
}

std::string crossing(const std::string& attributes, const std::string& places) {
  return "<overCrossing " + attributes + "><linearLocation>" + places + "</linearLocation></overCrossing>";
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

TEST_F(RailmlTest, PlacesBeyondTheirNetElementAreTold) {
  const std::string text = railml3("<balise id=\"b\"><spotLocation netElementRef=\"n1\" pos=\"70000\"/></balise>");
  EXPECT_THAT(core::value_or_throw(build_map({write("a.railml", text)}, {})).map.problems,
              testing::Contains(testing::AllOf(testing::StartsWith("<balise> \"b\" lies at 70000"),
                                               testing::EndsWith("it is put to its end"))));
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
