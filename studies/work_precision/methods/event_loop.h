// Event-driven integration with a general-purpose solver of x' = F(t, x), x = (q, u): the solver
// steps, sign changes of the signals over each step are located on its dense output, and the
// machine is restarted after each event,
//
//   open contact:    0 < g_i,        sign change: impact (Baumann & Leine 2014, eq. (6))
//   locked contact:  0 <= lambda_i,  sign change: it opens
//
// Contacts are treated as in sprag::Master (pulse, completed chatter, sustained contact), so that
// methods differ only in integration and event search. In addition a bounce is completed if its
// height is below the rounding of the gap, because the gap is computed from q here. Starts inside a
// contact are refused.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "studies/work_precision/machine.h"
#include "studies/work_precision/method.h"

namespace sprag::work_precision {

/// The sets of open and locked contacts, the equation of motion of this phase, and the effect of an
/// event. x has 2 f entries, q first.
class ContactPhases {
 public:
  /// Bounces below an error of tolerance (1 + |q|) are completed. This serves integrators with a
  /// low order in their first steps after a restart, such as multistep methods.
  ContactPhases(const Task& task, Outcome& outcome, double tolerance = 0.0);

  Eigen::Index f() const { return machine_.f(); }
  int m() const { return machine_.m(); }

  /// x' of the present phase.
  void derivative(double t, const double* x, double* rate) {
    ++outcome_->right_hand_sides;
    for (Eigen::Index i = 0; i < f(); ++i) rate[i] = x[f() + i];
    if (locked_ == 0) {
      machine_.accelerate(t, x, x + f(), rate + f());
    } else {
      (void)machine_.accelerate_locked(t, x, x + f(), locked_, rate + f(), lambda_);
    }
  }

  /// Positive until the contact's next event. The zero of a parted contact's gap at its last impact
  /// is divided out, (g(t) - g(t_0)) / (t - t_0); otherwise a short flight would begin and end with
  /// the same sign. A contact that opens without velocity may return by at most the gap's rounding
  /// before it is clear.
  double signal(int contact, double t, const double* x);

  /// Call after each step without events.
  void settle(double t, const double* x);

  /// Time at which the rest of a chatter is completed, or infinity.
  double completion() const { return completion_; }

  /// The functions below throw std::runtime_error (dependent directions, no progress, ...).
  /// Contacts that touch at t = 0.
  void start(double* x);
  /// Impacts and openings at t: of the contacts whose signal is zero, and those to be completed.
  void take(double t, ContactSet fired, double* x);

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();

  struct Parting {
    double t = -infinity;  // never: the gap itself is the signal
    double gap = 0.0;      // rounding of it
    double velocity = 0.0;
    bool near = false;  // let go, and not clear of the other side yet
  };

  struct Impact {
    double t = -infinity;
    ContactSet closing = 0;
  };

  void close(double t, ContactSet closing, ContactSet to_stay, double* x);
  ContactSet sustained(double t, ContactSet resting, const double* x);
  void project(double t, double* x) const;
  void part(int contact, double t, double velocity, const double* x);
  double gap_scale(int contact, const double* q) const;
  double velocity_noise(int contact, const double* u) const;
  ContactSet wedged(double t, ContactSet closing);
  void hold_hardly_parted(double t, ContactSet staying, ContactSet participants, double* x,
                          ContactSet& resting);
  double shortest_chatter(double t) const;
  double resolvable_height(int contact, const double* q) const;
  double gap_acceleration(int contact, double t, const double* u_dot) const;
  double acceleration_scale(int contact, double t, const double* u_dot) const;
  [[noreturn]] void fail(double t, const std::string& what) const;

  Machine machine_;
  Outcome* outcome_;
  double tolerance_;
  ContactSet locked_ = 0;
  ContactSet near_ = 0;  // see Parting
  double completion_ = infinity;
  std::vector<double> completions_;  // per contact
  std::vector<Parting> partings_;    // per contact
  ContactVector lambda_;             // of the locked ones
  std::vector<double> rate_;         // scratch
  std::vector<double> epsilon_;      // scratch
  std::array<Impact, 32> recent_;    // ring of the last impacts
  std::int64_t impacts_ = 0;
  int events_since_ = 0;  // since_ [s]
  double since_ = 0.0;
};

/// First zero of phi in (a, b], to rounding accuracy, for phi(a) = phi_a > 0 >= phi(b) = phi_b:
/// Chandrupatla, "A new hybrid quadratic/bisection algorithm", Adv. Eng. Softw. 28, 1997. Returns a
/// for phi_a <= 0.
template <typename Phi>
double locate(Phi phi, double a, double phi_a, double b, double phi_b) {
  constexpr double epsilon = std::numeric_limits<double>::epsilon();
  if (!(phi_a > 0.0)) return a;
  if (phi_b == 0.0) return b;
  double x = b, f = phi_b;    // the latest point
  double y = a, f_y = phi_a;  // across the zero
  double share = 0.5;         // of the way from x to y
  while (true) {
    const double next = x + share * (y - x);
    const double f_next = phi(next);
    double z = y, f_z = f_y;  // the discarded point
    if ((f_next > 0.0) == (f > 0.0)) {
      z = x;
      f_z = f;
    } else {
      y = x;
      f_y = f;
    }
    x = next;
    f = f_next;
    const double best = std::abs(f_y) < std::abs(f) ? y : x;
    const double resolution = 2.0 * epsilon * std::abs(best) / std::abs(y - x);
    if (!(resolution < 0.5) || f == 0.0 || f_y == 0.0) return best;
    const double xi = (x - y) / (z - y);
    const double eta = (f - f_y) / (f_z - f_y);
    const bool monotone = eta * eta < xi && (1.0 - eta) * (1.0 - eta) < 1.0 - xi;
    share = monotone ? f / (f_y - f) * f_z / (f_y - f_z) +
                           (z - x) / (y - x) * f / (f_z - f) * f_y / (f_z - f_y)
                     : 0.5;
    share = std::clamp(share, resolution, 1.0 - resolution);
  }
}

/// Runs the task with an integrator of the phases:
///
///   void restart(double t, std::span<const double> x)  from a new state, or in a new phase
///   double step()                        one step of its own choice; the time reached
///   void interpolate(double t, double* x)              within the last step; not counted as a step
///   ContactSet fired() const             signals whose zero has ended the step, if it looks for
///   them
template <typename Integrator>
void run_events(const Task& task, ContactPhases& phases, Integrator& integrator, Outcome& outcome) {
  constexpr double epsilon = std::numeric_limits<double>::epsilon();
  const auto size = static_cast<std::size_t>(2 * phases.f());
  const int m = phases.m();
  std::vector<double> x(size), scratch(size);
  std::vector<double> before(static_cast<std::size_t>(m)), after(before);
  const Eigen::Index samples = task.sample_step > 0.0 ? task.samples() : 0;
  Eigen::Index sample = 0;
  const auto record = [&](Eigen::Index k) {
    outcome.q.col(k) = Eigen::Map<const Eigen::VectorXd>(scratch.data(), phases.f());
    outcome.u.col(k) = Eigen::Map<const Eigen::VectorXd>(scratch.data() + phases.f(), phases.f());
  };
  const auto read_signals = [&](double t, std::vector<double>& signals) {
    for (int i = 0; i < m; ++i) {
      signals[static_cast<std::size_t>(i)] = phases.signal(i, t, x.data());
    }
  };
  // The first zero of the signals in (t, end], or `end`, and the signals that are zero there.
  const auto first_zero = [&](double t, double end) {
    std::pair<double, ContactSet> first{end, 0};
    auto& [event, fired] = first;
    for (int i = 0; i < m; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (after[k] > 0.0) continue;
      const auto phi = [&](double at) {
        integrator.interpolate(at, scratch.data());
        return phases.signal(i, at, scratch.data());
      };
      const double zero = locate(phi, t, before[k], end, after[k]);
      // Events that are simultaneous within rounding are treated as one event.
      if (zero < event - 2.0 * epsilon * event) {
        first = {zero, bit(i)};
      } else if (zero <= event + 2.0 * epsilon * event) {
        fired |= bit(i);
      }
    }
    return first;
  };

  for (Eigen::Index i = 0; i < phases.f(); ++i) {
    x[static_cast<std::size_t>(i)] = task.start.q[i];
    x[static_cast<std::size_t>(i + phases.f())] = task.start.u[i];
  }
  try {
    double t = 0.0;
    phases.start(x.data());
    integrator.restart(t, x);
    read_signals(t, before);
    while (t < task.horizon) {
      const double reached = integrator.step();
      ++outcome.steps;
      if (!(reached > t)) throw std::runtime_error("the step size underflows");
      const double end = std::min({reached, phases.completion(), task.horizon});
      integrator.interpolate(end, x.data());
      read_signals(end, after);
      for (const double signal : after) {
        if (!std::isfinite(signal)) throw std::runtime_error("the solution is not finite");
      }
      ContactSet fired = end == reached ? integrator.fired() : 0;
      double event = end;
      if (fired == 0) std::tie(event, fired) = first_zero(t, end);
      for (; sample < samples && task.sample_time(sample) < event; ++sample) {
        integrator.interpolate(task.sample_time(sample), scratch.data());
        record(sample);
      }
      if (fired != 0 || event == phases.completion()) {
        integrator.interpolate(event, x.data());
        phases.take(event, fired, x.data());
        integrator.restart(event, x);
        read_signals(event, before);
      } else {
        phases.settle(end, x.data());
        std::swap(before, after);
      }
      t = event;
    }
    scratch = x;
    for (; sample < samples; ++sample) record(sample);
  } catch (const std::exception& error) {
    outcome.failure = error.what();
  }
}

}  // namespace sprag::work_precision
