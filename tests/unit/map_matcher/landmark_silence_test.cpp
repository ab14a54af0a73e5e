#include "map_matcher/landmark_silence.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/time.hpp"
#include "map_matcher/map_matcher.hpp"
#include "unit/map_matcher/marked_line.hpp"

namespace railfix::map_matcher {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using track::LandmarkKind;

std::shared_ptr<const track::Map> line_with(LandmarkKind kind, double every_m) {
  std::vector<std::pair<LandmarkKind, double>> landmarks;
  for (double offset_m = 0.5 * every_m; offset_m < 20000; offset_m += every_m) landmarks.emplace_back(kind, offset_m);
  return marked_line(landmarks);
}

class Silence : public ::testing::Test {
 protected:
  void map(LandmarkKind kind, double every_m) {
    path_ = path_along(line_with(kind, every_m));
    run_to(0);
  }
  void run_to(double place_m, bool rails_in_sight = true) { silence_.run_on(*path_, place_m, rails_in_sight); }
  void sight(LandmarkKind kind, double place_m) {
    silence_.sight(*path_, {1, kind, 5, 0, 0.1, 0.98}, {place_m - 5, 3, 3, place_m});
  }
  std::shared_ptr<const track::Path> path_;
  LandmarkSilence silence_;
};

TEST_F(Silence, IsSaidBehindSixLandmarksAndTwoKilometres) {
  map(LandmarkKind::frog, 1000);
  run_to(5400);
  EXPECT_THAT(silence_.trouble(), IsEmpty());
  run_to(5600);
  EXPECT_THAT(silence_.trouble(), HasSubstr("of 6 landmarks that the map has on the last 5.1 km none was sighted"));
  silence_ = {};
  map(LandmarkKind::mast, 50);
  run_to(2000);
  EXPECT_THAT(silence_.trouble(), IsEmpty());
  run_to(2100);
  EXPECT_THAT(silence_.trouble(), HasSubstr("of 42 landmarks"));
}

// Nothing stands on the 2 km before a station: that is no silence of 2 km.
TEST_F(Silence, IsNotOfOneStationNorOfOneGroup) {
  map(LandmarkKind::frog, 200);
  run_to(5050, false);
  silence_.begin_way();
  run_to(5050);
  run_to(6300);
  EXPECT_THAT(silence_.trouble(), IsEmpty());
  silence_ = {};
  map(LandmarkKind::balise, 3);  // one after the other is one thing
  run_to(9000);
  EXPECT_THAT(silence_.trouble(), IsEmpty());
}

TEST_F(Silence, CountsWhatIsPassedOnceHoweverOftenThePlaceIsCorrected) {
  map(LandmarkKind::frog, 1000);
  for (double place_m = 10; place_m < 5400; place_m += 10) {
    run_to(place_m);
    run_to(place_m - 15);
  }
  EXPECT_THAT(silence_.trouble(), IsEmpty());
  run_to(5600);
  EXPECT_THAT(silence_.trouble(), HasSubstr("of 6 landmarks that the map has on the last 5.1 km"));
}

TEST_F(Silence, EndsWithASightingOfWhatTheMapHasThere) {
  map(LandmarkKind::frog, 1000);
  run_to(7000);
  sight(LandmarkKind::balise, 7500);
  sight(LandmarkKind::frog, 7100);
  EXPECT_THAT(silence_.trouble(), HasSubstr("of 7 landmarks"));
  sight(LandmarkKind::frog, 7505);
  EXPECT_THAT(silence_.trouble(), IsEmpty());
  run_to(13400);  // 7,500 was sighted, before it was passed
  EXPECT_THAT(silence_.trouble(), IsEmpty());
  run_to(13600);
  EXPECT_THAT(silence_.trouble(), HasSubstr("of 6 landmarks"));
}

TEST_F(Silence, IsNotOfDarknessNorOfAWayBackNorOfAnotherPath) {
  map(LandmarkKind::frog, 200);
  run_to(4000, false);
  EXPECT_THAT(silence_.trouble(), IsEmpty());
  run_to(0);
  EXPECT_THAT(silence_.trouble(), IsEmpty());
  silence_.begin_way();
  run_to(5000);
  EXPECT_THAT(silence_.trouble(), IsEmpty());
}

// Cameras tell no level crossing.
TEST_F(Silence, IsNotOfWhatNoCameraTells) {
  map(LandmarkKind::level_crossing, 200);
  run_to(10000);
  EXPECT_THAT(silence_.trouble(), IsEmpty());
}

TEST(MapMatcherSilence, IsItsTroubleWhileRailsAreSeenAndUntilALandmarkIsSighted) {
  MapMatcher matcher({}, line_with(LandmarkKind::frog, 400));
  auto ride = [&, at_m = 10.0](double to_m, bool rails_seen) mutable {
    for (; at_m < to_m; at_m += 5) {
      const int64_t stamp_ns = core::to_ns(1 + at_m / 25);
      if (rails_seen) matcher.add(ViewInput{0, 1e-9, stamp_ns});
      StateInput state;
      state.placed = {stamp_ns, {1, at_m, track::Direction::forward}, 25, at_m, 3, 3};
      state.sigma_m = 0.7;
      state.track_probability = 1;
      state.pose.northing_m = at_m;
      matcher.add(state);
    }
    return core::to_ns(1 + (at_m - 5) / 25);
  };
  ride(4000, false);
  EXPECT_THAT(matcher.trouble(), IsEmpty());
  int64_t stamp_ns = ride(6900, true);
  EXPECT_THAT(matcher.trouble(), HasSubstr("none was sighted"));
  matcher.add(Sighting{stamp_ns, LandmarkKind::frog, 5, 0, 0.1, 0.98});
  ride(6950, true);
  EXPECT_THAT(matcher.trouble(), HasSubstr("none was sighted")) << "there is none";
  stamp_ns = ride(6996, true);
  matcher.add(Sighting{stamp_ns, LandmarkKind::frog, 5, 0, 0.1, 0.98});
  ride(7010, true);
  EXPECT_THAT(matcher.trouble(), IsEmpty());
}

}  // namespace
}  // namespace railfix::map_matcher
