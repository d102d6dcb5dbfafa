// Would catch a scene's key that is read wrongly or has another default. The beam's force is held
// to tests/reference, and several forces to what scenes write (scene_writer_test.cpp).
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <filesystem>
#include <string>
#include <string_view>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/scene_file.h"
#include "tests/files/scene_texts.h"

namespace sprag {
namespace {

std::filesystem::path shipped(const std::string& name) {
  return std::filesystem::path(SPRAG_SOURCE_DIR) / "scenes" / (name + ".toml");
}

double synchronization_energy(const Scene& scene) {
  const Eigen::VectorXd q = scene.truth.start.q - scene.prior.start.q;
  const Eigen::VectorXd u = scene.truth.start.u - scene.prior.start.u;
  return 0.5 * u.dot(scene.model.M * u) + 0.5 * q.dot(scene.model.K * q);
}

TEST(Scene, BeamSceneIsReadAsWritten) {
  const Scene scene = parse(beam_text);
  EXPECT_EQ(scene.name, "x");
  ASSERT_TRUE(scene.beam.has_value());
  EXPECT_EQ(scene.beam->modes, 3);
  EXPECT_EQ(scene.beam->damping, 0.17);
  const Model& model = scene.model;
  EXPECT_EQ(model.M, Eigen::MatrixXd(mass(*scene.beam).asDiagonal()));
  EXPECT_EQ(model.C, Eigen::MatrixXd(damping(*scene.beam).asDiagonal()));
  EXPECT_EQ(model.K, Eigen::MatrixXd(stiffness(*scene.beam).asDiagonal()));
  EXPECT_EQ(model.law, ImpactLaw::poisson);
  EXPECT_EQ(model.chatter_time, 1e-7);
  ASSERT_EQ(model.contacts.size(), 1U);
  EXPECT_EQ(model.contacts[0].w, mode_shapes(*scene.beam, 0.868));
  EXPECT_EQ(model.contacts[0].clearance, 0.01);
  EXPECT_EQ(model.contacts[0].restitution, 0.7);
  EXPECT_EQ(scene.truth.start.q, Eigen::Vector3d(-0.05, 0, 0));
  EXPECT_EQ(scene.prior.start.q, Eigen::Vector3d(0.1, 2, 0));
  EXPECT_EQ(scene.prior.start.u, Eigen::Vector3d::Zero());
  EXPECT_FALSE(scene.truth.release_penetration);
}

TEST(Scene, SystemSceneIsReadAsWritten) {
  const Scene scene = parse(system_text);
  EXPECT_FALSE(scene.beam.has_value());
  const Model& model = scene.model;
  EXPECT_EQ(model.M, (Eigen::Matrix2d() << 2, 0.5, 0.5, 1).finished());
  EXPECT_EQ(model.C, (Eigen::Matrix2d() << 0.1, 0, 0, 0.2).finished());
  EXPECT_EQ(model.K, (Eigen::Matrix2d() << 3, -1, -1, 3).finished());
  ASSERT_EQ(model.forces.size(), 1U);
  EXPECT_EQ(model.forces[0].direction, Eigen::Vector2d(1, 2));
  EXPECT_EQ(model.forces[0].constant, -9.81);
  EXPECT_EQ(model.forces[0].harmonic.amplitude, 0.3);
  EXPECT_EQ(model.forces[0].harmonic.frequency, 2.0);
  EXPECT_EQ(model.forces[0].harmonic.phase, 0.0);
  EXPECT_EQ(model.contacts[0].w, Eigen::Vector2d(0, 1));
  EXPECT_EQ(model.contacts[0].motion.amplitude, 0.01);
  EXPECT_EQ(model.contacts[0].motion.frequency, 4.0);
  EXPECT_EQ(model.contacts[0].motion.phase, 0.5);
  EXPECT_EQ(model.contacts[0].restitution, 0.5);
  EXPECT_EQ(scene.truth.start.q, Eigen::Vector2d(0.1, 0.2));
  EXPECT_EQ(scene.truth.start.u, Eigen::Vector2d::Zero());
}

TEST(Scene, DampingRatiosArePerMode) {
  const Scene one = parse(replaced(beam_text, "damping = 0.17", "damping_ratio = 0.02"));
  const Scene each =
      parse(replaced(beam_text, "damping = 0.17", "damping_ratio = [0.01, 0.0, 0.3]"));
  const Eigen::Vector3d zeta(0.01, 0.0, 0.3);
  for (int i = 0; i < 3; ++i) {
    const double critical = 2.0 * std::sqrt(one.model.K(i, i) * one.model.M(i, i));
    EXPECT_NEAR(one.model.C(i, i), 0.02 * critical, 1e-15 * critical);
    EXPECT_NEAR(each.model.C(i, i), zeta[i] * critical, 1e-15 * critical);
  }

  // Coupled masses: in the natural modes, by ascending frequency.
  const Model model =
      parse(replaced(system_text, "C = [[0.1, 0.0], [0.0, 0.2]]", "damping_ratio = [0.05, 0.1]"))
          .model;
  const Eigenpairs modes = eigenpairs(model.K, model.M);
  const Eigen::MatrixXd C = congruent(modes.vectors, model.C);
  const Eigen::Vector2d omega = modes.values.cwiseSqrt();
  EXPECT_NEAR(C(0, 0), 2.0 * 0.05 * omega[0], 1e-13);
  EXPECT_NEAR(C(1, 1), 2.0 * 0.1 * omega[1], 1e-13);
  EXPECT_NEAR(C(0, 1), 0.0, 1e-13);
}

TEST(Scene, SideAndMountSetTheGap) {
  const Eigen::Vector3d q(0.03, -0.02, 0.01);
  const Eigen::Vector3d u(0.5, 0.7, -0.3);
  const double t = 0.4;
  const Harmonic e{0.03, 9.5, 0.25};
  const auto contact_of = [](std::string_view side, std::string_view mount) {
    const std::string lines =
        "side = \"" + std::string(side) + "\"\nmount = \"" + std::string(mount) + "\"";
    const std::string text = replaced(beam_text, "side = \"below\"\nmount = \"ground\"", lines);
    return parse(replaced(text, "q = [-0.05, 0.0, 0.0]", "penetration = \"release\""))
        .model.contacts[0];
  };
  const Eigen::VectorXd v = mode_shapes({.modes = 3}, 0.868);
  const double w = v.dot(q);
  const double rate_of_w = v.dot(u);
  const Contact below = contact_of("below", "ground");
  EXPECT_DOUBLE_EQ(gap(below, q, t), w + value(e, t) + 0.01);
  EXPECT_DOUBLE_EQ(gap_velocity(below, u, t), rate_of_w + rate(e, t));
  const Contact above = contact_of("above", "ground");
  EXPECT_DOUBLE_EQ(gap(above, q, t), -w - value(e, t) + 0.01);
  EXPECT_DOUBLE_EQ(gap_velocity(above, u, t), -rate_of_w - rate(e, t));
  EXPECT_DOUBLE_EQ(gap(contact_of("below", "frame"), q, t), w + 0.01);
  EXPECT_DOUBLE_EQ(gap(contact_of("above", "frame"), q, t), -w + 0.01);
}

TEST(Scene, OmittedKeysTakeDefaults) {
  const Scene beam = parse(
      "[beam]\nmodes = 2\nlength = 1\nbending_stiffness = 1\nmass_per_length = 1\ndamping = 0\n"
      "[[contact]]\nposition = 1\nrestitution = 0.3\n");
  EXPECT_EQ(beam.model.law, ImpactLaw::poisson);
  EXPECT_EQ(beam.model.chatter_time, 1e-8 * time_scale(beam.model, beam.truth.start));
  EXPECT_TRUE(beam.model.forces.empty());
  EXPECT_EQ(beam.model.contacts[0].w, mode_shapes(*beam.beam, 1.0));
  EXPECT_EQ(beam.model.contacts[0].clearance, 0.0);
  EXPECT_EQ(beam.model.contacts[0].restitution, 0.3);
  EXPECT_EQ(value(beam.model.contacts[0].motion, 0.3), 0.0);
  EXPECT_EQ(beam.truth.start.q, Eigen::Vector2d::Zero());
  EXPECT_EQ(beam.prior.start.u, Eigen::Vector2d::Zero());
}

TEST(ShippedScenes, PaperBeamAsPrintedStartsInsideWithTheSameEnergy) {
  const Scene scene = read_scene(shipped("paper_beam_as_printed"));
  EXPECT_TRUE(scene.truth.release_penetration);
  EXPECT_NEAR(synchronization_energy(scene), 0.4783533, 5e-8);
  EXPECT_NEAR(gap(scene.model.contacts[0], scene.truth.start.q, 0.0), -0.0518, 5e-5);
  EXPECT_EQ(scene.truth.start.q, -read_scene(shipped("paper_beam")).truth.start.q);
  EXPECT_EQ(scene.prior.start.q, -read_scene(shipped("paper_beam")).prior.start.q);
}

TEST(Scene, DefinitenessDoesNotDependOnUnits) {
  const std::string text =
      replaced(system_text, "[[2.0, 0.5], [0.5, 1.0]]", "[[1e-14, 1e-5], [1e-5, 1e6]]");
  EXPECT_EQ(parse(text).model.M(1, 1), 1e6);
  EXPECT_EQ(
      parse(replaced(system_text, "[[3, -1], [-1, 3.0]]", "[[1, -1], [-1, 1]]")).model.K(0, 1),
      -1.0);
  EXPECT_EQ(parse(replaced(system_text, "[[3, -1], [-1, 3.0]]", "[[0, 0], [0, 0]]")).model.K,
            Eigen::Matrix2d::Zero());
}

TEST(Scene, StartOnSupportIsAcceptedDespiteRounding) {
  // 0.1 * 3 exceeds 0.3 by one rounding.
  EXPECT_EQ(parse("[system]\nM = [[1]]\nC = [[0]]\nK = [[0]]\n[impact]\nrestitution = 0.5\n"
                  "[[contact]]\ndirection = [-3]\nclearance = 0.3\n[master]\nq = [0.1]\n")
                .truth.start.q(0),
            0.1);
}

TEST(SceneFile, UnreadableFilesAreNamed) {
  const auto error_of_file = [](const std::filesystem::path& file) {
    return message_of([&] { read_scene(file); });
  };
  EXPECT_EQ(error_of_file("scenes/absent.toml"),
            "scenes/absent.toml: cannot be read: No such file or directory");
  EXPECT_EQ(error_of_file("/"), "/: cannot be read: Is a directory");
}

}  // namespace
}  // namespace sprag
