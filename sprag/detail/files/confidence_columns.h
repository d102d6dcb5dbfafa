// What an estimate says of its own error, as columns of a states CSV.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "sprag/detail/estimates/confidence.h"
#include "sprag/model.h"

namespace sprag {

/// Columns that hold a Confidence, behind those of the state; none where nothing is estimated. For
/// a bound alone: `B`, its half-widths `bound_q1`, ..., `bound_g1`, ..., `closing_t`,
/// `closing_contact`, `replica_gap`. `initial` is B(0). Parameters have the columns `accepted` and,
/// by their keys, `KEY` and `sigma_KEY`.
std::vector<std::string> confidence_columns(const Confidence& confidence, double initial);

/// Columns of outputs: NAME and sigma_NAME each, and where `bounded` bound_NAME; of a machine that
/// is no estimate only NAME.
std::vector<std::string> output_columns(const std::vector<Output>& outputs, bool estimated,
                                        bool bounded = false);

/// Appends the values of an estimate of (q, u) in these columns, with one sigma each, or none
/// without a filter: they are infinite then. `bounds` has one half-width each, or none.
void add_outputs(const std::vector<Output>& outputs, const Eigen::Ref<const Eigen::VectorXd>& q,
                 const Eigen::Ref<const Eigen::VectorXd>& u, const Eigen::VectorXd& sigma,
                 std::vector<double>& values, const Eigen::VectorXd* bounds = nullptr);

/// Whether a states CSV may already have a column of this name.
bool is_column_of_states(std::string_view name);

/// The values in these columns; `values` keeps its room.
void to_columns(const Confidence& confidence, double initial, std::vector<double>& values);

}  // namespace sprag
