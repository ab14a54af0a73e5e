// How well the own track's rails are found in real cab pictures. Three groups of ../shared/data:
//   cabview   a drive with rail masks: every frame of the masks once alone (cold start) and once as a sequence, and how
//             many of all 135 frames are seen
//   switches  16 pictures of 16 unknown cameras, each a cold start without a mount
//   tram      a sequence on grass track and crossings, 640 x 368, its mount calibrated from itself
// railfix-bench-rails-on-real-pictures [--draw DIR]
//
// The masks are thin lines along the middle of each rail head, of all tracks. Therefore the found inner edge is moved
// outwards by half a head before it is compared: in every fifth row from the horizon + 60 px to the bottom,
// horizontally, with the middle of the nearest mask run. Rows without a run within 40 px (overlaid text, end of the
// mask) do not count. A frame is right when the median over the rows of both rails is within 4 px. Switches and tram
// are compared with labels.csv: middles of both heads in two rows, read off by eye to about 0.3 % of the width; right
// when no label is farther off than 0.8 % of it. Two switch pictures have no label: over a merging switch the
// own track cannot be told.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "track_detector/draw.hpp"
#include "track_detector/mount_calibration.hpp"
#include "track_detector/track_detector.hpp"

namespace {

namespace fs = std::filesystem;
using namespace railfix::track_detector;
using railfix::geometry::Intrinsics;
using railfix::geometry::View;

constexpr double kGaugeM = 1.435;
constexpr double kFocalPerWidth = 0.72;
constexpr double kRightPx = 4;
constexpr double kRightShare = 0.008;  // of the width, against labels
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

std::string draw_folder;

void draw(const std::string& name, const cv::Mat& grey, const Intrinsics& camera, const TrackObservation& observation) {
  if (draw_folder.empty()) return;
  cv::Mat colour;
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  draw_track(colour, camera, observation, kGaugeM);
  cv::imwrite(draw_folder + "/" + name + ".jpg", colour);
}

std::vector<fs::path> pictures_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".jpg") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::vector<cv::Mat> read_grey(const std::vector<fs::path>& files) {
  std::vector<cv::Mat> pictures;
  for (const auto& file : files) pictures.push_back(cv::imread(file.string(), cv::IMREAD_GRAYSCALE));
  return pictures;
}

Intrinsics usual_camera(const cv::Size& size) {
  const double focal_px = kFocalPerWidth * size.width;
  return {focal_px, focal_px, (size.width - 1) / 2.0, (size.height - 1) / 2.0, 0, 0, 0, 0, size.width, size.height};
}

/// Both rails' middles in one row.
struct Label {
  double row = 0;
  double left_u = 0;
  double right_u = 0;
};

std::map<std::string, std::vector<Label>> read_labels(const std::string& group) {
  std::ifstream file(fs::path(RAILFIX_SOURCE_DIR) / "tests/benchmark/rails_on_real_pictures/labels.csv");
  std::map<std::string, std::vector<Label>> labels;
  std::string line;
  while (std::getline(file, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    std::string its_group;
    std::string picture;
    Label label;
    if (fields >> its_group >> picture >> label.row >> label.left_u >> label.right_u && its_group == group)
      labels[picture].push_back(label);
  }
  return labels;
}

/// Largest distance of the found rails from the labels.
double worst_distance(const Intrinsics& camera, const TrackObservation& observation, const std::vector<Label>& labels) {
  const View view(camera, observation.shape.camera);
  double worst = 0;
  for (const auto& label : labels) {
    for (const auto side : {Side::left, Side::right}) {
      const auto column = column_in_row(view, observation.shape, side, {}, label.row);
      const double u = side == Side::left ? label.left_u : label.right_u;
      worst = std::max(worst, column ? std::abs(*column - u) : 1e3);
    }
  }
  return worst;
}

void judge(const std::string& group, const std::string& name, const Intrinsics& camera,
           const TrackObservation& observation, const std::vector<Label>& labels, std::map<std::string, int>& tally) {
  if (labels.empty()) {
    ++tally[observation.seen() ? "seen, no label" : "not seen, no label"];
    return;
  }
  const double worst = worst_distance(camera, observation, labels);
  const char* verdict = !observation.seen() ? "not seen" : worst <= kRightShare * camera.width_px ? "right" : "WRONG";
  ++tally[verdict];
  std::printf("  %s %s: %s, %.1f px from the labels, confidence %.2f %s\n", group.c_str(), name.c_str(), verdict, worst,
              observation.confidence, observation.reason.c_str());
}

void print(const std::string& group, const std::map<std::string, int>& tally) {
  std::printf("%s:", group.c_str());
  for (const auto& [verdict, count] : tally) std::printf("  %s %d", verdict.c_str(), count);
  std::printf("\n");
}

void switches(const fs::path& folder) {
  const auto labels = read_labels("switches");
  std::map<std::string, int> tally;
  for (const auto& file : pictures_in(folder)) {
    const cv::Mat grey = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
    const auto camera = usual_camera(grey.size());
    const auto observation = find_rails_anywhere(camera, grey, kGaugeM);
    const auto name = file.stem().string();
    const auto known = labels.find(name);
    judge("switches", name, camera, observation, known == labels.end() ? std::vector<Label>{} : known->second, tally);
    draw("switches-" + name, grey, camera, observation);
  }
  print("switches", tally);
}

/// A sequence whose mount is calibrated from itself.
void sequence(const std::string& group, const fs::path& folder) {
  const auto files = pictures_in(folder);
  const auto pictures = read_grey(files);
  const auto camera = usual_camera(pictures.front().size());
  MountCalibrator calibrator(camera, kGaugeM);
  for (const auto& picture : pictures) calibrator.add(picture);
  const auto mount = calibrator.solve();
  if (!mount.ok()) {
    std::printf("%s: %s\n", group.c_str(), mount.error().message.c_str());
    return;
  }
  const auto labels = read_labels(group);
  TrackDetector detector(camera, mount.value().mount, {});
  std::map<std::string, int> tally;
  int seen = 0;
  for (size_t i = 0; i < pictures.size(); ++i) {
    const auto observation = detector.detect(pictures[i]);
    const auto name = files[i].stem().string();
    seen += observation.seen() ? 1 : 0;
    const auto known = labels.find(name);
    if (known != labels.end()) judge(group, name, camera, observation, known->second, tally);
    draw(group + "-" + name, pictures[i], camera, observation);
  }
  std::printf("%s: both rails seen in %d of %zu pictures\n", group.c_str(), seen, pictures.size());
  if (!tally.empty()) print(group, tally);
}

void masks(const fs::path& folder) {
  std::vector<fs::path> masks;
  for (const auto& entry : fs::directory_iterator(folder / "rail_masks")) masks.push_back(entry.path());
  std::sort(masks.begin(), masks.end());
  std::vector<fs::path> files;
  for (const auto& mask : masks) files.push_back(folder / "frames" / (mask.stem().string() + ".jpg"));
  const auto pictures = read_grey(files);
  const auto camera = usual_camera(pictures.front().size());
  MountCalibrator calibrator(camera, kGaugeM);
  for (const auto& picture : pictures) calibrator.add(picture);
  const auto mount = calibrator.solve();
  if (!mount.ok()) {
    std::printf("cabview: %s\n", mount.error().message.c_str());
    return;
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
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  if (argc == 3 && std::string(argv[1]) == "--draw") draw_folder = argv[2];
  if (!draw_folder.empty()) std::filesystem::create_directories(draw_folder);
  const auto folder = data_folder();
  if (!fs::exists(folder / "cabview")) {
    std::printf("skipped: no pictures in %s (set RAILFIX_DATA)\n", folder.c_str());
    return 0;
  }
  masks(folder / "cabview");
  sequence("cabview", folder / "cabview" / "frames");
  switches(folder / "switches");
  sequence("tram", folder / "tram" / "day");
  return 0;
}
