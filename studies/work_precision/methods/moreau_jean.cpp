// Moreau-Jean time stepping with contacts of the geometry. With x_theta = theta x_(k+1) +
// (1 - theta) x_k:
//
//   M (u_(k+1) - u_k) = h (f_theta - C u_theta - K q_theta) + W P,   q_(k+1) = q_k + h u_theta.
//
// A contact takes part in the step if g_k + h gamma_k / 2 <= 0; P follows from the impact law of
// fixed_step.h with G = W^T (M + h theta C + h^2 theta^2 K)^-1 W. Second order in free flight for
// theta = 1/2, first order across impacts. Sources: J. J. Moreau, Comput. Methods Appl. Mech. Eng.
// 177 (1999); M. Jean, ibid.; the prediction of the gap as in Siconos, V. Acary & B. Brogliato,
// Numerical Methods for Nonsmooth Dynamical Systems, 2008.
#include <Eigen/Cholesky>
#include <complex>
#include <exception>

#include "studies/work_precision/machine.h"
#include "studies/work_precision/methods/fixed_step.h"
#include "studies/work_precision/methods/methods.h"

namespace sprag::work_precision {
namespace {

void step_by_moreau_jean(const Task& task, double theta, double h, Outcome& outcome) {
  const Machine machine(task.model);
  const Model& model = machine.model();
  const Eigen::Index f = machine.f();
  const int m = machine.m();
  const bool diagonal = machine.diagonal();
  const Eigen::MatrixXd& W = machine.W();
  Excitation excitation(model, h);
  Record record(task, h, outcome);

  // u_(k+1) = U_q q_k + U_u u_k + drive without contacts
  const Eigen::LLT<Eigen::MatrixXd> M_hat(model.M + h * theta * model.C +
                                          h * h * theta * theta * model.K);
  const Eigen::MatrixXd U_q = M_hat.solve(-h * model.K);
  const Eigen::MatrixXd U_u =
      M_hat.solve(model.M - h * (1.0 - theta) * (model.C + h * theta * model.K));
  const Eigen::VectorXd u_q = U_q.diagonal();
  const Eigen::VectorXd u_u = U_u.diagonal();
  const Eigen::MatrixXd MinvW = M_hat.solve(W);
  Eigen::MatrixXcd A(f, excitation.force().cols());
  for (Eigen::Index j = 0; j < A.cols(); ++j) {
    const Eigen::VectorXcd f_theta =
        excitation.force().col(j) *
        ((1.0 - theta) +
         theta * std::polar(1.0, excitation.frequency(static_cast<std::size_t>(j)) * h));
    A.col(j).real() = h * M_hat.solve(f_theta.real());
    A.col(j).imag() = h * M_hat.solve(f_theta.imag());
  }
  const Drive drive(h * M_hat.solve(excitation.constant()), A);
  StepImpact impact(model, W.transpose() * MinvW);

  Eigen::VectorXd q = task.start.q;
  Eigen::VectorXd u = task.start.u;
  Eigen::VectorXd u_new(f);
  if (!record.state(0, q.data(), u.data())) return;
  for (std::int64_t k = 1; k <= record.steps(); ++k) {
    ContactSet active = 0;
    for (int i = 0; i < m; ++i) {
      const double gamma = dot(W, i, u.data()) + excitation.support_rate(i);
      const double g = dot(W, i, q.data()) + excitation.support(i);
      if (g + 0.5 * h * gamma > 0.0) continue;
      active |= bit(i);
      impact.gamma_k[i] = gamma;
    }
    drive.at(excitation, u_new.data());
    if (diagonal) {
      for (Eigen::Index i = 0; i < f; ++i) u_new[i] += u_q[i] * q[i] + u_u[i] * u[i];
    } else {
      u_new.noalias() += U_q * q;
      u_new.noalias() += U_u * u;
    }
    excitation.advance();
    ContactSet pushed = 0;
    if (active != 0) {
      for_each(active, [&](int i) {
        impact.gamma_free[i] = dot(W, i, u_new.data()) + excitation.support_rate(i);
      });
      pushed = impact.solve(active);
      for_each(pushed, [&](int i) { add(MinvW, i, impact.P[i], u_new.data()); });
      ++outcome.solves;
    }
    for (Eigen::Index i = 0; i < f; ++i) {
      q[i] += h * (theta * u_new[i] + (1.0 - theta) * u[i]);
      u[i] = u_new[i];
    }
    outcome.steps = k;
    record.impulses(k, pushed);
    if (!record.state(k, q.data(), u.data())) break;
  }
  outcome.right_hand_sides = outcome.steps;
  outcome.solves += outcome.steps;
}

void run(const Task& task, double theta, double h, Outcome& outcome) {
  try {
    step_by_moreau_jean(task, theta, h, outcome);
  } catch (const std::exception& error) {
    outcome.failure = error.what();
  }
}

}  // namespace

void run_moreau_jean(const Task& task, double h, Outcome& outcome) { run(task, 0.5, h, outcome); }

void run_moreau_jean_implicit(const Task& task, double h, Outcome& outcome) {
  run(task, 1.0, h, outcome);
}

}  // namespace sprag::work_precision
