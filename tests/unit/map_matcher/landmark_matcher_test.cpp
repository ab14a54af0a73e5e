#include "map_matcher/landmark_matcher.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/random.hpp"
#include "core/result.hpp"
#include "track/aside.hpp"
#include "unit/map_matcher/marked_line.hpp"

namespace railfix::map_matcher {
namespace {

using track::LandmarkKind;

std::shared_ptr<const track::Path> line_with(const std::vector<std::pair<LandmarkKind, double>>& landmarks) {
  return path_along(marked_line(landmarks));
}

Sighting sighting_of(LandmarkKind kind, double confidence = 0.98) {
  return {1000, kind, 5.0, 0, 0.2, confidence};
}
Prior prior_at(double place_m, double interval_m, double travelled_m) {
  return {place_m, interval_m, interval_m, travelled_m};
}

TEST(LandmarkMatcher, SaysNothingWhenThePlaceIsNoNumberOrTheIntervalHasNoEnd) {
  for (const Prior& prior :
       {prior_at(NAN, 10, 0), prior_at(495, INFINITY, 0), prior_at(495, NAN, 0), prior_at(495, 10, NAN)}) {
    LandmarkMatcher matcher({}, line_with({{LandmarkKind::balise, 500}}));
    EXPECT_FALSE(matcher.add(sighting_of(LandmarkKind::balise), prior));
    EXPECT_TRUE(matcher.add(sighting_of(LandmarkKind::balise), prior_at(495, 10, 0)));
  }
}

TEST(LandmarkMatcher, FixComesFromMapAndSightingNotFromThePrior) {
  const auto path = line_with({{LandmarkKind::balise, 500}});
  for (const double prior_error_m : {-6.0, 0.0, 7.0}) {
    LandmarkMatcher matcher({}, path);
    const auto fix = matcher.add(sighting_of(LandmarkKind::balise), prior_at(495 + prior_error_m, 10, 0));
    ASSERT_TRUE(fix);
    EXPECT_NEAR(fix->path_distance_m, 495, 1e-9);
    EXPECT_NEAR(fix->sigma_m, std::hypot(0.2, 0.1), 1e-9);
    EXPECT_EQ(fix->landmark, 1U);
    EXPECT_GT(fix->probability, 0.9);
    EXPECT_LT(fix->probability, 0.999);
  }
}

TEST(LandmarkMatcher, SaysNothingOutsideTheWindowOrOfAnotherKind) {
  const auto path = line_with({{LandmarkKind::balise, 500}});
  LandmarkMatcher matcher({}, path);
  EXPECT_FALSE(matcher.add(sighting_of(LandmarkKind::balise), prior_at(450, 10, 0)));
  EXPECT_FALSE(matcher.add(sighting_of(LandmarkKind::frog), prior_at(495, 10, 50)));
}

TEST(LandmarkMatcher, TwoBalisesNearEachOtherAreAmbiguousUntilBothAreSeen) {
  const auto path = line_with({{LandmarkKind::balise, 500}, {LandmarkKind::balise, 503}});
  LandmarkMatcher matcher({}, path);
  const auto first = matcher.add(sighting_of(LandmarkKind::balise), prior_at(495, 6, 100));
  EXPECT_TRUE(!first || first->probability < 0.9);
  const auto second = matcher.add(sighting_of(LandmarkKind::balise), prior_at(498, 6, 103));
  ASSERT_TRUE(second);
  EXPECT_EQ(second->landmark, 2U);
  EXPECT_NEAR(second->path_distance_m, 498, 1e-9);
  EXPECT_GT(second->probability, 0.95);
}

TEST(LandmarkMatcher, EqualMastsWithinTheWindowAreNotTold) {
  std::vector<std::pair<LandmarkKind, double>> masts;
  for (int i = 0; i < 100; ++i) masts.emplace_back(LandmarkKind::mast, 50.0 * i);
  LandmarkMatcher matcher({}, line_with(masts));
  for (int i = 10; i < 20; ++i) {
    const auto fix = matcher.add(sighting_of(LandmarkKind::mast), prior_at(50.0 * i - 5, 80, 50.0 * i));
    EXPECT_TRUE(!fix || fix->probability < 0.7);
  }
}

TEST(LandmarkMatcher, AMovedMastAndABaliseThatTheMapLacksDoNotMislead) {
  std::vector<std::pair<LandmarkKind, double>> landmarks;
  for (int i = 0; i < 20; ++i) landmarks.emplace_back(LandmarkKind::mast, 100 + 60.0 * i);
  landmarks.emplace_back(LandmarkKind::balise, 829);
  std::sort(landmarks.begin(), landmarks.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  LandmarkMatcher matcher({}, line_with(landmarks));
  const auto seen = [&](LandmarkKind kind, double really_m) {
    return matcher.add(sighting_of(kind), prior_at(really_m - 5 + 2, 15, 1.004 * really_m));
  };
  for (int i = 2; i < 20; ++i) {
    const bool moved = i == 9;
    const auto fix = seen(LandmarkKind::mast, 100 + 60.0 * i + (moved ? 5 : 0));
    if (moved) {
      EXPECT_TRUE(!fix || fix->probability < 0.5);
    } else if (i > 3) {
      ASSERT_TRUE(fix) << i;
      EXPECT_GT(fix->probability, 0.9) << i;
      EXPECT_NEAR(fix->path_distance_m, 95 + 60.0 * i, 1e-6) << i;
    }
    // A balise 9 m in front of the only one on the map.
    const auto lacking = i == 12 ? seen(LandmarkKind::balise, 820 + 0.1) : std::nullopt;
    EXPECT_TRUE(!lacking || lacking->probability < 0.5);
  }
}

// Its error adds up over the masts seen before, in the same direction for all of them.
TEST(LandmarkMatcher, AnOdometerThatIsOffByTwoPerCentDoesNotNameTheWrongOneOfAPair) {
  core::Random random(4);
  std::vector<std::pair<LandmarkKind, double>> landmarks;
  for (double m = 100; m < 990; m += random.uniform(40, 65)) landmarks.emplace_back(LandmarkKind::mast, m);
  for (const double m : {1000.0, 1003.0}) landmarks.emplace_back(LandmarkKind::balise, m);
  const auto path = line_with(landmarks);
  for (const double scale : {0.98, 1.02}) {
    LandmarkMatcher matcher({}, path);
    std::optional<Fix> fix;
    for (const auto& [kind, m] : landmarks) {
      if (m == 1000.0) continue;  // missed
      fix = matcher.add(sighting_of(kind, 0.95), prior_at(m - 5, 10, scale * (m - 5)));
    }
    ASSERT_TRUE(fix);
    EXPECT_NEAR(fix->path_distance_m, 998, 1e-9) << scale;
    EXPECT_GT(fix->probability, 0.9) << scale;
  }
}

// The mast stands 4 m from where the map has it. A train that rocks to and fro sees it again and again: that says
// nothing new, neither of the mast nor of the place.
TEST(LandmarkMatcher, WhatIsSeenAgainAndAgainIsNoSurer) {
  std::vector<std::pair<LandmarkKind, double>> masts;
  for (double m = 300; m < 900; m += 55) masts.emplace_back(LandmarkKind::mast, m);
  const double moved_m = masts[5].second + 4;
  double first = 0;
  for (const int times : {1, 6}) {
    LandmarkMatcher matcher({}, line_with(masts));
    for (int i = 0; i < 5; ++i) {
      const double m = masts[static_cast<size_t>(i)].second;
      (void)matcher.add(sighting_of(LandmarkKind::mast, 0.95), prior_at(m - 5, 20, m - 5));
    }
    double most = 0;
    for (int i = 0; i < times; ++i) {
      const auto fix = matcher.add(sighting_of(LandmarkKind::mast, 0.95), prior_at(moved_m - 5, 20, moved_m - 5));
      if (fix && std::abs(fix->path_distance_m - (moved_m - 5)) > 1) most = std::max(most, fix->probability);
    }
    EXPECT_LT(most, 0.9) << "seen " << times << " times";
    if (times == 1) first = most;
    EXPECT_LE(most, first + 0.05) << "seen " << times << " times";
  }
}

TEST(LandmarkMatcher, OneMastThatStandsThereByChanceConfirmsNoPlaceHoweverOftenItIsSeen) {
  LandmarkMatcher matcher({}, line_with({{LandmarkKind::mast, 500}, {LandmarkKind::mast, 560}}));
  for (int i = 0; i < 20; ++i) (void)matcher.add(sighting_of(LandmarkKind::mast, 0.95), prior_at(495, 5, 495));
  EXPECT_GT(matcher.doubt(), 1e-5);
}

// An element of 40 m is missing on the map, behind twenty masts that have confirmed the place.
TEST(LandmarkMatcher, APlaceThatWasConfirmedIsDoubtedWhereTheMapGoesOnOtherwise) {
  std::vector<std::pair<LandmarkKind, double>> mapped;
  std::vector<double> stand_m;
  core::Random random(3);
  for (double m = 300; m < 3000; m += random.uniform(40, 65)) {
    stand_m.push_back(m);
    mapped.emplace_back(LandmarkKind::mast, m < 1500 ? m : m - 40);
  }
  LandmarkMatcher matcher({}, line_with(mapped));
  bool doubted = false;
  for (const double m : stand_m) {
    (void)matcher.add(sighting_of(LandmarkKind::mast, 0.95), prior_at(m - 5, 3, m - 5));
    doubted = doubted || matcher.doubt() > 0.5;
    if (m < 1500) {
      EXPECT_FALSE(doubted) << m;
    }
    if (m > 2000) {
      EXPECT_TRUE(doubted) << m;
    }
  }
}

// From each of two tracks 4.2 m apart a train sees the masts of both.
TEST(LandmarkMatcher, AMastBeyondTheTrackBesideIsNotTheOneOfTheOwnTrack) {
  const auto is_fix = [](double seen_m, double mapped_m, double map_sigma_m = 0.1) {
    auto map = marked_line({{LandmarkKind::mast, 500}});
    auto changed = std::make_shared<track::Map>(*map);
    changed->landmarks[0].lateral_m = mapped_m;
    changed->landmarks[0].sigma_m = map_sigma_m;
    LandmarkMatcher matcher({}, path_along(changed));
    Sighting sighting = sighting_of(LandmarkKind::mast);
    sighting.lateral_m = seen_m;
    return matcher.add(sighting, prior_at(495, 5, 495)).has_value();
  };
  EXPECT_TRUE(is_fix(3.4, 3.1));
  EXPECT_FALSE(is_fix(7.3, 3.1));
  EXPECT_FALSE(is_fix(-3.1, 3.1));
  EXPECT_TRUE(is_fix(5, track::kMastBesideM)) << "the source said the side alone";
  EXPECT_FALSE(is_fix(7.2, track::kMastBesideM));
  EXPECT_TRUE(is_fix(5, 3.1, 3)) << "drawn to metres";
  EXPECT_FALSE(is_fix(7.2, 3.1, 3));
  EXPECT_TRUE(is_fix(7.3, 0)) << "not known";
}

/// Runs past masts every 60 m, and what else the map has, where somebody told the start `told_off_m` further on; how
/// often it was confirmed, and how often a fix was sure.
struct Passed {
  int here = 0;
  int sure = 0;
};
Passed pass_even_masts(double told_off_m, const std::vector<std::pair<LandmarkKind, double>>& else_mapped) {
  auto mapped = else_mapped;
  for (double m = 60; m < 9000; m += 60) mapped.emplace_back(LandmarkKind::mast, m);
  std::ranges::sort(mapped, {}, &std::pair<LandmarkKind, double>::second);
  LandmarkMatcher matcher({}, line_with(mapped));
  Passed passed;
  for (const auto& [kind, m] : mapped) {
    if (m < 3000 || m > 5000) continue;
    const auto fix = matcher.add(sighting_of(kind, 0.95), prior_at(m - 5 + told_off_m, 5, m - 5));
    passed.sure += fix && fix->probability > 0.9 ? 1 : 0;
    passed.here += fix && fix->sightings_fit == SightingsFit::here ? 1 : 0;
  }
  return passed;
}

TEST(LandmarkMatcher, MastsAtEvenDistancesConfirmNoPlace) {
  for (const double told_off_m : {0.0, 120.0, -60.0}) {
    const auto passed = pass_even_masts(told_off_m, {});
    EXPECT_EQ(passed.here, 0) << told_off_m;
    EXPECT_GT(passed.sure, 25) << "they fit";
  }
}

TEST(LandmarkMatcher, WhatStandsAmongEvenMastsConfirmsThePlaceForGood) {
  EXPECT_GT(pass_even_masts(0, {{LandmarkKind::balise, 4010}}).here, 14);
  EXPECT_GT(pass_even_masts(0, {{LandmarkKind::frog, 4010}}).here, 14);
  EXPECT_GT(pass_even_masts(0, {{LandmarkKind::bridge, 4010}}).here, 14);
  EXPECT_EQ(pass_even_masts(120, {{LandmarkKind::balise, 4010}}).here, 0);
}

// A cab that looks the other way from where it was told to be meets masts that stand there as they do here, the first
// one behind a tunnel of 700 m.
TEST(LandmarkMatcher, MastsThatStandAlikeOnEitherSideOfWhereTheStartWasToldDoNotConfirmWhereTheCabLooks) {
  std::vector<std::pair<LandmarkKind, double>> mapped;
  const std::vector<double> ways_m{700, 753, 821, 880, 961, 1009, 1090, 1141, 1215, 1270, 1352};
  for (const double way_m : ways_m) {
    mapped.emplace_back(LandmarkKind::mast, 4000 - way_m);
    mapped.emplace_back(LandmarkKind::mast, 4000 + way_m);
  }
  std::ranges::sort(mapped, {}, &std::pair<LandmarkKind, double>::second);
  const auto confirmed = [&](double told_m) {
    LandmarkMatcher matcher({}, line_with(mapped), told_m);
    int here = 0;
    for (const double way_m : ways_m) {
      const auto fix = matcher.add(sighting_of(LandmarkKind::mast, 0.95), prior_at(4000 + way_m - 5, 5, way_m - 5));
      here += fix && fix->sightings_fit == SightingsFit::here ? 1 : 0;
    }
    return here;
  };
  EXPECT_EQ(confirmed(0), 0);
  EXPECT_GT(confirmed(-9000), 3) << "told far away there is no such place";
}

// Each pair looks like every other one, but for the way from the one before.
TEST(LandmarkMatcher, PairsOfBalisesAtUnevenDistancesConfirmThePlace) {
  std::vector<std::pair<LandmarkKind, double>> balises;
  for (const double m : {1000.0, 1650.0, 2500.0, 2990.0, 3900.0, 4500.0, 5450.0}) {
    balises.emplace_back(LandmarkKind::balise, m);
    balises.emplace_back(LandmarkKind::balise, m + 3);
  }
  LandmarkMatcher matcher({}, line_with(balises));
  SightingsFit fit = SightingsFit::not_told;
  for (const auto& [kind, m] : balises) {
    const auto fix = matcher.add(sighting_of(kind, 0.95), prior_at(m - 5, 8, m - 5));
    if (fix) fit = fix->sightings_fit;
    if (m < 1640) {
      EXPECT_NE(fit, SightingsFit::here) << "it may be any pair";
    }
    if (m > 3000) {
      EXPECT_EQ(fit, SightingsFit::here) << m;
    }
  }
}

TEST(LandmarkMatcher, UnsureSightingGivesUnsureFix) {
  LandmarkMatcher matcher({}, line_with({{LandmarkKind::frog, 500}}));
  const auto fix = matcher.add(sighting_of(LandmarkKind::frog, 0.6), prior_at(495, 10, 0));
  ASSERT_TRUE(fix);
  EXPECT_LT(fix->probability, 0.8);
}

// Over many random lines with missed and false sightings: what is called 95 % sure must be right in 95 %.
TEST(LandmarkMatcher, ProbabilitiesAreHonest) {
  core::Random random(11);
  int sure = 0;
  int wrong = 0;
  for (int line = 0; line < 60; ++line) {
    std::vector<std::pair<LandmarkKind, double>> landmarks;
    for (double m = 100; m < 6000; m += random.uniform(20, 250)) {
      landmarks.emplace_back(LandmarkKind::balise, m);
      if (random.uniform() < 0.5) landmarks.emplace_back(LandmarkKind::balise, m += 3);
    }
    LandmarkMatcher matcher({}, line_with(landmarks));
    const double scale = 1 + 0.007 * random.normal();
    std::vector<std::pair<double, bool>> sightings;
    for (const auto& [kind, m] : landmarks)
      if (random.uniform() < 0.85) sightings.emplace_back(m, true);
    for (int k = 0; k < 3; ++k) sightings.emplace_back(random.uniform(100, 6000), false);
    std::sort(sightings.begin(), sightings.end());
    for (const auto& [m, real] : sightings) {
      const double foot_m = m - 5;
      const double interval_m = random.uniform(2, 25);
      const auto prior = prior_at(foot_m + random.uniform(-0.8, 0.8) * interval_m, interval_m, foot_m * scale);
      Sighting sighting = sighting_of(LandmarkKind::balise, 0.95);
      sighting.distance_ahead_m += 0.2 * random.normal();
      const auto fix = matcher.add(sighting, prior);
      if (!fix || fix->probability < 0.95) continue;
      ++sure;
      if (!real || std::abs(fix->path_distance_m - foot_m) > 1.0) ++wrong;
    }
  }
  EXPECT_GT(sure, 500);
  EXPECT_LT(wrong, sure / 20) << wrong << " of " << sure;
}

/// 6 km with a mast every 40 to 65 m; the map has them, or a share of them, `map_sigma_m` elsewhere.
class MastLine {
 public:
  MastLine(uint64_t seed, double map_sigma_m, double mapped = 1) : random_(seed) {
    auto map = std::make_shared<track::Map>();
    map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{6500, 0, 0}})});
    uint32_t id = 0;
    for (double m = 100; m < 6000; m += random_.uniform(40, 65)) {
      masts_m_.push_back(m);
      if (mapped < 1 && random_.uniform() > mapped) continue;
      map->landmarks.push_back(
          {++id, LandmarkKind::mast, 1, m + map_sigma_m * random_.normal(), 0, std::max(map_sigma_m, 0.1), ""});
    }
    const auto path = core::value_or_throw(track::Path::follow(map, {1, 0, track::Direction::forward}, 6500, 0));
    matcher_.emplace(LandmarkParameters{}, std::make_shared<const track::Path>(path));
  }
  /// From 500 m on while train_state says that the train is `told_off_m` further on.
  void run(double way_m, double told_off_m, double missed = 0.15) {
    for (const double m : masts_m_) {
      if (m < 500 || m > 500 + way_m || random_.uniform() < missed) continue;
      ++seen_;
      const auto fix = matcher_->add(sighting_of(LandmarkKind::mast, 0.95), prior_at(m - 5 + told_off_m, 5, m - 5));
      sure_ += fix && fix->probability >= 0.9 ? 1 : 0;
      here_ += fix && fix->sightings_fit == SightingsFit::here ? 1 : 0;
      doubted_ += matcher_->doubt() > 0.5 ? 1 : 0;
    }
  }
  [[nodiscard]] double sure_share() const { return static_cast<double>(sure_) / seen_; }
  [[nodiscard]] int sure() const { return sure_; }
  [[nodiscard]] double here_share() const { return static_cast<double>(here_) / seen_; }
  [[nodiscard]] double doubted_share() const { return static_cast<double>(doubted_) / seen_; }
  [[nodiscard]] int doubted() const { return doubted_; }
  [[nodiscard]] double doubt() const { return matcher_->doubt(); }

 private:
  core::Random random_;
  std::vector<double> masts_m_;
  std::optional<LandmarkMatcher> matcher_;
  int seen_ = 0;
  int sure_ = 0;
  int here_ = 0;
  int doubted_ = 0;
};

// The start is somebody's word. Among equal masts one stands by chance where the next is expected, again and again.
TEST(LandmarkMatcher, MastsDoNotConfirmAPlaceWhereTheTrainIsNot) {
  int sure = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    MastLine line(seed, 0.1);
    line.run(1500, 2170);
    EXPECT_GT(line.doubted_share(), 0.6) << seed;
    sure += line.sure();
  }
  EXPECT_LE(sure, 20) << "one before there is anything to compare it with";
}

TEST(LandmarkMatcher, MastsConfirmThePlaceWhereTheTrainIs) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    MastLine line(seed, 0.1);
    line.run(1500, 0);
    EXPECT_EQ(line.doubted(), 0) << seed;
    EXPECT_EQ(line.doubt(), 0) << seed;
    EXPECT_GT(line.sure_share(), 0.9) << seed;
    EXPECT_GT(line.here_share(), 0.75) << seed << ": no other place is alike";
  }
}

TEST(LandmarkMatcher, MastsThatAreRarelySightedDoNotSpeakAgainstThePlace) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    MastLine line(seed, 0.1);
    line.run(3000, 0, 0.7);
    EXPECT_EQ(line.doubted(), 0) << seed;
    EXPECT_GT(line.sure_share(), 0.9) << seed;
  }
}

// OpenStreetMap has them within metres: that is no evidence against the place.
TEST(LandmarkMatcher, MastsThatTheMapHasWithinMetresDoNotSpeakAgainstThePlace) {
  double share = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    MastLine line(seed, 3);
    line.run(1500, 0);
    EXPECT_EQ(line.doubted(), 0) << seed;
    share += line.sure_share() / 20;
  }
  EXPECT_GT(share, 0.5);
}

// Few maps have all masts. What is seen beside them says at first that the train is elsewhere, and soon that the map
// lacks them.
TEST(LandmarkMatcher, MastsThatTheMapLacksHardlySpeakAgainstThePlace) {
  double doubted = 0;
  double sure = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    MastLine line(seed, 0.1, 0.2);
    line.run(5000, 0);
    doubted += line.doubted_share() / 20;
    sure += line.sure_share() / 20;
  }
  EXPECT_LT(doubted, 0.02);
  EXPECT_GT(sure, 0.1) << "half of those that it has";
}

TEST(LandmarkMatcher, APlaceWhereTheTrainIsNotIsDoubtedWhereTheMapLacksMasts) {
  double doubted = 0;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    MastLine line(seed, 0.1, 0.2);
    line.run(3000, 2170);
    doubted += line.doubted_share() / 20;
  }
  EXPECT_GT(doubted, 0.6);
}

}  // namespace
}  // namespace railfix::map_matcher
