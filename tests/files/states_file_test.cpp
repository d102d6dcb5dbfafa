// Would catch a states file that does not round-trip bit for bit, and damage that is not reported
// at its line.
#include "sprag/detail/files/states_file.h"

#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <random>

#include "tests/support/temporary_directory.h"

namespace sprag {
namespace {

using test::TemporaryDirectory;
using test::write_text;

TEST(StatesFileTest, WritesDocumentedFormat) {
  const TemporaryDirectory directory;
  const auto file = directory / "states.csv";
  StatesWriter writer(file, 2);
  writer.write(0, 0.0, Eigen::Vector2d(-0.05, 0.0), Eigen::Vector2d(1.0, 1e-9));
  writer.write(1, 0.001, Eigen::Vector2d(1.0 / 3.0, 2.0), Eigen::Vector2d(0.0, -3.0));
  EXPECT_TRUE(writer.close());
  EXPECT_EQ(test::read_text(file),
            "k,t,q1,q2,u1,u2\n0,0,-0.050000000000000003,0,1,1.0000000000000001e-09\n"
            "1,0.001,0.33333333333333331,2,0,-3\n");
}

TEST(StatesFileTest, RandomStatesRoundTripBitForBit) {
  const unsigned seed = 4711;
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  const auto any_double = [&random] {
    double value = std::numeric_limits<double>::quiet_NaN();
    while (!std::isfinite(value)) value = std::bit_cast<double>(random());
    return value;
  };
  const TemporaryDirectory directory;
  for (const int f : {1, 3, 200}) {
    const auto file = directory / "states.csv";
    std::vector<StateRow> rows;
    StatesWriter writer(file, f);
    for (int k = 0; k < 300; ++k) {
      rows.push_back({k, 0.01 * k, Eigen::VectorXd::NullaryExpr(f, any_double),
                      Eigen::VectorXd::NullaryExpr(f, any_double)});
      writer.write(k, rows.back().t, rows.back().q, rows.back().u);
    }
    ASSERT_TRUE(writer.close());
    StatesReader reader(file);
    EXPECT_EQ(reader.coordinates(), f);
    StateRow row;
    for (const StateRow& expected : rows) {
      ASSERT_TRUE(reader.next(row));
      EXPECT_EQ(row.k, expected.k);
      EXPECT_EQ(row.t, expected.t);
      EXPECT_EQ(row.q, expected.q);
      EXPECT_EQ(row.u, expected.u);
    }
    EXPECT_FALSE(reader.next(row));
    EXPECT_FALSE(reader.damage());
  }
}

TEST(StatesFileTest, AdditionalColumnsAreWrittenAndSkippedByReaders) {
  const TemporaryDirectory directory;
  const auto file = directory / "states.csv";
  StatesWriter writer(file, 1, {"B", "sigma_q1"});
  const Eigen::VectorXd q = Eigen::VectorXd::Constant(1, 2.0);
  const std::vector<double> more{std::numeric_limits<double>::infinity(), 0.25};
  writer.write(0, 0.0, q, q, more);
  EXPECT_TRUE(writer.close());
  EXPECT_EQ(test::read_text(file), "k,t,q1,u1,B,sigma_q1\n0,0,2,2,inf,0.25\n");
  StatesReader reader(file);
  EXPECT_EQ(reader.coordinates(), 1);
  StateRow row;
  EXPECT_TRUE(reader.next(row));
  EXPECT_EQ(row.q, q);
  EXPECT_FALSE(reader.next(row));
  EXPECT_FALSE(reader.damage());
  // A row with a missing field is an incomplete last row.
  StatesReader cut(write_text(file, "k,t,q1,u1,B,sigma_q1\n0,0,2,2,inf\n"));
  EXPECT_FALSE(cut.next(row));
  EXPECT_TRUE(cut.damage());
}

TEST(StatesFileTest, DamageEndsReadingAndNamesTheLine) {
  const TemporaryDirectory directory;
  for (const char* bad : {"1,0.1,2\n", "1,0.1,2,3,4\n", "x,0.1,2,3\n", "1,0.1,nan,3\n",
                          "1,0.1,2,inf\n", "1,0,2,3\n", "1,-1,2,3\n", "\n", "1,0.1,2,3"}) {
    SCOPED_TRACE(bad);
    StatesReader reader(
        write_text(directory / "states.csv", "k,t,q1,u1\n0,0,1,1\n" + std::string(bad)));
    StateRow row;
    EXPECT_TRUE(reader.next(row));
    EXPECT_FALSE(reader.next(row));
    ASSERT_TRUE(reader.damage());
    EXPECT_EQ(reader.damage()->line, 3U);
    EXPECT_FALSE(reader.next(row));
  }
}

TEST(StatesFileTest, OtherFilesAreInputErrors) {
  const TemporaryDirectory directory;
  EXPECT_THROW(StatesReader(directory / "absent.csv"), InputError);
  for (const char* text : {"", "k,t\n", "k,t,q1\n", "k,t,q1,u2\n", "t,k,q1,u1\n", "k,t,q1,u1"})
    EXPECT_THROW(StatesReader(write_text(directory / "states.csv", text)), InputError) << text;
}

TEST(StatesFileTest, OverlongLineIsDamage) {
  const TemporaryDirectory directory;
  StatesReader reader(
      write_text(directory / "states.csv", "k,t,q1,u1\n" + std::string(3U << 20U, '1') + "\n"));
  StateRow row;
  EXPECT_FALSE(reader.next(row));
  ASSERT_TRUE(reader.damage());
  EXPECT_EQ(reader.damage()->what, "line longer than 1 MiB");
}

TEST(StatesWriterTest, KeepsErrorOfFullDisk) {
  StatesWriter writer("/dev/full", 1);
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(1);
  for (int k = 0; k < 100000; ++k) writer.write(k, k, one, one);
  EXPECT_FALSE(writer.good());
  EXPECT_FALSE(writer.close());
  EXPECT_FALSE(StatesWriter("/nowhere/states.csv", 1).good());
}

}  // namespace
}  // namespace sprag
