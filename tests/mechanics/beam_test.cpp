// Would catch wrong wavenumbers, shapes, means or units of the beam's modes.
#include "sprag/beam.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>

namespace sprag {
namespace {

// Values by mpmath with 700 digits: roots of cos(x) + 1/cosh(x), and (19) exactly as printed.
struct ModeValue {
  int i;
  long double wavenumber, mean;
};
constexpr ModeValue mode_values[] = {
    {1, 1.875104068711961166445L, -0.782991756039625736501L},
    {2, 4.694091132974174576436L, -0.4339358951107192720871L},
    {3, 7.854757438237612564861L, -0.2544252968661057114465L},
    {10, 29.84513020910281726379L, -0.06701260761765527435023L},
    {50, 155.5088363526947653039L, -0.01286100550237538066819L},
    {100, 312.588469032184427227L, -0.006398188667010867769603L},
    {200, 626.7477343911637510733L, -0.003191076553220959113161L},
};

struct ShapeValue {
  int i;
  double xi;  // exact as a double
  long double v;
};
constexpr ShapeValue shape_values[] = {
    {1, 0.0009765625, -0.000003351630981555680086265L},
    {1, 0.1, -0.03354699961660878504469L},
    {1, 0.5, -0.6790462257306478342218L},
    {1, 0.868, -1.636903950429081191208L},
    {1, 1.0, -2.0L},
    {3, 0.0009765625, -0.00005868872064113397813775L},
    {3, 0.1, -0.4561378032941754519363L},
    {3, 0.5, -0.03937518964388545916393L},
    {3, 0.868, -0.004360363305567232415006L},
    {3, 1.0, -2.0L},
    {50, 0.0009765625, -0.02189527200334196003151L},
    {50, 0.1, -1.144122981969769527354L},
    {50, 0.5, -1.414213562373095048802L},
    {50, 0.868, -1.100911943455611786206L},
    {50, 1.0, 2.0L},
    {200, 0.0009765625, -0.2983198470040621353009L},
    {200, 0.1, 1.144122805635365703144L},
    {200, 0.5, 1.414213562373095048802L},
    {200, 0.868, -0.3688855958250045391836L},
    {200, 1.0, 2.0L},
};

constexpr double few_roundings = 1e-15;

double relative_error(double computed, long double truth) {
  return static_cast<double>(std::abs((computed - truth) / truth));
}

TEST(Beam, WavenumbersAreAccurateRoots) {
  for (const ModeValue& expected : mode_values) {
    EXPECT_LT(relative_error(wavenumber(expected.i), expected.wavenumber), few_roundings)
        << "i = " << expected.i;
  }
  EXPECT_DOUBLE_EQ(wavenumber(1), 1.8751040687119611664453082410782141625701);
}

TEST(Beam, WavenumbersSatisfyTheFrequencyEquationOncePerHalfTurn) {
  for (int i = 1; i <= 200; ++i) {
    const long double x = wavenumber(i);
    EXPECT_EQ(static_cast<int>(std::floor(x / std::numbers::pi_v<long double>)), i - 1);
    const long double residual = std::cos(x) + 1 / std::cosh(x);
    EXPECT_LT(static_cast<double>(std::abs(residual)), few_roundings * static_cast<double>(x))
        << "i = " << i;
  }
}

TEST(Beam, ModeShapesHaveSmallRelativeErrors) {
  for (const ShapeValue& expected : shape_values) {
    EXPECT_LT(relative_error(mode_shape(expected.i, expected.xi), expected.v), 1e-14)
        << "i = " << expected.i << ", xi = " << expected.xi;
  }
}

TEST(Beam, MeansMatchReference) {
  for (const ModeValue& expected : mode_values) {
    EXPECT_LT(relative_error(mode_mean(expected.i), expected.mean), few_roundings)
        << "i = " << expected.i;
  }
}

TEST(Beam, TipHasThePrintedSignAndClampDoesNotMove) {
  for (int i = 1; i <= 200; ++i) {
    EXPECT_DOUBLE_EQ(mode_shape(i, 1.0), i % 2 == 1 ? -2.0 : 2.0) << "i = " << i;
    EXPECT_EQ(mode_shape(i, 0.0), 0.0);
    // v = -(beta x)^2 to leading order.
    const double y = 1e-9;
    EXPECT_NEAR(mode_shape(i, y / wavenumber(i)) / (y * y), -1.0, 1e-8) << "i = " << i;
  }
}

TEST(Beam, ShapesAreSmoothWhereSeriesAndClosedFormMeet) {
  for (const int i : {1, 2, 3, 20, 200}) {
    const double xi = 1 / wavenumber(i);
    const double below = mode_shape(i, xi * (1 - 1e-15));
    const double above = mode_shape(i, xi * (1 + 1e-15));
    EXPECT_NEAR(below, above, 1e-14 * std::abs(above)) << "i = " << i;
  }
}

TEST(Beam, ThousandsOfModesDoNotOverflow) {
  for (const int i : {1000, 4000, 20000}) {
    EXPECT_DOUBLE_EQ(wavenumber(i), (i - 0.5) * std::numbers::pi);
    for (const double xi : {0.0, 1e-6, 0.25, 0.5, 0.868, 0.999, 1.0}) {
      EXPECT_LE(std::abs(mode_shape(i, xi)), 2.0) << "i = " << i << ", xi = " << xi;
    }
    EXPECT_DOUBLE_EQ(mode_shape(i, 1.0), 2.0);
    EXPECT_DOUBLE_EQ(mode_mean(i), -2 / wavenumber(i));
  }
}

// Simpson's rule on a grid far finer than the modes.
template <typename Integrand>
double integral(const Integrand& integrand) {
  constexpr int panels = 2000;
  double sum = integrand(0.0) + integrand(1.0);
  for (int k = 1; k < panels; ++k) {
    sum += (k % 2 == 1 ? 4 : 2) * integrand(static_cast<double>(k) / panels);
  }
  return sum / (3 * panels);
}

TEST(Beam, LowModesAreOrthonormal) {
  for (int i = 1; i <= 5; ++i) {
    for (int j = 1; j <= i; ++j) {
      const double product =
          integral([&](double xi) { return mode_shape(i, xi) * mode_shape(j, xi); });
      EXPECT_NEAR(product, i == j ? 1.0 : 0.0, 1e-9) << "i = " << i << ", j = " << j;
    }
  }
}

TEST(Beam, DampingRatiosMatchModes) {
  Beam beam{.modes = 3, .length = 2.0, .bending_stiffness = 3.0, .mass_per_length = 5.0};
  beam.damping_ratio = Eigen::Vector3d(0.01, 0.0, 0.2);
  for (int i = 0; i < 3; ++i) {
    const double omega = std::sqrt(stiffness(beam)[i] / mass(beam)[i]);
    EXPECT_NEAR(damping(beam)[i] / (2.0 * mass(beam)[i] * omega), beam.damping_ratio[i], 1e-15);
  }
}

TEST(Beam, MatricesHaveUnitsOfEq22) {
  const Beam beam{
      .modes = 4, .length = 2.0, .bending_stiffness = 3.0, .mass_per_length = 5.0, .damping = 0.7};
  ASSERT_EQ(mass(beam).size(), 4);
  ASSERT_EQ(damping(beam).size(), 4);
  ASSERT_EQ(stiffness(beam).size(), 4);
  ASSERT_EQ(inertia_direction(beam).size(), 4);
  for (int i = 1; i <= 4; ++i) {
    EXPECT_DOUBLE_EQ(mass(beam)(i - 1), 10.0);
    EXPECT_DOUBLE_EQ(damping(beam)(i - 1), 1.4);
    EXPECT_DOUBLE_EQ(stiffness(beam)(i - 1), 3.0 / 8.0 * std::pow(wavenumber(i), 4));
    const double x = wavenumber(i);
    const double sigma = (std::cos(x) + std::cosh(x)) / (std::sin(x) + std::sinh(x));
    EXPECT_NEAR(inertia_direction(beam)(i - 1), 2 * 10.0 / x * sigma, 1e-14);
  }
}

TEST(Beam, ShapesAtAPointDependOnItsShareOfTheLength) {
  const Beam beam{.modes = 200, .length = 3.0};
  const Eigen::VectorXd v = mode_shapes(beam, 0.75);
  ASSERT_EQ(v.size(), 200);
  for (int i = 1; i <= 200; ++i) EXPECT_DOUBLE_EQ(v(i - 1), mode_shape(i, 0.25)) << "i = " << i;
}

}  // namespace
}  // namespace sprag
