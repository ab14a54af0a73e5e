#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/random.hpp"
#include "track_detector/plate_search.hpp"

namespace railfix::track_detector {
namespace {

vision::Sheet sheet() {
  vision::Sheet s;
  s.near_m = 4;
  s.half_width_m = 0.58;
  s.cell_m = 0.02;
  s.rows = 400;
  s.cols = 59;
  return s;
}

const PlateBlur kBlur{1000, 2.5, 0};

struct Plate {
  double ahead_m, lateral_m, length_m, width_m;
};

/// Rough dark ground with a bright plate on it.
vision::TopView ground_with(const Plate& plate, double rough_grey = 3) {
  const vision::Sheet s = sheet();
  vision::TopView view;
  view.grey.create(s.rows, s.cols, CV_32F);
  view.row_seen.assign(static_cast<size_t>(s.rows), 1);
  core::Random random(3);
  for (int r = 0; r < s.rows; ++r) {
    for (int c = 0; c < s.cols; ++c) {
      const bool inside = std::abs(s.ahead_m(r) - plate.ahead_m) < 0.5 * plate.length_m &&
                          std::abs(s.offset_m(c) - plate.lateral_m) < 0.5 * plate.width_m;
      view.grey.at<float>(r, c) =
          static_cast<float>(inside ? 170 + random.normal(0, 3) : 90 + random.normal(0, rough_grey));
    }
  }
  return view;
}

TEST(PlateSearch, FindsAPlateWhereItLies) {
  PlateSearch search(sheet(), {});
  const auto& found = search.find(ground_with({7.0, 0.03, 0.36, 0.48}), kBlur);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].ahead_m, 7.0, 0.01);
  EXPECT_NEAR(found[0].lateral_m, 0.03, 0.01);
}

TEST(PlateSearch, ABrightPlateIsOneAndADarkStainIsNot) {
  PlateSearch search(sheet(), {});
  const auto& plate = search.find(ground_with({7.0, 0.0, 0.36, 0.48}), kBlur);
  ASSERT_EQ(plate.size(), 1U);
  const double sure = plate[0].score;
  EXPECT_GT(sure, 1);
  // Darkens the ground by half and lets its texture through.
  vision::TopView stained = ground_with({100, 0, 0, 0}, 12);
  for (int r = 0; r < sheet().rows; ++r) {
    for (int c = 0; c < sheet().cols; ++c) {
      const double s = (sheet().ahead_m(r) - 7.0) / 0.20;
      const double d = sheet().offset_m(c) / 0.26;
      stained.grey.at<float>(r, c) *= static_cast<float>(1 - 0.5 * std::clamp(1.6 * (1 - s * s - d * d), 0.0, 1.0));
    }
  }
  for (const auto& stain : search.find(stained, kBlur)) EXPECT_LT(stain.score, -5);
}

// A wide plate off the middle: nothing is known of it, and nothing beyond the sheet is read.
TEST(PlateEvidence, SaysNothingOfAPlateWhoseSurroundingsLeaveTheSheet) {
  LandmarkOptions options;
  options.balise_width_m = 0.7;
  PlateEvidence evidence(sheet(), options);
  AreaSums sums;
  sums.set(ground_with({7.0, 0.0, 0.36, 0.7}).grey);
  const auto at = [&](double row, double col) {
    return evidence.of(sums, {row, col, sheet().ahead_m(row), 0.9, 1.0}, kBlur).has_value();
  };
  EXPECT_TRUE(at(150, 29));
  EXPECT_FALSE(at(150, 24));
  EXPECT_FALSE(at(150, 34));
  EXPECT_FALSE(at(10, 29));
  EXPECT_FALSE(at(390, 29));
}

}  // namespace
}  // namespace railfix::track_detector
