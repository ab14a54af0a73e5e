// railfix-measure-landmarks --dataset SEQ: balises found with the true camera poses, against truth/landmarks.csv.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>

#include "core/random.hpp"
#include "core/time.hpp"
#include "dataset/dataset.hpp"
#include "track_detector/landmark_finder.hpp"

namespace railfix {
namespace {

constexpr double kMatchM = 1.5;  // half the distance of the balises of a group

struct Found {
  double distance_m;
  track_detector::Sighting sighting;
};

double distance_at(const std::vector<dataset::TruthRow>& truth, int64_t stamp_ns) {
  const auto after = std::lower_bound(truth.begin() + 1, truth.end() - 1, stamp_ns,
                                      [](const dataset::TruthRow& row, int64_t t) { return row.stamp_ns < t; });
  const auto& a = *(after - 1);
  const auto& b = *after;
  const double share = static_cast<double>(stamp_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
  return a.distance_m + share * (b.distance_m - a.distance_m);
}

void judge(const std::vector<dataset::TruthLandmark>& landmarks, const std::vector<Found>& found, double begin_m,
           double end_m) {
  int expected = 0;
  int hit = 0;
  int right = 0;
  double sum = 0;
  double squared = 0;
  double normalised = 0;
  for (const auto& landmark : landmarks) {
    if (landmark.kind != "balise" || landmark.distance_m < begin_m + 9.0 || landmark.distance_m > end_m + 4.0) continue;
    ++expected;
    const bool seen = std::any_of(found.begin(), found.end(), [&](const Found& f) {
      return std::abs(f.distance_m - landmark.distance_m) < kMatchM;
    });
    hit += seen ? 1 : 0;
    if (!seen) std::printf("missed  balise at %.2f m\n", landmark.distance_m);
  }
  for (const Found& f : found) {
    double error = 1e9;
    for (const auto& landmark : landmarks) {
      if (landmark.kind == "balise" && std::abs(f.distance_m - landmark.distance_m) < std::abs(error)) {
        error = f.distance_m - landmark.distance_m;
      }
    }
    const bool matched = std::abs(error) < kMatchM;
    std::printf("%s at %9.3f m  error %+.3f m  sigma %.3f  lateral %+.3f  ahead %.2f  confidence %.2f\n",
                matched ? "right " : "FALSE ", f.distance_m, matched ? error : NAN, f.sighting.sigma_m,
                f.sighting.lateral_m, f.sighting.distance_ahead_m, f.sighting.confidence);
    if (!matched) continue;
    ++right;
    sum += error;
    squared += error * error;
    normalised += error * error / (f.sighting.sigma_m * f.sighting.sigma_m);
  }
  const double n = std::max(1, right);
  std::printf(
      "balises expected %d, recall %.1f %%, sightings %zu, precision %.1f %%, mean error %+.3f m, rms %.3f m, "
      "rms/sigma %.2f\n",
      expected, 100.0 * hit / std::max(1, expected), found.size(),
      100.0 * right / std::max<double>(1, static_cast<double>(found.size())), sum / n, std::sqrt(squared / n),
      std::sqrt(normalised / n));
}

int measure(const std::string& folder, double pitch_noise_rad) {
  const auto calibration = core::value_or_throw(dataset::read_calibration(folder + "/mav0/cam0/sensor.yaml"));
  const auto truth = core::value_or_throw(dataset::read_truth(folder + "/truth/track.csv"));
  const auto landmarks = core::value_or_throw(dataset::read_truth_landmarks(folder + "/truth/landmarks.csv"));
  if (truth.size() < 2) throw core::BadInput(folder + "/truth/track.csv has fewer than two rows");
  auto source = core::value_or_throw(dataset::open_pictures(folder, {}));
  track_detector::LandmarkFinder finder(calibration.intrinsics, {});
  core::Random random(1);
  std::vector<Found> found;
  double seconds = 0;
  size_t pictures = 0;
  while (auto next = core::value_or_throw(source->next())) {
    const auto row = std::lower_bound(truth.begin(), truth.end(), next->stamp_ns,
                                      [](const dataset::TruthRow& r, int64_t t) { return r.stamp_ns < t; });
    if (row == truth.end() || row->stamp_ns != next->stamp_ns) continue;
    track_detector::LandmarkPicture picture;
    picture.grey = next->grey;
    picture.stamp_ns = next->stamp_ns;
    picture.pose = row->camera;
    picture.pose.pitch_rad += random.normal(0, pitch_noise_rad);
    picture.curvature_per_m = row->curvature_per_m;
    picture.vertical_curvature_per_m = row->vertical_curvature_per_m;
    const std::clock_t begin = std::clock();  // processor time: other programs do not count
    const auto sightings = finder.process(picture);
    seconds += static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    ++pictures;
    for (const auto& sighting : sightings) {
      found.push_back({distance_at(truth, sighting.stamp_ns) + sighting.distance_ahead_m, sighting});
    }
  }
  judge(landmarks, found, truth.front().distance_m, truth.back().distance_m);
  std::printf("%zu pictures, %.2f ms each\n", pictures,
              1e3 * seconds / static_cast<double>(std::max<size_t>(1, pictures)));
  return 0;
}

}  // namespace
}  // namespace railfix

int main(int argc, char** argv) {
  CLI::App app("Balises found on a dataset with truth");
  std::string folder;
  double pitch_noise_rad = 0;
  app.add_option("--dataset", folder, "Dataset folder")->required();
  app.add_option("--pitch-noise", pitch_noise_rad, "Added to every pose, 1 sigma, rad");
  CLI11_PARSE(app, argc, argv);
  try {
    return railfix::measure(folder, pitch_noise_rad);
  } catch (const railfix::core::BadInput& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
