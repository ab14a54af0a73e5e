#include "track/import/fit/smooth.hpp"

#include <Eigen/Sparse>
#include <array>
#include <cmath>

#include "core/units.hpp"

namespace railfix::track {
namespace {

constexpr double kFixedWeight = 1e8;   // of the end points, against 1 of the others
constexpr double kLongestWaveM = 150;  // shorter bends are drawn by hand, longer ones are real
constexpr double kEasing = 1.2;
constexpr int kMostSmoothings = 40;

using SparseMatrix = Eigen::SparseMatrix<double>;

/// Rows: change of the second derivative from one point to the next, per square root of the length between them.
SparseMatrix third_differences(const std::vector<Eigen::Vector2d>& points) {
  const auto count = static_cast<Eigen::Index>(points.size());
  std::vector<double> step(points.size() - 1);
  for (size_t i = 0; i + 1 < points.size(); ++i) step[i] = (points[i + 1] - points[i]).norm();
  const auto second = [&](size_t i) {  // weights of points i - 1, i, i + 1
    const double scale = 2.0 / (step[i - 1] + step[i]);
    return std::array{scale / step[i - 1], -scale / step[i - 1] - scale / step[i], scale / step[i]};
  };
  std::vector<Eigen::Triplet<double>> entries;
  for (size_t i = 1; i + 2 < points.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i - 1);
    const double scale = 1.0 / std::sqrt(step[i]);
    for (size_t k = 0; k < 3; ++k) {
      entries.emplace_back(row, static_cast<Eigen::Index>(i - 1 + k), -scale * second(i)[k]);
      entries.emplace_back(row, static_cast<Eigen::Index>(i + k), scale * second(i + 1)[k]);
    }
  }
  SparseMatrix out(count - 3, count);
  out.setFromTriplets(entries.begin(), entries.end());
  return out;
}

}  // namespace

std::vector<Eigen::Vector2d> smoothed(const std::vector<Eigen::Vector2d>& points, double limit_m) {
  if (points.size() < 5 || !(limit_m > 0)) return points;
  const auto count = static_cast<Eigen::Index>(points.size());
  const SparseMatrix difference = third_differences(points);
  const SparseMatrix roughness = difference.transpose() * difference;
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(count);
  weight[0] = weight[count - 1] = kFixedWeight;
  // Relative to the first point: map coordinates are millions of metres and would cost digits.
  Eigen::MatrixXd drawn(count, 2);
  for (Eigen::Index i = 0; i < count; ++i) drawn.row(i) = (points[static_cast<size_t>(i)] - points[0]).transpose();

  const double length = (drawn.bottomRows(count - 1) - drawn.topRows(count - 1)).rowwise().norm().sum();
  const double stiffness = std::pow(kLongestWaveM / (2.0 * core::kPi), 6.0) * static_cast<double>(count) / length;
  for (int attempt = 0; attempt < kMostSmoothings; ++attempt) {
    SparseMatrix system = stiffness * roughness;
    system.diagonal() += weight;
    const Eigen::SimplicialLDLT<SparseMatrix> solver(system);
    if (solver.info() != Eigen::Success) break;
    const Eigen::MatrixXd placed = solver.solve(weight.asDiagonal() * drawn);
    const Eigen::VectorXd moved = (placed - drawn).rowwise().norm();
    if (!moved.allFinite()) break;
    if (moved.maxCoeff() <= limit_m) {
      std::vector<Eigen::Vector2d> out = points;
      for (Eigen::Index i = 1; i + 1 < count; ++i) out[static_cast<size_t>(i)] = points[0] + placed.row(i).transpose();
      return out;
    }
    // Points that moved too far hold on more firmly, the others stay free.
    weight = weight.cwiseProduct((kEasing * moved / limit_m).cwiseMax(1.0));
  }
  return points;
}

}  // namespace railfix::track
