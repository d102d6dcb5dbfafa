#include "sprag/detail/analysis/reduction_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/error.h"

namespace sprag {
namespace {

using Eigen::Index;

constexpr int least_closings = 8;
constexpr double strongly_damped = 0.05;
constexpr std::size_t most_modes_of_fit = 10;
// Omitted modes take part of the impulse; in all cases seen, at most half of it.
constexpr double least_share = 0.5;
constexpr double largest_tried_share = 1.0;
constexpr int tried_shares = 20;  // number of intervals of the grid search
constexpr double share_is_close = 1e-4;

const std::array<std::vector<int>, 4> sets{{{0}, {0, 1}, {1, 2, 3}, {0, 1, 2, 3}}};

bool has_closings(std::span<const ContactEvent> events) {
  return std::any_of(events.begin(), events.end(), [](const ContactEvent& event) {
    return event.kind != ContactEventKind::opens;
  });
}

bool sees_every_contact(const Model& model) {
  return std::all_of(model.contacts.begin(), model.contacts.end(),
                     [](const Contact& contact) { return contact.w.squaredNorm() > 0.0; });
}

// The smallest damping ratio of the omitted modes; infinity if there are none.
double least_zeta_left_out(const ModalMachine& machine, const std::vector<Index>& kept) {
  const Model& model = machine.model;
  double least = infinity;
  for (Index k = 0; k < model.coordinates(); ++k) {
    if (std::find(kept.begin(), kept.end(), k) != kept.end()) continue;
    const double critical = 2.0 * std::sqrt(model.K(k, k) * model.M(k, k));
    least = std::min(least, critical > 0.0 ? model.C(k, k) / critical : 0.0);
  }
  return least;
}

std::string name_of(const std::vector<int>& orders, double least_zeta) {
  std::string name;
  for (const int j : orders) name += (name.empty() ? "b_" : ", b_") + std::to_string(j);
  if (least_zeta > 0.0) name += ", damping >= 5 %";
  return name;
}

Reduction with_share(const ModalMachine& machine, const std::vector<Index>& kept, double x) {
  Reduction result;
  result.modes = static_cast<int>(kept.size());
  result.share = x;
  result.machine = reduced(machine, kept);
  set_impulse_share(x, result.machine.model);
  result.correction = "restitution";
  for (const Contact& contact : result.machine.model.contacts) {
    char text[32];
    std::snprintf(text, sizeof text, " %.4g", *contact.replica_restitution);
    if (!result.correction.ends_with(text)) result.correction += text;
  }
  return result;
}

}  // namespace

Followed second_half(std::span<const ContactEvent> events, double begins, ContactSet closed) {
  Followed followed{.events = events, .begins = begins, .closed = closed};
  if (!events.empty()) followed.counts = 0.5 * (begins + events.back().t);
  if (const int count = closings(followed); count < least_closings) {
    throw Error("contacts close at " + std::to_string(count) +
                " instants in the second half of the events; at least " +
                std::to_string(least_closings) + " are needed");
  }
  return followed;
}

int closings(const Followed& followed) {
  int count = 0;
  for_each_instant(followed.events, [&](std::span<const ContactEvent> of_one) {
    if (of_one.front().t >= followed.counts && has_closings(of_one)) ++count;
  });
  return count;
}

double rms_gap(const ModalMachine& machine, const Followed& followed) {
  // The tick ends after all events, so only the instants of the events are evaluated.
  const bool from_zero = !(followed.begins > 0.0);
  double squares = 0.0;
  double weights = 0.0;
  double last = followed.begins;
  try {
    Replica replica(machine.model, from_zero ? 1.0 : followed.begins);
    Replica::State state;
    replica.start(machine.*followed.start, from_zero ? 0 : 1, followed.closed, state);
    replica.open_tick(state);
    for_each_instant(followed.events, [&](std::span<const ContactEvent> of_one) {
      check_interrupt();
      replica.take(of_one, state);
      if (!has_closings(of_one)) return;
      const double t = of_one.front().t;
      const double weight = t - last;
      last = t;
      if (t < followed.counts) return;
      squares += weight * square(state.innovation.gap);
      weights += weight;
    });
  } catch (const ModelError&) {
    return infinity;
  }
  const double rms = std::sqrt(squares / weights);
  return std::isfinite(rms) ? rms : infinity;
}

std::vector<Reduction> candidates(const ModalMachine& machine, const std::vector<Index>& kept) {
  const Index f = machine.model.coordinates();
  std::vector<Reduction> found;
  const auto add = [&](Reduction reduction) {
    reduction.modes = static_cast<int>(kept.size());
    if (sees_every_contact(reduction.machine.model)) found.push_back(std::move(reduction));
  };
  add({.correction = "none", .machine = reduced(machine, kept)});
  bool complete = static_cast<Index>(kept.size()) == f;
  for (const std::vector<int>& orders : sets) {
    if (complete) break;
    try {
      ModalMachine part = with_static_vectors(machine, kept, orders);
      complete = part.model.coordinates() == f;
      const Eigen::MatrixXd C = part.model.C;
      add({.correction = name_of(orders, 0.0),
           .static_vectors = orders,
           .machine = std::move(part)});
      if (complete) break;
      part = with_static_vectors(machine, kept, orders, strongly_damped);
      if (part.model.C == C) continue;
      add({.correction = name_of(orders, strongly_damped),
           .static_vectors = orders,
           .least_zeta = strongly_damped,
           .machine = std::move(part)});
    } catch (const ModelError&) {  // no static vector for a motion without stiffness
    }
  }
  return found;
}

std::optional<Reduction> fitted_restitution(const ModalMachine& machine,
                                            const std::vector<Index>& kept,
                                            const Followed& followed) {
  if (kept.size() > most_modes_of_fit || !(least_zeta_left_out(machine, kept) < strongly_damped) ||
      !sees_every_contact(reduced(machine, kept).model)) {
    return std::nullopt;
  }
  const auto rms = [&](double x) {
    return rms_gap(with_share(machine, kept, x).machine, followed);
  };
  double best = largest_tried_share;
  double least = infinity;
  const double step = (largest_tried_share - least_share) / tried_shares;
  for (int i = 0; i <= tried_shares; ++i) {
    const double x = least_share + step * i;
    const double value = rms(x);
    if (value < least) {
      least = value;
      best = x;
    }
  }
  if (!std::isfinite(least)) return std::nullopt;
  // Golden section search around the best grid point.
  constexpr double golden = 0.6180339887498949;
  double low = std::max(best - step, least_share);
  double high = std::min(best + step, largest_tried_share);
  double left = high - golden * (high - low);
  double right = low + golden * (high - low);
  double of_left = rms(left);
  double of_right = rms(right);
  while (high - low > share_is_close) {
    if (of_left < of_right) {
      high = right;
      right = left;
      of_right = of_left;
      left = high - golden * (high - low);
      of_left = rms(left);
    } else {
      low = left;
      left = right;
      of_left = of_right;
      right = low + golden * (high - low);
      of_right = rms(right);
    }
  }
  for (const auto& [x, value] : {std::pair(left, of_left), std::pair(right, of_right)}) {
    if (!(value < least)) continue;
    least = value;
    best = x;
  }
  Reduction result = with_share(machine, kept, best);
  result.rms = least;
  return result;
}

std::string description(const Scene& scene, const Reduction& reduction) {
  const Index n = reduction.modes;
  const Index f = reduction.machine.model.coordinates();
  const auto coordinates = [](Index from, Index to) {
    std::string range = "q_" + std::to_string(from);
    return to > from ? range + " .. q_" + std::to_string(to) : range;
  };
  std::string text = coordinates(1, n) + ": the first of " +
                     std::to_string(scene.model.coordinates()) + " modes, by frequency";
  if (f > n) text += "\n" + coordinates(n + 1, f) + ": static vectors, " + reduction.correction;
  if (!scene.beam) return text;
  text += "\ntip:";
  for (Index i = 0; i < f; ++i) {
    char term[48];
    std::snprintf(term, sizeof term, " %+.17g q_%d", reduction.machine.observed(0, i),
                  static_cast<int>(i) + 1);
    text += term;
  }
  return text;
}

std::vector<Reduction> reductions(const ModalMachine& machine, const std::vector<Index>& kept,
                                  const Followed& followed) {
  std::vector<Reduction> found = candidates(machine, kept);
  for (Reduction& reduction : found) reduction.rms = rms_gap(reduction.machine, followed);
  if (auto fitted = fitted_restitution(machine, kept, followed)) {
    found.push_back(std::move(*fitted));
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Reduction& a, const Reduction& b) { return a.rms < b.rms; });
  return found;
}

}  // namespace sprag
