#include "studies/identification/trial.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numbers>

#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/parameters/scene_with.h"
#include "studies/common/random.h"

namespace sprag::identification_study {
namespace {

using Kind = Unknown::Kind;
using common::Random;

void limit(const Unknown& unknown, double& value) {
  if (unknown.upper_limit > 0.0) value = std::min(value, 0.99 * unknown.upper_limit);
}

// Another machine of the family, with enough impacts and without sustained contacts.
std::optional<std::pair<Scene, std::vector<ContactEvent>>> other_machine(const Scene& scene,
                                                                         const Trial& trial,
                                                                         Random& draw) {
  const std::vector<Unknown> all = unknowns_named(scene, usual_keys(scene));
  const MachineFamily family(scene, all);
  Eigen::VectorXd values = family.nominal();
  for (std::size_t k = 0; trial.machine_off > 0.0 && k < all.size(); ++k) {
    double& value = values[static_cast<Eigen::Index>(k)];
    if (all[k].kind == Kind::phase) {
      value = draw.uniform(-std::numbers::pi, std::numbers::pi);
    } else if (all[k].kind == Kind::clearance && !family.groups().empty()) {
      value += draw.uniform(-0.3, 0.3) * family.groups()[0].amplitude;
    } else {
      value *= 1.0 + draw.uniform(-1.0, 1.0) * trial.machine_off;
      limit(all[k], value);
    }
  }
  Scene machine = with(scene, all, values);
  for (const Contact& contact : machine.model.contacts) {
    if (gap(contact, machine.truth.start.q, 0.0) < 0.0) return std::nullopt;
  }
  Master master(machine.model, machine.truth.start);
  std::vector<ContactEvent> events;
  const auto wanted = static_cast<std::size_t>(trial.impacts);
  master.advance(at(1e5), events, wanted);
  if (events.size() < wanted) return std::nullopt;
  events.resize(wanted);
  const bool held = std::any_of(events.begin(), events.end(), [](const ContactEvent& event) {
    return event.kind != ContactEventKind::pulse;
  });
  if (held && trial.machine_off > 0.0) return std::nullopt;
  return std::pair{std::move(machine), std::move(events)};
}

}  // namespace

std::vector<std::string> usual_keys(const Scene& scene) {
  std::vector<std::string> keys;
  const std::vector<Unknown> all = unknowns_of(scene);
  const bool one = all.front().key == "impact.restitution";
  for (const Unknown& unknown : all) {
    const bool of_contact = unknown.kind == Kind::restitution && unknown.index >= 0;
    if (unknown.kind == Kind::amplitude || unknown.kind == Kind::constant) continue;
    if (one && of_contact) continue;
    keys.push_back(unknown.key);
  }
  return keys;
}

bool Outcome::right(const Trial& trial) const {
  if (!accepted()) return false;
  return trial.jitter > 0.0 ? worst_sigmas < 6.0 : worst < 1e-9;
}

double error_of(const Unknown& unknown, double value, double truth) {
  const double error = unknown.coordinate(value) - unknown.coordinate(truth);
  return unknown.kind == Kind::phase ? std::remainder(error, 2.0 * std::numbers::pi) : error;
}

std::optional<Question> question(const Scene& scene, const Trial& trial, std::uint64_t seed) {
  Random draw(seed);
  auto drawn = other_machine(scene, trial, draw);
  for (int again = 0; !drawn && again < 1000; ++again) drawn = other_machine(scene, trial, draw);
  if (!drawn) return std::nullopt;
  Question asked;
  const Scene& machine = drawn->first;
  std::vector<ContactEvent>& events = asked.events;
  const double end = drawn->second.back().t;
  // Each contact's reports keep their order.
  std::vector<double> last(scene.model.contacts.size());
  for (ContactEvent event : drawn->second) {
    if (draw.uniform() < trial.lost) {
      ++asked.events_lost;
      continue;
    }
    double& before = last[static_cast<std::size_t>(event.contact)];
    before = event.t = std::max(before, event.t + trial.jitter * draw.normal());
    events.push_back(event);
  }
  for (int i = 0; i < trial.impacts; ++i) {
    if (!(draw.uniform() < trial.spurious)) continue;
    ++asked.events_spurious;
    events.push_back({draw.uniform(0.0, end), 0, ContactEventKind::pulse});
  }
  std::stable_sort(events.begin(), events.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });

  const std::vector<std::string> keys = trial.keys.empty() ? usual_keys(machine) : trial.keys;
  const MachineFamily of_machine(machine, unknowns_named(machine, keys));
  asked.truth = of_machine.nominal();
  Eigen::VectorXd wrong = asked.truth;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    double& value = wrong[static_cast<Eigen::Index>(k)];
    if (of_machine.unknowns()[k].linear()) {
      // Phases and clearances need no initial guess.
      value += of_machine.unknowns()[k].unit_step;
      continue;
    }
    const bool damping = of_machine.unknowns()[k].kind == Kind::damping;
    const double off = damping && trial.damping_off > 0.0 ? trial.damping_off : trial.off;
    const double sign = draw.uniform() < 0.5 ? -1.0 : 1.0;
    // The machine deviates from the scene by a share of the scene's value, as Unknown::within.
    value /= 1.0 + sign * draw.uniform(0.5, 1.0) * off;
    limit(of_machine.unknowns()[k], value);
  }
  asked.nominal = with(machine, of_machine.unknowns(), wrong);
  const Scene& nominal = asked.nominal;
  IdentificationSettings& settings = asked.settings;
  settings.unknowns = unknowns_named(nominal, keys);
  for (std::size_t k = 0; k < keys.size(); ++k) {
    settings.unknowns[k].within = trial.within.value_or(trial.off);
    if (settings.unknowns[k].kind == Kind::damping && trial.damping_off > 0.0) {
      settings.unknowns[k].within = 2.0 * trial.damping_off;
    }
    // The unknown is a factor on the scene's own matrix; its true value makes the scene's matrix
    // the machine's.
    const auto i = static_cast<Eigen::Index>(k);
    const bool factor = keys[k] == "system.K" || keys[k] == "system.C";
    if (factor) asked.truth[i] /= wrong[i];
    // The unknown is a shift of all phases of a general system.
    if (!nominal.beam && keys[k] == "excitation.phase") asked.truth[i] -= wrong[i];
  }
  if (trial.jitter_given) settings.jitter = trial.jitter;
  return asked;
}

Outcome run(const Scene& scene, const Trial& trial, std::uint64_t seed) {
  Outcome outcome;
  const std::optional<Question> asked = question(scene, trial, seed);
  if (!asked) {
    outcome.too_few = true;
    return outcome;
  }
  outcome.truth = asked->truth;
  outcome.events_lost = asked->events_lost;
  outcome.events_spurious = asked->events_spurious;
  const std::clock_t begin = std::clock();
  try {
    outcome.found = identify(asked->nominal, asked->events, asked->settings);
  } catch (const TooFewImpacts&) {
    outcome.too_few = true;
    return outcome;
  }
  outcome.seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  for (std::size_t k = 0; k < outcome.found.unknowns.size(); ++k) {
    const FittedUnknown& fitted = outcome.found.unknowns[k];
    const double error =
        error_of(fitted.unknown, fitted.value, outcome.truth[static_cast<Eigen::Index>(k)]);
    const double sigma = fitted.sigma / std::abs(fitted.unknown.slope(fitted.value));
    outcome.worst = std::max(outcome.worst, std::abs(error));
    outcome.worst_sigmas = std::max(outcome.worst_sigmas, std::abs(error) / sigma);
    if (std::abs(error) < 1.96 * sigma) ++outcome.inside_95;
    ++outcome.values;
  }
  return outcome;
}

}  // namespace sprag::identification_study
