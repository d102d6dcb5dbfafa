// An event whose time is not known: a mixture over when it happened, collapsed to its first two
// moments.
//
// The state is x = m + S xi with xi ~ N(0, I). A hypothesis says that the event happened at a given
// time; it brings what is known of the state given that, and an unknown y, the change of the gap
// velocity by the impact, which has moved the state by y b since. With weights w of the hypotheses,
// mean and covariance of xi and of all y b are those of the whole mixture, exactly; what is not
// Gaussian in it is left out.
//
// An event happens where the flux through the support is: of two states that both have a gap of
// zero, the faster one meets it more often. So the gap velocity at an impact has the density
// (-gamma)^+ N(gamma; mu, d^2) (Rice's formula for level crossings).
#pragma once

#include <Eigen/Core>

namespace sprag {

/// Of gamma ~ N(mu, d^2), weighted by the flux (-gamma)^+: log of the total weight, mean and
/// variance. d > 0.
struct FluxMoments {
  double log_weight, mean, variance;
};
FluxMoments flux_moments(double mu, double d);

/// log of the normal distribution function, and its density over it, for any x without overflow.
double log_normal_cdf(double x);
double normal_hazard(double x);  ///< phi(x) / Phi(x)

class EventMixture {
 public:
  /// Most hypotheses.
  static constexpr int capacity = 32;

  EventMixture() = default;
  /// For up to `columns` columns of S, and an impact that moves `coordinates` positions and
  /// velocities. Nothing allocates afterwards.
  EventMixture(Eigen::Index columns, Eigen::Index coordinates);

  /// What one hypothesis says. The covariance of xi is
  ///
  ///   I - taken_along_phi phi phi^T - taken_along_psi psi psi^T,
  ///
  /// its mean shift_phi phi + shift_psi psi, and y has mean alpha, variance beta and the covariance
  /// slope psi with xi. |phi|^2 = 1 - rest_phi, which is told by itself, since it may be far below
  /// the rounding of 1.
  struct Hypothesis {
    double log_weight = 0.0;
    double rest_phi = 1.0;
    double shift_phi = 0.0, shift_psi = 0.0;
    double taken_along_phi = 0.0, taken_along_psi = 0.0;
    double alpha = 0.0, beta = 0.0, slope = 0.0;
  };

  /// No hypothesis, S with this many columns.
  void begin(Eigen::Index columns);
  int size() const { return size_; }
  bool full() const { return size_ == capacity; }

  /// Adds one; the caller then fills phi(), psi() (one entry a column of S) and, unless alpha, beta
  /// and slope are zero, b_q() and b_u() of the last one.
  void add(const Hypothesis& hypothesis);
  auto phi() { return phi_.col(size_ - 1).head(columns_); }
  auto psi() { return psi_.col(size_ - 1).head(columns_); }
  auto b_q() { return b_q_.col(size_ - 1); }
  auto b_u() { return b_u_.col(size_ - 1); }

  /// log of the sum of all weights; minus infinity where there is none.
  double log_total() const { return log_total_of_first(size_); }
  double log_total_of_first(int count) const;

  /// Moves the mean (q, u) and replaces S = (S_q, S_u), of begin()'s columns, by a square root of
  /// the mixture's covariance; `S_q` and `S_u` have room for added_columns() more. Returns the new
  /// number of columns, or 0, with everything as it was, where no hypothesis has a finite weight.
  Eigen::Index collapse(Eigen::VectorXd& q, Eigen::VectorXd& u, Eigen::MatrixXd& S_q,
                        Eigen::MatrixXd& S_u);
  static constexpr Eigen::Index added_columns() { return Eigen::Index{2} * capacity; }

 private:
  void reflect(Eigen::MatrixXd& S_q, Eigen::MatrixXd& S_u);

  Eigen::Index columns_ = 0;
  int size_ = 0;
  Hypothesis hypotheses_[capacity];
  Eigen::MatrixXd phi_, psi_;  // columns x hypotheses
  Eigen::MatrixXd b_q_, b_u_;  // coordinates x hypotheses

  // Scratch of a collapse.
  Eigen::VectorXd w_, mean_phi_, reflection_, xi_, delta_;
  Eigen::VectorXd off_q_, off_u_;
  Eigen::MatrixXd joint_;  // within hypotheses, of xi, y and each one's y; then its root
  Eigen::MatrixXd basis_q_, basis_u_;  // what these are coordinates of
};

}  // namespace sprag
