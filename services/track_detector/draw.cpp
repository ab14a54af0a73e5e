#include "track_detector/draw.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "core/units.hpp"

namespace railfix::track_detector {
namespace {

const cv::Scalar kLeft(80, 220, 60);
const cv::Scalar kRight(60, 160, 255);
const cv::Scalar kHorizon(255, 200, 80);
const cv::Scalar kWarn(60, 60, 255);
constexpr int kShift = 4;  // sub-pixel bits of OpenCV's drawing

cv::Point fixed(const Eigen::Vector2d& pixel) {
  return {static_cast<int>(std::lround(pixel.x() * (1 << kShift))),
          static_cast<int>(std::lround(pixel.y() * (1 << kShift)))};
}

int pen(const cv::Mat& picture) {
  return std::max(1, picture.cols / 800);
}

void draw_rail(cv::Mat& picture, const geometry::View& view, const TrackObservation& observation, Side side,
               double gauge_m) {
  std::vector<cv::Point> line;
  for (double x = std::max(1.0, 0.8 * observation.near_m); x < observation.far_m; x *= 1.03) {
    if (const auto pixel = view.project(rail_point(observation.shape, side, gauge_m, x))) line.push_back(fixed(*pixel));
  }
  cv::polylines(picture, line, false, side == Side::left ? kLeft : kRight, pen(picture), cv::LINE_AA, kShift);
}

struct Words {
  std::string text;
  cv::Scalar colour;
};

// On a darkened band, so that they can be read in front of sky and of ballast.
void write(cv::Mat& picture, const std::vector<Words>& lines) {
  if (lines.empty()) return;
  constexpr double kWidestPx = 1080;  // of the pose's longest line at scale 1
  const double size = picture.cols / kWidestPx * 0.72;
  const int step = static_cast<int>(34 * size);
  const int margin = static_cast<int>(14 * size);
  const cv::Rect whole({}, picture.size());
  const cv::Rect band(0, 0, picture.cols, static_cast<int>(lines.size()) * step + margin);
  cv::Mat behind = picture(band & whole);
  behind.convertTo(behind, -1, 0.35);
  cv::Point at(margin, step - margin / 4);
  for (const auto& line : lines) {
    cv::putText(picture, line.text, at, cv::FONT_HERSHEY_SIMPLEX, 0.8 * size, line.colour,
                std::max(1, static_cast<int>(std::lround(1.8 * size))), cv::LINE_AA);
    at.y += step;
  }
}

std::vector<Words> describe(const TrackObservation& observation) {
  const auto& camera = observation.shape.camera;
  const auto sigma = [&](int k) { return std::sqrt(std::max(0.0, observation.covariance(k, k))); };
  const auto deg = [](double rad) { return core::deg_from_rad(rad); };
  const cv::Scalar white = cv::Scalar::all(255);
  std::vector<Words> lines;
  char text[200];
  std::snprintf(text, sizeof text, "roll %+.2f +-%.2f   pitch %.2f +-%.2f   yaw %+.2f +-%.2f deg", deg(camera.roll_rad),
                deg(sigma(0)), deg(camera.pitch_rad), deg(sigma(1)), deg(camera.yaw_rad), deg(sigma(2)));
  lines.push_back({text, white});
  std::snprintf(text, sizeof text, "camera %.3f +-%.3f m above the rails, %.3f +-%.3f m %s of the track centre",
                camera.height_m, sigma(4), std::abs(camera.lateral_m), sigma(3),
                camera.lateral_m < 0 ? "right" : "left");
  lines.push_back({text, white});
  const double beta = observation.shape.curvature_per_m;
  std::snprintf(text, sizeof text, "curvature %+.2f +-%.2f /km (%s)   vertical %+.2f +-%.2f /km   residual %.2f px",
                1e3 * beta, 1e3 * sigma(5),
                std::abs(beta) < 2 * sigma(5) ? "straight"
                : beta > 0                    ? "left"
                                              : "right",
                1e3 * observation.shape.vertical_curvature_per_m, 1e3 * sigma(6), observation.residual_px);
  lines.push_back({text, white});
  return lines;
}

}  // namespace

void draw_track(cv::Mat& picture, const geometry::Intrinsics& camera, const TrackObservation& observation,
                double gauge_m) {
  const geometry::View view(camera, observation.shape.camera);
  const int horizon = static_cast<int>(std::lround(view.horizon_v_px()));
  cv::line(picture, {0, horizon}, {picture.cols - 1, horizon}, kHorizon, 1);
  if (observation.seen_left) draw_rail(picture, view, observation, Side::left, gauge_m);
  if (observation.seen_right) draw_rail(picture, view, observation, Side::right, gauge_m);
  std::vector<Words> lines;
  if (observation.seen_left || observation.seen_right) {
    for (const auto& point : observation.points) {
      cv::circle(picture, fixed(point.pixel), (2 + pen(picture)) << kShift, point.side == Side::left ? kLeft : kRight,
                 pen(picture), cv::LINE_AA, kShift);
    }
    lines = describe(observation);
  }
  if (!observation.seen_left) lines.push_back({"left rail not seen", kWarn});
  if (!observation.seen_right) lines.push_back({"right rail not seen", kWarn});
  if (!observation.reason.empty()) lines.push_back({observation.reason, kWarn});
  write(picture, lines);
}

void draw_words(cv::Mat& picture, const std::vector<std::string>& warnings) {
  std::vector<Words> lines;
  for (const auto& warning : warnings) lines.push_back({warning, kWarn});
  write(picture, lines);
}

}  // namespace railfix::track_detector
