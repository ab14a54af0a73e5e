#include "fusion/scale_file.hpp"

#include <cmath>
#include <cstdio>

#include "core/time.hpp"
#include "core/whole_file.hpp"

namespace railfix::fusion {
namespace {

constexpr double kWriteEveryS = 10.0;

// All that metres come from; another mount or lens is another text.
std::string numbers_of(const msg::CameraCalibration& c) {
  char text[240];
  std::snprintf(text, sizeof text, "=%ux%u,%.6g,%.6g,%.6g,%.6g,%.4g,%.4g,%.4g,%.4g,%.5g,%.5g,%.5g,%.5g,%.5g",
                c.width_px(), c.height_px(), c.fu_px(), c.fv_px(), c.cu_px(), c.cv_px(), c.k1(), c.k2(), c.p1(), c.p2(),
                c.height_m(), c.pitch_rad(), c.yaw_rad(), c.roll_rad(), c.lateral_m());
  return text;
}

std::string in_percent(const OdometerScales& s) {
  char text[120];
  std::snprintf(text, sizeof text, "camera %+.3f +- %.3f %%, wheel %+.3f +- %.3f %%", 100 * s.camera,
                100 * s.camera_sigma, 100 * s.wheel, 100 * s.wheel_sigma);
  return text;
}

}  // namespace

ScaleFile::ScaleFile(std::filesystem::path path, spdlog::logger& log) : path_(std::move(path)), log_(log) {
  if (!path_.empty()) read();
}

void ScaleFile::read() {
  std::error_code failed;
  if (!std::filesystem::exists(path_, failed)) return;
  const auto text = core::read_whole(path_);
  auto saved = text.ok() ? saved_scales(text.value()) : text.error();
  if (!saved.ok()) {
    log_.warn("{} is not used: {}; it is replaced when references have taught them", path_.string(),
              saved.error().message);
    return;
  }
  saved_ = std::move(saved).value();
  log_.info("scales of an earlier trip, on trial: {}", in_percent(saved_->scales));
}

bool ScaleFile::fits(const msg::CameraCalibration& camera) {
  const std::string name = camera.camera().c_str();
  const std::string numbers = numbers_of(camera);
  cameras_[name] = numbers;
  if (!saved_) return true;
  const bool known = (" " + saved_->camera_id).find(" " + name + "=") != std::string::npos;
  const bool same = (saved_->camera_id + " ").find(name + numbers + " ") != std::string::npos;
  return !known || same || forget("the camera is calibrated otherwise");
}

bool ScaleFile::fits(const WheelInput& sample) {
  const bool is_number = std::isfinite(sample.pulses_per_metre) && sample.pulses_per_metre > 0;
  if (!is_number || sample.pulses_per_metre == pulses_per_metre_) return true;
  pulses_per_metre_ = sample.pulses_per_metre;
  if (!saved_ || saved_->pulses_per_metre == 0 || saved_->pulses_per_metre == pulses_per_metre_) return true;
  return forget("the wheel has another number of pulses a metre");
}

bool ScaleFile::forget(const std::string& sensor) {
  log_.warn("scales of an earlier trip are not used: {} than then", sensor);
  saved_.reset();
  told_ = SavedScalesAre::contradicted;
  return false;
}

void ScaleFile::follow(const Fusion& fusion, const TrainEstimate& state) {
  const auto are = fusion.saved_scales();
  if (are != told_ && saved_) {
    if (are == SavedScalesAre::confirmed) log_.info("references confirm the scales of the earlier trip");
    if (are == SavedScalesAre::contradicted) {
      log_.warn(
          "scales of an earlier trip are contradicted and not used any more ({}): was a wheelset, the lens or "
          "the camera's mount exchanged?",
          in_percent(saved_->scales));
      saved_.reset();  // also for a fusion that begins anew
    }
    told_ = are;
  }
  if (path_.empty() || state.integrity != Integrity::ok) return;
  if (std::abs(core::seconds(state.stamp_ns - written_ns_)) < kWriteEveryS) return;
  if (const auto learnt = fusion.learnt_scales()) write(*learnt, fusion.camera_lag(), state.stamp_ns);
}

void ScaleFile::write(const OdometerScales& learnt, const std::optional<CameraLag::Lag>& camera_lag, int64_t stamp_ns) {
  written_ns_ = stamp_ns;
  SavedScales saved{learnt, stamp_ns, "", pulses_per_metre_, camera_lag};
  for (const auto& [name, numbers] : cameras_) saved.camera_id += (saved.camera_id.empty() ? "" : " ") + name + numbers;
  const auto status = core::write_whole(path_, to_text(saved));
  if (status.ok() || failure_told_) return;
  log_.warn("fusion.scales_file: {}", status.error().message);
  failure_told_ = true;
}

}  // namespace railfix::fusion
