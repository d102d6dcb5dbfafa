#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "python/src/arrays.h"
#include "python/src/bindings.h"
#include "python/src/long_call.h"
#include "python/src/members.h"
#include "python/src/settings.h"
#include "sprag/detail/analysis/assessment.h"
#include "sprag/detail/analysis/guaranteed_widths.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/text/parameters_text.h"
#include "sprag/detail/text/printable.h"
#include "sprag/energy.h"
#include "sprag/events_file.h"
#include "sprag/observer.h"
#include "sprag/simulate.h"

namespace sprag::python {
namespace {

using Table = py::array_t<double, py::array::c_style | py::array::forcecast>;

// In Python contacts count from 1.
Simulation run_master(const Scene& scene, double duration, double tick) {
  Simulation run = simulate(scene.model, scene.truth.start, duration, tick);
  for (ContactEvent& event : run.events) ++event.contact;
  return run;
}

std::int64_t skipped(const EventCounts& counts) {
  return std::accumulate(counts.skipped.begin(), counts.skipped.end(), std::int64_t{0});
}

// An observer that several threads may share: a mutex serializes its calls.
class SharedObserver {
 public:
  SharedObserver(const Scene& scene, const ObserverSettings& settings)
      : contacts_(scene.model.contacts.size()),
        observer_(long_call([&] { return Observer(scene, settings); })) {}

  bool take(double t, int contact, int kind) {
    const ContactEvent event = to_event(t, contact, kind, contacts_);
    return locked(mutex_, [&] { return observer_.take(event); });
  }
  void set_horizon(double t) {
    locked(mutex_, [&] { observer_.set_horizon(t); });
  }
  std::vector<Estimate> settle() {
    const InterruptRelay relay;
    std::vector<Estimate> estimates = locked(mutex_, [&] {
      for (Estimate& estimate : observer_.settle(relay.token())) {
        unreturned_.push_back(std::move(estimate));
      }
      if (relay.token().stop_requested()) return std::vector<Estimate>();
      return std::exchange(unreturned_, {});
    });
    if (relay.token().stop_requested()) raise_interrupt();
    return estimates;
  }
  Estimate at(double t) {
    const InterruptRelay relay;
    try {
      return locked(mutex_, [&] { return observer_.at(t, relay.token()); });
    } catch (const Interrupted&) {
      raise_interrupt();
    }
  }
  double tick() const { return observer_.tick(); }
  EventCounts counts() {
    return locked(mutex_, [&] { return observer_.counts(); });
  }

 private:
  std::size_t contacts_;
  std::mutex mutex_;
  Observer observer_;
  std::vector<Estimate> unreturned_;  // settled by calls that Ctrl-C has ended
};

// Number of skipped events by the reason, in the words of Skip.
std::map<std::string, std::int64_t> skipped_by_reason(const EventCounts& counts) {
  return {{"backwards", counts.of(Skip::backwards)},
          {"beyond_horizon", counts.of(Skip::beyond_horizon)},
          {"unknown_contact", counts.of(Skip::unknown_contact)},
          {"contradicting", counts.of(Skip::contradicting)}};
}

py::array events_of_file(const std::filesystem::path& path, const Scene& scene) {
  const std::string file = path.string();
  EventsFile recorded = read_events(path, static_cast<int>(scene.model.contacts.size()));
  if (recorded.damage) recorded.skipped.push_back(*recorded.damage);
  for (const FileProblem& problem : recorded.skipped) {
    warn(file + ":" + std::to_string(problem.line) + ": " + problem.what);
  }
  if (const std::size_t before = to_machine_time(scene.clock, recorded); before > 0) {
    warn(file + ": " + std::to_string(before) + (before == 1 ? " event" : " events") +
         " before the machine's t = 0, by clock.offset, left out");
  }
  return owned(std::move(recorded.events));
}

void bind_simulation(py::module_& module) {
  module.def("read_events", &events_of_file, "file"_a, "scene"_a,
             "The contact events of an events CSV, as an array of event_dtype. Their times are the "
             "machine's, by the scene's [clock]. Rows that contradict the rest are left out, "
             "nothing after damage is used: a RuntimeWarning reports both. Raises InputError.");

  value_class<Simulation>(module, "Simulation",
                          "A machine's run. All arrays are read-only views; row k is tick k.")
      .get("events", "Contact events in order: entries of event_dtype.", &Simulation::events)
      .get("t", "Times k h [s], n entries.", &Simulation::t)
      .get("q", "Coordinates, n x f.", &Simulation::q)
      .get("u", "Velocities, n x f, those after an impact at a tick.", &Simulation::u);

  module.def(
      "simulate",
      [](const Scene& scene, double duration, double tick) {
        return long_call([&] { return run_master(scene, duration, tick); });
      },
      "scene"_a, "duration"_a, py::kw_only(), "tick"_a = 0.01,
      "The machine from its start at t = 0 up to duration [s], with its states at every tick [s]; "
      "no states where tick is 0. Raises ModelError, SimulationError or ValueError.");
}

void bind_inconsistency(py::module_& module) {
  value_class<Inconsistency>(module, "Inconsistency", "An event that the filter has refused.")
      .get("t", "[s]", &Inconsistency::t)
      .get("contact", "From 1.", [](const Inconsistency& of) { return of.contact + 1; })
      .get("reason",
           "Likely cause: 'model' (model, uncertainty or event times are wrong), 'spurious event' "
           "or 'missing event'.",
           &Inconsistency::suspicion, [](Suspicion of) { return name(of); })
      .get("square", "Normalized innovation squared.", &Inconsistency::square);
}

void bind_estimates(py::module_& module) {
  value_class<Estimates>(module, "Estimates",
                         "An observer's estimates of many ticks. All arrays are read-only views; "
                         "row k is tick k. Sigmas have no columns without a timing filter.")
      .get("t", "Times k h [s], n entries.", &Estimates::t)
      .get("q", "Coordinates, n x f.", &Estimates::q)
      .get("u", "Velocities, n x f.", &Estimates::u)
      .get("sigma_q", "Standard deviations of q, n x f; inf where unknown.", &Estimates::sigma_q)
      .get("sigma_u", "Standard deviations of u, n x f.", &Estimates::sigma_u)
      .get("sigma_gap", "Standard deviations of the gaps [m], n x m.", &Estimates::sigma_gap)
      .get("outputs", "The scene's outputs, n x as many.", &Estimates::outputs)
      .get("sigma_outputs", "Their standard deviations; inf where unknown.",
           &Estimates::sigma_outputs)
      .get("bound",
           "B of a states CSV: the replica's V is at most this, n entries [energy]; inf where "
           "nothing guarantees it.",
           &Estimates::bound)
      .get("bound_q",
           "Guaranteed half-widths about q, n x f; no columns where the scene has no tolerances.",
           &Estimates::bound_q)
      .get("bound_gap", "The same of the gaps [m], n x m.", &Estimates::bound_gap)
      .get("bound_outputs", "The same of the scene's outputs.", &Estimates::bound_outputs)
      .get("from_filter", "Whether q and u are the timing filter's, n entries; else the replica's.",
           &Estimates::of_filter)
      .get("penetrating",
           "Whether q lies inside a support, where the machine cannot be, n entries.",
           &Estimates::penetrating)
      .get("keys",
           "Of an adaptive observer: the parameters that it seeks, as the scene file names them, P "
           "of them.",
           &Estimates::keys)
      .get("parameters", "Their values, n x P; the scene's own until they are found.",
           &Estimates::parameters)
      .get("sigma_parameters", "Their standard deviations, n x P; inf until they are found.",
           &Estimates::sigma_parameters)
      .get("taken", "Number of accepted events.", &Estimates::counts, &EventCounts::events)
      .get("skipped", "Number of events that contradicted earlier ones and were skipped.",
           &Estimates::counts, &skipped)
      .get("skipped_by_reason",
           "The same by reason: 'backwards', 'beyond_horizon', 'unknown_contact', 'contradicting'.",
           &Estimates::counts, &skipped_by_reason)
      .get("inconsistencies",
           "Events that the filter refused, in order of time: a list of Inconsistency. Of several "
           "between two ticks the last one.",
           &Estimates::inconsistencies);

  module.def(
      "observe",
      [](const Scene& scene, const py::object& events, double duration, double tick,
         const std::string& estimator) {
        const auto taken = to_events(events, scene.model.contacts.size());
        const ObserverSettings settings = to_settings(tick, estimator);
        return long_call([&] { return observe(scene, taken, duration, settings); });
      },
      "scene"_a, "events"_a, "duration"_a, py::kw_only(), "tick"_a = 0.01, "estimator"_a = "both",
      "Estimates from recorded events up to duration [s], at every tick [s]. events: an array of "
      "event_dtype, or (t, contact, kind) each, in any order. estimator: \"both\", \"timing\", "
      "\"replica\" or \"adaptive\". Raises ModelError or ValueError.");
}

void bind_estimate(py::module_& module) {
  value_class<Estimate>(module, "Estimate",
                        "An observer's estimate of one tick. All arrays are read-only views.")
      .get("tick", "Number of the tick, from 0.", &Estimate::tick)
      .get("t", "tick h [s].", &Estimate::t)
      .get("q", "Coordinates, f entries.", &Estimate::q)
      .get("u", "Velocities, f entries.", &Estimate::u)
      .get("closed", "The contacts that are closed, from 1.", &Estimate::closed, &contacts_of)
      .get("settled", "Whether it is final.", &Estimate::settled)
      .get("from_filter", "Whether q and u are the timing filter's; else the replica's.",
           &Estimate::of_filter)
      .get("penetrating", "Whether q lies inside a support, where the machine cannot be.",
           &Estimate::penetrating)
      .get("sigma_q", "Standard deviations of q, f entries; none without a timing filter.",
           &Estimate::sigma_q)
      .get("sigma_u", "Standard deviations of u, f entries.", &Estimate::sigma_u)
      .get("sigma_gap", "Standard deviations of the gaps [m], m entries.", &Estimate::sigma_gap)
      .get("outputs", "The scene's outputs, one entry each.", &Estimate::outputs)
      .get("sigma_outputs", "Their standard deviations.", &Estimate::sigma_outputs)
      .get("bound", "B of a states CSV: the replica's V is at most this; inf where unproven.",
           &Estimate::bound)
      .get("bound_q",
           "Guaranteed half-widths about q, f entries; none where the scene has no tolerances.",
           &Estimate::bound_q)
      .get("bound_gap", "The same of the gaps [m], m entries.", &Estimate::bound_gap)
      .get("bound_outputs", "The same of the scene's outputs.", &Estimate::bound_outputs)
      .get("parameters",
           "Of an adaptive observer: (value, standard deviation) of each parameter that it seeks, "
           "by its key in the scene file; inf where it is the scene's. Else empty.",
           [](const Estimate& estimate) {
             std::map<std::string, std::pair<double, double>> found;
             for (std::size_t k = 0;
                  estimate.parameters.any() && k < estimate.parameters.keys->size(); ++k) {
               const auto i = static_cast<Eigen::Index>(k);
               found[(*estimate.parameters.keys)[k]] = {estimate.parameters.values[i],
                                                        estimate.parameters.sigmas[i]};
             }
             return found;
           })
      .get("inconsistencies", "Number of events so far that the filter has refused.",
           &Estimate::inconsistencies)
      .get("inconsistency", "The last of them; None: none.",
           [](const Estimate& estimate) -> std::optional<Inconsistency> {
             if (estimate.inconsistencies == 0) return std::nullopt;
             return estimate.last;
           });
}

void bind_observer(py::module_& module) {
  ValueClass<SharedObserver>(
      module, "Observer",
      "Takes contact events in any order and late, gives settled estimates in order and the "
      "estimate at any time. Threads may share one: calls wait for each other.")
      .def(py::init([](const Scene& scene, double tick, const std::string& estimator) {
             return std::make_unique<SharedObserver>(scene, to_settings(tick, estimator));
           }),
           "scene"_a, py::kw_only(), "tick"_a = 0.01, "estimator"_a = "both")
      .def("take", &SharedObserver::take, "t"_a, "contact"_a = 1,
           "kind"_a = static_cast<int>(ContactEventKind::pulse),
           "Takes an event at t [s] of a contact, from 1, of a ContactEventKind. False if it is "
           "refused: it is not after the horizon.")
      .def("set_horizon", &SharedObserver::set_horizon, "t"_a,
           "Every event up to t [s] has been taken; never goes back.")
      .def("settle", &SharedObserver::settle,
           "The estimates up to the horizon that were not handed out yet, in order.")
      .def("at", &SharedObserver::at, "t"_a,
           "The estimate at the last tick at or before t [s], provisional. Raises ValueError "
           "before the last settled tick.")
      .get("tick", "h [s].", &SharedObserver::tick)
      .get("taken", "How many events counted so far, of those up to the horizon.",
           [](SharedObserver& observer) { return observer.counts().events; })
      .get("skipped", "How many were refused or contradicted those before them.",
           [](SharedObserver& observer) { return skipped(observer.counts()); })
      .get("skipped_by_reason", "The same by reason, as in Estimates.",
           [](SharedObserver& observer) { return skipped_by_reason(observer.counts()); });
}

struct Energies {
  Eigen::VectorXd V;
  Rows V_i;
};
SPRAG_MEMBERS(Energies, V, V_i)

// One state counts as one row.
Eigen::Map<const Rows> rows_of(const char* name, const Table& table) {
  if (table.ndim() != 1 && table.ndim() != 2) {
    throw std::invalid_argument(std::string(name) + " must have one dimension or two");
  }
  return {table.data(), table.ndim() == 1 ? 1 : table.shape(0), table.shape(table.ndim() - 1)};
}

// q_m and u_m: n x f; q and u: n rows, f columns or fewer.
Energies energies_of(const Scene& scene, const Table& of_q_m, const Table& of_u_m,
                     const Table& of_q, const Table& of_u) {
  const auto q_m = rows_of("q_m", of_q_m), u_m = rows_of("u_m", of_u_m), q = rows_of("q", of_q),
             u = rows_of("u", of_u);
  const Eigen::Index f = scene.model.coordinates(), n = q_m.rows();
  if (q_m.cols() != f || u_m.cols() != f) {
    throw std::invalid_argument("q_m and u_m must have " + std::to_string(f) + " columns");
  }
  if (q.cols() > f || u.cols() > f) {
    throw std::invalid_argument("q and u must have at most " + std::to_string(f) + " columns");
  }
  if (u_m.rows() != n || q.rows() != n || u.rows() != n) {
    throw std::invalid_argument("q_m, u_m, q and u must have as many rows");
  }
  return long_call([&] {
    const ErrorEnergy energy(scene.model);
    Energies all{Eigen::VectorXd(n), Rows(n, f)};
    for (Eigen::Index k = 0; k < n; ++k) {
      const Eigen::VectorXd of_tick = energy(q_m.row(k).transpose(), u_m.row(k).transpose(),
                                             q.row(k).transpose(), u.row(k).transpose());
      all.V[k] = of_tick[0];
      all.V_i.row(k) = of_tick.tail(f);
    }
    return all;
  });
}

void bind_energies(py::module_& module) {
  value_class<Energies>(module, "Energies",
                        "Synchronization error energy of many ticks. Arrays are read-only views.")
      .get("V", "n entries, >= 0.", &Energies::V)
      .get("V_i", "Parts that belong to the natural modes, n x f; rows sum to V.", &Energies::V_i);
  module.def(
      "energies", &energies_of, "scene"_a, "q_m"_a, "u_m"_a, "q"_a, "u"_a,
      "V between a machine q_m, u_m (n x f) and an estimate q, u (n x f or fewer columns; missing "
      "ones count as zero), in the scene's unit of energy. Raises ModelError or ValueError.");
}

// Same limit as in the program check_scene.
constexpr auto longest_trial = std::chrono::seconds(5);

struct PythonAssessment {
  bool synchronizes = false;
  std::string verdict;
  std::vector<Finding> findings;
  double decades = 0.0;
  std::optional<int> modes_needed;
  std::optional<std::vector<std::pair<std::string, double>>> half_widths;
  std::string text;
};
SPRAG_MEMBERS(PythonAssessment, synchronizes, verdict, findings, decades, modes_needed, half_widths,
              text)

PythonAssessment check(const Scene& scene, std::optional<double> accuracy) {
  if (accuracy && !(*accuracy > 0.0)) throw std::invalid_argument("accuracy must be > 0");
  TrialLimits limits;
  limits.out_of_time = [begin = std::chrono::steady_clock::now()] {
    return std::chrono::steady_clock::now() - begin > longest_trial;
  };
  Assessment found = assess(scene, limits);
  if (accuracy) assess_accuracy(scene, *accuracy, limits, found);
  found.scene = printable(scene.name);
  const std::optional<GuaranteedWidths> guaranteed = guaranteed_widths(scene);
  PythonAssessment result{
      found.synchronizes(),
      found.verdict(),
      found.findings,
      found.decades,
      {},
      {},
      to_text(found) + parameters_text(scene) + guaranteed_text(scene, guaranteed)};
  if (found.accuracy) result.modes_needed = found.accuracy->modes;
  if (guaranteed && guaranteed->why_none.empty()) {
    result.half_widths.emplace(guaranteed->widths.begin(), guaranteed->widths.end());
  }
  return result;
}

void bind_check(py::module_& module) {
  value_class<Finding>(module, "Finding", "Result of one check.")
      .get("id", "Its short name.", &Finding::id)
      .get("required", "Whether the replica's convergence requires it; others are for information.",
           &Finding::required)
      .get("holds", "Whether it is fulfilled.", &Finding::holds)
      .get("what", "The result, in words.", &Finding::what)
      .get("provided", "Condition that was not checked and on which it depends; or empty.",
           &Finding::provided)
      .get("change", "Remedy; empty if none is needed.", &Finding::change);
  using Class = PythonAssessment;
  value_class<Class>(
      module, "Assessment",
      "Whether a scene's replica will synchronize, and why. str() is what check_scene prints.")
      .get("synchronizes", "Whether all required findings hold.", &Class::synchronizes)
      .get("verdict", "'will synchronize' or 'may not synchronize'.", &Class::verdict)
      .get("findings", "All findings.", &Class::findings)
      .get("decades", "By how many decades V falls a unit of time without impacts [1/s].",
           &Class::decades)
      .get("modes_needed", "The fewest modes within the accuracy that was asked for, or None.",
           &Class::modes_needed)
      .get("half_widths",
           "Guaranteed half-widths of the outputs, or of the gaps, by name, in the second half of "
           "a trial run; inf where no spring holds one. None without a tolerance or a guarantee.",
           [](const Class& of) {
             using ByName = std::map<std::string, double>;
             return of.half_widths
                        ? std::optional<ByName>({of.half_widths->begin(), of.half_widths->end()})
                        : std::nullopt;
           })
      .def("__str__", [](const Class& of) { return of.text; });
  module.def(
      "check",
      [](const Scene& scene, std::optional<double> accuracy) {
        return long_call([&] { return check(scene, accuracy); });
      },
      "scene"_a, py::kw_only(), "accuracy"_a = py::none(),
      "Whether the replica of a scene will synchronize with its machine: every assumption of the "
      "theorem, and a short run of the machine, of at most 5 s of wall time. With `accuracy` "
      "[length] > 0 also how many modes show the tip, or the gaps, to it. Raises ModelError or "
      "ValueError.");
}

}  // namespace

void refuse_choice(const std::string& what, const std::string& given,
                   const std::vector<std::string>& choices) {
  std::string text = what + " is \"" + given + "\"; must be ";
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (i > 0) text += i + 1 == choices.size() ? " or " : ", ";
    text += '"' + choices[i] + '"';
  }
  throw std::invalid_argument(text);
}

EstimatorKind to_estimator(const std::string& name) {
  using enum EstimatorKind;
  return chosen<EstimatorKind>(
      "estimator", name,
      {{"both", both}, {"timing", timing}, {"replica", replica}, {"adaptive", adaptive}});
}

void warn(const std::string& text) {
  if (PyErr_WarnEx(PyExc_RuntimeWarning, text.c_str(), 1) != 0) throw py::error_already_set();
}

ObserverSettings to_settings(double tick, const std::string& estimator) {
  return {tick, to_estimator(estimator)};
}

void bind_runs(py::module_& module) {
  bind_simulation(module);
  bind_inconsistency(module);
  bind_estimates(module);
  bind_estimate(module);
  bind_observer(module);
  bind_energies(module);
  bind_check(module);
}

}  // namespace sprag::python
