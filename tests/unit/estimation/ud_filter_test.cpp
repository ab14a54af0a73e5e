#include "estimation/ud_filter.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "core/random.hpp"
#include "unit/estimation/joseph_filter.hpp"

namespace railfix::estimation {
namespace {

StateMatrix random_matrix(core::Random& random, int rows, int cols, double size) {
  StateMatrix m(rows, cols);
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) m(i, j) = size * random.normal();
  return m;
}

StateVector random_vector(core::Random& random, int n, double size) {
  return random_matrix(random, n, 1, size).col(0);
}

StateMatrix random_covariance(core::Random& random, int n, double size) {
  const StateMatrix root = random_matrix(random, n, n, size);
  return root * root.transpose();
}

void expect_same(const StateMatrix& expected, const StateMatrix& actual, double relative = 1e-9) {
  ASSERT_EQ(expected.rows(), actual.rows());
  EXPECT_LE((expected - actual).cwiseAbs().maxCoeff(), relative * (expected.cwiseAbs().maxCoeff() + 1e-300));
}

StateMatrix without(const StateMatrix& p, int state) {
  const auto n = static_cast<int>(p.rows());
  StateMatrix rest(n - 1, n - 1);
  for (int i = 0; i < n - 1; ++i)
    for (int j = 0; j < n - 1; ++j) rest(i, j) = p(i + (i >= state ? 1 : 0), j + (j >= state ? 1 : 0));
  return rest;
}

// Every property holds for covariances that are zero, tiny and of ordinary size.
class UdFilterSizes : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(ZeroTinyRandom, UdFilterSizes, testing::Values(0.0, 1e-8, 1.0));

TEST_P(UdFilterSizes, FactorsGiveTheCovarianceBack) {
  core::Random random(1);
  for (int n = 1; n <= 16; ++n) {
    const StateMatrix p = random_covariance(random, n, GetParam());
    const auto filter = UdFilter::from_covariance(p);
    expect_same(p, filter.covariance());
    for (int i = 0; i < n; ++i) EXPECT_NEAR(filter.variance(i), p(i, i), 1e-12 * GetParam());
    EXPECT_TRUE((filter.d().array() >= 0).all());
  }
}

TEST_P(UdFilterSizes, PropagatesLikeTheDenseFilter) {
  core::Random random(2);
  for (int n = 1; n <= 16; ++n) {
    JosephFilter dense{random_covariance(random, n, GetParam())};
    auto filter = UdFilter::from_covariance(dense.p);
    const StateMatrix phi = random_matrix(random, n, n, 1);
    const StateMatrix g = random_matrix(random, n, 3, 1);
    const StateVector q = random_vector(random, 3, GetParam()).cwiseAbs();
    dense.propagate(phi, g, q);
    filter.propagate(phi, g, q);
    expect_same(dense.p, filter.covariance());
  }
}

TEST_P(UdFilterSizes, PropagatesThroughRectangularMatrices) {
  core::Random random(3);
  const StateMatrix p = random_covariance(random, 6, GetParam());
  for (const int rows : {3, 6, 9}) {
    auto filter = UdFilter::from_covariance(p);
    const StateMatrix phi = random_matrix(random, rows, 6, 1);
    filter.propagate(phi, StateMatrix::Zero(rows, 1), StateVector::Zero(1));
    expect_same(phi * p * phi.transpose(), filter.covariance());
  }
}

TEST_P(UdFilterSizes, UpdatesLikeTheDenseFilter) {
  core::Random random(4);
  for (int n = 1; n <= 16; ++n) {
    JosephFilter dense{random_covariance(random, n, GetParam())};
    auto filter = UdFilter::from_covariance(dense.p);
    for (int k = 0; k < 5; ++k) {
      const StateVector h = random_vector(random, n, 1);
      const double residual = random.normal();
      const double r = 0.1 + random.uniform();
      const auto innovation = filter.innovation(h, residual, r);
      EXPECT_NEAR(innovation.variance, h.dot(dense.p * h) + r, 1e-9 * innovation.variance);
      EXPECT_NEAR(innovation.nis, residual * residual / innovation.variance, 1e-12);
      const StateVector expected = dense.update(h, residual, r);
      const StateVector correction = filter.update(h, residual, r);
      EXPECT_LE((expected - correction).cwiseAbs().maxCoeff(), 1e-9 * (1 + expected.cwiseAbs().maxCoeff()));
      expect_same(dense.p, filter.covariance(), 1e-8);
    }
  }
}

TEST_P(UdFilterSizes, ClonesAreExactAndCanBeForgotten) {
  core::Random random(5);
  const int n = 7;
  const StateMatrix p = random_covariance(random, n, GetParam());
  for (int state = 0; state < n; ++state) {
    auto filter = UdFilter::from_covariance(p);
    filter.clone_to_front(state);
    StateMatrix twice(n + 1, n);
    twice << StateMatrix::Identity(n, n).row(state), StateMatrix::Identity(n, n);
    expect_same(twice * p * twice.transpose(), filter.covariance());
    StateVector difference = StateVector::Zero(n + 1);
    difference(0) = 1;
    difference(state + 1) = -1;
    EXPECT_NEAR(filter.variance(difference), 0, 1e-20);
    filter.marginalise(0);
    expect_same(p, filter.covariance());
  }
}

TEST_P(UdFilterSizes, MarginalisesInflatesAndResetsAnyState) {
  core::Random random(6);
  const int n = 7;
  const StateMatrix p = random_covariance(random, n, GetParam());
  for (int state = 0; state < n; ++state) {
    auto filter = UdFilter::from_covariance(p);
    filter.marginalise(state);
    expect_same(without(p, state), filter.covariance());

    filter = UdFilter::from_covariance(p);
    filter.inflate(state, 2.5);
    StateMatrix inflated = p;
    inflated(state, state) += 2.5;
    expect_same(inflated, filter.covariance());

    filter = UdFilter::from_covariance(p);
    filter.reset(state, 4);
    StateMatrix reset = p;
    reset.row(state).setZero();
    reset.col(state).setZero();
    reset(state, state) = 4;
    expect_same(reset, filter.covariance());
  }
}

// A measurement of the way since the clone must not say anything of where the clone was (paper 002, eq. 5).
TEST(UdFilter, RelativeMeasurementKnowsOnlyTheDifference) {
  UdFilter filter(StateVector{{100.0, 1.0}});  // position, speed
  filter.clone_to_front(0);
  StateMatrix phi = StateMatrix::Identity(3, 3);
  phi(1, 2) = 2.0;
  filter.propagate(phi, StateMatrix::Zero(3, 1), StateVector::Zero(1));
  filter.update(StateVector{{-1.0, 1.0, 0.0}}, 0.3, 1e-4);
  EXPECT_NEAR(filter.variance(0), 100.0, 1e-6);
  EXPECT_NEAR(filter.variance(StateVector{{-1.0, 1.0, 0.0}}), 1e-4, 1e-7);
  EXPECT_NEAR(filter.variance(1), 100.0, 1e-3);
}

// Millimetres against hundreds of kilometres, without process noise on most states: where the textbook update breaks.
TEST(UdFilter, StaysPositiveOverManyExtremeUpdates) {
  core::Random random(7);
  const int n = 9;
  UdFilter filter{StateVector(StateVector::Constant(n, 1e12))};
  StateMatrix phi = StateMatrix::Identity(n, n);
  phi(0, 1) = 0.016;
  phi(1, 2) = 0.016;
  StateMatrix g = StateMatrix::Zero(n, 1);
  g(2, 0) = 1;
  for (int k = 0; k < 50000; ++k) {
    filter.propagate(phi, g, StateVector::Constant(1, 1e-6));
    StateVector h = StateVector::Zero(n);
    h(0) = 1;
    h(3 + k % 6) = random.uniform(-1, 1);
    const auto correction = filter.update(h, random.normal(), 1e-8);
    ASSERT_TRUE(correction.allFinite());
    ASSERT_TRUE((filter.d().array() > 0).all()) << "at update " << k;
  }
  const Eigen::MatrixXd p = filter.covariance();
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(p).eigenvalues().minCoeff(), -1e-12 * p.trace());
}

// Normalised innovations of a correct model have mean one.
TEST(UdFilter, InnovationsAreConsistent) {
  core::Random random(8);
  UdFilter filter(StateVector{{4.0, 1.0}});
  Eigen::Vector2d truth(2.0 * random.normal(), random.normal());
  StateVector estimate = StateVector::Zero(2);
  const StateMatrix phi{{1.0, 0.1}, {0.0, 1.0}};
  const StateMatrix g{{0.0}, {1.0}};
  double sum = 0;
  const int steps = 20000;
  for (int k = 0; k < steps; ++k) {
    truth = phi * truth;
    truth(1) += 0.05 * random.normal();
    estimate = phi * estimate;
    filter.propagate(phi, g, StateVector::Constant(1, 0.05 * 0.05));
    const StateVector h{{1.0, 0.0}};
    const double residual = truth(0) + 0.3 * random.normal() - estimate(0);
    sum += filter.innovation(h, residual, 0.09).nis;
    estimate += filter.update(h, residual, 0.09);
  }
  EXPECT_NEAR(sum / steps, 1.0, 0.04);
}

}  // namespace
}  // namespace railfix::estimation
