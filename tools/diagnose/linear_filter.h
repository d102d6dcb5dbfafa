// What a model expects of recorded events, one instant after the other: a Kalman filter that is
// linear in the state and in what is not known of each event.
//
// Between events, at impacts and in what events say of the state it is the observer's own filter
// (sprag/estimation/timing_filter.h), with one difference. There an event whose time is off by tau
// ~ N(0, sigma^2) is a mixture over tau. Here tau, tau^2 and the products of tau with what is not
// known of gamma- and of its rate are normal unknowns of their instant: at the reported time g_i- =
// gamma_i- tau - gamma_i-' tau^2 / 2, and the impact was tau earlier, which moves q by (u+ - u-)
// tau, and u by what gamma_i- and the damping forces were otherwise meanwhile. That is right to
// second order in tau, for jitters that are small against the fastest mode's time 1 / omega_max.
//
// A diagnosis compares models by likelihoods. Innovations r that are normal, with a variance S of
// which all that is not known is a part, give it one that is smooth in the parameters and in sigma,
// for models too that do not fit at all; and it runs many thousand times.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "sprag/estimation/active_impact.h"
#include "sprag/estimation/belief.h"
#include "sprag/estimation/uncertainty.h"
#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/dynamics.h"
#include "sprag/mechanics/flow.h"
#include "sprag/mechanics/flows.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

/// What was expected of the last instant at which contacts closed: of the one whose gap was
/// farthest from zero.
struct ExpectedClosing {
  double t = -1.0;         ///< [s]; before the first one -1
  int contact = 0;         ///< from 0
  double gap = 0.0;        ///< [m]
  double deviation = 0.0;  ///< standard deviation of the gap, time and rounding included [m]
  double gamma = 0.0;      ///< gap velocity before the impact [m/s]
};

class LinearFilter {
 public:
  /// Puts the mean at `start` at time t with the contacts `closed`, with the uncertainty of a
  /// start, which must have a jitter > 0. Throws ModelError.
  LinearFilter(Model model, Uncertainty uncertainty, State start, Instant t, ContactSet closed);
  LinearFilter(const LinearFilter&) = delete;
  LinearFilter& operator=(const LinearFilter&) = delete;

  /// Moves the mean to the instant of these events, all of one, and applies them.
  void follow(std::span<const ContactEvent> of_one_instant);

  const ExpectedClosing& expected() const { return expected_; }
  /// Largest term of a gap so far [m].
  double length() const { return terms_.length; }
  /// Impacts decided by the mean, and sets of contacts that cannot be hit or held together.
  std::int64_t ambiguous_impacts() const { return ambiguous_impacts_; }
  std::int64_t refused_impacts() const { return refused_impacts_; }

  /// The share of the time between the last two instants for which a contact's gap was negative.
  double inside(int contact) const;

 private:
  const Dynamics& dynamics() const { return flows_.dynamics(); }
  Eigen::Index f() const { return dynamics().coordinates(); }
  void go_on(Instant t);

  // An instant with events.
  void drop_redundant(ContactSet held);
  void measure_release(int contact);
  void measure_closings();
  void add_event_unknowns();
  double condition(double residual, double noise, double scale);
  void strike(ContactSet staying, ContactSet leaving);
  ContactSet closing() const;
  void add_effect(Eigen::Index row, const Eigen::VectorXd& on_q, const Eigen::VectorXd& on_u);

  Flows flows_;
  Uncertainty uncertainty_;
  State start_;
  std::vector<Functional> acceleration_;  // gamma_i' without contact forces
  Eigen::MatrixXd MinvC_, MinvK_;

  ContactSet chi_;
  ContactSet inside_ = 0;  // closed since t = 0: the machine may have started inside the support
  BeliefColumns columns_;
  ActiveImpact impact_;
  Belief now_;  // at the last instant
  Motion motion_;
  Motion previous_;  // as it went on from the instant before
  ExpectedClosing expected_;
  Terms terms_;
  std::int64_t ambiguous_impacts_ = 0, refused_impacts_ = 0;

  // Scratch of an instant.
  Eigen::VectorXd u_before_, jump_, first_on_q_, first_on_u_, on_q_, on_u_;
  std::vector<Closing> closings_;
  Eigen::MatrixXd event_;  // rows of S of the event's own unknowns, and their means: tau, tau^2,
  Eigen::VectorXd event_mean_;  // tau times what is not known of each gamma- and of its rate
  Eigen::VectorXd phi_;         // what a measurement sees of each column
  Eigen::VectorXd no_gaps_;
};

}  // namespace sprag
