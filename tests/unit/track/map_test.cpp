#include "track/map.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
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

TEST(Map, ParsesPositions) {
  const Map map = small_map();
  EXPECT_EQ(map.parse_position("1:300").value().edge, 1U);
  EXPECT_EQ(map.parse_position("siding:20.5:-").value().edge, 3U);
  EXPECT_EQ(map.parse_position("siding:20.5:-").value().direction, Direction::reverse);
  EXPECT_DOUBLE_EQ(map.parse_position("siding:20.5:+").value().offset_m, 20.5);
  for (const char* bad :
       {"", ":", "1", "1:", ":5", "1:x", "1:5:", "1:5:*", "1:-5", "1:1001", "4:0", "0:0", "1:nan", "1:5 "}) {
    EXPECT_FALSE(map.parse_position(bad).ok()) << bad;
  }
}

TEST(Map, KnowsLandmarksOfAnEdgeInOrder) {
  const Map map = small_map();
  const auto found = map.landmarks_on(1);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0]->id, 3U);
  EXPECT_EQ(map.landmark(0), nullptr);
  EXPECT_EQ(map.edge(4), nullptr);
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

TEST(Map, ProjectsInManyThreadsAtOnce) {
  const Map map = small_map();
  std::vector<std::thread> threads;
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

}  // namespace
}  // namespace railfix::track
