// The nonsmooth generalized-alpha scheme with contacts at position and at velocity level. The
// smooth part of the step,
//
//   M v'_(k+1) = f_(k+1) - C u_(k+1) - K q_(k+1),
//   (1 - alpha_m) a_(k+1) + alpha_m a_k = (1 - alpha_f) v'_(k+1) + alpha_f v'_k,
//   q_(k+1) = q_k + h u_k + h^2 ((1/2 - beta) a_k + beta a_(k+1)) + M^-1 W nu,
//   u_(k+1) = u_k + h ((1 - gamma) a_k + gamma a_(k+1)) + M^-1 W Lambda,
//
// is solved without iteration, because the machine is linear, together with
//
//   0 <= nu _|_ g_(k+1) >= 0,   and where nu > 0   0 <= Lambda _|_ gamma_(k+1) + E gamma_k >= 0
//
// (Poisson's law as in fixed_step.h). The two are solved one after the other: the effect of Lambda
// on g_(k+1) through C, of order h^2, is left to the next step. Second order in free flight, with
// the spectral radius 0.8 at infinite frequency; first order across impacts. Sources: Q. Z. Chen,
// V. Acary, G. Virlez & O. Bruels, Int. J. Numer. Methods Eng. 96 (2013); O. Bruels, V. Acary & A.
// Cardona, Comput. Methods Appl. Mech. Eng. 281 (2014).
#include <Eigen/Cholesky>
#include <exception>

#include "studies/work_precision/machine.h"
#include "studies/work_precision/methods/fixed_step.h"
#include "studies/work_precision/methods/methods.h"

namespace sprag::work_precision {
namespace {

constexpr double rho = 0.8;
constexpr double alpha_m = (2.0 * rho - 1.0) / (rho + 1.0);
constexpr double alpha_f = rho / (rho + 1.0);
constexpr double gamma_ = 0.5 + alpha_f - alpha_m;
constexpr double beta = 0.25 * (gamma_ + 0.5) * (gamma_ + 0.5);
constexpr double kappa = (1.0 - alpha_f) / (1.0 - alpha_m);

// Effect of unit multipliers on q, u and v' at the end of the step: f x m each.
struct Response {
  Eigen::MatrixXd q, u, rate;

  void apply(int contact, double multiplier, double* q_, double* u_, double* rate_) const {
    add(q, contact, multiplier, q_);
    add(u, contact, multiplier, u_);
    add(rate, contact, multiplier, rate_);
  }
};

// Symmetric up to terms of higher order in h, which vanish if M, C and K share their modes.
Eigen::MatrixXd symmetric(const Eigen::MatrixXd& A) { return 0.5 * (A + A.transpose()); }

// Constant matrices of a step: of its linear equation S v' = r, and the responses to multipliers.
struct StepMatrices {
  StepMatrices(const Machine& machine, double u_of_a, double q_of_a) {
    const Model& model = machine.model();
    const Eigen::MatrixXd S = model.M + kappa * (u_of_a * model.C + q_of_a * model.K);
    const Eigen::LLT<Eigen::MatrixXd> factor(S);
    Sinv = factor.solve(Eigen::MatrixXd::Identity(machine.f(), machine.f()));
    sinv = Sinv.diagonal();
    c = model.C.diagonal();
    k = model.K.diagonal();
    position.rate = -factor.solve(model.K * machine.MinvW());
    velocity.rate = -factor.solve(model.C * machine.MinvW());
    for (Response* response : {&position, &velocity}) {
      response->q = kappa * q_of_a * response->rate;
      response->u = kappa * u_of_a * response->rate;
    }
    position.q += machine.MinvW();
    velocity.u += machine.MinvW();
    G_position = symmetric(machine.W().transpose() * position.q);
  }

  Eigen::MatrixXd Sinv, G_position;
  Eigen::VectorXd sinv, c, k;  // diagonals
  Response position, velocity;
};

void step_by_generalized_alpha(const Task& task, double h, Outcome& outcome) {
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

  const double u_of_a = h * gamma_;
  const double q_of_a = h * h * beta;
  const StepMatrices step(machine, u_of_a, q_of_a);
  const Response& position = step.position;
  const Response& velocity = step.velocity;
  StepImpact impact(model, symmetric(W.transpose() * velocity.u));
  const Drive drive(excitation.constant(), excitation.force());

  Eigen::VectorXd q = task.start.q;
  Eigen::VectorXd u = task.start.u;
  Eigen::VectorXd rate(f), a(f), u_before(f), force(f), g(m), nu(m);
  machine.accelerate(0.0, q.data(), u.data(), rate.data());
  a = rate;
  if (!record.state(0, q.data(), u.data())) return;
  for (std::int64_t k = 1; k <= record.steps(); ++k) {
    excitation.advance();
    drive.at(excitation, force.data());
    // a becomes a_(k+1) without its part of v'_(k+1); the same holds for q and u.
    for (Eigen::Index i = 0; i < f; ++i) {
      u_before[i] = u[i];
      const double a_known = (alpha_f * rate[i] - alpha_m * a[i]) / (1.0 - alpha_m);
      q[i] += h * u[i] + h * h * (0.5 - beta) * a[i] + q_of_a * a_known;
      u[i] += h * (1.0 - gamma_) * a[i] + u_of_a * a_known;
      a[i] = a_known;
    }
    if (diagonal) {
      for (Eigen::Index i = 0; i < f; ++i) {
        rate[i] = step.sinv[i] * (force[i] - step.c[i] * u[i] - step.k[i] * q[i]);
      }
    } else {
      force.noalias() -= model.C * u;
      force.noalias() -= model.K * q;
      rate.noalias() = step.Sinv * force;
    }
    for (Eigen::Index i = 0; i < f; ++i) {
      q[i] += kappa * q_of_a * rate[i];
      u[i] += kappa * u_of_a * rate[i];
    }
    bool violated = false;
    for (int i = 0; i < m; ++i) {
      g[i] = dot(W, i, q.data()) + excitation.support(i);
      violated |= g[i] < 0.0;
    }
    ContactSet pushed = 0;
    if (violated) {
      const ContactSet active = complementarity(step.G_position, bit(m) - 1, g, nu);
      for_each(active, [&](int i) { position.apply(i, nu[i], q.data(), u.data(), rate.data()); });
      const double t_before = static_cast<double>(k - 1) * h;
      for_each(active, [&](int i) {
        impact.gamma_k[i] = machine.gap_velocity(i, t_before, u_before.data());
        impact.gamma_free[i] = dot(W, i, u.data()) + excitation.support_rate(i);
      });
      pushed = impact.solve(active);
      for_each(pushed,
               [&](int i) { velocity.apply(i, impact.P[i], q.data(), u.data(), rate.data()); });
      outcome.solves += 2;
    }
    for (Eigen::Index i = 0; i < f; ++i) a[i] += kappa * rate[i];
    outcome.steps = k;
    record.impulses(k, pushed);
    if (!record.state(k, q.data(), u.data())) break;
  }
  outcome.right_hand_sides = outcome.steps;
  outcome.solves += outcome.steps;
}

}  // namespace

void run_generalized_alpha(const Task& task, double h, Outcome& outcome) {
  try {
    step_by_generalized_alpha(task, h, outcome);
  } catch (const std::exception& error) {
    outcome.failure = error.what();
  }
}

}  // namespace sprag::work_precision
