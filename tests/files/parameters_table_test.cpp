// [parameters] of a scene: read, rejected and written.
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/scene_file.h"
#include "tests/files/scene_texts.h"

namespace sprag {
namespace {

using Keys = std::vector<std::string>;

std::string beam_with(const std::string& table) {
  return std::string(beam_text) + "[parameters]\n" + table;
}

std::string system_with(const std::string& table) {
  return std::string(system_text) + "[parameters]\n" + table;
}

TEST(ParametersTable, KeepsOrderOfTheFile) {
  const ParameterUncertainty parameters = parse(beam_with(R"(
impact.restitution = { sigma = 0.01 }
"contact.1.position" = { sigma = 1e-4, consider = true }
beam.damping = { sigma = 0.002 }
correlation = [["impact.restitution", "beam.damping", -0.3]]
)"))
                                              .prior.parameters;
  EXPECT_FALSE(parameters.empty());
  EXPECT_EQ(parameters.keys, (Keys{"impact.restitution", "contact.1.position", "beam.damping"}));
  EXPECT_EQ(parameters.sigma, Eigen::Vector3d(0.01, 1e-4, 0.002));
  EXPECT_EQ(parameters.consider, (std::vector<bool>{false, true, false}));
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Identity();
  correlation(0, 2) = correlation(2, 0) = -0.3;
  EXPECT_EQ(parameters.correlation, correlation);
}

TEST(ParametersTable, IsEmptyByDefault) {
  for (const std::string& text : {std::string(beam_text), beam_with(""),
                                  beam_with("consider = true"), beam_with("correlation = []")}) {
    const ParameterUncertainty parameters = parse(text).prior.parameters;
    EXPECT_TRUE(parameters.empty());
    EXPECT_EQ(parameters.sigma.size(), 0);
    EXPECT_EQ(parameters.root_of_covariance().size(), 0);
  }
}

TEST(ParametersTable, ConsiderIsADefaultForEntriesWithoutTheirOwn) {
  const ParameterUncertainty parameters = parse(beam_with(R"(
beam.damping = { sigma = 0.002 }
beam.bending_stiffness = { sigma = 1, consider = false }
consider = true
)"))
                                              .prior.parameters;
  EXPECT_EQ(parameters.consider, (std::vector<bool>{true, false}));
}

// Headers, dotted keys, quoted keys and inline tables are equivalent.
TEST(ParametersTable, AcceptsAllFormsOfKey) {
  for (const char* text : {"[parameters.contact.1.position]\nsigma = 0.5\n",
                           "[parameters]\ncontact = { 1 = { position = { sigma = 0.5 } } }\n",
                           "[parameters]\ncontact.1.position.sigma = 0.5\n",
                           "[parameters]\ncontact.\"1.position\" = { sigma = 0.5 }\n"}) {
    const ParameterUncertainty parameters = parse(std::string(beam_text) + text).prior.parameters;
    EXPECT_EQ(parameters.keys, (Keys{"contact.1.position"})) << text;
    EXPECT_EQ(parameters.sigma[0], 0.5) << text;
  }
}

TEST(ParametersTable, InvalidEntriesAreRefused) {
  // The [parameters] header is line 26 of the text.
  const std::string a = "beam.damping = { sigma = 0.1 }\n",
                    b = "impact.restitution = { sigma = 1 }\n",
                    c = "contact.1.position = { sigma = 1 }\n";
  const std::string pair = "[\"key\", \"other key\", number]", shape = "an array of " + pair;
  for (const auto& [given, message] : std::vector<std::pair<std::string, std::string>>{
           {"beam.damping = {}", "27:16: missing key parameters.beam.damping.sigma"},
           {"beam.damping = { consider = true }",
            "27:16: missing key parameters.beam.damping.sigma"},
           {"beam.damping = { sigma = 0 }",
            "27:26: parameters.beam.damping.sigma is 0; must be > 0"},
           {"beam.damping = { sigma = -0.1 }",
            "27:26: parameters.beam.damping.sigma is -0.1; must be > 0"},
           {"beam.damping = { sigma = inf }",
            "27:26: parameters.beam.damping.sigma is inf; must be finite"},
           {"beam.damping = { sigma = nan }",
            "27:26: parameters.beam.damping.sigma is nan; must be finite"},
           {"beam.damping = { sigma = \"0.1\" }",
            "27:26: parameters.beam.damping.sigma is a string; must be a number"},
           {"beam.damping = { sigma = 1, consider = 1 }",
            "27:40: parameters.beam.damping.consider is an integer; must be true or false"},
           {"beam.damping = { sgima = 0.1 }",
            "27:18: unknown key parameters.beam.damping.sgima; did you mean sigma?"},
           {"beam.damping = { sigma = 0.1, mean = 2 }",
            "27:31: unknown key parameters.beam.damping.mean; must be one of sigma, consider"},
           {"beam.damping = 0.1",
            "27:16: parameters.beam.damping is a float; must be a table, as in beam.damping = "
            "{ sigma = 0.01 }"},
           {"consider = 1\n" + a,
            "27:12: parameters.consider is an integer; must be true or false"},
           {"conisder = true\n" + a,
            "27:12: parameters.conisder is a boolean; must be a table, as in conisder = "
            "{ sigma = 0.01 }"},
           {a + "\"beam.damping\" = { sigma = 0.1 }",
            "28:1: parameters.beam.damping is listed again; must be listed once"},
           {a + b + "correlation = 0.5",
            "29:15: parameters.correlation is a float; must be " + shape},
           {a + b + "correlation = [0.5]",
            "29:16: parameters.correlation[1] is a float; must be " + pair},
           {a + b + "correlation = [[\"beam.damping\", 0.5]]",
            "29:16: parameters.correlation[1] has 2 entries; must have 3, " + pair},
           {a + b + "correlation = [[\"beam.damping\", 1, 0.5]]",
            "29:33: parameters.correlation[1][2] is an integer; must be the key of a parameter, "
            "in quotes"},
           {a + b + "correlation = [[\"beam.damping\", \"contact.1.position\", 0.5]]",
            "29:33: parameters.correlation[1][2] is contact.1.position, which has no sigma here; "
            "must be one of beam.damping, impact.restitution"},
           {a + "correlation = [[\"beam.damping\", \"beam.damping\", 0.5]]",
            "28:16: parameters.correlation[1] is of beam.damping with itself; must be of two "
            "parameters"},
           {a + b +
                "correlation = [[\"beam.damping\", \"impact.restitution\", 0.5],\n"
                "[\"impact.restitution\", \"beam.damping\", 0.5]]",
            "30:1: parameters.correlation[2] is of impact.restitution and beam.damping again; must "
            "be given once"},
           {a + b + "correlation = [[\"beam.damping\", \"impact.restitution\", 1.5]]",
            "29:55: parameters.correlation[1][3] is 1.5; must be in [-1, 1]"},
           {a + b + "correlation = [[\"beam.damping\", \"impact.restitution\", nan]]",
            "29:55: parameters.correlation[1][3] is nan; must be finite"},
           {a + b + c +
                "correlation = [[\"beam.damping\", \"impact.restitution\", 1.0],\n"
                "[\"impact.restitution\", \"contact.1.position\", 1.0],\n"
                "[\"beam.damping\", \"contact.1.position\", -1.0]]",
            "30:15: parameters.correlation makes a matrix with the eigenvalue -1; must be positive "
            "semidefinite"}}) {
    EXPECT_EQ(error_of(beam_with(given)), "x.toml:" + message) << given;
  }
  EXPECT_EQ(error_of("parameters = 1\n" + std::string(beam_text)),
            "x.toml:1:14: parameters is an integer; must be a table");
}

TEST(ParametersTable, AcceptsOnlyParametersThatFilterCanEstimate) {
  const std::string misspelled = error_of(beam_with("beam.dampin = { sigma = 0.1 }"));
  EXPECT_TRUE(misspelled.starts_with(
      "x.toml:27:6: parameters: beam.dampin is no parameter of this scene; did you mean "
      "beam.damping? It has impact.restitution, beam.damping, "))
      << misspelled;
  EXPECT_TRUE(error_of(beam_with("system.K = { sigma = 0.1 }"))
                  .starts_with("x.toml:27:8: parameters: system.K is no parameter of this scene"));
  // The force and the support have two frequencies.
  for (const char* key : {"system.C", "system.K.1.2", "system.C.2.2", "excitations.amplitude"}) {
    EXPECT_EQ(parse(system_with(std::string(key) + " = { sigma = 0.1 }")).prior.parameters.keys,
              Keys{key});
  }
  for (const char* clock : {"clock.offset = { sigma = 0.1 }", "clock.rate = { sigma = 1e-4 }"}) {
    EXPECT_NE(error_of(system_with(clock)).find("is of the contact clock"), std::string::npos);
  }
}

// S S^T is the covariance, also for singular correlations.
TEST(ParametersTable, RootOfCovariance) {
  for (const double correlation : {0.0, 0.4, -0.999999, -1.0, 1.0}) {
    ParameterUncertainty parameters;
    parameters.keys = {"a", "b", "c"};
    parameters.sigma = Eigen::Vector3d(1e-6, 2.0, 3e4);
    parameters.correlation = Eigen::Matrix3d::Identity();
    parameters.correlation(0, 1) = parameters.correlation(1, 0) = correlation;
    const Eigen::MatrixXd S = parameters.root_of_covariance();
    ASSERT_EQ(S.rows(), 3);
    ASSERT_EQ(S.cols(), 3);
    const Eigen::VectorXd inverse = parameters.sigma.cwiseInverse();
    const Eigen::MatrixXd scaled =
        inverse.asDiagonal() * product(S, S.transpose()) * inverse.asDiagonal();
    EXPECT_LT((scaled - parameters.correlation).cwiseAbs().maxCoeff(), 1e-14) << correlation;
  }
}

TEST(ParametersTable, RoundTrips) {
  const Scene scene = parse(system_with(R"(
system.K = { sigma = 0.017, consider = true }
contact.1.clearance = { sigma = 1e-300 }
"contact.1.motion.phase" = { sigma = 0.1 }
correlation = [["system.K", "contact.1.motion.phase", 0.1234567890123456],
               ["contact.1.clearance", "system.K", -0.5]]
consider = false
)"));
  const ParameterUncertainty again = parse(to_toml(scene)).prior.parameters;
  EXPECT_EQ(again.keys, (Keys{"system.K", "contact.1.clearance", "contact.1.motion.phase"}));
  EXPECT_EQ(again.keys, scene.prior.parameters.keys);
  EXPECT_EQ(again.sigma, scene.prior.parameters.sigma);
  EXPECT_EQ(again.consider, scene.prior.parameters.consider);
  EXPECT_EQ(again.correlation, scene.prior.parameters.correlation);
  EXPECT_EQ(to_toml(ParameterUncertainty{}, "none"), "");
  EXPECT_TRUE(
      to_toml(scene.prior.parameters, "why")
          .starts_with("[parameters]\n# why\nsystem.K = { sigma = 0.017, consider = true }\n"));
}

// Its keys are the beam's, but the written scene is a system if they do not give its matrices.
TEST(ParametersTable, IsWrittenOfABeamThatHasItsKeys) {
  Scene scene = parse(beam_with("beam.damping = { sigma = 0.1 }"));
  EXPECT_EQ(parse(to_toml(scene)).prior.parameters.keys, scene.prior.parameters.keys);
  scene.model.K(0, 0) *= 1.5;
  const std::string text = to_toml(scene);
  EXPECT_EQ(text.find("[parameters]"), std::string::npos);
  EXPECT_TRUE(parse(text).prior.parameters.empty());
}

}  // namespace
}  // namespace sprag
