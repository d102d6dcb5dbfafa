// The path of a machine that is hit at given times, whatever its gaps are then. It is linear in
// where it starts and in what drives it, z = (x0, inputs):
//
//   g_k(t_k) = A_k z,   gamma_k- = Gamma_k z,
//
// x0 = (y, y') at the start of a stretch being the free part of the motion: the machine moves about
// its steady response to the harmonics.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/identification/machine_family.h"
#include "sprag/identification/record.h"
#include "sprag/mechanics/oscillators.h"

namespace sprag {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The free flights between the impacts of some stretches, which depend on C and K alone; made
/// again only where these, or the times, are others than before.
class Flights {
 public:
  void set(const Machine& machine, const Stretches& stretches);

  /// Moves columns of (y, y'), in place, to impact k of stretch s from the impact before it, or
  /// from the start. The columns from `forced` on take the constant forces as well, one each.
  void move(std::size_t s, std::size_t k, RowMatrix& Y, RowMatrix& U, Eigen::Index columns,
            Eigen::Index forced) const;
  /// The same for one state; `constants` are the factors on the constant forces.
  void move(std::size_t s, std::size_t k, Eigen::VectorXd& y, Eigen::VectorXd& u,
            const Eigen::VectorXd& constants) const;

 private:
  bool modal_ = true;
  Eigen::Index n_ = 0;
  Eigen::MatrixXd C_, K_, constant_forces_;
  std::vector<std::vector<double>> intervals_;
  std::vector<std::size_t> first_;            // flight of each stretch's first impact
  std::vector<OscillatorStep> modes_;         // n a flight
  std::vector<Eigen::MatrixXd> transitions_;  // 2n x (2n + J) a flight
  mutable Eigen::VectorXd x_, moved_;
  mutable Eigen::MatrixXd X_, moved_columns_;
};

/// e^(i Omega_j t) at all impacts, made again only where frequencies or times are others.
struct Harmonics {
  void set(const Eigen::VectorXd& frequencies, const Stretches& stretches);
  std::vector<Eigen::MatrixXcd> values;  ///< a stretch: G x its impacts

 private:
  Eigen::VectorXd frequencies_;
  std::vector<std::vector<double>> times_;
};

struct PathRows {
  RowMatrix A, Gamma;  ///< impacts x (2n + inputs)
};

/// The rows of one stretch.
void path_rows(const Machine& machine, const Flights& flights, const Harmonics& harmonics,
               const Stretch& stretch, std::size_t s, PathRows& rows);

/// Likewise at the start of a stretch that begins with a release: A is the gap's row, Gamma its
/// velocity's.
void release_rows(const Machine& machine, const Stretch& stretch, PathRows& rows);

struct Path {
  Eigen::VectorXd g, gamma, gamma_rate;  ///< before each impact
  Eigen::VectorXd y, u;                  ///< the free part after the last impact
};

void follow(const Machine& machine, const Flights& flights, const Harmonics& harmonics,
            const Stretch& stretch, std::size_t s, const Eigen::VectorXd& x0,
            const Eigen::VectorXd& inputs, Path& path);

/// d g_k / d t_j of a stretch whose path is this one: lower triangular. `end`, where it is not
/// null, takes what they make of the free part after the last impact, 2n x impacts.
void time_derivatives(const Machine& machine, const Flights& flights, const Stretch& stretch,
                      std::size_t s, const Path& path, RowMatrix& G, RowMatrix* end = nullptr);

}  // namespace sprag
