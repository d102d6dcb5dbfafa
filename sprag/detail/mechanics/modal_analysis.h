// Modal analysis of M q'' + C q' + K q = 0, with or without contacts locked: real modes where one
// transformation diagonalizes M, C and K, real oscillators from pairs of complex modes where none
// does.
//
// All in extended precision: a stiff beam's lowest frequency is ten decades below its highest, and
// an eigensolver is exact only on the scale of the highest.
#pragma once

#include <complex>
#include <vector>

#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag::modal {

using Real = Extended;
using Complex = std::complex<Real>;

/// M-orthonormal basis of null(W^T), f x (f - l); the columns of W belong to the contacts `locked`.
/// Throws ModelError when they are linearly dependent.
MatrixR constrained_basis(const MatrixR& M, const MatrixR& W, const std::vector<int>& locked);

/// Orthogonal V with V^T K V and V^T C V diagonal, if there is one.
bool diagonalize(const MatrixR& K, const MatrixR& C, MatrixR& V);

/// Eigenvalues at the eigensolver's noise are rigid-body motion: sets them to zero.
void drop_noise(VectorR& kappa);

/// Real second-order oscillators z'' + 2 delta z' + kappa z = 0 equivalent to y'' + C y' + K y = 0:
/// y = P z + R z', one oscillator for each complex pair or pair of real eigenvalues.
struct ComplexModes {
  VectorR delta, kappa;
  MatrixR P, R;
  /// [z; z'] = T^-1 [y; y'], 2r x 2r.
  MatrixR T_inverse;
};

/// K and C symmetric and positive semidefinite. Throws ModelError where the modes are defective in
/// a way that no oscillator has: more than two eigenvalues share one direction.
ComplexModes complex_modes(const MatrixR& K, const MatrixR& C);

/// Of z'' + 2 delta z' + kappa z = forcing e^(i Omega t), one oscillator a row.
struct Response {
  VectorCR steady;  ///< complex amplitude of the steady response; zero where `drive` is not
  VectorCR drive;   ///< the forcing where the steady response would be far beyond the motion: near
                    ///< resonance, and where next to nothing holds the oscillator
};

/// Forcing below `noise` times the largest is none.
Response response(const VectorR& delta, const VectorR& kappa, const VectorCR& forcing, Real Omega,
                  Real noise);

}  // namespace sprag::modal
