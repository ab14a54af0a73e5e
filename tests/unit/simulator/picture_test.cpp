#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "scene.hpp"
#include "simulator/dataset_writer.hpp"

namespace railfix::simulator {
namespace {

// Where the grey level crosses the middle between rail head (outside) and its dark side (inside), along the row.
double edge_u(const cv::Mat& picture, double u, double v, int side) {
  const int row = static_cast<int>(std::lround(v));
  const int middle = static_cast<int>(std::lround(u));
  const int out = side > 0 ? -1 : 1;  // the left rail's head lies left of its inner edge
  double bright = 0.0;
  double dark = 255.0;
  for (int k = 1; k <= 2; ++k) {
    bright = std::max<double>(bright, picture.at<uint8_t>(row, middle + k * out));
    dark = std::min<double>(dark, picture.at<uint8_t>(row, middle - k * out));
  }
  const double half = 0.5 * (bright + dark);
  for (int k = -3; k < 3; ++k) {
    const double a = picture.at<uint8_t>(row, middle + k * out);
    const double b = picture.at<uint8_t>(row, middle + (k + 1) * out);
    if (a < half && b >= half) return middle + (k + (half - a) / (b - a)) * out;
  }
  return std::nan("");
}

// Errors of the edges (px, along the row) at many places on both rails.
std::vector<double> edge_errors(const std::shared_ptr<const Line>& line, const RenderOptions& options,
                                const Shot& shot) {
  const Renderer renderer(line, options);
  const cv::Mat picture = renderer.render(shot);
  std::vector<double> errors;
  for (const int side : {1, -1}) {
    for (double ahead = 5.0; ahead < 16.0; ahead += 0.21) {
      const auto pixel = rail_edge_px(*line, truth_of(shot), options.camera, ahead, side);
      const auto beyond = rail_edge_px(*line, truth_of(shot), options.camera, ahead + 0.01, side);
      if (!pixel || pixel->y() > options.camera.height_px - 2 || pixel->x() < 5 ||
          pixel->x() > options.camera.width_px - 6)
        continue;
      // The row's own place on the edge, a fraction of a pixel away.
      const double slope = (beyond->x() - pixel->x()) / (beyond->y() - pixel->y());
      const double row = std::round(pixel->y());
      const double expected = pixel->x() + slope * (row - pixel->y());
      errors.push_back(side *
                       (expected - edge_u(picture, expected, row, side)));  // positive: inner edge seen too far out
    }
  }
  return errors;
}

double median_of_magnitudes(std::vector<double> values) {
  for (auto& value : values) value = std::isnan(value) ? 9.0 : std::abs(value);
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

TEST(Picture, RailEdgesLieWhereTheTruthSays) {
  struct Case {
    const char* what;
    const char* start;
    double distance_m;
    geometry::CameraPose pose;
    double k1;
  };
  for (const auto& one : {Case{"straight", "1:100", 20, {0, 0.2094, 0, 0, 2.5}, 0},
                          Case{"shaken", "1:100", 21, {0.02, 0.22, -0.03, 0.2, 2.3}, 0},
                          Case{"curve", "1:430", 60, {0, 0.2094, 0, 0, 2.5}, 0},
                          Case{"transition with twist", "3:100", 60, {0, 0.2094, 0, 0, 2.5}, 0},
                          Case{"vertical curve", "1:280", 5, {0, 0.2094, 0, 0, 2.5}, 0},
                          Case{"lens", "1:100", 20, {0, 0.2094, 0, 0, 2.5}, -0.12}}) {
    auto options = small_camera();
    options.camera.k1 = one.k1;
    options.read_noise_grey = 0.2;
    options.shot_noise_grey = 0.0;
    auto shot = standing_at(one.distance_m);
    shot.pose = one.pose;
    const auto errors = edge_errors(line_from(one.start), options, shot);
    ASSERT_GT(errors.size(), 50U) << one.what;
    // Linear interpolation between two pixels of an edge is itself wrong by up to 0.13 px, but not on average.
    EXPECT_LT(median_of_magnitudes(errors), 0.2) << one.what;
    const double mean = std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(errors.size());
    EXPECT_LT(std::abs(mean), 0.06) << one.what;
  }
}

// The ground between the rails, looked at from above: rows along the track, 5 mm a pixel.
cv::Mat ground_from_above(const cv::Mat& picture, const geometry::View& view, double depth_m, double from_m) {
  cv::Mat map_u(600, 160, CV_32FC1);
  cv::Mat map_v(600, 160, CV_32FC1);
  for (int i = 0; i < map_u.rows; ++i) {
    for (int j = 0; j < map_u.cols; ++j) {
      const auto pixel = view.project({from_m + i * 0.005, (80 - j) * 0.005, -depth_m});
      map_u.at<float>(i, j) = static_cast<float>(pixel->x());
      map_v.at<float>(i, j) = static_cast<float>(pixel->y());
    }
  }
  cv::Mat above;
  cv::remap(picture, above, map_u, map_v, cv::INTER_LINEAR);
  cv::Mat real;
  above.convertTo(real, CV_32F);
  return real;
}

TEST(Picture, GroundMovesAsTheTruthSays) {
  const auto line = line_from("1:100");
  auto options = small_camera();
  options.ballast_depth_m = options.texture_depth_m;  // one plane, one shift
  const Renderer renderer(line, options);
  const geometry::View view(options.camera, standing_at(0).pose);
  for (const double step_m : {0.137, 0.61, 1.003}) {
    auto second = standing_at(50.0 + step_m);
    second.noise_seed = 5;
    const cv::Mat a = ground_from_above(renderer.render(standing_at(50.0)), view, options.texture_depth_m, 4.5);
    const cv::Mat b = ground_from_above(renderer.render(second), view, options.texture_depth_m, 4.5);
    // The strip 1.2 m ahead in the first picture is found nearer in the second.
    const int first_row = 280;
    cv::Mat score;
    cv::matchTemplate(b, a.rowRange(first_row, first_row + 200), score, cv::TM_CCOEFF_NORMED);
    cv::Point best;
    double value = 0;
    cv::minMaxLoc(score, nullptr, &value, nullptr, &best);
    const double left = score.at<float>(best.y - 1, 0);
    const double right = score.at<float>(best.y + 1, 0);
    const double peak = best.y + 0.5 * (left - right) / (left - 2.0 * value + right);
    EXPECT_NEAR((first_row - peak) * 0.005, step_m, 0.002);
    EXPECT_GT(value, 0.7);
  }
}

TEST(Picture, GroundNeverRepeats) {
  const auto line = line_from("1:100");
  const auto options = small_camera();
  const Renderer renderer(line, options);
  const geometry::View view(options.camera, standing_at(0).pose);
  const cv::Mat a = ground_from_above(renderer.render(standing_at(50.0)), view, 0.18, 4.5);
  for (const double period_m : {0.6, 2.4, 4.096, 4.8, 12.0, 61.44}) {
    const cv::Mat b = ground_from_above(renderer.render(standing_at(50.0 + period_m)), view, 0.18, 4.5);
    // One bay of ballast between two sleepers.
    for (int row = 0; row + 60 < a.rows; row += 60) {
      cv::Mat score;
      cv::matchTemplate(b.rowRange(row, row + 60), a.rowRange(row, row + 60), score, cv::TM_CCOEFF_NORMED);
      EXPECT_LT(score.at<float>(0, 0), 0.93) << period_m << " m, row " << row;
    }
  }
}

TEST(Picture, SameSeedSameBytes) {
  const auto line = line_from("1:100");
  auto options = small_camera();
  const cv::Mat a = Renderer(line, options).render(standing_at(70.0));
  const cv::Mat b = Renderer(line_from("1:100"), options).render(standing_at(70.0));
  EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0.0);
  options.seed = 2;
  const cv::Mat c = Renderer(line, options).render(standing_at(70.0));
  EXPECT_GT(cv::norm(a, c, cv::NORM_L1), 1e6);
}

TEST(Picture, StripIsTheWholePictureThereAndNothingBeside) {
  const auto line = line_from("1:100");
  auto options = small_camera();
  const auto shot = standing_at(20.0);
  const cv::Mat whole = Renderer(line, options).render(shot);
  options.strip = {25.0, 1.2};
  const cv::Mat strip = Renderer(line, options).render(shot);
  const geometry::View view(options.camera, shot.pose);
  int compared = 0;
  for (double x = 5.0; x < 20.0; x += 0.5) {
    for (const double y : {-1.0, 0.0, 1.0}) {
      const auto pixel = view.project({x, y, 0.0});
      if (!pixel || pixel->y() > 510) continue;
      const int u = static_cast<int>(pixel->x());
      const int v = static_cast<int>(pixel->y());
      // Means of a few pixels, because each picture has its own noise.
      const cv::Rect patch(u - 4, v, 9, 1);
      EXPECT_NEAR(cv::mean(whole(patch))[0], cv::mean(strip(patch))[0], 6.0) << x << " " << y;
      ++compared;
    }
  }
  EXPECT_GT(compared, 60);
  EXPECT_EQ(cv::norm(strip(cv::Rect(0, 0, 640, 100)), cv::NORM_INF), cv::norm(strip.row(0), cv::NORM_INF));
  EXPECT_LT(cv::countNonZero(strip != strip.at<uint8_t>(0, 0)), strip.total() * 2 / 5);
}

TEST(Picture, BaliseIsWhereTheLandmarkSays) {
  const auto line = line_from("1:180");  // balises at 20 and 23 m
  ASSERT_GE(line->balises().size(), 2U);
  const auto options = small_camera();
  const auto shot = standing_at(line->balises()[0].distance_m - 8.0);
  const cv::Mat picture = Renderer(line, options).render(shot);
  const geometry::View view(options.camera, shot.pose);
  const auto grey = [&](double x, double y) {
    const auto pixel = view.project({x, y, -0.12});
    return cv::mean(picture(cv::Rect(static_cast<int>(pixel->x()) - 1, static_cast<int>(pixel->y()), 3, 1)))[0];
  };
  EXPECT_GT(grey(8.0, 0.0), 140.0);
  EXPECT_GT(grey(8.12, 0.2), 140.0);
  EXPECT_GT(grey(11.0, 0.0), 140.0);
  EXPECT_LT(grey(8.0, 0.34), 140.0);
  EXPECT_LT(grey(9.5, 0.0), 140.0);
}

TEST(Picture, SwitchShowsBothTracksFromBothSides) {
  for (const char* start : {"2:20", "2:405", "2:440:-"}) {
    const auto line = line_from(start);
    const auto options = small_camera();
    const auto shot = standing_at(12.0);
    const cv::Mat picture = Renderer(line, options).render(shot);
    // Somewhere left or right of the own rails 15 m ahead another rail shines; nothing is broken (white noise).
    const geometry::View view(options.camera, shot.pose);
    const int row = static_cast<int>(view.project({9.0, 0.0, 0.0})->y());
    const int begin = static_cast<int>(view.project({9.0, 3.6, 0.0})->x());
    const int end = static_cast<int>(view.project({9.0, -3.6, 0.0})->x());
    int bright = 0;
    for (int u = std::max(begin, 0); u < std::min(end, picture.cols); ++u) bright += picture.at<uint8_t>(row, u) > 155;
    EXPECT_GT(bright, 10) << start;
    EXPECT_LT(bright, 60) << start;
  }
}

TEST(Picture, TunnelIsDark) {
  const auto line = line_from("3:700");  // portal at 60 m, 150 m long
  const auto options = small_camera();
  const Renderer renderer(line, options);
  const double outside = cv::mean(renderer.render(standing_at(10.0)))[0];
  const double inside = cv::mean(renderer.render(standing_at(130.0)))[0];
  EXPECT_LT(inside, 0.4 * outside);
  EXPECT_DOUBLE_EQ(line->depth_in_tunnel_m(59.0), 0.0);
  EXPECT_NEAR(line->depth_in_tunnel_m(70.0), 10.0, 1e-6);
}

}  // namespace
}  // namespace railfix::simulator
