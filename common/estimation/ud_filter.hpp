// Covariance of a Kalman filter kept as P = U D U^T (U unit upper triangular, D diagonal): it cannot lose symmetry or
// become negative by rounding, at the cost of the plain filter. Sources: G. J. Bierman, Factorization Methods for
// Discrete Sequential Estimation, 1977 (measurement update V.3, rank-one update of Agee and Turner III.5); C. L.
// Thornton, JPL TM 33-798, 1976 (modified weighted Gram-Schmidt time update); A. Mourikis and S. Roumeliotis, 2007
// (cloned states).
#pragma once

#include <Eigen/Core>

namespace railfix::estimation {

/// Most states, clones included, that one filter can have; nothing is ever allocated.
constexpr int kMaxStates = 24;

using StateVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxStates, 1>;
using StateMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxStates, kMaxStates>;

/// What one scalar measurement says before it is used: nis is chi-square distributed with one degree of freedom.
struct Innovation {
  double variance = 0;  // of the residual: h P h^T + r
  double nis = 0;       // residual^2 / variance
};

/// The factors and what is done with them. The states themselves belong to the caller, who adds the returned
/// corrections.
class UdFilter {
 public:
  UdFilter() = default;
  /// Independent states with these variances (>= 0).
  explicit UdFilter(const StateVector& variances);
  /// Factors of a symmetric positive semi-definite matrix.
  static UdFilter from_covariance(const StateMatrix& covariance);

  [[nodiscard]] int size() const { return static_cast<int>(d_.size()); }
  [[nodiscard]] StateMatrix covariance() const;
  /// h P h^T of a combination of states.
  [[nodiscard]] double variance(const StateVector& h) const;
  [[nodiscard]] double variance(int state) const;
  [[nodiscard]] const StateMatrix& u() const { return u_; }
  [[nodiscard]] const StateVector& d() const { return d_; }

  /// P <- phi P phi^T + g diag(q) g^T (Thornton). phi may be rectangular: then it also adds, drops or combines states.
  /// REQUIRES: q >= 0, at most kMaxStates noise columns.
  void propagate(const StateMatrix& phi, const StateMatrix& g, const StateVector& q);

  /// What a measurement z = h x + noise(r) with this residual (z - h x) would mean; changes nothing.
  [[nodiscard]] Innovation innovation(const StateVector& h, double residual, double r) const;
  /// Uses the measurement (Bierman) and returns what to add to the states. REQUIRES: r > 0.
  StateVector update(const StateVector& h, double residual, double r);

  /// Puts an exact copy of a state in front of all others: index 0 is the clone, the others move up by one.
  void clone_to_front(int state);
  /// Puts an independent state in front of all others.
  void push_front(double variance);
  /// Forgets a state; what it meant for the others stays in them. States behind it move down by one.
  void marginalise(int state);
  /// Makes one state's variance larger by this much, as by process noise.
  void inflate(int state, double variance);
  /// Forgets all that is known of one state and begins again: independent, with this variance.
  void reset(int state, double variance);

 private:
  void add_rank_one(StateVector a, double weight, int rows);
  StateMatrix u_;
  StateVector d_;
};

}  // namespace railfix::estimation
