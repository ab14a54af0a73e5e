#include "track/import/build.hpp"

#include <bzlib.h>
#include <zlib.h>

#include "import_fixture.hpp"
#include "small_map.hpp"

namespace railfix::track {
namespace {

using testing::HasSubstr;

class BuildTest : public ImportTest {
 protected:
  static std::string message(const std::vector<std::filesystem::path>& inputs, const BuildOptions& options = {}) {
    const core::Result<BuiltMap> built = build_map(inputs, options);
    return built.ok() ? "was built" : built.error().message;
  }
};

constexpr const char* kLine =
    R"({"type":"FeatureCollection","features":[{"type":"Feature","properties":{"railway":"%KIND%"},
"geometry":{"type":"LineString","coordinates":[[15.60,48.20],[15.61,48.20],[15.62,48.201]]}}]})";

std::string line_of_kind(const std::string& kind) {
  std::string text = kLine;
  text.replace(text.find("%KIND%"), 6, kind);
  return text;
}

TEST_F(BuildTest, SaysWhatIsWrongInOneSentence) {
  EXPECT_THAT(message({in_folder("none.osm")}), HasSubstr("is the path right?"));
  EXPECT_THAT(message({write("a.txt", "x")}), HasSubstr("of no kind that can be read"));
  EXPECT_THAT(message({write("a.json", "{\n")}), HasSubstr("as JSON map data: not JSON at line 2, column 1."));
  const std::string deep = std::string(150'000, '[') + std::string(150'000, ']');
  EXPECT_THAT(
      message({write("a.json", R"({"features":[{"geometry":{"type":"Polygon","coordinates":)" + deep + "}}]}")}),
      HasSubstr("as JSON map data: its lists and objects nest"));
  EXPECT_THAT(message({write("b.json", "{}")}), HasSubstr("neither"));
  EXPECT_THAT(message({write("c.json", R"({"elements":[{"type":"node"}]})")}), HasSubstr("as JSON map data"));
  EXPECT_THAT(message({write("d.json", R"({"elements":[]})")}), HasSubstr("no railway tracks"));
  EXPECT_THAT(message({write("e.osm", "<osm version=\"0.6\"></osm>")}), HasSubstr("no railway tracks"));
  EXPECT_THAT(message({write("f.osm", "not xml")}), HasSubstr("as OpenStreetMap data"));
  EXPECT_THAT(message({write("g.pbf", "not pbf")}), HasSubstr("as OpenStreetMap data"));
  EXPECT_THAT(message({write("h.map", "no map")}), HasSubstr("h.map"));
  EXPECT_THAT(message({write("i.geojson", line_of_kind("rail"))}, {.crs = "EPSG:4326"}),
              HasSubstr("not a coordinate system in metres"));
  EXPECT_THAT(message({}), HasSubstr("no railway tracks"));
}

TEST_F(BuildTest, VirtualGroupsOfAMappedLineStayAsVagueAsItIs) {
  const auto line = write("line.geojson", line_of_kind("rail"));
  const BuiltMap mapped = core::value_or_throw(build_map({line}, {.virtual_balises_at = {"1:100"}}));
  EXPECT_EQ(mapped.virtual_balises.groups, 1U);
  ASSERT_TRUE(mapped.map.save(in_folder("mapped.map")).ok());
  const BuiltMap upon = core::value_or_throw(build_map({in_folder("mapped.map")}, {.virtual_balises_every_m = 300}));
  ASSERT_GT(upon.map.balise_groups.size(), 3U);
  for (const BaliseGroup& group : upon.map.balise_groups) EXPECT_EQ(group.q_locacc_m, 5) << group.nid_bg;
}

/// A track of these coordinates in GeoJSON.
std::string track_of(const std::string& coordinates) {
  return R"({"features":[{"type":"Feature","id":"way/7","properties":{"railway":"rail","@id":"way/7"},
"geometry":{"type":"LineString","coordinates":[)" +
         coordinates + "]}}]}";
}

TEST_F(BuildTest, CoordinatesThatAreNoDegreesAreTold) {
  EXPECT_THAT(message({write("lv95.geojson", track_of("[2600000.0,1200000.0],[2600100.0,1200000.0]"))}),
              HasSubstr("way/7: the coordinates [2600000.0,1200000.0] and 1 more are not degrees"));
  EXPECT_THAT(message({write("comma.geojson", track_of(R"([15.0,48.0],["15,02","48,0"])"))}),
              HasSubstr(R"(Feature way/7: "48,0" is not a number of degrees)"));
  EXPECT_THAT(message({write("one.geojson", track_of("[15.0,48.0],15.1"))}),
              HasSubstr("Feature way/7: 15.1 is no pair of longitude and latitude"));
  const auto huge = write("huge.geojson", track_of("[15.0,48.0],[1e300,48.0],[15.02,48.0]"));
  EXPECT_THAT(core::value_or_throw(build_map({huge}, {})).map.problems,
              testing::Contains(HasSubstr("way/7: the coordinates [1e+300,48.0] are not degrees; left out")));
}

TEST_F(BuildTest, LatitudesThatAreLongitudesAreTold) {
  constexpr const char* kTold = "latitude and longitude may be swapped";
  EXPECT_THAT(message({write("a.geojson", track_of("[35.6,139.7],[35.61,139.7]"))}),
              testing::EndsWith(std::string("way/7: the coordinates [35.6,139.7] and 1 more have a latitude beyond 90 "
                                            "degrees, ") +
                                kTold + "; GeoJSON coordinates are longitude, latitude in degrees (WGS 84)"));
  for (const auto& file :
       {write("a.osm", R"(<osm version="0.6"><node id="1" lat="139.7" lon="35.6"/><node id="2" lat="139.7" lon="35.61"/>
<way id="7"><nd ref="1"/><nd ref="2"/><tag k="railway" v="rail"/></way></osm>)"),
        write("a.json", R"({"elements":[{"type":"node","id":1,"lat":139.7,"lon":35.6},
{"type":"node","id":2,"lat":139.7,"lon":35.61},{"type":"way","id":7,"nodes":[1,2],"tags":{"railway":"rail"}}]})"),
        write("b.json", R"({"elements":[{"type":"way","id":7,"tags":{"railway":"rail"},
"geometry":[{"lat":139.7,"lon":35.6},{"lat":139.7,"lon":35.61}]}]})")})
    EXPECT_THAT(message({file}), HasSubstr(std::string("their tracks lack them: ") + kTold)) << file;
}

// Where a latitude can be a longitude too, only the system that was asked for can tell.
TEST_F(BuildTest, TracksThatWouldLieInTheSystemTheOtherWayRoundAreTold) {
  const auto problems = [&](const std::string& coordinates, const std::string& crs) {
    return core::value_or_throw(build_map({write("a.geojson", track_of(coordinates))}, {.crs = crs})).map.problems;
  };
  const auto told = testing::Contains(
      "the tracks lie around latitude 15.600, longitude 48.205, for which EPSG:32633 is not made, and would lie right "
      "the other way round: latitude and longitude may be swapped");
  EXPECT_THAT(problems("[48.2,15.6],[48.21,15.6]", "EPSG:32633"), told);
  for (const char* crs : {"", "local", "EPSG:32632"})
    EXPECT_THAT(problems("[48.2,15.6],[48.21,15.6]", crs), testing::Not(testing::Contains(HasSubstr("swapped"))));
  for (const char* crs : {"EPSG:32633", "EPSG:32632"})
    EXPECT_THAT(problems("[15.6,48.2],[15.6,48.21]", crs), testing::Not(testing::Contains(HasSubstr("swapped"))));
}

// The other inputs can tell, too.
TEST_F(BuildTest, InputsThatLieApartAreTold) {
  const auto problems = [&](const std::string& first, const std::string& second) {
    return core::value_or_throw(
               build_map({write("a.geojson", track_of(first)), write("b.geojson", track_of(second))}, {.crs = "local"}))
        .map.problems;
  };
  const auto apart = testing::Contains(HasSubstr("the tracks of b.geojson lie around "));
  EXPECT_THAT(problems("[15.6,48.2],[15.6,48.21]", "[48.3,15.6],[48.31,15.6]"),
              testing::Contains(testing::MatchesRegex(
                  "the tracks of b.geojson lie around latitude 15.600, longitude 48.305, 4... km from those of "
                  "a.geojson, and would lie 11 km from them the other way round: latitude and longitude may be swapped "
                  "in one of the two")));
  EXPECT_THAT(problems("[15.6,48.2],[15.6,48.21]", "[2.3,48.2],[2.3,48.21]"),
              testing::Contains(testing::EndsWith(" km from those of a.geojson: do they belong on one map?")));
  EXPECT_THAT(problems("[15.6,48.2],[15.6,48.21]", "[14.6,48.2],[14.6,48.21]"), testing::Not(apart));
  const auto plan = core::value_or_throw(build_map({write("a.geojson", track_of("[15.6,48.2],[15.6,48.21]"))}, {}));
  ASSERT_TRUE(plan.map.save(in_folder("plan.map")).ok());
  const auto both = core::value_or_throw(
      build_map({in_folder("plan.map"), write("b.geojson", track_of("[48.3,15.6],[48.31,15.6]"))}, {}));
  EXPECT_THAT(both.map.problems, testing::Contains(HasSubstr(" km from those of plan.map, and would lie 11 km")));
}

TEST_F(BuildTest, WhatCrsIsTakenForIsSaid) {
  auto plan = core::value_or_throw(build_map({write("a.geojson", track_of("[15.6,48.2],[15.6,48.21]"))}, {})).map;
  const std::string crs = std::exchange(plan.crs, "");
  ASSERT_TRUE(plan.save(in_folder("plan.map")).ok());
  const auto built = core::value_or_throw(build_map({in_folder("plan.map")}, {.crs = crs}));
  EXPECT_EQ(built.crs_remark,
            "plan.map names no coordinate system: its coordinates stay as they are and are taken as " + crs + "'s");
  EXPECT_EQ(core::value_or_throw(build_map({in_folder("plan.map")}, {})).crs_remark, "");
}

// Nor can the file itself, unless it says where it lies.
TEST_F(BuildTest, TracksBesideTheBoundsThatTheFileDeclaresAreTold) {
  const auto problems = [&](const std::string& name, const std::string& text) {
    return core::value_or_throw(build_map({write(name, text)}, {.crs = "local"})).map.problems;
  };
  const auto osm = [&](const std::string& bounds, double lat, double lon) {
    const auto node = [&](int id, double further) {
      return "<node id=\"" + std::to_string(id) + "\" lat=\"" + std::to_string(lat + further) + "\" lon=\"" +
             std::to_string(lon) + "\"/>";
    };
    return problems(
        "a.osm", "<osm version=\"0.6\">" + bounds + node(1, 0) + node(2, 0.01) + node(3, 0.02) +
                     R"(<way id="7"><nd ref="1"/><nd ref="2"/><nd ref="3"/><tag k="railway" v="rail"/></way></osm>)");
  };
  const std::string bounds = R"(<bounds minlat="48.19" minlon="15.5" maxlat="48.215" maxlon="15.7"/>)";
  const std::string declared =
      "the file declares bounds of latitude 48.1900 to 48.2150, longitude 15.5000 to 15.7000, and ";
  EXPECT_THAT(
      osm(bounds, 15.6, 48.2),
      testing::Contains(declared + "0 of the 3 points of its tracks lie within; the other way round they would: "
                                   "latitude and longitude may be swapped"));
  EXPECT_THAT(osm(bounds, 49.2, 15.6),
              testing::Contains(declared + "0 of the 3 points of its tracks lie within: the bounds "
                                           "or the coordinates are wrong"));
  const auto told = testing::Contains(HasSubstr("declares bounds"));
  EXPECT_THAT(osm(bounds, 48.2, 15.6), testing::Not(told)) << "tracks may reach beyond them";
  EXPECT_THAT(osm("", 15.6, 48.2), testing::Not(told));
  const auto geojson = [&](const std::string& bbox) {
    return problems("a.geojson", R"({"bbox":)" + bbox + "," + track_of("[48.2,15.6],[48.21,15.6]").substr(1));
  };
  for (const char* bbox : {"[15.5,48.1,15.7,48.3]", "[15.5,48.1,200,15.7,48.3,900]"})
    EXPECT_THAT(geojson(bbox),
                testing::Contains(HasSubstr("0 of the 2 points of its tracks lie within; the other way")))
        << bbox;
  for (const char* bbox : {"[48.1,15.5,48.3,15.7]", "[]", "null", "[1,2,3,\"4\"]"})
    EXPECT_THAT(geojson(bbox), testing::Not(told)) << bbox;
}

TEST_F(BuildTest, LinesOfOnePointAreToldAsSuch) {
  EXPECT_THAT(
      message({write(
          "one.geojson",
          R"({"features":[{"properties":{"railway":"rail"},"geometry":{"type":"LineString","coordinates":[[15.6,48.2]]}}]})")}),
      HasSubstr("no railway track has two points (the first track has 1 on the earth)"));
  EXPECT_THAT(message({write("huge.geojson", track_of("[15.0,48.0],[1e300,48.0]"))}),
              HasSubstr("no railway track has two points (way 7 has 1 on the earth)"));
}

// A map that lacks a track makes another one look alone.
TEST_F(BuildTest, TracksWithoutAShapeAreToldBesideOthers) {
  const auto feature = [](int id, const std::string& geometry) {
    return R"(,{"type":"Feature","id":"way/)" + std::to_string(id) +
           R"(","properties":{"railway":"rail"},"geometry":)" + geometry + "}";
  };
  const auto line = [](const std::string& points) { return R"({"type":"LineString","coordinates":[)" + points + "]}"; };
  std::string text = track_of("[15.0,48.0],[15.01,48.0]");
  text.insert(text.size() - 2, feature(2, "null") + feature(3, R"({"type":"GeometryCollection","geometries":[]})") +
                                   feature(4, R"({"type":"MultiLineString","coordinates":[]})") + feature(5, line("")) +
                                   feature(6, line("[15.0,48.0]")) + feature(7, line("[15.0,48.0],[15.0,48.0]")) +
                                   feature(8, line("[15.0,48.0],[15.01,48.0]")));
  EXPECT_THAT(core::value_or_throw(build_map({write("a.geojson", text)}, {})).map.problems,
              testing::ElementsAre(
                  "3 features are railway tracks by their tags but have no line; left out: export the ways with their "
                  "geometry",
                  "3 railway ways have no two points apart from each other; left out: way 5, way 6, way 7"));
  const auto overpass = write("b.json", R"({"elements":[{"type":"node","id":1,"lat":48,"lon":15},
{"type":"node","id":2,"lat":48,"lon":15.01},{"type":"way","id":5,"nodes":[1,2],"tags":{"railway":"rail"}},
{"type":"way","id":6,"nodes":[2],"tags":{"railway":"rail"}},{"type":"way","id":7,"tags":{"railway":"rail"}}]})");
  EXPECT_THAT(core::value_or_throw(build_map({overpass}, {})).map.problems,
              testing::ElementsAre(HasSubstr("2 railway ways have no two points apart from each other; left out: way "
                                             "6, way 7")));
}

TEST_F(BuildTest, FilesCutShortAreToldAsSuch) {
  EXPECT_THAT(message({write("a.pbf", "")}), HasSubstr("the file is empty ("));
  EXPECT_THAT(message({write("a.osm.bz2", "")}), HasSubstr("the file is empty ("));
  EXPECT_THAT(message({write("a.osm.bz2", "BZh91AY")}), HasSubstr("the file is empty or cut short (bzip2 error"));
  EXPECT_THAT(message({write("a.pbf", std::string("\0\0\0\x0d\n\x09OSM", 9))}),
              HasSubstr("the file is empty or cut short (PBF error"));
  EXPECT_THAT(message({write("a.osm", "<osm version=\"0.6\"><node id=\"1\" lat=\"48\" lon=\"15\"/>")}),
              HasSubstr("the file is empty or cut short (XML"));
}

TEST_F(BuildTest, WhatOverpassRemarksIsTold) {
  const std::string track =
      R"("elements":[{"type":"way","id":7,"tags":{"railway":"rail"},"geometry":[{"lat":48,"lon":15},{"lat":48,"lon":15.01}]}]})";
  const auto problems = [&](const std::string& remark) {
    return core::value_or_throw(build_map({write("a.json", "{" + remark + track)}, {})).map.problems;
  };
  EXPECT_THAT(problems(""), testing::IsEmpty());
  EXPECT_THAT(problems(R"("remark":"runtime error: Query timed out after 25 seconds.",)"),
              testing::Contains(HasSubstr("the extract may not be whole, Overpass remarks \"runtime error: Query timed "
                                          "out after 25 seconds.\"")));
  for (const std::string& told : problems(R"("remark":")" + std::string(5000, 'x') + R"(",)"))
    EXPECT_LT(told.size(), 400U);
}

TEST_F(BuildTest, WhatOverpassRemarksInXmlIsToldOfCompressedOnesToo) {
  const std::string xml =
      R"(<osm version="0.6"><node id="1" lat="48.0" lon="15.0"/><node id="2" lat="48.0" lon="15.01"/>
<way id="1"><nd ref="1"/><nd ref="2"/><tag k="railway" v="rail"/></way><!--)" +
      std::string(3'000'000, 'x') + "--><remark> runtime error: Query timed out. </remark></osm>";
  for (const char* name : {"a.osm", "a.osm.gz", "a.osm.bz2"}) {
    const std::string file = in_folder(name).string();
    if (gzFile zipped = file.ends_with(".gz") ? gzopen(file.c_str(), "wb") : nullptr; zipped != nullptr) {
      gzwrite(zipped, xml.data(), static_cast<unsigned>(xml.size()));
      gzclose(zipped);
    } else if (BZFILE* packed = file.ends_with(".bz2") ? BZ2_bzopen(file.c_str(), "wb") : nullptr; packed != nullptr) {
      BZ2_bzwrite(packed, const_cast<char*>(xml.data()), static_cast<int>(xml.size()));
      BZ2_bzclose(packed);
    } else {
      static_cast<void>(write(name, xml));
    }
    EXPECT_THAT(core::value_or_throw(build_map({file}, {})).map.problems,
                testing::Contains(HasSubstr("Overpass remarks \" runtime error: Query timed out. \"")))
        << name;
  }
}

TEST_F(BuildTest, OverpassSaysWhichElementIsWrong) {
  const auto with = [&](const std::string& element) { return write("a.json", R"({"elements":[)" + element + "]}"); };
  EXPECT_THAT(message({with(R"({"type":"node","id":"1","lat":48,"lon":15})")}),
              HasSubstr(R"(node 1: "1" is not an id; ids are whole numbers)"));
  EXPECT_THAT(message({with(R"({"type":"node","id":5,"lat":"48,0","lon":15})")}),
              HasSubstr(R"(node 5: "48,0" is not a number of degrees)"));
  EXPECT_THAT(message({with(R"({"type":"node","id":5,"lon":15})")}), HasSubstr(R"(node 5: there is no "lat")"));
  EXPECT_THAT(message({with(R"({"type":"way","id":7,"nodes":[1,"2"],"tags":{"railway":"rail"}})")}),
              HasSubstr(R"(way 7: "2" is not an id)"));
}

TEST_F(BuildTest, TracksWithoutTheirNodesSayWhatToAskFor) {
  const std::string way = R"({"type":"way","id":7,"nodes":[1,2],"tags":{"railway":"rail"}})";
  EXPECT_THAT(message({write("a.json", R"({"elements":[)" + way + "]}")}), HasSubstr("of way 7 they hold 0 of 2"));
  EXPECT_THAT(message({write("a.osm", R"(<osm version="0.6"><node id="2" lat="48.0" lon="15.01"/>
<way id="1"><nd ref="1"/><nd ref="2"/><tag k="railway" v="rail"/></way></osm>)")}),
              HasSubstr("of way 1 they hold 1 of 2); extract the ways together with their nodes"));
}

// `out geom;` of Overpass.
TEST_F(BuildTest, TheGeometryWithinAWayIsRead) {
  const std::string tags = R"("tags":{"railway":"rail"})";
  const std::string geometry = R"("geometry":[{"lat":48,"lon":15},null,{"lat":48,"lon":15.01},{"lat":48,"lon":15.02}])";
  const auto length_m = [&](const std::string& way) {
    const Map map =
        core::value_or_throw(build_map({write("a.json", R"({"elements":[{"type":"way","id":7,)" + way + "}]}")}, {}))
            .map;
    EXPECT_EQ(map.edges.size(), 1U);
    return map.edges[0].alignment.length_m();
  };
  EXPECT_NEAR(length_m(tags + "," + geometry + R"(,"nodes":[1,2,3,4])"), 745, 2);  // one was cut off, behind the first
  EXPECT_NEAR(length_m(tags + "," + geometry), 745, 2);
  EXPECT_THAT(
      message({write("b.json", R"({"elements":[{"type":"way","id":7,"nodes":[1],)" + tags + "," + geometry + "}]}")}),
      HasSubstr("way 7: it has 1 nodes but 4 places"));
}

TEST_F(BuildTest, TramsOnlyWhereAskedFor) {
  const auto file = write("tram.geojson", line_of_kind("tram"));
  EXPECT_THAT(message({file}), HasSubstr("no railway tracks"));
  EXPECT_EQ(core::value_or_throw(build_map({file}, {.with_trams = true})).map.edges.size(), 1U);
}

TEST_F(BuildTest, NodesThatAreMissingAreToldInOneSentence) {
  const auto problems = [&](int ways) {
    std::string text = R"({"elements":[{"type":"node","id":1,"lat":48.2,"lon":15.6})";
    for (int id = 5; id < 5 + ways; ++id) {
      text += R"(,{"type":"node","id":)" + std::to_string(id) + R"(,"lat":48.2,"lon":15.6)" + std::to_string(id) +
              R"(},{"type":"way","id":)" + std::to_string(id) + R"(,"nodes":[1,)" + std::to_string(id) +
              R"(,3],"tags":{"railway":"rail"}})";
    }
    return core::value_or_throw(build_map({write("m.json", text + "]}")}, {})).map.problems;
  };
  EXPECT_THAT(problems(1),
              testing::ElementsAre("way 5 names 1 node that the data do not hold; the tracks have gaps there: extract "
                                   "the ways together with their nodes, from Overpass by (._;>;); or by out geom;"));
  const std::vector<std::string> told = problems(7);
  EXPECT_THAT(told.front(),
              HasSubstr("way 5, way 6, way 7, way 8, way 9 and 2 more name 7 nodes that the data do not hold"));
  EXPECT_EQ(std::ranges::count_if(told, [](const auto& one) { return one.find("do not hold") != one.npos; }), 1);
}

TEST_F(BuildTest, WhatCutsTheNetworkIsToldFirst) {
  const auto file =
      write("cut.json", R"({"remark":"timed out","elements":[{"type":"way","id":7,"tags":{"railway":"rail",
"incline":"up"},"geometry":[{"lat":48,"lon":15},{"lat":48,"lon":15.01}]},{"type":"way","id":8,"tags":{"railway":"rail"},
"geometry":[{"lat":48,"lon":15.0103},{"lat":48,"lon":15.02}]}]})");
  EXPECT_THAT(core::value_or_throw(build_map({file}, {})).map.problems,
              testing::ElementsAre(HasSubstr("the extract may not be whole"), HasSubstr("end loose at nodes"),
                                   HasSubstr("cannot be reached"), HasSubstr("incline")));
}

TEST_F(BuildTest, ARingIsOneEdgeJoinedToItself) {
  std::string nodes;
  std::string refs;
  for (int i = 0; i < 24; ++i) {
    const double angle = 2 * core::kPi * i / 24;
    nodes += R"({"type":"node","id":)" + std::to_string(i + 1) + R"(,"lat":)" +
             std::to_string(48.2 + 0.002 * std::sin(angle)) + R"(,"lon":)" +
             std::to_string(15.6 + 0.003 * std::cos(angle)) + "},";
    refs += std::to_string(i + 1) + ",";
  }
  const auto file = write("ring.json", R"({"elements":[)" + nodes + R"({"type":"way","id":5,"nodes":[)" + refs +
                                           R"(1],"tags":{"railway":"rail"}}]})");
  const Map map = core::value_or_throw(build_map({file}, {})).map;
  ASSERT_EQ(map.edges.size(), 1U);
  EXPECT_EQ(map.edges[0].from_node, map.edges[0].to_node);
  EXPECT_EQ(map.connections.size(), 1U);
}

// Four tracks at one node that nobody calls anything: where each leads straight on to one other, two tracks cross.
TEST_F(BuildTest, TwoTracksThatCrossAtANodeAreNoSwitch) {
  const auto built = [&](const char* node_of_the_branch) {
    const auto file = write("cross.json", std::string(R"({"elements":[
{"type":"node","id":1,"lat":47.0,"lon":8.0},{"type":"node","id":2,"lat":47.001,"lon":8.0},
{"type":"node","id":3,"lat":47.002,"lon":8.0},{"type":"node","id":4,"lat":47.001,"lon":7.998},
{"type":"node","id":5,"lat":47.001,"lon":8.002},{"type":"node","id":6,"lat":47.0021,"lon":8.0002},
{"type":"way","id":11,"nodes":[1,2,3],"tags":{"railway":"rail","maxspeed":"fast"}},
{"type":"way","id":12,"nodes":[4,2,)") + node_of_the_branch +
                                              R"(],"tags":{"railway":"rail","maxspeed":"signals"}}]})");
    return core::value_or_throw(build_map({file}, {.crs = "local"})).map;
  };
  const auto of_kind = [](const Map& map, NodeKind kind) { return std::ranges::count(map.nodes, kind, &Node::kind); };
  const Map crossing = built("5");
  EXPECT_EQ(of_kind(crossing, NodeKind::crossing), 1);
  EXPECT_EQ(of_kind(crossing, NodeKind::railway_switch), 0);
  EXPECT_EQ(crossing.connections.size(), 2U);
  EXPECT_THAT(
      crossing.problems,
      testing::Contains("1 speed limits are no number of km/h or mph, the first one is \"fast\" of way 11; left out"));
  EXPECT_EQ(of_kind(built("6"), NodeKind::railway_switch), 1);
}

TEST_F(BuildTest, BuildsUponACompiledMap) {
  const auto file = in_folder("small.map");
  Map small = small_map();
  small.balise_groups.clear();
  ASSERT_TRUE(small.save(file).ok());
  const Map map = core::value_or_throw(build_map({file}, {.virtual_balises_every_m = 250})).map;
  EXPECT_EQ(map.edges.size(), 3U);
  EXPECT_EQ(map.crs, "EPSG:2056");
  EXPECT_EQ(map.balise_groups.size(), 9U);
  EXPECT_THAT(map.problems, testing::IsEmpty());
  const auto copy = in_folder("copy.map");
  std::filesystem::copy_file(file, copy);
  EXPECT_THAT(message({file, copy}), HasSubstr("only one compiled map"));
  EXPECT_THAT(message({file, file}), HasSubstr("small.map is given twice"));
  EXPECT_THAT(message({file}, {.crs = "EPSG:32633"}), HasSubstr("not reprojected"));
}

}  // namespace
}  // namespace railfix::track
