#include "compare/gamab.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"

namespace railfix::compare {
namespace {

/// Errors that stay nearly the same inside a leg of ten pairs, as those of two odometers do.
std::vector<Sample> runs(size_t legs, double ours_sigma, double certified_sigma, uint64_t seed) {
  core::Random random(seed);
  std::vector<Sample> samples;
  for (size_t leg = 0; leg < legs; ++leg) {
    const double ours = random.normal(0, ours_sigma);
    const double certified = random.normal(0, certified_sigma);
    for (int i = 0; i < 10; ++i)
      samples.push_back(
          {leg, ours + random.normal(0, 0.1 * ours_sigma), certified + random.normal(0, 0.1 * certified_sigma)});
  }
  return samples;
}

RatioResult judged(const std::vector<Sample>& samples) {
  return compare_ratio(samples, Figure::root_mean_square, Demand{});
}

TEST(Gamab, TellsTheBetterTheWorseAndTheUndecided) {
  const auto better = judged(runs(60, 1, 3, 1));
  EXPECT_EQ(better.verdict, Verdict::at_least_as_good);
  EXPECT_EQ(better.legs, 60U);
  EXPECT_EQ(better.samples, 600U);
  EXPECT_LT(better.low, better.ratio);
  EXPECT_LT(better.ratio, better.high);
  EXPECT_EQ(judged(runs(60, 3, 1, 2)).verdict, Verdict::worse);
  int undecided = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const auto equal = judged(runs(20, 1, 1, 3 + seed));
    if (equal.verdict != Verdict::open) continue;
    ++undecided;
    EXPECT_GT(equal.legs_needed, 20);
  }
  EXPECT_GE(undecided, 14);
}

TEST(Gamab, TenLegsAreTheLeast) {
  const auto few = judged(runs(9, 1, 10, 4));
  EXPECT_EQ(few.verdict, Verdict::open);
  EXPECT_TRUE(std::isnan(few.legs_needed)) << "nine legs do not tell how many it takes";
  EXPECT_EQ(judged({}).samples, 0U);
}

/// Legs of the same errors on both sides.
RatioResult alike(size_t legs, double confidence = 0.95) {
  std::vector<Sample> samples;
  for (size_t leg = 0; leg < legs; ++leg) samples.push_back({leg, 10, 10});
  return compare_ratio(samples, Figure::mean, {.confidence = confidence});
}

TEST(Gamab, LegsNeededAreAboutAsManyAsItTakes) {
  EXPECT_EQ(alike(130).verdict, Verdict::at_least_as_good);
  for (const size_t legs : {10U, 20U, 59U, 110U}) EXPECT_NEAR(alike(legs).legs_needed, 121, 12) << legs;
  EXPECT_NEAR(alike(20, 0.999).legs_needed, 270, 40);
}

// Where errors scatter, the bound comes nearer with the root of the number of legs.
TEST(Gamab, LegsNeededWhereErrorsScatter) {
  const auto forty = runs(40, 0.8, 1, 3);
  const auto times = [&](size_t n) {
    std::vector<Sample> more;
    for (size_t turn = 0; turn < n; ++turn) {
      for (const auto& sample : forty) more.push_back({sample.leg + 40 * turn, sample.ours, sample.certified});
    }
    return judged(more);
  };
  EXPECT_EQ(times(2).verdict, Verdict::open);
  EXPECT_EQ(times(4).verdict, Verdict::at_least_as_good);
  EXPECT_GT(judged(forty).legs_needed, 80);
  EXPECT_LT(judged(forty).legs_needed, 160);
}

TEST(Gamab, ValuesThatAreNotKnownAreLeftOut) {
  auto samples = runs(20, 1, 3, 5);
  samples[0].ours = NAN;
  samples[1].certified = HUGE_VAL;
  EXPECT_EQ(judged(samples).samples, 198U);
}

// A system just at the limit must be declared good in no more than about 5 of 100 cases, and worse in no more either.
TEST(Gamab, TheConfidenceHolds) {
  for (const size_t legs : {20U, 40U}) {
    int good = 0;
    int worse = 0;
    for (uint64_t seed = 0; seed < 200; ++seed) {
      const auto verdict = judged(runs(legs, 1.05, 1, 100 + seed)).verdict;
      good += verdict == Verdict::at_least_as_good;
      worse += verdict == Verdict::worse;
    }
    EXPECT_LE(good, 14) << legs;  // 5 % are 10, with 3 of scatter
    EXPECT_LE(worse, 14) << legs;
  }
}

TEST(Gamab, OneBadLegIsNotForgotten) {
  auto samples = runs(20, 1, 1, 6);
  for (auto& sample : samples) {
    if (sample.leg == 7) sample.ours = 30;
  }
  EXPECT_GT(judged(samples).high, 7) << "a second such leg would not surprise";
}

std::vector<Sample> broken(size_t legs, size_t ours, size_t certified) {
  std::vector<Sample> samples;
  for (size_t leg = 0; leg < legs; ++leg) {
    samples.push_back({leg, 0, 0});
    samples.push_back({leg, leg < ours ? 1.0 : 0.0, leg + certified >= legs ? 1.0 : 0.0});
  }
  return samples;
}

TEST(Gamab, BrokenPromisesCountByLeg) {
  const auto none = compare_broken(broken(59, 0, 0), Demand{});
  EXPECT_EQ(none.verdict, Verdict::at_least_as_good);
  EXPECT_NEAR(none.ours_at_most, 0.0495, 1e-4);  // 1 - 0.05^(1/59)
  const auto many = compare_broken(broken(40, 8, 0), Demand{});
  EXPECT_EQ(many.verdict, Verdict::worse);
  EXPECT_EQ(many.ours.broken, 8U);
  EXPECT_EQ(compare_broken(broken(40, 1, 0), Demand{}).verdict, Verdict::open);
  EXPECT_EQ(compare_broken(broken(100, 1, 3), Demand{}).verdict, Verdict::at_least_as_good);
  EXPECT_EQ(compare_broken(broken(40, 1, 3), Demand{}).verdict, Verdict::open)
      << "up to 0.11 of our legs may be broken";
  EXPECT_EQ(compare_broken(broken(40, 1, 3), {.broken_at_most = 0.2}).verdict, Verdict::at_least_as_good);
  EXPECT_EQ(compare_broken(broken(9, 0, 0), Demand{}).verdict, Verdict::open);
  const auto few = compare_broken(broken(10, 0, 0), Demand{});
  EXPECT_EQ(few.verdict, Verdict::open);
  EXPECT_NEAR(few.ours_at_most, 0.26, 0.01);
}

// 60 legs, and each side promises on some of them only.
TEST(Gamab, ALegWithoutAPromiseKeepsNone) {
  std::vector<Sample> samples;
  for (size_t leg = 0; leg < 60; ++leg) samples.push_back({leg, leg % 3 == 0 ? 0 : NAN, leg % 2 == 0 ? 0 : NAN});
  const auto kept = compare_broken(samples, Demand{});
  EXPECT_EQ(kept.verdict, Verdict::open);
  EXPECT_EQ(kept.ours.legs, 20U);
  EXPECT_EQ(kept.certified.legs, 30U);
  EXPECT_NEAR(kept.ours_at_most, 0.139, 1e-3);  // 1 - 0.05^(1/20)
  for (auto& sample : samples) sample.ours = sample.leg % 2 == 0 ? 0 : 1;
  EXPECT_EQ(compare_broken(samples, Demand{}).verdict, Verdict::open) << "nobody knows what the other would have kept";
}

/// Ten reports a leg, of which ours has `ours` and the certified system `certified` with a known interval.
RatioResult share(size_t legs, size_t ours, size_t certified) {
  std::vector<Sample> samples;
  for (size_t i = 0; i < 10 * legs; ++i)
    samples.push_back({i / 10, i % 10 < ours ? 1.0 : 0.0, i % 10 < certified ? 1.0 : 0.0});
  return compare_share(samples, Demand{});
}

TEST(Gamab, ASystemThatIsSilentIsWorse) {
  EXPECT_EQ(share(20, 2, 10).verdict, Verdict::worse);
  EXPECT_NEAR(share(20, 2, 10).ratio, 5, 1e-9);
  EXPECT_EQ(share(20, 0, 10).verdict, Verdict::worse);
  EXPECT_EQ(share(70, 10, 10).verdict, Verdict::at_least_as_good);
  EXPECT_EQ(share(20, 10, 10).verdict, Verdict::open) << "the next leg may be a silent one";
  EXPECT_EQ(share(20, 10, 5).verdict, Verdict::at_least_as_good);
  EXPECT_EQ(share(20, 0, 0).verdict, Verdict::open);
}

// Silent on whole legs now and then, just as often as the margin allows.
TEST(Gamab, TheConfidenceHoldsForSharesToo) {
  core::Random random(9);
  for (const size_t legs : {60U, 100U}) {
    int good = 0;
    int worse = 0;
    for (int turn = 0; turn < 200; ++turn) {
      std::vector<Sample> samples;
      for (size_t leg = 0; leg < legs; ++leg) {
        const bool silent = random.uniform() < 1 - 1 / 1.05;
        for (int i = 0; i < 10; ++i) samples.push_back({leg, silent ? 0.0 : 1.0, 1.0});
      }
      const auto verdict = compare_share(samples, Demand{}).verdict;
      good += verdict == Verdict::at_least_as_good;
      worse += verdict == Verdict::worse;
    }
    EXPECT_LE(good, 19) << legs;  // 5 % are 10, with 3 of scatter
    EXPECT_LE(worse, 19) << legs;
  }
}

TEST(Gamab, NoErrorAtAllIsAsGoodAsNone) {
  std::vector<Sample> samples;
  for (size_t leg = 0; leg < 9; ++leg) samples.push_back({leg, 0, 0});
  EXPECT_EQ(compare_ratio(samples, Figure::root_mean_square, {}).verdict, Verdict::open) << "too few legs";
  samples.push_back({9, 0, 0});
  const auto result = compare_ratio(samples, Figure::root_mean_square, {});
  EXPECT_EQ(result.verdict, Verdict::at_least_as_good);
  EXPECT_EQ(result.ratio, 1);
  EXPECT_EQ(result.high, 1);
}

}  // namespace
}  // namespace railfix::compare
