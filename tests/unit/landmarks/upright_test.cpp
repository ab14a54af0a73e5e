#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/random.hpp"
#include "core/time.hpp"
#include "track_detector/landmark_finder.hpp"
#include "track_detector/platform_tracker.hpp"
#include "track_detector/upright_objects.hpp"
#include "unit/landmarks/seen_along_track.hpp"

namespace railfix::track_detector::upright_test {
namespace {

constexpr double kStepM = 0.7;
constexpr double kSpeedMps = 30;
constexpr double kWidest = 0.55;

/// An upright line beside straight track; `wall` and `deep` is what lies behind it towards the track.
struct Corner {
  double place_m, lateral_m, inner_grey, outer_grey, wall_grey = 100, deep_grey = 100;
  double shows_m = 40;  // from nearer than this: it is burnt out until the camera has got used to the light
  double fades_m = 2;   // until nearer than this: the land behind it is as bright
  double low_grey = 0;  // so much brighter is it within it in the lower rows, and darker in the upper ones
};

// The corners as seen from way_m: edges as a picture of 640 columns would show them. score_share: less where the ground
// behind them is uneven in brightness.
UprightProfile see(const std::vector<Corner>& corners, double way_m, std::vector<UprightEdge>& edges,
                   float score_share = 1, double curvature_per_m = 0) {
  UprightProfile profile;
  profile.cell = 0.002;
  profile.widest = kWidest;
  profile.step.assign(641, 0.0F);
  for (auto& half : profile.half_step) half.assign(641, 0.0F);
  edges.clear();
  for (const Corner& corner : corners) {
    const double ahead_m = corner.place_m - way_m;
    const double bearing = bearing_of(ahead_m, corner.lateral_m, curvature_per_m);
    if (ahead_m < corner.fades_m || ahead_m > corner.shows_m || std::abs(bearing) > kWidest) continue;
    const double side = corner.lateral_m > 0 ? 1 : -1;
    edges.push_back({bearing, corner.inner_grey, corner.outer_grey, corner.wall_grey, corner.deep_grey});
    for (int c = 0; c < 641; ++c) {
      const double share = 1 - std::abs(c - profile.column(bearing)) / 2.5;
      if (share <= 0) continue;
      const double step = corner.outer_grey - corner.inner_grey;
      profile.step[static_cast<size_t>(c)] += static_cast<float>(side * share * step);
      profile.half_step[0][static_cast<size_t>(c)] += static_cast<float>(side * share * (step + corner.low_grey));
      profile.half_step[1][static_cast<size_t>(c)] += static_cast<float>(side * share * (step - corner.low_grey));
    }
  }
  std::sort(edges.begin(), edges.end(), [](const auto& a, const auto& b) { return a.bearing < b.bearing; });
  profile.score = profile.step;
  for (float& score : profile.score) score *= score_share;
  return profile;
}

constexpr double kDay = 80;  // grey levels beside the track
constexpr double kNight = 6;
constexpr double kLining = 32;
constexpr double kRoofM = 40.5;  // behind it the ground is in the shade
constexpr double kNoRoofM = 1e9;

/// The ground from way_m as GroundShade sees it.
void show_ground(GroundShade& shade, double way_m, double roof_m = kRoofM) {
  const vision::Sheet sheet{3.5, 0.58, 0.02, 525, 59};
  vision::TopView view{cv::Mat(sheet.rows, sheet.cols, CV_32F), std::vector<uint8_t>(525, 1)};
  for (int row = 0; row < sheet.rows; ++row) view.grey.row(row).setTo(way_m + sheet.ahead_m(row) < roof_m ? 80 : 40);
  shade.add(view, sheet, way_m);
}

/// These and their like on the other wall.
std::vector<Corner> on_both_walls(std::vector<Corner> corners) {
  for (size_t i = 0, n = corners.size(); i < n; ++i) {
    corners.push_back(corners[i]);
    corners.back().lateral_m *= -1;
  }
  return corners;
}

std::vector<UprightObject> pass(const std::vector<Corner>& corners, double to_m, double beside_grey = kDay,
                                float score_share = 1, double curvature_per_m = 0, double roof_m = kRoofM) {
  EdgeTracker tracker;
  GroundShade shade;
  UprightObjects objects;
  std::vector<UprightObject> told;
  std::vector<UprightEdge> edges;
  LandmarkPicture picture;
  picture.curvature_per_m = curvature_per_m;
  for (double way_m = 0; way_m < to_m; way_m += kStepM) {
    picture.stamp_ns = core::to_ns(way_m / kSpeedMps);
    const auto profile = see(corners, way_m, edges, score_share, curvature_per_m);
    const auto& settled = tracker.follow(edges, profile, picture, way_m);
    show_ground(shade, way_m, roof_m);
    for (const auto& object : objects.add(settled, tracker, shade, way_m, beside_grey)) {
      told.push_back(object);
      EXPECT_NEAR(kSpeedMps * core::seconds(object.seen_ns) + object.seen_ahead_m, object.place_m, 0.12);
      EXPECT_LE(object.seen_ns, picture.stamp_ns);
      EXPECT_GT(object.seen_ahead_m, 2.5 / kWidest) << "it had left the picture";
    }
  }
  return told;
}

TEST(Uprights, AMastStandsWhereItsEdgesComeFrom) {
  const auto told = pass({{39.87, 3.2, 100, 60}, {39.87, 3.46, 60, 100}}, 45);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].type, LandmarkType::mast);
  EXPECT_NEAR(told[0].place_m, 40, 0.02);
  EXPECT_NEAR(told[0].lateral_m, 3.33, 0.02);
}

TEST(Uprights, AMastOfWhichOnlyTheSideShowsIsOne) {
  const auto told = pass({{40.13, -3.2, 100, 60}, {39.87, -3.2, 60, 100}}, 45);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_NEAR(told[0].place_m, 40, 0.03);
}

TEST(Uprights, AMastThatIsNoDarkerThanWhatIsBehindItShowsByItsSide) {
  const auto told = pass({{40.13, -3.2, 100, 60}, {39.87, -3.2, 60, 102}, {39.87, -3.46, 102, 100}}, 45);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_NEAR(told[0].place_m, 40, 0.15);
}

// Far away its edges push each other apart; that must not shift it.
TEST(Uprights, AMastFarBesideTheTrackStandsInTheMiddleOfItsOutlines) {
  const auto told = pass({{40.13, 6.87, 100, 60}, {39.87, 6.87, 60, 80}, {39.87, 7.13, 80, 100}}, 45);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_NEAR(told[0].place_m, 40, 0.08);
}

TEST(Uprights, AreToldAsOfThePictureThatShowedThemNearestIfThatIsNotLongAgo) {
  UprightObject mast{LandmarkType::mast, 100, 3.2, 0.05, 20};
  mast.seen_ns = core::to_ns(3.7);
  mast.seen_ahead_m = 7.5;
  const auto soon = sighting_of(mast, 99.4, core::to_ns(4.0), 0.01);
  EXPECT_EQ(soon.stamp_ns, core::to_ns(3.7));
  EXPECT_EQ(soon.distance_ahead_m, 7.5);
  EXPECT_NEAR(soon.sigma_m, std::hypot(0.05, 0.075), 1e-9);
  const auto after_a_stop = sighting_of(mast, 99.4, core::to_ns(30), 0.01);
  EXPECT_EQ(after_a_stop.stamp_ns, core::to_ns(30));
  EXPECT_NEAR(after_a_stop.distance_ahead_m, 0.6, 1e-9);
  EXPECT_NEAR(after_a_stop.sigma_m, std::hypot(0.05, 0.066), 1e-9);
}

TEST(Uprights, APostIsNoMast) {
  EXPECT_TRUE(pass({{40, 3.2, 100, 60}, {40, 3.32, 60, 100}}, 45).empty());
}

TEST(Uprights, ThePlaceHoldsInACurveThatIsSeenWrongly) {
  EdgeTracker tracker;
  std::vector<UprightEdge> edges;
  LandmarkPicture picture;
  picture.curvature_per_m = 2e-4;  // it is straight
  std::vector<SettledEdge> settled;
  for (double way_m = 0; way_m < 45; way_m += kStepM) {
    const auto profile = see({{40, 3.2, 100, 60}}, way_m, edges);
    for (const auto& edge : tracker.follow(edges, profile, picture, way_m)) settled.push_back(edge);
  }
  ASSERT_EQ(settled.size(), 1U);
  EXPECT_NEAR(settled[0].place_m, 40, 0.15);
  EXPECT_LT(std::abs(settled[0].place_m - 40), 2 * settled[0].sigma_m);
}

TEST(Uprights, ATunnelHasOnePortalInAndOneOut) {
  const auto corners = on_both_walls({{40, 2.7, 70, 120, 60, 15},
                                      {42.5, 2.7, 40, 70, 40, 15},
                                      {70, 2.7, 150, 90, 160, 200},
                                      {72.5, 2.7, 210, 170, 210, 200}});
  const auto told = pass(corners, 80);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0].type, LandmarkType::portal_in);
  EXPECT_NEAR(told[0].place_m, 40, 0.05);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 72.5, 0.08);
}

TEST(Uprights, ATunnelMayBeLong) {
  constexpr double kEndM = 5072.5;
  EdgeTracker tracker;
  GroundShade shade;
  UprightObjects objects;
  std::vector<UprightObject> told;
  std::vector<UprightEdge> edges;
  const auto corners = on_both_walls({{40, 2.7, 70, 120, 60, 15},
                                      {42.5, 2.7, 40, 70, 40, 15},
                                      {kEndM - 2.5, 2.7, 150, 90, 160, 200},
                                      {kEndM, 2.7, 210, 170, 210, 200}});
  for (double way_m = 0; way_m < kEndM + 8; way_m += kStepM) {
    const bool lining = way_m > 40 && way_m < kEndM - 15;  // the light beside the track is that of some metres ahead
    LandmarkPicture picture;
    picture.stamp_ns = core::to_ns(way_m / kSpeedMps);
    const auto profile = see(corners, way_m, edges);
    const auto& settled = tracker.follow(edges, profile, picture, way_m);
    show_ground(shade, way_m);
    for (const auto& object : objects.add(settled, tracker, shade, way_m, lining ? kLining : kDay))
      told.push_back(object);
  }
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, kEndM, 0.08);
}

// Seen at way 0 to 50 and from 56 on, at the brightness that is beside the track then.
std::vector<UprightObject> pass_blind(double grey_behind_gap) {
  const auto corners = on_both_walls({{40, 2.7, 70, 120, 60, 15}, {90, 2.7, 210, 170, 210, 200}});
  EdgeTracker tracker;
  GroundShade shade;
  UprightObjects objects;
  std::vector<UprightObject> told;
  std::vector<UprightEdge> edges;
  for (double way_m = 0; way_m < 100; way_m += kStepM) {
    if (way_m > 50 && way_m < 56) {
      tracker.forget();
      objects.forget();
      continue;
    }
    const double beside_grey = way_m < 40 || way_m > 75 ? kDay : way_m < 50 ? kLining : grey_behind_gap;
    const auto profile = see(corners, way_m, edges);
    const auto& settled = tracker.follow(edges, profile, {}, way_m);
    show_ground(shade, way_m);
    for (const auto& object : objects.add(settled, tracker, shade, way_m, beside_grey)) told.push_back(object);
  }
  return told;
}

TEST(Uprights, AGapInATunnelDoesNotLoseItsPortalOut) {
  const auto told = pass_blind(kLining);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 90, 0.1);
}

TEST(Uprights, DaylightBehindAGapEndsATunnelWithoutAPortalOut) {
  EXPECT_EQ(pass_blind(kDay).size(), 1U);
}

TEST(Uprights, ATrainThatBacksOverOpenLandAtNightIsNotBetweenWalls) {
  EdgeTracker tracker;
  UprightObjects objects;
  int between_walls = 0;
  for (double way_m = 0; way_m > -1500; way_m -= kStepM) {
    objects.add({}, tracker, {}, way_m, way_m > -1 ? 18 : 14);
    between_walls += objects.lit_walls() ? 1 : 0;
  }
  EXPECT_EQ(between_walls, 0);
}

TEST(Uprights, AWallsLastPieceThatIsBrighterThanLandAndDarkerThanHazeLeavesTheExitInDoubt) {
  Corner end{71, 2.7, 206, 206, 206, 200};
  end.low_grey = 20;
  const auto told = pass(on_both_walls({{40, 2.7, 70, 120, 60, 15}, {70, 2.7, 210, 120, 205, 200}, end}), 80);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_LT(std::abs(told[1].place_m - 71), 2 * told[1].sigma_m);
}

TEST(Uprights, AnExitThatTheOtherWallContradictsIsInDoubt) {
  auto corners = on_both_walls({{40, 2.7, 70, 120, 60, 15}, {70, 2.7, 210, 120, 205, 200}});
  corners.push_back({71.8, 2.7, 210, 150, 210, 200});  // stands behind the end
  const auto told = pass(corners, 80);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_LT(std::abs(told[1].place_m - 70), 1.5 * told[1].sigma_m);
}

TEST(Uprights, TheFaintEndOfABrightWallIsThePortalOut) {
  const auto corners =
      on_both_walls({{40, 2.7, 70, 120, 60, 15}, {70, 2.7, 210, 120, 205, 200}, {70.5, 2.7, 206, 210, 206, 200}});
  const auto told = pass(corners, 80);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 70.5, 0.08);
}

// As in a drawn tunnel: half a metre of panel, nearly as bright as the uneven land behind it.
TEST(Uprights, AShortBrightPanelBelongsToTheTunnel) {
  const auto corners =
      on_both_walls({{40, 2.7, 70, 120, 60, 15}, {70, 2.7, 205, 120, 205, 200}, {70.5, 2.7, 214, 205, 214, 200}});
  const auto told = pass(corners, 80, kDay, 0.2F);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 70.5, 0.08);
}

// For two tracks: the wall beside the other track is far away, and a curve bends it by 0.3 m before it is seen.
TEST(Uprights, InACurveTheFarWallAloneTellsThePortalOut) {
  for (const double curvature_per_m : {-0.002, 0.0, 0.002}) {
    const auto told = pass({{40, 2.7, 70, 120, 60, 15}, {40, -6.8, 70, 120, 60, 15}, {72.5, -6.8, 240, 150, 240, 240}},
                           85, kDay, 1, curvature_per_m);
    ASSERT_EQ(told.size(), 2U) << curvature_per_m;
    EXPECT_EQ(told[1].type, LandmarkType::portal_out);
    EXPECT_NEAR(told[1].place_m, 72.5, 0.15) << curvature_per_m;
  }
}

TEST(Uprights, TheNearWallTellsThePortalOutBetterThanTheFarOne) {
  const auto told = pass({{40, 2.7, 70, 120, 60, 15},
                          {40, -6.8, 70, 120, 60, 15},
                          {72.5, 2.7, 240, 150, 240, 240},
                          {73.7, -6.8, 240, 150, 240, 240}},
                         85);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 72.5, 0.2);
}

// As in a drawn tunnel for two tracks: behind the last panel but one everything is burnt out until a few looks before
// the near wall's end leaves the picture, too few to follow it; the far wall's end has left before.
TEST(Uprights, TheNearWallShowsItsEndInAFewLooksOnly) {
  const auto told = pass({{40, -2.7, 70, 120, 60, 15},
                          {40, 6.8, 70, 120, 60, 15},
                          {70, 6.8, 240, 130, 240, 238},
                          {72, -2.7, 245, 225, 245, 245, 7.3}},
                         85);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 72, 0.1);
}

// Narrower than its portal in by a hand's width on each side: 0.2 m too near for who does not look again.
TEST(Uprights, ATunnelThatGetsNarrowerEndsWhereItsWallsAre) {
  std::vector<Corner> corners = {{40, 2.7, 70, 120, 60, 15}};
  for (double place_m = 45; place_m < 70; place_m += 5) corners.push_back({place_m, 2.6, 60, 40, 60, 15});
  corners.push_back({72, 2.6, 240, 150, 240, 238});
  const auto told = pass(on_both_walls(corners), 85);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 72, 0.08);
}

// What the train runs after its end has left the picture is known less well than the end.
TEST(Uprights, APortalOutIsToldWhenItHasLeftThePicture) {
  const auto corners = on_both_walls({{40, 4, 70, 120, 60, 15}, {70, 4, 240, 150, 240, 238}});
  const double leaves_m = 4 / kWidest;
  EXPECT_EQ(pass(corners, 70 - leaves_m).size(), 1U);
  EXPECT_EQ(pass(corners, 70 - leaves_m + 2.3 + 2.1 + 1.5 * kStepM).size(), 2U);
}

// As on a drawn line: something stands in line with one wall behind the tunnel.
TEST(Uprights, WhatOneOfTwoLikeWallsShowsBehindTheEndIsNotTheEnd) {
  auto corners = on_both_walls({{40, 2.7, 70, 120, 60, 15}, {70, 2.7, 236, 150, 236, 238}});
  corners.push_back({72, 2.7, 225, 236, 225, 236, 7.3});
  const auto told = pass(corners, 80);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 70, 0.08);
}

// On the right the picture gets a little brighter once more 0.25 m behind the end, too little to be followed.
TEST(Uprights, WhatStandsCloseBehindTheEndIsNotTheEndOfBothWalls) {
  auto corners = on_both_walls({{40, 2.7, 70, 120, 60, 15}, {72.5, 2.7, 240, 150, 240, 240}});
  corners.push_back({72.75, -2.7, 246, 240, 246, 246});
  const auto told = pass(corners, 85, kDay, 0.3F);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 72.5, 0.06);
}

// The same a metre behind the end: once that was taken for one end of two that agree, and their mean for the place.
TEST(Uprights, WallsThatEndAtTwoPlacesSaySo) {
  for (const double behind_m : {0.6, 0.8, 1.0, 1.2}) {
    auto corners = on_both_walls({{40, 2.7, 70, 120, 60, 15}, {70, 2.7, 236, 150, 236, 238}});
    corners.push_back({70 + behind_m, 2.7, 225, 236, 225, 236, 7.3});
    const auto told = pass(corners, 80);
    ASSERT_EQ(told.size(), 2U);
    EXPECT_EQ(told[1].type, LandmarkType::portal_out);
    EXPECT_LT(std::abs(told[1].place_m - 70), 2 * told[1].sigma_m) << behind_m;
  }
}

// Land as bright as the last half metre of wall: what was followed and the clearest step do not agree.
TEST(Uprights, AnEndThatIsToldInTwoWaysSaysSo) {
  const auto told = pass({{40, 2.7, 70, 120, 60, 15},
                          {40, -2.7, 70, 120, 60, 15},
                          {69.5, 2.7, 236, 150, 236, 238},
                          {69.5, -2.7, 236, 150, 236, 238},
                          {70, -2.7, 239, 221, 239, 238, 40, 7.6}},
                         80);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_LT(std::abs(told[1].place_m - 70), 0.5 * told[1].sigma_m);
}

// As in a drawn tunnel in a curve: a panel in a lamp's light is as bright to a camera that is used to the dark as land
// was before the tunnel, and the mouth shows elsewhere.
TEST(Uprights, APanelInALampsLightIsNotThePortalOut) {
  EdgeTracker tracker;
  GroundShade shade;
  UprightObjects objects;
  std::vector<UprightObject> told;
  std::vector<UprightEdge> edges;
  const auto corners =
      on_both_walls({{40, 2.7, 70, 110, 60, 15}, {70, 2.7, 100, 46, 100, 34}, {72.5, 2.7, 29, 60, 29, 34}});
  for (double way_m = 0; way_m < 80; way_m += kStepM) {
    const auto profile = see(corners, way_m, edges);
    const auto& settled = tracker.follow(edges, profile, {}, way_m);
    show_ground(shade, way_m);
    for (const auto& object : objects.add(settled, tracker, shade, way_m, way_m < 40 ? kDay : kLining))
      told.push_back(object);
  }
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].type, LandmarkType::portal_in);
}

// Greys of a drawn tunnel: the camera is used to the dark, and one wall's panel as bright as land was before it.
TEST(Uprights, APanelThatGlaresBeforeTheEndIsNotThePortalOut) {
  std::vector<Corner> corners;
  for (const double side : {1.0, -1.0}) {
    corners.push_back({40, side * 2.7, 70, 120, 60, 15});
    corners.push_back({60, side * 2.7, side > 0 ? 99.0 : 76.0, side > 0 ? 51.0 : 46.0, side > 0 ? 101.0 : 76.0, 211});
    corners.push_back({62.5, side * 2.7, 79, 58, 80, 233});
    corners.push_back({67.5, side * 2.7, 121, 65, 129, 249});
    corners.push_back({70, side * 2.7, 164, 103, 176, 249});
    corners.push_back({72.5, side * 2.7, 244, 143, 247, 249});
  }
  const auto told = pass(corners, 80);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 72.5, 0.08);
}

// As in a drawn tunnel whose last half metre of wall was as burnt out as the land behind it.
TEST(Uprights, AnEndBeforeBurntOutLandMayHideAPanel) {
  const auto sigma_m = [](double land_grey) {
    const auto told = pass(on_both_walls({{40, 2.7, 70, 120, 60, 15}, {70, 2.7, land_grey, 150, land_grey, 248}}), 80);
    return told.size() == 2 ? told[1].sigma_m : 0.0;
  };
  EXPECT_GT(sigma_m(247), 0.6);
  EXPECT_LT(sigma_m(238), 0.2);
}

// Greys of a drawn tunnel: the last panel but one glares, and the last one is nearly as bright as the land.
TEST(Uprights, AWallThatIsDarkerThanTheOpenLandHasNotEnded) {
  const auto told = pass(on_both_walls({{40, 2.7, 70, 120, 60, 15}, {70, 2.7, 213, 109, 226, 249}}), 80);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].type, LandmarkType::portal_in);
}

// A burnt-out picture shows noise where the last step of a wall is looked for.
TEST(Uprights, NoiseIsNoLastStepOfAWall) {
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    core::Random random(seed);
    EdgeTracker tracker;
    std::vector<UprightEdge> edges;
    double way_m = 0;
    for (; way_m < 30; way_m += kStepM) {
      auto profile = see({}, way_m, edges);
      for (float& score : profile.score) score = static_cast<float>(0.6 * random.normal());
      for (float& step : profile.step) step = static_cast<float>(1.5 * random.normal());
      tracker.follow(edges, profile, {}, way_m);
    }
    for (const double wall_m : {-2.7, 2.7})
      EXPECT_FALSE(tracker.steps(wall_m, way_m, way_m + 2.3).last()) << "seed " << seed;
  }
}

TEST(Uprights, WallsWithDaylightBehindAreABridge) {
  const auto told =
      pass({{40, 4.0, 60, 120, 65}, {40, -4.0, 60, 120, 65}, {49, 4.0, 100, 60, 100}, {49, -4.0, 100, 60, 100}}, 60);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].type, LandmarkType::bridge);
  EXPECT_NEAR(told[0].place_m, 40, 0.05);
}

// Noise barriers, or lorries at a crossing: as bright against what is behind them as a portal's face.
TEST(Uprights, WallsThatEndOppositeEachOtherWithoutARoofAreNothing) {
  for (const double deep_grey : {100.0, 15.0}) {
    const auto corners = on_both_walls({{40, 4.2, 60, 150, 65, deep_grey}});
    EXPECT_TRUE(pass(corners, 60, kDay, 1, 0, kNoRoofM).empty());
    EXPECT_TRUE(pass(corners, 60, kDay, 1, 0, 48).empty()) << "a bridge 8 m behind them";
    EXPECT_EQ(pass(corners, 60).size(), 1U);
  }
}

// Dry ground in the mouth is as bright as wet ground before it: the panel behind is not where the tunnel begins.
TEST(Uprights, APanelIsNotToldInsteadOfAMouthThatShowsNoRoof) {
  const auto corners = on_both_walls({{40, 2.7, 70, 120, 60, 15}, {42.5, 2.7, 40, 70, 40, 15}});
  EXPECT_TRUE(pass(corners, 60, kDay, 1, 0, 47).empty());
}

TEST(Uprights, MastsOnBothSidesAreNoBridge) {
  const auto told = pass(
      {{40.13, 3.2, 100, 50, 95}, {39.87, 3.2, 50, 110, 70}, {40.13, -3.2, 100, 50, 95}, {39.87, -3.2, 50, 110, 70}},
      60);
  ASSERT_EQ(told.size(), 2U);
  for (const auto& object : told) EXPECT_EQ(object.type, LandmarkType::mast);
}

// Lit corners before the dark: of a bridge or of a portal; and a mast behind them.
const std::vector<Corner> kGateAndMast{
    {40, 2.7, 14, 24, 14, 8}, {40, -2.7, 14, 24, 14, 8}, {80.13, 3.8, 100, 60}, {79.87, 3.8, 60, 100}};

TEST(Uprights, InTheDarkNothingIsAPortalAndMastsBehindItCount) {
  const auto told = pass(kGateAndMast, 90, kNight);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].type, LandmarkType::mast);
  EXPECT_NEAR(told[0].place_m, 80, 0.15);
}

TEST(Uprights, ByDayTheSameIsAPortalWithoutMastsBehindIt) {
  const auto told = pass(kGateAndMast, 90, kDay);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].type, LandmarkType::portal_in);
}

TEST(Uprights, LongDaylightEndsATunnelWithoutPortalOut) {
  auto corners = kGateAndMast;
  corners.push_back({120.13, 3.8, 100, 60});
  corners.push_back({119.87, 3.8, 60, 100});
  const auto told = pass(corners, 130, kDay);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[1].type, LandmarkType::mast);
  EXPECT_NEAR(told[1].place_m, 120, 0.15);
}

TEST(Uprights, BetweenLitWallsInTheDarkNothingIsTold) {
  EXPECT_TRUE(pass(kGateAndMast, 90, kLining).empty());
}

std::vector<SettledPlatform> approach(double height_m, double lateral_m) {
  constexpr double kEyeM = 2.5;
  const double factor = (kEyeM - kUsualPlatformM) / (kEyeM - height_m);
  PlatformTracker tracker;
  std::vector<SettledPlatform> told;
  for (double way_m = 0; way_m < 40; way_m += kStepM) {
    const double ahead_m = factor * (30 - way_m);
    std::vector<PlatformMark> seen;
    if (ahead_m > 4.5 && ahead_m < 19) seen.push_back({-1, true, ahead_m, factor * lateral_m, 0.9});
    for (const auto& end : tracker.follow(seen, way_m)) told.push_back(end);
  }
  return told;
}

TEST(Platforms, HeightFollowsFromTheMotion) {
  for (const double height_m : {0.38, 0.55, 0.76}) {
    const auto told = approach(height_m, 1.67);
    ASSERT_EQ(told.size(), 1U) << height_m;
    EXPECT_NEAR(told[0].place_m, 30, 0.1);
    EXPECT_LT(std::abs(told[0].place_m - 30), 2 * told[0].sigma_m);
    EXPECT_NEAR(told[0].lateral_m, -1.67, 0.05);
  }
}

TEST(Platforms, WhatLiesOnTheGroundIsNone) {
  EXPECT_TRUE(approach(-0.1, 2.2).empty());
}

}  // namespace
}  // namespace railfix::track_detector::upright_test
