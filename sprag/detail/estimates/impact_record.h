// What an estimator says of each event: the gap velocity before and after it, its impulse, and of a
// contact that was closed for a while the force. Recorded on request, for a table of impacts; it
// allocates, so that a real-time loop does without.
//
// Velocities and impulses are those of the estimator's own mean and covariance at the event: of a
// filter after it has learnt that the contact closes there. The impulses follow from the jump of
// the velocities, G Lambda = gamma+ - gamma- over the contacts that are struck or held, and so do
// their deviations, column by column of S. A contact force is linear in the state that its flow
// began with, so that its integral is a quadrature of one row; over several flows, as when other
// contacts are hit meanwhile, the deviations of the parts are added as they are, which is an upper
// bound.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <span>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/mechanics/dynamics.h"
#include "sprag/detail/mechanics/flow.h"

namespace sprag {

/// A number and its standard deviation; infinite where nothing is known of it.
struct Uncertain {
  double value = 0.0;
  double sigma = std::numeric_limits<double>::infinity();
};

struct ImpactRecord {
  double t = 0.0;   ///< as reported [s]
  int contact = 0;  ///< from 0
  ContactEventKind kind = ContactEventKind::pulse;
  bool from_filter = false;  ///< else it is the replica's
  Uncertain time;            ///< when it was, by all that is known then [s]
  Uncertain before, after;   ///< gap velocities [m/s]
  Uncertain impulse;         ///< [N s]
  /// Of a release, where the contact was held until then: its force behind the closing, before the
  /// release and where it was largest [N], and its impulse between them [N s], that of other
  /// contacts' impacts included.
  bool sustained = false;
  Uncertain force_begin, force_end, force_largest, force_impulse;
};

class ImpactRecorder {
 public:
  /// Appends to `records`; both must outlive this. `jitter`: sigma of event times [s]. Not
  /// `is_sure`: all deviations are infinite.
  ImpactRecorder(const Dynamics& dynamics, std::vector<ImpactRecord>& records, double jitter,
                 bool is_sure);

  /// No contact has been held so far.
  void start();

  /// The forces of a motion on its flow, for tau >= 0. S as of a Belief; none: nothing is known of
  /// the error.
  void fly(const Motion& from, double tau);
  void fly(const Motion& from, double tau, const Eigen::MatrixXd& S_q, const Eigen::MatrixXd& S_u,
           Eigen::Index columns);

  /// A force of zero was measured where the last flight ends, of a held contact: what its columns
  /// see, the residual and the variance of its noise.
  void measured_release(int contact, const Eigen::Ref<const Eigen::VectorXd>& phi, double residual,
                        double r);

  /// An instant: what is known of (q, u) before its impact and behind it, and its events. The
  /// contacts of `struck` may have taken impulses; columns that are new behind it were zero before.
  void before(const Belief& belief);
  void before(const Eigen::VectorXd& u);
  /// `rounding`: of gap velocities.
  void after(const Belief& belief, double rounding, double t, ContactSet struck,
             std::span<const ContactEvent> events);
  void after(const Eigen::VectorXd& u, double t, ContactSet struck,
             std::span<const ContactEvent> events);

  /// One event, whatever is known of it.
  void add(ImpactRecord record);
  /// An impulse on a contact that is held.
  void push(int contact, Uncertain impulse);

 private:
  struct Held {
    bool any = false;
    Uncertain begin, end, largest;
    double impulse = 0.0, deviation = 0.0;  ///< of the flights before the last one
    double last_impulse = 0.0;
    // What the columns of the last flight's start see; empty: not of that flight, or not known.
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
  Eigen::MatrixXd S_before_;      // f x columns; none: not known
  Eigen::MatrixXd Z_, V_;         // of a flight's start, in its flow's oscillators
  Eigen::ArrayXd row_z_, row_v_;  // what a force depends on
  OscillatorKernels kernels_;
  Motion there_;
};

}  // namespace sprag
