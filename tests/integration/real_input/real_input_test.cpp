// What an engineer does with a recording: a plain folder of pictures or a video and a calibration, through the real
// services, every picture drawn.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "dataset/dataset.hpp"
#include "support/program.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

constexpr double kSimulateS = 600;
constexpr double kRunS = 120;

size_t files_in(const fs::path& folder) {
  return static_cast<size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

fs::path shared_data() {
  if (const char* folder = std::getenv("RAILFIX_DATA")) return folder;
  return fs::path(RAILFIX_SOURCE_DIR).parent_path() / "shared" / "data";
}

class RealInput : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::temp_directory_path() / ("railfix-real-input-" + std::to_string(getpid()));
    const auto sequence = folder_ / "seq";
    simulated_ =
        test::run_program({"railfix", "simulate", "--out", sequence, "--length-m", "40", "--speed-kmh", "72", "--size",
                           "640x512", "--rate-hz", "5", "--format", "jpg", "--seed", "3", "--start", "1:250"},
                          kSimulateS);
    if (simulated_.exit_code != 0) return;
    fs::copy(sequence / "mav0" / "cam0" / "sensor.yaml", camera());
    fs::copy(sequence / "mav0" / "cam0" / "data", pictures());
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }
  void SetUp() override { ASSERT_EQ(simulated_.exit_code, 0) << simulated_.err; }

  static std::string camera() { return folder_ / "camera.yaml"; }
  static std::string pictures() { return folder_ / "pictures"; }
  static test::Outcome run(const std::string& source, const std::string& name, const std::string& calibration) {
    const auto out = folder_ / name;
    return test::run_program({"railfix", "run", "--pictures", source, "--camera", calibration, "--fps", "5", "--out",
                              out, "--draw", out / "drawn"},
                             kRunS);
  }

  static fs::path folder_;
  static test::Outcome simulated_;
};
fs::path RealInput::folder_;
test::Outcome RealInput::simulated_;

TEST_F(RealInput, EveryPictureOfAFolderIsDrawnAndAStrangeOneIsNamed) {
  const size_t good = files_in(pictures());
  ASSERT_GT(good, 5U);
  const auto strange = fs::path(pictures()) / "zz_other_size.jpg";
  cv::imwrite(strange, cv::Mat(100, 200, CV_8UC1, cv::Scalar(90)));
  const auto outcome = run(pictures(), "of_folder", camera());
  fs::remove(strange);
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  EXPECT_EQ(files_in(folder_ / "of_folder" / "drawn"), good + 1);
  EXPECT_THAT(outcome.out, HasSubstr("both rails seen on " + std::to_string(good) + ", not seen on 0, left out 1"));
  EXPECT_THAT(test::slurp(folder_ / "of_folder" / "log" / "frame_grabber.log"), HasSubstr("zz_other_size.jpg"));
}

TEST_F(RealInput, AStartThatIsNotOnTheMapIsRefusedBeforeAnythingStarts) {
  const auto out = folder_ / "of_wrong_start";
  for (const auto& [start, why] : {std::pair{"99:1:+", "the map has no edge \"99\""},
                                   {"1:1e9", "is not on edge 1"},
                                   {"banana", "is not a place on the map"}}) {
    const auto outcome =
        test::run_program({"railfix", "run", "--dataset", folder_ / "seq", "--start", start, "--out", out}, kRunS);
    EXPECT_EQ(outcome.exit_code, 2) << start;
    EXPECT_THAT(outcome.err, ::testing::StartsWith("railfix: --start: "));
    EXPECT_THAT(outcome.err, HasSubstr(why));
    EXPECT_FALSE(fs::exists(out / "log"));
  }
}

TEST_F(RealInput, AVideoKeepsItsColours) {
  const std::string video = folder_ / "cab.avi";
  cv::VideoWriter writer(video, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 5, {640, 512});
  ASSERT_TRUE(writer.isOpened());
  size_t frames = 0;
  for (const auto& file : fs::directory_iterator(pictures())) {
    ++frames;
    cv::Mat picture = cv::imread(file.path(), cv::IMREAD_COLOR);
    cv::multiply(picture, cv::Scalar(0.5, 0.8, 1.0), picture);
    writer.write(picture);
  }
  writer.release();
  const auto outcome = run(video, "of_video", camera());
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  EXPECT_EQ(files_in(folder_ / "of_video" / "drawn"), frames);
  const cv::Mat drawn = cv::imread(folder_ / "of_video" / "drawn" / "000000.jpg", cv::IMREAD_COLOR);
  ASSERT_EQ(drawn.size(), cv::Size(640, 512));
  const cv::Scalar mean = cv::mean(drawn);
  EXPECT_GT(mean[2], 1.3 * mean[0]);
}

TEST_F(RealInput, PicturesOfAnotherSizeThanTheCalibrationAreRefusedInOneSentence) {
  const auto folder = folder_ / "other";
  fs::create_directories(folder);
  cv::imwrite(folder / "0.jpg", cv::Mat(100, 200, CV_8UC1, cv::Scalar(90)));
  const auto outcome = run(folder, "of_other", camera());
  EXPECT_NE(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("the pictures have 200x100 pixels, but the calibration is for 640x512"));
}

TEST_F(RealInput, CabPictures) {
  const auto frames = shared_data() / "cabview" / "frames";
  if (!fs::exists(frames)) GTEST_SKIP() << "skipped: no pictures in " << frames << " (set RAILFIX_DATA)";
  const auto folder = folder_ / "cab";
  fs::create_directories(folder);
  for (const char* name : {"0000.jpg", "0010.jpg", "0020.jpg", "0030.jpg", "0062.jpg"}) fs::copy(frames / name, folder);
  dataset::CameraCalibration calibration;
  calibration.intrinsics = {1382.4, 1382.4, 959.5, 539.5, 0, 0, 0, 0, 1920, 1080};
  calibration.mount = geometry::CameraPose{0, 0.0509, -0.0025, 0.018, 3.044};
  ASSERT_TRUE(dataset::write_calibration(folder_ / "cab.yaml", calibration).ok());
  const auto outcome = run(folder, "of_cab", folder_ / "cab.yaml");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err << outcome.out;
  EXPECT_EQ(files_in(folder_ / "of_cab" / "drawn"), 5U);
  EXPECT_THAT(outcome.out, HasSubstr("both rails seen on 5"));
}

}  // namespace
}  // namespace railfix
