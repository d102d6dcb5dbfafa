// Contacts as springs and dashpots that only push, without events:
//
//   lambda_i = max(0, k delta_i + d_i delta_i'),  delta_i = -g_i > 0.
//
// The collision of the mass 1 / G_ii with damping ratio zeta = cos psi parts where the force falls
// to zero, with the restitution exp(-2 psi cot psi) (Schwager & Poeschel, "Coefficient of
// restitution and linear-dashpot model revisited", Granular Matter 9, 2007); d_i is chosen so that
// this is epsilon_i. Integrated by Boost.Odeint's Dormand-Prince 5(4).
#include <cmath>
#include <numbers>

#include "studies/work_precision/machine.h"
#include "studies/work_precision/methods/dormand_prince.h"
#include "studies/work_precision/methods/event_loop.h"
#include "studies/work_precision/methods/methods.h"

namespace sprag::work_precision {
namespace {

constexpr double tolerance = 1e-8;
// A smaller restitution requires an ever stiffer dashpot.
constexpr double least_restitution = 1e-2;

// -log(restitution) as a function of the damping ratio; it increases.
double loss(double zeta) {
  if (zeta < 1.0) return 2.0 * std::acos(zeta) * zeta / std::sqrt(1.0 - zeta * zeta);
  if (zeta > 1.0) return 2.0 * std::acosh(zeta) * zeta / std::sqrt(zeta * zeta - 1.0);
  return 2.0;
}

double damping_ratio(double restitution) {
  const double wanted = -std::log(std::max(restitution, least_restitution));
  double low = 0.0, high = 16.0;
  for (int i = 0; i < 100; ++i) {
    const double zeta = 0.5 * (low + high);
    (loss(zeta) < wanted ? low : high) = zeta;
  }
  return 0.5 * (low + high);
}

class PenaltyMachine {
 public:
  PenaltyMachine(const Model& model, double k, Outcome& outcome)
      : machine_(model), k_(k), outcome_(&outcome) {
    for (int i = 0; i < machine_.m(); ++i) {
      const double zeta = damping_ratio(model.contacts[static_cast<std::size_t>(i)].restitution);
      d_.push_back(2.0 * zeta * std::sqrt(k / machine_.G()(i, i)));
    }
  }

  const Machine& machine() const { return machine_; }

  void derivative(double t, const double* x, double* rate) {
    ++outcome_->right_hand_sides;
    const Eigen::Index f = machine_.f();
    const double* u = x + f;
    double* acceleration = rate + f;
    for (Eigen::Index k = 0; k < f; ++k) rate[k] = u[k];
    machine_.accelerate(t, x, u, acceleration);
    for (int i = 0; i < machine_.m(); ++i) {
      const double g = machine_.gap(i, t, x);
      if (g >= 0.0) continue;
      const double gamma = machine_.gap_velocity(i, t, u);
      const double lambda = -k_ * g - d_[static_cast<std::size_t>(i)] * gamma;
      if (lambda <= 0.0) continue;
      const double* direction = machine_.MinvW().col(i).data();
      for (Eigen::Index k = 0; k < f; ++k) acceleration[k] += lambda * direction[k];
    }
  }

 private:
  Machine machine_;
  double k_;
  std::vector<double> d_;
  Outcome* outcome_;
};

template <typename Integrator>
void integrate(const Task& task, const Machine& machine, Integrator& integrator,
               std::vector<double>& x, Outcome& outcome) {
  const Eigen::Index f = machine.f();
  const int m = machine.m();
  std::vector<double> scratch(x);
  std::vector<double> gap(static_cast<std::size_t>(m));
  for (int i = 0; i < m; ++i) gap[static_cast<std::size_t>(i)] = machine.gap(i, 0.0, x.data());
  std::vector<double> touchdowns;
  const Eigen::Index samples = task.sample_step > 0.0 ? task.samples() : 0;
  Eigen::Index sample = 0;
  const auto record = [&](double t) {
    integrator.interpolate(t, scratch.data());
    outcome.q.col(sample) = Eigen::Map<const Eigen::VectorXd>(scratch.data(), f);
    outcome.u.col(sample) = Eigen::Map<const Eigen::VectorXd>(scratch.data() + f, f);
    ++sample;
  };
  integrator.restart(0.0, x);
  double t = 0.0;
  while (t < task.horizon) {
    const double reached = integrator.step();
    ++outcome.steps;
    if (!(reached > t)) throw std::runtime_error("the step size underflows");
    const double end = std::min(reached, task.horizon);
    integrator.interpolate(end, x.data());
    touchdowns.clear();
    for (int i = 0; i < m; ++i) {
      double& before = gap[static_cast<std::size_t>(i)];
      const double after = machine.gap(i, end, x.data());
      if (!std::isfinite(after)) throw std::runtime_error("the solution is not finite");
      if (before > 0.0 && after <= 0.0) {
        const auto phi = [&](double s) {
          integrator.interpolate(s, scratch.data());
          return machine.gap(i, s, scratch.data());
        };
        touchdowns.push_back(locate(phi, t, before, end, after));
      }
      before = after;
    }
    std::sort(touchdowns.begin(), touchdowns.end());
    outcome.impacts.insert(outcome.impacts.end(), touchdowns.begin(), touchdowns.end());
    while (sample < samples && task.sample_time(sample) < end) record(task.sample_time(sample));
    t = end;
  }
  while (sample < samples) record(t);
}

}  // namespace

void run_penalty(const Task& task, double k, Outcome& outcome) try {
  PenaltyMachine penalty(task.model, k, outcome);
  std::vector<double> x(task.start.q.begin(), task.start.q.end());
  x.insert(x.end(), task.start.u.begin(), task.start.u.end());
  with_state(penalty.machine().f(), [&](auto state) {
    const auto rate = [&penalty](double t, const double* y, double* y_dot) {
      penalty.derivative(t, y, y_dot);
    };
    DormandPrince<decltype(state), decltype(rate)> integrator(state.size(), tolerance, rate);
    integrate(task, penalty.machine(), integrator, x, outcome);
  });
} catch (const std::exception& error) {
  outcome.failure = error.what();
}

}  // namespace sprag::work_precision
