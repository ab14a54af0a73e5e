// Many switches in a row, as in a station's throat.
#include <gtest/gtest.h>

#include <memory>

#include "map_matcher/track_choice/track_chooser.hpp"
#include "track/declared.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {
namespace {

constexpr auto kForward = track::Direction::forward;
constexpr double kStemM = 500;
constexpr double kLegM = 20;

/// A stem of 500 m, and behind it switch upon switch, a straight leg and a left one each: 2^levels ways.
std::shared_ptr<const track::Map> tree(int levels) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "stem", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{kStemM, 0, 0}})});
  std::vector<uint32_t> ends{1};
  for (int level = 0; level < levels; ++level) {
    const double length_m = level + 1 < levels ? kLegM : 2000;
    std::vector<uint32_t> next;
    for (const uint32_t from : ends) {
      const auto node = map->edges[from - 1].to_node;
      const auto& before = map->edges[from - 1].alignment;
      const auto pose = before.at(before.length_m()).pose;
      for (const bool left : {false, true}) {
        const auto id = static_cast<uint32_t>(map->edges.size() + 1);
        map->edges.push_back({id, "leg", node, id + 1, "",
                              track::Alignment::chained(pose, {{length_m, left ? 0.003 : 0, left ? 0.003 : 0}})});
        map->connections.push_back({node, from, id, left});
        next.push_back(id);
      }
    }
    ends = next;
  }
  return map;
}

// Fusion says how far the train may be off: nearly all ways are open at once, and more than can be followed.
TEST(SwitchLadder, WhatIsGivenUpForLackOfRoomIsNotKnown) {
  const auto map = tree(10);
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  double least = 1;
  for (double place_m = 300; place_m < 460; place_m += 1) {
    chooser.follow({{1, place_m, kForward}, 250, 250, 60});
    chooser.move({1, 0, 1e-4});
    ASSERT_TRUE(chooser.choice());
    least = std::min(least, chooser.choice()->options.front().probability);
  }
  EXPECT_LT(least, track::kDeclaredProbability);
}

// In the dark all ways of a fan are alike: none of them is given up without being told, and those that are left are no
// more probable for it.
TEST(SwitchLadder, OfWaysThatAreAlikeNoneGoesUntold) {
  auto made = std::make_shared<track::Map>(*tree(9));
  const auto straight = static_cast<uint32_t>(made->edges.size() + 1);  // 1 of 3 ways at the end of the stem
  made->edges.push_back(
      {straight, "straight", 2, straight + 1, "", track::Alignment::chained({0, kStemM, 0}, {{9000, 0, 0}})});
  made->connections.push_back({2, 1, straight, false});
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  for (double place_m = 450; place_m < 720; place_m += 2) {
    const uint32_t edge = place_m < kStemM ? 1 : straight;
    chooser.follow({{edge, edge == 1 ? place_m : place_m - kStemM, kForward}, 4, 4, 1});
    chooser.move_blind(2);
  }
  const auto choice = chooser.choice();
  ASSERT_TRUE(choice);
  double kept = 0;
  for (const auto& option : choice->options) {
    kept += option.probability;
    if (option.place.edge == straight) {
      EXPECT_NEAR(option.probability, 1.0 / 3, 0.01);
    }
  }
  EXPECT_NEAR(kept, 1.0 / 3 + 2.0 / 3 * 199 / 512, 0.02) << "200 of 513 ways";
}

// Twelve loops, one behind the other, of legs that are alike: 4096 ways, but never more than two at once.
TEST(SwitchLadder, WaysThatHaveMetInTheDarkAreOne) {
  auto made = std::make_shared<track::Map>();
  const auto straight = [](double from_m, double length_m) {
    return track::Alignment::chained({0, from_m, 0}, {{length_m, 0, 0}});
  };
  made->edges.push_back({1, "stem", 1, 2, "", straight(0, kStemM)});
  constexpr double kLoopM = 50;
  for (uint32_t loop = 0; loop < 12; ++loop) {
    const uint32_t on = 1 + 3 * loop;
    const uint32_t node = 2 + 2 * loop;
    const double from_m = kStemM + 2 * kLoopM * loop;
    made->edges.push_back({on + 1, "right", node, node + 1, "", straight(from_m, kLoopM)});
    made->edges.push_back({on + 2, "left", node, node + 1, "", straight(from_m, kLoopM)});
    made->edges.push_back({on + 3, "on", node + 1, node + 2, "", straight(from_m + kLoopM, loop < 11 ? kLoopM : 2000)});
    made->connections.insert(made->connections.end(), {{node, on, on + 1, false},
                                                       {node, on, on + 2, true},
                                                       {node + 1, on + 1, on + 3, false},
                                                       {node + 1, on + 2, on + 3, true}});
  }
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  const auto way = track::Path::follow(map, {1, 0, kForward}, 3000, 0);
  ASSERT_TRUE(way.ok());
  for (double place_m = 450; place_m < 1900; place_m += 2) {
    chooser.follow({way.value().position_at(place_m), 4, 4, 1});
    chooser.move_blind(2);
    ASSERT_TRUE(chooser.choice());
    EXPECT_LE(chooser.choice()->options.size(), 2U) << place_m;
  }
  EXPECT_GT(chooser.choice()->options.front().probability, track::kDeclaredProbability);
}

// Behind the points the train turns left, and then nobody can tell which of two legs it is on. Fusion goes on along the
// straight way until one is declared: that is no reason to begin there anew and forget what was measured.
TEST(SwitchLadder, WhileNothingIsDeclaredTheStraightWayOfFusionIsNotBelieved) {
  auto made = std::make_shared<track::Map>();
  made->edges.push_back({1, "stem", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{kStemM, 0, 0}})});
  const track::PlanPose switch_pose{0, kStemM, 0};
  made->edges.push_back({2, "straight", 2, 3, "", track::Alignment::chained(switch_pose, {{800, 0, 0}})});
  made->edges.push_back({3, "left", 2, 4, "", track::Alignment::chained(switch_pose, {{60, 0.003, 0.003}})});
  const auto pose = made->edges[2].alignment.at(60).pose;
  for (const uint32_t id : {4U, 5U})  // alike, as far as anybody can measure
    made->edges.push_back({id, "alike", 4, id + 1, "", track::Alignment::chained(pose, {{600, 0, 0}})});
  made->connections = {{2, 1, 2, false}, {2, 1, 3, true}, {4, 3, 4, false}, {4, 3, 5, true}};
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  for (double place_m = 450; place_m < 900; place_m += 1) {
    const bool behind = place_m > kStemM;
    chooser.follow({{behind ? 2U : 1U, behind ? place_m - kStemM : place_m, kForward}, 1, 1, 0.3});
    chooser.move({1, place_m > kStemM && place_m < kStemM + 60 ? 0.003 : 0, 1e-4});
    if (place_m < 620) continue;
    const auto choice = chooser.choice();
    ASSERT_TRUE(choice);
    for (const auto& option : choice->options)
      EXPECT_TRUE(option.place.edge != 2 || option.probability < 0.01) << place_m;
    EXPECT_FALSE(choice->known) << place_m;
  }
}

}  // namespace
}  // namespace railfix::map_matcher
