// railfix-measure-filter-health [UPDATES]: does the covariance stay positive definite? The same time and measurement
// updates, of a place that is hardly ever known and a scale that hides in it, through U-D factors and through the full
// covariance, naive and in Joseph's form, in double and in float.
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>

#include "estimation/ud_filter.hpp"

namespace railfix::estimation {
namespace {

constexpr int kStates = 9;

// Odometer, distance, origin, speed, acceleration, bias, scale, other scale, wheel: as fusion has them.
StateMatrix transition() {
  StateMatrix phi = StateMatrix::Identity(kStates, kStates);
  phi(0, 3) = phi(1, 3) = phi(8, 3) = 0.05;
  phi(1, 6) = 1.5;
  phi(8, 7) = -1.5;
  phi(3, 4) = 0.05;
  phi(4, 4) = 0.99;
  phi(6, 6) = phi(7, 7) = 1 - 2.5e-5;
  return phi;
}
StateVector noise() {
  StateVector q(kStates);
  q << 0, 0, 0, 0, 4e-3, 5e-7, 5e-9, 5e-9, 1e-6;
  return q;
}
StateVector variances() {
  StateVector v(kStates);
  v << 1e-6, 1e-6, 1e10, 3600, 0.16, 0.02, 1e-4, 1e-4, 1e10;
  return v;
}
// In turn: wheel, speed by the camera, acceleration; now and then a landmark, very exact.
std::pair<StateVector, double> measurement(uint64_t k) {
  StateVector h = StateVector::Zero(kStates);
  if (k % 600 == 599) {
    h(1) = h(2) = 1;
    return {h, 1e-4};
  }
  if (k % 3 == 0) h(8) = 1;
  if (k % 3 == 1) h(3) = 1;
  if (k % 3 == 2) h(4) = h(5) = 1;
  return {h, k % 3 == 0 ? 1e-5 : k % 3 == 1 ? 1e-3 : 2e-2};
}

template <class Scalar, bool joseph>
class Full {
 public:
  using Matrix = Eigen::Matrix<Scalar, kStates, kStates>;
  using Vector = Eigen::Matrix<Scalar, kStates, 1>;
  void cycle(uint64_t k) {
    p_ = phi_ * p_ * phi_.transpose();
    p_.diagonal() += q_;
    const auto [row, variance] = measurement(k);
    const Vector h = row.cast<Scalar>();
    const auto r = static_cast<Scalar>(variance);
    const Vector gain = p_ * h / (h.dot(p_ * h) + r);
    const Matrix rest = Matrix::Identity() - gain * h.transpose();
    if constexpr (joseph) {
      p_ = (rest * p_ * rest.transpose() + r * gain * gain.transpose()).eval();
    } else {
      p_ = (rest * p_).eval();
    }
  }
  [[nodiscard]] double variance(int state) const { return static_cast<double>(p_(state, state)); }
  /// Of the correlation matrix, so that units do not matter.
  [[nodiscard]] bool healthy() const {
    if (!p_.allFinite() || !(p_.diagonal().array() > 0).all()) return false;
    const Eigen::MatrixXd p = p_.template cast<double>();
    const Eigen::VectorXd scale = p.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd c = scale.asDiagonal() * (0.5 * (p + p.transpose())) * scale.asDiagonal();
    return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(c, Eigen::EigenvaluesOnly).eigenvalues().minCoeff() > 0;
  }

 private:
  Matrix phi_ = transition().cast<Scalar>();
  Vector q_ = noise().cast<Scalar>();
  Matrix p_ = Vector(variances().cast<Scalar>()).asDiagonal();
};

class Factors {
 public:
  void cycle(uint64_t k) {
    filter_.propagate(phi_, g_, q_);
    const auto [h, r] = measurement(k);
    filter_.update(h, 0, r);
  }
  [[nodiscard]] double variance(int state) const { return filter_.variance(state); }
  [[nodiscard]] bool healthy() const { return filter_.u().allFinite() && (filter_.d().array() > 0).all(); }

 private:
  StateMatrix phi_ = transition();
  StateMatrix g_ = StateMatrix::Identity(kStates, kStates);
  StateVector q_ = noise();
  UdFilter filter_{variances()};
};

template <class Filter>
void run(const char* name, uint64_t updates) {
  Filter filter;
  std::optional<uint64_t> broke;
  for (uint64_t k = 0; k < updates; ++k) {
    filter.cycle(k);
    if (!broke && (k < 1000 || k % 1000 == 0) && !filter.healthy()) broke = k;
  }
  std::printf("%-24s sigma of speed %.6g, of scale %.6g; ", name, std::sqrt(filter.variance(3)),
              std::sqrt(filter.variance(6)));
  if (broke) {
    std::printf("not positive definite from update %llu on\n", static_cast<unsigned long long>(*broke));
  } else {
    std::printf("positive definite throughout\n");
  }
}

}  // namespace
}  // namespace railfix::estimation

int main(int argc, char** argv) {
  using namespace railfix::estimation;
  const uint64_t updates = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 10'000'000;
  std::printf("%llu updates, %d states\n", static_cast<unsigned long long>(updates), kStates);
  run<Factors>("U-D factors, double", updates);
  run<Full<double, true>>("Joseph, double", updates);
  run<Full<double, false>>("naive, double", updates);
  run<Full<float, true>>("Joseph, float", updates);
  run<Full<float, false>>("naive, float", updates);
  return 0;
}
