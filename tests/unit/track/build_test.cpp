#include "track/import/build.hpp"

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

TEST_F(BuildTest, TramsOnlyWhereAskedFor) {
  const auto file = write("tram.geojson", line_of_kind("tram"));
  EXPECT_THAT(message({file}), HasSubstr("no railway tracks"));
  EXPECT_EQ(core::value_or_throw(build_map({file}, {.with_trams = true})).map.edges.size(), 1U);
}

TEST_F(BuildTest, NodesThatAreMissingAreTold) {
  const auto file =
      write("m.json",
            R"({"elements":[{"type":"node","id":1,"lat":48.2,"lon":15.6},{"type":"node","id":2,"lat":48.2,"lon":15.61},
    {"type":"way","id":5,"nodes":[1,2,3],"tags":{"railway":"rail"}}]})");
  const Map map = core::value_or_throw(build_map({file}, {})).map;
  EXPECT_EQ(map.edges.size(), 1U);
  EXPECT_THAT(map.problems, testing::Contains(HasSubstr("way 5 names 1 node")));
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
  EXPECT_THAT(message({file, file}), HasSubstr("only one compiled map"));
  EXPECT_THAT(message({file}, {.crs = "EPSG:32633"}), HasSubstr("not reprojected"));
}

}  // namespace
}  // namespace railfix::track
