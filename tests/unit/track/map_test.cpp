#include "track/map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <functional>
#include <thread>

#include "small_map.hpp"

namespace railfix::track {
namespace {

using testing::HasSubstr;

class MapFile : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() / ("railfix_map_" + std::to_string(::getpid()) + "_" +
                                                        testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] std::filesystem::path file() const { return folder_ / "test.map"; }
  [[nodiscard]] std::string content() const {
    std::ifstream in(file(), std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void write(const std::string& text) const { std::ofstream(file(), std::ios::binary) << text; }

  std::filesystem::path folder_;
};

TEST_F(MapFile, NamesInOtherEncodingsDoNotMakeItUnreadable) {
  Map map = small_map();
  map.edges[0].name = "M\xFChle \xE4\xB8\xAD \xED\xA0\x80";  // Latin-1, a Chinese character, half of a surrogate pair
  ASSERT_TRUE(map.save(file()).ok());
  EXPECT_EQ(core::value_or_throw(Map::load(file())).edges[0].name, "M?hle \xE4\xB8\xAD ???");
}

TEST_F(MapFile, NamesGiveATerminalNoOrders) {
  Map map = small_map();
  map.edges[0].name = "\x1B[2J\xC2\x9B\n\x7F\xC2\xA0";  // escapes of 7 and 8 bits, and a space that stays
  ASSERT_TRUE(map.save(file()).ok());
  EXPECT_EQ(core::value_or_throw(Map::load(file())).edges[0].name, "?[2J????\xC2\xA0");
}

TEST_F(MapFile, ReadsBackWhatWasSaved) {
  const Map saved = small_map();
  ASSERT_TRUE(saved.save(file()).ok());
  const Map map = core::value_or_throw(Map::load(file()));
  ASSERT_EQ(map.edges.size(), 3U);
  EXPECT_EQ(map.edges[0].name, "main");
  EXPECT_EQ(map.crs, "EPSG:2056");
  EXPECT_EQ(map.connections.size(), 2U);
  EXPECT_EQ(map.nodes[1].kind, NodeKind::railway_switch);
  ASSERT_EQ(map.landmarks.size(), 3U);
  EXPECT_EQ(map.landmarks[1].kind, LandmarkKind::portal_in);
  EXPECT_EQ(map.balise_groups[1].nid_lrbg(), 85U << 14U | 101U);
  EXPECT_EQ(map.edges[0].speed_limit_mps(500, Direction::forward), 20);
  EXPECT_EQ(map.edges[0].speed_limit_mps(500, Direction::reverse), 20);  // the lower of two
  EXPECT_EQ(map.edges[0].speed_limit_mps(700, Direction::reverse), 30);
  EXPECT_FALSE(map.edges[0].speed_limit_mps(700, Direction::forward));
  for (double s = 0; s < 1000; s += 100) {
    EXPECT_EQ(map.edges[0].alignment.at(s).pose.easting_m, saved.edges[0].alignment.at(s).pose.easting_m);
    EXPECT_EQ(map.edges[0].alignment.at(s).cant_m, saved.edges[0].alignment.at(s).cant_m);
    EXPECT_EQ(map.edges[0].alignment.at(s).grade, saved.edges[0].alignment.at(s).grade);
  }
}

TEST_F(MapFile, EveryTruncationIsASentenceOrASoundMap) {
  ASSERT_TRUE(small_map().save(file()).ok());
  const std::string whole = content();
  int refused = 0;
  for (size_t length = 0; length < whole.size(); length += 7) {
    write(whole.substr(0, length));
    const core::Result<Map> map = Map::load(file());
    if (!map) {
      ++refused;
      EXPECT_THAT(map.error().message, HasSubstr("test.map"));
    }
  }
  EXPECT_GT(refused, 20);
}

TEST_F(MapFile, EveryGarbledByteIsASentenceOrASoundMap) {
  ASSERT_TRUE(small_map().save(file()).ok());
  const std::string whole = content();
  for (size_t i = 0; i < whole.size(); i += 3) {
    std::string bad = whole;
    bad[i] = static_cast<char>(bad[i] ^ 0x55);
    write(bad);
    const core::Result<Map> map = Map::load(file());
    if (!map) continue;
    for (const Edge& edge : map.value().edges) EXPECT_TRUE(std::isfinite(edge.alignment.at(10).pose.easting_m));
  }
}

// What cannot be read is not stored; a damaged file is refused by the same checks.
TEST_F(MapFile, NamesWhatIsWrong) {
  EXPECT_THAT(Map::load(folder_ / "none").error().message, HasSubstr("cannot read"));
  EXPECT_THAT(Map::load(folder_).error().message, HasSubstr("cannot read"));
  Map map = small_map();
  map.landmarks[1].offset_m = 600;
  EXPECT_THAT(map.save(file()).error().message, HasSubstr("landmark 2 is not on an edge"));
  map = small_map();
  map.edges[1].alignment = Alignment::chained({}, {{100, 2, 2}});
  EXPECT_THAT(map.save(file()).error().message, HasSubstr("edge 2 has a radius"));
  map = small_map();
  map.edges[0].speed_limits[0].speed_mps = -1;
  EXPECT_THAT(map.save(file()).error().message, HasSubstr("edge 1 has a speed limit that is none"));
  EXPECT_FALSE(small_map().save(folder_ / "no" / "folder.map").ok());
}

// Whoever has a map relies on its references and identities.
TEST_F(MapFile, RefusesWhatRefersToNothing) {
  const auto message = [&](const std::function<void(Map&)>& spoil) {
    Map map = small_map();
    spoil(map);
    const core::Status saved = map.save(file());
    return saved.ok() ? std::string("was saved") : saved.error().message;
  };
  EXPECT_THAT(message([](Map& map) { map.balise_groups[0].nid_bg = 16383; }),  // means unknown
              HasSubstr("balise group 85/16383 has an identity that ETCS cannot carry"));
  EXPECT_EQ(message([](Map& map) { map.balise_groups[0].nid_bg = 16382; }), "was saved");
  for (const double accuracy_m : {-1.0, double{NAN}, double{INFINITY}}) {
    EXPECT_THAT(message([&](Map& map) { map.balise_groups[0].q_locacc_m = accuracy_m; }),
                HasSubstr("balise group 85/100 has a location accuracy that is not a length"));
  }
  EXPECT_THAT(message([](Map& map) { map.balise_groups[0].balises = {4}; }),
              HasSubstr("balise group 85/100 names a balise that is not among the landmarks"));
  EXPECT_EQ(message([](Map& map) { map.balise_groups[0].balises = {0, 1}; }), "was saved");
  EXPECT_THAT(message([](Map& map) { map.nodes.pop_back(); }),
              HasSubstr("edge 3 begins or ends at a node that does not exist"));
  EXPECT_THAT(message([](Map& map) { map.edges[1].to_node = 0; }), HasSubstr("edge 2 begins or ends at a node"));
  EXPECT_THAT(message([](Map& map) { map.connections[1].node = 5; }),
              HasSubstr("a connection lies at node 5, which does not exist"));
  EXPECT_THAT(message([](Map& map) { map.nodes[2].id = 7; }), HasSubstr("its nodes are not numbered"));
  EXPECT_THAT(message([](Map& map) { map.nodes[2].easting_m = NAN; }), HasSubstr("node 3 has a coordinate"));
}

TEST_F(MapFile, NodesThatWereLeftOutAreTheEndsOfTheTracks) {
  Map map = small_map();
  const std::vector<Node> nodes = std::exchange(map.nodes, {});
  ASSERT_TRUE(map.save(file()).ok());
  const Map read = core::value_or_throw(Map::load(file()));
  ASSERT_EQ(read.nodes.size(), 4U);
  for (size_t i = 0; i < nodes.size(); ++i) {
    EXPECT_EQ(read.nodes[i].id, i + 1);
    EXPECT_NEAR(read.nodes[i].easting_m, nodes[i].easting_m, 1e-6);
    EXPECT_NEAR(read.nodes[i].northing_m, nodes[i].northing_m, 1e-6);
  }
  map.edges[0].to_node = 4'000'000'000;
  EXPECT_THAT(map.save(file()).error().message, HasSubstr("edge 1 begins or ends at a node that does not exist"));
}

TEST_F(MapFile, LandmarksOfAnEdgeAreFoundInAnyMap) {
  Map made = small_map();
  for (uint32_t id = 4; id <= 300; ++id)
    made.landmarks.push_back({id, LandmarkKind::mast, 1 + id % 3, 7.0 * (id * 37 % 71), 3, 0.2, ""});
  ASSERT_TRUE(made.save(file()).ok());
  Map loaded = core::value_or_throw(Map::load(file()));
  const auto expect_same = [&](const Map& map) {
    for (uint32_t edge = 0; edge <= 4; ++edge) {
      std::vector<uint32_t> found, wanted;
      for (const Landmark* mark : map.landmarks_on(edge)) found.push_back(mark->id);
      Map fresh = small_map();
      fresh.landmarks = map.landmarks;
      for (const Landmark* mark : fresh.landmarks_on(edge)) wanted.push_back(mark->id);
      EXPECT_EQ(found, wanted) << "edge " << edge;
    }
  };
  expect_same(made);
  expect_same(loaded);
  const Map copy = loaded;
  expect_same(copy);
  std::swap(loaded.landmarks[10].offset_m, loaded.landmarks[13].offset_m);  // of one edge
  expect_same(loaded);
  loaded.landmarks.push_back({301, LandmarkKind::mast, 2, 5, 3, 0.2, ""});
  expect_same(loaded);
  std::erase_if(loaded.landmarks, [](const Landmark& mark) { return mark.edge == 1; });
  expect_same(loaded);
  loaded.landmarks.clear();
  expect_same(loaded);
}

TEST(Map, ParsesPositions) {
  const Map map = small_map();
  EXPECT_EQ(map.parse_position("1:300").value().edge, 1U);
  EXPECT_EQ(map.parse_position("siding:20.5:-").value().edge, 3U);
  EXPECT_EQ(map.parse_position("siding:20.5:-").value().direction, Direction::reverse);
  EXPECT_DOUBLE_EQ(map.parse_position("siding:20.5:+").value().offset_m, 20.5);
  const double end_m = map.edge(3)->alignment.length_m();
  const auto as_written = map.parse_position("3:" + std::to_string(end_m + 0.0005));
  ASSERT_TRUE(as_written.ok()) << "a length is written to the millimetre";
  EXPECT_EQ(as_written.value().offset_m, end_m);
  for (const char* bad :
       {"", ":", "1", "1:", ":5", "1:x", "1:5:", "1:5:*", "1:-5", "1:1001", "4:0", "0:0", "1:nan", "1:5 "}) {
    EXPECT_FALSE(map.parse_position(bad).ok()) << bad;
  }
}

TEST(Map, WhatMeansSeveralEdgesIsRefused) {
  Map map = small_map();
  map.edges[2].name = "2";
  const auto said = [&](const char* text) { return map.parse_position(text).error().message; };
  EXPECT_EQ(said("2:10"),
            "\"2\" is the number of one edge and the name of another; write one of edge/2, edge/3 instead");
  EXPECT_EQ(map.parse_position("edge/2:10").value().edge, 2U);
  EXPECT_EQ(map.parse_position("edge/3:10:-").value().edge, 3U);
  EXPECT_EQ(map.edge_text(2), "edge/2");
  EXPECT_EQ(map.edge_text(3), "3");
  map.edges[1].name = map.edges[0].name = "main";
  EXPECT_EQ(said("main:10"), "\"main\" is the name of 2 edges; write one of edge/1, edge/2 instead");
  EXPECT_FALSE(map.parse_position("edge/4:10").ok());
  map.edges[2].name = "3";
  EXPECT_EQ(map.parse_position("3:10").value().edge, 3U) << "its number and its name";
}

// Pieces may lie anywhere in the map; a line of the same name elsewhere does not go on.
TEST(Map, PlacesCountOnOverPiecesThatMeet) {
  Map map = small_map();
  map.edges[1].name = "siding#2";
  EXPECT_EQ(map.parse_position("siding:600").value().edge, 2U);
  EXPECT_DOUBLE_EQ(map.parse_position("siding:600").value().offset_m, 100);
  EXPECT_FALSE(map.parse_position("siding:1301").ok());
  map.edges[2].name = "main#2";  // drawn towards the switch
  EXPECT_FALSE(map.parse_position("main:1100").ok());
}

TEST(Map, KnowsLandmarksOfAnEdgeInOrder) {
  const Map map = small_map();
  const auto found = map.landmarks_on(1);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0]->id, 3U);
  EXPECT_EQ(map.landmark(0), nullptr);
  EXPECT_EQ(map.edge(4), nullptr);
}

TEST(Map, APortalInIsAPortalOutTheOtherWay) {
  using Kind = LandmarkKind;
  EXPECT_EQ(seen_along(Kind::portal_in, true), Kind::portal_in);
  EXPECT_EQ(seen_along(Kind::portal_in, false), Kind::portal_out);
  EXPECT_EQ(seen_along(Kind::portal_out, false), Kind::portal_in);
  EXPECT_EQ(seen_along(Kind::mast, false), Kind::mast);
}

TEST(Map, NamesOfLandmarkKindsGoBothWays) {
  for (int kind = 0; kind <= static_cast<int>(LandmarkKind::underbridge); ++kind) {
    EXPECT_EQ(landmark_kind_from(to_string(static_cast<LandmarkKind>(kind))), static_cast<LandmarkKind>(kind));
  }
  EXPECT_FALSE(landmark_kind_from("tree"));
}

// The old observatory in Bern: the origin of the Swiss grid, published by swisstopo to 0.01" and better.
TEST(Map, ProjectsTheSwissOrigin) {
  const Map map = small_map();
  const auto bern = map.to_geo(2600000, 1200000);
  ASSERT_TRUE(bern);
  EXPECT_NEAR(bern->lat_deg, 46.0 + 57.0 / 60 + 3.9 / 3600, 2e-5);
  EXPECT_NEAR(bern->lon_deg, 7.0 + 26.0 / 60 + 19.1 / 3600, 2e-5);
  const auto back = map.from_geo(*bern);
  ASSERT_TRUE(back);
  EXPECT_NEAR(back->x(), 2600000, 5e-3);  // the datum shift is without height
  EXPECT_NEAR(back->y(), 1200000, 5e-3);
}

TEST(Map, HasNoGeographyWithoutASystem) {
  Map map = small_map();
  map.crs = "";
  EXPECT_FALSE(map.to_geo(0, 0));
  map.crs = "EPSG:99999999";
  EXPECT_FALSE(map.to_geo(0, 0));
  map.crs = "EPSG:4326";  // degrees are not metres
  EXPECT_FALSE(map.to_geo(0, 0));
}

TEST(Projection, TakesPlanesInMetresOnly) {
  for (const char* crs : {"EPSG:2263", "EPSG:2263+5703", "EPSG:4326", "EPSG:4326+5773", "EPSG:9518", "EPSG:4979",
                          "EPSG:4978", "EPSG:5773", "+proj=utm +zone=32 +units=us-ft +type=crs", "no system"}) {
    const auto opened = Projection::open(crs);
    ASSERT_FALSE(opened.ok()) << crs;
    EXPECT_THAT(opened.error().message, HasSubstr("is not a coordinate system in metres that PROJ knows")) << crs;
  }
  for (const char* crs : {"EPSG:2056", "EPSG:2056+5728", "EPSG:31468", "EPSG:25832+7837",
                          "+proj=tmerc +lat_0=47 +lon_0=8 +k=1 +ellps=WGS84 +units=m +no_defs +type=crs",
                          "+proj=tmerc +lat_0=47 +lon_0=8 +ellps=bessel +towgs84=600,100,400 +type=crs"}) {
    EXPECT_TRUE(Projection::open(crs).ok()) << crs;
  }
  // Heights change nothing in the plane.
  const GeoPoint bern{.lat_deg = 46.951, .lon_deg = 7.4386};
  const auto flat = core::value_or_throw(Projection::open("EPSG:2056")).from_geo(bern).value();
  const auto high = core::value_or_throw(Projection::open("EPSG:2056+5728")).from_geo(bern).value();
  EXPECT_NEAR((flat - high).norm(), 0, 5e-3);
}

TEST(Map, ProjectsInManyThreadsAtOnce) {
  const Map map = small_map();
  std::vector<std::thread> threads;
  threads.reserve(4);
  std::atomic<int> wrong = 0;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < 200; ++i) {
        const double east = 2600000 + 1000 * t + i;
        const auto geo = map.to_geo(east, 1200000);
        if (!geo || std::abs(map.from_geo(*geo)->x() - east) > 5e-3) ++wrong;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

TEST(Utm, FindsTheZone) {
  EXPECT_EQ(utm_crs({.lat_deg = 48.2, .lon_deg = 15.6}), "EPSG:32633");
  EXPECT_EQ(utm_crs({.lat_deg = -33.9, .lon_deg = 18.4}), "EPSG:32734");
  EXPECT_EQ(utm_crs({.lat_deg = 0, .lon_deg = 180}), "EPSG:32660");
}

// Whoever draws or searches along it would not come back.
TEST_F(MapFile, RefusesElementsThatTurnOnAndOn) {
  Map map = small_map();
  map.edges[0].alignment = Alignment::chained({}, {{1000, -0.1, 0.1}});
  EXPECT_THAT(map.save(file()).error().message, HasSubstr("edge 1 has an element that turns round several times"));
  map.edges[0].alignment = Alignment::chained({}, {{1000, 0.01, 0.01}});  // a spiral ramp of less than two rounds
  EXPECT_TRUE(map.save(file()).ok());
}

TEST_F(MapFile, NamesGiveATerminalNoOrdersWhoeverWroteThem) {
  ASSERT_TRUE(small_map().save(file()).ok());
  std::string text = content();
  for (const std::string name : {"main", "line 1", "W1", "tunnel", "small"}) {
    for (size_t at = text.find(name); at != std::string::npos; at = text.find(name, at)) text[at] = '\x1B';
  }
  write(text);
  const Map map = core::value_or_throw(Map::load(file()));
  EXPECT_EQ(map.edges[0].name, "?ain");
  EXPECT_EQ(map.edges[0].line, "?ine 1");
  EXPECT_EQ(map.nodes[1].name, "?1");
  EXPECT_EQ(map.landmarks[1].name, "?unnel");
  EXPECT_EQ(map.name, "?mall");
}

TEST_F(MapFile, NothingLiesBeyondAnEndByRounding) {
  Map map = small_map();
  map.landmarks[0].offset_m = 1000.0009;
  map.landmarks[2].offset_m = -0.0009;
  map.balise_groups[0].offset_m = 1000.0009;
  ASSERT_TRUE(map.save(file()).ok());
  const Map read = core::value_or_throw(Map::load(file()));
  EXPECT_EQ(read.landmarks[0].offset_m, 1000);
  EXPECT_EQ(read.landmarks[2].offset_m, 0);
  EXPECT_EQ(read.balise_groups[0].offset_m, 1000);
}

}  // namespace
}  // namespace railfix::track
