// Record of each event for a table of impacts: gap velocities before and after it, its impulse, and
// the force of a sustained contact that it ends. Made on request; allocates, so that a real-time
// loop does not use it.
//
// Velocities and impulses are those of the estimator's mean and covariance at the event; in a
// filter, after its update by the event. The impulses follow from the jump of the velocities, G
// Lambda = gamma+ - gamma- over the contacts that are struck or held. Their deviations follow in
// the same way from each column of S. A contact force is linear in the state at the start of its
// flow, so that its integral is a quadrature of one row. Over several flows, as when other contacts
// are hit meanwhile, the deviations of the parts are added, which is an upper bound.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/flow.h"
#include "sprag/impacts.h"

namespace sprag {

class ImpactRecorder {
 public:
  /// Appends to `records`; `dynamics` and `records` must outlive this. `jitter`: sigma of event
  /// times [s]. `is_sure` false: all deviations are infinite.
  ImpactRecorder(const Dynamics& dynamics, std::vector<ImpactRecord>& records, double jitter,
                 bool is_sure);

  /// Resets: no contact has been held so far.
  void start();

  /// Adds the forces of a motion on its flow, for tau >= 0. S as in Belief; without S the error is
  /// unknown.
  void fly(const Motion& from, double tau);
  void fly(const Motion& from, double tau, const Eigen::MatrixXd& S_q, const Eigen::MatrixXd& S_u,
           Eigen::Index columns);

  /// A force of zero of a held contact was measured at the end of the last flight: the
  /// measurement's phi, residual and noise variance, as in PotterUpdate.
  void measured_release(int contact, const Eigen::Ref<const Eigen::VectorXd>& phi, double residual,
                        double r);

  /// An impact: belief about (q, u) before and after it, and its events. Contacts in `struck` may
  /// have received impulses. Columns that are new after it were zero before.
  void before(const Belief& belief);
  void before(const Eigen::VectorXd& u);
  /// `rounding`: standard deviation of rounding in gap velocities.
  void after(const Belief& belief, double rounding, double t, ContactSet struck,
             std::span<const ContactEvent> events);
  void after(const Eigen::VectorXd& u, double t, ContactSet struck,
             std::span<const ContactEvent> events);

  /// Appends one event, with the force of the sustained contact that it ends.
  void add(ImpactRecord record);
  /// Adds an impulse on a held contact.
  void push(int contact, Uncertain impulse);

 private:
  struct Held {
    bool any = false;
    Uncertain begin, end, largest;
    double impulse = 0.0, deviation = 0.0;  ///< sums over the flights before the last one
    double last_impulse = 0.0;
    // Derivatives by the columns of S at the last flight's start; empty: not of that flight, or
    // unknown.
    Eigen::VectorXd phi_begin, phi_end, phi_largest, phi_impulse;
  };

  void fly(const Motion& from, double tau, bool known);
  void see(const Flow& flow, const Eigen::ArrayXd& row_z, const Eigen::ArrayXd& row_v,
           Eigen::VectorXd& phi) const;
  void find_row(const Flow& flow, const Signal& force, double tau);
  void after(const Eigen::VectorXd& u, const Eigen::MatrixXd* S, double rounding, double t,
             ContactSet struck, std::span<const ContactEvent> events);
  void close(Held& held) const;

  const Dynamics* dynamics_;
  std::vector<ImpactRecord>* records_;
  double jitter_;
  bool is_sure_;
  std::vector<Held> held_;  // per contact
  Eigen::VectorXd u_before_;
  Eigen::MatrixXd S_before_;      // f x columns; empty: unknown
  Eigen::MatrixXd Z_, V_;         // S at a flight's start, in its flow's oscillators
  Eigen::ArrayXd row_z_, row_v_;  // a force as a linear function of the flight's start
  OscillatorKernels kernels_;
  Motion there_;
};

}  // namespace sprag
