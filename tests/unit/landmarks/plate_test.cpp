#include <gtest/gtest.h>

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

struct Plate {
  double ahead_m, lateral_m, length_m, width_m;
};

/// Rough dark ground with a bright plate on it.
vision::TopView ground_with(const Plate& plate) {
  const vision::Sheet s = sheet();
  vision::TopView view;
  view.grey.create(s.rows, s.cols, CV_32F);
  view.row_seen.assign(static_cast<size_t>(s.rows), 1);
  core::Random random(3);
  for (int r = 0; r < s.rows; ++r) {
    for (int c = 0; c < s.cols; ++c) {
      const bool inside = std::abs(s.ahead_m(r) - plate.ahead_m) < 0.5 * plate.length_m &&
                          std::abs(s.offset_m(c) - plate.lateral_m) < 0.5 * plate.width_m;
      view.grey.at<float>(r, c) = static_cast<float>((inside ? 170 : 90) + random.normal(0, 3));
    }
  }
  return view;
}

TEST(PlateSearch, FindsAPlateWhereItLies) {
  PlateSearch search(sheet(), {});
  const auto& found = search.find(ground_with({7.0, 0.03, 0.36, 0.48}));
  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].ahead_m, 7.0, 0.01);
  EXPECT_NEAR(found[0].lateral_m, 0.03, 0.01);
}

}  // namespace
}  // namespace railfix::track_detector
