#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
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
#include "sprag/detail/analysis/diagnosis.h"
#include "sprag/detail/analysis/reduction_choice.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/detail/identification/fitted_parameters.h"
#include "sprag/detail/identification/repaired_events.h"
#include "sprag/detail/identification/request.h"
#include "sprag/detail/identification/verdict.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/text/diagnosis_text.h"
#include "sprag/detail/text/identification_text.h"
#include "sprag/detail/text/reduction_text.h"
#include "sprag/identification.h"
#include "sprag/impacts.h"
#include "sprag/smoother.h"

namespace sprag::python {
namespace {

using EventList = std::vector<ContactEvent>;

// Sorted by time, as the functions of the library require.
EventList in_order(const py::object& events, const Scene& scene, double duration) {
  EventList taken = to_events(events, scene.model.contacts.size());
  std::erase_if(taken, [&](const ContactEvent& event) { return event.t > duration; });
  std::stable_sort(taken.begin(), taken.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  return taken;
}

// A structured array of rows; `dtype` has the layout of Row.
template <class Row>
py::array structured(const std::vector<Row>& rows) {
  return read_only(py::array_t<Row>(static_cast<py::ssize_t>(rows.size()), rows.data()));
}

const char* name_of(Misfit misfit) {
  switch (misfit) {
    case Misfit::none:
      return "none";
    case Misfit::scatter:
      return "scatter";
    case Misfit::structured:
      return "structured";
    case Misfit::prediction:
      break;
  }
  return "prediction";
}

struct EventRow {
  double t;
  std::int32_t contact;  // from 1
};

std::vector<EventRow> rows_of(const std::vector<MissingImpact>& missing) {
  std::vector<EventRow> rows;
  for (const MissingImpact& impact : missing) rows.push_back({impact.t, impact.contact + 1});
  return rows;
}

// ---- identification

// The rows of an events file with notes.
py::array mended(const IdentifyResult& result) {
  py::list rows;
  if (result.fit.converged()) {
    for (const NotedEvent& noted : noted_events(result.events, result.fit)) {
      const ContactEvent& event = noted.event;
      for (const bool closed : {true, false}) {
        if (event.kind == (closed ? ContactEventKind::opens : ContactEventKind::closes)) continue;
        rows.append(py::make_tuple(event.t, event.contact + 1, closed ? 1 : 0,
                                   std::string(name_of(noted.note))));
      }
    }
  }
  py::list fields;
  for (const auto& [name, type] : {std::pair("t", "f8"), std::pair("contact", "i4"),
                                   std::pair("closed", "i1"), std::pair("note", "U8")}) {
    fields.append(py::make_tuple(name, type));
  }
  return read_only(py::module_::import("numpy").attr("array")(rows, fields));
}

struct PythonIdentification {
  IdentifyResult result;
  std::vector<std::string> keys;
  Eigen::VectorXd values, sigmas, low, high;
  std::vector<std::uint8_t> determined, at_bound;
  Eigen::MatrixXd covariance;
};
SPRAG_MEMBERS(PythonIdentification, result, keys, values, sigmas, low, high, determined, at_bound,
              covariance)

PythonIdentification collected(IdentifyResult result) {
  PythonIdentification all;
  const Identification& fit = result.fit;
  const auto P = static_cast<Eigen::Index>(fit.unknowns.size());
  for (Eigen::VectorXd* of : {&all.values, &all.sigmas, &all.low, &all.high}) of->resize(P);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  for (Eigen::Index k = 0; k < P; ++k) {
    const FittedUnknown& of = fit.unknowns[static_cast<std::size_t>(k)];
    const bool known = of.determined && fit.converged();
    all.keys.push_back(of.unknown.key);
    all.values[k] = known ? of.value : nan;
    all.sigmas[k] = known ? of.sigma : nan;
    all.low[k] = known ? of.low : nan;
    all.high[k] = known ? of.high : nan;
    all.determined.push_back(known ? 1 : 0);
    all.at_bound.push_back(known && of.at_bound ? 1 : 0);
  }
  all.covariance = all.sigmas.asDiagonal() * correlations(fit) * all.sigmas.asDiagonal();
  all.result = std::move(result);
  return all;
}

std::optional<std::vector<std::string>> keys_or_all(const py::object& free) {
  if (free.is_none()) return std::nullopt;
  if (py::isinstance<py::str>(free)) return std::vector{free.cast<std::string>()};
  return free.cast<std::vector<std::string>>();
}

PythonIdentification run_identify(const Scene& scene, const py::object& events,
                                  const py::object& free, const py::object& known,
                                  const py::object& within, std::optional<double> jitter,
                                  bool accept, double duration) {
  if (jitter && !(*jitter >= 0.0 && std::isfinite(*jitter))) {
    throw std::invalid_argument("jitter must be >= 0");
  }
  IdentifyRequest request;
  request.free = keys_or_all(free);
  request.known = keys_or_all(known).value_or(std::vector<std::string>());
  request.jitter = jitter;
  request.causes = free.is_none();
  request.accept = accept;
  if (py::isinstance<py::dict>(within)) {
    request.within_of = within.cast<std::map<std::string, double>>();
  } else if (!within.is_none()) {
    request.within = within.cast<double>();
  }
  const EventList taken = in_order(events, scene, duration);
  return long_call([&] { return collected(identify_requested(scene, taken, request)); });
}

using IdentificationClass = py::class_<PythonIdentification>;

void bind_fitted_values(IdentificationClass& of_fit) {
  using Class = PythonIdentification;
  const auto vector = [](Eigen::VectorXd Class::*member) {
    return
        [member](const py::object& self) { return view(self.cast<const Class&>().*member, self); };
  };
  of_fit.def_readonly("keys", &Class::keys, "Keys of the parameters in the scene file.")
      .def_property_readonly("values", vector(&Class::values), "Values, P entries.")
      .def_property_readonly("sigmas", vector(&Class::sigmas), "Standard deviations, P entries.")
      .def_property_readonly("low", vector(&Class::low), "Lower ends of the 95 % intervals.")
      .def_property_readonly("high", vector(&Class::high), "Upper ends of the 95 % intervals.")
      .def_property_readonly(
          "determined",
          [](const py::object& self) { return view(self.cast<const Class&>().determined, self); },
          "Whether the events determine each parameter.")
      .def_property_readonly(
          "at_bound",
          [](const py::object& self) { return view(self.cast<const Class&>().at_bound, self); },
          "Whether each value is a physical bound.")
      .def_property_readonly(
          "parameters",
          [](const Class& of) {
            std::map<std::string, std::pair<double, double>> found;
            for (std::size_t k = 0; k < of.keys.size(); ++k) {
              const auto i = static_cast<Eigen::Index>(k);
              if (of.determined[k] != 0) found[of.keys[k]] = {of.values[i], of.sigmas[i]};
            }
            return found;
          },
          "(value, standard deviation) of each determined parameter by its key.")
      .def_property_readonly(
          "combinations",
          [](const Class& of) {
            std::vector<std::pair<std::map<std::string, double>, double>> all;
            for (const Combination& combination : of.result.fit.combinations) {
              std::map<std::string, double> weights;
              for (const auto& [k, weight] : combination.weights) weights[of.keys[k]] = weight;
              all.emplace_back(std::move(weights), combination.sigma);
            }
            return all;
          },
          "Of a degenerate orbit: (weight of the relative change by key, standard deviation) of "
          "each combination that the events determine.")
      .def_property_readonly(
          "covariance",
          [](const py::object& self) { return view(self.cast<const Class&>().covariance, self); },
          "Covariance of the values, P x P; nan where one of the two is not determined or at a "
          "bound.")
      .def_property_readonly(
          "others", [](const Class& of) { return of.result.fit.others; },
          "Values at other minima that fit as well, P entries each.");
}

void bind_fit_figures(IdentificationClass& of_fit) {
  using Class = PythonIdentification;
  of_fit
      .def_property_readonly(
          "jitter", [](const Class& of) { return of.result.fit.jitter; },
          "Standard deviation of event times, as given or as estimated [s].")
      .def_property_readonly(
          "scatter", [](const Class& of) { return of.result.fit.scatter; },
          "Root mean square of the residuals per degree of freedom [s].")
      .def_property_readonly(
          "drift",
          [](const Class& of) -> std::optional<double> {
            if (!of.result.fit.departure.is_drift()) return std::nullopt;
            return of.result.fit.departure.drift->drift;
          },
          "Process noise that the residuals show [energy per unit of time]; None: none.")
      .def_property_readonly(
          "chi2", [](const Class& of) { return of.result.fit.chi2; },
          "Sum of the squared residuals in units of the jitter.")
      .def_property_readonly(
          "freedom", [](const Class& of) { return of.result.fit.freedom; }, "Degrees of freedom.")
      .def_property_readonly(
          "impacts", [](const Class& of) { return of.result.fit.impacts; },
          "Number of impacts used.")
      .def_property_readonly(
          "left_out", [](const Class& of) { return of.result.fit.left_out; },
          "Number of closings that the fit does not use.")
      .def_property_readonly(
          "missing", [](const Class& of) { return structured(rows_of(of.result.fit.missing)); },
          "Impacts without an event: an array with the fields t [s] and contact (from 1).")
      .def_property_readonly(
          "spurious", [](const Class& of) { return of.result.fit.spurious; },
          "Indices of spurious events in the events in order of time, from 0.")
      .def_property_readonly(
          "repaired",
          [](const Class& of) {
            EventList all;
            for (const RepairedEvent& event : repaired_events(of.result.events, of.result.fit)) {
              if (!event.spurious) all.push_back(event.event);
            }
            return owned(std::move(all));
          },
          "The events with the missing ones at the times of the fit and without spurious ones: an "
          "array of event_dtype.")
      .def_property_readonly(
          "mended", [](const Class& of) { return mended(of.result); },
          "The rows of `identify --events`: an array with its fields t [s], contact (from 1), "
          "closed (1 or 0) and note ('', 'lost', 'spurious' or 'suspect'); a pulse is two rows. "
          "Empty without a fit.")
      .def_property_readonly(
          "start", [](const Class& of) -> const State& { return of.result.fit.start; },
          py::return_value_policy::reference_internal, "State at start_t.")
      .def_property_readonly(
          "start_sigma", [](const Class& of) -> const State& { return of.result.fit.start_sigma; },
          py::return_value_policy::reference_internal, "Its standard deviations.")
      .def_property_readonly(
          "start_t", [](const Class& of) { return of.result.fit.start_t; }, "[s]")
      .def_property_readonly(
          "fitted",
          [](const Class& of) -> std::shared_ptr<Scene> {
            if (!of.result.fit.converged()) return nullptr;
            return std::make_shared<Scene>(of.result.fit.fitted);
          },
          "The scene with all that the fit determines, as `identify --output` writes it: values, "
          "parameters with their correlations, start and its uncertainty, jitter, and the drift or "
          "its 95 % limit. None without a fit; that of a refused fit has the scatter as its "
          "jitter.");
}

void bind_identification(py::module_& module) {
  using Class = PythonIdentification;
  IdentificationClass of_fit = value_class<PythonIdentification>(
      module, "Identification",
      "Parameters that contact events determine, P of them, and the verdict. Entry k "
      "of each array belongs to keys[k]; it is nan where determined[k] is False.");
  of_fit
      .def_property_readonly(
          "fits", [](const Class& of) { return of.result.fit.fits(); },
          "Whether the fit is accepted; if not, problem is the reason.")
      .def_property_readonly(
          "accepted", [](const Class& of) { return of.result.fit.fits() || of.result.accepted; },
          "Whether the fit is accepted, or taken as an effective model by `accept`.")
      .def_property_readonly(
          "verdict", [](const Class& of) { return verdict(of.result); }, "The verdict in words.")
      .def_property_readonly(
          "reason", [](const Class& of) { return reason_of(of.result.fit); },
          "Why a fit is refused, and the remedy; empty if it is accepted.")
      .def_property_readonly(
          "held",
          [](const Class& of) -> std::optional<std::string> {
            if (of.result.held.empty()) return std::nullopt;
            return of.result.held;
          },
          "Key of the parameter that is held to fix the scale, or None.")
      .def_property_readonly(
          "problem", [](const Class& of) { return name_of(of.result.fit.problem); },
          "'none', 'no_convergence', 'events_left_out', 'merged_bounces', "
          "'lost_or_spurious_events', 'bound_reached', 'degenerate_orbit' or 'wrong_model'.")
      .def_property_readonly(
          "misfit", [](const Class& of) { return name_of(of.result.fit.misfit); },
          "Evidence that the model is wrong: 'none', 'scatter', 'structured' or 'prediction'.")
      .def_property_readonly(
          "cause", [](const Class& of) { return name_of(of.result.fit.departure.cause); },
          "The likeliest departure from the model, if it is significant: 'none', 'drift', "
          "'restitution_scatter', 'restitution_by_speed', 'restitution_by_time', 'friction', "
          "'soft_stop' or 'clock_rate'.")
      .def_property_readonly(
          "culprit",
          [](const Class& of) -> std::optional<std::string> {
            if (of.result.fit.culprit < 0) return std::nullopt;
            return of.keys[static_cast<std::size_t>(of.result.fit.culprit)];
          },
          "Key of the parameter that reached its bound, or None.")
      .def("__str__", [](const Class& of) { return to_text(of.result); });
  bind_fitted_values(of_fit);
  bind_fit_figures(of_fit);
  module.def(
      "identify", &run_identify, py::arg("scene"), py::arg("events"), py::kw_only(),
      py::arg("free") = py::none(), py::arg("known") = py::tuple(), py::arg("within") = py::none(),
      py::arg("jitter") = py::none(), py::arg("accept") = false,
      py::arg("duration") = std::numeric_limits<double>::infinity(),
      "Identifies parameters of a machine from contact events since t = 0, as the program identify "
      "does. free: their key in the scene file, or a list of keys; None: all that events can "
      "determine, without known, also one or several keys, and single ones that explain the events "
      "alone. within: largest relative error of the scene's values, 0.2 for None; or a dict of it "
      "by key. jitter [s]: None takes the scene's, or estimates it. accept: take a model that does "
      "not fit as an effective one. events: an array of event_dtype, or (t, contact, kind) each; "
      "later ones than duration [s] are left out. Raises sprag.Error for too few impacts, "
      "ModelError or ValueError.");
}

// ---- diagnosis

void bind_diagnosis(py::module_& module) {
  value_class<Candidate>(module, "Candidate",
                         "A parameter that may be wrong, alone, and the value that explains the "
                         "events best.")
      .def_property_readonly(
          "key", [](const Candidate& of) { return of.parameter.key; }, "Key in the scene file.")
      .def_property_readonly(
          "unit", [](const Candidate& of) { return of.parameter.unit; }, "Unit; may be empty.")
      .def_property_readonly(
          "nominal", [](const Candidate& of) { return of.parameter.nominal; }, "Scene's value.")
      .def_readonly("determined", &Candidate::determined, "Whether the events determine it.")
      .def_readonly("value", &Candidate::value, "The value; the scene's if not determined.")
      .def_readonly("sigma", &Candidate::deviation, "Its standard deviation.")
      .def_readonly("scatter", &Candidate::scatter, "Scatter of event times with it [s].")
      .def_readonly("gain", &Candidate::gain, "Gain of -2 log L; 0 if not determined.")
      .def_readonly("explained", &Candidate::explained,
                    "Share of the square of the scatter that it explains.")
      .def_readonly("fits", &Candidate::fits, "Whether the events fit with it and the jitter.")
      .def_readonly("improved_by", &Candidate::improved_by,
                    "Key of a parameter that explains much more together with it; else empty.");
  value_class<Diagnosis>(module, "Diagnosis",
                         "Whether events fit a scene, and which parameter would explain them.")
      .def_readonly("fits", &Diagnosis::fits, "Whether the events fit the scene as it is.")
      .def_readonly("jitter", &Diagnosis::jitter, "Specified jitter [s]; 0: exact.")
      .def_readonly("scatter", &Diagnosis::scatter,
                    "Scatter of event times about the scene's machine [s].")
      .def_readonly("misfit", &Diagnosis::misfit, "chi^2 per degree of freedom with the jitter.")
      .def_readonly("closings", &Diagnosis::closings, "Number of closings used.")
      .def_readonly("candidates", &Diagnosis::candidates, "All parameters, the best first.")
      .def_property_readonly(
          "explanation", [](const Diagnosis& of) { return of.explanation(); },
          py::return_value_policy::reference_internal,
          "The candidate with which the events fit, or None.")
      .def_property_readonly(
          "ties",
          [](const Diagnosis& of) {
            std::vector<Candidate> ties;
            for (const Candidate* tie : of.ties()) ties.push_back(*tie);
            return ties;
          },
          "Other parameters that explain the misfit as well.")
      .def_property_readonly(
          "missing", [](const Diagnosis& of) { return structured(rows_of(of.missing)); },
          "Lost events that explain the misfit: an array with the fields t [s] and contact.")
      .def_property_readonly(
          "spurious", [](const Diagnosis& of) { return owned(of.spurious); },
          "Spurious events that explain the misfit, an array of event_dtype.")
      .def_property_readonly(
          "verdict", [](const Diagnosis& of) { return verdict(of); }, "The verdict in words.")
      .def("__str__", [](const Diagnosis& of) { return to_text(of); });
  module.def(
      "diagnose",
      [](const Scene& scene, const py::object& events, std::optional<double> jitter,
         double duration, const py::object& free) {
        DiagnosisSettings settings;
        settings.jitter = jitter.value_or(scene.prior.jitter);
        if (!(settings.jitter >= 0.0 && std::isfinite(settings.jitter))) {
          throw std::invalid_argument("jitter must be >= 0");
        }
        settings.keys = keys_or_all(free).value_or(std::vector<std::string>());
        const EventList taken = in_order(events, scene, duration);
        return long_call([&] { return diagnose(scene, taken, settings); });
      },
      py::arg("scene"), py::arg("events"), py::kw_only(), py::arg("jitter") = py::none(),
      py::arg("duration") = std::numeric_limits<double>::infinity(), py::arg("free") = py::none(),
      "Whether contact events since t = 0 fit a scene and, if not, which single parameter would "
      "explain them. jitter [s]: None takes the scene's. free: the parameters that may be wrong, "
      "as "
      "for identify(); None: all. Raises sprag.Error for too few events, ModelError or "
      "ValueError.");
}

// ---- smoothing

struct Smoothed {
  Eigen::VectorXd t;
  Rows q, u, sigma_q, sigma_u, sigma_gap, outputs, sigma_outputs;
  std::vector<std::uint8_t> smoothed;
  std::vector<SmoothedStretch> stretches;
};
SPRAG_MEMBERS(Smoothed, t, q, u, sigma_q, sigma_u, sigma_gap, outputs, sigma_outputs, smoothed,
              stretches)

Smoothed run_smooth(const Scene& scene, const EventList& events, double duration, double tick) {
  const std::int64_t last = last_tick(duration, tick);
  const auto n = static_cast<Eigen::Index>(last + 1);
  const Model& model = scene.model;
  const Eigen::Index f = model.coordinates();
  const auto m = std::ssize(model.contacts), o = std::ssize(model.outputs);
  Smoothed all{.t = Eigen::VectorXd(n),
               .q = Rows(n, f),
               .u = Rows(n, f),
               .sigma_q = Rows(n, f),
               .sigma_u = Rows(n, f),
               .sigma_gap = Rows(n, m),
               .outputs = Rows(n, o),
               .sigma_outputs = Rows(n, o),
               .smoothed = std::vector<std::uint8_t>(static_cast<std::size_t>(n)),
               .stretches = {}};
  const auto take = [&](std::int64_t tick_number, const SmoothedEstimate& of, bool smoothed) {
    const auto k = static_cast<Eigen::Index>(tick_number);
    all.t[k] = tick_instant(tick_number, tick).hi;
    all.q.row(k) = of.q;
    all.u.row(k) = of.u;
    all.sigma_q.row(k) = of.sigma_q;
    all.sigma_u.row(k) = of.sigma_u;
    all.sigma_gap.row(k) = of.sigma_gap;
    all.sigma_outputs.row(k) = of.sigma_outputs;
    for (Eigen::Index i = 0; i < o; ++i) {
      all.outputs(k, i) = value(model.outputs[static_cast<std::size_t>(i)], of.q, of.u);
    }
    all.smoothed[static_cast<std::size_t>(k)] = smoothed ? 1 : 0;
  };
  all.stretches = smooth(scene, events, tick, last, take);
  return all;
}

void bind_smoother(py::module_& module) {
  value_class<SmoothedStretch>(module, "SmoothedStretch", "Part of a recording that is smoothed.")
      .get("begin", "[s]", &SmoothedStretch::from)
      .get("end", "[s]", &SmoothedStretch::to)
      .get("events", "Number of events in it.", &SmoothedStretch::events)
      .get("misfit",
           "Mean normalized innovation squared of its events; about 1 if model, jitter and drift "
           "are right.",
           &SmoothedStretch::misfit);
  value_class<Smoothed>(module, "Smoothed",
                        "Estimates from all events before and after each tick. All arrays are "
                        "read-only views; row k is tick k.")
      .get("t", "Times k h [s], n entries.", &Smoothed::t)
      .get("q", "Coordinates, n x f.", &Smoothed::q)
      .get("u", "Velocities, n x f.", &Smoothed::u)
      .get("sigma_q", "Standard deviations of q, n x f.", &Smoothed::sigma_q)
      .get("sigma_u", "Standard deviations of u, n x f.", &Smoothed::sigma_u)
      .get("sigma_gap", "Standard deviations of the gaps [m], n x m.", &Smoothed::sigma_gap)
      .get("outputs", "The scene's outputs, n x as many.", &Smoothed::outputs)
      .get("sigma_outputs", "Their standard deviations.", &Smoothed::sigma_outputs)
      .get("smoothed",
           "Whether each tick lies in a stretch, n entries; other ticks have the estimate of "
           "observe().",
           &Smoothed::smoothed)
      .get("stretches", "The stretches, in order of time.", &Smoothed::stretches);
  module.def(
      "smooth",
      [](const Scene& scene, const py::object& events, double duration, double tick) {
        if (!(duration >= 0.0 && std::isfinite(duration))) {
          throw std::invalid_argument("duration must be >= 0");
        }
        if (!(tick > 0.0 && std::isfinite(tick))) throw std::invalid_argument("tick must be > 0");
        const EventList taken = in_order(events, scene, duration);
        return long_call([&] { return run_smooth(scene, taken, duration, tick); });
      },
      "scene"_a, "events"_a, "duration"_a, py::kw_only(), "tick"_a = 0.01,
      "Estimates at every tick [s] up to duration [s] from all events of a complete recording, "
      "those after the tick included. The scene needs a jitter or uncertain parameters. Raises "
      "sprag.Error if it cannot be smoothed, ModelError or ValueError.");
}

// ---- impacts and predictions

struct ImpactRow {
  double t;
  std::int32_t contact;
  std::int8_t kind;
  bool from_filter;
  double time, sigma_time, velocity_before, sigma_velocity_before, velocity_after,
      sigma_velocity_after, impulse, sigma_impulse;
  bool sustained;
  double force_begin, sigma_force_begin, force_end, sigma_force_end, force_largest,
      sigma_force_largest, force_impulse, sigma_force_impulse;
};

struct PredictionRow {
  double t;
  std::int32_t contact;
  std::int8_t kind;
  double sigma_t;
};

ImpactRow row_of(const ImpactRecord& of) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto force = [&](const Uncertain& x) { return of.sustained ? x : Uncertain{nan, nan}; };
  const Uncertain begin = force(of.force_begin), end = force(of.force_end),
                  largest = force(of.force_largest), impulse = force(of.force_impulse);
  return {of.t,
          of.contact + 1,
          static_cast<std::int8_t>(of.kind),
          of.from_filter,
          of.time.value,
          of.time.sigma,
          of.before.value,
          of.before.sigma,
          of.after.value,
          of.after.sigma,
          of.impulse.value,
          of.impulse.sigma,
          of.sustained,
          begin.value,
          begin.sigma,
          end.value,
          end.sigma,
          largest.value,
          largest.sigma,
          impulse.value,
          impulse.sigma};
}

void bind_impacts(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(EventRow, t, contact);
  PYBIND11_NUMPY_DTYPE(ImpactRow, t, contact, kind, from_filter, time, sigma_time, velocity_before,
                       sigma_velocity_before, velocity_after, sigma_velocity_after, impulse,
                       sigma_impulse, sustained, force_begin, sigma_force_begin, force_end,
                       sigma_force_end, force_largest, sigma_force_largest, force_impulse,
                       sigma_force_impulse);
  PYBIND11_NUMPY_DTYPE(PredictionRow, t, contact, kind, sigma_t);
  module.def(
      "impacts",
      [](const Scene& scene, const py::object& events, double duration, double tick,
         const std::string& estimator) {
        const EventList taken = to_events(events, scene.model.contacts.size());
        const ObserverSettings settings = to_settings(tick, estimator);
        const std::vector<ImpactRecord> records =
            long_call([&] { return impacts(scene, taken, duration, settings); });
        std::vector<ImpactRow> rows;
        rows.reserve(records.size());
        for (const ImpactRecord& record : records) rows.push_back(row_of(record));
        return structured(rows);
      },
      "scene"_a, "events"_a, "duration"_a, py::kw_only(), "tick"_a = 0.01, "estimator"_a = "both",
      "The impacts of a recording: an array with one entry for each event and the columns of "
      "`observer --impacts` as fields: t [s] as reported, contact (from 1), kind, from_filter; "
      "time [s], velocity_before and velocity_after (of the gap [m/s]), impulse [N s], each with "
      "its standard deviation `sigma_NAME`, inf where unknown; and for releases (the field "
      "sustained) force_begin, force_end, force_largest [N] and force_impulse [N s] of the contact "
      "that ends, else nan. Raises ModelError or ValueError.");
  value_class<Prediction>(module, "Prediction", "Predicted contact events of a machine.")
      .get("made_at", "Time of the prediction [s].", &Prediction::made_at)
      .get("certain_until", "No other event is expected up to here [s].",
           &Prediction::certain_until)
      .get("events",
           "In order of time, an array with the fields t [s], contact (from 1), kind, sigma_t [s].",
           [](const Prediction& of) {
             std::vector<PredictionRow> rows;
             for (const PredictedEvent& event : of.events) {
               rows.push_back(
                   {event.t, event.contact + 1, static_cast<std::int8_t>(event.kind), event.sigma});
             }
             return structured(rows);
           });
  module.def(
      "predict",
      [](const Scene& scene, const py::object& events, double t, double ahead, double tick,
         const std::string& estimator) {
        const EventList taken = to_events(events, scene.model.contacts.size());
        const ObserverSettings settings = to_settings(tick, estimator);
        return long_call([&] { return predict(scene, taken, t, ahead, settings); });
      },
      "scene"_a, "events"_a, "t"_a, "ahead"_a, py::kw_only(), "tick"_a = 0.01,
      "estimator"_a = "both",
      "Predicts the contact events in the time ahead [s] after t [s] from the events up to t. No "
      "events are predicted while the filter is not confirmed. Raises ModelError or ValueError.");
}

// ---- reduction

struct PythonReduction {
  std::string correction;
  int modes = 0;
  std::vector<int> static_vectors;
  double rms_gap = 0.0;
  std::shared_ptr<Scene> scene;
};
SPRAG_MEMBERS(PythonReduction, correction, modes, static_vectors, rms_gap, scene)

struct PythonReductions {
  int closings = 0;
  double begin = 0.0, end = 0.0;
  std::vector<PythonReduction> all;
  std::string text;
};
SPRAG_MEMBERS(PythonReductions, closings, begin, end, all, text)

PythonReductions run_reduce(const Scene& scene, const EventList& events, int modes) {
  const ModalMachine machine = modal_machine(scene);
  std::vector<Eigen::Index> kept = by_frequency(machine);
  kept.resize(static_cast<std::size_t>(modes));
  const Followed followed = second_half(events);
  const ReductionTable table{scene.name, closings(followed), followed.counts, events.back().t,
                             reductions(machine, kept, followed)};
  if (table.reductions.empty()) {
    throw ModelError("the first " + std::to_string(modes) + " modes do not see every contact");
  }
  PythonReductions found{table.closings, table.from, table.to, {}, to_text(table)};
  for (const Reduction& of : table.reductions) {
    found.all.push_back({of.correction, of.modes, of.static_vectors, of.rms,
                         std::make_shared<Scene>(reduced_scene(scene, of.machine))});
  }
  return found;
}

void bind_reduction(py::module_& module) {
  using One = PythonReduction;
  using All = PythonReductions;
  value_class<One>(module, "Reduction",
                   "A machine with fewer modes and a correction for the others.")
      .get("correction", "Text: 'b_0, b_1', 'restitution 0.1' or 'none'.", &One::correction)
      .get("modes", "Number of kept modes.", &One::modes)
      .get("static_vectors", "Orders of the static vectors; may be empty.", &One::static_vectors)
      .get("rms_gap", "Root mean square of the replica's own gap at the closings [m].",
           &One::rms_gap)
      .get("scene", "The reduced scene.", &One::scene);
  value_class<All>(module, "Reductions",
                   "A sequence of Reduction, the best first. str() is what reduce prints.")
      .get("closings", "Number of closings that count.", &All::closings)
      .get("begin", "Begin of the time in which they count [s].", &All::begin)
      .get("end", "Its end [s].", &All::end)
      .def("__len__", [](const All& of) { return of.all.size(); })
      .def(
          "__getitem__",
          [](const All& of, std::ptrdiff_t index) {
            const std::ptrdiff_t k = index < 0 ? index + std::ssize(of.all) : index;
            if (k < 0 || k >= std::ssize(of.all)) throw py::index_error();
            return of.all[static_cast<std::size_t>(k)];
          },
          "index"_a)
      .def(
          "__iter__", [](const All& of) { return py::make_iterator(of.all.begin(), of.all.end()); },
          py::keep_alive<0, 1>())
      .def("__str__", [](const All& of) { return of.text; });
  module.def(
      "reduce",
      [](const Scene& scene, const py::object& events, int modes, double duration) {
        const auto most = static_cast<int>(scene.model.coordinates());
        if (modes < 1 || modes > most) {
          throw std::invalid_argument("modes is " + std::to_string(modes) + "; must be from 1 to " +
                                      std::to_string(most));
        }
        const EventList taken = in_order(events, scene, duration);
        return long_call([&] { return run_reduce(scene, taken, modes); });
      },
      "scene"_a, "events"_a, "modes"_a, py::kw_only(),
      "duration"_a = std::numeric_limits<double>::infinity(),
      "Reduces a scene to its first modes, with each correction for the others that is tried: "
      "Reductions, the one that follows the events best first. Raises sprag.Error for too few "
      "events, ModelError or ValueError.");
}

}  // namespace

void bind_analyses(py::module_& module) {
  bind_impacts(module);
  bind_identification(module);
  bind_diagnosis(module);
  bind_smoother(module);
  bind_reduction(module);
}

}  // namespace sprag::python
