// bifurcation_cost: cost of the bifurcation diagram of scenes/impact_oscillator by the exact
// event-driven simulation and by RK4 with located events, in one run. Also the errors of RK4's
// points where the motion is periodic.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <vector>

#include "command_line/program.h"
#include "sprag/detail/analysis/recurrence.h"
#include "sprag/scene_file.h"
#include "studies/common/cpu_time.h"
#include "studies/work_precision/methods/methods.h"

namespace {

using sprag::common::cpu_seconds;

constexpr double first_frequency = 16.0, last_frequency = 76.0;  // [rad/s]
constexpr int frequencies = 400, transient = 300, periods = 200;
constexpr std::array steps_per_period{100, 200, 400, 800, 1600};
// In chaos another method soon follows another orbit: points cannot be compared.
constexpr double clearly_stable = -0.5;  // exponent [1/s]

struct Cost {
  double seconds = 0.0;
  std::vector<double> errors;  // of points, over the largest magnitude
};

double share(std::vector<double> values, double of) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(of * static_cast<double>(values.size() - 1))];
}

int compare(nlohmann::ordered_json& report) {
  const sprag::Scene scene = sprag::read_scene(SPRAG_SOURCE_DIR "/scenes/impact_oscillator.toml");
  double exact = 0.0;
  std::array<Cost, steps_per_period.size()> costs;
  int stable = 0;
  for (int i = 0; i < frequencies; ++i) {
    sprag::check_interrupt();
    sprag::Model model = scene.model;
    const double Omega =
        first_frequency + (last_frequency - first_frequency) * i / (frequencies - 1);
    for (sprag::Force& force : model.forces) force.harmonic.frequency = Omega;
    const double T = 2.0 * std::numbers::pi / Omega;
    sprag::RecurrenceSettings settings;
    settings.transient = transient;
    settings.periods = periods;
    double start = cpu_seconds();
    const sprag::Recurrence found = sprag::recurrence(model, scene.truth.start, settings);
    exact += cpu_seconds() - start;
    settings.lyapunov = true;
    const bool counts =
        found.attractor_period > 0 &&
        sprag::recurrence(model, scene.truth.start, settings).lyapunov < clearly_stable;
    stable += counts ? 1 : 0;

    sprag::work_precision::Task task;
    task.model = model;
    task.start = scene.truth.start;
    task.sample_step = T;
    task.horizon = (transient + periods - 1) * T;
    for (std::size_t k = 0; k < costs.size(); ++k) {
      sprag::work_precision::Outcome outcome;
      prepare(task, outcome);
      start = cpu_seconds();
      sprag::work_precision::run_rk4(task, T / steps_per_period[k], outcome);
      costs[k].seconds += cpu_seconds() - start;
      if (!counts) continue;
      const Eigen::VectorXd q = found.points.col(0);
      const double off = (outcome.q.row(0).tail(periods).transpose() - q).cwiseAbs().maxCoeff();
      costs[k].errors.push_back(off / q.cwiseAbs().maxCoeff());
    }
  }

  std::printf("%d frequencies, %d periods of each, %d points; %d motions clearly stable\n\n",
              frequencies, transient + periods, frequencies * periods, stable);
  std::printf(
      "| method | CPU [s] | ratio | error of points: median | of 90 %% |\n|---|---|---|---|---|\n");
  std::printf("| exact | %.3f | 1 | | |\n", exact);
  report["exact"] = exact;
  for (std::size_t k = 0; k < costs.size(); ++k) {
    const Cost& cost = costs[k];
    std::printf("| RK4, %d steps a period | %.2f | %.0f | %.0e | %.0e |\n", steps_per_period[k],
                cost.seconds, cost.seconds / exact, share(cost.errors, 0.5),
                share(cost.errors, 0.9));
    report["rk4"].push_back({{"steps_per_period", steps_per_period[k]},
                             {"seconds", cost.seconds},
                             {"ratio", cost.seconds / exact},
                             {"median_error", share(cost.errors, 0.5)},
                             {"error_of_90_percent", share(cost.errors, 0.9)}});
  }
  return std::fflush(stdout) == 0 ? sprag::exit_done : sprag::exit_failed;
}

}  // namespace

int main(int argc, char** argv) {
  const auto app = sprag::command_line(
      "Compares what a bifurcation diagram costs, exactly and by RK4, in one run.",
      "bifurcation_cost");
  sprag::CommonOptions common;
  sprag::add_common_options(*app, common);
  return sprag::run_program(argc, argv, *app, common, compare);
}
