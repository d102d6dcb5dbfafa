// Time stepping with exact modal flight, as in the simulation of strings against obstacles. In a
// mode with poles s_1, s_2 the positions at three ticks obey, without error,
//
//   (q_(k+1) - q_k) - B (q_k - q_(k-1)) + D q_k = r_k,
//   B = e^((s_1 + s_2) h),   D = (1 - e^(s_1 h)) (1 - e^(s_2 h)),
//
// r_k from the excitation. Kept as v_(k+1/2) = (q_(k+1) - q_k) / h. A contact acts at tick k,
//
//   v_(k+1/2) += (1 + B) / 2 M^-1 W P,
//
// where g_k + h gamma_(k-1/2) / 2 <= 0, with the impact law of fixed_step.h between gamma_(k-1/2)
// and gamma_(k+1/2) = (g_(k+1) - g_k) / h. First order in h across impacts. Sources: S. Bilbao,
// A. Torin & V. Chatziioannou, Acta Acust. united Ac. 101 (2015); C. Issanchou et al., J. Sound
// Vib. 393 (2017); MoreauJeanBilbaoOSI of Siconos.
#include <cmath>
#include <complex>
#include <exception>

#include "sprag/detail/mechanics/oscillators.h"
#include "studies/work_precision/machine.h"
#include "studies/work_precision/methods/fixed_step.h"
#include "studies/work_precision/methods/methods.h"

namespace sprag::work_precision {
namespace {

using Complex = std::complex<double>;

Complex harmonic(const Excitation& excitation, Eigen::Index j) {
  return {0.0, excitation.frequency(static_cast<std::size_t>(j))};
}

// The recursion of all modes, divided by h: v_(k+1/2) = B v_(k-1/2) - D q_k + drive.
struct Recursion {
  Eigen::ArrayXd B, D;
  Drive drive;
};

// The velocity at a tick, u_k = after v_(k+1/2) + before v_(k-1/2) + position q_k + drive: exact
// for modes that the step resolves, the central difference of the positions for others.
struct Velocity {
  Eigen::ArrayXd after, before, position;
  Drive drive;
};

// 1 - e^(s h) for the poles s = -delta +- sqrt(delta^2 - kappa), multiplied.
double stiffness(double delta, double kappa, double h) {
  const double square = kappa - delta * delta;
  if (square > 0.0) {
    const double fall = std::expm1(-delta * h);
    const double sine = std::sin(0.5 * std::sqrt(square) * h);
    return fall * fall + 4.0 * std::exp(-delta * h) * sine * sine;
  }
  const double fast = delta + std::sqrt(-square);
  const double slow = fast == 0.0 ? 0.0 : kappa / fast;
  return std::expm1(-fast * h) * std::expm1(-slow * h);
}

Recursion recursion(const Excitation& excitation, const Eigen::ArrayXd& m,
                    const Eigen::ArrayXd& delta, const Eigen::ArrayXd& kappa, double h) {
  const Eigen::Index f = m.size();
  Recursion result;
  result.B = (-2.0 * h * delta).exp();
  result.D.resize(f);
  Eigen::VectorXd constant(f);
  Eigen::MatrixXcd A(f, excitation.force().cols());
  for (Eigen::Index i = 0; i < f; ++i) {
    const double D = stiffness(delta[i], kappa[i], h);
    const double loss = -std::expm1(-2.0 * delta[i] * h);
    result.D[i] = D / h;
    // alpha makes r = D / kappa, which has a limit where kappa = 0.
    const double compliance = kappa[i] != 0.0   ? D / kappa[i]
                              : delta[i] != 0.0 ? 0.5 * h * loss / delta[i]
                                                : h * h;
    constant[i] = compliance * excitation.constant()[i] / m[i] / h;
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      const Complex s = harmonic(excitation, j);
      const Complex alpha = excitation.force()(i, j) / m[i];
      const Complex impedance = kappa[i] + s * (2.0 * delta[i] + s);
      if (alpha != 0.0 && impedance == 0.0) throw ModelError("undamped resonance");
      const double sine = std::sin(0.5 * s.imag() * h);
      const Complex back(-2.0 * sine * sine, -std::sin(s.imag() * h));  // e^(-s h) - 1
      A(i, j) = alpha == 0.0 ? 0.0 : alpha / impedance * (D - 4.0 * sine * sine - loss * back) / h;
    }
  }
  result.drive = Drive(constant, A);
  return result;
}

Velocity velocity(const Excitation& excitation, const Eigen::ArrayXd& m,
                  const Eigen::ArrayXd& delta, const Eigen::ArrayXd& kappa, double h) {
  const Eigen::Index f = m.size();
  const TickTable table(Oscillators(delta, kappa), h);
  Velocity result{Eigen::ArrayXd::Constant(f, 0.5),
                  Eigen::ArrayXd::Constant(f, 0.5),
                  Eigen::ArrayXd::Zero(f),
                  {}};
  Eigen::VectorXd constant = Eigen::VectorXd::Zero(f);
  Eigen::MatrixXcd A = Eigen::MatrixXcd::Zero(f, excitation.force().cols());
  for (Eigen::Index i = 0; i < f; ++i) {
    const double zv = table.zv[i];
    constexpr double resolved = 0.5;
    if (zv < resolved * h * std::exp(-delta[i] * h)) continue;
    result.after[i] = h / zv;
    result.before[i] = 0.0;
    result.position[i] = (1.0 - table.zz[i]) / zv;
    const double alpha = excitation.constant()[i] / m[i];
    constant[i] =
        -alpha * (kappa[i] == 0.0 ? table.z_alpha[i] : (1.0 - table.zz[i]) / kappa[i]) / zv;
    for (Eigen::Index j = 0; j < A.cols(); ++j) {
      const Complex s = harmonic(excitation, j);
      const Complex F = excitation.force()(i, j);
      if (F == 0.0) continue;
      const Complex Q = F / m[i] / (kappa[i] + s * (2.0 * delta[i] + s));
      A(i, j) = -Q * (std::exp(s * h) - table.zz[i] - zv * s) / zv;
    }
  }
  result.drive = Drive(constant, A);
  return result;
}

void step_by_bilbao(const Task& task, double h, Outcome& outcome) {
  const Machine machine(task.model);
  if (!machine.diagonal()) {
    outcome.failure = "modal flow only";
    return;
  }
  const Model& model = machine.model();
  const Eigen::Index f = machine.f();
  const int m = machine.m();
  const Eigen::MatrixXd& W = machine.W();
  Excitation excitation(model, h);
  Record record(task, h, outcome);

  const Eigen::ArrayXd mass = model.M.diagonal();
  const Eigen::ArrayXd delta = 0.5 * model.C.diagonal().array() / mass;
  const Eigen::ArrayXd kappa = model.K.diagonal().array() / mass;
  const auto [B, D, drive] = recursion(excitation, mass, delta, kappa, h);
  const Velocity rate = velocity(excitation, mass, delta, kappa, h);
  const Eigen::MatrixXd kick = (0.5 * (1.0 + B) / mass).matrix().asDiagonal() * W;
  StepImpact impact(model, W.transpose() * kick);

  Eigen::VectorXd q = task.start.q;
  Eigen::VectorXd u = task.start.u;
  Eigen::VectorXd v(f), v_new(f), g(m), g_new(m), gamma(m);
  for (int i = 0; i < m; ++i) {
    g[i] = dot(W, i, q.data()) + excitation.support(i);
    gamma[i] = dot(W, i, u.data()) + excitation.support_rate(i);
  }
  // The position at tick -1 that goes with u: u_0 = after v_(1/2) + before v_(-1/2) + ..., and
  // v_(1/2) = B v_(-1/2) - D q_0 + ...
  rate.drive.at(excitation, v_new.data());
  drive.at(excitation, v.data());
  v = ((u - v_new).array() - rate.position * q.array() - rate.after * (v.array() - D * q.array())) /
      (rate.after * B + rate.before);
  for (std::int64_t k = 0; k <= record.steps(); ++k) {
    drive.at(excitation, v_new.data());
    for (Eigen::Index i = 0; i < f; ++i) v_new[i] += B[i] * v[i] - D[i] * q[i];
    const bool sampled = record.wants(k);
    if (sampled) rate.drive.at(excitation, u.data());
    excitation.advance();
    ContactSet active = 0;
    for (int i = 0; i < m; ++i) {
      if (g[i] + 0.5 * h * gamma[i] <= 0.0) active |= bit(i);
      g_new[i] = dot(W, i, q.data()) + h * dot(W, i, v_new.data()) + excitation.support(i);
    }
    ContactSet pushed = 0;
    if (active != 0) {
      for_each(active, [&](int i) {
        impact.gamma_k[i] = gamma[i];
        impact.gamma_free[i] = (g_new[i] - g[i]) / h;
      });
      pushed = impact.solve(active);
      for_each(pushed, [&](int i) {
        add(kick, i, impact.P[i], v_new.data());
        for (int j = 0; j < m; ++j) g_new[j] += h * impact.G()(j, i) * impact.P[i];
      });
      ++outcome.solves;
    }
    if (sampled) {
      u.array() += rate.after * v_new.array() + rate.before * v.array() + rate.position * q.array();
    }
    outcome.steps = k;
    record.impulses(k, pushed);
    if (!record.state(k, q.data(), u.data())) break;
    for (int i = 0; i < m; ++i) gamma[i] = (g_new[i] - g[i]) / h;
    g.swap(g_new);
    for (Eigen::Index i = 0; i < f; ++i) q[i] += h * v_new[i];
    v.swap(v_new);
  }
  outcome.right_hand_sides = outcome.steps;
}

}  // namespace

void run_bilbao(const Task& task, double h, Outcome& outcome) {
  try {
    step_by_bilbao(task, h, outcome);
  } catch (const std::exception& error) {
    outcome.failure = error.what();
  }
}

}  // namespace sprag::work_precision
