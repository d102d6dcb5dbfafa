// The master with sampled inputs against an independent integration: Runge-Kutta steps of 1e-6 of
// M u' + C u + K q = f(t) on the same interpolant, and bisection for the impacts.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "sprag/beam.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/sampled_input.h"
#include "tests/support/random.h"

namespace sprag::test {
namespace {

constexpr double reference_step = 1e-6;
constexpr std::size_t most_impacts = 25;

// The machine with its inputs' motion: x = (q, u, e, e').
class ReferenceMachine {
 public:
  ReferenceMachine(const Model& model, const State& start)
      : model_(model), f_(model.coordinates()), inverse_(model.M.inverse()) {
    for (const Force& force : model.forces) {
      if (force.input) input_ = force.input;
    }
    const InputDerivatives at_start = input_->derivatives(0, -input_->knots().front());
    x_.resize(2 * f_ + 2);
    x_ << start.q, start.u, at_start[0], at_start[1];
  }

  // Impact times up to `end`, each of one contact.
  std::vector<std::pair<double, int>> run(double end) {
    std::vector<std::pair<double, int>> impacts;
    double t = 0.0;
    for (std::int64_t k = 1; t < end && impacts.size() < most_impacts; ++k) {
      const double next = static_cast<double>(k) * reference_step;
      while (impacts.size() < most_impacts) {
        const Eigen::VectorXd to = moved(t, next - t);
        int first = -1;
        double time = next;
        for (int i = 0; i < static_cast<int>(model_.contacts.size()); ++i) {
          if (!(gap(i, to) < 0.0) || !(gap_velocity(i, to) < 0.0)) continue;
          const double root = t + bisect(i, t, next - t);
          if (root <= time) {
            time = root;
            first = i;
          }
        }
        if (first < 0) {
          x_ = to;
          t = next;
          break;
        }
        x_ = moved(t, time - t);
        t = time;
        const Contact& contact = model_.contacts[static_cast<std::size_t>(first)];
        const Eigen::VectorXd direction = inverse_ * contact.w;
        x_.segment(f_, f_) -= (1.0 + contact.restitution) * gap_velocity(first, x_) /
                              contact.w.dot(direction) * direction;
        impacts.emplace_back(t, first);
      }
    }
    return impacts;
  }

 private:
  Eigen::VectorXd rate(double t, const Eigen::VectorXd& x) const {
    const double a = input_->value(t);
    Eigen::VectorXd force = -model_.C * x.segment(f_, f_) - model_.K * x.head(f_);
    for (const Force& one : model_.forces) {
      force += one.direction * (one.constant + value(one.harmonic, t) + (one.input ? a : 0.0));
    }
    Eigen::VectorXd of(x.size());
    of << x.segment(f_, f_), inverse_ * force, x[2 * f_ + 1], a;
    return of;
  }

  Eigen::VectorXd moved(double t, double h) const {
    const Eigen::VectorXd k1 = rate(t, x_);
    const Eigen::VectorXd k2 = rate(t + 0.5 * h, x_ + 0.5 * h * k1);
    const Eigen::VectorXd k3 = rate(t + 0.5 * h, x_ + 0.5 * h * k2);
    const Eigen::VectorXd k4 = rate(t + h, x_ + h * k3);
    return x_ + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
  }

  double gap(int i, const Eigen::VectorXd& x) const {
    const Contact& contact = model_.contacts[static_cast<std::size_t>(i)];
    return contact.w.dot(x.head(f_)) + contact.clearance + contact.input_share * x[2 * f_];
  }
  double gap_velocity(int i, const Eigen::VectorXd& x) const {
    const Contact& contact = model_.contacts[static_cast<std::size_t>(i)];
    return contact.w.dot(x.segment(f_, f_)) + contact.input_share * x[2 * f_ + 1];
  }

  double bisect(int i, double t, double h) const {
    double low = 0.0;
    double high = h;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (gap(i, moved(t, middle)) < 0.0 ? high : low) = middle;
    }
    return high;
  }

  Model model_;
  Eigen::Index f_;
  Eigen::MatrixXd inverse_;
  SampledInputPointer input_;
  Eigen::VectorXd x_;
};

// A sweep with some noise, an acceleration.
SampledInputPointer shaken(Interpolation interpolation, double amplitude, double from, double to,
                           double duration, double rate, std::uint64_t seed) {
  Random random(seed);
  std::vector<double> t, a;
  const auto n = static_cast<int>(std::lround(duration * rate)) + 1;
  for (int k = 0; k < n; ++k) {
    const double time = k / rate;
    const double phase =
        2.0 * std::numbers::pi * (from * time + 0.5 * (to - from) / duration * time * time);
    t.push_back(time);
    a.push_back(amplitude * (std::cos(phase) + random.uniform(-0.1, 0.1)));
  }
  return std::make_shared<const SampledInput>(
      t, a, SampledInput::Settings{.interpolation = interpolation});
}

struct SampledMachine {
  std::string name;
  Model model;
  State start;
  double duration;
};

Model shaken_beam(const Beam& beam, const SampledInputPointer& input) {
  Model model = beam_model(beam);
  model.forces.push_back({inertia_direction(beam), 0.0, {}, input});
  return model;
}

Contact beam_stop(const Beam& beam, double x_c, Side side, double clearance, double restitution,
                  const SampledInputPointer& input) {
  Contact contact = beam_contact(beam, x_c, side, clearance, restitution);
  contact.input = input;
  contact.input_share = input ? (side == Side::below ? 1.0 : -1.0) : 0.0;
  return contact;
}

SampledMachine beam_on_ground(Interpolation interpolation) {
  const Beam beam{.modes = 3, .damping = 0.17};
  const auto input = shaken(interpolation, -3.0, 0.7, 3.0, 8.0, 500.0, 11);
  Model model = shaken_beam(beam, input);
  model.contacts = {beam_stop(beam, 0.868, Side::below, 0.0, 0.7, input)};
  return {
      "beam on ground", model, {Eigen::Vector3d(-0.05, 0.0, 0.0), Eigen::Vector3d::Zero()}, 4.0};
}

SampledMachine beam_on_frame(Interpolation interpolation) {
  const Beam beam{.modes = 3, .damping = 0.17};
  const auto input = shaken(interpolation, 5.0, 0.5, 4.0, 8.0, 1000.0, 12);
  Model model = shaken_beam(beam, input);
  model.contacts = {beam_stop(beam, 0.9, Side::below, 0.02, 0.6, nullptr)};
  return {"beam on frame", model, {Eigen::Vector3d(-0.04, 0.0, 0.0), Eigen::Vector3d::Zero()}, 4.0};
}

// A mass between two walls of a shaken box.
SampledMachine rattle(Interpolation interpolation) {
  const auto input = shaken(interpolation, 40.0, 5.0, 12.0, 3.0, 2000.0, 13);
  Model model;
  model.M = Eigen::MatrixXd::Constant(1, 1, 0.3);
  model.C = Eigen::MatrixXd::Constant(1, 1, 0.2);
  model.K = Eigen::MatrixXd::Zero(1, 1);
  model.forces.push_back({Eigen::VectorXd::Constant(1, -0.3), 0.0, {}, input});
  model.contacts.push_back({Eigen::VectorXd::Constant(1, 1.0), 0.02, {}, 0.5});
  model.contacts.push_back({Eigen::VectorXd::Constant(1, -1.0), 0.02, {}, 0.5});
  return {"rattle", model, {Eigen::VectorXd::Zero(1), Eigen::VectorXd::Constant(1, 0.1)}, 1.5};
}

// Two coupled masses with damping that couples the modes, each against a stop of its own.
SampledMachine two_stops(Interpolation interpolation) {
  const auto input = shaken(interpolation, 30.0, 3.0, 15.0, 3.0, 2000.0, 14);
  Model model;
  model.M = Eigen::Vector2d(1.0, 0.5).asDiagonal();
  model.C = (Eigen::Matrix2d() << 3.0, -1.0, -1.0, 1.5).finished();
  model.K = (Eigen::Matrix2d() << 900.0, -400.0, -400.0, 700.0).finished();
  model.forces.push_back({-model.M * Eigen::Vector2d::Ones(), 0.0, {}, input});
  model.forces.push_back({Eigen::Vector2d(1.0, 0.0), 0.5, {2.0, 20.0, 0.3}});
  model.contacts.push_back({Eigen::Vector2d(1.0, 0.0), 0.01, {}, 0.6});
  model.contacts.push_back({Eigen::Vector2d(0.0, -1.0), 0.015, {}, 0.6});
  return {"two stops", model, {Eigen::Vector2d(0.0, 0.0), Eigen::Vector2d(0.2, 0.0)}, 1.5};
}

SampledMachine many_modes(Interpolation interpolation) {
  const Beam beam{.modes = 20, .bending_stiffness = 0.1, .damping = 0.5};
  const auto input = shaken(interpolation, -1.0, 0.5, 4.0, 4.0, 1000.0, 15);
  Model model = shaken_beam(beam, input);
  model.contacts = {beam_stop(beam, 0.8, Side::above, 0.01, 0.5, nullptr)};
  return {"20 modes", model, {Eigen::VectorXd::Zero(20), Eigen::VectorXd::Zero(20)}, 1.5};
}

class SampledMaster : public ::testing::TestWithParam<Interpolation> {};

TEST_P(SampledMaster, FindsTheImpactTimesOfAFineIntegration) {
  for (const SampledMachine& machine :
       {beam_on_ground(GetParam()), beam_on_frame(GetParam()), rattle(GetParam()),
        two_stops(GetParam()), many_modes(GetParam())}) {
    SCOPED_TRACE(machine.name);
    Master master(machine.model, machine.start);
    std::vector<ContactEvent> events;
    master.advance(at(machine.duration), events, most_impacts);
    const auto expected = ReferenceMachine(machine.model, machine.start).run(machine.duration);
    ASSERT_GE(expected.size(), 5U);
    ASSERT_GE(events.size(), expected.size());
    double worst = 0.0;
    std::size_t compared = 0;
    for (std::size_t k = 0; k < expected.size(); ++k) {
      // The reference does not complete chatters.
      if (events[k].kind != ContactEventKind::pulse) break;
      ASSERT_EQ(events[k].contact, expected[k].second) << k;
      ASSERT_NEAR(events[k].t, expected[k].first, 1e-9) << k;
      worst = std::max(worst, std::abs(events[k].t - expected[k].first));
      ++compared;
    }
    EXPECT_GE(compared, 5U);
    std::printf("%s: %zu impacts within %.1e, %ld expansions\n", machine.name.c_str(), compared,
                worst, master.expansions());
  }
}

INSTANTIATE_TEST_SUITE_P(Interpolations, SampledMaster,
                         ::testing::Values(Interpolation::linear, Interpolation::spline),
                         [](const auto& of) {
                           return of.param == Interpolation::linear ? "linear" : "spline";
                         });

}  // namespace
}  // namespace sprag::test
