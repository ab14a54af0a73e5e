// A map that lacks a piece of track: from there on every place is wrong by its length. The landmarks that are sighted
// say so, by the real landmark matcher, and show the train where it is.
#include <gtest/gtest.h>

#include "core/random.hpp"
#include "map_matcher/landmark_matcher.hpp"
#include "straight_run.hpp"

namespace railfix::fusion::lost_place_test {
namespace {

constexpr double kPeriodS = 0.1;
constexpr double kSpeedMps = 25;
constexpr double kAheadM = 8;  // of the foot a mast is sighted
constexpr double kLackM = 1500;

/// Masts every 40 to 65 m, of which the camera sees four of five.
class MastRide {
 public:
  /// The map lacks so much behind kLackM; negative: it has so much that is not there.
  MastRide(double lacks_m, uint64_t seed) : lacks_m_(lacks_m), random_(seed) {
    auto map = std::make_shared<track::Map>(*straight_line());
    for (double m = 100; m < 6000; m += random_.uniform(40, 65)) {
      const double stands_m = m < kLackM ? m : m + lacks_m;
      masts_m_.push_back(stands_m);
      map->landmarks.push_back({static_cast<uint32_t>(masts_m_.size()), track::LandmarkKind::mast, 1,
                                m + 0.1 * random_.normal(), 3, 0.15, ""});
    }
    const track::EdgePosition start{1, 0, track::Direction::forward};
    path_ = std::make_shared<const track::Path>(core::value_or_throw(track::Path::follow(map, start, 20000, 0)));
    matcher_.emplace(map_matcher::LandmarkParameters{}, path_);
    fusion_.emplace(core::value_or_throw(Fusion::create({.camera_lag_s = kAnyLagS}, map, start)));
  }

  void run_to(double place_m) {
    while (place_m_ < place_m) step();
  }
  [[nodiscard]] const TrainEstimate& state() const { return state_; }
  /// What it is on the map.
  [[nodiscard]] double truth_m() const { return place_m_ < kLackM ? place_m_ : place_m_ - lacks_m_; }
  [[nodiscard]] bool is_inside() const {
    const double error_m = state_.position.offset_m - truth_m();
    return error_m <= state_.over_m && -error_m <= state_.under_m;
  }
  /// Where map_matcher doubted the place first, and where the state was ok again behind that.
  [[nodiscard]] std::optional<double> doubted_at_m() const { return doubted_at_m_; }
  [[nodiscard]] std::optional<double> ok_again_at_m() const { return ok_again_at_m_; }
  /// States from a second behind the doubt on.
  [[nodiscard]] int outside() const { return outside_; }

 private:
  void step() {
    t_s_ += kPeriodS;
    place_m_ += kSpeedMps * kPeriodS;
    fusion_->add(wheel_at(t_s_, place_m_ / 1.004));
    state_ = fusion_->add(step_at(t_s_, kSpeedMps / 1.002, kPeriodS)).value_or(state_);
    while (next_ < masts_m_.size() && masts_m_[next_] < place_m_ + kAheadM) sight(masts_m_[next_++]);
    say_track();
    if (!doubted_at_m_ || place_m_ < *doubted_at_m_ + kSpeedMps) return;
    outside_ += is_inside() ? 0 : 1;
    if (!ok_again_at_m_ && state_.integrity == Integrity::ok) ok_again_at_m_ = place_m_;
  }
  void sight(double mast_m) {
    if (random_.uniform() < 0.2) return;
    const double ahead_m = mast_m - place_m_ + 0.1 * random_.normal();
    const auto fix = matcher_->add({at(t_s_), track::LandmarkKind::mast, ahead_m, 3, 0.15, 0.95},
                                   {state_.path_distance_m, state_.over_m, state_.under_m, state_.distance_m});
    if (!fix) return;
    auto input = fix_at(t_s_, fix->path_distance_m, fix->landmark, fix->probability);
    input.sightings_fit = static_cast<SightingsFit>(fix->sightings_fit);
    fusion_->add(input);
  }
  // As map_matcher's service does it.
  void say_track() {
    const double elsewhere = matcher_->place_doubt();
    if (elsewhere > 0 && !doubted_at_m_) doubted_at_m_ = place_m_;
    fusion_->add(FixInput{at(t_s_), 1, state_.position.offset_m, INFINITY, 1 - elsewhere, 0, FixKind::track,
                          track::Direction::forward, nullptr,
                          elsewhere > 0 ? SightingsFit::nowhere : SightingsFit::not_told});
  }

  double lacks_m_;
  core::Random random_;
  std::vector<double> masts_m_;
  std::shared_ptr<const track::Path> path_;
  std::optional<map_matcher::LandmarkMatcher> matcher_;
  std::optional<Fusion> fusion_;
  TrainEstimate state_;
  double t_s_ = 0;
  double place_m_ = 0;
  size_t next_ = 0;
  std::optional<double> doubted_at_m_;
  std::optional<double> ok_again_at_m_;
  int outside_ = 0;
};

TEST(LostPlace, WhereTheMapLacksAPieceOfTrackTheTrainIsLostUntilTheMastsShowWhereItIs) {
  for (const double lacks_m : {-35.0, 20.0, 44.0, 80.0}) {
    for (uint64_t seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE(std::to_string(lacks_m) + " m, seed " + std::to_string(seed));
      MastRide ride(lacks_m, seed);
      ride.run_to(kLackM - 10);
      EXPECT_FALSE(ride.doubted_at_m());
      EXPECT_EQ(ride.state().integrity, Integrity::ok);
      ride.run_to(kLackM + 2000);
      ASSERT_TRUE(ride.doubted_at_m() && ride.ok_again_at_m());
      std::cout << lacks_m << " m: doubted " << *ride.doubted_at_m() - kLackM << " m behind it, ok again "
                << *ride.ok_again_at_m() - *ride.doubted_at_m() << " m further on\n";
      EXPECT_EQ(ride.outside(), 0);
      EXPECT_LT(ride.state().over_m + ride.state().under_m, 5);
      EXPECT_LT(*ride.ok_again_at_m() - *ride.doubted_at_m(), 1000);
    }
  }
}

TEST(LostPlace, IsOverWithLandmarksOnlyHoweverLittleIsDoubtedAnyMore) {
  auto fusion = fusion_at(900);
  double t_s = 1;
  const auto say = [&](bool fits_nowhere) {
    fusion.add(FixInput{at(t_s), 1, 900 + 20 * t_s, INFINITY, fits_nowhere ? 0.1 : 0.9999, 0, FixKind::track,
                        track::Direction::forward, nullptr,
                        fits_nowhere ? SightingsFit::nowhere : SightingsFit::not_told});
    t_s += 1;
    return run(fusion, t_s - 1, t_s, 20);
  };
  run(fusion, 0, 1, 20);
  EXPECT_EQ(say(false).reason, kOnlyTold);
  auto state = say(true);
  EXPECT_EQ(state.integrity, Integrity::unusable);
  EXPECT_NE(state.reason.find("fits the map nowhere near"), std::string::npos) << state.reason;
  EXPECT_GE(std::min(state.over_m, state.under_m), 100);
  state = say(false);
  EXPECT_EQ(state.reason.find("nowhere"), std::string::npos) << state.reason;
  EXPECT_NE(state.reason.find("waits for a landmark"), std::string::npos) << state.reason;
  EXPECT_GE(std::min(state.over_m, state.under_m), 100);
  for (uint32_t landmark = 1; landmark <= 5; ++landmark, t_s += 3) {
    fusion.add(sure_fix_at(t_s, 900 + 20 * t_s, landmark));
    state = run(fusion, t_s, t_s + 3, 20);
  }
  EXPECT_EQ(state.integrity, Integrity::ok) << state.reason;
  EXPECT_LT(state.under_m, 5);
}

TEST(LostPlace, IsNoneWhereGnssHoldsThePlaceAndTheIntervalHoldsWhatGnssMayBeWrongBy) {
  auto fusion = fusion_at(900);
  TrainEstimate state;
  const auto ride = [&](double from_s, double to_s) {
    for (double t_s = from_s; t_s < to_s; t_s += 1) {
      fusion.add(GnssInput{at(t_s), 0, 900 + 20 * t_s, 1, 1});
      state = run(fusion, t_s, t_s + 1, 20);
    }
  };
  ride(0, 60);
  EXPECT_EQ(state.reason, kToldAndGnss);
  fusion.add(FixInput{at(60), 1, 2100, INFINITY, 0.1, 0, FixKind::track, track::Direction::forward, nullptr,
                      SightingsFit::nowhere});
  EXPECT_EQ(run(fusion, 60, 61, 20).integrity, Integrity::unusable);
  ride(61, 63);
  EXPECT_NE(state.integrity, Integrity::unusable) << state.reason;
  EXPECT_GT(state.under_m, 30);
  EXPECT_LT(state.under_m, 80);
}

}  // namespace
}  // namespace railfix::fusion::lost_place_test
