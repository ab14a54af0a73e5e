// railfix-measure-filter-health [UPDATES]: does the covariance stay positive definite? The same time and measurement
// updates, of a place that is hardly ever known and a scale that hides in it, through U-D factors and through the full
// covariance, naive and in Joseph's form, in double and in float.
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdio>
#include <optional>

#include "estimation/ud_filter.hpp"
#include "fusion/motion_filter.hpp"
#include "measuring_tool.hpp"
#include "whole_number.hpp"

namespace railfix::estimation {
namespace {

using fusion::StateIndex;
constexpr int kStates = static_cast<int>(StateIndex::count);

constexpr int at(StateIndex state) {
  return static_cast<int>(state);
}

StateMatrix transition() {
  using enum StateIndex;
  StateMatrix phi = StateMatrix::Identity(kStates, kStates);
  for (const auto way : {camera_odometer, distance, wheel_odometer}) phi(at(way), at(speed)) = 0.05;
  phi(at(distance), at(unit_scale)) = 1.5;
  phi(at(wheel_odometer), at(other_scale)) = -1.5;
  phi(at(speed), at(acceleration)) = 0.05;
  phi(at(acceleration), at(acceleration)) = 0.99;
  for (const auto scale : {unit_scale, other_scale}) phi(at(scale), at(scale)) = 1 - 2.5e-5;
  phi(at(shape_error), at(shape_error)) = 1 - 7.5e-4;
  phi(at(gnss_error), at(gnss_error)) = 1 - 8.3e-4;
  return phi;
}
StateVector noise() {
  StateVector q(kStates);
  q << 1e-6, 0, 0, 0, 4e-3, 5e-7, 5e-9, 5e-9, 1e-6, 5e-12, 1.5e-3, 1.7e-3;
  return q;
}
StateVector variances() {
  StateVector v(kStates);
  v << 1e-6, 1e-6, 1e10, 3600, 0.16, 0.02, 1e-4, 1e-4, 1e10, 1e-4, 1, 1;
  return v;
}
// In turn: wheel, speed by the camera, acceleration; now and then GNSS, turning in a curve, and a landmark, very exact.
std::pair<StateVector, double> measurement(uint64_t k) {
  using enum StateIndex;
  StateVector h = StateVector::Zero(kStates);
  const bool landmark = k % 600 == 599;
  const bool gnss = k % 60 == 30;
  const bool turning = k % 60 == 10;
  if (landmark || gnss) h(at(distance)) = h(at(origin)) = 1;
  if (landmark) return {h, 1e-4};
  if (gnss) {
    h(at(gnss_error)) = 2.6;
    return {h, 2.25};
  }
  if (turning) {
    h(at(distance)) = h(at(origin)) = h(at(shape_error)) = 3e-4;
    h(at(gyro_bias)) = 1;
    return {h, 1.6e-5};
  }
  if (k % 3 == 0) h(at(wheel_odometer)) = 1;
  if (k % 3 == 1) h(at(speed)) = 1;
  if (k % 3 == 2) h(at(acceleration)) = h(at(accel_bias)) = 1;
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

/// As fusion has it: clones for pictures to come in front of the states, older ones forgotten, scales and biases
/// doubted, a place that is lost and begun anew.
class ClonedFactors {
 public:
  void cycle(uint64_t k) {
    StateMatrix phi = StateMatrix::Identity(size(), size());
    phi.bottomRightCorner(kStates, kStates) = phi_;
    StateMatrix g = StateMatrix::Zero(size(), kStates);
    g.bottomRows(kStates).setIdentity();
    filter_.propagate(phi, g, q_);
    const auto [own, r] = measurement(k);
    StateVector h = StateVector::Zero(size());
    h.tail(kStates) = own;
    if (clones() > 0 && k % 3 == 1) {  // the way since the reference picture
      h.setZero();
      h[static_cast<int>(k / 3) % clones()] = -1;
      h[clones() + at(StateIndex::camera_odometer)] = 1;
    }
    filter_.update(h, 0, r);
    if (k % 5 == 0) filter_.clone_to_front(clones() + at(StateIndex::camera_odometer));
    if (clones() > kMostClones) filter_.marginalise(static_cast<int>(k / 5) % clones());
    if (k % 1000 == 500) filter_.inflate(clones() + at(StateIndex::accel_bias), 1e-2);
    if (k % 20000 == 10000) filter_.reset(clones() + at(StateIndex::origin), 3600);
  }
  [[nodiscard]] double variance(int state) const { return filter_.variance(clones() + state); }
  [[nodiscard]] bool healthy() const { return filter_.u().allFinite() && (filter_.d().array() >= 0).all(); }

 private:
  static constexpr int kMostClones = 4;
  [[nodiscard]] int size() const { return filter_.size(); }
  [[nodiscard]] int clones() const { return size() - kStates; }
  StateMatrix phi_ = transition();
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
  std::printf("%-24s sigma of speed %.6g, of scale %.6g; ", name, std::sqrt(filter.variance(at(StateIndex::speed))),
              std::sqrt(filter.variance(at(StateIndex::unit_scale))));
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
  uint64_t updates = 10'000'000;
  CLI::App app("Does the covariance of the filter stay positive definite?", "railfix-measure-filter-health");
  app.add_option("UPDATES", updates, "Time and measurement updates")
      ->check(railfix::tool::whole_number(1))
      ->capture_default_str();
  return railfix::measure::run_tool(app, argc, argv, [&] {
    std::printf("%llu updates, %d states\n", static_cast<unsigned long long>(updates), kStates);
    run<Factors>("U-D factors, double", updates);
    run<ClonedFactors>("... with clones", updates);
    run<Full<double, true>>("Joseph, double", updates);
    run<Full<double, false>>("naive, double", updates);
    run<Full<float, true>>("Joseph, float", updates);
    run<Full<float, false>>("naive, float", updates);
    return 0;
  });
}
