#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "commands.hpp"
#include "core/json_text.hpp"
#include "core/result.hpp"
#include "core/units.hpp"
#include "dataset/dataset.hpp"
#include "number_between.hpp"
#include "output_file.hpp"
#include "picture_file.hpp"
#include "progress.hpp"
#include "track_detector/draw.hpp"
#include "track_detector/mount_calibration.hpp"

namespace railfix::tool {
namespace {

// Seen in most cabs: 70 degrees across the picture.
constexpr double kAssumedFocalPerWidth = 0.72;
constexpr size_t kMaxPictures = 120;
constexpr size_t kFewestImuRows = 200;
constexpr double kGravityRollSigmaRad = 0.009;  // 0.09 m/s2 of bias and of cant that is not known
constexpr double kMostRollRad = 0.3;            // of a camera on a cab; more is an IMU with other axes
constexpr double kTypicalRollRad = 0.0175;      // 1 degree, to say what it would do
const cv::Scalar kMountColour(0, 230, 255);

struct MountArguments {
  std::string pictures;
  std::string video;
  std::string camera;
  std::string out;
  std::string draw;
  double gauge_m = 1.435;
  double focal_px = 0;
  bool roll_from_imu = false;
  bool json = false;
};

std::vector<dataset::Picture> load_pictures(const std::string& path, bool quiet) {
  if (!std::filesystem::exists(path)) throw core::BadInput(path + " does not exist");
  auto source = core::value_or_throw(dataset::open_pictures(path, {}));
  const auto count = source->count();
  const size_t stride = count ? std::max<size_t>(1, (*count + kMaxPictures - 1) / kMaxPictures) : 10;
  Progress progress("reading pictures", count.value_or(0), quiet);
  std::vector<dataset::Picture> pictures;
  for (size_t i = 0; pictures.size() < kMaxPictures; ++i) {
    auto picture = core::value_or_throw(source->next());
    if (!picture) break;
    progress.update(i + 1);
    if (i % stride == 0) pictures.push_back(std::move(*picture));
  }
  progress.finish();
  if (pictures.empty()) throw core::BadInput(path + " holds no picture");
  for (const auto& picture : pictures) {
    if (picture.grey.size() != pictures.front().grey.size()) {
      throw core::BadInput(path + ": " + picture.name + " has another size than " + pictures.front().name +
                           "; give pictures of one camera");
    }
  }
  return pictures;
}

struct Lens {
  dataset::CameraCalibration calibration{};
  std::string remark{};
  bool assumed = false;
};

Lens lens_of(const MountArguments& arguments, const cv::Size& size) {
  Lens found;
  auto& calibration = found.calibration;
  if (!arguments.camera.empty()) {
    calibration = core::value_or_throw(dataset::read_calibration(arguments.camera));
    if (calibration.intrinsics.width_px != size.width || calibration.intrinsics.height_px != size.height) {
      throw core::BadInput(arguments.camera + " is for another picture size than these pictures");
    }
    return found;
  }
  const auto own = arguments.focal_px <= 0 && std::filesystem::is_directory(arguments.pictures)
                       ? core::value_or_throw(dataset::find_calibration(arguments.pictures))
                       : std::nullopt;
  if (own && own->intrinsics.width_px == size.width && own->intrinsics.height_px == size.height) {
    calibration.intrinsics = own->intrinsics;
    calibration.intrinsics_sigma = own->intrinsics_sigma;
    found.remark = "The lens is that of " + arguments.pictures + " (sensor.yaml).";
    return found;
  }
  auto& lens = calibration.intrinsics;
  lens.width_px = size.width;
  lens.height_px = size.height;
  lens.fu_px = arguments.focal_px > 0 ? arguments.focal_px : kAssumedFocalPerWidth * size.width;
  lens.fv_px = lens.fu_px;
  lens.cu_px = (size.width - 1) / 2.0;
  lens.cv_px = (size.height - 1) / 2.0;
  if (arguments.focal_px <= 0) {
    char text[300];
    std::snprintf(
        text, sizeof text,
        "The focal length is assumed (%.0f px, 70 degrees across): angles and every distance along the track are wrong "
        "in proportion to it, height and sideways position by some centimetres. Give --focal or --camera to fix it.",
        lens.fu_px);
    found.remark = text;
    found.assumed = true;
  }
  return found;
}

// Read again, because keeping all pictures in colour would take four times the memory.
cv::Mat in_colour(const std::string& path, const dataset::Picture& wanted) {
  dataset::PictureOptions options;
  options.colour = true;
  const auto source = core::value_or_throw(dataset::open_pictures(path, options));
  while (true) {
    auto picture = core::value_or_throw(source->next());
    if (!picture) throw core::BadInput(path + " has changed while it was read");
    if (picture->name == wanted.name) return picture->colour;
  }
}

struct Roll {
  double rad = 0;
  double sigma_rad = 0;  // 0 = held, not measured
};

/// From gravity, with an IMU that sits in the camera's housing: on straight track the rails are level (but for cant).
Roll roll_from_gravity(const std::string& path) {
  const auto sensors = core::value_or_throw(dataset::read_sensors(path));
  if (sensors.imu.size() < kFewestImuRows) {
    throw core::BadInput(
        path + " holds no IMU data of some seconds: leave --roll-from-imu out, or give a dataset with mav0/imu0");
  }
  double across = 0;
  double up = 0;
  for (const auto& row : sensors.imu) {
    across += row.accel_mps2[1] / static_cast<double>(sensors.imu.size());
    up += row.accel_mps2[2] / static_cast<double>(sensors.imu.size());
  }
  const double roll_rad = std::atan2(across, up);
  if (std::abs(roll_rad) > kMostRollRad) {
    char text[300];
    std::snprintf(text, sizeof text,
                  "%s: by its IMU the camera is rolled by %.0f degrees, so that the IMU's axes are not the camera's (y "
                  "left, z up); leave --roll-from-imu out, or correct the axes",
                  path.c_str(), core::deg_from_rad(roll_rad));
    throw core::BadInput(text);
  }
  return {roll_rad, kGravityRollSigmaRad};
}

void put_words(cv::Mat& picture, const std::string& words, const cv::Point& at) {
  const double scale = picture.cols / 1600.0;
  cv::putText(picture, words, at, cv::FONT_HERSHEY_SIMPLEX, scale, {0, 0, 0}, 4, cv::LINE_AA);
  cv::putText(picture, words, at, cv::FONT_HERSHEY_SIMPLEX, scale, kMountColour, 1, cv::LINE_AA);
}

/// What the mount alone says, whatever this picture shows: straight rails at the gauge, distances, the horizon.
void draw_mount(cv::Mat& picture, const geometry::View& view, double gauge_m) {
  const auto pixel = [&](double x_m, double y_m) -> std::optional<cv::Point> {
    const auto p = view.project({x_m, y_m, 0});
    if (!p || p->cwiseAbs().maxCoeff() > 1e5) return std::nullopt;
    return cv::Point(cvRound(p->x()), cvRound(p->y()));
  };
  const auto line = [&](double x0_m, double y0_m, double x1_m, double y1_m) {
    const auto from = pixel(x0_m, y0_m);
    const auto to = pixel(x1_m, y1_m);
    if (from && to) cv::line(picture, *from, *to, kMountColour, 1, cv::LINE_AA);
  };
  for (const double side : {-0.5, 0.5}) {
    for (double x_m = 2; x_m < 80; x_m *= 1.1) line(x_m, side * gauge_m, 1.1 * x_m, side * gauge_m);
  }
  for (const double x_m : {5, 10, 15, 20, 30, 50, 80}) {
    line(x_m, -1.2, x_m, 1.2);
    if (const auto at = pixel(x_m, -1.25)) put_words(picture, std::to_string(cvRound(x_m)) + " m", *at);
  }
  const int horizon = cvRound(view.horizon_v_px());
  cv::line(picture, {0, horizon}, {picture.cols - 1, horizon}, kMountColour, 1, cv::LINE_AA);
  put_words(picture, "horizon", {8, horizon - 6});
}

void draw(const std::string& file, cv::Mat colour, const dataset::Picture& picture, const geometry::Intrinsics& lens,
          const geometry::CameraPose& mount, double gauge_m) {
  track_detector::DetectorOptions options;
  options.gauge_m = gauge_m;
  track_detector::TrackDetector detector(lens, mount, options);
  track_detector::draw_track(colour, lens, detector.detect(picture.grey), gauge_m);
  draw_mount(colour, geometry::View(lens, mount), gauge_m);
  core::ok_or_throw(write_picture(file, colour));
}

void print_roll(const geometry::CameraPose& mount, const Roll& roll) {
  const double lateral_m = kTypicalRollRad * mount.height_m;
  if (roll.sigma_rad > 0) {
    std::printf(
        "roll     %+7.3f deg  +- %.3f   right side down, from gravity; an IMU beside the camera only helps when it is "
        "turned with it\n",
        core::deg_from_rad(roll.rad), core::deg_from_rad(roll.sigma_rad));
    return;
  }
  std::printf(
      "roll       0.000 deg  held: straight rails cannot tell roll from a sideways position. Level the camera with a "
      "spirit level: a roll of 1 degree moves lateral by %.3f m\n",
      lateral_m);
}

// As they are stored.
void print(const track_detector::MountCalibration& found, const Roll& roll, const std::string& remark) {
  const auto deg = [](double rad) { return core::deg_from_rad(rad); };
  const auto& m = found.mount;
  const auto& s = found.sigma;
  std::printf("both rails seen in %zu of %zu pictures, %zu on straight track, residual %.2f px\n", found.seen,
              found.pictures, found.straight, found.residual_px);
  std::printf("height   %7.3f m    +- %.3f   above the rail heads\n", m.height_m, s.height_m);
  std::printf("lateral  %+7.3f m    +- %.3f   left of the track centre\n", m.lateral_m, s.lateral_m);
  std::printf("pitch    %7.3f deg  +- %.3f   down\n", deg(m.pitch_rad), deg(s.pitch_rad));
  std::printf("yaw      %+7.3f deg  +- %.3f   left\n", deg(m.yaw_rad), deg(s.yaw_rad));
  print_roll(m, roll);
  if (!remark.empty()) std::printf("%s\n", remark.c_str());
}

nlohmann::json json_of(const track_detector::MountCalibration& found, const geometry::Intrinsics& lens, bool assumed) {
  const auto& m = found.mount;
  const auto& s = found.sigma;
  return {{"height_m", m.height_m},
          {"height_sigma_m", s.height_m},
          {"lateral_m", m.lateral_m},
          {"lateral_sigma_m", s.lateral_m},
          {"pitch_rad", m.pitch_rad},
          {"pitch_sigma_rad", s.pitch_rad},
          {"yaw_rad", m.yaw_rad},
          {"yaw_sigma_rad", s.yaw_rad},
          {"roll_rad", m.roll_rad},
          {"focal_px", lens.fu_px},
          {"focal_assumed", assumed},
          {"pictures", found.pictures},
          {"seen", found.seen},
          {"straight", found.straight},
          {"residual_px", found.residual_px}};
}

// Roll, sideways position and yaw turn about the same rails.
void take_in_roll(double roll_sigma_rad, track_detector::MountCalibration& found) {
  auto& sigma = found.sigma;
  sigma.roll_rad = roll_sigma_rad;
  sigma.lateral_m = std::hypot(sigma.lateral_m, roll_sigma_rad * found.mount.height_m);
  sigma.yaw_rad = std::hypot(sigma.yaw_rad, roll_sigma_rad * std::sin(found.mount.pitch_rad));
}

int calibrate_mount(const MountArguments& arguments) {
  if (arguments.pictures.empty() == arguments.video.empty()) {
    throw core::BadInput("give either --pictures DIR or --video FILE");
  }
  const std::string& path = arguments.pictures.empty() ? arguments.video : arguments.pictures;
  // It may be that of --camera, to whose lens the mount is added, or that of an earlier time beside the pictures.
  check_output("--out", arguments.out, {arguments.video});
  check_output("--draw", arguments.draw, {path, arguments.camera});
  check_different({{"--out", arguments.out}, {"--draw", arguments.draw}});
  if (std::filesystem::is_regular_file(arguments.out) && !std::filesystem::is_empty(arguments.out) &&
      !dataset::read_calibration(arguments.out).ok())
    throw core::BadInput("--out " + arguments.out + " is there and no calibration; remove it or give another name");
  const auto pictures = load_pictures(path, arguments.json);
  const Roll roll = arguments.roll_from_imu ? roll_from_gravity(path) : Roll{};
  Lens lens = lens_of(arguments, pictures.front().grey.size());
  auto& calibration = lens.calibration;
  track_detector::MountCalibrator calibrator(calibration.intrinsics, arguments.gauge_m, roll.rad,
                                             calibration.intrinsics_sigma.value_or(geometry::Intrinsics{}));
  for (const auto& picture : pictures) calibrator.add(picture.grey);
  auto found = calibrator.solve();
  if (!found.ok()) {
    std::cerr << "railfix: " << found.error().message << '\n';
    return 1;
  }
  take_in_roll(roll.sigma_rad, found.value());
  calibration.mount = found.value().mount;
  calibration.mount_sigma = found.value().sigma;
  core::ok_or_throw(dataset::write_calibration(arguments.out, calibration));
  say_beside({arguments.out});
  const std::string drawn = arguments.draw.empty()
                                ? std::filesystem::path(arguments.out).replace_extension(".mount.png").string()
                                : arguments.draw;
  const auto& picture = pictures[pictures.size() / 2];
  draw(drawn, in_colour(path, picture), picture, calibration.intrinsics, *calibration.mount, arguments.gauge_m);
  if (arguments.json) {
    std::cout << core::json_text(json_of(found.value(), calibration.intrinsics, lens.assumed), 2) << '\n';
  } else {
    print(found.value(), roll, lens.remark);
    std::printf("written to %s; look at %s: straight rails must lie in the yellow lines\n", arguments.out.c_str(),
                drawn.c_str());
  }
  return 0;
}

}  // namespace

void add_calibrate(CLI::App& app, Action& chosen) {
  auto* calibrate = app.add_subcommand("calibrate", "How a camera sits and looks");
  calibrate->footer("Example: railfix calibrate mount --pictures frames --focal 1390 --out camera.yaml");
  calibrate->require_subcommand(1);
  add_calibrate_lens(*calibrate, chosen);
  auto* mount =
      calibrate->add_subcommand("mount", "Height, sideways position, pitch and yaw from the rails of straight track");
  mount->footer("Example: railfix calibrate mount --pictures frames --focal 1390 --out camera.yaml --draw check.png");
  auto arguments = std::make_shared<MountArguments>();
  mount->add_option("--pictures", arguments->pictures, "Folder of pictures or dataset, straight track among them");
  mount->add_option("--video", arguments->video, "Video file instead of pictures");
  mount->add_option("--gauge", arguments->gauge_m, "Track gauge in metres")
      ->check(number_between(0.5, 2.0))
      ->capture_default_str();
  auto* focal = mount->add_option("--focal", arguments->focal_px, "Focal length in pixels; else it is assumed")
                    ->check(number_between(50.0, 50000.0));
  mount
      ->add_option("--camera", arguments->camera,
                   "Calibration with the lens (intrinsics and distortion), instead of --focal")
      ->check(CLI::ExistingFile)
      ->excludes(focal);
  mount->add_option("--out", arguments->out, "Calibration file to write")->required();
  mount->add_option("--draw", arguments->draw, "Picture to check by eye; else beside --out");
  mount->add_flag(
      "--roll-from-imu", arguments->roll_from_imu,
      "Take the roll from gravity: for an IMU that is fixed to the camera, standing or on straight level track");
  mount->add_flag("--json", arguments->json, "Print the result as JSON");
  mount->callback([arguments, &chosen] { chosen = [arguments] { return calibrate_mount(*arguments); }; });
}

}  // namespace railfix::tool
