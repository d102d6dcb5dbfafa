#include "sprag/beam.h"

#include <array>
#include <cmath>
#include <iterator>
#include <numbers>

namespace sprag {
namespace {

constexpr long double pi = std::numbers::pi_v<long double>;

// beta_i l = (i - 1/2) pi + offset. The offset falls like 2 exp(-beta_i l). Stored separately, it
// keeps sin(beta_i l) = sign cos(offset) and cos(beta_i l) = -sign sin(offset) free of large
// arguments.
struct Root {
  int i;
  long double offset;
  long double sign;    // of sin(beta_i l)
  long double decay;   // exp(-beta_i l)
  long double excess;  // (1 - sigma_i) / decay: avoids exp(beta_i x) alone, which overflows

  long double wavenumber() const { return (i - 0.5L) * pi + offset; }
  long double sigma() const { return 1 - excess * decay; }
};

// cos(x) cosh(x) = -1 at x = (i - 1/2) pi + e becomes sin(e) = sign / cosh(x), which is nearly
// linear.
Root solve_root(int i) {
  Root r{i, 0, i % 2 == 1 ? 1.0L : -1.0L, 0, 0};
  constexpr int newton_steps = 8;  // i = 1 needs 5
  for (int k = 0; k < newton_steps; ++k) {
    r.decay = std::exp(-r.wavenumber());
    const long double sech = 2 * r.decay / (1 + r.decay * r.decay);
    const long double slope =
        std::cos(r.offset) + r.sign * sech * (1 - r.decay * r.decay) / (1 + r.decay * r.decay);
    r.offset -= (std::sin(r.offset) - r.sign * sech) / slope;
  }
  r.decay = std::exp(-r.wavenumber());
  const long double sine = r.sign * std::cos(r.offset);
  const long double cosine = -r.sign * std::sin(r.offset);
  r.excess = 2 * (sine - cosine - r.decay) / (1 - r.decay * r.decay + 2 * sine * r.decay);
  return r;
}

// The first roots are solved once: an identification of a position needs them thousands of times.
Root root(int i) {
  static const std::array<Root, 64> first = [] {
    std::array<Root, 64> roots;
    for (int k = 1; k <= std::ssize(roots); ++k) {
      roots[static_cast<std::size_t>(k - 1)] = solve_root(k);
    }
    return roots;
  }();
  return i <= std::ssize(first) ? first[static_cast<std::size_t>(i - 1)] : solve_root(i);
}

// v_i near the clamp, where cos and cosh cancel: -2 (y^2/2! + y^6/6! + ...) + 2 sigma (y^3/3! +
// ...).
long double series(long double y, long double sigma) {
  long double even = y * y;
  long double odd = even * y / 3;
  long double sum = 0;
  for (int k = 2; k < 26; k += 4) {
    sum += sigma * odd - even;
    even *= y * y * y * y / ((k + 1.0L) * (k + 2.0L) * (k + 3.0L) * (k + 4.0L));
    odd *= y * y * y * y / ((k + 2.0L) * (k + 3.0L) * (k + 4.0L) * (k + 5.0L));
  }
  return sum;
}

long double shape(const Root& r, long double xi) {
  const long double y = r.wavenumber() * xi;
  const long double sigma = r.sigma();
  if (y < 1) return series(y, sigma);
  // Removes whole turns while the argument is exact, so that its error does not grow with i.
  const long double angle = std::fmod((r.i - 0.5L) * xi, 2.0L) * pi + r.offset * xi;
  const long double growing = r.excess * std::exp(r.wavenumber() * (xi - 1)) / 2;
  const long double falling = (1 + sigma) * std::exp(-y) / 2;
  return std::cos(angle) - sigma * std::sin(angle) - growing - falling;
}

}  // namespace

double wavenumber(int i) { return static_cast<double>(root(i).wavenumber()); }

double mode_shape(int i, double xi) { return static_cast<double>(shape(root(i), xi)); }

double mode_mean(int i) {
  const Root r = root(i);
  return static_cast<double>(-2 * r.sigma() / r.wavenumber());
}

Eigen::VectorXd mode_shapes(const Beam& beam, double x_c) {
  Eigen::VectorXd v(beam.modes);
  const long double xi = static_cast<long double>(x_c) / beam.length;
  for (int i = 1; i <= beam.modes; ++i) v(i - 1) = static_cast<double>(shape(root(i), xi));
  return v;
}

Eigen::VectorXd mass(const Beam& beam) {
  return Eigen::VectorXd::Constant(beam.modes, beam.mass_per_length * beam.length);
}

Eigen::VectorXd damping(const Beam& beam) {
  if (beam.damping_ratio.size() == 0) {
    return Eigen::VectorXd::Constant(beam.modes, beam.damping * beam.length);
  }
  return 2.0 *
         beam.damping_ratio.cwiseProduct(mass(beam).cwiseProduct(stiffness(beam)).cwiseSqrt());
}

Eigen::VectorXd stiffness(const Beam& beam) {
  Eigen::VectorXd k(beam.modes);
  const long double l = beam.length;
  for (int i = 1; i <= beam.modes; ++i) {
    const long double beta_l = root(i).wavenumber();
    k(i - 1) = static_cast<double>(beam.bending_stiffness / (l * l * l) * std::pow(beta_l, 4));
  }
  return k;
}

Eigen::VectorXd inertia_direction(const Beam& beam) {
  Eigen::VectorXd direction(beam.modes);
  for (int i = 1; i <= beam.modes; ++i) {
    direction(i - 1) = -beam.mass_per_length * beam.length * mode_mean(i);
  }
  return direction;
}

Model beam_model(const Beam& beam, const Harmonic& excitation) {
  Model model;
  model.M = mass(beam).asDiagonal();
  model.C = damping(beam).asDiagonal();
  model.K = stiffness(beam).asDiagonal();
  if (excitation.amplitude != 0.0) {
    model.forces.push_back({inertia_direction(beam), 0.0, second_derivative(excitation)});
  }
  return model;
}

Contact beam_contact(const Beam& beam, double x_c, Side side, double clearance, double restitution,
                     const Harmonic& motion) {
  const double sign = side == Side::below ? 1.0 : -1.0;
  Contact contact{sign * mode_shapes(beam, x_c), clearance, motion, restitution};
  contact.motion.amplitude *= sign;
  return contact;
}

}  // namespace sprag
