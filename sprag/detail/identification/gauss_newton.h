// Least squares over the parameters theta of a machine, the starts of the stretches and the true
// times tau of the events:
//
//   minimize  sum ((tau_k - t_k) / sigma)^2 + sum (g_k(tau_k) / (eta |gamma_k-|))^2,
//
// where g_k is the gap of an event's contact along the path with impacts at tau, or the force of a
// contact that opens. eta is far below sigma: the gaps are zero. Along fixed tau the path is linear
// in the start and does not amplify deviations, so the search also converges for chaotic machines.
//
// One step is an information sweep in square-root form (Bierman 1977) from the last event to the
// first. It carries rows R (x, theta | rhs) of the deviations of the state x after an event. With
//
//   dx_k = A dx_k-1 + s dtau_k + B dtheta
//
// it replaces x_k by x_k-1 and tau_k, adds the rows of event k and eliminates dtau_k. No matrix is
// inverted, so plastic impacts need no special case. The cost is linear in the number of events.
#pragma once

#include <Eigen/Core>
#include <array>
#include <utility>
#include <vector>

#include "sprag/detail/filter/family_flight.h"
#include "sprag/detail/identification/events.h"
#include "sprag/identification.h"

namespace sprag {

struct FitPoint {
  Eigen::VectorXd c;                       ///< coordinates of the parameters
  std::vector<Eigen::VectorXd> starts;     ///< x of each stretch
  std::vector<std::vector<double>> times;  ///< tau of each stretch
};

struct EventFit {
  std::vector<FitStretch> stretches;
  FitPoint point;
  double sigma = 0.0;          ///< sigma of the times during the fit [s]
  double cost = 0.0;           ///< see above, with priors
  double squares = 0.0;        ///< sum of (tau - t)^2 over events with a time [s^2]
  int freedom = 1;             ///< equations minus unknowns, at least 1
  Eigen::MatrixXd covariance;  ///< of c, for `sigma`
  /// Share of each parameter's effect on the events that no start and no other parameter has.
  Eigen::VectorXd own_share;
  std::vector<std::vector<double>> velocities;  ///< gap velocities (or rates of force) at events
  Eigen::VectorXd last;                         ///< x after the last event of the first stretch
  bool converged = false;
  double remaining = 0.0;  ///< decrease of the cost that the last step promised

  std::size_t events() const;
  double variance() const { return squares / freedom; }
  /// Residuals tau - t of events with a time.
  std::vector<double> residuals() const;
};

/// Random departures from the model, besides the jitter of the times.
struct FitNoise {
  double drift = 0.0;        ///< process noise, energy per unit of time
  double restitution = 0.0;  ///< standard deviation of the restitution of one impact
};

/// Departures from the model that GaussNewton can add as one more unknown each: Misfit's causes.
inline constexpr std::array linear_causes{Cause::restitution_by_speed, Cause::friction,
                                          Cause::soft_stop, Cause::restitution_by_time,
                                          Cause::clock_rate};

/// An effect whose share apart from those of other unknowns is smaller is not determined: the
/// derivatives by differences are not better.
inline constexpr double least_own_share = 1e-5;

class GaussNewton {
 public:
  /// Throws ModelError if M is not positive definite.
  GaussNewton(const Scene& scene, const std::vector<Parameter>& unknowns, bool strictly_within);

  /// Nothing sets the scale of the motion: the first impact of a stretch has speed 1.
  void fix_speed() { fixes_speed_ = true; }
  /// Errors of times that are no errors of a path along recorded times [s].
  void resolve(double time) { resolution_ = time; }

  FamilyFlight& flight() { return flight_; }
  Eigen::Index parameters() const { return P_; }
  Eigen::Index n() const { return n_; }
  const Eigen::VectorXd& low() const { return low_; }
  const Eigen::VectorXd& high() const { return high_; }
  const Eigen::VectorXd& scale() const { return scale_; }

  /// Solution with the times held at the recorded ones: `score` is the root mean square of g over
  /// gamma [s], increased where an impact would come from inside.
  struct Held {
    Eigen::VectorXd c;
    std::vector<Eigen::VectorXd> starts;
    double score = 0.0, rms = 0.0;
  };
  /// The best starts for these parameters.
  Held project(const std::vector<FitStretch>& stretches, const Eigen::VectorXd& c);
  /// Levenberg-Marquardt from c.
  Held hold(const std::vector<FitStretch>& stretches, const Eigen::VectorXd& c, int iterations);
  /// Gauss-Newton over all unknowns from `point`. Parameter number `fixed` keeps its value.
  EventFit refine(std::vector<FitStretch> stretches, FitPoint point, double sigma, int iterations,
                  Eigen::Index fixed = -1);

  /// The minimum to first order about the fit of a machine that differs a little.
  EventFit stepped(EventFit fit);

  /// A departure from the model as one more unknown, to first order about a fit.
  struct Effect {
    double value = 0.0, sigma = 0.0;  ///< for the fit's sigma of times
    double gain = 0.0;                ///< what it takes from the cost
  };
  /// Effects of `linear_causes`, beside this noise. A restitution by speed is in units of the
  /// restitution per typical_speed().
  std::array<Effect, linear_causes.size()> effects(const EventFit& fit, const FitNoise& noise);
  /// Median speed of the impacts of the last path.
  double typical_speed() const { return paths_.front().typical; }

  /// Restricted likelihood (Patterson & Thompson 1971) of the times about a fit with noise.
  struct Likelihood {
    double squares = 0.0;             ///< sum of squares that no start and no parameter explains
    double logs = 0.0;                ///< twice the logarithm of the square root of the determinant
    Eigen::VectorXd changes, sigmas;  ///< of c from the fit; for the fit's sigma
  };
  Likelihood likelihood(const EventFit& fit, const FitNoise& noise);

  /// Uncertainty along a fit.
  struct Spread {
    /// Share of the error of each time that the fit absorbs, 0 to 1.
    std::vector<std::vector<double>> leverage;
    Eigen::MatrixXd start;  ///< covariance of x at the first start, for the fit's sigma
  };
  Spread spread(const EventFit& fit);

  /// Errors of predicting each recorded time from the path along the times before it [s].
  std::vector<std::vector<double>> misses(const EventFit& fit);

 private:
  struct Row {  // linearization at one event
    Eigen::MatrixXd A, B, noise;
    Eigen::VectorXd s, by_x, velocity_by_x, by_c, by_noise, of_time, eliminated;
    double g = 0.0, gamma = 0.0, weight = 0.0;
  };
  struct Path {
    std::vector<Row> rows;
    Eigen::MatrixXd of_held;  // rows of (x, theta | rhs) of contacts closed at the start
    Eigen::MatrixXd R;        // of (x, theta | rhs) at the start
    Eigen::VectorXd end;
    Eigen::VectorXd prior;  // inverse standard deviations of the start
    double typical = 0.0;   // speed
    double logs = 0.0;      // of the diagonal entries of eliminated variables

    void set_typical(const FitStretch& stretch);
  };
  enum class Times { held, free };

  void fly(const FitStretch& stretch, const Eigen::VectorXd& start,
           const std::vector<double>& times, Eigen::Index columns, Path& path);
  void start_rows(const FitStretch& stretch, const Eigen::VectorXd& start, Eigen::Index columns,
                  Path& path);
  void linearize(const FitEvent& event, ContactSet held, double tau, Eigen::Index columns,
                 Row& row);
  void add_causes(const FitStretch& stretch, const std::vector<double>& times, Path& path);
  void linearize(const EventFit& fit, Eigen::Index columns, const FitNoise& noise);
  void sweep(const FitStretch& stretch, const Eigen::VectorXd& at, const std::vector<double>& times,
             Times mode, double sigma, Eigen::Index columns, Path& path);
  void set_prior(Path& path) const;
  Eigen::VectorXd start_step(const Path& path, const Eigen::VectorXd& dc) const;
  std::pair<Eigen::VectorXd, std::vector<double>> path_step(const FitStretch& stretch,
                                                            const Path& path,
                                                            const Eigen::VectorXd& dc) const;
  Eigen::MatrixXd with_prior(const Eigen::MatrixXd& rows, const Eigen::VectorXd& c) const;
  FitPoint step(const std::vector<FitStretch>& stretches, const Eigen::VectorXd& dc) const;
  FitPoint moved(FitPoint point, const FitPoint& step, double share) const;
  double restore(const std::vector<FitStretch>& stretches, FitPoint& point, double sigma);
  Eigen::VectorXd effects_with_starts(std::size_t stretches, Eigen::Index columns) const;
  Eigen::MatrixXd shared(std::size_t stretches, Eigen::Index columns) const;
  double cost(const std::vector<FitStretch>& stretches, const FitPoint& point, double sigma);
  void weigh(const FitStretch& stretch, Path& path) const;
  double cost_of_paths(const std::vector<FitStretch>& stretches, const FitPoint& point,
                       double sigma) const;
  void fly_recorded(const std::vector<FitStretch>& stretches, const Held& held,
                    Eigen::Index columns);
  void shift(const FitStretch& stretch, Eigen::VectorXd dx, Path& path) const;
  double move_starts(const std::vector<FitStretch>& stretches, Held& held);
  void score(const std::vector<FitStretch>& stretches, Held& held);
  Eigen::VectorXd bounded(const Eigen::MatrixXd& S, const Eigen::VectorXd& c,
                          Eigen::Index fixed) const;
  std::vector<Eigen::Index> inside(const Eigen::VectorXd& c) const;
  void finish(EventFit& fit, const Eigen::MatrixXd& S, Eigen::Index fixed);

  FamilyFlight flight_;
  Eigen::MatrixXd drift_;  // dx of process noise at drift 1, per root of a unit of time
  FitNoise noise_;
  bool fixes_speed_ = false;
  bool is_linear_;  // in the start, along held times: no restitution depends on the speed
  double resolution_ = 0.0;
  Eigen::Index n_, P_;
  Eigen::VectorXd low_, high_, scale_, unit_;
  std::vector<Path> paths_;
  Eigen::MatrixXd work_;
};

/// Householder triangularization in place; rows below the diagonal become zero.
void triangularize_rows(Eigen::Ref<Eigen::MatrixXd> M);

}  // namespace sprag
