// Modal analysis of M q'' + C q' + K q = 0, with or without contacts locked: real modes where one
// transformation diagonalizes M, C and K, real oscillators from pairs of complex modes where none
// does.
//
// All in extended precision: a stiff beam's lowest frequency is ten decades below its highest, and
// an eigensolver is exact only on the scale of the highest.
#pragma once

#include <Eigen/Core>
#include <complex>
#include <vector>

namespace sprag::modal {

using Real = long double;
using Complex = std::complex<Real>;
using MatrixR = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using VectorR = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
using MatrixCR = Eigen::Matrix<Complex, Eigen::Dynamic, Eigen::Dynamic>;
using VectorCR = Eigen::Matrix<Complex, Eigen::Dynamic, 1>;

/// A B, A^-1 and M^-1 B, M symmetric and positive definite: functions, since every expression of
/// its own would compile its own kernels. A product with a diagonal A takes less time.
MatrixR product(const MatrixR& A, const MatrixR& B);
MatrixCR complex_product(const MatrixR& A, const MatrixCR& B);
MatrixR inverse(const MatrixR& A);
MatrixR solve_definite(const MatrixR& M, const MatrixR& B);

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
