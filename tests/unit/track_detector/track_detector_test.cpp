#include "track_detector/track_detector.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/units.hpp"
#include "synthetic_picture.hpp"
#include "track_detector/draw.hpp"
#include "track_detector/mount_calibration.hpp"
#include "track_detector/mount_watch.hpp"

namespace {

using namespace railfix::track_detector;
using railfix::core::rad_from_deg;
using test::kCab;
using test::kMount;
using test::render;
using test::Scene;

Scene shaken_curve(double curvature_per_m) {
  Scene scene;
  scene.shape.camera = kMount;
  scene.shape.camera.pitch_rad += 0.006;
  scene.shape.camera.yaw_rad -= 0.015;
  scene.shape.camera.lateral_m += 0.06;
  scene.shape.camera.height_m -= 0.03;
  scene.shape.curvature_per_m = curvature_per_m;
  return scene;
}

/// Largest distance of the found rails from the true ones, in metres across the track, up to `far_m`.
double worst_offset_m(const TrackObservation& observation, const Scene& scene, double far_m) {
  const railfix::geometry::View found(kCab, observation.shape.camera);
  const railfix::geometry::View truth(kCab, scene.shape.camera);
  double worst = 0;
  for (double x = 8; x < far_m; x += 1) {
    for (const auto side : {Side::left, Side::right}) {
      const auto pixel = found.project(rail_point(observation.shape, side, 1.435, x));
      const auto ground = truth.on_plane(*pixel, 0);
      worst = std::max(worst, std::abs(ground->y() - rail_point(scene.shape, side, 1.435, ground->x()).y()));
    }
  }
  return worst;
}

class ColdStart : public testing::TestWithParam<double> {};

TEST_P(ColdStart, FindsShakenRailsInOnePicture) {
  const Scene scene = shaken_curve(GetParam());
  TrackDetector detector(kCab, kMount, {});
  const auto observation = detector.detect(render(scene));
  ASSERT_TRUE(observation.seen()) << observation.reason;
  EXPECT_LT(worst_offset_m(observation, scene, 30), 0.01);
  for (const int k : {1, 2, 4, 5}) {
    const double error = to_vector(observation.shape)(k) - to_vector(scene.shape)(k);
    EXPECT_LT(std::abs(error), 4 * std::sqrt(observation.covariance(k, k))) << "unknown " << k;
  }
  EXPECT_NEAR(observation.shape.curvature_per_m, GetParam(), 3e-4);
}

INSTANTIATE_TEST_SUITE_P(Curvatures, ColdStart, testing::Values(0.0, 1.0 / 2000, -1.0 / 500, 1.0 / 250));

TEST(TrackDetector, FindsRailsWhenThePoseIsDegreesAndDecimetresWrong) {
  Scene scene;
  scene.shape.camera = kMount;
  auto guess = kMount;
  guess.pitch_rad += rad_from_deg(2);
  guess.yaw_rad -= rad_from_deg(2);
  guess.height_m += 0.25;
  guess.lateral_m += 0.2;
  DetectorOptions options;
  options.limits.pitch_rad = options.limits.yaw_rad = 0.03;
  options.limits.height_m = 0.15;
  options.limits.lateral_m = 0.2;
  TrackDetector detector(kCab, guess, options);
  const auto observation = detector.detect(render(scene));
  ASSERT_TRUE(observation.seen()) << observation.reason;
  EXPECT_LT(worst_offset_m(observation, scene, 30), 0.02);
}

// A mount that nobody knows, metre gauge and curves of 50 m: more than a picture has time for.
TEST(TrackDetector, TriesWideLimitsInTurns) {
  DetectorOptions options;
  options.gauge_m = 1.0;
  options.limits = {0.024, 0.024, 0.06, 0.3, 0.12, 0.02, 0.0005, 3e-5};
  SearchLimits limits;
  limits.pitch_rad = 0.072;
  limits.yaw_rad = 0.18;
  limits.lateral_m = 1.1;
  limits.height_fraction = 0.14;
  limits.curvature_per_m = 0.04;
  TopViewSize size;
  size.half_width_m = 5;
  const TopView view(kCab, kMount, size);
  const int turns = RailSearch(view, limits, options.gauge_m, options.head_m).turns();
  EXPECT_GT(turns, 1);
  EXPECT_EQ(RailSearch(view, {}, options.gauge_m, options.head_m).turns(), 1);
  for (const double curvature_per_m : {0.0, 1.0 / 60, -1.0 / 110}) {
    Scene scene;
    scene.gauge_m = options.gauge_m;
    scene.shape.camera = kMount;
    scene.shape.camera.yaw_rad += 0.03;
    scene.shape.curvature_per_m = curvature_per_m;
    const cv::Mat grey = render(scene);
    TrackDetector detector(kCab, kMount, options);
    int pictures = 0;
    while (pictures < 2 * turns + 2 && !detector.detect(grey).seen()) ++pictures;
    EXPECT_LT(pictures, 2 * turns + 2) << curvature_per_m;
  }
}

TEST(TrackDetector, FindsDarkRailsOnLightGround) {
  Scene scene = shaken_curve(0);
  scene.rail_grey = 60;
  scene.ground_grey = 190;
  TrackDetector detector(kCab, kMount, {});
  const auto observation = detector.detect(render(scene));
  ASSERT_TRUE(observation.seen()) << observation.reason;
  EXPECT_LT(worst_offset_m(observation, scene, 30), 0.01);
}

/// Mean place of the edges, outward of the true ones, in pixels.
double mean_outward_px(const TrackObservation& observation, const Scene& scene) {
  const railfix::geometry::View view(kCab, scene.shape.camera);
  double outward_px = 0;
  for (const auto& point : observation.points) {
    const auto ground = view.on_plane(point.pixel, 0);
    const double outward_m = (point.side == Side::left ? 1 : -1) * ground->y() - 1.435 / 2;
    outward_px += outward_m * kCab.fu_px / ground->x() / static_cast<double>(observation.points.size());
  }
  return outward_px;
}

// Heads too bright for the camera look wider than they are: that must neither move the pose nor make it look sure.
TEST(TrackDetector, KnowsThatBurntOutHeadsLookTooWide) {
  Scene scene;
  scene.shape.camera = kMount;
  TrackDetector detector(kCab, kMount, {});
  const auto usual = detector.detect(render(scene));
  for (const double rail_grey : {300.0, 400.0, 600.0}) {
    scene.rail_grey = rail_grey;
    const auto observation = detector.detect(render(scene));
    ASSERT_TRUE(observation.seen()) << observation.reason;
    for (const int k : {1, 4}) {
      const double error = to_vector(observation.shape)(k) - to_vector(scene.shape)(k);
      EXPECT_LT(std::abs(error), 2 * std::sqrt(observation.covariance(k, k))) << "unknown " << k;
    }
    EXPECT_GT(observation.covariance(1, 1), 1.5 * usual.covariance(1, 1));
    EXPECT_LT(std::abs(mean_outward_px(observation, scene)), 0.18) << rail_grey;
  }
}

// At a tunnel's end the near rails are a little too bright for the camera and the far ones much: taken alike, they
// pitch the camera by 4 mrad.
TEST(TrackDetector, LearnsByHowMuchHeadsAreTooBright) {
  Scene scene;
  scene.shape.camera = kMount;
  TrackDetector detector(kCab, kMount, {});
  for (uint64_t i = 0; i < 4; ++i) detector.detect(render(scene, kCab, i));
  for (const double gain : {1.55, 1.7, 2.0, 2.3}) {
    Scene brighter = scene;
    brighter.rail_grey *= gain;
    brighter.ground_grey *= gain;
    const auto observation = detector.detect(render(brighter));
    ASSERT_TRUE(observation.seen()) << observation.reason;
    EXPECT_LT(std::abs(mean_outward_px(observation, scene)), 0.06) << "gain " << gain;
  }
  // Heads that mirror the sun are brighter than ever: nothing is known of them.
  const double known = detector.detect(render(scene)).covariance(1, 1);
  scene.rail_grey = 600;
  EXPECT_GT(detector.detect(render(scene)).covariance(1, 1), 1.5 * known);
}

TEST(TrackDetector, FollowsAndRecovers) {
  TrackDetector detector(kCab, kMount, {});
  Scene scene;
  scene.shape.camera = kMount;
  ASSERT_TRUE(detector.detect(render(scene)).seen());
  scene.shape.camera.pitch_rad += 0.002;
  EXPECT_TRUE(detector.detect(render(scene)).seen());
  const cv::Mat nothing(1024, 1280, CV_8UC1, cv::Scalar(90));
  EXPECT_FALSE(detector.detect(nothing).seen());
  EXPECT_TRUE(detector.detect(render(shaken_curve(-1.0 / 500))).seen());
}

TEST(TrackDetector, SaysNotSeenWithoutRails) {
  TrackDetector detector(kCab, kMount, {});
  Scene scene = shaken_curve(0);
  scene.left_rail = scene.right_rail = false;
  for (const uint64_t seed : {1, 2, 3}) {
    for (const double noise : {3.0, 25.0}) {
      scene.noise_grey = noise;
      const auto observation = detector.detect(render(scene, kCab, seed));
      EXPECT_FALSE(observation.seen_left || observation.seen_right);
      EXPECT_FALSE(observation.reason.empty());
      EXPECT_EQ(observation.shape.camera.height_m, kMount.height_m);
      EXPECT_GT(observation.covariance(1, 1), 0);
    }
  }
  EXPECT_FALSE(detector.detect(cv::Mat::zeros(1024, 1280, CV_8UC1)).seen());
  EXPECT_FALSE(detector.detect(cv::Mat(1024, 1280, CV_8UC1, cv::Scalar(255))).seen());
}

TEST(TrackDetector, DoesNotInventASecondRail) {
  Scene scene = shaken_curve(0);
  scene.right_rail = false;
  TrackDetector detector(kCab, kMount, {});
  EXPECT_FALSE(detector.detect(render(scene)).seen());
}

// With the usual mount a line alone is a rail; elsewhere it is a shadow or the next track's.
TEST(TrackDetector, BelievesOneRailAloneOnlyWhereItUsuallyIs) {
  Scene scene;
  scene.shape.camera = kMount;
  scene.right_rail = false;
  TrackDetector detector(kCab, kMount, {});
  const auto alone = detector.detect(render(scene));
  EXPECT_TRUE(alone.seen_left);
  EXPECT_GT(std::sqrt(alone.covariance(3, 3)), 0.02) << "it may be the other edge of the head";
  EXPECT_LT(std::abs(alone.shape.camera.lateral_m - kMount.lateral_m), 2 * std::sqrt(alone.covariance(3, 3)));
  scene.noise_grey = 15;  // gives edges where the other rail should be
  for (const double lateral_m : {-0.3, 0.3}) {
    scene.shape.camera.lateral_m = lateral_m;
    detector.reset();
    const auto elsewhere = detector.detect(render(scene));
    EXPECT_FALSE(elsewhere.seen_left || elsewhere.seen_right) << lateral_m;
    EXPECT_FALSE(elsewhere.reason.empty());
  }
}

// At few pixels a support of 1.5 px is nearly all that is looked at: noise was seen as a pair in each of 89 pictures.
TEST(TrackDetector, NoiseIsNoRailAtLowResolution) {
  const railfix::geometry::Intrinsics tram{461, 461, 319.5, 183.5, 0, 0, 0, 0, 640, 368};
  TrackDetector detector(tram, {0, -0.1047, -0.0208, -0.231, 2.295}, {});
  cv::RNG random(7);
  cv::Mat noise(tram.height_px, tram.width_px, CV_8U);
  for (int i = 0; i < 12; ++i) {
    if (i % 2 == 0) random.fill(noise, cv::RNG::UNIFORM, 0, 255);
    if (i % 2 == 1) random.fill(noise, cv::RNG::NORMAL, 90, 40);
    const auto observation = detector.detect(noise);
    EXPECT_FALSE(observation.seen_left || observation.seen_right) << i;
  }
}

TEST(TrackDetector, RefusesRailsOfAnotherGauge) {
  Scene scene = shaken_curve(0);
  scene.gauge_m = 1.0;
  TrackDetector detector(kCab, kMount, {});
  EXPECT_FALSE(detector.detect(render(scene)).seen());
}

// Over a switch a pair of legs that do not belong together looks like a hump that no railway has.
TEST(TrackDetector, RefusesABendThatNoTrackHas) {
  Scene scene = shaken_curve(1.0 / 250);
  scene.shape.vertical_curvature_per_m = -0.003;
  DetectorOptions options;
  EXPECT_FALSE(TrackDetector(kCab, kMount, options).detect(render(scene)).seen());
  options.limits.vertical_curvature_per_m = 0.002;
  EXPECT_TRUE(TrackDetector(kCab, kMount, options).detect(render(scene)).seen());
  scene.shape.vertical_curvature_per_m = 0;
  options.limits.curvature_per_m = 0.0008;
  const auto bent = TrackDetector(kCab, kMount, options).detect(render(scene));
  EXPECT_FALSE(bent.seen()) << bent.shape.curvature_per_m;
}

/// Both legs of a switch in one picture; `leg` lies on the track of `scene` as the other one.
cv::Mat two_legs(const Scene& scene, const Branch& branch) {
  Scene other = scene;
  other.shape = other_leg(scene.shape, branch);
  cv::Mat both;
  cv::max(render(scene), render(other), both);
  return both;
}

TEST(TrackDetector, TellsThatAnotherLegLeavesAhead) {
  Scene scene;
  scene.shape.camera = kMount;
  TrackDetector detector(kCab, kMount, {});
  EXPECT_FALSE(detector.detect(render(scene)).branches);
  const auto observation = detector.detect(two_legs(scene, {14.0, 1.0 / 190, 1}));
  ASSERT_TRUE(observation.seen()) << observation.reason;
  EXPECT_TRUE(observation.branches);
  EXPECT_LT(observation.far_m, 20);
  EXPECT_LT(worst_offset_m(observation, scene, observation.far_m), 0.1);
}

// The train turns off; the detector had followed the straight leg. Once the legs are apart near the train it must know.
TEST(TrackDetector, GoesOverToTheLegThatTheTrainRunsOn) {
  const double bend_per_m = -1.0 / 190;  // seen from the train's leg the other one falls back to the right
  Scene scene;
  scene.shape.camera = kMount;
  scene.shape.curvature_per_m = 1.0 / 190;
  TrackDetector detector(kCab, kMount, {});
  Scene straight = scene;
  straight.shape = other_leg(scene.shape, {2.0, bend_per_m, 1});
  ASSERT_TRUE(detector.detect(render(straight)).seen());
  for (double from_m = 0.0; from_m >= -12.0; from_m -= 2.0) {
    const auto observation = detector.detect(two_legs(scene, {from_m, bend_per_m, 1}));
    ASSERT_TRUE(observation.seen()) << from_m;
    if (from_m > -6) continue;
    EXPECT_LT(worst_offset_m(observation, scene, 20), 0.1) << from_m;
    EXPECT_NEAR(observation.shape.curvature_per_m, 1.0 / 190, 1e-3) << from_m;
  }
}

TEST(TrackDetector, TakesTheRollOfAnotherSensor) {
  Scene scene;
  scene.shape.camera = kMount;
  scene.shape.camera.roll_rad = 0.012;
  const cv::Mat grey = render(scene);
  TrackDetector detector(kCab, kMount, {});
  const auto alone = detector.detect(grey);
  const auto helped = detector.detect(grey, RollHint{0.012, 0.001});
  ASSERT_TRUE(alone.seen() && helped.seen());
  EXPECT_NEAR(helped.shape.camera.roll_rad, 0.012, 0.002);
  EXPECT_NEAR(helped.shape.camera.lateral_m, kMount.lateral_m, 0.01);
  EXPECT_LT(helped.covariance(0, 0), 0.1 * alone.covariance(0, 0));
  EXPECT_LT(helped.covariance(3, 3), 0.1 * alone.covariance(3, 3));
}

TEST(MountCalibration, FindsAnUnknownMount) {
  MountCalibrator calibrator(kCab, 1.435);
  railfix::core::Random random(5);
  for (int i = 0; i < 3; ++i) {
    Scene scene;
    scene.shape.camera = {0, 0.16 + 0.001 * random.normal(), 0.03 + 0.001 * random.normal(), -0.2, 3.3};
    calibrator.add(render(scene, kCab, static_cast<uint64_t>(i)));
  }
  const auto found = calibrator.solve();
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_NEAR(found.value().mount.height_m, 3.3, 0.02);
  EXPECT_NEAR(found.value().mount.lateral_m, -0.2, 0.02);
  EXPECT_NEAR(found.value().mount.pitch_rad, 0.16, 0.003);
  EXPECT_NEAR(found.value().mount.yaw_rad, 0.03, 0.003);
}

const railfix::geometry::Intrinsics kSmall{575, 575, 319.5, 255.5, 0, 0, 0, 0, 640, 512};

// Errors over sigma, over drives with shake of their own.
TEST(MountCalibration, ErrorsAreWithinTheSigmas) {
  double square = 0;
  constexpr int kDrives = 1;
  for (uint64_t drive = 0; drive < kDrives; ++drive) {
    MountCalibrator calibrator(kSmall, 1.435);
    railfix::core::Random random(100 + drive);
    const railfix::geometry::CameraPose mount{0, 0.12, 0.01, 0.1, 2.5};
    for (uint64_t i = 0; i < 3; ++i) {
      Scene scene;
      scene.shape.camera = {0, mount.pitch_rad + 0.002 * random.normal(), mount.yaw_rad + 0.002 * random.normal(),
                            mount.lateral_m + 0.01 * random.normal(), mount.height_m + 0.005 * random.normal()};
      calibrator.add(render(scene, kSmall, 10 * drive + i));
    }
    const auto found = calibrator.solve();
    ASSERT_TRUE(found.ok()) << found.error().message;
    const auto& m = found.value().mount;
    const auto& s = found.value().sigma;
    for (const double error :
         {(m.pitch_rad - mount.pitch_rad) / s.pitch_rad, (m.yaw_rad - mount.yaw_rad) / s.yaw_rad,
          (m.lateral_m - mount.lateral_m) / s.lateral_m, (m.height_m - mount.height_m) / s.height_m}) {
      EXPECT_LT(std::abs(error), 3.5) << "drive " << drive;
      square += error * error / (4 * kDrives);
    }
    EXPECT_LT(s.height_m, 0.02);
    EXPECT_EQ(m.roll_rad, 0);
  }
  EXPECT_LT(square, 2.0);
}

TEST(MountCalibration, ARollFromElsewhereIsKept) {
  MountCalibrator calibrator(kSmall, 1.435, 0.02, {3, 3, 2, 2, 0, 0, 0, 0, 0, 0});
  for (uint64_t i = 0; i < 3; ++i) {
    Scene scene;
    scene.shape.camera = {0.02, 0.12, 0, 0.3, 2.5};
    calibrator.add(render(scene, kSmall, i));
  }
  const auto found = calibrator.solve();
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_EQ(found.value().mount.roll_rad, 0.02);
  EXPECT_NEAR(found.value().mount.lateral_m, 0.3, 0.02);
  EXPECT_GE(found.value().sigma.pitch_rad, 2.0 / kSmall.fv_px) << "the centre's sigma is in it";
}

// Pictures of a camera that swings slowly say little more than one.
TEST(MountCalibration, PicturesThatFollowEachOtherCountLess) {
  const auto sigma_of = [](bool swings) {
    MountCalibrator calibrator(kSmall, 1.435);
    for (uint64_t i = 0; i < 8; ++i) {
      Scene scene;
      const double up = swings ? (i < 4 ? 1 : -1) : (i % 2 == 0 ? 1 : -1);
      scene.shape.camera = {0, 0.12 + 0.004 * up, 0, 0, 2.5};
      calibrator.add(render(scene, kSmall, i));
    }
    return railfix::core::value_or_throw(calibrator.solve()).sigma.pitch_rad;
  };
  EXPECT_GT(sigma_of(true), 2 * sigma_of(false));
}

// With a wrong focal length some pictures show some pair of lines at the gauge.
TEST(MountCalibration, WhatFewPicturesShowIsNoMount) {
  MountCalibrator calibrator(kSmall, 1.435);
  for (uint64_t i = 0; i < 7; ++i) {
    Scene scene;
    scene.shape.camera = {0, 0.12, 0, 0, 2.5};
    calibrator.add(i % 2 == 1 ? render(scene, kSmall, i) : cv::Mat(512, 640, CV_8UC1, cv::Scalar(90)));
  }
  const auto found = calibrator.solve();
  ASSERT_FALSE(found.ok());
  EXPECT_NE(found.error().message.find("only 3 of 7 pictures show both rails"), std::string::npos)
      << found.error().message;
}

TEST(MountCalibration, CurvesAreRefused) {
  MountCalibrator calibrator(kSmall, 1.435);
  for (uint64_t i = 0; i < 2; ++i) {
    Scene scene;
    scene.shape.camera = kMount;
    scene.shape.curvature_per_m = 1.0 / 400;
    calibrator.add(render(scene, kSmall, i));
  }
  const auto found = calibrator.solve();
  ASSERT_FALSE(found.ok());
  EXPECT_NE(found.error().message.find("straight track"), std::string::npos) << found.error().message;
}

TEST(MountCalibration, SaysWhatToDoWithoutRails) {
  MountCalibrator calibrator(kCab, 1.435);
  EXPECT_FALSE(calibrator.solve().ok());
  calibrator.add(cv::Mat(1024, 1280, CV_8UC1, cv::Scalar(90)));
  const auto found = calibrator.solve();
  ASSERT_FALSE(found.ok());
  EXPECT_NE(found.error().message.find("straight track"), std::string::npos);
}

constexpr double kCurvatureSigma = 1e-4;

TEST(MountWatch, ShakeAveragesOutAndAKnockDoesNot) {
  TrackShape mount;
  mount.camera = kMount;
  const DetectorOptions options;
  MountWatch watch(mount, options.limits);
  TrackShape shape = mount;
  for (int i = 0; i < 3600; ++i) {
    shape.camera.pitch_rad = mount.camera.pitch_rad + (i % 2 == 0 ? 1 : -1) * options.limits.pitch_rad;
    watch.add(shape, kCurvatureSigma, 1.0 / 60);
  }
  EXPECT_FALSE(watch.drifted());
  shape.camera.pitch_rad = mount.camera.pitch_rad + 3 * options.limits.pitch_rad;
  for (int i = 0; i < 7200; ++i) watch.add(shape, kCurvatureSigma, 1.0 / 60);
  EXPECT_TRUE(watch.drifted());
}

TEST(MountWatch, HalfADegreeIsToldInNumbers) {
  TrackShape mount;
  mount.camera = kMount;
  MountWatch watch(mount, DetectorOptions().limits);
  for (double railfix::geometry::CameraPose::*angle :
       {&railfix::geometry::CameraPose::pitch_rad, &railfix::geometry::CameraPose::yaw_rad}) {
    TrackShape shape = mount;
    shape.camera.*angle -= 0.5 / 57.29578;
    for (int i = 0; i < 60 * 120; ++i) watch.add(mount, kCurvatureSigma, 1.0 / 60);
    EXPECT_EQ(watch.what_drifted(), "");
    for (int i = 0; i < 60 * 300; ++i) watch.add(shape, kCurvatureSigma, 1.0 / 60);
    EXPECT_NE(watch.what_drifted().find("by -0.50 deg (0.37 may be)"), std::string::npos) << watch.what_drifted();
    for (int i = 0; i < 60 * 300; ++i) watch.add(mount, kCurvatureSigma, 1.0 / 60);
  }
}

/// A camera 12 m ahead of the middle between the bogies, in a curve.
TrackShape in_curve(const TrackShape& mount, double radius_m) {
  TrackShape shape = mount;
  shape.curvature_per_m = 1 / radius_m;
  shape.camera.yaw_rad -= 12 / radius_m;
  return shape;
}

TEST(MountWatch, ACurveIsNoKnock) {
  TrackShape mount;
  mount.camera = kMount;
  for (const double radius_m : {800.0, 400.0, 1800.0}) {
    for (const double sigma : {1e-4, 1e-3}) {
      MountWatch watch(mount, DetectorOptions().limits);
      for (int i = 0; i < 600; ++i) watch.add(mount, sigma, 0.1);
      for (int i = 0; i < 3000; ++i) {  // runs through it, or stands 5 minutes
        watch.add(in_curve(mount, radius_m), sigma, 0.1);
        ASSERT_EQ(watch.what_drifted(), "") << radius_m << " m, after " << i / 10 << " s, sigma " << sigma;
      }
      for (int i = 0; i < 3000; ++i) {
        TrackShape knocked = mount;
        knocked.camera.yaw_rad -= 0.01;
        watch.add(knocked, sigma, 0.1);
      }
      EXPECT_TRUE(watch.drifted());
    }
  }
}

TEST(Draw, MarksTheRailsAndSaysNotSeen) {
  Scene scene = shaken_curve(0);
  const cv::Mat grey = render(scene);
  TrackDetector detector(kCab, kMount, {});
  cv::Mat seen;
  cv::cvtColor(grey, seen, cv::COLOR_GRAY2BGR);
  draw_track(seen, kCab, detector.detect(grey), 1.435);
  const railfix::geometry::View view(kCab, scene.shape.camera);
  const auto pixel = view.project(rail_point(scene.shape, Side::left, 1.435, 10));
  const auto colour =
      seen.at<cv::Vec3b>(static_cast<int>(std::lround(pixel->y())), static_cast<int>(std::lround(pixel->x())));
  EXPECT_GT(colour[1], colour[2] + 30) << "the left rail is green";
  cv::Mat blind(1024, 1280, CV_8UC3, cv::Scalar::all(90));
  draw_track(blind, kCab, TrackObservation{}, 1.435);
  cv::Mat red;
  cv::inRange(blind, cv::Scalar(0, 0, 200), cv::Scalar(100, 100, 255), red);
  EXPECT_GT(cv::countNonZero(red), 100);
}

}  // namespace
