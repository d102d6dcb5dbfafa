// Boost.Odeint's Dormand-Prince 5(4) with dense output, restarted at events (event_loop.h).
#include "studies/work_precision/methods/dormand_prince.h"
#include "studies/work_precision/methods/event_loop.h"
#include "studies/work_precision/methods/methods.h"

namespace sprag::work_precision {

void run_odeint(const Task& task, double tolerance, Outcome& outcome) try {
  ContactPhases phases(task, outcome);
  with_state(phases.f(), [&](auto state) {
    const auto rate = [&phases](double t, const double* x, double* x_dot) {
      phases.derivative(t, x, x_dot);
    };
    DormandPrince<decltype(state), decltype(rate)> integrator(state.size(), tolerance, rate);
    run_events(task, phases, integrator, outcome);
  });
} catch (const std::exception& error) {
  outcome.failure = error.what();
}

}  // namespace sprag::work_precision
