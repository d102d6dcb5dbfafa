// Columns of a states CSV that describe the error of an estimate, in the form of a Confidence.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "sprag/confidence.h"
#include "sprag/model.h"

namespace sprag {

/// Names of the columns of a Confidence, which follow those of the state. Empty if it has neither
/// sigma nor a finite bound. With a replica alone: `B`, its half-widths `bound_q1`, ...,
/// `bound_g1`, ..., `closing_t`, `closing_contact`, `replica_gap`. `initial` is B(0). Parameters
/// have the columns `accepted` and, for each key, `KEY` and `sigma_KEY`.
std::vector<std::string> confidence_columns(const Confidence& confidence, double initial);

/// Columns of outputs: NAME for each, with `estimated` also sigma_NAME, with `bounded` also
/// bound_NAME. The state of a simulated machine has neither.
std::vector<std::string> output_columns(const std::vector<Output>& outputs, bool estimated,
                                        bool bounded = false);

/// Appends the values of the outputs of an estimate (q, u) in these columns. `sigma` has one entry
/// per output, or none without a filter; sigma is infinite then. `bounds` has one half-width per
/// output, or is null.
void add_outputs(const std::vector<Output>& outputs, const Eigen::Ref<const Eigen::VectorXd>& q,
                 const Eigen::Ref<const Eigen::VectorXd>& u, const Eigen::VectorXd& sigma,
                 std::vector<double>& values, const Eigen::VectorXd* bounds = nullptr);

/// Whether a states CSV may contain a column of this name without the outputs.
bool is_column_of_states(std::string_view name);

/// Values in the order of confidence_columns(); `values` keeps its capacity.
void to_columns(const Confidence& confidence, double initial, std::vector<double>& values);

}  // namespace sprag
