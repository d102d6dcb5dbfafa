// Would catch an error energy V with a missing or negative part.
#include "sprag/energy.h"

#include <gtest/gtest.h>

#include <random>

namespace sprag {
namespace {

Model model(const Eigen::MatrixXd& M, const Eigen::MatrixXd& K) {
  Model result;
  result.M = M;
  result.C = Eigen::MatrixXd::Zero(M.rows(), M.cols());
  result.K = K;
  return result;
}

Eigen::MatrixXd random_spd(Eigen::Index n) {
  const Eigen::MatrixXd a = Eigen::MatrixXd::Random(n, n);
  return a * a.transpose() + 0.1 * Eigen::MatrixXd::Identity(n, n);
}

TEST(ErrorEnergyTest, PaperBeamAtTheStart) {
  const Eigen::Vector3d beta(1.8751040687119611, 4.6940911329741746, 7.8547574382376125);
  const Eigen::Vector3d k = beta.array().pow(4);
  const ErrorEnergy energy(model(Eigen::Matrix3d::Identity(), k.asDiagonal()));
  const Eigen::Vector3d q_m(-0.05, 0.0, 0.0);
  const Eigen::Vector3d q_s = 0.5 * beta.array().pow(-2);
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const Eigen::VectorXd v = energy(q_m, zero, q_s, zero);
  ASSERT_EQ(v.size(), 4);
  EXPECT_NEAR(v[0], 0.4783533, 5e-8);
  EXPECT_NEAR(v[1], 0.2283533, 5e-8);
  EXPECT_NEAR(v[2], 0.125, 1e-14);
  EXPECT_NEAR(v[3], 0.125, 1e-14);
}

TEST(ErrorEnergyTest, PartsAreNonNegativeAndSumToTheQuadraticForm) {
  const unsigned seed = 99;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::srand(seed);
  for (const Eigen::Index n : {1, 2, 5, 20}) {
    const Eigen::MatrixXd M = random_spd(n);
    Eigen::MatrixXd K = random_spd(n);
    if (n == 5) K = Eigen::VectorXd::Ones(n) * Eigen::RowVectorXd::Ones(n);  // rigid-body modes
    const ErrorEnergy energy(model(M, K));
    for (int i = 0; i < 20; ++i) {
      const Eigen::VectorXd q = Eigen::VectorXd::Random(n), u = Eigen::VectorXd::Random(n);
      const Eigen::VectorXd q_s = Eigen::VectorXd::Random(n), u_s = Eigen::VectorXd::Random(n);
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
