// The scheme of Paoli & Schatzman, on positions,
//
//   M (q_(k+1) - 2 q_k + q_(k-1)) / h^2 = f_k - C (q_(k+1) - q_(k-1)) / (2 h) - K q_k + W P / h,
//   0 <= P _|_ g_(k+1) + E g_(k-1) >= 0:
//
// for a fixed convex set and one epsilon, q_(k+1) = -epsilon q_(k-1) + (1 + epsilon) times the
// projection of (2 q_k - (1 - epsilon) q_(k-1) + ...) / (1 + epsilon). Implemented with velocities
// v_(k+1/2) = (q_(k+1) - q_k) / h, which avoids the cancellation of three positions; the velocity
// at tick k is (q_(k+1) - q_(k-1)) / (2 h). Explicit: stable for h below 2 / omega_max. Second
// order in free flight, first order across impacts. Source: L. Paoli & M. Schatzman, SIAM J. Numer.
// Anal. 40 (2002). The scheme has no Poisson law: with several contacts the law is always Newton's.
#include <Eigen/Cholesky>
#include <exception>

#include "studies/work_precision/machine.h"
#include "studies/work_precision/methods/fixed_step.h"
#include "studies/work_precision/methods/methods.h"

namespace sprag::work_precision {
namespace {

void step_by_paoli_schatzman(const Task& task, double h, Outcome& outcome) {
  if (starts_inside(task)) {
    outcome.failure = "starts inside a contact";
    return;
  }
  const Machine machine(task.model);
  const Model& model = machine.model();
  const Eigen::Index f = machine.f();
  const int m = machine.m();
  const bool diagonal = machine.diagonal();
  const Eigen::MatrixXd& W = machine.W();
  Excitation excitation(model, h);
  Record record(task, h, outcome);

  // v_(k+1/2) = V_q q_k + V_v v_(k-1/2) + drive without contacts
  const Eigen::LLT<Eigen::MatrixXd> M_hat(model.M + 0.5 * h * model.C);
  const Eigen::MatrixXd V_q = M_hat.solve(-h * model.K);
  const Eigen::MatrixXd V_v = M_hat.solve(model.M - 0.5 * h * model.C);
  const Eigen::VectorXd v_q = V_q.diagonal();
  const Eigen::VectorXd v_v = V_v.diagonal();
  const Eigen::MatrixXd MinvW = M_hat.solve(W);
  const Eigen::MatrixXd hG = h * W.transpose() * MinvW;
  Eigen::MatrixXcd A(f, excitation.force().cols());
  for (Eigen::Index j = 0; j < A.cols(); ++j) {
    A.col(j).real() = h * M_hat.solve(excitation.force().col(j).real());
    A.col(j).imag() = h * M_hat.solve(excitation.force().col(j).imag());
  }
  const Drive drive(h * M_hat.solve(excitation.constant()), A);

  Eigen::VectorXd q = task.start.q;
  Eigen::VectorXd v(f), v_new(f), u(f), g_before(m), g(m), g_new(m), b(m), P(m), epsilon(m);
  machine.accelerate(0.0, q.data(), task.start.u.data(), v.data());
  v = task.start.u - 0.5 * h * v;
  const Eigen::VectorXd q_before = q - h * v;
  for (int i = 0; i < m; ++i) {
    epsilon[i] = model.contacts[static_cast<std::size_t>(i)].restitution;
    g_before[i] = machine.gap(i, -h, q_before.data());
    g[i] = machine.gap(i, 0.0, q.data());
  }
  const ContactSet all = bit(m) - 1;
  for (std::int64_t k = 0; k <= record.steps(); ++k) {
    drive.at(excitation, v_new.data());
    if (diagonal) {
      for (Eigen::Index i = 0; i < f; ++i) v_new[i] += v_q[i] * q[i] + v_v[i] * v[i];
    } else {
      v_new.noalias() += V_q * q;
      v_new.noalias() += V_v * v;
    }
    excitation.advance();
    bool violated = false;
    for (int i = 0; i < m; ++i) {
      g_new[i] = dot(W, i, q.data()) + h * dot(W, i, v_new.data()) + excitation.support(i);
      b[i] = g_new[i] + epsilon[i] * g_before[i];
      violated |= b[i] < 0.0;
    }
    ContactSet pushed = 0;
    if (violated) {
      pushed = complementarity(hG, all, b, P);
      for_each(pushed, [&](int i) {
        add(MinvW, i, P[i], v_new.data());
        for (int j = 0; j < m; ++j) g_new[j] += hG(j, i) * P[i];
      });
      ++outcome.solves;
    }
    for (Eigen::Index i = 0; i < f; ++i) u[i] = 0.5 * (v[i] + v_new[i]);
    outcome.steps = k;
    if (!record.state(k, q.data(), u.data())) break;
    record.impulses(k + 1, pushed);
    for (Eigen::Index i = 0; i < f; ++i) q[i] += h * v_new[i];
    v.swap(v_new);
    g_before.swap(g);
    g.swap(g_new);
  }
  outcome.right_hand_sides = outcome.steps;
}

}  // namespace

void run_paoli_schatzman(const Task& task, double h, Outcome& outcome) {
  try {
    step_by_paoli_schatzman(task, h, outcome);
  } catch (const std::exception& error) {
    outcome.failure = error.what();
  }
}

}  // namespace sprag::work_precision
