#include "tools/report/analysis.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sprag::report {
namespace {

bool closes(double kind) { return kind != plot::opens_kind; }

}  // namespace

std::vector<ReportedEvent> reported_events(const plot::Table& table) {
  std::vector<ReportedEvent> events;
  const std::vector<double>& t = *table.column("t");
  const std::vector<double>& contact = *table.column("contact");
  const std::vector<double>* kind = table.column("kind");
  const std::vector<double>* closed = table.column("closed");
  for (std::size_t k = 0; k < t.size(); ++k) {
    const int number = static_cast<int>(contact[k]);
    if (kind != nullptr) {
      events.push_back({t[k], number, (*kind)[k]});
      continue;
    }
    if (closed == nullptr) continue;
    if ((*closed)[k] > 0.5) {
      events.push_back({t[k], number, plot::closes_kind});
      continue;
    }
    // An opening at the time of the contact's closing: both are a pulse.
    const auto last = std::find_if(events.rbegin(), events.rend(), [&](const ReportedEvent& event) {
      return event.contact == number || event.t < t[k];
    });
    if (last != events.rend() && last->contact == number && last->t == t[k] &&
        last->kind == plot::closes_kind) {
      last->kind = plot::impact_kind;
    } else {
      events.push_back({t[k], number, plot::opens_kind});
    }
  }
  return events;
}

Residuals normalized(const Residuals& residuals) {
  Residuals result;
  for (std::size_t k = 0; k < residuals.size(); ++k) {
    if (!std::isfinite(residuals.sigma[k]) || !(residuals.sigma[k] > 0.0)) continue;
    result.t.push_back(residuals.t[k]);
    result.value.push_back(residuals.value[k] / residuals.sigma[k]);
    result.sigma.push_back(1.0);
    result.contact.push_back(residuals.contact[k]);
  }
  return result;
}

std::optional<Consistency> consistency(const Residuals& normalized) {
  if (normalized.size() < fewest_residuals) return std::nullopt;
  Consistency result;
  result.n = normalized.size();
  const auto n = static_cast<double>(result.n);
  for (const double value : normalized.value) {
    result.mean_square += value * value / n;
    if (std::abs(value) <= 2.0) result.within_two += 1.0 / n;
  }
  // Quantiles of chi^2 / n by Wilson and Hilferty.
  const auto quantile = [n](double z) {
    const double part = 2.0 / (9.0 * n);
    return std::pow(1.0 - part + z * std::sqrt(part), 3.0);
  };
  constexpr double two_sided = 1.959964;
  result.low = quantile(-two_sided);
  result.high = quantile(two_sided);
  return result;
}

Residuals innovations(const plot::Table& states) {
  Residuals result;
  const auto* t = states.column("closing_t");
  const auto* contact = states.column("closing_contact");
  const auto* gap = states.column("filter_gap");
  const auto* sigma = states.column("sigma_filter_gap");
  if (t == nullptr || contact == nullptr || gap == nullptr || sigma == nullptr) return result;
  double last = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < t->size(); ++k) {
    if (!((*t)[k] >= 0.0) || (*t)[k] == last || !std::isfinite((*gap)[k])) continue;
    last = (*t)[k];
    result.t.push_back(last);
    result.contact.push_back(static_cast<int>((*contact)[k]));
    result.value.push_back((*gap)[k]);
    result.sigma.push_back((*sigma)[k] > 0.0 ? (*sigma)[k] : unknown);
  }
  return result;
}

PredictionCheck check_predictions(const plot::Table& predictions,
                                  const std::vector<ReportedEvent>& events, double jitter) {
  PredictionCheck check;
  const std::vector<double>& made_at = *predictions.column("made_at");
  const std::vector<double>& t = *predictions.column("t");
  const std::vector<double>& contact = *predictions.column("contact");
  const std::vector<double>* kind = predictions.column("kind");
  const std::vector<double>* sigma = predictions.column("sigma_t");
  if (kind == nullptr || sigma == nullptr) return check;
  for (std::size_t k = 0; k < made_at.size(); ++k) {
    if (k > 0 && made_at[k] == made_at[k - 1]) continue;  // the first event of each prediction
    if (!std::isfinite(t[k])) {
      ++check.none;
      continue;
    }
    const auto next = std::find_if(events.begin(), events.end(), [&](const ReportedEvent& event) {
      return event.t > made_at[k];
    });
    if (next == events.end()) {
      ++check.open_end;
    } else if (next->contact != static_cast<int>(contact[k]) ||
               closes(next->kind) != closes((*kind)[k])) {
      ++check.others;
    } else {
      check.errors.t.push_back(next->t);
      check.errors.contact.push_back(next->contact);
      check.errors.value.push_back(next->t - t[k]);
      check.errors.sigma.push_back(std::hypot((*sigma)[k], jitter));
    }
  }
  return check;
}

}  // namespace sprag::report
