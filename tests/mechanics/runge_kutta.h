// Machines by fourth-order Runge-Kutta steps of M u' + C u + K q = f(t), with impacts by bisection:
// a reference that shares no code with the library's flows and searches.
#pragma once

#include <cmath>
#include <vector>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/model.h"
#include "sprag/sampled_input.h"

namespace sprag::test {

class RungeKutta {
 public:
  using Real = long double;
  struct Impact {
    double t;
    int contact;
  };

  /// All sampled inputs of the machine must be the same.
  RungeKutta(const Model& model, const State& start) : model_(model), f_(model.coordinates()) {
    inverse_ = inverse(MatrixR(model.M.cast<Real>()));
    C_ = product(inverse_, model.C.cast<Real>());
    K_ = product(inverse_, model.K.cast<Real>());
    for (const Force& force : model.forces) {
      pushes_.push_back(inverse_ * force.direction.cast<Real>());
      if (force.input) input_ = force.input;
    }
    for (const Contact& contact : model.contacts) w_.push_back(contact.w.cast<Real>());
    x_.setZero(2 * f_ + 2);
    x_.head(f_) = start.q.cast<Real>();
    x_.segment(f_, f_) = start.u.cast<Real>();
    if (!input_) return;
    const InputDerivatives at_start = input_->derivatives(0, -input_->knots().front());
    x_[2 * f_] = at_start[0];
    x_[2 * f_ + 1] = at_start[1];
  }

  /// The first impacts up to `end`, by steps that end at multiples of h and at impacts. Samples of
  /// an input must be at multiples of h.
  std::vector<Impact> impacts(std::size_t count, Real end, Real h) {
    std::vector<Impact> all;
    Real t = 0;
    for (int k = 1; t < end && all.size() < count; ++k) {
      const Real next = static_cast<Real>(k) * h;
      while (all.size() < count) {
        const Vector to = moved(t, next - t);
        int first = -1;
        Real time = next;
        for (int i = 0; i < static_cast<int>(w_.size()); ++i) {
          if (!(gap(i, next, to) < 0) || !(gap_velocity(i, next, to) < 0)) continue;
          const Real root = t + bisect(i, t, next - t);
          if (root > time) continue;
          time = root;
          first = i;
        }
        if (first < 0) {
          x_ = to;
          t = next;
          break;
        }
        x_ = moved(t, time - t);
        t = time;
        const Vector& w = w_[static_cast<std::size_t>(first)];
        const Vector direction = inverse_ * w;
        x_.segment(f_, f_) -= (1 + Real(contact(first).restitution)) * gap_velocity(first, t, x_) /
                              w.dot(direction) * direction;
        all.push_back({static_cast<double>(t), first});
      }
    }
    return all;
  }

 private:
  // No allocation, because there are millions of steps. x = (q, u, e, e'), e of the sampled input.
  using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1, Eigen::ColMajor, 44, 1>;
  using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, 20, 20>;

  const Contact& contact(int i) const { return model_.contacts[static_cast<std::size_t>(i)]; }

  static Real cosine(const Harmonic& of, Real t) {
    return of.amplitude * std::cos(of.frequency * t + of.phase);
  }

  Real gap(int i, Real t, const Vector& x) const {
    const Contact& of = contact(i);
    return w_[static_cast<std::size_t>(i)].dot(x.head(f_)) + of.clearance + cosine(of.motion, t) +
           of.input_share * x[2 * f_];
  }
  Real gap_velocity(int i, Real t, const Vector& x) const {
    const Contact& of = contact(i);
    return w_[static_cast<std::size_t>(i)].dot(x.segment(f_, f_)) -
           of.motion.amplitude * of.motion.frequency *
               std::sin(of.motion.frequency * t + of.motion.phase) +
           of.input_share * x[2 * f_ + 1];
  }

  // Forces depend on t only; all four slopes of a step take them at three times.
  Vector push(Real t) const {
    const Real a = input_ ? input_->value(static_cast<double>(t)) : 0.0;
    Vector sum = Vector::Zero(2 * f_ + 2);
    for (std::size_t j = 0; j < pushes_.size(); ++j) {
      const Force& force = model_.forces[j];
      sum.segment(f_, f_) +=
          pushes_[j] * (force.constant + cosine(force.harmonic, t) + (force.input ? a : 0));
    }
    sum[2 * f_ + 1] = a;
    return sum;
  }

  Vector rate(const Vector& push, const Vector& x) const {
    Vector of = push;
    of.head(f_) = x.segment(f_, f_);
    of.segment(f_, f_).noalias() -= C_ * x.segment(f_, f_);
    of.segment(f_, f_).noalias() -= K_ * x.head(f_);
    of[2 * f_] = x[2 * f_ + 1];
    return of;
  }

  Vector moved(Real t, Real h) const {
    const Vector middle = push(t + h / 2);
    const Vector k1 = rate(push(t), x_);
    const Vector k2 = rate(middle, x_ + h / 2 * k1);
    const Vector k3 = rate(middle, x_ + h / 2 * k2);
    const Vector k4 = rate(push(t + h), x_ + h * k3);
    return x_ + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  }

  Real bisect(int i, Real t, Real h) const {
    Real low = 0, high = h;
    for (int k = 0; k < 60; ++k) {
      const Real middle = (low + high) / 2;
      (gap(i, t + middle, moved(t, middle)) < 0 ? high : low) = middle;
    }
    return high;
  }

  Model model_;
  Eigen::Index f_;
  Matrix inverse_, C_, K_;
  std::vector<Vector> pushes_, w_;
  SampledInputPointer input_;
  Vector x_;
};

}  // namespace sprag::test
