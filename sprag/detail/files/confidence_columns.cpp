#include "sprag/detail/files/confidence_columns.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace sprag {
namespace {

// Defines names and values in one place, so that they stay consistent.
template <typename Column, typename Columns>
void visit_columns(const Confidence& confidence, double initial, const Column& column,
                   const Columns& columns) {
  const bool bounded =
      confidence.has_replica && (std::isfinite(initial) || confidence.bound_q.size() > 0);
  if (!confidence.has_filter && !bounded) return;
  const Innovation& closing = confidence.has_replica ? confidence.replica : confidence.filter;
  if (confidence.has_replica) column("B", confidence.bound);
  if (confidence.has_filter) {
    columns("sigma_q", confidence.sigma_q);
    columns("sigma_u", confidence.sigma_u);
    columns("sigma_g", confidence.sigma_g);
  }
  columns("bound_q", confidence.bound_q);
  columns("bound_g", confidence.bound_g);
  column("closing_t", closing.t);
  column("closing_contact", closing.t < 0.0 ? 0.0 : closing.contact + 1.0);
  if (confidence.has_replica) column("replica_gap", confidence.replica.gap);
  if (!confidence.has_filter) return;
  column("filter_gap", confidence.filter.gap);
  column("sigma_filter_gap", confidence.filter.deviation);
  if (confidence.has_replica) column("from_filter", confidence.from_filter ? 1.0 : 0.0);
  if (confidence.bound_q.size() > 0) {
    column("refutations", static_cast<double>(confidence.refutations));
  }
  column("inconsistencies", static_cast<double>(confidence.inconsistencies));
  const ParameterEstimates& parameters = confidence.parameters;
  if (!parameters.any()) return;
  column("accepted", parameters.accepted);
  Eigen::Index k = 0;
  for (const std::string& key : *parameters.keys) {
    column(key.c_str(), parameters.values[k]);
    column(("sigma_" + key).c_str(), parameters.sigmas[k]);
    ++k;
  }
}

}  // namespace

std::vector<std::string> confidence_columns(const Confidence& confidence, double initial) {
  std::vector<std::string> names;
  visit_columns(
      confidence, initial, [&](const char* name, double) { names.emplace_back(name); },
      [&](const std::string& name, const Eigen::VectorXd& values) {
        for (Eigen::Index i = 1; i <= values.size(); ++i) {
          names.push_back(name + std::to_string(i));
        }
      });
  return names;
}

void to_columns(const Confidence& confidence, double initial, std::vector<double>& values) {
  values.clear();
  visit_columns(
      confidence, initial, [&](const char*, double value) { values.push_back(value); },
      [&](const char*, const Eigen::VectorXd& of) {
        values.insert(values.end(), of.begin(), of.end());
      });
}

std::vector<std::string> output_columns(const std::vector<Output>& outputs, bool estimated,
                                        bool bounded) {
  std::vector<std::string> names;
  for (const Output& output : outputs) {
    names.push_back(output.name);
    if (estimated) names.push_back("sigma_" + output.name);
    if (bounded) names.push_back("bound_" + output.name);
  }
  return names;
}

void add_outputs(const std::vector<Output>& outputs, const Eigen::Ref<const Eigen::VectorXd>& q,
                 const Eigen::Ref<const Eigen::VectorXd>& u, const Eigen::VectorXd& sigma,
                 std::vector<double>& values, const Eigen::VectorXd* bounds) {
  Eigen::Index i = 0;
  for (const Output& output : outputs) {
    values.push_back(value(output, q, u));
    values.push_back(i < sigma.size() ? sigma[i] : std::numeric_limits<double>::infinity());
    if (bounds != nullptr) values.push_back((*bounds)[i]);
    ++i;
  }
}

bool is_column_of_states(std::string_view name) {
  constexpr std::string_view words[] = {
      "k",           "t",           "B",           "closing_t",       "closing_contact",
      "replica_gap", "filter_gap",  "from_filter", "inconsistencies", "accepted",
      "smoothed",    "penetrating", "refutations"};
  if (std::find(std::begin(words), std::end(words), name) != std::end(words)) return true;
  if (name.starts_with("sigma_") || name.starts_with("bound_")) return true;
  // Plain q and u columns are states; gaps appear as sigma_g and bound_g only, but their names are
  // reserved too.
  const bool numbered = name.starts_with('q') || name.starts_with('u') || name.starts_with('g');
  return numbered && name.size() > 1 &&
         name.find_first_not_of("0123456789", 1) == std::string_view::npos;
}

}  // namespace sprag
