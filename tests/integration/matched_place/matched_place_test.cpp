// Which place a train_state means: map_matcher reads a map file of its own and follows a path of its own. Where it took
// the state for another place, it would confirm a wrong one with the landmarks that stand there.
#include <gmock/gmock.h>

#include <set>

#include "core/random.hpp"
#include "support/on_map_matcher.hpp"
#include "track/ways.hpp"

namespace railfix {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using track::Direction;
using track::EdgePosition;

constexpr int kDomain = 76;
constexpr double kSpeedMps = 10;
constexpr double kPromisedM = 25;

/// Straight northwards.
track::Map line(double length_m, double begin_m = 0) {
  track::Map map;
  map.edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, begin_m, 0}, {{length_m, 0, 0}})});
  return map;
}

class MatchedPlace : public ::testing::Test, public test::OnMapMatcher {
 protected:
  MatchedPlace() : OnMapMatcher("matched-place", kDomain, {.speed_mps = kSpeedMps, .begin_m = 500}) {}

  /// The next state of the train, with its coordinates on the map that fusion has.
  void tick(const track::Map& map, const EdgePosition& place, double promised_m = kPromisedM) {
    ++tick_;
    msg::TrainState here = state(place, promised_m);
    const auto said = last_of_track();
    if (said && said->stamp_ns() > placeless_ns_) here.track_probability(said->probability());  // as fusion believes it
    const auto pose = track::cab_pose(map, place);
    here.easting_m(pose.easting_m);
    here.northing_m(pose.northing_m);
    here.heading_rad(pose.heading_rad);
    states_.write(here);
    steps_.write(step());
    match();
  }
  /// Fusion has given the place up.
  void tick_without_place() {
    ++tick_;
    msg::TrainState nowhere = state({0, 0, Direction::unknown}, kPromisedM);
    nowhere.track_known(0);
    placeless_ns_ = nowhere.stamp_ns();
    states_.write(nowhere);
    steps_.write(step());
    match();
  }
  void sight(double ahead_m, uint8_t kind = msg::SIGHTING_BRIDGE) {
    msg::LandmarkSighting seen;
    seen.stamp_ns(stamp_ns(tick_));
    seen.kind(kind);
    seen.distance_ahead_m(ahead_m);
    seen.sigma_m(0.3);
    seen.confidence(0.95);
    sightings_.write(seen);
    match();
  }
  [[nodiscard]] std::vector<msg::PositionFix> landmark_fixes() const {
    std::vector<msg::PositionFix> fixes;
    for (const auto& fix : said_)
      if (fix.kind() == msg::FIX_LANDMARK) fixes.push_back(fix);
    return fixes;
  }
  [[nodiscard]] std::optional<msg::PositionFix> last_of_track() const {
    const auto last =
        std::find_if(said_.rbegin(), said_.rend(), [](const auto& fix) { return fix.kind() == msg::FIX_TRACK; });
    return last == said_.rend() ? std::nullopt : std::optional(*last);
  }
  int64_t placeless_ns_ = 0;  // fusion knew no place then
  /// What it says of itself by now; a status is no data, no turn waits for it.
  [[nodiscard]] std::string reason() {
    const int64_t now_ns = core::wall_ns();
    EXPECT_TRUE(run_until([&] { return status("map_matcher").stamp_ns() > now_ns; }));
    return status("map_matcher").reason().c_str();
  }
};

TEST_F(MatchedPlace, AStateOfAnotherMapIsNone) {
  track::Map own = line(2000);
  own.landmarks = {{1, track::LandmarkKind::bridge, 1, 600, 0, 0.1, ""}};
  const track::Map of_fusion = line(2000, 9000);  // the edges are numbered anew
  ASSERT_TRUE(start_matcher(own));
  const auto ride = [&](const track::Map& map, double seconds) {
    for (double t_s = 0; t_s < seconds; t_s += kPeriodS) {
      tick(map, {1, way_m()});
      sight(600 - way_m());
    }
  };
  ride(of_fusion, 1);
  EXPECT_THAT(reason(), HasSubstr("of another map"));
  const int64_t of_fusion_ns = stamp_ns(tick_);
  // Fusion was given the same file.
  ride(own, 1);
  ASSERT_FALSE(landmark_fixes().empty());
  for (const auto& fix : said_) EXPECT_GT(fix.stamp_ns(), of_fusion_ns) << "a fix of kind " << int{fix.kind()};
  const auto fix = landmark_fixes().front();
  EXPECT_NEAR(fix.offset_m(), way_m(fix.stamp_ns()), 0.5);
  EXPECT_EQ(reason(), "");
}

// The driver has gone to the other cab: what stands behind the place along the edge is in front of the train.
TEST_F(MatchedPlace, ATurnedTrainIsOnAnotherTrip) {
  track::Map map = line(2000);
  map.landmarks = {{1, track::LandmarkKind::bridge, 1, 498, 0, 0.1, ""}};
  ASSERT_TRUE(start_matcher(map));
  for (int i = 0; i < 10; ++i) tick(map, {1, way_m(), Direction::forward});
  const auto turned = [&](int64_t stamp_ns) { return 510 - (way_m(stamp_ns) - 510); };
  for (int i = 0; i < 10; ++i) {
    tick(map, {1, turned(stamp_ns(tick_ + 1)), Direction::reverse});
    sight(turned(stamp_ns(tick_)) - 498);
  }
  ASSERT_FALSE(landmark_fixes().empty());
  for (const auto& fix : landmark_fixes()) {
    EXPECT_EQ(fix.direction(), msg::DIRECTION_REVERSE);
    EXPECT_NEAR(fix.offset_m(), turned(fix.stamp_ns()), 0.5);
  }
}

/// Masts every 40 to 65 m on a straight track; the start was told 2.2 km too far back, or rightly.
class ToldStart : public MatchedPlace {
 protected:
  static constexpr double kPromisedStartM = 5;
  void SetUp() override {
    core::Random random(5);
    map_ = line(6000);
    for (double m = 300; m < 6000; m += random.uniform(40, 65))
      map_.landmarks.push_back(
          {static_cast<uint32_t>(map_.landmarks.size() + 1), track::LandmarkKind::mast, 1, m, 0, 0.1, ""});
    ASSERT_TRUE(start_matcher(map_));
  }
  void ride(double way_m, double told_off_m) {
    const double end_m = this->way_m() + way_m;
    auto mast = std::ranges::find_if(map_.landmarks, [&](const auto& one) { return one.offset_m > this->way_m() + 5; });
    while (this->way_m() < end_m) {
      tick(map_, {1, this->way_m() + told_off_m}, kPromisedStartM);
      if (mast->offset_m - this->way_m() > 5) continue;
      sight(mast->offset_m - this->way_m(), msg::SIGHTING_MAST);
      ++mast;
    }
  }
  [[nodiscard]] bool said_lately() const { return !said_.empty() && said_.back().stamp_ns() > stamp_ns(tick_ - 12); }

  track::Map map_;
};
class ToldStartWrongOrRight : public ToldStart, public ::testing::WithParamInterface<bool> {};

TEST_P(ToldStartWrongOrRight, IsDoubtedWhereTheMastsFitTheMapNowhereNearIt) {
  const bool wrong = GetParam();
  ride(600, wrong ? 2200 : 0);
  ASSERT_TRUE(said_lately());
  ASSERT_TRUE(last_of_track());
  if (wrong) {
    EXPECT_LT(last_of_track()->probability(), 0.5);
    EXPECT_EQ(last_of_track()->sightings_fit(), msg::SIGHTINGS_FIT_NOWHERE);
    EXPECT_LE(landmark_fixes().size(), 3U) << "of about eleven masts";
    EXPECT_THAT(reason(), HasSubstr("fit the map nowhere"));
    // And not in turns with "active": the dashboard would flicker.
    std::set<std::string> said;
    listen(messaging::topics::service_status, [&](const msg::ServiceStatus& status) {
      if (status.service() == "map_matcher") said.insert(status.reason().c_str());
    });
    ride(50, 2200);
    EXPECT_THAT(reason(), HasSubstr("fit the map nowhere"));
    EXPECT_THAT(said, ElementsAre(HasSubstr("fit the map nowhere")));
  } else {
    EXPECT_GT(last_of_track()->probability(), 0.999);
    EXPECT_EQ(last_of_track()->sightings_fit(), msg::SIGHTINGS_FIT_NOT_TOLD);
    EXPECT_GT(landmark_fixes().size(), 8U);
    EXPECT_EQ(reason(), "");
  }
}

TEST_F(ToldStart, DoubtEndsWhereTheMastsFitThoughTheTrackIsChosenAnewMeanwhile) {
  ride(600, 2200);
  ASSERT_TRUE(last_of_track());
  ASSERT_LT(last_of_track()->probability(), 0.5);
  tick_ += 400;  // the computer was busy for so long that nobody knows which way the train has taken
  ride(600, 0);  // the operator has mended his word
  ASSERT_TRUE(said_lately());
  EXPECT_GT(last_of_track()->probability(), 0.999);
}

TEST_F(ToldStart, IsForgottenWhereFusionGivesThePlaceUp) {
  ride(600, 2200);
  ASSERT_TRUE(last_of_track());
  ASSERT_EQ(last_of_track()->sightings_fit(), msg::SIGHTINGS_FIT_NOWHERE);
  for (int i = 0; i < 10; ++i) tick_without_place();
  EXPECT_THAT(reason(), HasSubstr("not known yet"));
  ride(30, 0);  // found again
  ASSERT_TRUE(said_lately());
  EXPECT_EQ(last_of_track()->sightings_fit(), msg::SIGHTINGS_FIT_NOT_TOLD);
  EXPECT_GT(last_of_track()->probability(), 0.99);
}

INSTANTIATE_TEST_SUITE_P(Starts, ToldStartWrongOrRight, ::testing::Bool());

}  // namespace
}  // namespace railfix
