#include "dataset/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "core/whole_file.hpp"
#include "dataset/yaml_file.hpp"

namespace railfix::dataset {
namespace {

using core::Error;
using core::Result;
using core::Status;

constexpr int kLargestSidePx = 100'000;
// A focal length in picture widths: views from 157 to 0.6 degrees wide.
constexpr double kShortestFocal = 0.1;
constexpr double kLongestFocal = 100;

Status read_lens(const YamlFile& yaml, geometry::Intrinsics& camera) {
  if (yaml.has("camera_model")) {
    const auto model = yaml.text("camera_model");
    if (!model.ok()) return model.error();
    if (model.value() != "pinhole")
      return yaml.error("camera_model", "is '" + model.value() + "', only pinhole can be used");
  }
  const auto intrinsics = yaml.numbers("intrinsics", 4);
  if (!intrinsics.ok()) return intrinsics.error();
  const auto& i = intrinsics.value();
  for (const double focal_px : {i[0], i[1]}) {
    const double widths = focal_px / std::max(camera.width_px, 1);
    if (!(widths >= kShortestFocal && widths <= kLongestFocal))
      return yaml.error("intrinsics", "fu and fv are in pixels, and a tenth to a hundred times the picture's width");
  }
  camera.fu_px = i[0];
  camera.fv_px = i[1];
  camera.cu_px = i[2];
  camera.cv_px = i[3];
  return {};
}

Status read_distortion(const YamlFile& yaml, geometry::Intrinsics& camera) {
  std::string model = yaml.has("distortion_coefficients") ? "radial-tangential" : "none";
  if (yaml.has("distortion_model")) {
    const auto text = yaml.text("distortion_model");
    if (!text.ok()) return text.error();
    model = text.value();
  }
  if (model == "none") return {};
  if (model != "radial-tangential" && model != "radtan" && model != "plumb_bob") {
    return yaml.error("distortion_model", "is '" + model + "', only radial-tangential and none can be used");
  }
  const auto coefficients = yaml.numbers("distortion_coefficients", 4);
  if (!coefficients.ok()) return coefficients.error();
  const auto& k = coefficients.value();
  for (size_t more = 4; more < k.size(); ++more) {
    if (k[more] != 0) return yaml.error("distortion_coefficients", "only k1, k2, p1, p2 may differ from zero");
  }
  camera.k1 = k[0];
  camera.k2 = k[1];
  camera.p1 = k[2];
  camera.p2 = k[3];
  return {};
}

Status read_resolution(const YamlFile& yaml, geometry::Intrinsics& camera) {
  const auto resolution = yaml.numbers("resolution", 2);
  if (!resolution.ok()) return resolution.error();
  const auto& r = resolution.value();
  for (size_t i = 0; i < 2; ++i) {
    if (r[i] < 1 || r[i] > kLargestSidePx || r[i] != std::floor(r[i])) {
      return yaml.error("resolution", "must be [width, height] in whole pixels");
    }
  }
  camera.width_px = static_cast<int>(r[0]);
  camera.height_px = static_cast<int>(r[1]);
  return {};
}

Status read_pose(const YamlFile& yaml, const std::string& section, std::optional<geometry::CameraPose>& result) {
  if (!yaml.has(section)) return {};
  geometry::CameraPose pose;
  const std::pair<const char*, double*> fields[] = {{".height_m", &pose.height_m},
                                                    {".pitch_rad", &pose.pitch_rad},
                                                    {".yaw_rad", &pose.yaw_rad},
                                                    {".roll_rad", &pose.roll_rad},
                                                    {".lateral_m", &pose.lateral_m}};
  for (const auto& [key, value] : fields) {
    const auto number = yaml.number(section + key);
    if (!number.ok()) return number.error();
    *value = number.value();
  }
  if (pose.height_m <= 0) return yaml.error(section + ".height_m", "must be positive");
  result = pose;
  return {};
}

Status read_lens_sigma(const YamlFile& yaml, std::optional<geometry::Intrinsics>& result) {
  if (!yaml.has("intrinsics_sigma") || !yaml.has("distortion_sigma")) return {};
  const auto lens = yaml.numbers("intrinsics_sigma", 4);
  if (!lens.ok()) return lens.error();
  const auto distortion = yaml.numbers("distortion_sigma", 4);
  if (!distortion.ok()) return distortion.error();
  const auto& f = lens.value();
  const auto& k = distortion.value();
  result = geometry::Intrinsics{f[0], f[1], f[2], f[3], k[0], k[1], k[2], k[3], 0, 0};
  return {};
}

// "P0: f 0 cu 0  0 f cv 0  0 0 1 0": rectified pictures, so there is no distortion.
Result<CameraCalibration> read_kitti_calibration(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::string line;
  while (std::getline(stream, line)) {
    std::istringstream cells(line);
    std::string name;
    cells >> name;
    if (name != "P0:" && name != "P_rect_00:") continue;
    double p[12] = {};
    for (double& value : p) {
      if (!(cells >> value)) return Error{file.string() + " line '" + name + "' must hold 12 numbers"};
    }
    if (!(std::min(p[0], p[5]) >= 1) || std::max(p[0], p[5]) > kLongestFocal * kLargestSidePx)
      return Error{file.string() + " line '" + name + "' must hold focal lengths in pixels"};
    CameraCalibration calibration;
    calibration.intrinsics.fu_px = p[0];
    calibration.intrinsics.fv_px = p[5];
    calibration.intrinsics.cu_px = p[2];
    calibration.intrinsics.cv_px = p[6];
    return calibration;
  }
  return Error{file.string() + " has no line 'P0: ...'; it must be the calib.txt of a KITTI odometry sequence"};
}

void write_pose(std::ostream& stream, const char* section, const geometry::CameraPose& m) {
  stream << section << ":\n"
         << "  height_m: " << m.height_m << "      # above the rail heads\n"
         << "  pitch_rad: " << m.pitch_rad << "    # down positive\n"
         << "  yaw_rad: " << m.yaw_rad << "      # left positive\n"
         << "  roll_rad: " << m.roll_rad << "\n"
         << "  lateral_m: " << m.lateral_m << "    # left of the track centre positive\n";
}

}  // namespace

Result<CameraCalibration> read_calibration(const std::filesystem::path& file) {
  const auto loaded = YamlFile::load(file);
  if (!loaded.ok()) return loaded.error();
  const YamlFile& yaml = loaded.value();
  CameraCalibration calibration;
  for (const Status& status :
       {read_resolution(yaml, calibration.intrinsics), read_lens(yaml, calibration.intrinsics),
        read_distortion(yaml, calibration.intrinsics), read_pose(yaml, "mount", calibration.mount),
        read_lens_sigma(yaml, calibration.intrinsics_sigma), read_pose(yaml, "mount_sigma", calibration.mount_sigma)}) {
    if (!status.ok()) return status.error();
  }
  if (yaml.has("rate_hz")) {
    const auto rate = yaml.number("rate_hz");
    if (!rate.ok()) return rate.error();
    if (rate.value() < 0) return yaml.error("rate_hz", "must not be negative");
    calibration.rate_hz = rate.value();
  }
  return calibration;
}

Status write_calibration(const std::filesystem::path& file, const CameraCalibration& calibration) {
  std::ostringstream stream;
  const auto& c = calibration.intrinsics;
  stream.precision(17);
  stream << "sensor_type: camera\n";
  if (calibration.rate_hz > 0) stream << "rate_hz: " << calibration.rate_hz << '\n';
  stream << "resolution: [" << c.width_px << ", " << c.height_px << "]\n"
         << "camera_model: pinhole\n"
         << "intrinsics: [" << c.fu_px << ", " << c.fv_px << ", " << c.cu_px << ", " << c.cv_px << "]\n"
         << "distortion_model: radial-tangential\n"
         << "distortion_coefficients: [" << c.k1 << ", " << c.k2 << ", " << c.p1 << ", " << c.p2 << "]\n";
  if (calibration.intrinsics_sigma) {
    const auto& g = *calibration.intrinsics_sigma;
    stream << "intrinsics_sigma: [" << g.fu_px << ", " << g.fv_px << ", " << g.cu_px << ", " << g.cv_px << "]\n"
           << "distortion_sigma: [" << g.k1 << ", " << g.k2 << ", " << g.p1 << ", " << g.p2 << "]\n";
  }
  if (calibration.mount) write_pose(stream, "mount", *calibration.mount);
  if (calibration.mount_sigma) write_pose(stream, "mount_sigma", *calibration.mount_sigma);
  return core::write_whole(file, stream.str());
}

Result<std::optional<CameraCalibration>> find_calibration(const std::filesystem::path& pictures) {
  using Found = std::optional<CameraCalibration>;
  for (const char* place : {"mav0/cam0/sensor.yaml", "cam0/sensor.yaml", "sensor.yaml", "camera.yaml"}) {
    if (!std::filesystem::is_regular_file(pictures / place)) continue;
    const auto read = read_calibration(pictures / place);
    if (!read.ok()) return read.error();
    return Found(read.value());
  }
  if (std::filesystem::is_regular_file(pictures / "calib.txt")) {
    const auto read = read_kitti_calibration(pictures / "calib.txt");
    if (!read.ok()) return read.error();
    return Found(read.value());
  }
  return Found();
}

}  // namespace railfix::dataset
