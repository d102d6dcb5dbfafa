// Path of a machine with impacts at given times, whatever its gaps are at these times. The path is
// linear in its start and its inputs, z = (x0, inputs):
//
//   g_k(t_k) = A_k z,   gamma_k- = Gamma_k z.
//
// x0 = (y, y') at the start of a stretch is the free part of the motion, that is the motion minus
// the steady response to the harmonics and the response to the records with all contacts open, also
// while some are held.
#pragma once

#include <Eigen/Core>
#include <map>
#include <vector>

#include "sprag/detail/identification/held_flight.h"
#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/record.h"
#include "sprag/detail/mechanics/oscillators.h"

namespace sprag {

using RowMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The flights to the impacts of some stretches, each from the previous impact or the start. Free
/// flights depend on C and K alone and are computed again only if these or the times change.
/// Flights with passages or held contacts depend on the whole machine.
class Flights {
 public:
  void set(const Machine& machine, const Stretches& stretches);

  /// Moves columns of (y, y') in place to impact k of stretch s. To the columns from `inputs` on it
  /// adds the response to the unit inputs, the driving ones and J of constant forces, one each.
  void move(std::size_t s, std::size_t k, RowMatrix& Y, RowMatrix& U, Eigen::Index columns,
            Eigen::Index inputs) const;
  /// The same for one state with these inputs.
  void move(std::size_t s, std::size_t k, Eigen::VectorXd& y, Eigen::VectorXd& u,
            const Eigen::VectorXd& inputs) const;

  /// W lambda of the contacts that are held at the time t of an impact [s], for the state (y, u)
  /// before or after it.
  Eigen::VectorXd force(const Machine& machine, ContactSet held, double t, const Eigen::VectorXd& y,
                        const Eigen::VectorXd& u, const Eigen::VectorXd& inputs) const;

 private:
  static constexpr std::size_t none = static_cast<std::size_t>(-1);
  const HeldFlight& held_flight(ContactSet held);
  void set_free(const Machine& machine);
  void set_composed(const Machine& machine, const Stretches& stretches);
  void compose(const Stretch& stretch, std::size_t k);

  bool modal_ = true;
  Eigen::Index n_ = 0, driving_ = 0;
  Eigen::MatrixXd C_, K_, constant_forces_;
  std::vector<std::vector<double>> intervals_;
  std::vector<std::size_t> first_;            // index of the flight to each stretch's first impact
  std::vector<OscillatorStep> modes_;         // n for each flight
  std::vector<Eigen::MatrixXd> transitions_;  // 2n x (2n + J) for each flight
  // Flights with passages or held contacts.
  std::vector<std::size_t> number_;        // index of each flight in composed_, or none
  std::vector<Eigen::MatrixXd> composed_;  // 2n x (2n + driving inputs + J)
  std::map<ContactSet, HeldFlight> held_;  // for machine_
  Machine machine_;
  Stretches stretches_;  // of composed_; empty if there are no such flights
  mutable Eigen::VectorXd x_, moved_;
  mutable Eigen::MatrixXd X_, moved_columns_;
};

/// e^(i Omega_j t) at all impacts. Computed again only if frequencies or times change.
struct Harmonics {
  void set(const Eigen::VectorXd& frequencies, const Stretches& stretches);
  std::vector<Eigen::MatrixXcd> values;  ///< of each stretch: G x its impacts

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

/// Likewise at the start of a stretch, one row for each contact that was closed there: A for the
/// gap, Gamma for its velocity.
void start_rows(const Machine& machine, const Stretch& stretch, PathRows& rows);

struct Path {
  Eigen::VectorXd g, gamma, gamma_rate;  ///< before each impact
  Eigen::VectorXd y, u;                  ///< the free part after the last impact
  /// n x N: W lambda before each impact minus W lambda after it. Empty if no contact is ever held.
  Eigen::MatrixXd force_drop;
};

/// Derivative of the free part after impact k by the time of the impact: the impact comes later,
/// and with another velocity (part of the saltation matrix).
void effect_of_time(const Machine& machine, const Stretch& stretch, std::size_t k, const Path& path,
                    Eigen::VectorXd& on_y, Eigen::VectorXd& on_u);

void follow(const Machine& machine, const Flights& flights, const Harmonics& harmonics,
            const Stretch& stretch, std::size_t s, const Eigen::VectorXd& x0,
            const Eigen::VectorXd& inputs, Path& path);

/// d g_k / d t_j for the path of a stretch: lower triangular. `end`, if not null, receives the
/// derivatives of the free part after the last impact, 2n x impacts.
void time_derivatives(const Machine& machine, const Flights& flights, const Stretch& stretch,
                      std::size_t s, const Path& path, RowMatrix& G, RowMatrix* end = nullptr);

}  // namespace sprag
