// system.modes: a scene of 20 or 200 coordinates keeps some modes of its machine.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/reduction.h"
#include "sprag/scene_file.h"
#include "sprag/simulate.h"
#include "tests/files/scene_texts.h"
#include "tests/support/random.h"
#include "tests/support/repetitions.h"

namespace sprag {
namespace {

std::string text_of(const Eigen::VectorXd& vector) {
  std::string text = "[";
  char number[40];
  for (const double value : vector) {
    std::snprintf(number, sizeof number, "%.17g, ", value);
    text += number;
  }
  return text + "]";
}

std::string text_of(const Eigen::MatrixXd& matrix) {
  std::string text = "[";
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    text += text_of(Eigen::VectorXd(matrix.row(i))) + ",\n";
  }
  return text + "]";
}

// A bar of N unequal elements with a consistent mass matrix, clamped at its left end, which is
// shaken. The free end meets a stop.
struct Bar {
  explicit Bar(int n, std::uint64_t seed = 3) : N(n), M(N, N), K(N, N) {
    Random random(seed);
    M.setZero();
    K.setZero();
    for (int e = 0; e < N; ++e) {
      const double share = random.uniform(0.8, 1.2) / N;
      const auto add = [&](Eigen::MatrixXd& matrix, double same, double other) {
        matrix(e, e) += same;
        if (e == 0) return;
        matrix(e - 1, e - 1) += same;
        matrix(e - 1, e) += other;
        matrix(e, e - 1) += other;
      };
      add(M, share / 3.0, share / 6.0);
      add(K, 1.0 / share, -1.0 / share);
    }
    M = (M + M.transpose()).eval() / 2.0;
    tip = Eigen::VectorXd::Unit(N, N - 1);
    start = 0.05 * Eigen::VectorXd::LinSpaced(N, 1.0 / N, 1.0);
  }

  std::string text(const std::string& system, const std::string& mount = "frame",
                   const std::string& damping = "damping_ratio = 0.03") const {
    return "[system]\nM = " + text_of(M) + "\nK = " + text_of(K) + "\n" + damping + "\n" + system +
           "\n[excitation]\ninfluence = 1.0\namplitude = 0.1\nfrequency = 2.0\n" +
           "[[contact]]\ndirection = " + text_of(tip) + "\nclearance = 0.12\nmount = \"" + mount +
           "\"\n[impact]\nrestitution = 0.6\n[[output]]\nname = \"tip\"\ndirection = " +
           text_of(tip) + "\n[master]\nq = " + text_of(start) + "\n[replica]\nuncertainty = 0.1\n";
  }

  Scene scene(const std::string& system, const std::string& mount = "frame",
              const std::string& damping = "damping_ratio = 0.03") const {
    return parse(text(system, mount, damping));
  }

  int N;
  Eigen::MatrixXd M, K;
  Eigen::VectorXd tip, start;
};

Simulation run(const Scene& scene, double duration, double h = 0.05) {
  return simulate(scene.model, scene.truth.start, duration, h);
}

Eigen::VectorXd tips(const Scene& scene, const Simulation& run) {
  return run.q * scene.model.outputs[0].direction;
}

void expect_same_impacts(const Simulation& whole, const Simulation& part, double tolerance) {
  ASSERT_GE(whole.events.size(), 4U);
  ASSERT_EQ(whole.events.size(), part.events.size());
  for (std::size_t i = 0; i < whole.events.size(); ++i) {
    EXPECT_EQ(whole.events[i].kind, part.events[i].kind) << i;
    EXPECT_NEAR(whole.events[i].t, part.events[i].t, tolerance) << i;
  }
}

// The exact flow of 200 coordinates takes seconds.
std::vector<int> sizes() { return thorough() ? std::vector{20, 200} : std::vector{20}; }

TEST(KeptModes, AllModesHaveTheFullMachinesImpacts) {
  for (const int N : sizes()) {
    const Bar bar(N);
    for (const char* mount : {"frame", "ground"}) {
      // The many bounces of 200 elements amplify rounding: a short run.
      const double duration = N == 20 ? 12.0 : 2.0;
      const Scene whole = bar.scene("", mount);
      const Scene all = bar.scene("modes = " + std::to_string(N), mount);
      EXPECT_EQ(all.model.coordinates(), N);
      EXPECT_TRUE(all.model.M.isIdentity(0.0));
      EXPECT_TRUE(all.model.K.isDiagonal(0.0));
      EXPECT_TRUE(all.model.C.isDiagonal(0.0));
      const Simulation of_whole = run(whole, duration), of_all = run(all, duration);
      expect_same_impacts(of_whole, of_all, 1e-9);
      EXPECT_LT((tips(whole, of_whole) - tips(all, of_all)).cwiseAbs().maxCoeff(), 1e-9);
      EXPECT_LT((of_whole.q.transpose() - product(all.kept->Phi, of_all.q.transpose()))
                    .cwiseAbs()
                    .maxCoeff(),
                1e-8);
      if (N == 200) break;
    }
  }
}

// A matrix that couples the modes, Rayleigh damping and damping ratios all mean what they mean
// without `modes`.
TEST(KeptModes, EveryKindOfDampingIsProjected) {
  const Bar bar(20);
  Eigen::MatrixXd dashpot = Eigen::MatrixXd::Zero(20, 20);
  dashpot(7, 7) = 0.2;
  dashpot(19, 19) = 0.05;
  std::string ratios = "modal_damping = [";
  for (int i = 0; i < 20; ++i) ratios += std::to_string(0.02 + 0.003 * i) + ", ";
  for (const std::string& damping :
       {"C = " + text_of(dashpot), std::string("rayleigh = { alpha = 0.1, beta = 0.003 }"),
        ratios + "]"}) {
    expect_same_impacts(run(bar.scene("", "frame", damping), 5.0),
                        run(bar.scene("modes = 20", "frame", damping), 5.0), 1e-9);
  }
  // Ratios of the kept modes alone.
  const Scene few = bar.scene("modes = 3", "frame", "damping_ratio = [0.02, 0.023, 0.026]");
  const Scene cut = bar.scene("modes = 3", "frame", ratios + "]");
  EXPECT_LT((few.model.C - cut.model.C).norm(), 1e-12 * cut.model.C.norm());
}

TEST(KeptModes, CoordinatesOfTheFileAreProjected) {
  const Bar bar(20);
  const Scene whole = bar.scene("", "ground");
  const Scene part = bar.scene("modes = 4\nstatic_vectors = [0, 1]", "ground");
  const KeptModes& kept = *part.kept;
  EXPECT_EQ(kept.modes, 4);
  EXPECT_EQ(part.model.coordinates(), 6);
  EXPECT_EQ(kept.given(), 20);
  EXPECT_LT((congruent(kept.Phi, bar.M) - Eigen::MatrixXd::Identity(6, 6)).norm(), 1e-12);
  EXPECT_LT((congruent(kept.Phi, bar.K) - part.model.K).norm(), 1e-12 * part.model.K.norm());
  // The support on the ground moves as it does for the whole machine.
  EXPECT_EQ(part.model.contacts[0].motion.amplitude, whole.model.contacts[0].motion.amplitude);
  // b_0 keeps G = w^T M^-1 w, b_1 the static flexibility w^T K^-1 w.
  const Eigen::VectorXd& w = part.model.contacts[0].w;
  const Eigen::VectorXd& W = whole.model.contacts[0].w;
  EXPECT_NEAR(w.squaredNorm() / W.dot(CholeskyFactor(bar.M).solve(W).col(0)), 1.0, 1e-10);
  EXPECT_NEAR(w.dot(CholeskyFactor(part.model.K).solve(w).col(0)) /
                  W.dot(CholeskyFactor(bar.K).solve(W).col(0)),
              1.0, 1e-10);
  // A state of the kept modes keeps its gap and its outputs.
  const State state{Eigen::VectorXd::LinSpaced(6, 1.0, 2.0),
                    Eigen::VectorXd::LinSpaced(6, 0.1, 1.0)};
  const State given = expanded(state, kept);
  EXPECT_NEAR(gap(whole.model.contacts[0], given.q, 0.3), gap(part.model.contacts[0], state.q, 0.3),
              1e-12);
  EXPECT_LT((projected(given, kept).u - state.u).norm(), 1e-12);
}

TEST(KeptModes, DeviationsOfTheStart) {
  const Bar bar(20);
  const auto with = [&](const std::string& sigma) {
    return parse(replaced(bar.text("modes = 3"), "uncertainty = 0.1", sigma));
  };
  const Scene one = with("sigma_q = 0.01\nsigma_u = 0.1");
  const Eigen::MatrixXd covariance =
      1e-4 * product(one.kept->to_kept, one.kept->to_kept.transpose());
  EXPECT_LT((one.prior.sigma->q.cwiseAbs2() - covariance.diagonal()).norm(), 1e-15);
  const Scene each = with("sigma_q = [0.1, 0.2, 0.3]\nsigma_u = [1, 2, 3]");
  EXPECT_EQ(each.prior.sigma->q, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_NE(error_of(replaced(bar.text("modes = 3"), "uncertainty = 0.1",
                              "sigma_q = [1, 2]\nsigma_u = 1.0"))
                .find("replica.sigma_q has 2 numbers; must be one or 3"),
            std::string::npos);
}

TEST(KeptModes, FreeMachineKeepsItsRigidMotion) {
  Bar bar(20);
  bar.K(0, 0) -= bar.K.row(0).sum();  // no clamp
  const Scene scene = bar.scene("modes = 3");
  EXPECT_EQ(scene.model.K(0, 0), 0.0);
  EXPECT_EQ(scene.model.C(0, 0), 0.0);
  EXPECT_GT(scene.model.K(1, 1), 1.0);
}

TEST(KeptModes, WrittenSceneIsTheReducedMachine) {
  const Bar bar(20);
  for (const char* mount : {"frame", "ground"}) {
    const Scene scene = bar.scene("modes = 3\nstatic_vectors = 0", mount);
    const Scene written = parse(to_toml(scene));
    EXPECT_EQ(written.model.coordinates(), 4);
    EXPECT_FALSE(written.kept);
    expect_same_impacts(run(scene, 10.0), run(written, 10.0), 0.0);
  }
}

TEST(KeptModes, MistakesAreRefused) {
  const Bar bar(20);
  const std::string text = bar.text("modes = 3");
  ASSERT_EQ(error_of(text), "no error");
  for (const auto& [keys, message] : std::vector<std::pair<std::string, std::string>>{
           {"modes = 0", "system.modes is 0; must be in 1..20"},
           {"modes = 21", "system.modes is 21; must be in 1..20"},
           {"modes = -1", "system.modes is -1; must be in 1..20"},
           {"modes = 2.5", "system.modes is a float; must be an integer"},
           {"modes = \"3\"", "system.modes is a string; must be an integer"},
           {"modes = [3]", "system.modes is an array; must be an integer"},
           {"static_vectors = [0]", "system.static_vectors needs system.modes"},
           {"static_damping_ratio = 0.1", "system.static_damping_ratio needs system.modes"},
           {"modes = 3\nstatic_damping_ratio = 0.1",
            "system.static_damping_ratio needs system.static_vectors"},
           {"modes = 3\nstatic_vectors = [1, 0]",
            "system.static_vectors has 0; must be whole numbers from 0 to 3, ascending"},
           {"modes = 3\nstatic_vectors = [4]", "system.static_vectors has 4"},
           {"modes = 3\nstatic_vectors = [0.5]", "system.static_vectors has 0.5"},
           {"modes = 3\nstatic_vectors = [0]\nstatic_damping_ratio = -1",
            "system.static_damping_ratio is -1; must be >= 0"}}) {
    const std::string error = error_of(replaced(text, "modes = 3", keys));
    EXPECT_NE(error.find("x.toml:"), std::string::npos) << error;
    EXPECT_NE(error.find(message), std::string::npos) << keys << ": " << error;
  }
  // Vectors have the file's coordinates.
  const std::string short_direction =
      replaced(text, "[[output]]\nname = \"tip\"\ndirection = " + text_of(bar.tip),
               "[[output]]\nname = \"tip\"\ndirection = [1, 0, 0]");
  EXPECT_NE(error_of(short_direction).find("must be 20"), std::string::npos);
  // A beam has modes of its own.
  EXPECT_NE(error_of(std::string(beam_text) + "[system]\nmodes = 2\n")
                .find("system and beam exclude each other"),
            std::string::npos);
  EXPECT_NE(error_of(replaced(beam_text, "modes = 3", "modes = 3\nstatic_vectors = [0]"))
                .find("static_vectors"),
            std::string::npos);
  // Single entries of matrices are no parameters of the reduced machine.
  EXPECT_NE(error_of(text + "[adapt]\nfree = [\"system.K.1.2\"]\n").find("with system.modes"),
            std::string::npos);
  EXPECT_EQ(error_of(text + "[adapt]\nfree = [\"system.K\"]\n"), "no error");
}

TEST(KeptModes, ContactAtANodeOfTheKeptModesIsRefused) {
  // Two equal masses: the second mode has a node in the middle.
  const std::string text = R"([system]
M = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
K = [[2, -1, 0], [-1, 2, -1], [0, -1, 2]]
damping_ratio = 0.1
modes = 1
[[contact]]
direction = [1, 0, -1]
[impact]
restitution = 0.5
)";
  EXPECT_EQ(error_of(text),
            "x.toml:7:13: contact[1].direction is zero in the first 1 modes; must not be (keep "
            "more with system.modes, or set system.static_vectors = [0])");
  EXPECT_EQ(error_of(replaced(text, "modes = 1", "modes = 1\nstatic_vectors = [0]")), "no error");
  EXPECT_EQ(error_of(replaced(text, "modes = 1", "modes = 2")), "no error");
}

TEST(KeptModes, StartInsideForWantOfModesIsReleased) {
  const Bar bar(20);
  std::string text = bar.text("modes = 1");
  // The free end alone is pulled away from the stop; one mode does not show that.
  const Eigen::VectorXd start = -0.119 * Eigen::VectorXd::Ones(20);
  text = replaced(text, text_of(bar.start), text_of(start));
  const Scene scene = parse(text);
  EXPECT_TRUE(scene.truth.release_penetration);
  ASSERT_EQ(scene.remarks.size(), 1U);
  EXPECT_NE(scene.remarks[0].find("because modes are left out"), std::string::npos);
  EXPECT_FALSE(parse(replaced(text, "modes = 1", "modes = 20")).truth.release_penetration);
}

}  // namespace
}  // namespace sprag
