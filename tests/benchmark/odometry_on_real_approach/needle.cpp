#include "needle.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <string>

namespace railfix {
namespace {

// First picture that shows 9.0, 9.1 ... 10.7 km, read off by eye in all 135 pictures.
constexpr std::array kTurns = {1, 5, 10, 16, 21, 27, 33, 39, 45, 52, 60, 69, 78, 87, 96, 106, 116, 128};
constexpr double kBetweenTurnsM = 100;
constexpr double kOfAPicture = 0.289;     // the turn lies anywhere between two pictures
constexpr double kFewestM = 1.0;          // sigma of a turn
constexpr double kReadingSigmaDeg = 0.3;  // of one needle
constexpr double kKmhPerMps = 3.6;

}  // namespace

Needle::Needle(const std::filesystem::path& table) {
  std::ifstream in(table);
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream fields(line);
    int frame = 0;
    double angle_deg = 0, kmh = 0, distance_m = 0;
    if (!(fields >> frame >> angle_deg >> kmh >> distance_m)) break;
    angle_deg_.push_back(angle_deg);
    file_kmh_.push_back(kmh);
    file_m_.push_back(distance_m);
  }
  fit();
}

// Way from picture 0 to midway before this picture, per unknown: trapezoids of one second.
Eigen::Vector3d Needle::way_row(int frame) const {
  Eigen::Vector3d row(0, 0, -1);
  for (int i = 1; i <= frame; ++i) {
    const double share = i == frame ? 0.5 : 1.0;
    const auto at = static_cast<size_t>(i);
    row += share * Eigen::Vector3d(1.0, 0.5 * (angle_deg_[at - 1] + angle_deg_[at]), 0);
  }
  return row;
}

void Needle::fit() {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (size_t k = 0; k < kTurns.size(); ++k) {
    const Eigen::Vector3d row = way_row(kTurns[k]);
    const double sigma_m = std::max(kFewestM, kOfAPicture * step_in_file(kTurns[k]));
    normal += row * row.transpose() / (sigma_m * sigma_m);
    right += row * (kBetweenTurnsM * static_cast<double>(k)) / (sigma_m * sigma_m);
  }
  covariance_ = normal.inverse();
  fit_ = normal.ldlt().solve(right);
  for (size_t k = 0; k < kTurns.size(); ++k) {
    const auto at = static_cast<size_t>(kTurns[k]);
    const double way_m = kBetweenTurnsM * static_cast<double>(k);
    const double in_file_m = 0.5 * (file_m_[at] + file_m_[at - 1]) - 0.5 * (file_m_[1] + file_m_[0]);
    worst_m_ = std::max(worst_m_, std::abs(way_row(kTurns[k]).dot(fit_) - way_m));
    worst_file_m_ = std::max(worst_file_m_, std::abs(in_file_m - way_m));
  }
}

std::pair<double, double> Needle::step(int frame) const {
  const auto at = static_cast<size_t>(frame);
  const Eigen::Vector3d row(1.0, 0.5 * (angle_deg_[at - 1] + angle_deg_[at]), 0);
  const double reading_m = fit_.y() * kReadingSigmaDeg / std::sqrt(2.0);
  return {row.dot(fit_), std::hypot(std::sqrt(row.dot(covariance_ * row)), reading_m)};
}

double Needle::step_in_file(int frame) const {
  const auto at = static_cast<size_t>(frame);
  return file_m_[at] - file_m_[at - 1];
}

void Needle::print() const {
  const auto kmh = [this](double angle_deg) { return kKmhPerMps * (fit_.x() + fit_.y() * angle_deg); };
  const double zero_deg = -fit_.x() / fit_.y();
  const Eigen::Vector3d at_zero(1.0, zero_deg, 0);
  const double file_slope = (file_kmh_.back() - file_kmh_.front()) / (angle_deg_.back() - angle_deg_.front());
  const double file_zero_deg = angle_deg_.back() - file_kmh_.back() / file_slope;
  std::printf("needle: rests at %.1f +- %.1f degrees, %.3f km/h a degree by the counter (turns within %.0f m); ",
              zero_deg, std::sqrt(at_zero.dot(covariance_ * at_zero)) / std::abs(fit_.y()), -kKmhPerMps * fit_.y(),
              worst_m_);
  std::printf("speed.csv takes %.1f and %.3f (turns within %.0f m)\n", file_zero_deg, -file_slope, worst_file_m_);
  // Middle of the dial's figures against the hub, read off picture 0134.
  constexpr std::pair<double, double> kFigures[] = {{20, 183.5}, {40, 148.3}, {60, 115.5}, {80, 86.7}};
  for (const auto& [figure, angle_deg] : kFigures)
    std::printf("dial's figure %.0f at %.1f degrees: %.1f km/h, speed.csv %.1f km/h\n", figure, angle_deg,
                kmh(angle_deg), file_slope * (angle_deg - file_zero_deg));
}

}  // namespace railfix
