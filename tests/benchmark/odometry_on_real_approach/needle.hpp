// The speedometer drawn into the cab pictures, and what its needle means: zero and slope from the kilometre counter
// that is drawn above it. Speed = slope * (zero - angle); the way between two turns of the counter is 100 m.
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <utility>
#include <vector>

namespace railfix {

class Needle {
 public:
  /// Table with the columns frame, needle_angle_deg, speed_kmh_est, distance_m_integrated; pictures one second apart.
  explicit Needle(const std::filesystem::path& table);
  /// Way since the picture before, and its sigma.
  [[nodiscard]] std::pair<double, double> step(int frame) const;
  [[nodiscard]] double step_in_file(int frame) const;
  void print() const;

 private:
  [[nodiscard]] Eigen::Vector3d way_row(int frame) const;
  void fit();
  std::vector<double> angle_deg_;
  std::vector<double> file_kmh_;
  std::vector<double> file_m_;
  // Speed at angle 0 and change per degree, m/s; distance at the first turn of the counter, m.
  Eigen::Vector3d fit_ = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  double worst_m_ = 0;       // of the counter's turns, with the fit
  double worst_file_m_ = 0;  // ... and as the table has it
};

}  // namespace railfix
