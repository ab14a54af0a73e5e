#include "map_matcher/alike_places.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "unit/map_matcher/marked_line.hpp"

namespace railfix::map_matcher {
namespace {

using track::LandmarkKind;
using Marks = std::vector<std::pair<LandmarkKind, double>>;

constexpr double kTravelledM = 700;  // where path distance is 1500 m

Marks even_masts(double from_m, double to_m) {
  Marks masts;
  for (double m = from_m; m <= to_m; m += 60) masts.emplace_back(LandmarkKind::mast, m);
  return masts;
}

/// All of `sighted` were, on the way to 1500 m.
bool is_alike_elsewhere(const Marks& mapped, const Marks& sighted, double since_told_m = 600) {
  SightingHistory history({});
  for (const auto& [kind, m] : sighted) history.add({1, kind, 5, 0, 0.2, 0.95}, m - 1500 + kTravelledM);
  const double shift_m = 1500 - kTravelledM;
  const auto path = path_along(marked_line(mapped));
  return AlikePlaces(history, *path).any({shift_m, shift_m - 10, shift_m + 10, kTravelledM, since_told_m});
}

TEST(AlikePlaces, ThereAreAmongMastsAtEvenDistances) {
  EXPECT_TRUE(is_alike_elsewhere(even_masts(0, 4980), even_masts(1020, 1500)));
  auto missed = even_masts(1020, 1500);
  missed.erase(missed.begin() + 3);
  EXPECT_TRUE(is_alike_elsewhere(even_masts(0, 4980), missed));
}

TEST(AlikePlaces, ThereAreNoneWhereOneStandsElsewhere) {
  auto mapped = even_masts(0, 4980);
  mapped[21].second += 15;  // that at 1260 m
  EXPECT_FALSE(is_alike_elsewhere(mapped, {mapped.begin() + 17, mapped.begin() + 26}));
  EXPECT_TRUE(is_alike_elsewhere(mapped, {mapped.begin() + 17, mapped.begin() + 21})) << "not seen yet";
}

TEST(AlikePlaces, ThereAreNoneWhereSomethingElseWasSighted) {
  for (const auto kind : {LandmarkKind::balise, LandmarkKind::frog, LandmarkKind::bridge, LandmarkKind::portal_in}) {
    auto mapped = even_masts(0, 4980);
    mapped.emplace(mapped.begin() + 22, kind, 1275);
    const Marks sighted{mapped.begin() + 17, mapped.begin() + 27};
    EXPECT_FALSE(is_alike_elsewhere(mapped, sighted)) << track::to_string(kind);
    mapped.emplace(mapped.begin() + 26, kind, 1455);  // three masts further on
    EXPECT_TRUE(is_alike_elsewhere(mapped, sighted)) << track::to_string(kind);
  }
}

// Eight masts, the first and the last of which tell where they stand, but not from which side they were passed.
TEST(AlikePlaces, AShortRowIsAlikeForATrainThatWasToldToLookTheOtherWay) {
  const auto row = even_masts(1080, 1500);
  EXPECT_TRUE(is_alike_elsewhere(row, row, 600));
  EXPECT_FALSE(is_alike_elsewhere(row, row, 5000)) << "it has come from too far away";
  auto uneven = row;
  uneven[2].second += 15;
  EXPECT_FALSE(is_alike_elsewhere(uneven, uneven, 600));
}

}  // namespace
}  // namespace railfix::map_matcher
