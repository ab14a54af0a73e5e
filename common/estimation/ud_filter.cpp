#include "estimation/ud_filter.hpp"

#include <cassert>

namespace railfix::estimation {

UdFilter::UdFilter(const StateVector& variances)
    : u_(StateMatrix::Identity(variances.size(), variances.size())), d_(variances) {
  assert((variances.array() >= 0).all());
}

UdFilter UdFilter::from_covariance(const StateMatrix& covariance) {
  const auto n = static_cast<int>(covariance.rows());
  UdFilter filter{StateVector(StateVector::Zero(n))};
  StateMatrix rest = covariance;
  for (int j = n - 1; j >= 0; --j) {
    const double d = rest(j, j);
    if (!(d > 0)) continue;
    filter.d_(j) = d;
    filter.u_.col(j).head(j) = rest.col(j).head(j) / d;
    rest.topLeftCorner(j, j) -= d * filter.u_.col(j).head(j) * filter.u_.col(j).head(j).transpose();
  }
  return filter;
}

StateMatrix UdFilter::covariance() const {
  return u_ * d_.asDiagonal() * u_.transpose();
}

double UdFilter::variance(const StateVector& h) const {
  const StateVector f = u_.transpose() * h;
  return f.cwiseAbs2().dot(d_);
}

double UdFilter::variance(int state) const {
  return u_.row(state).transpose().cwiseAbs2().dot(d_);
}

void UdFilter::propagate(const StateMatrix& phi, const StateMatrix& g, const StateVector& q) {
  const auto n = static_cast<int>(phi.rows());
  const auto from = size();
  const auto noises = static_cast<int>(q.size());
  assert(phi.cols() == from && g.rows() == n && g.cols() == noises);
  // Rows of the wide matrix are stored as columns, so that the inner products run through memory in order.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 2 * kMaxStates, kMaxStates> w(from + noises, n);
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 2 * kMaxStates, 1> weight(from + noises);
  // (phi U)^T. Most of phi is zero, and so is U below its diagonal.
  w.topRows(from).setZero();
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < from; ++k) {
      if (phi(i, k) != 0) w.col(i).segment(k, from - k) += phi(i, k) * u_.row(k).tail(from - k).transpose();
    }
  }
  w.bottomRows(noises) = g.transpose();
  weight << d_, q;

  u_ = StateMatrix::Identity(n, n);
  d_ = StateVector::Zero(n);
  for (int j = n - 1; j >= 0; --j) {
    const Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 2 * kMaxStates, 1> weighted = w.col(j).cwiseProduct(weight);
    d_(j) = weighted.dot(w.col(j));
    if (!(d_(j) > 0)) continue;
    for (int i = 0; i < j; ++i) {
      u_(i, j) = w.col(i).dot(weighted) / d_(j);
      w.col(i) -= u_(i, j) * w.col(j);
    }
  }
}

Innovation UdFilter::innovation(const StateVector& h, double residual, double r) const {
  const double s = variance(h) + r;
  return {s, residual * residual / s};
}

StateVector UdFilter::update(const StateVector& h, double residual, double r) {
  assert(r > 0);
  const int n = size();
  const StateVector f = u_.transpose() * h;
  const StateVector v = d_.cwiseProduct(f);
  StateVector gain = StateVector::Zero(n);
  double alpha = r;
  for (int j = 0; j < n; ++j) {
    const double before = alpha;
    alpha += f(j) * v(j);
    d_(j) *= before / alpha;
    const double lambda = -f(j) / before;
    for (int i = 0; i < j; ++i) {
      const double u = u_(i, j);
      u_(i, j) = u + gain(i) * lambda;
      gain(i) += u * v(j);
    }
    gain(j) = v(j);
  }
  return gain * (residual / alpha);
}

void UdFilter::clone_to_front(int state) {
  const int n = size();
  assert(n < kMaxStates && state >= 0 && state < n);
  const StateVector row = u_.row(state).transpose();
  push_front(0);
  u_.row(0).tail(n) = row.transpose();
}

void UdFilter::push_front(double variance) {
  const int n = size();
  assert(n < kMaxStates && variance >= 0);
  StateMatrix u = StateMatrix::Identity(n + 1, n + 1);
  u.bottomRightCorner(n, n) = u_;
  StateVector d(n + 1);
  d << variance, d_;
  u_ = u;
  d_ = d;
}

// Dropping row `state` leaves the column of the same number, which still feeds the rows above: fold it in as a rank-one
// update.
void UdFilter::marginalise(int state) {
  const int n = size();
  assert(state >= 0 && state < n);
  const StateVector above = u_.col(state).head(state);
  const double weight = d_(state);
  const int behind = n - state - 1;
  StateMatrix u = StateMatrix::Identity(n - 1, n - 1);
  u.topLeftCorner(state, state) = u_.topLeftCorner(state, state);
  u.topRightCorner(state, behind) = u_.topRightCorner(state, behind);
  u.bottomRightCorner(behind, behind) = u_.bottomRightCorner(behind, behind);
  StateVector d(n - 1);
  d << d_.head(state), d_.tail(behind);
  u_ = u;
  d_ = d;
  add_rank_one(above, weight, state);
}

void UdFilter::inflate(int state, double variance) {
  StateVector a = StateVector::Zero(state + 1);
  a(state) = 1;
  add_rank_one(a, variance, state + 1);
}

void UdFilter::reset(int state, double variance) {
  const StateVector above = u_.col(state).head(state);
  const double weight = d_(state);
  u_.col(state).head(state).setZero();
  u_.row(state).tail(size() - state - 1).setZero();
  d_(state) = variance;
  add_rank_one(above, weight, state);
}

// Agee and Turner: U D U^T + weight a a^T for the first `rows` states.
void UdFilter::add_rank_one(StateVector a, double weight, int rows) {
  for (int j = rows - 1; j >= 0 && weight > 0; --j) {
    const double s = a(j);
    const double d = d_(j) + weight * s * s;
    if (!(d > 0)) continue;
    const double beta = weight * s / d;
    weight *= d_(j) / d;
    d_(j) = d;
    for (int i = 0; i < j; ++i) {
      a(i) -= s * u_(i, j);
      u_(i, j) += beta * a(i);
    }
  }
}

}  // namespace railfix::estimation
