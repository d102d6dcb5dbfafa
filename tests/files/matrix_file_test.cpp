// Matrices as written by numpy, scipy and MATLAB, and scenes that use them.
#include "sprag/detail/files/matrix_file.h"

#include <gtest/gtest.h>

#include <vector>

#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/files/scene_writer.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/scene_file.h"
#include "tests/files/scene_texts.h"
#include "tests/support/random.h"
#include "tests/support/run.h"
#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

using test::write_text;

class MatrixFile : public testing::Test {
 protected:
  Eigen::MatrixXd read(const std::string& text, const std::string& name = "a.csv") {
    return read_matrix_file(write_text(directory_ / name, text));
  }
  std::string error(const std::string& text, const std::string& name = "a.csv") {
    return message_of([&] { read(text, name); }, (directory_ / "").string());
  }
  test::TemporaryDirectory directory_;
};

TEST_F(MatrixFile, ReadsRowsInCommonFormats) {
  const Eigen::MatrixXd A{{2.0, -1.0}, {-1.0, 3.5e-3}};
  for (const char* text :
       {"2.000000000000000000e+00 -1.000000000000000000e+00\n"
        "-1.000000000000000000e+00 3.500000000000000073e-03\n",  // numpy.savetxt
        "2,-1\n-1,0.0035\n",                                     // writematrix
        "\xEF\xBB\xBF"
        "2,-1\r\n-1,0.0035",
        "# M\n% of the rig\n\n  2;-1\n -1; +0.0035\n", "\t2\t-1\n\t-1\t.35e-2\n",
        "   2.0000000e+00  -1.0000000e+00\n  -1.0000000e+00   3.5000000e-03\n"}) {  // save -ascii
    EXPECT_EQ(read(text), A) << text;
  }
}

TEST_F(MatrixFile, ReadsAllRealMatrixMarketKinds) {
  const Eigen::MatrixXd A{{2.0, -1.0, 0.0}, {-1.0, 3.5, 0.25}, {0.0, 0.25, 1.0}};
  EXPECT_EQ(read("%%MatrixMarket matrix coordinate real symmetric\n%\n3 3 5\n"
                 "1 1 2.0\n2 1 -1.0\n2 2 3.5\n3 2 0.25\n3 3 1e0\n",
                 "k.mtx"),
            A);
  EXPECT_EQ(read("%%MatrixMarket matrix coordinate real general\n3 3 8\n1 1 1\n1 1 1\n2 1 -1\n"
                 "1 2 -1\n2 2 3.5\n3 2 .25\n2 3 .25\n3 3 1\n",
                 "k.mtx"),
            A);  // the duplicate entry 1 1 is added
  EXPECT_EQ(read("%%MatrixMarket matrix array real symmetric\n% by mmwrite\n3 3\n2\n-1\n0\n3.5\n"
                 "0.25\n1\n",
                 "k.mtx"),
            A);
  EXPECT_EQ(read("%%MatrixMarket Matrix Array Integer General\n2 3\n1\n4\n2\n5\n3\n6\n", "k.mtx"),
            (Eigen::MatrixXd{{1, 2, 3}, {4, 5, 6}}));
}

TEST_F(MatrixFile, ErrorsNamePosition) {
  const std::string market = "%%MatrixMarket matrix coordinate real ";
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"1,2\n3,x\n", ":2:3: 'x' is not a number; must be one, as 0.25 or 1e-3"},
           {"1,2\n3,\n", ":2:3: a field is empty; must be a number"},
           {"1,2\n3\n", ":2:1: the row has 1 numbers; must have 2, as the rows before"},
           {"1;0,5\n", ":1:3: '0,5' is not a number; must be one, as 0.25 or 1e-3 (decimal point)"},
           {"1 nan\n", ":1:3: 'nan' is not a finite double; must be one"},
           {"1 1e999\n", ":1:3: '1e999' is not a finite double; must be one"},
           {"1+0j,2\n", ":1:1: '1+0j' is not a number; must be one, as 0.25 or 1e-3"},
           {"# nothing\n", ": has no numbers"},
           {"\x93NUMPY\x01",
            ": is no text; must be CSV or Matrix Market (numpy.savetxt, "
            "scipy.io.mmwrite)"},
           {market + "hermitian\n1 1 1\n1 1 1\n",
            ":1:1: is a file of 'hermitian'; must be general or symmetric"},
           {"%%MatrixMarket matrix coordinate pattern general\n",
            ":1:1: is a file of 'pattern'; must be real or integer"},
           {market + "general\n2 2 2\n1 1 1\n",
            ": ends before row, column and value of entry 2 of 2"},
           {market + "general\n2 2 1\n1 3 1\n", ":3:3: '3'; must be a whole number in 1..2"},
           {market + "general\n2 2 1\n1 1 1\n2 2 2\n", ":4:1: has more entries than it says"},
           {market + "general\n900000 900000 1\n1 1 1\n",
            ":2:1: '900000'; must be a whole number in 1..5000"},
           {market + "symmetric\n2 2 1\n1 2 1\n",
            ":3:1: the entry lies above the diagonal; a symmetric file must have the lower half"},
           {market + "symmetric\n2 3 1\n1 1 1\n", ":2:1: is symmetric; must have as many columns"},
       }) {
    EXPECT_EQ(error(text), "a.csv" + message);
  }
  EXPECT_EQ(error("1 2\n", "a.mtx"),
            "a.mtx:1:1: a Matrix Market file must begin with %%MatrixMarket");
}

std::string with_files() {
  std::string text(system_text);
  text = replaced(text, "[[2.0, 0.5], [0.5, 1.0]]", "\"fe/M.mtx\"");
  text = replaced(text, "[[3, -1], [-1, 3.0]]", "\"fe/K.csv\"");
  text = replaced(text, "direction = [1.0, 2.0]", "direction = \"fe/f.csv\"");
  return replaced(text, "q = [0.1, 0.2]", "q = 'fe/q.csv'");
}

class SceneOfFiles : public MatrixFile {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(directory_ / "fe");
    write_text(directory_ / "fe/M.mtx",
               "%%MatrixMarket matrix array real symmetric\n2 2\n2\n0.5\n1\n");
    write_text(directory_ / "fe/K.csv", "3 -1\n-1 3\n");
    write_text(directory_ / "fe/f.csv", "1\n2\n");
    write_text(directory_ / "fe/q.csv", "0.1, 0.2\n");
  }
  Scene scene(const std::string& text) {
    return read_scene(write_text(directory_ / "x.toml", text));
  }
  std::string error_of_scene(const std::string& text) {
    return message_of([&] { scene(text); }, (directory_ / "").string());
  }
};

TEST_F(SceneOfFiles, EqualsSceneInOneFile) {
  const Scene of_files = scene(with_files());
  EXPECT_EQ(to_toml(of_files), to_toml(parse(system_text)));
  EXPECT_TRUE(of_files.remarks.empty());
}

TEST_F(SceneOfFiles, ErrorsNameFileLineAndKey) {
  write_text(directory_ / "fe/K.csv", "3 -1\n-1 x\n");
  EXPECT_EQ(error_of_scene(with_files()),
            "fe/K.csv:2:4: 'x' is not a number; must be one, as 0.25 or 1e-3 (system.K)");
  write_text(directory_ / "fe/K.csv", "3 -1\n-1.1 3\n");
  EXPECT_EQ(error_of_scene(with_files()),
            "x.toml:4:5: system.K[2][1] is -1.1 (fe/K.csv); must be -1, as system.K[1][2] "
            "(symmetric)");
  write_text(directory_ / "fe/K.csv", "3 -1\n");
  EXPECT_EQ(error_of_scene(with_files()),
            "x.toml:4:5: system.K is 1 x 2 (fe/K.csv); must be square");
  write_text(directory_ / "fe/K.csv", "3\n");
  EXPECT_EQ(error_of_scene(with_files()),
            "x.toml:4:5: system.K is 1 x 1; must be 2 x 2, as system.M");
  write_text(directory_ / "fe/K.csv", "3 -1\n-1 3\n");
  write_text(directory_ / "fe/f.csv", "1 2\n2 1\n");
  EXPECT_EQ(error_of_scene(with_files()),
            "x.toml:6:13: force[1].direction is 2 x 2 (fe/f.csv); must be one row or one column");
  std::filesystem::remove(directory_ / "fe/f.csv");
  EXPECT_EQ(error_of_scene(with_files()),
            "x.toml:6:13: force[1].direction names a file: fe/f.csv: No such file or directory");
}

TEST_F(SceneOfFiles, RoundingAsymmetryIsRepairedWithRemark) {
  write_text(directory_ / "fe/K.csv", "3 -1\n-1.0000000000000002 3\n");
  const Scene mended = scene(with_files());
  EXPECT_EQ(mended.model.K, mended.model.K.transpose());
  ASSERT_EQ(mended.remarks.size(), 1U);
  EXPECT_TRUE(mended.remarks[0].ends_with(
      "x.toml:4:5: system.K (fe/K.csv) is symmetric but for rounding (2.220446049250313e-16); the "
      "mean of it and its transpose is taken"))
      << mended.remarks[0];
}

TEST_F(SceneOfFiles, FileNamesStayValidInOtherFolder) {
  std::filesystem::create_directory(directory_ / "out");
  const std::string text =
      with_files_from(with_files(), directory_ / "", directory_ / "out", "out/x.toml");
  EXPECT_NE(text.find("\"../fe/M.mtx\""), std::string::npos) << text;
  EXPECT_EQ(to_toml(read_scene(write_text(directory_ / "out/x.toml", text))),
            to_toml(scene(with_files())));
  EXPECT_EQ(with_files_from(with_files(), directory_ / "", directory_ / "", "x.toml"),
            with_files());
  EXPECT_EQ(with_files_from("[excitation]\nfile = \"a.csv\"\n[[force]]\nfile = \"b.csv\"\n",
                            directory_ / "", directory_ / "out", "out/x.toml"),
            "[excitation]\nfile = \"../a.csv\"\n[[force]]\nfile = \"../b.csv\"\n");
}

// A random structure on a shaken base, and the same with every force and motion written explicitly.
TEST(ShakenFrame, EqualsMachineWithExplicitForces) {
  Random random(20261123);
  std::size_t events = 0;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Index f = 3;
    Scene scene;
    const Eigen::MatrixXd A = random.matrix(f, f), B = random.matrix(f, f);
    scene.name = "x";
    scene.model.M = product(A, A.transpose()) + Eigen::MatrixXd::Identity(f, f);
    scene.model.K = 50.0 * (product(B, B.transpose()) + Eigen::MatrixXd::Identity(f, f));
    scene.model.C = 0.01 * scene.model.K;
    const Eigen::VectorXd r = random.vector(f), w = random.vector(f), v = random.vector(f);
    const double e = 0.05, Omega = random.uniform(3.0, 12.0), phase = random.uniform(-3.0, 3.0);
    scene.model.forces = {{r, -1.0, {}},
                          {-scene.model.M * r, 0.0, {-e * Omega * Omega, Omega, phase}}};
    scene.model.contacts = {{w, 0.02, {w.dot(r) * e, Omega, phase}, 0.6}, {v, 0.03, {}, 0.6}};
    scene.truth.start = scene.prior.start = {Eigen::VectorXd::Zero(f), Eigen::VectorXd::Zero(f)};
    scene.truth.release_penetration = true;
    Scene shaken = scene;
    shaken.frame = ShakenFrame{r, {e, Omega, phase}, 1, {0}};
    const std::string text = to_toml(shaken);
    ASSERT_NE(text.find("influence"), std::string::npos);
    ASSERT_EQ(text.find("motion"), std::string::npos);
    const Scene read = parse_scene(text, "x.toml");
    const auto wanted = test::events_of(scene, 10.0), got = test::events_of(read, 10.0);
    ASSERT_EQ(got.size(), wanted.size()) << i;
    events += got.size();
    for (std::size_t k = 0; k < got.size(); ++k) EXPECT_NEAR(got[k].t, wanted[k].t, 1e-9) << i;
    EXPECT_EQ(to_toml(read), text);
  }
  EXPECT_GT(events, 400U);
}

TEST(ShakenFrame, ContactsStandOnTheGroundOrOnTheFrame) {
  const std::string text = replaced(
      replaced(std::string(system_text), "[impact]",
               "[excitation]\ninfluence = 1.0\namplitude = 0.1\nfrequency = 3.0\n[impact]"),
      "motion = { amplitude = 0.01, frequency = 4.0, phase = 0.5 }\n", "");
  const Scene ground = parse(text);
  EXPECT_EQ(ground.model.contacts[0].motion.amplitude, 0.1);
  EXPECT_DOUBLE_EQ(ground.model.forces[1].harmonic.amplitude, -0.9);
  EXPECT_EQ(ground.model.forces[1].direction, (Eigen::VectorXd{{-2.5, -1.5}}));
  const Scene frame = parse(replaced(text, "clearance = 0.1", "mount = \"frame\""));
  EXPECT_EQ(frame.model.contacts[0].motion.amplitude, 0.0);
  EXPECT_EQ(to_toml(parse(to_toml(frame))), to_toml(frame));
  EXPECT_EQ(error_of(replaced(text, "influence = 1.0\n", "")),
            "x.toml:10:1: missing key excitation.influence");
  EXPECT_EQ(error_of(replaced(text, "influence = 1.0", "influence = [1, 1, 1]")),
            "x.toml:11:13: excitation.influence has 3 numbers; must be one or 2");
  EXPECT_EQ(
      error_of(replaced(text, "clearance = 0.1",
                        "mount = \"frame\"\nmotion = { amplitude = 0.1, frequency = 1 }")),
      "x.toml:18:9: contact[1].mount and contact[1].motion exclude each other; must be one of "
      "them (motion is all of s_i(t))");
  EXPECT_EQ(
      error_of(replaced(system_text, "clearance = 0.1", "mount = \"frame\"")),
      "x.toml:14:9: contact[1].mount and contact[1].motion exclude each other; must be one of "
      "them (motion is all of s_i(t))");
}

TEST(Damping, RayleighAndRatiosEqualExplicitC) {
  const std::string C = "C = [[0.1, 0.0], [0.0, 0.2]]";
  const Scene rayleigh = parse(replaced(system_text, C, "rayleigh = { alpha = 0.1, beta = 0.02 }"));
  const Eigen::MatrixXd wanted{{0.1 * 2.0 + 0.02 * 3.0, 0.1 * 0.5 - 0.02},
                               {0.1 * 0.5 - 0.02, 0.1 + 0.02 * 3.0}};
  EXPECT_LT((rayleigh.model.C - wanted).norm(), 1e-15);
  // 2 zeta omega of each mode, by Cayley and Hamilton: C M^-1 C = 4 zeta^2 K.
  const Scene ratio = parse(replaced(system_text, C, "damping_ratio = 0.05"));
  const Eigen::MatrixXd& D = ratio.model.C;
  const Eigen::MatrixXd M_inverse = Eigen::Matrix2d{{1.0, -0.5}, {-0.5, 2.0}} / 1.75;
  EXPECT_LT((D * M_inverse * D - 0.01 * ratio.model.K).norm(), 1e-14);
  EXPECT_EQ(error_of(replaced(system_text, C, C + "\nrayleigh = { alpha = 0, beta = 0 }")),
            "x.toml:4:12: system.rayleigh and system.C exclude each other; must be one of them");
  EXPECT_EQ(error_of(replaced(system_text, C, "rayleigh = { alpha = -1, beta = 0 }")),
            "x.toml:3:22: system.rayleigh.alpha is -1; must be >= 0");
  EXPECT_EQ(parse(replaced(system_text, C, "modal_damping = 0.05")).model.C, D);
  EXPECT_EQ(
      error_of(replaced(system_text, C, "modal_damping = 0.05\ndamping_ratio = 0.05")),
      "x.toml:3:17: system.modal_damping and system.damping_ratio exclude each other; must be one "
      "of them");
  EXPECT_EQ(error_of(replaced(system_text, C, "modal_damping = -0.05")),
            "x.toml:3:17: system.modal_damping has -0.05; must be >= 0");
  EXPECT_EQ(error_of(replaced(system_text, C, "modal_damp = 0.05")),
            "x.toml:3:1: unknown key system.modal_damp; did you mean modal_damping?");
}

}  // namespace
}  // namespace sprag
