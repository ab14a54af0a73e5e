#include "track_detector/ground_shade.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace railfix::track_detector {
namespace {

// Ground of grey 80 with sleepers, at 40 % of that between two places.
GroundShade drive(double dark_from_m, double dark_to_m, double to_m) {
  const vision::Sheet sheet{3.5, 0.58, 0.02, 525, 59};
  GroundShade shade;
  vision::TopView view{cv::Mat(sheet.rows, sheet.cols, CV_32F), std::vector<uint8_t>(525, 1)};
  for (double way_m = 0; way_m < to_m; way_m += 0.8) {
    for (int row = 0; row < sheet.rows; ++row) {
      const double at_m = way_m + sheet.ahead_m(row);
      const double light = at_m > dark_from_m && at_m < dark_to_m ? 0.4 : 1;
      view.grey.row(row).setTo(light * (at_m - 0.6 * std::floor(at_m / 0.6) < 0.27 ? 110 : 70));
    }
    shade.add(view, sheet, way_m);
  }
  return shade;
}

TEST(GroundShade, TellsWhatARoofTakes) {
  const auto share = drive(41, 48, 38).share(40);
  ASSERT_TRUE(share);
  EXPECT_NEAR(*share, 0.4, 0.05);
}

TEST(GroundShade, IsTheGroundsOfThePlaceAlone) {
  for (const double from_m : {30.0, 46.0}) {
    const auto share = drive(from_m, from_m + 3, 38).share(40);
    ASSERT_TRUE(share);
    EXPECT_GT(*share, 0.9) << from_m;
  }
}

TEST(GroundShade, SaysNothingBeforeAPictureHasShownIt) {
  EXPECT_FALSE(drive(41, 48, 20).share(40));
  EXPECT_FALSE(drive(41, 48, 32).share(60));
}

}  // namespace
}  // namespace railfix::track_detector
