#include "studies/recorded_input/study.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <numbers>
#include <vector>

#include "sprag/beam.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/sampled_input.h"
#include "studies/common/cpu_time.h"

namespace sprag::recorded_input {
namespace {

enum class Given { harmonic, linear, spline, displacement };

constexpr const char* names[] = {"harmonic", "linear", "spline", "displacement"};

// A steel ruler of three modes on a shaker at 40 Hz, against a screw that moves with the shaker.
struct Machine {
  Model model;
  State start;
};

constexpr double amplitude = 1e-3;  // [m]
constexpr double hertz = 40.0;

Machine machine(Given given, double rate, double duration) {
  const Beam beam{.modes = 3,
                  .length = 0.3,
                  .bending_stiffness = 0.35,
                  .mass_per_length = 0.157,
                  .damping = 0.183};
  const double Omega = 2.0 * std::numbers::pi * hertz;
  const Harmonic shake{.amplitude = amplitude, .frequency = Omega, .phase = 0.4};
  Machine of{beam_model(beam, given == Given::harmonic ? shake : Harmonic{}),
             {Eigen::VectorXd::Zero(3), Eigen::VectorXd::Zero(3)}};
  if (given != Given::harmonic) {
    std::vector<double> t, values;
    const Harmonic signal = given == Given::displacement ? shake : second_derivative(shake);
    for (int k = 0; k <= static_cast<int>(duration * rate) + 4; ++k) {
      t.push_back(k / rate);
      values.push_back(value(signal, t.back()));
    }
    of.model.forces.push_back(
        {inertia_direction(beam),
         0.0,
         {},
         std::make_shared<const SampledInput>(
             t, values,
             SampledInput::Settings{.interpolation = given == Given::linear ? Interpolation::linear
                                                                            : Interpolation::spline,
                                    .displacement = given == Given::displacement})});
  }
  of.model.contacts = {beam_contact(beam, 0.28, Side::below, 5e-4, 0.6)};
  of.model.chatter_time = 1e-9;
  return of;
}

struct Run {
  Eigen::VectorXd q, u;
  std::vector<ContactEvent> events;
  double cpu = 0.0;
  long expansions = 0;
};

// The least CPU time of several runs. The first one builds the flows, which the others share.
Run run(const Machine& of, const Flows& flows, double duration, int repeats) {
  Run result{Eigen::VectorXd(3), Eigen::VectorXd(3), {}};
  for (int i = 0; i < repeats; ++i) {
    result.events.clear();
    Master master(flows, of.start, 0.0, 0);
    const double begin = common::cpu_seconds();
    master.advance(at(duration), result.events);
    const double cpu = common::cpu_seconds() - begin;
    result.cpu = i == 0 ? cpu : std::min(result.cpu, cpu);
    master.state(at(duration), result.q, result.u);
    result.expansions = master.expansions();
  }
  return result;
}

}  // namespace

void convergence() {
  constexpr double duration = 0.1;
  const Machine harmonic = machine(Given::harmonic, 0.0, duration);
  const Run exact = run(harmonic, Flows(harmonic.model), duration, 50);
  std::printf("interpolation,rate,samples_per_period,error_of_u,error_of_times,cpu_s\n");
  std::printf("harmonic,0,0,0,0,%.3g\n", exact.cpu);
  for (const Given given : {Given::linear, Given::spline, Given::displacement}) {
    for (const double rate : {1000.0, 2000.0, 5000.0, 10000.0}) {
      const Machine of = machine(given, rate, duration);
      const Run sampled = run(of, Flows(of.model), duration, 50);
      double times = 0.0;
      for (std::size_t k = 0; k < std::min(exact.events.size(), sampled.events.size()); ++k) {
        times = std::max(times, std::abs(exact.events[k].t - sampled.events[k].t));
      }
      if (exact.events.size() != sampled.events.size()) times = std::nan("");
      std::printf("%s,%g,%g,%.4g,%.4g,%.3g\n", names[static_cast<int>(given)], rate, rate / hertz,
                  (sampled.u - exact.u).norm() / exact.u.norm(), times, sampled.cpu);
    }
  }
}

void speed() {
  constexpr double duration = 10.0;
  const Machine harmonic = machine(Given::harmonic, 0.0, duration);
  const Machine linear = machine(Given::linear, 2000.0, duration);
  const Machine spline = machine(Given::spline, 2000.0, duration);
  double cpu[3] = {1e9, 1e9, 1e9};
  const Flows flows[3] = {Flows(harmonic.model), Flows(linear.model), Flows(spline.model)};
  std::size_t impacts[3] = {};
  long expansions[3] = {};
  for (int i = 0; i < 15; ++i) {
    int k = 0;
    for (const Machine* of : {&harmonic, &linear, &spline}) {
      const Run one = run(*of, flows[k], duration, 1);
      cpu[k] = std::min(cpu[k], one.cpu);
      expansions[k] = one.expansions;
      impacts[k++] = one.events.size();
    }
  }
  for (int k = 0; k < 3; ++k) {
    std::printf("%-9s %8.1f us per unit of time, %5zu events, %7ld expansions, %.2f times\n",
                names[k], 1e6 * cpu[k] / duration, impacts[k], expansions[k], cpu[k] / cpu[0]);
  }
}

}  // namespace sprag::recorded_input
