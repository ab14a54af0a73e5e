// The dense Kalman filter with Joseph's update, as the reference for the UD filter in tests and benchmarks.
#pragma once

#include <Eigen/Core>

#include "estimation/ud_filter.hpp"

namespace railfix::estimation {

struct JosephFilter {
  StateMatrix p;

  void propagate(const StateMatrix& phi, const StateMatrix& g, const StateVector& q) {
    p = (phi * p * phi.transpose() + g * q.asDiagonal() * g.transpose()).eval();
  }
  StateVector update(const StateVector& h, double residual, double r) {
    const StateVector ph = p * h;
    const double s = h.dot(ph) + r;
    const StateVector gain = ph / s;
    const StateMatrix rest = StateMatrix::Identity(p.rows(), p.cols()) - gain * h.transpose();
    p = (rest * p * rest.transpose() + r * gain * gain.transpose()).eval();
    return gain * residual;
  }
};

}  // namespace railfix::estimation
