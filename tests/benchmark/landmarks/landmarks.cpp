// railfix-measure-landmarks --dataset SEQ: sightings of every kind against truth/landmarks.csv, with camera poses from
// the rails (or the true ones) and the time they take.
// railfix-measure-landmarks --pictures DIR --fps N: what would be sighted on real pictures.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/random.hpp"
#include "core/time.hpp"
#include "dataset/dataset.hpp"
#include "track_detector/landmark_finder.hpp"
#include "track_detector/mount_calibration.hpp"
#include "track_detector/track_detector.hpp"

namespace railfix {
namespace {

struct Found {
  double distance_m;
  track_detector::Sighting sighting;
};

constexpr double kFocalPerWidth = 0.72;  // of cameras that nobody knows

struct Settings {
  std::string folder;
  double pitch_noise_rad = 0;
  bool true_poses = false;
  bool verbose = false;
  std::string pictures;  // instead of folder
  double fps = 1;
  std::string draw;     // folder for pictures of sightings
  double first_m = 40;  // what is nearer at the beginning cannot be followed
};

const std::map<std::string, track_detector::LandmarkType> kKinds = {
    {"frog", track_detector::LandmarkType::frog},           {"balise", track_detector::LandmarkType::balise},
    {"portal_in", track_detector::LandmarkType::portal_in}, {"portal_out", track_detector::LandmarkType::portal_out},
    {"mast", track_detector::LandmarkType::mast},           {"bridge", track_detector::LandmarkType::bridge},
    {"platform", track_detector::LandmarkType::platform}};

double distance_at(const std::vector<dataset::TruthRow>& truth, int64_t stamp_ns) {
  const auto after = std::lower_bound(truth.begin() + 1, truth.end() - 1, stamp_ns,
                                      [](const dataset::TruthRow& row, int64_t t) { return row.stamp_ns < t; });
  const auto& a = *(after - 1);
  const auto& b = *after;
  const double share = static_cast<double>(stamp_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
  return a.distance_m + share * (b.distance_m - a.distance_m);
}

track_detector::LandmarkPicture picture_of(const dataset::Picture& source,
                                           const track_detector::TrackObservation& rails) {
  track_detector::LandmarkPicture picture;
  picture.grey = source.grey;
  picture.stamp_ns = source.stamp_ns;
  picture.pose = rails.shape.camera;
  picture.curvature_per_m = rails.shape.curvature_per_m;
  picture.vertical_curvature_per_m = rails.shape.vertical_curvature_per_m;
  picture.pitch_sigma_rad = std::sqrt(rails.covariance(1, 1));
  return picture;
}

/// A post where the object stands, with its kind, distance and sigma.
void draw_sighting(cv::Mat& picture, const geometry::View& view, const track_detector::Sighting& sighting) {
  static constexpr const char* kNames[] = {"",           "frog", "balise", "portal in",
                                           "portal out", "mast", "bridge", "platform"};
  const auto foot = view.project({sighting.distance_ahead_m, sighting.lateral_m, 0});
  const auto top = view.project({sighting.distance_ahead_m, sighting.lateral_m, 1.5});
  if (!foot || !top) return;
  const cv::Point2d a(foot->x(), foot->y());
  const cv::Point2d b(top->x(), top->y());
  cv::line(picture, a, b, cv::Scalar(0, 200, 255), 2, cv::LINE_AA);
  char text[80];
  std::snprintf(text, sizeof(text), "%s %.2f m +- %.2f", kNames[static_cast<size_t>(sighting.type)],
                sighting.distance_ahead_m, sighting.sigma_m);
  cv::putText(picture, text, b, cv::FONT_HERSHEY_SIMPLEX, 0.6, cv::Scalar(0, 200, 255), 2, cv::LINE_AA);
}

void draw(const Settings& settings, const cv::Mat& grey, const geometry::View& view,
          const track_detector::Sighting& sighting, size_t number) {
  if (settings.draw.empty()) return;
  cv::Mat colour;
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  draw_sighting(colour, view, sighting);
  cv::imwrite(
      settings.draw + "/" + std::to_string(number) + "_" + std::to_string(static_cast<int>(sighting.type)) + ".png",
      colour);
}

// Half the distance of the balises of a group; what stands beside the track is met more coarsely.
double match_m(const std::string& kind) {
  return kind == "balise" ? 1.5 : 3.0;
}

bool same_side(double a_m, double b_m) {
  return std::abs(a_m) < 0.3 || std::abs(b_m) < 0.3 || a_m * b_m > 0;
}

void judge(const std::string& kind, const std::vector<dataset::TruthLandmark>& landmarks,
           const std::vector<Found>& found, double begin_m, double end_m, bool verbose) {
  std::vector<const dataset::TruthLandmark*> real;
  for (const auto& landmark : landmarks) {
    if (landmark.kind == kind) real.push_back(&landmark);
  }
  std::vector<bool> used(real.size());
  std::vector<double> errors;
  double normalised = 0;
  int wrong = 0;
  int said = 0;
  for (const Found& f : found) {
    if (f.sighting.type != kKinds.at(kind)) continue;
    ++said;
    size_t best = real.size();
    for (size_t i = 0; i < real.size(); ++i) {
      const double off_m = std::abs(f.distance_m - real[i]->distance_m);
      if (used[i] || off_m > match_m(kind) || !same_side(f.sighting.lateral_m, real[i]->lateral_m)) continue;
      if (best == real.size() || off_m < std::abs(f.distance_m - real[best]->distance_m)) best = i;
    }
    const double error_m = best < real.size() ? f.distance_m - real[best]->distance_m : NAN;
    if (verbose || best == real.size()) {
      std::printf("  %s %-10s at %9.3f m, error %+.3f m, sigma %.3f, lateral %+.2f, ahead %5.2f, confidence %.2f\n",
                  best < real.size() ? "right" : "FALSE", kind.c_str(), f.distance_m, error_m, f.sighting.sigma_m,
                  f.sighting.lateral_m, f.sighting.distance_ahead_m, f.sighting.confidence);
    }
    if (best == real.size()) {
      ++wrong;
      continue;
    }
    used[best] = true;
    errors.push_back(error_m);
    normalised += std::pow(error_m / f.sighting.sigma_m, 2);
  }
  int expected = 0;
  int hit = 0;
  for (size_t i = 0; i < real.size(); ++i) {
    if (real[i]->distance_m < begin_m || real[i]->distance_m > end_m + 3) continue;
    ++expected;
    hit += used[i] ? 1 : 0;
    if (!used[i])
      std::printf("  missed %s at %.2f m, lateral %+.2f m\n", kind.c_str(), real[i]->distance_m, real[i]->lateral_m);
  }
  double sum = 0;
  double squared = 0;
  std::vector<double> absolute;
  for (const double error : errors) {
    sum += error;
    squared += error * error;
    absolute.push_back(std::abs(error));
  }
  std::sort(absolute.begin(), absolute.end());
  const double n = std::max<double>(1, static_cast<double>(errors.size()));
  std::printf(
      "%-10s real %3d found %3d false %2d  recall %5.1f %%  precision %5.1f %%  mean %+.3f m  rms %.3f m  p95 %.3f m  "
      "rms/sigma %.2f\n",
      kind.c_str(), expected, hit, wrong, 100.0 * hit / std::max(1, expected),
      100.0 * (said - wrong) / std::max(1, said), sum / n, std::sqrt(squared / n),
      absolute.empty() ? 0.0 : absolute[static_cast<size_t>(0.95 * static_cast<double>(absolute.size() - 1))],
      std::sqrt(normalised / n));
}

// Real pictures have no truth: says what would be reported, for looking at.
int tell(const Settings& settings) {
  dataset::PictureOptions options;
  options.fps = settings.fps;
  geometry::Intrinsics camera;
  std::vector<dataset::Picture> pictures;
  auto source = core::value_or_throw(dataset::open_pictures(settings.pictures, options));
  while (auto next = core::value_or_throw(source->next())) pictures.push_back(*next);
  if (pictures.empty()) throw core::BadInput(settings.pictures + " has no pictures");
  camera.width_px = pictures[0].grey.cols;
  camera.height_px = pictures[0].grey.rows;
  camera.fu_px = camera.fv_px = kFocalPerWidth * camera.width_px;
  camera.cu_px = 0.5 * (camera.width_px - 1);
  camera.cv_px = 0.5 * (camera.height_px - 1);
  track_detector::MountCalibrator calibrator(camera, 1.435);
  for (const auto& one : pictures) calibrator.add(one.grey);
  const auto mount = core::value_or_throw(calibrator.solve()).mount;
  track_detector::TrackDetector detector(camera, mount, {});
  track_detector::LandmarkFinder finder(camera, {});
  size_t seen = 0;
  size_t said = 0;
  for (size_t i = 0; i < pictures.size(); ++i) {
    const auto rails = detector.detect(pictures[i].grey);
    if (!rails.seen()) continue;
    ++seen;
    const auto picture = picture_of(pictures[i], rails);
    for (const auto& sighting : finder.process(picture)) {
      ++said;
      std::printf("picture %zu: kind %d, %.2f m ahead, lateral %+.2f m, sigma %.2f m, confidence %.2f\n", i,
                  static_cast<int>(sighting.type), sighting.distance_ahead_m, sighting.lateral_m, sighting.sigma_m,
                  sighting.confidence);
      draw(settings, pictures[i].grey, geometry::View(camera, picture.pose), sighting, i);
    }
  }
  std::printf("%zu pictures, rails seen on %zu, %zu sightings\n", pictures.size(), seen, said);
  return 0;
}

int measure(const Settings& settings) {
  const std::string& folder = settings.folder;
  const auto calibration = core::value_or_throw(dataset::read_calibration(folder + "/mav0/cam0/sensor.yaml"));
  const auto truth = core::value_or_throw(dataset::read_truth(folder + "/truth/track.csv"));
  const auto landmarks = core::value_or_throw(dataset::read_truth_landmarks(folder + "/truth/landmarks.csv"));
  if (truth.size() < 2) throw core::BadInput(folder + "/truth/track.csv has fewer than two rows");
  auto source = core::value_or_throw(dataset::open_pictures(folder, {}));
  track_detector::LandmarkFinder finder(calibration.intrinsics, {});
  track_detector::TrackDetector detector(calibration.intrinsics, calibration.mount.value_or(geometry::CameraPose{}),
                                         {});
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
    if (settings.true_poses) {
      picture.pose = row->camera;
      picture.pose.pitch_rad += random.normal(0, settings.pitch_noise_rad);
      picture.curvature_per_m = row->curvature_per_m;
      picture.vertical_curvature_per_m = row->vertical_curvature_per_m;
    } else {
      const auto rails = detector.detect(next->grey);
      if (!rails.seen()) continue;
      picture = picture_of(*next, rails);
    }
    const std::clock_t begin = std::clock();  // processor time: other programs do not count
    const auto& sightings = finder.process(picture);
    seconds += static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    ++pictures;
    for (const auto& sighting : sightings) {
      found.push_back({distance_at(truth, sighting.stamp_ns) + sighting.distance_ahead_m, sighting});
      auto now = sighting;
      now.distance_ahead_m = found.back().distance_m - row->distance_m;
      draw(settings, next->grey, geometry::View(calibration.intrinsics, picture.pose), now, pictures);
    }
  }
  for (const auto& [kind, type] : kKinds) {
    judge(kind, landmarks, found, truth.front().distance_m + settings.first_m, truth.back().distance_m,
          settings.verbose);
  }
  std::printf("%zu pictures, %.2f ms each\n", pictures,
              1e3 * seconds / static_cast<double>(std::max<size_t>(1, pictures)));
  return 0;
}

}  // namespace
}  // namespace railfix

int main(int argc, char** argv) {
  CLI::App app("Sightings on a dataset with truth");
  railfix::Settings settings;
  auto* dataset = app.add_option("--dataset", settings.folder, "Dataset folder with truth");
  app.add_option("--pictures", settings.pictures, "Real pictures without truth: only says what is sighted")
      ->excludes(dataset);
  app.add_option("--fps", settings.fps, "... so many a second");
  app.add_option("--draw", settings.draw, "Existing folder for a picture of each sighting");
  app.add_flag("--true-poses", settings.true_poses, "Poses from truth/track.csv instead of from the rails");
  app.add_option("--pitch-noise", settings.pitch_noise_rad, "Added to every true pose, 1 sigma, rad");
  app.add_option("--first-m", settings.first_m, "Landmarks in the first metres do not count");
  app.add_flag("--verbose", settings.verbose, "Every sighting, not only false and missed ones");
  CLI11_PARSE(app, argc, argv);
  try {
    return settings.folder.empty() ? railfix::tell(settings) : railfix::measure(settings);
  } catch (const railfix::core::BadInput& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
