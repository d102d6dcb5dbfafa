// Fixed-interval smoothing: every event of a recording speaks for the whole path. For impacts of
// single contacts whose times jitter.
//
// Along given times s_k of its impacts the machine's path is affine in its state x, and to first
// order in the errors d_k of these times:
//
//   0 = g_k(x) + gamma_k d_k,   x+ = J_k x- + b_k d_k,   d_k ~ N(t_k - s_k, sigma^2),
//
// t_k as reported, b_k what an impact that comes later makes of the state behind it. A Kalman
// filter runs through that, Bryson and Frazier's recursion (in its form for discrete times) back:
// with the innovations y of variances v, gains K and transitions F it takes no inverse of a
// covariance,
//
//   lambda^- = H^T y / v + (I - K H)^T lambda,   x_smoothed = x_filtered + P lambda, ...
//
// Then all s_k move to where the smoothed path has its impacts, and gamma_k and b_k with them,
// until nothing moves: Gauss and Newton's steps to the most likely path. What the model lacks
// (drift) is in P.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sprag/estimation/belief.h"
#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/error.h"
#include "sprag/mechanics/flows.h"
#include "sprag/mechanics/scene.h"

namespace sprag {

/// What cannot be smoothed; what() says why.
struct SmoothingError : Error {
  using Error::Error;
};

class Smoother {
 public:
  /// Throws ModelError, or SmoothingError where the scene gives no jitter, or the events do not
  /// tell the scale of the machine's motion.
  explicit Smoother(const Scene& scene);

  /// Puts the start at t = 0 with the scene's uncertainty, or at t with a mean and a covariance,
  /// 2f x 2f.
  void start();
  void start(double t, const Eigen::VectorXd& q, const Eigen::VectorXd& u,
             const Eigen::MatrixXd& covariance);

  /// Takes all events since the start, impacts of single contacts in order. Throws SmoothingError
  /// for others, and where no path is found that they fit.
  void take(std::span<const ContactEvent> events);

  /// What is known at t, not before the start, of q and u, f entries each, and their standard
  /// deviations, also of the gaps, m entries, and of the model's outputs. Around an impact that may
  /// or may not be over, mean and deviation of both.
  struct Estimate {
    Eigen::VectorXd q, u, sigma_q, sigma_u, sigma_gap, sigma_outputs;
  };
  void at(Instant t, Estimate& estimate);

  /// When an event was, by all of them, and its deviation [s].
  double time(std::size_t event) const { return impacts_[event].s; }
  double deviation(std::size_t event) const { return impacts_[event].sigma_time; }
  /// Mean square of (reported - smoothed time) over sigma^2 (1 - its share of the solution); about
  /// 1 where model and jitter are right.
  double misfit() const { return misfit_; }

 private:
  struct Impact {
    ContactEvent event;
    double s = 0.0;            // when it was [s]
    double gamma = 0.0;        // before it, on the path that it is linear about
    Eigen::VectorXd b;         // 2f
    Eigen::MatrixXd Phi;       // 2f x 2f: the flight to it
    Eigen::MatrixXd F;         // 2f x (2f + 1): the impact, of x and d
    Eigen::VectorXd H, K;      // 2f + 1
    double y = 0.0, v = 1.0;   // innovation and its variance
    Eigen::VectorXd before;    // x predicted, then smoothed
    Belief predicted, behind;  // what the filter knows
    Eigen::VectorXd lambda;    // of x before the impact, the impact heard
    Eigen::MatrixXd Lambda;
    double sigma_time = 0.0;
    double step = 0.0;     // from s to where the smoothed path has it [s]
    Eigen::VectorXd jump;  // u+ - u- on the path that it is linear about
  };

  void run_filter();
  void run_back();
  void fly(double tau, Belief& belief);
  Eigen::MatrixXd transition(double tau);
  void linearize(Impact& impact) const;
  bool passes_through();
  double move_times(double share);

  const Scene* scene_;
  std::shared_ptr<Flows> flows_;
  Uncertainty uncertainty_;
  Eigen::MatrixXd MinvC_;
  BeliefColumns columns_;
  Belief start_, unit_, here_;
  double begins_ = 0.0;
  std::vector<Impact> impacts_;
  bool linear_ = false;  // in d_k too
  double speed_ = 1.0;
  double misfit_ = 0.0;
  Terms terms_;  // the largest so far
  Motion motion_;
};

/// A part of a recording that is smoothed, and how many events it has.
struct SmoothedStretch {
  double from = 0.0, to = 0.0;  ///< [s]
  std::size_t events = 0;
  double misfit = 0.0;  ///< Smoother::misfit
  std::string failure;  ///< why the estimate is the filter's there after all; empty: it is not
};

/// Smooths a recording that has every event since t = 0. Where a contact stays closed, or the order
/// of impacts is not certain, the estimate is a timing filter's, and a stretch ends: what comes
/// later says nothing of it. take(k, estimate, smoothed) for ticks 0 to `last` in order. Throws
/// ModelError, SmoothingError, Interrupted.
std::vector<SmoothedStretch> smooth(
    const Scene& scene, std::span<const ContactEvent> events, double h, std::int64_t last,
    const std::function<void(std::int64_t, const Smoother::Estimate&, bool)>& take);

}  // namespace sprag
