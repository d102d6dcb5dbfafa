// Data common to all flows of one model: its matrices as in (2) of Baumann & Leine 2014, the
// frequencies and complex amplitudes of its excitation, and its gaps as functions of the physical
// state.
#pragma once

#include <Eigen/Core>
#include <complex>

#include "sprag/detail/mechanics/sampled_inputs.h"
#include "sprag/model.h"

namespace sprag {

/// A of the harmonic Re(A e^(i Omega t)). The real amplitude may be negative.
std::complex<double> complex_amplitude(const Harmonic& harmonic);
/// Its constant value if its frequency is zero, else 0.
double constant_part(const Harmonic& harmonic);

/// Affine function of the physical state: a^T q + b^T u + constant + Re sum_j h_j e^(i Omega_j t) +
/// chain^T d, where d are the derivatives of all sampled inputs (sampled_inputs.h).
struct Functional {
  Eigen::VectorXd a, b;
  double constant = 0.0;
  Eigen::VectorXcd h;
  Eigen::VectorXd chain = {};  ///< chain_terms entries for each input; empty without inputs
};

/// Frequencies, complex amplitudes, W, M^-1 W and G = W^T M^-1 W.
class Dynamics {
 public:
  /// Throws ModelError if the sizes do not match or M is not positive definite.
  explicit Dynamics(Model model);

  const Model& model() const { return model_; }
  Eigen::Index coordinates() const { return model_.coordinates(); }
  int contacts() const { return static_cast<int>(model_.contacts.size()); }
  bool diagonal() const { return diagonal_; }

  const Eigen::VectorXd& frequencies() const { return frequencies_; }
  const Eigen::MatrixXcd& force_amplitudes() const { return force_amplitudes_; }
  const Eigen::VectorXd& force_constant() const { return force_constant_; }
  const Eigen::MatrixXcd& motion_amplitudes() const { return motion_amplitudes_; }
  const Eigen::VectorXd& offsets() const {
    return offsets_;
  }  ///< c_i and constant motion, m entries
  const SampledInputs& inputs() const { return inputs_; }
  /// Takes new samples of a streamed input. Does not allocate.
  void follow_input() { inputs_.follow(); }
  const Eigen::MatrixXd& W() const { return W_; }          ///< f x m
  const Eigen::MatrixXd& MinvW() const { return MinvW_; }  ///< f x m
  const Eigen::MatrixXd& G() const { return G_; }          ///< m x m

  Functional gap(int contact) const;
  Functional gap_velocity(int contact) const;
  /// gamma_i' without contact forces.
  Functional free_acceleration(int contact) const;

 private:
  Model model_;
  bool diagonal_ = false;
  Eigen::VectorXd frequencies_, force_constant_, offsets_;
  Eigen::MatrixXcd force_amplitudes_, motion_amplitudes_;  // f x nf, m x nf
  Eigen::MatrixXd W_, MinvW_, G_;
  SampledInputs inputs_;

  Eigen::VectorXd support_chain(int contact, Eigen::Index order) const;
};

}  // namespace sprag
