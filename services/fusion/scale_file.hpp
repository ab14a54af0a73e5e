// The file of the scales that a trip has taught, for the next one (fusion.scales_file).
#pragma once

#include <spdlog/logger.h>

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "fusion/fusion.hpp"
#include "messaging/topics.hpp"

namespace railfix::fusion {

class ScaleFile {
 public:
  /// Reads what there is; an empty path keeps nothing. What cannot be used is told in the log.
  ScaleFile(std::filesystem::path path, spdlog::logger& log);
  /// Of an earlier trip, and of the same sensors as far as is known.
  [[nodiscard]] const std::optional<SavedScales>& saved() const { return saved_; }
  /// The sensors of this trip. False: the saved scales are of others, and are forgotten.
  [[nodiscard]] bool fits(const msg::CameraCalibration& camera);
  [[nodiscard]] bool fits(const WheelInput& sample);
  /// To be called now and then: tells what has become of the saved scales, and writes what this trip has taught.
  void follow(const Fusion& fusion, const TrainEstimate& state);

 private:
  void read();
  void write(const OdometerScales& learnt, const std::optional<CameraLag::Lag>& camera_lag, int64_t stamp_ns);
  bool forget(const std::string& sensor);

  std::filesystem::path path_;
  spdlog::logger& log_;
  std::optional<SavedScales> saved_;
  std::map<std::string, std::string> cameras_;  // calibrations of this trip
  double pulses_per_metre_ = 0;
  SavedScalesAre told_ = SavedScalesAre::none;
  int64_t written_ns_ = 0;
  bool failure_told_ = false;
};

}  // namespace railfix::fusion
