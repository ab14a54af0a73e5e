// Boards drawn through a known lens: every pixel's rays meet the board's plane, so the truth is exact.
#include "lens/lens_calibration.hpp"

#include <gmock/gmock.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/random.hpp"

namespace railfix::tool {
namespace {

using ::testing::HasSubstr;

const geometry::Intrinsics kLens{560, 563, 331, 247, -0.24, 0.07, 0.0008, -0.0005, 640, 512};
constexpr int kSamples = 3;  // a pixel's side

/// Undistorted rays of all samples, made once.
const std::vector<cv::Point2f>& rays() {
  static const std::vector<cv::Point2f> all = [] {
    std::vector<cv::Point2f> made;
    for (int y = 0; y < kLens.height_px * kSamples; ++y) {
      for (int x = 0; x < kLens.width_px * kSamples; ++x) {
        const Eigen::Vector2d pixel((x + 0.5) / kSamples - 0.5, (y + 0.5) / kSamples - 0.5);
        const auto ray = geometry::undistort(kLens, pixel);
        made.emplace_back(static_cast<float>(ray.x()), static_cast<float>(ray.y()));
      }
    }
    return made;
  }();
  return all;
}

struct Pose {
  cv::Vec3d rotation;
  cv::Vec3d translation;  // of the board's corner, metres
};

/// `print` is the board as printed with a margin of one square; `square_m` wide squares.
cv::Mat photograph(const cv::Mat& print, int pixels_per_square, double square_m, const Pose& pose, uint64_t seed) {
  cv::Matx33d r;
  cv::Rodrigues(pose.rotation, r);
  // Board point (a, b): a * r0 + b * r1 + t = s * ray. Solved by the inverse of [r0 r1 t].
  const cv::Matx33d from_board(r(0, 0), r(0, 1), pose.translation[0], r(1, 0), r(1, 1), pose.translation[1], r(2, 0),
                               r(2, 1), pose.translation[2]);
  const cv::Matx33f to_board = cv::Matx33f(from_board.inv());
  cv::Mat fine(kLens.height_px * kSamples, kLens.width_px * kSamples, CV_8UC1, cv::Scalar(110));
  const auto scale = static_cast<float>(pixels_per_square / square_m);
  for (size_t i = 0; i < rays().size(); ++i) {
    const cv::Vec3f on = to_board * cv::Vec3f(rays()[i].x, rays()[i].y, 1);
    const auto x = static_cast<int>(std::floor(on[0] / on[2] * scale)) + pixels_per_square;
    const auto y = static_cast<int>(std::floor(on[1] / on[2] * scale)) + pixels_per_square;
    if (x < 0 || y < 0 || x >= print.cols || y >= print.rows) continue;
    fine.data[i] = static_cast<uint8_t>(30 + print.at<uint8_t>(y, x) * 0.7);
  }
  cv::Mat picture;
  cv::resize(fine, picture, {kLens.width_px, kLens.height_px}, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(picture, picture, {}, 0.6);
  core::Random random(seed);
  for (int i = 0; i < picture.rows * picture.cols; ++i) {
    picture.data[i] = cv::saturate_cast<uint8_t>(picture.data[i] + random.normal(0, 2));
  }
  return picture;
}

/// The board's middle at (x, y) of the field (-1..1), so far away, tilted.
Pose pose_at(double x, double y, double distance_m, double tilt_x, double tilt_y, const BoardDescription& board) {
  const cv::Vec3d rotation(tilt_x, tilt_y, 0.05);
  cv::Matx33d r;
  cv::Rodrigues(rotation, r);
  const cv::Vec3d middle(board.columns * board.square_m / 2, board.rows * board.square_m / 2, 0);
  const cv::Vec3d at(0.35 * x * distance_m, 0.28 * y * distance_m, distance_m);
  return {rotation, at - r * middle};
}

std::vector<Pose> good_poses(const BoardDescription& board, uint64_t seed) {
  core::Random random(seed);
  std::vector<Pose> poses;
  for (const double y : {-0.9, 0.0, 0.9}) {
    for (const double x : {-0.9, -0.3, 0.3, 0.9}) {
      const double tilt_x = random.uniform(-0.6, 0.6);
      poses.push_back(pose_at(x, y, random.uniform(0.42, 0.65), tilt_x, random.uniform(-0.6, 0.6), board));
    }
  }
  return poses;
}

/// The square of (error over sigma), averaged over the eight numbers.
double normalised_square(const LensCalibration& found) {
  const double errors[] = {
      (found.lens.fu_px - kLens.fu_px) / found.sigma.fu_px, (found.lens.fv_px - kLens.fv_px) / found.sigma.fv_px,
      (found.lens.cu_px - kLens.cu_px) / found.sigma.cu_px, (found.lens.cv_px - kLens.cv_px) / found.sigma.cv_px,
      (found.lens.k1 - kLens.k1) / found.sigma.k1,          (found.lens.k2 - kLens.k2) / found.sigma.k2,
      (found.lens.p1 - kLens.p1) / found.sigma.p1,          (found.lens.p2 - kLens.p2) / found.sigma.p2};
  double sum = 0;
  for (const double error : errors) {
    EXPECT_LT(std::abs(error), 4);
    sum += error * error / 8;
  }
  return sum;
}

LensCalibration calibrate(const BoardDescription& board, uint64_t seed) {
  const auto finder = core::value_or_throw(BoardFinder::make(board));
  constexpr int kPrint = 60;
  const cv::Mat print = finder.draw(kPrint);
  std::vector<BoardView> views;
  for (const auto& pose : good_poses(board, seed)) {
    const cv::Mat picture = photograph(print, kPrint, board.square_m, pose, seed + views.size());
    if (auto view = finder.find("picture", picture)) views.push_back(std::move(*view));
  }
  EXPECT_GE(views.size(), 8U);
  return core::value_or_throw(calibrate_lens(views, {kLens.width_px, kLens.height_px}));
}

TEST(LensCalibration, AChessboardGivesTheLensWithinItsSigmas) {
  const auto found = calibrate({9, 7, 0.03, 0, ""}, 1);
  const double sum = normalised_square(found);
  EXPECT_LT(found.rms_px, 0.15);
  EXPECT_LT(found.sigma.fu_px, 1.5);
  EXPECT_LT(sum, 2.5) << "the sigmas are too small";
  EXPECT_GT(sum, 0.1) << "the sigmas are too large";
}

TEST(LensCalibration, ACharucoBoardMayBePartlyOutOfThePicture) {
  const auto found = calibrate({9, 7, 0.04, 0.03, "5X5_100"}, 5);
  EXPECT_LT(normalised_square(found), 3);
  EXPECT_GT(found.coverage, 0.7);
}

std::vector<BoardView> exact(const std::vector<Pose>& poses) {
  std::vector<BoardView> views;
  core::Random random(3);
  for (const auto& pose : poses) {
    BoardView view;
    view.name = std::to_string(views.size());
    for (int i = 0; i < 48; ++i)
      view.board_m.emplace_back(0.03F * static_cast<float>(i % 8), 0.03F * static_cast<float>(i / 8), 0.0F);
    const cv::Matx33d camera(kLens.fu_px, 0, kLens.cu_px, 0, kLens.fv_px, kLens.cv_px, 0, 0, 1);
    cv::projectPoints(view.board_m, pose.rotation, pose.translation, camera,
                      cv::Vec4d(kLens.k1, kLens.k2, kLens.p1, kLens.p2), view.pixels);
    for (auto& pixel : view.pixels) {
      pixel += cv::Point2f(static_cast<float>(random.normal(0, 0.1)), static_cast<float>(random.normal(0, 0.1)));
    }
    views.push_back(std::move(view));
  }
  return views;
}

TEST(LensCalibration, SaysWhichPicturesAreMissing) {
  const BoardDescription board{9, 7, 0.03, 0, ""};
  const cv::Size size(kLens.width_px, kLens.height_px);
  const auto message = [&](const std::vector<Pose>& poses) {
    const auto found = calibrate_lens(exact(poses), size);
    return found.ok() ? "was accepted" : found.error().message;
  };
  const std::vector<Pose> same(20, pose_at(0, 0, 0.6, 0.3, 0.2, board));
  EXPECT_THAT(message(same), HasSubstr("20 pictures, 1 of them different; at least 8"));
  std::vector<Pose> middle;
  std::vector<Pose> flat;
  for (const auto& good : good_poses(board, 1)) {
    Pose pose = good;
    const double i = static_cast<double>(middle.size());
    middle.push_back(
        pose_at(0.3 * std::sin(2 * i), 0.3 * std::cos(2 * i), 1.2, 0.5 * std::sin(i), 0.5 * std::cos(i), board));
    pose.rotation = {0, 0, 0.1};
    flat.push_back(pose);
  }
  EXPECT_THAT(message(middle), HasSubstr("into the corners"));
  EXPECT_THAT(message(flat), HasSubstr("tilt it by 30 degrees"));
  EXPECT_EQ(message(good_poses(board, 1)), "was accepted");
}

TEST(LensCalibration, APictureThatDoesNotAgreeIsLeftOut) {
  auto views = exact(good_poses({9, 7, 0.03, 0, ""}, 2));
  for (size_t i = 0; i < views[4].pixels.size(); i += 2) views[4].pixels[i].x += 4;
  const auto found = calibrate_lens(views, {kLens.width_px, kLens.height_px});
  ASSERT_TRUE(found.ok()) << found.error().message;
  EXPECT_THAT(found.value().outliers, ::testing::ElementsAre("4"));
  EXPECT_LT(normalised_square(found.value()), 3);
}

TEST(Board, WhatCannotBe) {
  EXPECT_FALSE(BoardFinder::make({3, 7, 0.03, 0, ""}).ok());
  EXPECT_FALSE(BoardFinder::make({9, 7, 0, 0, ""}).ok());
  EXPECT_FALSE(BoardFinder::make({9, 7, 0.03, 0.03, "5X5_100"}).ok());
  EXPECT_FALSE(BoardFinder::make({9, 7, 0.03, 0.02, "9X9"}).ok());
  EXPECT_TRUE(BoardFinder::make({10, 10, 0.03, 0.02, "5X5_50"}).ok());
  const auto too_large = BoardFinder::make({11, 10, 0.03, 0.02, "5X5_50"});
  ASSERT_FALSE(too_large.ok());
  EXPECT_THAT(too_large.error().message, ::testing::HasSubstr("has 50 markers, and the board has 55"));
}

}  // namespace
}  // namespace railfix::tool
