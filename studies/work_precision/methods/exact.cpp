// The event-driven simulation of this project, master.h: exact flows between events, which are
// located by bounds on the derivatives of the gaps. It has no step and no tolerance.
#include <exception>

#include "sprag/detail/mechanics/master.h"
#include "studies/work_precision/methods/methods.h"

namespace sprag::work_precision {

void run_exact(const Task& task, double /*setting*/, Outcome& outcome) {
  std::vector<ContactEvent> events;
  try {
    Master master(task.model, task.start);
    const auto count = [&] {
      outcome.right_hand_sides = master.expansions();
      outcome.solves = master.impacts();
    };
    try {
      if (task.sample_step > 0.0) {
        for (Eigen::Index k = 0; k < outcome.q.cols(); ++k) {
          const Instant t = at(task.sample_time(k));
          master.advance(t, events);
          master.state(t, outcome.q.col(k), outcome.u.col(k));
        }
      }
      master.advance(at(task.horizon), events);
    } catch (const SimulationError& error) {
      outcome.failure = error.what();
    }
    count();
  } catch (const std::exception& error) {
    outcome.failure = error.what();
  }
  outcome.steps = static_cast<std::int64_t>(events.size());
  for (const ContactEvent& event : events) {
    if (event.kind != ContactEventKind::opens) outcome.impacts.push_back(event.t);
  }
}

}  // namespace sprag::work_precision
