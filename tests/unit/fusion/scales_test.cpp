// Scales of camera and wheel that an earlier trip has taught: what they are worth, and what when they are wrong.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "straight_run.hpp"

namespace railfix::fusion {
namespace {

SavedScales saved_as(double camera, double wheel) {
  return {{camera - 1, wheel - 1, 2e-4, 1e-4, 0.5}, kBeginNs, "cam0=640x512,577", 100, CameraLag::Lag{0.03, 0.004}};
}

TEST(Scales, AreWrittenAndReadAgain) {
  const SavedScales saved = saved_as(1.0021, 0.9971);
  const auto read = saved_scales(to_text(saved));
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_NEAR(read.value().scales.camera, 0.0021, 1e-11);
  EXPECT_NEAR(read.value().scales.wheel, -0.0029, 1e-11);
  EXPECT_NEAR(read.value().scales.wheel_sigma, 1e-4, 1e-12);
  EXPECT_NEAR(read.value().scales.correlation, 0.5, 1e-9);
  EXPECT_EQ(read.value().stamp_ns, saved.stamp_ns);
  EXPECT_EQ(read.value().camera_id, saved.camera_id);
  EXPECT_EQ(read.value().pulses_per_metre, 100);
  ASSERT_TRUE(read.value().camera_lag);
  EXPECT_NEAR(read.value().camera_lag->late_s, 0.03, 1e-9);
  EXPECT_NEAR(read.value().camera_lag->sigma_s, 0.004, 1e-9);
}

TEST(Scales, ADamagedFileIsRefused) {
  const std::string whole = to_text(saved_as(1.0021, 0.9971));
  for (size_t length = 0; length < whole.size(); ++length)
    EXPECT_FALSE(saved_scales(whole.substr(0, length)).ok()) << length;
  for (const auto& [number, other] : {std::pair{"-0.0029", "nan"},
                                      {"-0.0029", "3"},
                                      {"0.0001\n", "0\n"},
                                      {"0.5", "1"},
                                      {"0.03", "3"},
                                      {"0.03", "x"},
                                      {"0.004", "0"}}) {
    std::string text = whole;
    text.replace(text.find(number), std::string(number).size(), other);
    EXPECT_FALSE(saved_scales(text).ok()) << text;
  }
}

TEST(Scales, WhatIsWrongWithAFileIsSaid) {
  const std::string whole = to_text(saved_as(1.0021, 0.9971));
  const auto said = [](const std::string& text) {
    const auto read = saved_scales(text);
    return read.ok() ? std::string("taken") : read.error().message;
  };
  EXPECT_EQ(said(whole.substr(0, whole.size() - 1)), "its last line is cut off");
  EXPECT_EQ(said("\n"), "it holds no 'key: value' lines");
  EXPECT_EQ(said("- 1\n- 2\n"), "it holds no 'key: value' lines");
  EXPECT_THAT(said(whole + "wheel: [\n"), ::testing::HasSubstr("is not YAML"));
  EXPECT_THAT(said(std::string("\x00\xFF\xFE: {\n", 7)), ::testing::Not("taken"));
  std::string text(100'000, '[');
  text += '\n';
  EXPECT_THAT(said(text), ::testing::HasSubstr("is not YAML"));
  text = whole;
  text.replace(text.find("wheel: -0.0029"), 14, "wheel: [1, 2]");
  EXPECT_EQ(said(text), "wheel is missing or no number");
  text.replace(text.find("camera_id"), 9, "camera");
  EXPECT_EQ(said(text), "camera_id is missing or no text");
}

TEST(Scales, AFileOfTheReleaseBeforeIsRead) {
  const auto read = saved_scales(
      "# True over measured metres, less 1, as references on the last trip have taught them to railfix-fusion.\n"
      "# Remove this file when a wheelset, the lens or the camera's mount has been exchanged.\n"
      "camera: 0.00209999987\ncamera_sigma: 1.9e-05\nwheel: -0.0029\nwheel_sigma: 0.0001\ncorrelation: 0.5\n"
      "pulses_per_metre: 98.039215686274517\nstamp_ns: 1763700000000000000\n"
      "camera_id: cam0=1280x1024,1154,1154,640,512,0,0,0,0,2.5,-0.08,0,0.001,0 "
      "cam1=640x512,577,577,320,256,0,0,0,0,2.5,0,0,0,0\n");
  ASSERT_TRUE(read.ok()) << read.error().message;
  EXPECT_EQ(read.value().scales.camera_sigma, 1.9e-05);
  EXPECT_EQ(read.value().pulses_per_metre, 98.039215686274517);
  EXPECT_EQ(read.value().stamp_ns, 1763700000000000000);
  EXPECT_FALSE(read.value().camera_lag);
  EXPECT_TRUE(read.value().camera_id.ends_with("cam1=640x512,577,577,320,256,0,0,0,0,2.5,0,0,0,0"));
  const auto of_no_camera = saved_scales(to_text({read.value().scales, 0, "", 0, {}}));
  ASSERT_TRUE(of_no_camera.ok()) << of_no_camera.error().message;
  EXPECT_EQ(of_no_camera.value().camera_id, "");
}

TEST(Scales, GrowOldToWhatIsKnownWithoutThem) {
  const FusionParameters parameters;
  const SavedScales saved = saved_as(1.0021, 0.9971);
  const auto next_trip = aged(saved, saved.stamp_ns, parameters);
  EXPECT_NEAR(next_trip.wheel_sigma, std::hypot(1e-4, parameters.wheel_scale_trip_sigma), 1e-12);
  EXPECT_EQ(next_trip.wheel, saved.scales.wheel);
  EXPECT_LT(next_trip.correlation, 0.5);
  const auto later = aged(saved, saved.stamp_ns + core::to_ns(20 * 86400.0), parameters);
  EXPECT_NEAR(later.wheel_sigma, 20 * parameters.scale_sigma_per_day, 1e-4);
  const auto never = aged(saved, saved.stamp_ns - core::to_ns(1000 * 86400.0), parameters);
  EXPECT_EQ(never.wheel_sigma, parameters.wheel_scale_sigma);
  EXPECT_EQ(never.camera_sigma, parameters.visual_scale_sigma);
}

TEST(Scales, WhatTheFilterBeginsWithIsWhatItIsTold) {
  const OdometerScales told{0.0021, -0.0029, 3e-4, 1e-4, 0.6};
  for (const auto unit : {Odometer::camera, Odometer::wheel}) {
    MotionFilter filter({}, told, kBeginNs, true);
    filter.choose_unit(unit);
    const auto scales = filter.scales();
    EXPECT_NEAR(scales.camera, told.camera, 1e-12);
    EXPECT_NEAR(scales.wheel, told.wheel, 1e-12);
    EXPECT_NEAR(scales.camera_sigma, told.camera_sigma, 1e-9);
    EXPECT_NEAR(scales.wheel_sigma, told.wheel_sigma, 1e-9);
    EXPECT_NEAR(scales.correlation, told.correlation, 1e-6);
  }
}

TEST(Scales, AreWorthMetresBeforeTheFirstReferenceAndTheIntervalDoesNotRelyOnThem) {
  const double camera = 1.002;
  const double wheel = 0.997;
  Passage first({camera, wheel});
  Passage next({camera, wheel, saved_as(camera, wheel)});
  for (auto* passage : {&first, &next}) passage->run_to(2000);
  EXPECT_GT(std::abs(first.error_m()), 0.8);
  EXPECT_LT(std::abs(next.error_m()), 0.2);
  EXPECT_EQ(next.fusion().saved_scales(), SavedScalesAre::on_trial);
  EXPECT_GE(next.state().over_m + next.state().under_m, first.state().over_m + first.state().under_m);
  EXPECT_FALSE(next.fusion().learnt_scales());  // nothing was taught yet

  for (auto* passage : {&first, &next}) {
    for (const double place_m : {2500.0, 3500.0, 4500.0}) {
      passage->sight(0.05);
      passage->run_to(place_m);
    }
  }
  EXPECT_EQ(next.fusion().saved_scales(), SavedScalesAre::confirmed);
  EXPECT_EQ(first.fusion().saved_scales(), SavedScalesAre::none);
  EXPECT_LE(next.state().over_m + next.state().under_m, first.state().over_m + first.state().under_m);
  for (auto* passage : {&first, &next}) {
    const auto learnt = passage->fusion().learnt_scales();
    ASSERT_TRUE(learnt);
    EXPECT_NEAR(learnt->camera, camera - 1, 4 * learnt->camera_sigma);
    EXPECT_NEAR(learnt->wheel, wheel - 1, 4 * learnt->wheel_sigma);
    EXPECT_LT(learnt->wheel_sigma, 1e-3);
  }
}

// A mount that was moved: only places on the map can tell. What is wrong by no more than a trip may change is put right
// without a word.
TEST(Scales, ThatAReferenceContradictsAreDroppedAndTheIntervalHeldMeanwhile) {
  for (const double wrong : {-0.02, -0.003, 0.003, 0.02}) {
    SavedScales saved = saved_as(1.0 + wrong, 1.0);
    saved.scales.wheel_sigma = 0.01;  // that train has no wheel sensor
    Passage passage({.camera = 1.0, .saved = saved});
    passage.run_to(1500);
    EXPECT_GT(std::abs(passage.error_m()), 0.7 * 1500 * std::abs(wrong)) << wrong;
    EXPECT_EQ(passage.fusion().saved_scales(), SavedScalesAre::on_trial);
    passage.sight(0);
    passage.run_to(2500);
    if (std::abs(wrong) > 0.01) {
      EXPECT_EQ(passage.fusion().saved_scales(), SavedScalesAre::contradicted) << wrong;
    }
    EXPECT_LT(std::abs(passage.error_m()), 2) << wrong;
    passage.sight(0);
    passage.run_to(4000);
    EXPECT_NE(passage.fusion().saved_scales(), SavedScalesAre::on_trial) << wrong;
    EXPECT_LT(std::abs(passage.scale_error()), 3e-4) << wrong;
  }
}

// What was saved of a wheel sensor that has failed cannot be tried; the camera's scale can.
TEST(Scales, OfASensorThatIsMissingDoNotKeepTheOthersOnTrial) {
  Passage passage({.camera = 1.002, .saved = saved_as(1.002, 0.997)});
  for (const double place_m : {1500.0, 2500.0, 3500.0, 4500.0}) {
    passage.run_to(place_m);
    passage.sight(0.05);
  }
  EXPECT_EQ(passage.fusion().saved_scales(), SavedScalesAre::confirmed);
  EXPECT_LT(std::abs(passage.scale_error()), 3e-4);
}

// A new wheelset shows by the camera at once.
TEST(Scales, OfAnotherWheelAreDroppedByWhatTheCameraSays) {
  Passage passage({.camera = 1.0, .wheel = 1.02, .saved = saved_as(1.0, 1.0)});
  passage.run_to(300);
  EXPECT_EQ(passage.fusion().saved_scales(), SavedScalesAre::contradicted);
  passage.run_to(1500);
  EXPECT_EQ(passage.state().reason.find("wheel"), std::string::npos) << passage.state().reason;
}

// Nothing has moved yet, and the first fix says nothing of any scale.
TEST(Scales, AreNotConfirmedByAFirstFix) {
  auto fusion = fusion_at(0, saved_as(1.02, 1.0));
  fusion.add(GnssInput{at(0), 0, 0, 1.0, 1});
  fusion.add(fix_at(0.01, 0, 1));
  run(fusion, 0.02, 1, 20);
  EXPECT_EQ(fusion.saved_scales(), SavedScalesAre::on_trial);
}

TEST(Scales, OfOtherSensorsAreForgottenAtOnce) {
  auto fusion = fusion_at(0, saved_as(1.02, 1.0));
  EXPECT_EQ(fusion.saved_scales(), SavedScalesAre::on_trial);
  run(fusion, 0, 5, 20);
  EXPECT_NEAR(fusion.estimator()->filter().scale(Odometer::camera), 1.02, 1e-4);
  fusion.drop_saved_scales();
  const auto state = run(fusion, 5, 10, 20);
  EXPECT_NEAR(state.visual_scale, 1.0, 1e-9);
  EXPECT_NEAR(state.position.offset_m, 200, 0.1);
}

}  // namespace
}  // namespace railfix::fusion
