// Modal analysis of M q'' + C q' + K q = 0, with or without locked contacts: real modes if one
// transformation diagonalizes M, C and K, else real oscillators from pairs of complex modes.
//
// All in extended precision: a stiff beam's lowest frequency may be ten decades below its highest,
// and the error of an eigensolver is relative to the highest.
#pragma once

#include <complex>
#include <vector>

#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag::modal {

using Real = Extended;
using Complex = std::complex<Real>;

/// M-orthonormal basis of null(W^T), f x (f - l). The columns of W belong to the contacts `locked`.
/// Throws ModelError if they are linearly dependent.
MatrixR constrained_basis(const MatrixR& M, const MatrixR& W, const std::vector<int>& locked);

/// Finds an orthogonal V with V^T K V and V^T C V diagonal. Returns whether there is one.
bool diagonalize(const MatrixR& K, const MatrixR& C, MatrixR& V);

/// Sets eigenvalues at the noise level of the eigensolver to zero: they are rigid-body motion.
void drop_noise(VectorR& kappa);

/// Real second-order oscillators z'' + 2 delta z' + kappa z = 0 equivalent to y'' + C y' + K y = 0:
/// y = P z + R z', one oscillator for each complex pair or pair of real eigenvalues.
struct ComplexModes {
  VectorR delta, kappa;
  MatrixR P, R;
  /// [z; z'] = T^-1 [y; y'], 2r x 2r.
  MatrixR T_inverse;
};

/// K and C symmetric and positive semidefinite. Throws ModelError if more than two eigenvalues
/// share one direction: no oscillator has such a defective mode.
ComplexModes complex_modes(const MatrixR& K, const MatrixR& C);

/// Response of z'' + 2 delta z' + kappa z = forcing e^(i Omega t), one oscillator per row.
struct Response {
  VectorCR steady;  ///< complex amplitude of the steady response; zero where `drive` is not
  VectorCR drive;   ///< the forcing where the steady response is much larger than the motion: near
                    ///< resonance and with very low stiffness; else zero
};

/// Forcing below `noise` times the largest counts as zero.
Response response(const VectorR& delta, const VectorR& kappa, const VectorCR& forcing, Real Omega,
                  Real noise);

}  // namespace sprag::modal
