// What a filter knows of the state x = (q, u) at an instant: mean and a square root S of the
// covariance, P = S S^T. And what a report says that is to be made of it.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>

#include "sprag/estimation/uncertainty.h"
#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/dynamics.h"
#include "sprag/mechanics/flow.h"

namespace sprag {

struct Belief {
  /// Most Gaussians that a belief is made of.
  static constexpr int most_components = 12;

  Eigen::VectorXd q, u;      ///< mean, f entries each
  Eigen::MatrixXd S_q, S_u;  ///< f rows each; the first `columns` columns are S
  Eigen::Index columns = 0;
  /// Behind an event of unknown time it is known better than by one Gaussian: as several, of one
  /// covariance and these weights. Each of the first `components` columns of S belongs to one: its
  /// mean is off by the column over the root of its weight. The others are S of each. All columns
  /// together are those of the one Gaussian with the same mean and covariance.
  int components = 0;
  std::array<double, most_components> weights{};
};

/// The covariance of a start; the mean stays.
void set_start(const Uncertainty& uncertainty, Belief& belief);

/// What the model lacks in tau >= 0: as many columns more as `uncertainty` has of drift.
void add_drift(const Uncertainty& uncertainty, double tau, Belief& belief);

/// Whether mean and covariance are numbers that can be gone on with.
bool is_sane(const Belief& belief);

/// Of a functional of (q, u), its constant left out.
double variance(const Functional& of, const Belief& belief);

/// A measurement of standard deviation below this share of its terms tells nothing but their
/// rounding.
inline constexpr double measurement_rounding = 32.0 * std::numeric_limits<double>::epsilon();

/// Impacts happen at doubles: none is at its time but up to this share of it.
inline constexpr double time_step = std::numeric_limits<double>::epsilon();

/// A scalar measurement by Potter's square root: residual = measured - expected, `phi` what it sees
/// of each column of S, r the variance of its noise. With alpha = phi^T phi + r and K = S phi /
/// alpha
///
///   x += K residual,   S -= K phi^T / (1 + sqrt(r / alpha)).
class PotterUpdate {
 public:
  /// `phi` must outlive this.
  PotterUpdate(Eigen::Ref<const Eigen::VectorXd> phi, double residual, double r);

  /// Of some rows x of what is estimated, and the same rows of S. Does not allocate.
  void apply(Eigen::Ref<Eigen::VectorXd> x, Eigen::Ref<Eigen::MatrixXd> S) const;

 private:
  Eigen::Ref<const Eigen::VectorXd> phi_;
  double gain_, shrink_;
};

/// Moves and merges the columns of beliefs of one machine: nothing but scratch, so that neither
/// allocates.
class BeliefColumns {
 public:
  BeliefColumns() = default;
  /// For up to `columns` columns; `free` is the machine's free flight, f its coordinates.
  BeliefColumns(const Flow& free, Eigen::Index f, Eigen::Index columns);

  /// S on this flow for tau; nothing where tau is not positive. The mean stays.
  void move(const Flow& flow, double tau, Belief& belief);

  /// phi: what a signal of this flow sees of each column, `columns` entries of `phi`. Returns the
  /// root of the sum of squares of what their terms are together: roundings are in proportion.
  double see(const Flow& flow, const Signal& signal, const Belief& belief, Eigen::VectorXd& phi);

  /// Householder reflections of S^T leave P = S S^T as it is and, of more than 4 f columns, all but
  /// 2 f zero. Those of components stay.
  void merge(Belief& belief);

 private:
  Eigen::MatrixXd z_, v_;  // S in a flow's oscillators
  OscillatorKernels kernels_;
  Eigen::MatrixXd merged_;  // columns x 2 f
};

/// Largest terms of gaps [m] and of their velocities [m/s]: their roundings are in proportion.
struct Terms {
  double length = 0.0, speed = 0.0;

  void include(const Contact& contact, const Eigen::VectorXd& q, const Eigen::VectorXd& u);
  /// Of each coordinate at q, u, where the contacts' directions have entries up to `largest_w`: a
  /// machine that was not hit yet has no terms but these.
  Terms of_coordinates(const Eigen::VectorXd& q, const Eigen::VectorXd& u, double largest_w) const;
};

/// Sum of the absolute terms of a signal.
double largest_terms(const Signal& signal, const Motion& motion);

/// An event of one contact at a time that is not quite known.
struct UncertainEvent {
  enum class Kind : std::int8_t {
    none,     ///< no event, or several at one instant
    known,    ///< says nothing that is not known by another's report
    pulse,    ///< an impact
    sticks,   ///< an impact without restitution: the contact stays closed
    burst,    ///< an impact so soon after the last that their times cannot be told apart
    stays,    ///< bounces have come to an end: the contact stays closed
    releases  ///< of a contact that was locked
  };
  Kind kind = Kind::none;
  int contact = 0;
  ContactSet held = 0;  ///< other contacts, closed before and after
  int in_row = 0;       ///< of a burst: how many since a pulse that was none, counting it
  /// Of a release: how long the contact had been closed, by the reports [s].
  double held_for = std::numeric_limits<double>::infinity();
  /// When the contact's last event was, by what was known then: how long before the report [s], and
  /// the deviation of that.
  double since_last = std::numeric_limits<double>::infinity(), since_deviation = 0.0;
  /// For how long surely nothing has happened to the machine that has been reported [s].
  double quiet_for = std::numeric_limits<double>::infinity();
};

/// One whose time is told by the gap, and which changes the gap velocity.
inline bool is_impact(const UncertainEvent& event) {
  return event.kind == UncertainEvent::Kind::pulse || event.kind == UncertainEvent::Kind::sticks;
}

}  // namespace sprag
