#include "sprag/analysis/accuracy.h"

#include <algorithm>
#include <numbers>

#include "sprag/analysis/reduction.h"
#include "sprag/estimation/replica.h"
#include "sprag/mechanics/interrupt.h"
#include "sprag/mechanics/master.h"

namespace sprag {
namespace {

constexpr std::int64_t most_ticks = 50000;
constexpr double ticks_per_period = 8.0;

// What the replica of `machine` shows at each tick while it follows the events.
Eigen::MatrixXd follow(const ModalMachine& machine, const std::vector<ContactEvent>& events,
                       double tick, std::int64_t ticks) {
  const Eigen::Index f = machine.model.coordinates();
  Replica replica(machine.model, tick);
  Replica::State state;
  replica.start(machine.master, 0, 0, state);
  Eigen::MatrixXd shown(machine.observed.rows(), ticks + 1);
  Eigen::VectorXd q(f);
  Eigen::VectorXd u(f);
  auto next = events.begin();
  for (std::int64_t k = 0; k <= ticks; ++k) {
    check_interrupt();
    const auto first = next;
    const double t = tick_instant(k, tick).hi;
    while (next != events.end() && next->t <= t) ++next;
    if (k == 0) {
      replica.apply({first, next}, state);
    } else {
      replica.tick({first, next}, state);
    }
    replica.output(state, q, u);
    shown.col(k) = machine.observed * q;
  }
  return shown;
}

}  // namespace

Accuracy find_accuracy(const Scene& scene, double tolerance, double duration,
                       const TrialLimits& limits) {
  const ModalMachine machine = modal_machine(scene);
  Accuracy result;
  result.tolerance = tolerance;
  result.duration = duration;

  Master master(machine.model, machine.master);
  std::vector<ContactEvent> events;
  if (!master.advance(at(duration), events, static_cast<std::size_t>(limits.events))) {
    result.duration = events.back().t;
  }
  const std::vector<Eigen::Index> order = by_frequency(machine);
  const double fastest = std::sqrt(machine.model.K(order.back(), order.back()) /
                                   machine.model.M(order.back(), order.back()));
  const double wanted = result.duration * fastest * ticks_per_period / (2.0 * std::numbers::pi);
  const auto ticks =
      static_cast<std::int64_t>(std::clamp(wanted, 1000.0, static_cast<double>(most_ticks)));
  const double tick = result.duration / static_cast<double>(ticks);

  const Eigen::MatrixXd whole = follow(machine, events, tick, ticks);
  result.modes = static_cast<int>(order.size());
  result.changes.push_back({result.modes, 0.0});
  for (int n = result.modes - 1; n >= 1; --n) {
    const std::vector<Eigen::Index> kept(order.begin(), order.begin() + n);
    const Eigen::MatrixXd shown = follow(reduced(machine, kept), events, tick, ticks);
    const double change = (shown - whole).cwiseAbs().maxCoeff();
    result.changes.push_back({n, change});
    if (!(change < tolerance)) break;
    result.modes = n;
  }
  std::reverse(result.changes.begin(), result.changes.end());
  return result;
}

}  // namespace sprag
