// How well the ego track's rails are found in real cab pictures with rail masks (data/cabview): every frame once alone
// (cold start) and once as a sequence.
//
// The masks are thin lines along the middle of each rail head, of all tracks. Therefore the found inner edge is moved
// outwards by half a head before it is compared: in every fifth row from the horizon + 60 px to the bottom,
// horizontally, with the middle of the nearest mask run. Rows without a run within 40 px (overlaid text, end of the
// mask) do not count. A frame is right when the median over the rows of both rails is within 4 px.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <vector>

#include "track_detector/mount_calibration.hpp"
#include "track_detector/track_detector.hpp"

namespace {

namespace fs = std::filesystem;
using namespace railfix::track_detector;
using railfix::geometry::Intrinsics;
using railfix::geometry::View;

constexpr double kFocalPerWidth = 0.72;
constexpr double kRightPx = 4;
constexpr double kSearchPx = 40;
constexpr double kBelowHorizonPx = 60;

fs::path data_folder() {
  if (const char* folder = std::getenv("RAILFIX_DATA")) return folder;
  return fs::path(RAILFIX_SOURCE_DIR).parent_path() / "shared" / "data";
}

/// Middle of the mask run nearest to u in this row.
std::optional<double> mask_middle(const cv::Mat& mask, int row, double u) {
  const auto* pixels = mask.ptr<uint8_t>(row);
  std::optional<double> best;
  for (int c = std::max(0, static_cast<int>(u - 2 * kSearchPx));
       c < std::min(mask.cols, static_cast<int>(u + 2 * kSearchPx)); ++c) {
    if (pixels[c] == 0) continue;
    const int first = c;
    while (c + 1 < mask.cols && pixels[c + 1] != 0) ++c;
    if (c - first > 25) continue;  // text
    const double middle = 0.5 * (first + c);
    if (!best || std::abs(middle - u) < std::abs(*best - u)) best = middle;
  }
  if (best && std::abs(*best - u) > kSearchPx) best.reset();
  return best;
}

/// Column of a rail head's middle in a row.
std::optional<double> column_in_row(const View& view, const TrackShape& shape, Side side,
                                    const DetectorOptions& options, double row) {
  double near_m = 2;
  double far_m = 300;
  const auto at = [&](double x) {
    return view.project(rail_point(shape, side, options.gauge_m, x, options.head_m / 2));
  };
  for (int i = 0; i < 60; ++i) {
    const double middle = std::sqrt(near_m * far_m);
    const auto pixel = at(middle);
    if (!pixel) return std::nullopt;
    (pixel->y() > row ? near_m : far_m) = middle;
  }
  const auto pixel = at(near_m);
  if (!pixel || std::abs(pixel->y() - row) > 1) return std::nullopt;
  return pixel->x();
}

double median(std::vector<double> values) {
  if (values.empty()) return std::nan("");
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

double median_distance(const Intrinsics& camera, const TrackObservation& observation, const DetectorOptions& options,
                       const cv::Mat& mask) {
  const View view(camera, observation.shape.camera);
  std::vector<double> distances;
  for (int row = static_cast<int>(view.horizon_v_px() + kBelowHorizonPx); row < mask.rows; row += 5) {
    for (const auto side : {Side::left, Side::right}) {
      const auto column = column_in_row(view, observation.shape, side, options, row);
      if (!column) continue;
      const auto middle = mask_middle(mask, row, *column);
      if (middle) distances.push_back(std::abs(*middle - *column));
    }
  }
  return distances.size() < 40 ? std::nan("") : median(std::move(distances));
}

struct Tally {
  int frames = 0;
  int seen = 0;
  int right = 0;
  std::vector<double> distances;
  void add(const TrackObservation& observation, double distance) {
    ++frames;
    if (!observation.seen()) return;
    ++seen;
    if (distance <= kRightPx) ++right;
    if (std::isfinite(distance)) distances.push_back(distance);
  }
  void print(const char* name) const {
    std::printf("%-22s %6d %6d %18d %14.2f px %14.2f px\n", name, frames, seen, right, median(distances),
                distances.empty() ? std::nan("") : *std::max_element(distances.begin(), distances.end()));
  }
};

}  // namespace

int main() {
  const auto folder = data_folder() / "cabview";
  if (!fs::exists(folder / "rail_masks")) {
    std::printf("skipped: no pictures in %s (set RAILFIX_DATA)\n", folder.c_str());
    return 0;
  }
  std::vector<fs::path> masks;
  for (const auto& entry : fs::directory_iterator(folder / "rail_masks")) masks.push_back(entry.path());
  std::sort(masks.begin(), masks.end());
  std::vector<cv::Mat> pictures;
  for (const auto& mask : masks) {
    pictures.push_back(cv::imread((folder / "frames" / mask.stem()).string() + ".jpg", cv::IMREAD_GRAYSCALE));
    if (pictures.back().empty()) {
      std::fprintf(stderr, "no picture for %s\n", mask.c_str());
      return 1;
    }
  }
  const auto size = pictures.front().size();
  const Intrinsics camera{kFocalPerWidth * size.width,
                          kFocalPerWidth * size.width,
                          (size.width - 1) / 2.0,
                          (size.height - 1) / 2.0,
                          0,
                          0,
                          0,
                          0,
                          size.width,
                          size.height};
  MountCalibrator calibrator(camera, 1.435);
  for (const auto& picture : pictures) calibrator.add(picture);
  const auto mount = calibrator.solve();
  if (!mount.ok()) {
    std::fprintf(stderr, "%s\n", mount.error().message.c_str());
    return 1;
  }
  const DetectorOptions options;
  TrackDetector detector(camera, mount.value().mount, options);
  Tally alone;
  Tally sequence;
  for (const bool single : {true, false}) {
    detector.reset();
    for (size_t i = 0; i < pictures.size(); ++i) {
      const cv::Mat mask = cv::imread(masks[i].string(), cv::IMREAD_GRAYSCALE);
      if (single) detector.reset();
      const auto observation = detector.detect(pictures[i]);
      const double distance = median_distance(camera, observation, options, mask);
      (single ? alone : sequence).add(observation, distance);
      if (!observation.seen() || !(distance <= kRightPx)) {
        std::printf("%s %s: %s, %.1f px from the mask\n", single ? "alone" : "sequence", masks[i].stem().c_str(),
                    observation.seen() ? "seen" : observation.reason.c_str(), distance);
      }
    }
  }
  std::printf("%-22s %6s %6s %18s %17s %17s\n", "cabview", "frames", "seen", "within 4 px", "median", "worst frame");
  alone.print("each picture alone");
  sequence.print("as a sequence");
  return 0;
}
