#include "sprag/detail/analysis/accuracy.h"

#include <algorithm>
#include <limits>
#include <numbers>
#include <optional>

#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/replica/replica.h"

namespace sprag {
namespace {

constexpr std::int64_t most_ticks = 50000;
constexpr double samples_per_period = 8.0;
constexpr std::size_t most_events_of_fit = 2000;
constexpr int most_corrected = 30;
constexpr int all_tried = 8;
constexpr int most_static_vectors = 4;  // of a contact

// The observed quantities of the replica of `machine` at each tick while it follows the events.
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

struct Corrected {
  Reduction reduction;
  double change;
};

// The corrected machine of this number of coordinates with the smallest change.
template <typename Change>
std::optional<Corrected> best_corrected(const ModalMachine& machine,
                                        const std::vector<Eigen::Index>& order, int coordinates,
                                        const Followed& followed, const Change& change) {
  std::optional<Corrected> best;
  const auto consider = [&](Reduction reduction) {
    double here = std::numeric_limits<double>::infinity();
    try {
      here = change(reduction.machine);
    } catch (const ModelError&) {  // no flow
    }
    if (!(here < (best ? best->change : std::numeric_limits<double>::infinity()))) return;
    best = Corrected{std::move(reduction), here};
  };
  const int fewest_modes =
      coordinates - most_static_vectors * static_cast<int>(machine.model.contacts.size());
  for (int n = std::max(fewest_modes, 1); n <= coordinates; ++n) {
    const std::vector<Eigen::Index> kept(order.begin(), order.begin() + n);
    if (n == coordinates) {
      if (auto fitted = fitted_restitution(machine, kept, followed)) consider(std::move(*fitted));
      break;
    }
    for (Reduction& reduction : candidates(machine, kept)) {
      if (reduction.machine.model.coordinates() == coordinates) consider(std::move(reduction));
    }
  }
  return best;
}

// The corrected machine within the tolerance with the fewest coordinates below `modes`.
template <typename Change>
std::optional<Corrected> fewest_corrected(const ModalMachine& machine,
                                          const std::vector<Eigen::Index>& order, int modes,
                                          double tolerance, const Followed& followed,
                                          const Change& change) {
  const int most = std::min(modes - 1, most_corrected);
  const auto within = [&](int coordinates) {
    auto best = best_corrected(machine, order, coordinates, followed, change);
    if (best && !(best->change < tolerance)) best.reset();
    return best;
  };
  int failed = 0;
  for (int c = 1; c <= most;) {
    if (auto found = within(c)) {
      for (int fewer = failed + 1; fewer < c; ++fewer) {
        if (auto better = within(fewer)) return better;
      }
      return found;
    }
    failed = c;
    c = c < all_tried || c == most ? c + 1 : std::min(c + c / 2, most);
  }
  return std::nullopt;
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
  const double wanted = result.duration * fastest * samples_per_period / (2.0 * std::numbers::pi);
  const auto ticks =
      static_cast<std::int64_t>(std::clamp(wanted, 1000.0, static_cast<double>(most_ticks)));
  const double tick = result.duration / static_cast<double>(ticks);

  const Eigen::MatrixXd whole = follow(machine, events, tick, ticks);
  result.modes = static_cast<int>(order.size());
  result.changes.push_back({result.modes, 0.0});
  const auto change_of = [&](const ModalMachine& part) {
    return (follow(part, events, tick, ticks) - whole).cwiseAbs().maxCoeff();
  };
  for (int n = result.modes - 1; n >= 1; --n) {
    const double change = change_of(reduced(machine, {order.begin(), order.begin() + n}));
    result.changes.push_back({n, change});
    if (!(change < tolerance)) break;
    result.modes = n;
    result.change = change;
  }
  std::reverse(result.changes.begin(), result.changes.end());

  const Followed followed{
      .events = std::span(events).first(std::min(events.size(), most_events_of_fit)),
      .start = &ModalMachine::master};
  if (auto found = fewest_corrected(machine, order, result.modes, tolerance, followed, change_of)) {
    result.fewest = std::move(found->reduction);
    result.change = found->change;
  } else {
    result.fewest = {.correction = "none",
                     .modes = result.modes,
                     .machine = reduced(machine, {order.begin(), order.begin() + result.modes})};
  }
  return result;
}

}  // namespace sprag
