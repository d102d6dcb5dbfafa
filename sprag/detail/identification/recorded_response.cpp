#include "sprag/detail/identification/recorded_response.h"

#include <algorithm>
#include <cmath>
#include <unsupported/Eigen/MatrixFunctions>

#include "sprag/detail/parameters/unknowns.h"

namespace sprag {
namespace {

// a and its derivatives, up to the third, drive the oscillators.
constexpr Eigen::Index chain = 4;

// Transition over tau from (y, y', a, a', a'', a''') to (y, y').
Eigen::MatrixXd chained_step(const Eigen::MatrixXd& C, const Eigen::MatrixXd& K,
                             const Eigen::VectorXd& force, double tau) {
  const Eigen::Index n = K.rows();
  Eigen::MatrixXd generator = Eigen::MatrixXd::Zero(2 * n + chain, 2 * n + chain);
  generator.block(0, n, n, n).setIdentity();
  generator.block(n, 0, n, n) = -K;
  generator.block(n, n, n, n) = -C;
  generator.block(n, 2 * n, n, 1) = force;
  for (Eigen::Index j = 0; j + 1 < chain; ++j) generator(2 * n + j, 2 * n + j + 1) = 1.0;
  generator *= tau;
  return generator.exp().topRows(2 * n);
}

Eigen::Vector4d chain_of(const InputDerivatives& d) { return {d[2], d[3], d[4], d[5]}; }

}  // namespace

RecordedResponse::RecordedResponse(const SampledInput& input, bool modal, const Eigen::MatrixXd& C,
                                   const Eigen::MatrixXd& K, const Eigen::VectorXd& force,
                                   double before)
    : modal_(modal), mean_frequency_(sprag::mean_frequency(input)), C_(C), K_(K), force_(force) {
  const std::size_t knots = input.knots().size();
  knots_.reserve(knots + 1);
  pieces_.reserve(knots + 1);
  // Before the first sample: a is constant, or the displacement goes on with constant velocity.
  InputDerivatives first = input.at_knot(0);
  const double a = input.settings().displacement ? 0.0 : first[2];
  first = {first[0] - first[1] * before + 0.5 * a * before * before,
           first[1] - a * before,
           a,
           0.0,
           0.0,
           0.0};
  knots_.push_back(input.knots().front() - before);
  pieces_.push_back(first);
  for (std::size_t k = 0; k < knots; ++k) {
    knots_.push_back(input.knots()[k]);
    pieces_.push_back(input.at_knot(k));
  }
  rows_.setZero(2 * force.size(), static_cast<Eigen::Index>(knots_.size()));
  if (modal_) {
    tabulate_modes();
  } else {
    tabulate_coupled();
  }
}

PolynomialForce RecordedResponse::force(Eigen::Index i, std::size_t k) const {
  PolynomialForce F{};
  for (std::size_t order = 0; order < chain; ++order) {
    F[order] = force_[i] * pieces_[k][order + 2];
  }
  return F;
}

// In extended precision, so that the roundings of many steps do not add up.
void RecordedResponse::tabulate_modes() {
  const Eigen::Index n = force_.size();
  std::vector<PolynomialStep> steps(static_cast<std::size_t>(n));
  double of_steps = -1.0;
  std::vector<long double> y(static_cast<std::size_t>(n), 0.0L), u = y;
  for (std::size_t k = 0; k + 1 < knots_.size(); ++k) {
    const double h = knots_[k + 1] - knots_[k];
    // Spacings of an even record differ by rounding; the difference moves y by rounding too.
    constexpr double rounding = 1e-13;
    const bool same = std::abs(h - of_steps) <= rounding * std::abs(knots_[k + 1]);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto j = static_cast<std::size_t>(i);
      if (!same) steps[j] = polynomial_step(0.5 * C_(i, 0), K_(i, 0), h);
      steps[j].apply(force(i, k), y[j], u[j]);
      rows_(i, static_cast<Eigen::Index>(k) + 1) = static_cast<double>(y[j]);
      rows_(n + i, static_cast<Eigen::Index>(k) + 1) = static_cast<double>(u[j]);
    }
    if (!same) of_steps = h;
  }
}

void RecordedResponse::tabulate_coupled() {
  const Eigen::Index n = force_.size();
  Eigen::MatrixXd step;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(2 * n + chain);
  double of_step = -1.0;
  for (std::size_t k = 0; k + 1 < knots_.size(); ++k) {
    const double h = knots_[k + 1] - knots_[k];
    constexpr double rounding = 1e-13;
    if (!(std::abs(h - of_step) <= rounding * std::abs(knots_[k + 1]))) {
      step = chained_step(C_, K_, force_, h);
      of_step = h;
    }
    x.tail(chain) = chain_of(pieces_[k]);
    const Eigen::VectorXd next = step * x;
    x.head(2 * n) = next;
    rows_.col(static_cast<Eigen::Index>(k) + 1) = next;
  }
}

std::size_t RecordedResponse::interval(double t) const {
  const auto after = std::upper_bound(knots_.begin(), knots_.end(), t);
  return after == knots_.begin() ? 0 : static_cast<std::size_t>(after - knots_.begin()) - 1;
}

void RecordedResponse::move(std::size_t k, double tau, RecordedMotion& motion) const {
  const Eigen::Index n = force_.size();
  const auto row = rows_.col(static_cast<Eigen::Index>(k));
  motion.y = row.head(n);
  motion.u = row.tail(n);
  if (tau == 0.0) return;
  if (!modal_) {
    Eigen::VectorXd x(2 * n + chain);
    x << row, chain_of(pieces_[k]);
    const Eigen::VectorXd next = chained_step(C_, K_, force_, tau) * x;
    motion.y = next.head(n);
    motion.u = next.tail(n);
    return;
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    move_under_force(0.5 * C_(i, 0), K_(i, 0), force(i, k), tau, motion.y[i], motion.u[i]);
  }
}

void RecordedResponse::at(double t, RecordedMotion& motion) const {
  const std::size_t k = interval(t);
  const double tau = t - knots_[k];
  move(k, tau, motion);
  motion.input = moved_by(pieces_[k], tau);
  if (modal_) {
    motion.rate = force_ * motion.input[2] - C_.col(0).cwiseProduct(motion.u) -
                  K_.col(0).cwiseProduct(motion.y);
  } else {
    motion.rate = force_ * motion.input[2] - C_ * motion.u - K_ * motion.y;
  }
}

}  // namespace sprag
