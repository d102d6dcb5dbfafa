// State and unknowns of a scene's machine (machine_family.h) from the times of single impacts, as
// one extended Kalman filter over z = (y, y', c). The unknowns' coordinates c take a slow random
// walk. At an impact that is reported at t_m, its true time t_m - tau with tau ~ N(0, sigma^2) is
// estimated with z:
//
//   g(z, t_m - tau) = 0,
//
// by Gauss and Newton's steps from the mean (an iterated update), and what the impact makes of z is
// linear about where they end. The covariance is S S^T, conditioned by Potter's square root and
// brought back to as many columns as rows by Householder reflections.
//
// By itself such a filter diverges where its unknowns begin a few percent off. It is to start from
// a batch (maximum_likelihood.h): follow() leads it along the path that was found.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "sprag/adaptation/joint_flight.h"
#include "sprag/estimation/innovation.h"
#include "sprag/identification/maximum_likelihood.h"

namespace sprag {

/// What is known of z behind the last impact, at t.
struct JointBelief {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

  double t = 0.0;
  int held = -1;       ///< the contact that is closed since, -1: none
  bool burst = false;  ///< its impacts follow each other too fast to be told apart
  Eigen::VectorXd z;   ///< 2n + P entries
  Rows S;              ///< square
  double sigma = 0.0;  ///< of event times [s]
  Innovation innovation;
  double square = 0.0;  ///< of the last innovation, over its variance
  double length = 0.0;  ///< the largest terms of a gap so far
};

class JointFilter {
 public:
  /// The family must be modal and outlive this; its scene says how far the unknowns walk.
  explicit JointFilter(const MachineFamily& family);

  /// Standard deviation of the walk of each coordinate after a unit of time, P entries.
  const Eigen::VectorXd& walk() const { return walk_; }

  Eigen::Index n() const { return flight_.n(); }
  Eigen::Index unknowns() const { return flight_.unknowns(); }
  JointBelief no_belief() const;

  /// Takes an impact: belief.square and belief.innovation say how it fits. False, and the belief of
  /// no use, where none follows from it. `stays`: the contact is closed from then on. Does not
  /// allocate.
  bool take(int contact, double t, bool stays, JointBelief& belief);

  /// Takes impacts that follow each other too fast to be told apart, this one and those to come,
  /// for a chatter that has come to its end: belief.burst. False where it would take longer than
  /// `longest`. Does not allocate.
  bool take_burst(int contact, double t, double longest, JointBelief& belief);

  /// The contact that is closed opens.
  void release(double t, JointBelief& belief);

  /// Steps that at() takes for this t: many where a contact has been closed for long.
  double cost(double t, const JointBelief& belief) const;

  /// Along a path of given true times from where its stretches start, linearized about that path.
  /// `belief` is what is known behind the last impact then. Allocates.
  void follow(const Likelihood& path, const Stretches& measured, double sigma, JointBelief& belief);

  /// Forgets the state: it is x then, with the deviations S_x, 2n x 2n; of c all stays known that
  /// is, but for its walk. Does not allocate.
  void restart(double t, const Eigen::Ref<const Eigen::VectorXd>& x,
               const Eigen::Ref<const Eigen::MatrixXd>& S_x, JointBelief& belief);

  /// The mean at t, (y, y'); valid until the next call.
  const Eigen::VectorXd& at(double t, const JointBelief& belief);
  /// After at(): a contact's gap there.
  double gap(int contact) const { return present_.gap(contact).g; }
  /// The deviations at t: 2n rows, of (y, y'), and m rows, of the gaps. Does not allocate.
  void deviations(double t, const JointBelief& belief, JointBelief::Rows& of_x,
                  JointBelief::Rows& of_gaps);

 private:
  // Where an impact is linearized.
  struct Point {
    Eigen::VectorXd z;
    double tau = 0.0;
  };
  // What the linearized impact says, before it is taken.
  struct Residual {
    double value = 0.0, variance = 0.0, noise = 0.0;
    double square() const { return value * value / variance; }
  };

  Eigen::Index size() const { return 2 * n() + unknowns(); }
  void spread(const JointBelief& belief, double duration, double sigma);
  void linearize(int contact, double t0, double t);
  Residual expect(const JointBelief& belief);
  void condition(const Residual& residual);
  void carry_columns(bool struck);
  void triangularize(Eigen::Index rows, Eigen::Index columns);
  void keep(JointBelief& belief) const;
  std::vector<double> largest(const Likelihood& path, const Eigen::VectorXd& c);
  Eigen::VectorXd start_of(const Likelihood& path, std::size_t s) const;

  const MachineFamily* family_;
  Eigen::VectorXd walk_;
  JointFlight flight_, present_;

  JointBelief::Rows A_;      // z by columns: those of S, of the walk, of tau
  Eigen::VectorXd tau_row_;  // tau by columns
  Eigen::VectorXd h_;        // d g / d z
  JointFlight::Gap gap_;
  Eigen::VectorXd phi_, gain_, dx_, column_;
  double gain_of_tau_ = 0.0;
  Point point_;  // and from there on the mean behind the impact
};

}  // namespace sprag
