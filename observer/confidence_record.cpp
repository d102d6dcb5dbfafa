#include "observer/confidence_record.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <ostream>

namespace sprag {
namespace {

constexpr std::int64_t most_reported = 20;
constexpr std::size_t most_kept = 1000;

// JSON has no infinity.
nlohmann::ordered_json or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json numbers(const Eigen::VectorXd& values) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const double value : values) list.push_back(or_null(value));
  return list;
}

const char* advice(const Inconsistency& last) {
  if (last.known_loss) return "records before this event were lost.";
  switch (last.suspicion) {
    case Suspicion::spurious_event:
      return "no contact was near: a spurious event?";
    case Suspicion::missing_event:
      return "it had passed the contact before: a missing event?";
    default:
      return "model, uncertainty or event times?";
  }
}

void print_parameters(const ParameterEstimates& parameters, std::ostream& out) {
  for (std::size_t k = 0; k < parameters.keys->size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    const auto digits = out.precision(9);
    out << "  " << (*parameters.keys)[k] << " = " << parameters.values[i];
    out.precision(digits);
    if (std::isfinite(parameters.sigmas[i])) {
      out << " +- " << parameters.sigmas[i] << '\n';
    } else {
      out << ", the scene's\n";
    }
  }
}

nlohmann::ordered_json parameters_to_json(const ParameterEstimates& parameters) {
  nlohmann::ordered_json json;
  for (std::size_t k = 0; k < parameters.keys->size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    json[(*parameters.keys)[k]] = {{"value", parameters.values[i]},
                                   {"sigma", or_null(parameters.sigmas[i])}};
  }
  return json;
}

}  // namespace

void ConfidenceRecord::conclude(const Confidence& confidence, double initial) {
  any_ = confidence.has_filter ||
         (confidence.has_replica && (std::isfinite(initial) || confidence.bound_q.size() > 0));
  initial_ = initial;
  last_ = confidence;
}

void ConfidenceRecord::take_penetration(double depth) {
  ++ticks_in_full_;
  if (depth > 0.0) ++penetrating_ticks_;
  deepest_ = std::max(deepest_, depth);
}

void ConfidenceRecord::note(double t, const Confidence& confidence, std::ostream& out) {
  t_ = t;
  ++ticks_;
  from_filter_ = confidence.from_filter;
  if (from_filter_) ++ticks_from_filter_;
  take_inconsistencies(confidence, out);
  take_contacts(confidence, out);
  take_forgotten(confidence, out);
  if (refutations_.more(confidence.refutations, out)) {
    out << "t = " << t
        << ": the filter's estimate is false: it lies further from the replica's than the "
           "guaranteed bound and its own sigma allow. The estimate is the replica's.\n";
  }
  if (confidence.parameters.any()) take_parameters(confidence, out);
}

void ConfidenceRecord::take_parameters(const Confidence& confidence, std::ostream& out) {
  const ParameterEstimates& parameters = confidence.parameters;
  const bool any = identified_.more(parameters.identifications, out);
  if (parameters.accepted != accepted_ && parameters.accepted >= 0.0 &&
      accepted_times_.size() < most_kept) {
    accepted_times_.push_back(parameters.accepted);
  }
  if (any && parameters.accepted < 0.0) {
    out << "t = " << t_
        << ": the events so far fit no machine with the free parameters of [adapt]\n";
  } else if (any) {
    out << "t = " << t_ << ": " << parameters.keys->size()
        << " parameters are identified, and are estimated with the state from here on\n";
  } else if (parameters.accepted < 0.0 && accepted_ >= 0.0) {
    out << "t = " << t_ << ": the parameters do not fit any more; they are identified anew\n";
  }
  accepted_ = parameters.accepted;
}

// The filter lost a covariance because more events lie within the rollback history than it stores.
void ConfidenceRecord::take_forgotten(const Confidence& confidence, std::ostream& out) {
  if (forgotten_.more(confidence.forgotten, out)) {
    out << "t = " << t_ << ": the filter starts again: it has no room for so many events\n";
  }
}

void ConfidenceRecord::take_contacts(const Confidence& confidence, std::ostream& out) {
  if (redundant_.more(confidence.redundancy.closings, out)) {
    out << "t = " << t_ << ", contact " << confidence.redundancy.contact + 1
        << " is reported closed beside others that hold its direction already: it carries no force "
           "of its own\n";
  }
  if (refused_.more(confidence.refused_impacts, out)) {
    out << "t = " << t_
        << ": contacts reported closed cannot be held together: they contradict each other, or "
           "resound undamped; the estimate may be wrong from here on\n";
  }
}

// Takes a new value of the counter. Returns whether it has risen and a line is to be printed.
bool ConfidenceRecord::Counter::more(std::int64_t now, std::ostream& out) {
  if (now < seen) seen = 0;  // a new session
  if (now == seen) return false;
  total += now - seen;
  seen = now;
  if (++lines == most_reported + 1) out << "more of these are only counted\n";
  return lines <= most_reported;
}

void ConfidenceRecord::take_inconsistencies(const Confidence& confidence, std::ostream& out) {
  const std::int64_t before = inconsistencies_.total;
  const bool any = inconsistencies_.more(confidence.inconsistencies, out);
  const Inconsistency& last = confidence.last;
  if (inconsistencies_.total > before && first_.size() < most_kept) first_.push_back(last);
  if (!any) return;
  out << "t = " << last.t << ", contact " << last.contact + 1 << ": ";
  if (!confidence.has_replica && last.suspicion == Suspicion::missing_event && !last.known_loss) {
    out << "an event has not come that had to: a missing event? ";
  } else {
    out << (confidence.parameters.any() ? "the filter" : "the timing filter") << " does not fit, "
        << advice(last) << ' ';
  }
  if (const std::int64_t others = inconsistencies_.total - before - 1; others > 0) {
    out << "In the same tick it did not fit " << others << (others == 1 ? " time" : " times")
        << " before. ";
  }
  if (confidence.has_replica) {
    out << "The estimate is the replica's.\n";
  } else if (confidence.scale_is_lost) {
    out << "Sigma is infinite from here on: no event determines the scale of this machine's "
           "motion.\n";
  } else {
    out << "Sigma is infinite until events have fitted again.\n";
  }
}

void ConfidenceRecord::to_json(nlohmann::ordered_json& report) const {
  report["redundant_closings"] = redundant_.total;
  report["refused_impacts"] = refused_.total;
  if (!any_) return;
  nlohmann::ordered_json& json = report["confidence"];
  if (last_.has_replica) {
    json["bound"] = {{"initial", or_null(initial_)}, {"final", or_null(last_.bound)}};
  }
  if (last_.bound_q.size() > 0) {
    json["bound"]["half_width_q"] = numbers(last_.bound_q);
    json["bound"]["half_width_g"] = numbers(last_.bound_g);
    json["refutations"] = refutations_.total;
  }
  const Innovation& closing = last_.has_replica ? last_.replica : last_.filter;
  if (closing.t >= 0.0) {
    json["last_closing"] = {{"t", closing.t}, {"contact", closing.contact + 1}};
    if (last_.has_replica) json["last_closing"]["replica_gap"] = last_.replica.gap;
    if (last_.has_filter) {
      json["last_closing"]["filter_gap"] = last_.filter.gap;
      json["last_closing"]["sigma_filter_gap"] = or_null(last_.filter.deviation);
    }
  }
  if (ticks_in_full_ > 0) {
    json["penetration"] = {
        {"ticks", penetrating_ticks_}, {"of_ticks", ticks_in_full_}, {"deepest", deepest_}};
  }
  if (!last_.has_filter) return;
  json["sigma_q"] = numbers(last_.sigma_q);
  json["sigma_u"] = numbers(last_.sigma_u);
  json["sigma_g"] = numbers(last_.sigma_g);
  if (last_.has_replica) json["ticks_from_filter"] = ticks_from_filter_;
  if (last_.parameters.any()) {
    report["adaptation"] = {{"identifications", identified_.total},
                            {"accepted", accepted_times_},
                            {"from_filter", last_.from_filter},
                            {"parameters", parameters_to_json(last_.parameters)}};
  }
  json["forgotten_covariances"] = forgotten_.total;
  json["inconsistencies"] = inconsistencies_.total;
  nlohmann::ordered_json& list = json["first_inconsistencies"] = nlohmann::ordered_json::array();
  for (const Inconsistency& one : first_) {
    list.push_back({{"t", one.t},
                    {"contact", one.contact + 1},
                    {"suspicion", name(one.suspicion)},
                    {"known_loss", one.known_loss},
                    {"square_over_variance", or_null(one.square)}});
  }
}

void ConfidenceRecord::print(bool verbose, std::ostream& out) const {
  if (!any_ || ticks_ == 0) return;
  if (last_.has_replica && std::isfinite(last_.bound)) {
    if (refutations_.total > 0) {
      out << "the filter's estimate was false " << refutations_.total
          << (refutations_.total == 1 ? " time" : " times") << ", by the guaranteed bound\n";
    }
    if (verbose) {
      out << "error energy of the replica at t = " << t_ << ": at most " << last_.bound << '\n';
    }
  }
  if (penetrating_ticks_ > 0) {
    out << "the estimate was inside a support at " << penetrating_ticks_ << " of " << ticks_in_full_
        << " ticks, by " << deepest_
        << " at most: the machine cannot be there; --states marks these ticks as `penetrating`\n";
  }
  if (!last_.has_filter) return;
  out << (last_.parameters.any() ? "filter of state and parameters: " : "timing filter: ");
  if (last_.has_replica) {
    out << 100.0 * static_cast<double>(ticks_from_filter_) / static_cast<double>(ticks_)
        << " % of the ticks, ";
  }
  out << "did not fit " << inconsistencies_.total << " times\n";
  if (last_.parameters.any()) print_parameters(last_.parameters, out);
}

}  // namespace sprag
