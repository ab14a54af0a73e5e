#include <osmium/builder/attr.hpp>
#include <osmium/io/any_output.hpp>

#include "core/random.hpp"
#include "core/units.hpp"
#include "import_fixture.hpp"
#include "track/import/build.hpp"
#include "track/import/finish.hpp"
#include "track/import/osm/osm_network.hpp"
#include "track/import/scale.hpp"
#include "track/path.hpp"

namespace railfix::track {
namespace {

using testing::HasSubstr;

// The line of OsmTest in the two JSON formats.
constexpr const char* kOverpass = R"({"elements":[
{"type":"node","id":1,"lat":48.20001,"lon":15.601},
{"type":"node","id":2,"lat":48.20004,"lon":15.602,"tags":{"railway":"level_crossing","name":"Mill Lane"}},
{"type":"node","id":3,"lat":48.20009,"lon":15.603,"tags":{"railway":"switch","ref":"W1"}},
{"type":"node","id":4,"lat":48.20016,"lon":15.604},{"type":"node","id":5,"lat":48.20025,"lon":15.605},
{"type":"node","id":6,"lat":48.20036,"lon":15.606,"tags":{"railway":"crossing","name":"Mill Lane"}},
{"type":"node","id":7,"lat":48.20049,"lon":15.607},{"type":"node","id":8,"lat":48.20064,"lon":15.608},
{"type":"way","id":10,"nodes":[1,2,3,4],"tags":{"railway":"rail","name":"Westbahn","maxspeed":"160","maxspeed:backward":"50 mph"}},
{"type":"way","id":11,"nodes":[4,5,6,7,8],"tags":{"railway":"rail","name":"Westbahn","maxspeed":"100"}}]})";

constexpr const char* kGeoJson = R"({"type":"FeatureCollection","features":[
{"type":"Feature","properties":{"railway":"level_crossing","name":"Mill Lane"},"geometry":{"type":"Point","coordinates":[15.602,48.20004]}},
{"type":"Feature","properties":{"railway":"crossing","name":"Mill Lane"},"geometry":{"type":"Point","coordinates":[15.606,48.20036]}},
{"type":"Feature","properties":{"railway":"rail","name":"Westbahn","maxspeed":"160","maxspeed:backward":"50 mph"},
"geometry":{"type":"LineString","coordinates":[[15.601,48.20001],[15.602,48.20004],[15.603,48.20009],[15.604,48.20016]]}},
{"type":"Feature","properties":{"railway":"rail","name":"Westbahn","maxspeed":"100"},"geometry":{"type":"LineString",
"coordinates":[[15.604,48.20016],[15.605,48.20025],[15.606,48.20036],[15.607,48.20049],[15.608,48.20064]]}}]})";

/// A main line (ways 10 and 11) with a switch (node 3), a siding (way 12), a tunnel (way 11), and a road.
class OsmTest : public ImportTest {
 protected:
  [[nodiscard]] std::filesystem::path write_osm(const std::string& name) const {
    using namespace osmium::builder::attr;  // NOLINT(google-build-using-namespace)
    osmium::memory::Buffer buffer(100000, osmium::memory::Buffer::auto_grow::yes);
    for (int i = 1; i <= 8; ++i) {
      const osmium::Location place(15.6 + 0.001 * i, 48.2 + 0.00001 * i * i);
      if (i == 3) {
        osmium::builder::add_node(buffer, _id(i), _version(1), _location(place), _tag("railway", "switch"),
                                  _tag("ref", "W1"));
      } else if (i == 5) {
        osmium::builder::add_node(buffer, _id(i), _version(1), _location(place), _tag("railway", "signal"));
      } else if (i == 2 || i == 6) {
        osmium::builder::add_node(buffer, _id(i), _version(1), _location(place),
                                  _tag("railway", i == 2 ? "level_crossing" : "crossing"), _tag("name", "Mill Lane"));
      } else {
        osmium::builder::add_node(buffer, _id(i), _version(1), _location(place));
      }
    }
    osmium::builder::add_node(buffer, _id(20), _version(1), _location(15.6045, 48.20002));
    osmium::builder::add_node(buffer, _id(21), _version(1), _location(15.6055, 48.19990));
    osmium::builder::add_way(buffer, _id(10), _version(1), _nodes({1, 2, 3, 4}), _tag("railway", "rail"),
                             _tag("name", "Westbahn"), _tag("maxspeed", "160"), _tag("maxspeed:backward", "50 mph"));
    osmium::builder::add_way(buffer, _id(11), _version(1), _nodes({4, 5, 6, 7, 8}), _tag("railway", "rail"),
                             _tag("name", "Westbahn"), _tag("tunnel", "yes"), _tag("maxspeed", "100"));
    osmium::builder::add_way(buffer, _id(12), _version(1), _nodes({3, 20, 21}), _tag("railway", "rail"),
                             _tag("service", "siding"), _tag("maxspeed", "signals"));
    osmium::builder::add_way(buffer, _id(13), _version(1), _nodes({1, 20}), _tag("highway", "primary"));
    osmium::builder::add_node(buffer, _id(30), _version(1), _location(15.6015, 48.2010));
    osmium::builder::add_node(buffer, _id(31), _version(1), _location(15.6015, 48.1990));
    osmium::builder::add_way(buffer, _id(15), _version(1), _nodes({30, 31}), _tag("highway", "track"),
                             _tag("bridge", "yes"), _tag("name", "Field Way"));
    osmium::builder::add_way(buffer, _id(14), _version(1), _nodes({20, 2}), _tag("railway", "abandoned"));
    osmium::io::Writer writer(in_folder(name).string(), osmium::io::overwrite::allow);
    writer(std::move(buffer));
    writer.close();
    return in_folder(name);
  }
};

// JOSM keeps what was deleted in its file until it is uploaded.
TEST_F(OsmTest, WhatWasDeletedInJosmIsNoTrack) {
  const auto track_m = [&](const std::string& of_way, const std::string& generator) {
    const std::string text =
        "<osm version='0.6' generator='" + generator +
        "'><node id='1' version='1' lat='48.2' lon='15.6'/><node id='2' version='1' lat='48.21' lon='15.6'/>"
        "<node id='3' version='1' lat='48.22' lon='15.6'/><way id='10' version='1'><nd ref='1'/><nd ref='2'/>"
        "<tag k='railway' v='rail'/></way><way id='11' version='1' " +
        of_way + "><nd ref='2'/><nd ref='3'/><tag k='railway' v='rail'/></way></osm>";
    double length_m = 0;
    for (const Edge& edge : core::value_or_throw(build_map({write("d.osm", text)}, {})).map.edges)
      length_m += edge.alignment.length_m();
    return length_m;
  };
  EXPECT_NEAR(track_m("", "JOSM"), 2224, 10);
  EXPECT_NEAR(track_m("action='modify' visible='true'", "JOSM"), 2224, 10);
  EXPECT_NEAR(track_m("action='delete' visible='true'", "JOSM"), 1112, 5);
  EXPECT_NEAR(track_m("visible='false'", "Overpass API"), 1112, 5);
}

TEST_F(OsmTest, XmlAndPbfGiveTheSameNetwork) {
  for (const char* name : {"a.osm", "a.osm.pbf", "a.osm.bz2", "a.osm.gz"}) {
    SCOPED_TRACE(name);
    const Map map = core::value_or_throw(build_map({write_osm(name)}, {})).map;
    EXPECT_EQ(map.crs, "EPSG:32633");
    ASSERT_EQ(map.edges.size(), 3U);
    const auto found = std::find_if(map.nodes.begin(), map.nodes.end(),
                                    [](const Node& n) { return n.kind == NodeKind::railway_switch; });
    ASSERT_NE(found, map.nodes.end());
    EXPECT_EQ(found->name, "W1");
    ASSERT_EQ(map.connections.size(), 2U);
    EXPECT_EQ(map.edge(map.connections[0].edge_a)->line, "Westbahn");
    EXPECT_EQ(map.edge(map.connections[0].edge_b)->line, "Westbahn");
    EXPECT_FALSE(map.connections[0].diverging);
    EXPECT_TRUE(map.connections[1].diverging);
    EXPECT_THAT(map.problems, testing::Not(testing::Contains(HasSubstr("node"))));
    EXPECT_EQ(std::count_if(
                  map.landmarks.begin(), map.landmarks.end(),
                  [](const Landmark& mark) { return mark.kind == LandmarkKind::bridge && mark.name == "Field Way"; }),
              1);
  }
}

TEST_F(OsmTest, NodesNowhereOnTheEarthAreTold) {
  std::string nodes;
  std::string refs;
  for (int id = 1; id <= 6; ++id) {
    nodes += "<node id=\"" + std::to_string(id) + "\" lat=\"" + (id == 3 ? "148.2" : "48.2") + "\" lon=\"15.60" +
             std::to_string(id) + "\"/>";
    refs += "<nd ref=\"" + std::to_string(id) + "\"/>";
  }
  const auto built = build_map({write("a.osm", "<osm version=\"0.6\">" + nodes + "<way id=\"10\">" + refs +
                                                   "<tag k=\"railway\" v=\"rail\"/></way></osm>")},
                               {});
  ASSERT_TRUE(built.ok()) << built.error().message;
  EXPECT_THAT(built.value().map.problems, testing::Contains(HasSubstr("1 nodes of tracks have a latitude beyond 90")));
}

TEST_F(OsmTest, TunnelsAndSignalsBecomeLandmarks) {
  const Map map = core::value_or_throw(build_map({write_osm("a.osm")}, {})).map;
  const auto of = [&](LandmarkKind kind) {
    return std::find_if(map.landmarks.begin(), map.landmarks.end(), [&](const Landmark& l) { return l.kind == kind; });
  };
  ASSERT_NE(of(LandmarkKind::portal_in), map.landmarks.end());
  EXPECT_EQ(of(LandmarkKind::portal_out), map.landmarks.end());  // the data end inside the tunnel
  const Landmark& portal = *of(LandmarkKind::portal_in);
  const PlanPose pose = map.edge(portal.edge)->alignment.at(portal.offset_m).pose;
  const auto node4 = map.from_geo({48.2 + 0.00001 * 16, 15.604});
  EXPECT_NEAR(pose.easting_m, node4->x(), 1e-3);
  EXPECT_NEAR(pose.northing_m, node4->y(), 1e-3);
  EXPECT_GT(portal.sigma_m, 0);
  EXPECT_NE(of(LandmarkKind::mast), map.landmarks.end());
}

// A way's own bridge=* carries the track: on the map, but nothing that a camera tells.
TEST_F(OsmTest, ABridgeThatCarriesTheTrackIsAnUnderbridge) {
  std::string text = kOverpass;
  const std::string tag = "\"maxspeed\":\"100\"";
  text.replace(text.find(tag), tag.size(), tag + ",\"bridge\":\"viaduct\",\"bridge:name\":\"Long One\"");
  const Map map = core::value_or_throw(build_map({write("a.json", text)}, {})).map;
  std::vector<const Landmark*> bridges;
  for (const Landmark& mark : map.landmarks) {
    EXPECT_NE(mark.kind, LandmarkKind::bridge);
    if (mark.kind == LandmarkKind::underbridge) bridges.push_back(&mark);
  }
  ASSERT_EQ(bridges.size(), 1U);
  EXPECT_EQ(bridges[0]->name, "Long One");
  EXPECT_GT(bridges[0]->sigma_m, 50);  // 300 m long
}

/// The line of OsmTest with one more way from north to south across it, between its nodes 5 and 6.
std::string with_a_way_across(const std::string& tags) {
  std::string text = kOverpass;
  text.replace(
      text.rfind("]}"), 2,
      R"(,{"type":"node","id":30,"lat":48.2013,"lon":15.6055},{"type":"node","id":31,"lat":48.1993,"lon":15.6055},
{"type":"way","id":40,"nodes":[30,31],"tags":{)" +
          tags + "}}]}");
  return text;
}

// Only what leads over the track is a bridge that the camera tells.
TEST_F(OsmTest, ABridgeOverTheTrackIsFoundWhereItCrosses) {
  const auto bridges = [&](const std::string& text) {
    const Map map = core::value_or_throw(build_map({write("a.json", text)}, {.crs = "local"})).map;
    std::vector<std::pair<std::string, double>> found;  // name, metres from where the ways cross
    const auto crossing = map.from_geo({48.200305, 15.6055});
    for (const Landmark& mark : map.landmarks) {
      if (mark.kind != LandmarkKind::bridge) continue;
      const PlanPose pose = map.edge(mark.edge)->alignment.at(mark.offset_m).pose;
      found.emplace_back(mark.name, std::hypot(pose.easting_m - crossing->x(), pose.northing_m - crossing->y()));
      EXPECT_GT(mark.sigma_m, 3);
      EXPECT_LT(mark.sigma_m, 6);
    }
    return found;
  };
  for (const char* road : {R"("highway":"primary","bridge":"yes","layer":"1","name":"Road")",
                           R"("highway":"primary","bridge":"yes","name":"Road")",
                           R"("waterway":"canal","bridge":"aqueduct","name":"Road")",
                           R"("railway":"rail","bridge":"yes","name":"Road")"}) {
    SCOPED_TRACE(road);
    const auto found = bridges(with_a_way_across(road));
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].first, "Road");
    EXPECT_LT(found[0].second, 1);
  }
  for (const char* other :
       {R"("highway":"primary")", R"("highway":"primary","bridge":"no")", R"("highway":"primary","tunnel":"yes")",
        R"("highway":"primary","bridge":"yes","layer":"0")", R"("highway":"proposed","bridge":"yes")",
        R"("railway":"abandoned","bridge":"yes")"}) {
    EXPECT_TRUE(bridges(with_a_way_across(other)).empty()) << other;
  }
  // Not over a tunnel, and not over a viaduct of its own height.
  for (const char* tag : {R"("tunnel":"yes")", R"("bridge":"yes")"}) {
    std::string text = with_a_way_across(R"("highway":"primary","bridge":"yes")");
    const std::string of_track = R"("maxspeed":"100")";
    EXPECT_TRUE(bridges(text.replace(text.find(of_track), of_track.size(), tag)).empty()) << tag;
  }
}

TEST_F(OsmTest, ARoadAndItsFootwayAreOneBridge) {
  std::string text = with_a_way_across(R"("highway":"primary","bridge":"yes")");
  text.replace(
      text.rfind("]}"), 2,
      R"(,{"type":"node","id":32,"lat":48.2013,"lon":15.6056},{"type":"node","id":33,"lat":48.1993,"lon":15.6056},
{"type":"way","id":41,"nodes":[32,33],"tags":{"highway":"footway","bridge":"yes"}}]})");
  const Map map = core::value_or_throw(build_map({write("a.json", text)}, {})).map;
  EXPECT_EQ(std::count_if(map.landmarks.begin(), map.landmarks.end(),
                          [](const Landmark& mark) { return mark.kind == LandmarkKind::bridge; }),
            1);
}

TEST_F(OsmTest, WhatIsWrongInASoundExtractIsAllThatIsTold) {
  EXPECT_THAT(core::value_or_throw(build_map({write("b.json", kOverpass)}, {})).map.problems,
              testing::ElementsAre("switch \"W1\" at latitude 48.200090, longitude 15.603000 has only two tracks, the "
                                   "end of edge 1 (way/10) and the start of edge 2 (way/10#2)"));
}

TEST_F(OsmTest, GeoJsonTakesNoRiverForATrack) {
  const auto with_line = [&](const std::string& properties) {
    std::string text = kGeoJson;
    text.replace(text.rfind("]}"), 2,
                 R"(,{"type":"Feature","properties":)" + properties +
                     R"(,"geometry":{"type":"LineString","coordinates":[[15.6055,48.2013],[15.6055,48.1993]]}}]})");
    return core::value_or_throw(build_map({write("a.geojson", text)}, {})).map;
  };
  const size_t edges = core::value_or_throw(build_map({write("b.geojson", kGeoJson)}, {})).map.edges.size();
  for (const char* key : {"waterway", "power", "highway", "route", "barrier"}) {
    const Map map = with_line(std::string("{\"") + key + "\":\"line\"}");
    EXPECT_EQ(map.edges.size(), edges) << key;
    EXPECT_THAT(map.problems,
                testing::Contains(std::string("1 line with \"") + key + "\" and no railway: no track, left out"));
  }
  const Map silent = with_line(R"({"stroke":"#f00"})");
  EXPECT_EQ(silent.edges.size(), edges + 1);
  EXPECT_THAT(silent.problems, testing::Contains("1 line without a word of what it is: taken as track"));
  EXPECT_EQ(with_line(R"({"route":"train","type":"route"})").edges.size(), edges + 1);
  const Map over = with_line(R"({"highway":"primary","bridge":"yes"})");
  EXPECT_EQ(over.edges.size(), edges);
  EXPECT_EQ(std::count_if(over.landmarks.begin(), over.landmarks.end(),
                          [](const Landmark& mark) { return mark.kind == LandmarkKind::bridge; }),
            1);
}

TEST_F(OsmTest, LevelCrossingsAndSpeedsAreKeptInEveryFormat) {
  for (const auto& file :
       {write_osm("a.osm"), write_osm("a.osm.pbf"), write("a.json", kOverpass), write("a.geojson", kGeoJson)}) {
    SCOPED_TRACE(file.filename().string());
    const Map map = core::value_or_throw(build_map({file}, {})).map;
    EXPECT_EQ(std::count_if(map.landmarks.begin(), map.landmarks.end(),
                            [](const Landmark& mark) {
                              return mark.kind == LandmarkKind::level_crossing && mark.name == "Mill Lane";
                            }),
              2);
    // Along the way as drawn, west to east, whichever way the edge runs.
    const auto limit_kmh = [&](double lon_deg, bool eastwards) {
      const auto at = map.from_geo({48.2 + 10 * std::pow(lon_deg - 15.6, 2), lon_deg});
      for (const Edge& edge : map.edges) {
        const auto near = edge.alignment.nearest(at->x(), at->y());
        if (std::abs(near.lateral_m) > 2 || edge.line != "Westbahn") continue;
        const bool runs_east = std::sin(edge.alignment.at(near.offset_m).pose.heading_rad) > 0;
        const auto limit =
            edge.speed_limit_mps(near.offset_m, runs_east == eastwards ? Direction::forward : Direction::reverse);
        return core::kmh_from_mps(limit.value_or(0));
      }
      return -1.0;
    };
    EXPECT_NEAR(limit_kmh(15.6015, true), 160, 1e-9);
    EXPECT_NEAR(limit_kmh(15.6015, false), 80.4672, 1e-9);
    EXPECT_NEAR(limit_kmh(15.6035, true), 160, 1e-9);
    EXPECT_NEAR(limit_kmh(15.6065, true), 100, 1e-9);
    EXPECT_NEAR(limit_kmh(15.6065, false), 100, 1e-9);
    for (const Edge& edge : map.edges) {
      if (edge.line.empty()) {
        EXPECT_TRUE(edge.speed_limits.empty());  // "signals" is no number
      }
    }
  }
}

TEST_F(OsmTest, TheStraightWayAndTheBranchAreSmooth) {
  const auto map = std::make_shared<const Map>(core::value_or_throw(build_map({write_osm("a.osm")}, {})).map);
  const Connection& branch = map->connections[1];
  const auto heading = [&](uint32_t id) {  // leaving the switch
    const Edge& edge = *map->edge(id);
    const bool forward = edge.from_node == branch.node;
    return edge.alignment.at(forward ? 0 : edge.alignment.length_m()).pose.heading_rad + (forward ? 0 : core::kPi);
  };
  for (const Connection& way : map->connections) {
    EXPECT_NEAR(core::wrap_pi(heading(way.edge_a) - heading(way.edge_b) - core::kPi), 0, 1e-9);
  }
}

TEST_F(OsmTest, LocalProjectionIsTrueToScale) {
  const Map utm = core::value_or_throw(build_map({write_osm("a.osm")}, {})).map;
  const Map local = core::value_or_throw(build_map({write_osm("a.osm")}, {.crs = "local"})).map;
  const double ratio = utm.edges[0].alignment.length_m() / local.edges[0].alignment.length_m();
  EXPECT_NEAR(ratio, 0.9996, 1e-4);
  EXPECT_LT(ratio, 1 - 3e-4);
  ASSERT_TRUE(local.to_geo(100000, 100000));
}

/// A line 1 km from west to east at every one of these longitudes.
std::string lines_at(const std::vector<double>& lons_deg) {
  std::string text;
  for (const double lon : lons_deg) {
    text += std::string(text.empty() ? "" : ",") +
            R"({"type":"Feature","properties":{"railway":"rail"},"geometry":{"type":"LineString","coordinates":[[)" +
            std::to_string(lon) + ",47.2],[" + std::to_string(lon + 0.0132) + ",47.2]]}}";
  }
  return R"({"type":"FeatureCollection","features":[)" + text + "]}";
}

TEST_F(OsmTest, TheScaleOfAWideMapIsToldWithWhatToDo) {
  const auto map_at = [&](const std::vector<double>& lons_deg, const std::string& crs) {
    return core::value_or_throw(build_map({write("a.geojson", lines_at(lons_deg))}, {.crs = crs})).map;
  };
  const auto told = testing::Contains(HasSubstr("give another --crs"));
  const Map wide = map_at({9.6, 15.0, 16.9}, "");  // UTM zone 33
  const ScaleRange range = *scale_over(wide);
  EXPECT_NEAR(range.least_m_per_km, -0.4, 0.001);
  EXPECT_NEAR(range.most_m_per_km, 1.65, 0.02);
  EXPECT_THAT(wide.problems, told);
  EXPECT_THAT(map_at({9.6, 16.9}, "local").problems, told);
  const Map narrow = map_at({15.0, 15.1}, "local");
  EXPECT_NEAR(scale_over(narrow)->most_m_per_km, 0, 0.001);
  EXPECT_THAT(narrow.problems, testing::Not(told));
  EXPECT_THAT(map_at({15.0, 17.0}, "").problems, testing::Not(told));
  // A map that is built upon is measured anew.
  ASSERT_TRUE(wide.save(in_folder("wide.map")).ok());
  const auto again = core::value_or_throw(build_map({in_folder("wide.map")}, {})).map.problems;
  EXPECT_EQ(std::count_if(again.begin(), again.end(), [](const auto& p) { return p.find("--crs") != p.npos; }), 1);
  EXPECT_FALSE(scale_over(Map()));
}

TEST_F(OsmTest, NoDamageToAFileCrashesIt) {
  core::Random random(3);
  for (const char* name : {"b.osm", "b.osm.pbf"}) {
    const std::string whole = content(write_osm(name));
    for (int i = 0; i < 60; ++i) {
      std::string bad = whole;
      if (i % 2 == 0) bad.resize(random.next() % bad.size());
      for (int k = 0; k < 3 && !bad.empty(); ++k) bad[random.next() % bad.size()] = static_cast<char>(random.next());
      const auto built = build_map({write(name, bad)}, {});
      if (!built.ok()) {
        EXPECT_FALSE(built.error().message.empty());
      }
    }
  }
}

class StrayNodes : public ImportTest {
 protected:
  struct Displaced {
    int number = 0;
    double north_m = 0;
    double east_m = 0;
  };
  /// Nodes 101 to 112 on a curve of 500 m radius, every 60 m, one of them displaced, and a siding from the sixth on.
  static std::string curve(const Displaced& displaced, bool as_geojson = false) {
    std::string nodes;
    std::string line;
    std::string siding;
    for (int i = 1; i <= 15; ++i) {
      const int along = i <= 12 ? i : i - 6;  // 13, 14, 15 beside 7, 8, 9
      const double radius_m = i <= 12 ? 500 : 500 + 4.0 * (i - 12);
      const double north_m = radius_m * std::sin(0.12 * along) + (i == displaced.number ? displaced.north_m : 0);
      const double east_m = radius_m * (1 - std::cos(0.12 * along)) + (i == displaced.number ? displaced.east_m : 0);
      char lat[20];
      char lon[20];
      std::snprintf(lat, sizeof lat, "%.7f", 48 + north_m / 111200);
      std::snprintf(lon, sizeof lon, "%.7f", 15 + east_m / 74500);
      std::string& refs = i <= 12 ? line : siding;
      const std::string id = std::to_string(100 + i);
      nodes += R"({"type":"node","id":)" + id + R"(,"lat":)" + lat + R"(,"lon":)" + lon + "},";
      refs += (refs.empty() ? "" : ",") + (as_geojson ? std::string("[") + lon + "," + lat + "]" : id);
    }
    if (as_geojson)
      return R"({"features":[{"properties":{"railway":"rail"},"geometry":{"type":"LineString","coordinates":[)" + line +
             "]}}]}";
    return R"({"elements":[)" + nodes + R"({"type":"way","id":10,"nodes":[)" + line +
           R"(],"tags":{"railway":"rail"}},{"type":"way","id":11,"nodes":[106,)" + siding +
           R"(],"tags":{"railway":"rail"}}]})";
  }
  [[nodiscard]] std::vector<std::string> told(const std::string& text) const {
    std::vector<std::string> problems =
        core::value_or_throw(build_map({write("a.json", text)}, {.crs = "local"})).map.problems;
    std::erase_if(problems, [](const auto& one) { return one.find("off the line between") == one.npos; });
    return problems;
  }
};

TEST_F(StrayNodes, AreNamedWithWhatToDo) {
  EXPECT_THAT(told(curve({.number = 4, .north_m = 100})),
              testing::ElementsAre(testing::AllOf(
                  HasSubstr("node 104 of way/10 at latitude 48.002976, longitude 15.000758 lies "),
                  HasSubstr(" off the line between its neighbours, as no track runs: correct its place in the source, "
                            "or take it out of the way"))));
  // Across, along, by little, by a digit of the degrees; at the switch, and next to the end.
  for (const Displaced& one : {Displaced{4, 0, 30}, {4, -40, 0}, {9, -200, 0}, {9, 0, 74500}, {6, 150, 0}, {2, 0, 90}})
    EXPECT_THAT(told(curve(one)),
                testing::ElementsAre(HasSubstr("node 10" + std::to_string(one.number) + " of way/10")))
        << one.number << " by " << one.north_m << ", " << one.east_m;
  EXPECT_THAT(told(curve({.number = 4, .north_m = 100}, true)),
              testing::ElementsAre(HasSubstr("the point of way/-1 at")));
}

TEST_F(StrayNodes, AreNoneInARealDrawing) {
  EXPECT_THAT(told(curve({})), testing::IsEmpty());
  for (const char* name : {"network/osm/sankt_poelten.json", "network/osm/Ventimiglia_Albenga.geojson",
                           "line_gnss/osm_thusis_filisur.geojson"}) {
    const std::filesystem::path file = shared_data(name);
    if (!std::filesystem::exists(file)) GTEST_SKIP() << "skipped: no " << file;
    EXPECT_THAT(told(content(file)), testing::IsEmpty()) << name;
  }
}

TEST_F(OsmTest, SanktPoeltenRunsThroughItsNodes) {
  const std::filesystem::path file = shared_data("network/osm/sankt_poelten.json");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "skipped: no " << file;
  const OsmData data = core::value_or_throw(read_osm_json(file, false));
  const BuiltMap built = core::value_or_throw(build_map({file}, {}));
  EXPECT_GT(built.map.edges.size(), 500U);
  size_t off = 0;
  size_t tried = 0;
  for (size_t way = 0; way < data.ways.size(); way += 40) {
    const GeoPoint place = data.nodes.at(data.ways[way].nodes[data.ways[way].nodes.size() / 2]).place;
    const auto point = built.map.from_geo(place);
    double nearest = 1e9;
    for (const Edge& edge : built.map.edges) {
      const PlanPose& start = edge.alignment.starts().front();
      if (std::hypot(start.easting_m - point->x(), start.northing_m - point->y()) > edge.alignment.length_m() + 10)
        continue;
      nearest = std::min(nearest, std::abs(edge.alignment.nearest(point->x(), point->y()).lateral_m));
    }
    ++tried;
    if (nearest > 1e-3) ++off;
  }
  EXPECT_GT(tried, 40U);
  EXPECT_LE(off, tried / 10);  // nodes nearer than 2 m to another are left out
  for (const Edge& edge : built.map.edges) EXPECT_TRUE(std::isfinite(edge.alignment.at(1).pose.easting_m));
}

TEST_F(OsmTest, GeoJsonFindsTheTaggedSwitches) {
  const std::filesystem::path file = shared_data("network/osm/Ventimiglia_Albenga.geojson");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "skipped: no " << file;
  const Map map = core::value_or_throw(build_map({file}, {})).map;
  EXPECT_EQ(map.crs, "EPSG:32632");
  const auto switches = std::count_if(map.nodes.begin(), map.nodes.end(),
                                      [](const Node& n) { return n.kind == NodeKind::railway_switch; });
  EXPECT_GE(switches, 39);
  EXPECT_TRUE(std::any_of(map.landmarks.begin(), map.landmarks.end(),
                          [](const Landmark& l) { return l.kind == LandmarkKind::portal_in; }));
}

}  // namespace
}  // namespace railfix::track
