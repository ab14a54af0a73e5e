// Nonlinear least squares of a few unknowns: Levenberg-Marquardt over normal equations, with Cauchy weights against
// outliers.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>
#include <limits>

namespace railfix::estimation {

/// Sums of J'WJ, J'Wr and the cost. Residuals are in units of their sigma.
template <int N>
struct NormalEquations {
  Eigen::Matrix<double, N, N> information = Eigen::Matrix<double, N, N>::Zero();
  Eigen::Matrix<double, N, 1> gradient = Eigen::Matrix<double, N, 1>::Zero();
  double cost = 0;

  /// `cauchy_scale`: residual (in sigmas) at which the weight is one half; 0 = plain squares. Returns the weight.
  double add(const Eigen::Matrix<double, 1, N>& jacobian, double residual, double cauchy_scale = 0) {
    double weight = 1;
    if (cauchy_scale > 0) {
      const double ratio = residual / cauchy_scale;
      weight = 1.0 / (1.0 + ratio * ratio);
      cost += 0.5 * cauchy_scale * cauchy_scale * std::log1p(ratio * ratio);
    } else {
      cost += 0.5 * residual * residual;
    }
    information.noalias() += weight * jacobian.transpose() * jacobian;
    gradient.noalias() += weight * residual * jacobian.transpose();
    return weight;
  }
  /// Gaussian knowledge of one unknown: (value - mean) / sigma.
  void add_prior(int index, double difference, double sigma) {
    const double inverse = 1.0 / sigma;
    information(index, index) += inverse * inverse;
    gradient(index) += difference * inverse * inverse;
    cost += 0.5 * difference * difference * inverse * inverse;
  }
};

struct LeastSquaresOptions {
  int max_iterations = 30;
  double step_tolerance = 1e-6;  // largest last step, in sigmas of the solution
};

template <int N>
struct LeastSquaresResult {
  Eigen::Matrix<double, N, 1> x;
  NormalEquations<N> equations;  // at x; information.inverse() is the covariance
  int iterations = 0;
  double last_step = std::numeric_limits<double>::infinity();  // in sigmas of the solution
  bool converged = false;
};

/// Minimises from `x`. `build(x, equations)` adds all residuals and may return false where the model does not exist.
template <int N, class Build>
LeastSquaresResult<N> least_squares(Build&& build, const Eigen::Matrix<double, N, 1>& x,
                                    const LeastSquaresOptions& options = {}) {
  LeastSquaresResult<N> result;
  result.x = x;
  if (!build(result.x, result.equations)) return result;
  double damping = 1e-6;
  while (result.iterations < options.max_iterations) {
    ++result.iterations;
    Eigen::Matrix<double, N, N> damped = result.equations.information;
    damped.diagonal() *= 1.0 + damping;
    const Eigen::Matrix<double, N, 1> step = -damped.ldlt().solve(result.equations.gradient);
    if (!step.allFinite()) return result;
    const double length = std::sqrt(std::abs(step.dot(result.equations.information * step)));
    result.last_step = length;
    NormalEquations<N> trial;
    const Eigen::Matrix<double, N, 1> moved = result.x + step;
    const bool exists = build(moved, trial);
    // At the minimum the cost is flat to rounding: a tiny step may raise it by a few ulps and is still right.
    if (exists && trial.cost <= result.equations.cost * (1.0 + 1e-12)) {
      result.x = moved;
      result.equations = trial;
      damping = std::max(damping * 0.1, 1e-12);
      if (length < options.step_tolerance) {
        result.converged = true;
        return result;
      }
    } else {
      if (length < options.step_tolerance) {
        result.converged = true;
        return result;
      }
      damping = std::max(damping, 1e-6) * 10.0;
      if (damping > 1e9) return result;
    }
  }
  return result;
}

}  // namespace railfix::estimation
