// Common parts of the fixed-step methods: the excitation at the ticks t_k = k h, the impact law
// between the two ends of a step, and the record of a run.
//
// Impact law of Moreau & Jean: with gamma_k at the beginning of the step and gamma_free at its end
// without contacts,
//
//   Newton    0 <= P _|_ gamma_free + G P + E gamma_k >= 0,
//   Poisson   0 <= Lambda _|_ gamma_k + G Lambda >= 0,  P = (1 + E) Lambda + nu,
//             0 <= nu _|_ gamma_free + G P >= 0:
//
// where finite forces take no part in the restitution, so that a contact at rest stays at rest. For
// one contact both laws of the model equal the first. No step allocates.
#pragma once

#include <Eigen/Core>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "studies/work_precision/method.h"

namespace sprag::work_precision {

/// All harmonics of a model, forces and supports, at the present tick.
class Excitation {
 public:
  /// At tick 0. Frequency 0 counts as constant.
  Excitation(const Model& model, double h);

  void advance() {
    if (++tick_ % exact_every == 0) {
      set_phases();
      return;
    }
    for (std::size_t j = 0; j < phases_.size(); ++j) {
      Phase& p = phases_[j];
      const double cosine = p.cosine * p.step_cosine - p.sine * p.step_sine;
      p.sine = p.sine * p.step_cosine + p.cosine * p.step_sine;
      p.cosine = cosine;
    }
  }

  std::size_t frequencies() const { return phases_.size(); }
  double frequency(std::size_t j) const { return phases_[j].frequency; }
  double cosine(std::size_t j) const { return phases_[j].cosine; }
  double sine(std::size_t j) const { return phases_[j].sine; }

  /// f(t) = constant + Re sum_j force_j e^(i Omega_j t).
  const Eigen::VectorXd& constant() const { return constant_; }
  const Eigen::MatrixXcd& force() const { return force_; }  ///< f x frequencies()

  /// s_i + c_i [m] and s_i' [m/s].
  double support(int contact) const {
    const Support& s = supports_[static_cast<std::size_t>(contact)];
    if (s.phase < 0) return s.clearance;
    const Phase& p = phases_[static_cast<std::size_t>(s.phase)];
    return s.clearance + s.cosine * p.cosine + s.sine * p.sine;
  }
  double support_rate(int contact) const {
    const Support& s = supports_[static_cast<std::size_t>(contact)];
    if (s.phase < 0) return 0.0;
    const Phase& p = phases_[static_cast<std::size_t>(s.phase)];
    return p.frequency * (s.sine * p.cosine - s.cosine * p.sine);
  }

 private:
  // The recurrence restarts after this number of ticks, which limits its rounding error.
  static constexpr std::int64_t exact_every = 64;

  struct Phase {
    double frequency, cosine, sine, step_cosine, step_sine;
  };
  struct Support {
    double clearance, cosine, sine;
    std::ptrdiff_t phase;  // -1: does not move
  };

  std::ptrdiff_t phase_of(double frequency);
  void set_phases();

  double h_;
  std::int64_t tick_ = 0;
  std::vector<Phase> phases_;
  std::vector<Support> supports_;
  Eigen::VectorXd constant_;
  Eigen::MatrixXcd force_;
};

/// x += constant + Re sum_j A_j e^(i Omega_j t): the effect of f(t) in one step of a linear method.
class Drive {
 public:
  Drive() = default;
  Drive(const Eigen::VectorXd& constant, const Eigen::MatrixXcd& A)
      : constant_(constant), cosine_(A.real()), sine_(-A.imag()) {}

  /// x has as many entries as `constant`; they are overwritten.
  void at(const Excitation& excitation, double* x) const {
    const Eigen::Index n = constant_.size();
    if (excitation.frequencies() == 0) {
      for (Eigen::Index i = 0; i < n; ++i) x[i] = constant_[i];
      return;
    }
    const double* from = constant_.data();
    for (std::size_t j = 0; j < excitation.frequencies(); ++j) {
      const double c = excitation.cosine(j);
      const double s = excitation.sine(j);
      const double* a = cosine_.data() + static_cast<Eigen::Index>(j) * n;
      const double* b = sine_.data() + static_cast<Eigen::Index>(j) * n;
      for (Eigen::Index i = 0; i < n; ++i) x[i] = from[i] + c * a[i] + s * b[i];
      from = x;
    }
  }

 private:
  Eigen::VectorXd constant_;
  Eigen::MatrixXd cosine_, sine_;
};

/// Column `contact` of W times x, in four chains of additions.
inline double dot(const Eigen::MatrixXd& W, int contact, const double* x) {
  const Eigen::Index f = W.rows();
  const double* w = W.data() + contact * f;
  Eigen::Index i = 0;
  double sum = 0.0;
  if (f >= 4) {
    double a = 0.0, b = 0.0, c = 0.0, d = 0.0;
    for (; i + 4 <= f; i += 4) {
      a += w[i] * x[i];
      b += w[i + 1] * x[i + 1];
      c += w[i + 2] * x[i + 2];
      d += w[i + 3] * x[i + 3];
    }
    sum = (a + b) + (c + d);
  }
  for (; i < f; ++i) sum += w[i] * x[i];
  return sum;
}

/// x += factor times column `contact` of W.
inline void add(const Eigen::MatrixXd& W, int contact, double factor, double* x) {
  const Eigen::Index f = W.rows();
  const double* w = W.data() + contact * f;
  for (Eigen::Index i = 0; i < f; ++i) x[i] += factor * w[i];
}

/// Solves 0 <= x _|_ A x + b >= 0 on the contacts of `set`. A is m x m, b and x have m entries;
/// entries outside `set` are not changed. Returns the contacts with x > 0. A is regularized if it
/// is singular, so that dependent directions share the load.
ContactSet complementarity(const Eigen::MatrixXd& A, ContactSet set, const Eigen::VectorXd& b,
                           Eigen::VectorXd& x);

/// The impact law of a step, see above.
class StepImpact {
 public:
  /// G is m x m.
  StepImpact(const Model& model, Eigen::MatrixXd G);

  /// Solves for P of the contacts `active`, given their gamma_k and gamma_free. Returns those with
  /// P > 0.
  ContactSet solve(ContactSet active);

  const Eigen::MatrixXd& G() const { return G_; }

  Eigen::VectorXd gamma_k, gamma_free, P;  ///< m entries each

 private:
  bool poisson_;
  Eigen::MatrixXd G_;
  Eigen::VectorXd epsilon_, b_, Lambda_;
};

/// Whether a contact has g < 0 at the start: no method on positions can open it without an impulse.
bool starts_inside(const Task& task);

/// Writes the outcome of a run of n = horizon / h steps.
class Record {
 public:
  Record(const Task& task, double h, Outcome& outcome);

  std::int64_t steps() const { return steps_; }

  /// The state at tick k, for consecutive ticks; u is read only if tick k is sampled. Returns
  /// false, with the failure noted, after the motion has diverged.
  bool state(std::int64_t k, const double* q, const double* u) {
    bool bounded = true;
    for (Eigen::Index i = 0; i < f_; ++i) bounded &= std::abs(q[i]) <= blown_up;
    if (!bounded) {
      fail(k);
      return false;
    }
    if (k == sample_tick_) sample(q, u);
    return true;
  }

  /// Contacts with an impulse in the step that ends at tick k, for consecutive steps.
  void impulses(std::int64_t k, ContactSet pushed) {
    const ContactSet impacts = pushed & ~pushed_;
    pushed_ = pushed;
    if (impacts != 0) add_impacts(k, impacts);
  }

 private:
  static constexpr double blown_up = 1e6;

  void fail(std::int64_t k);
  void sample(const double* q, const double* u);
  void add_impacts(std::int64_t k, ContactSet impacts);
  void next_sample();

  Outcome& outcome_;
  double h_;
  double sample_step_;
  Eigen::Index f_;
  std::int64_t steps_;
  std::int64_t sample_tick_ = -1;
  Eigen::Index sample_ = 0;
  ContactSet pushed_ = 0;
};

}  // namespace sprag::work_precision
