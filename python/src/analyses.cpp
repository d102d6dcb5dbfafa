#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
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

constexpr double infinity = std::numeric_limits<double>::infinity();

// Sorted by time, as the functions of the library require.
EventList in_order(const py::object& events, const Scene& scene, double duration) {
  EventList taken = to_events(events, scene.model.contacts.size());
  std::erase_if(taken, [&](const ContactEvent& event) { return event.t > duration; });
  std::stable_sort(taken.begin(), taken.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  return taken;
}

// A structured array of rows, in which contacts count from 1.
template <class Row>
py::array structured(std::vector<Row> rows) {
  for (Row& row : rows) ++row.contact;
  return read_only(py::array_t<Row>(std::ssize(rows), rows.data()));
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
  const py::dict fields("names"_a = py::make_tuple("t", "contact", "closed", "note"),
                        "formats"_a = py::make_tuple("f8", "i4", "i1", "U8"));
  return read_only(py::module_::import("numpy").attr("array")(rows, fields));
}

// An attribute of each parameter: 0, or nan, where the events do not determine it.
template <typename T>
py::array_t<T> of_parameters(const Identification& fit, T FittedUnknown::*member) {
  py::array_t<T> values(std::ssize(fit.unknowns));
  std::transform(fit.unknowns.begin(), fit.unknowns.end(), values.mutable_data(),
                 [&](const FittedUnknown& of) {
                   const bool known = of.determined && fit.converged();
                   return known ? of.*member : std::numeric_limits<T>::quiet_NaN();
                 });
  return read_only(values);
}

std::vector<std::string> keys_of(const Identification& fit) {
  std::vector<std::string> keys;
  for (const FittedUnknown& of : fit.unknowns) keys.push_back(of.unknown.key);
  return keys;
}

// (value, standard deviation) of each determined parameter.
std::map<std::string, std::pair<double, double>> parameters_of(const Identification& fit) {
  std::map<std::string, std::pair<double, double>> found;
  for (const FittedUnknown& of : fit.unknowns) {
    if (of.determined && fit.converged()) found[of.unknown.key] = {of.value, of.sigma};
  }
  return found;
}

using Weights = std::map<std::string, double>;

std::vector<std::pair<Weights, double>> combinations_of(const Identification& fit) {
  std::vector<std::pair<Weights, double>> all;
  for (const Combination& combination : fit.combinations) {
    Weights weights;
    for (const auto& [k, weight] : combination.weights) {
      weights[fit.unknowns[k].unknown.key] = weight;
    }
    all.emplace_back(std::move(weights), combination.sigma);
  }
  return all;
}

// nan where one of the two parameters is not determined.
const Eigen::MatrixXd covariance_of(const Identification& fit) {
  const auto sigmas = of_parameters(fit, &FittedUnknown::sigma).cast<Eigen::VectorXd>();
  return sigmas.asDiagonal() * correlations(fit) * sigmas.asDiagonal();
}

py::array repaired(const IdentifyResult& result) {
  EventList all;
  for (const RepairedEvent& event : repaired_events(result.events, result.fit)) {
    if (!event.spurious) all.push_back(event.event);
  }
  return owned(std::move(all));
}

std::optional<std::vector<std::string>> keys_or_all(const py::object& free) {
  if (free.is_none()) return std::nullopt;
  if (py::isinstance<py::str>(free)) return std::vector{free.cast<std::string>()};
  return free.cast<std::vector<std::string>>();
}

double required_jitter(double jitter) {
  if (jitter >= 0.0 && std::isfinite(jitter)) return jitter;
  throw std::invalid_argument("jitter must be >= 0");
}

IdentifyResult run_identify(const Scene& scene, const py::object& events, const py::object& free,
                            const py::object& known, const py::object& within,
                            std::optional<double> jitter, bool accept, double duration) {
  IdentifyRequest request;
  request.free = keys_or_all(free);
  request.known = keys_or_all(known).value_or(std::vector<std::string>());
  if (jitter) request.jitter = required_jitter(*jitter);
  request.causes = free.is_none();
  request.accept = accept;
  if (py::isinstance<py::dict>(within)) {
    request.within_of = within.cast<std::map<std::string, double>>();
  } else if (!within.is_none()) {
    request.within = within.cast<double>();
  }
  const EventList taken = in_order(events, scene, duration);
  return long_call([&] { return identify_requested(scene, taken, request); });
}

void bind_identification(py::module_& module) {
  using Fit = Identification;
  const auto number = [](double FittedUnknown::*member) {
    return [member](const Fit& fit) { return of_parameters(fit, member); };
  };
  const auto flag = [](bool FittedUnknown::*member) {
    return [member](const Fit& fit) { return of_parameters(fit, member); };
  };
  const auto fit = &IdentifyResult::fit;
  value_class<IdentifyResult>(
      module, "Identification",
      "Parameters that contact events determine, P of them, and the verdict. Entry k "
      "of each array belongs to keys[k]; it is nan where determined[k] is False.")
      .get("fits", "Whether the fit is accepted; if not, problem is the reason.", fit, &Fit::fits)
      .get("accepted", "Whether the fit is accepted, or taken as an effective model by `accept`.",
           [](const IdentifyResult& of) { return of.fit.fits() || of.accepted; })
      .get("verdict", "The verdict in words.", [](const IdentifyResult& of) { return verdict(of); })
      .get("reason", "Why a fit is refused, and the remedy; empty if it is accepted.", fit,
           &reason_of)
      .get("held", "Key of the parameter that is held to fix the scale, or None.",
           [](const IdentifyResult& of) {
             return of.held.empty() ? std::nullopt : std::optional(of.held);
           })
      .get("problem",
           "'none', 'no_convergence', 'events_left_out', 'merged_bounces', "
           "'lost_or_spurious_events', 'bound_reached', 'degenerate_orbit' or 'wrong_model'.",
           fit, [](const Fit& of) { return name_of(of.problem); })
      .get("misfit",
           "Evidence that the model is wrong: 'none', 'scatter', 'structured' or 'prediction'.",
           fit, [](const Fit& of) { return name_of(of.misfit); })
      .get("cause",
           "The likeliest departure from the model, if it is significant: 'none', 'drift', "
           "'restitution_scatter', 'restitution_by_speed', 'restitution_by_time', 'friction', "
           "'soft_stop' or 'clock_rate'.",
           fit, [](const Fit& of) { return name_of(of.departure.cause); })
      .get("culprit", "Key of the parameter that reached its bound, or None.", fit,
           [](const Fit& of) -> std::optional<std::string> {
             if (of.culprit < 0) return std::nullopt;
             return of.unknowns[static_cast<std::size_t>(of.culprit)].unknown.key;
           })
      .get("keys", "Keys of the parameters in the scene file.", fit, &keys_of)
      .get("values", "Values, P entries.", fit, number(&FittedUnknown::value))
      .get("sigmas", "Standard deviations, P entries.", fit, number(&FittedUnknown::sigma))
      .get("low", "Lower ends of the 95 % intervals.", fit, number(&FittedUnknown::low))
      .get("high", "Upper ends of the 95 % intervals.", fit, number(&FittedUnknown::high))
      .get("determined", "Whether the events determine each parameter.", fit,
           flag(&FittedUnknown::determined))
      .get("at_bound", "Whether each value is a physical bound.", fit,
           flag(&FittedUnknown::at_bound))
      .get("parameters", "(value, standard deviation) of each determined parameter by its key.",
           fit, &parameters_of)
      .get("combinations",
           "Of a degenerate orbit: (weight of the relative change by key, standard deviation) of "
           "each combination that the events determine.",
           fit, &combinations_of)
      .get("covariance",
           "Covariance of the values, P x P; nan where one of the two is not determined or at a "
           "bound.",
           fit, &covariance_of)
      .get("others", "Values at other minima that fit as well, P entries each.", fit, &Fit::others)
      .get("jitter", "Standard deviation of event times, as given or as estimated [s].", fit,
           &Fit::jitter)
      .get("scatter", "Root mean square of the residuals per degree of freedom [s].", fit,
           &Fit::scatter)
      .get("drift", "Process noise that the residuals show [energy per unit of time]; None: none.",
           fit,
           [](const Fit& of) -> std::optional<double> {
             if (!of.departure.is_drift()) return std::nullopt;
             return of.departure.drift->drift;
           })
      .get("chi2", "Sum of the squared residuals in units of the jitter.", fit, &Fit::chi2)
      .get("freedom", "Degrees of freedom.", fit, &Fit::freedom)
      .get("impacts", "Number of impacts used.", fit, &Fit::impacts)
      .get("left_out", "Number of closings that the fit does not use.", fit, &Fit::left_out)
      .get("missing",
           "Impacts without an event: an array with the fields t [s] and contact (from 1).", fit,
           [](const Fit& of) { return structured(of.missing); })
      .get("spurious", "Indices of spurious events in the events in order of time, from 0.", fit,
           &Fit::spurious)
      .get("repaired",
           "The events with the missing ones at the times of the fit and without spurious ones: an "
           "array of event_dtype.",
           &repaired)
      .get("mended",
           "The rows of `identify --events`: an array with its fields t [s], contact (from 1), "
           "closed (1 or 0) and note ('', 'lost', 'spurious' or 'suspect'); a pulse is two rows. "
           "Empty without a fit.",
           &mended)
      .get("start", "State at start_t.", fit, &Fit::start)
      .get("start_sigma", "Its standard deviations.", fit, &Fit::start_sigma)
      .get("start_t", "[s]", fit, &Fit::start_t)
      .get(
          "fitted",
          "The scene with all that the fit determines, as `identify --output` writes it: values, "
          "parameters with their correlations, start and its uncertainty, jitter, and the drift or "
          "its 95 % limit. None without a fit; that of a refused fit has the scatter as its "
          "jitter.",
          fit, [](const Fit& of) { return of.converged() ? &of.fitted : nullptr; })
      .def("__str__", [](const IdentifyResult& of) { return to_text(of); });
  module.def(
      "identify", &run_identify, "scene"_a, "events"_a, py::kw_only(), "free"_a = py::none(),
      "known"_a = py::tuple(), "within"_a = py::none(), "jitter"_a = py::none(), "accept"_a = false,
      "duration"_a = infinity,
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

std::vector<Candidate> ties_of(const Diagnosis& diagnosis) {
  std::vector<Candidate> ties;
  for (const Candidate* tie : diagnosis.ties()) ties.push_back(*tie);
  return ties;
}

void bind_diagnosis(py::module_& module) {
  value_class<Candidate>(module, "Candidate",
                         "A parameter that may be wrong, alone, and the value that explains the "
                         "events best.")
      .get("key", "Key in the scene file.", &Candidate::parameter, &Parameter::key)
      .get("unit", "Unit; may be empty.", &Candidate::parameter, &Parameter::unit)
      .get("nominal", "Scene's value.", &Candidate::parameter, &Parameter::nominal)
      .get("determined", "Whether the events determine it.", &Candidate::determined)
      .get("value", "The value; the scene's if not determined.", &Candidate::value)
      .get("sigma", "Its standard deviation.", &Candidate::deviation)
      .get("scatter", "Scatter of event times with it [s].", &Candidate::scatter)
      .get("gain", "Gain of -2 log L; 0 if not determined.", &Candidate::gain)
      .get("explained", "Share of the square of the scatter that it explains.",
           &Candidate::explained)
      .get("fits", "Whether the events fit with it and the jitter.", &Candidate::fits)
      .get("improved_by",
           "Key of a parameter that explains much more together with it; else empty.",
           &Candidate::improved_by);
  value_class<Diagnosis>(module, "Diagnosis",
                         "Whether events fit a scene, and which parameter would explain them.")
      .get("fits", "Whether the events fit the scene as it is.", &Diagnosis::fits)
      .get("jitter", "Specified jitter [s]; 0: exact.", &Diagnosis::jitter)
      .get("scatter", "Scatter of event times about the scene's machine [s].", &Diagnosis::scatter)
      .get("misfit", "chi^2 per degree of freedom with the jitter.", &Diagnosis::misfit)
      .get("closings", "Number of closings used.", &Diagnosis::closings)
      .get("candidates", "All parameters, the best first.", &Diagnosis::candidates)
      .get("explanation", "The candidate with which the events fit, or None.",
           &Diagnosis::explanation)
      .get("ties", "Other parameters that explain the misfit as well.", &ties_of)
      .get("missing",
           "Lost events that explain the misfit: an array with the fields t [s] and contact.",
           [](const Diagnosis& of) { return structured(of.missing); })
      .get("spurious", "Spurious events that explain the misfit, an array of event_dtype.",
           [](const Diagnosis& of) { return owned(of.spurious); })
      .get("verdict", "The verdict in words.", [](const Diagnosis& of) { return verdict(of); })
      .def("__str__", [](const Diagnosis& of) { return to_text(of); });
  module.def(
      "diagnose",
      [](const Scene& scene, const py::object& events, std::optional<double> jitter,
         double duration, const py::object& free) {
        DiagnosisSettings settings;
        settings.jitter = required_jitter(jitter.value_or(scene.prior.jitter));
        settings.keys = keys_or_all(free).value_or(std::vector<std::string>());
        const EventList taken = in_order(events, scene, duration);
        return long_call([&] { return diagnose(scene, taken, settings); });
      },
      "scene"_a, "events"_a, py::kw_only(), "jitter"_a = py::none(), "duration"_a = infinity,
      "free"_a = py::none(),
      "Whether contact events since t = 0 fit a scene and, if not, which single parameter would "
      "explain them. jitter [s]: None takes the scene's. free: the parameters that may be wrong, "
      "as for identify(); None: all. Raises sprag.Error for too few events, ModelError or "
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

// The columns of `observer --impacts`; forces of releases only.
py::array columns_of(std::vector<ImpactRecord> records) {
  for (ImpactRecord& of : records) {
    ++of.contact;
    if (of.sustained) continue;
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    of.force_begin = of.force_end = of.force_largest = of.force_impulse = {nan, nan};
  }
  py::list names, formats, offsets;
  const auto field = [&](const std::string& name, const char* format, std::size_t offset) {
    names.append(name);
    formats.append(format);
    offsets.append(offset);
  };
  const auto uncertain = [&](const std::string& name, std::size_t offset) {
    field(name, "f8", offset + offsetof(Uncertain, value));
    field("sigma_" + name, "f8", offset + offsetof(Uncertain, sigma));
  };
  field("t", "f8", offsetof(ImpactRecord, t));
  field("contact", "i4", offsetof(ImpactRecord, contact));
  field("kind", "i1", offsetof(ImpactRecord, kind));
  field("from_filter", "?", offsetof(ImpactRecord, from_filter));
  uncertain("time", offsetof(ImpactRecord, time));
  uncertain("velocity_before", offsetof(ImpactRecord, before));
  uncertain("velocity_after", offsetof(ImpactRecord, after));
  uncertain("impulse", offsetof(ImpactRecord, impulse));
  field("sustained", "?", offsetof(ImpactRecord, sustained));
  uncertain("force_begin", offsetof(ImpactRecord, force_begin));
  uncertain("force_end", offsetof(ImpactRecord, force_end));
  uncertain("force_largest", offsetof(ImpactRecord, force_largest));
  uncertain("force_impulse", offsetof(ImpactRecord, force_impulse));
  const py::dtype type(names, formats, offsets, sizeof(ImpactRecord));
  return read_only(py::array(type, std::ssize(records), records.data()));
}

void bind_impacts(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(MissingImpact, t, contact);
  PYBIND11_NUMPY_DTYPE_EX(PredictedEvent, t, "t", contact, "contact", kind, "kind", sigma,
                          "sigma_t");
  module.def(
      "impacts",
      [](const Scene& scene, const py::object& events, double duration, double tick,
         const std::string& estimator) {
        const EventList taken = to_events(events, scene.model.contacts.size());
        const ObserverSettings settings = to_settings(tick, estimator);
        return columns_of(long_call([&] { return impacts(scene, taken, duration, settings); }));
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
           [](const Prediction& of) { return structured(of.events); });
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
  Scene scene;
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
    found.all.push_back(
        {of.correction, of.modes, of.static_vectors, of.rms, reduced_scene(scene, of.machine)});
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
      "scene"_a, "events"_a, "modes"_a, py::kw_only(), "duration"_a = infinity,
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
