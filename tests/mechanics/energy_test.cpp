// Would catch an error energy V with a missing or negative part.
#include "sprag/energy.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace sprag {
namespace {

Model model(const Eigen::MatrixXd& M, const Eigen::MatrixXd& K) {
  Model result;
  result.M = M;
  result.C = Eigen::MatrixXd::Zero(M.rows(), M.cols());
  result.K = K;
  return result;
}

TEST(ErrorEnergyTest, PartsAreNonNegativeAndSumToTheQuadraticForm) {
  Random random(99);
  for (const Eigen::Index n : {1, 2, 5, 20}) {
    const Eigen::MatrixXd M = random.positive_definite(n, 0.1, 3.0);
    Eigen::MatrixXd K = random.positive_definite(n, 0.1, 30.0);
    if (n == 5) K = Eigen::VectorXd::Ones(n) * Eigen::RowVectorXd::Ones(n);  // rigid-body modes
    const ErrorEnergy energy(model(M, K));
    for (int i = 0; i < 20; ++i) {
      const Eigen::VectorXd q = random.vector(n), u = random.vector(n);
      const Eigen::VectorXd q_s = random.vector(n), u_s = random.vector(n);
      const Eigen::VectorXd v = energy(q, u, q_s, u_s);
      const double expected = 0.5 * ((u - u_s).dot(M * (u - u_s)) + (q - q_s).dot(K * (q - q_s)));
      EXPECT_NEAR(v[0], expected, 1e-12 * (1.0 + expected));
      EXPECT_NEAR(v.tail(n).sum(), v[0], 1e-15 * v[0]);
      EXPECT_GE(v.minCoeff(), 0.0);
    }
  }
}

// A chain of masses without a support: V measures their relative displacements, however far apart
// two of them are.
TEST(ErrorEnergyTest, RigidMotionsHaveNoEnergyOfPosition) {
  const Eigen::Index n = 50;
  Eigen::MatrixXd K = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i + 1 < n; ++i) {
    K.block<2, 2>(i, i) += 1e8 * (Eigen::Matrix2d() << 1.0, -1.0, -1.0, 1.0).finished();
  }
  const Model chain = model(Eigen::MatrixXd::Identity(n, n), K);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(n);
  const Eigen::VectorXd far = Eigen::VectorXd::Constant(n, 100.0);
  EXPECT_LT(ErrorEnergy(chain)(far, zero, zero, zero)[0], 1e-13);
  EXPECT_EQ(natural_modes(chain).stiffness[0], 0.0);
  EXPECT_GT(natural_modes(chain).stiffness[1], 1e4);
}

TEST(ErrorEnergyTest, ModesOfCoupledPairAreSumAndDifference) {
  const ErrorEnergy energy(
      model(Eigen::Matrix2d::Identity(), (Eigen::Matrix2d() << 2, -1, -1, 2).finished()));
  const Eigen::Vector2d zero = Eigen::Vector2d::Zero();
  const Eigen::VectorXd in_phase = energy(Eigen::Vector2d(1, 1), zero, zero, zero);
  EXPECT_NEAR(in_phase[1], 1.0, 1e-15);  // w^2 = 1
  EXPECT_NEAR(in_phase[2], 0.0, 1e-15);
  const Eigen::VectorXd opposed = energy(zero, Eigen::Vector2d(1, -1), zero, zero);
  EXPECT_NEAR(opposed[1], 0.0, 1e-15);
  EXPECT_NEAR(opposed[2], 1.0, 1e-15);
}

TEST(ErrorEnergyTest, MissingReplicaModesCountAsZero) {
  const ErrorEnergy energy(
      model(Eigen::Vector2d(1, 2).asDiagonal(), Eigen::Vector2d(3, 4).asDiagonal()));
  const Eigen::Vector2d q(0.5, 0.25), u(1.0, 2.0);
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(1), none;
  EXPECT_EQ(energy(q, u, one, one), energy(q, u, Eigen::Vector2d(1, 0), Eigen::Vector2d(1, 0)));
  EXPECT_EQ(energy(q, u, none, none)[0], energy(q, u, 0.0 * q, 0.0 * u)[0]);
  EXPECT_EQ(energy(q, u, q, u)[0], 0.0);
}

TEST(ErrorEnergyTest, RefusesAnIndefiniteMass) {
  EXPECT_THROW(ErrorEnergy(model(Eigen::Vector2d(1, 0).asDiagonal(), Eigen::Matrix2d::Identity())),
               ModelError);
  EXPECT_THROW(
      ErrorEnergy(model((Eigen::Matrix2d() << 1, 2, 2, 1).finished(), Eigen::Matrix2d::Identity())),
      ModelError);
}

}  // namespace
}  // namespace sprag
