// Sampled inputs of a model and the machine's response to them.
//
// On a flow every mode has a particular response y_i(t) to the inputs, which starts at rest at the
// first knot. It is tabulated at the knots in advance, and exact between them. The oscillators of a
// motion are described relative to it, as they are relative to the steady response to harmonics. So
// a motion passes any number of knots in one step.
//
// The bank of oscillators (flow.h) has, after the harmonics, prescribed entries (z, z') that follow
// from the time alone: for each input (e, e'), (a, a') and (a'', a'''), then (y_i, y_i') of the
// modes.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/oscillators.h"
#include "sprag/detail/mechanics/polynomial_response.h"
#include "sprag/model.h"
#include "sprag/sampled_input.h"

namespace sprag {

/// Derivatives of one input: InputDerivatives of channel c are entries chain_terms c and following.
inline constexpr Eigen::Index chain_terms = 6;
/// Prescribed entries of the bank for each channel.
inline constexpr Eigen::Index chain_entries = chain_terms / 2;

/// The distinct inputs of a model, its channels, on one grid of knots.
class SampledInputs {
 public:
  SampledInputs() = default;
  explicit SampledInputs(const Model& model);

  bool empty() const { return channels_.empty(); }
  Eigen::Index channels() const { return static_cast<Eigen::Index>(channels_.size()); }
  const SampledInput& channel(Eigen::Index c) const {
    return *channels_[static_cast<std::size_t>(c)];
  }
  /// f(t) += forces() a(t), f x channels.
  const Eigen::MatrixXd& forces() const { return forces_; }
  /// s(t) += motions() e(t), m x channels.
  const Eigen::MatrixXd& motions() const { return motions_; }

  /// Whether the input is streamed: it is the only one then.
  bool streamed() const { return streamed_; }
  /// Number of knots for which a streamed input reserves memory.
  std::size_t most_knots() const;
  /// Takes new samples of a streamed input, or their removal. Does not allocate.
  void follow();

  std::size_t knots() const { return knots_.size(); }
  double knot(std::size_t k) const { return knots_[k]; }
  /// Length of interval k; infinity for the last.
  double length(std::size_t k) const;
  /// Common length of all intervals but the last; 0: they differ.
  double step() const { return step_; }
  /// The last k with knot(k) <= t, or 0.
  std::size_t interval(double t) const;
  /// Derivatives of all inputs on interval k at tau after its knot, chain_terms channels() entries.
  void derivatives(std::size_t k, double tau, double* of) const;
  /// Derivatives of input c at knot k.
  InputDerivatives at_knot(std::size_t k, Eigen::Index c) const;
  /// Adds `weight` f(t) of the inputs, f entries.
  void add_force(double t, double weight, Eigen::Ref<Eigen::VectorXd> force) const;

 private:
  std::vector<SampledInputPointer> channels_;
  Eigen::MatrixXd forces_, motions_;
  std::vector<double> knots_;
  // Per knot and channel: the channel's own interval; empty if all channels have the same knots.
  std::vector<std::size_t> own_;
  double step_ = 0.0;
  bool streamed_ = false;
};

/// The response of the modes of one flow.
class SampledResponse {
 public:
  /// Mode i obeys z'' + 2 delta z' + kappa z = forces.row(i) . (derivatives of the inputs), where
  /// `forces` has a row of chain_terms channels() for each mode. `first` is the bank's entry of the
  /// first channel, `first_mode` that of y_0. `inputs` must outlive this.
  SampledResponse(const SampledInputs& inputs, const Eigen::VectorXd& delta,
                  const Eigen::VectorXd& kappa, const Eigen::MatrixXd& forces, Eigen::Index first,
                  Eigen::Index first_mode);

  /// Takes new samples of a streamed input, or their removal. Does not allocate.
  void follow();

  const SampledInputs& inputs() const { return *inputs_; }
  Eigen::Index modes() const { return delta_.size(); }
  Eigen::Index first() const { return first_; }
  Eigen::Index first_mode() const { return first_mode_; }

  /// Sets the prescribed entries at t.
  void set(Instant t, OscillatorState& x) const;
  /// The same on interval k at tau after its knot.
  void set(std::size_t k, double tau, OscillatorState& x) const;

  /// Force on mode i and its derivatives, from the prescribed entries of x.
  PolynomialForce force(Eigen::Index i, const OscillatorState& x) const;

  /// y and y' at knot k, modes() entries each.
  const double* y(std::size_t k) const { return rows_.data() + k * row_; }
  const double* v(std::size_t k) const { return y(k) + delta_.size(); }

  /// Bounds over the block of `block` intervals with this number, for signals p y + r y' + ...: of
  /// |y''| and |y'''|, modes() entries each, and of the derivatives of the inputs.
  static constexpr std::size_t block = 32;
  std::size_t blocks() const { return (inputs_->knots() - 1 + block - 1) / block; }
  const double* largest_second(std::size_t number) const {
    return bounds_.data() + number * bound_row_;
  }
  const double* largest_third(std::size_t number) const {
    return largest_second(number) + delta_.size();
  }
  const double* largest_inputs(std::size_t number) const {
    return largest_second(number) + 2 * delta_.size();
  }

 private:
  PolynomialForce force(Eigen::Index i, const double* derivatives) const;
  void begin_table();
  void tabulate();
  void bound();

  const SampledInputs* inputs_;
  Eigen::Index first_, first_mode_;
  Eigen::VectorXd delta_, kappa_;
  Eigen::MatrixXd forces_;  // chain_terms channels x modes: a column is contiguous
  std::size_t row_ = 0, bound_row_ = 0;
  std::size_t tabulated_ = 0;          // knots in rows_
  std::vector<long double> y_, v_;     // at the last of them, modes() entries
  std::vector<PolynomialStep> steps_;  // of the modes, over length_of_steps_
  double length_of_steps_ = -1.0;
  std::vector<double> rows_;    // knot-major: y, y'
  std::vector<double> bounds_;  // block-major
};

/// Largest number of knots times coordinates: 128 MiB for each set of locked contacts.
inline constexpr std::size_t most_sampled_values = std::size_t{1} << 23U;

}  // namespace sprag
