// An event whose time is not known: a mixture over when it happened, collapsed to its first two
// moments.
//
// The state is x = m + S xi with xi ~ N(0, I). A hypothesis says that the event happened at a given
// time; it brings what is known of the state given that, and an unknown y, the change of the gap
// velocity by the impact, which has moved the state by y b since. With weights w of the hypotheses,
// mean and covariance of xi and of all y b are those of the whole mixture, exactly; what is not
// Gaussian in it is left out.
//
// Or it is kept until the next event, as a belief of several components: a Gaussian each for the
// likeliest hypotheses, of one covariance. The next event then has a hypothesis for each time and
// component, and what is kept of these is the times, with means and covariances over the old
// components (a generalized pseudo-Bayes filter of second order). Impacts that follow each other
// are curved in when they happened: what one Gaussian holds possible then may be far off.
//
// An event happens where the flux through the support is: of two states that both have a gap of
// zero, the faster one meets it more often. So the gap velocity at an impact has the density
// (-gamma)^+ N(gamma; mu, d^2) (Rice's formula for level crossings), if the machine was drawn from
// the belief. Nobody has drawn it: one that is slower than the belief allows would seem faster
// impact after impact. What leaves no such trace is Jeffreys' prior, the root of the determinant of
// Fisher's information. A report of the time T(x) up to sigma, dT/dx = h / |gamma|, multiplies that
// determinant by 1 + s^2 / (gamma sigma)^2, s the deviation of the gap. With the flux, the weight
// is sqrt(gamma^2 + s^2 / sigma^2): the flux where the state is known better than the time, nothing
// but the sign of gamma where the time is. (-gamma)^+ + v, v = s^2 / (|gamma| sigma^2) at the mean,
// has the same slope there.
#pragma once

#include <Eigen/Core>
#include <span>

#include "sprag/estimation/belief.h"
#include "sprag/filter/flux.h"

namespace sprag {

/// log of the normal distribution function, and its density over it, for any x without overflow.
double log_normal_cdf(double x);
double normal_hazard(double x);  ///< phi(x) / Phi(x)

class EventMixture {
 public:
  /// Most hypotheses.
  static constexpr int capacity = 32;

  EventMixture() = default;
  /// For beliefs of up to `columns` columns, and an impact that moves `coordinates` positions and
  /// velocities. Nothing allocates afterwards.
  EventMixture(Eigen::Index columns, Eigen::Index coordinates);

  /// What one hypothesis says of a component. The covariance of xi is
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

  /// No hypothesis about this belief.
  void begin(const Belief& belief);

  /// Adds one, as it is for each component of the belief, or for the belief itself if it has none;
  /// rest_phi and taken_along_phi are the same for all. The caller then fills phi(), psi() (one
  /// entry a column of S, those of components left out) and, unless alpha, beta and slope are zero,
  /// b_q() and b_u() of the last one.
  void add(std::span<const Hypothesis> of_components);
  void add(const Hypothesis& hypothesis) { add(std::span(&hypothesis, 1)); }
  auto phi() { return phi_.col(size_ - 1).head(columns_); }
  auto psi() { return psi_.col(size_ - 1).head(columns_); }
  auto b_q() { return b_q_.col(size_ - 1); }
  auto b_u() { return b_u_.col(size_ - 1); }

  /// Where an event changes the flow, what is not known within a hypothesis has moved on another
  /// one than the belief's S. Then it is for the caller to say: a root of the covariance within, of
  /// as many columns as the belief has, for this share of all weight. The shares of all calls are
  /// to be 1 together.
  struct Within {
    double share;
    Eigen::MatrixXd S_q, S_u;
  };
  Within& add_within(double share) {
    within_[within_size_].share = share;
    return within_[within_size_++];
  }
  static constexpr int most_within = 4;

  /// log of the sum of all weights; minus infinity where there is none.
  double log_total() const { return log_total_of_first(size_); }
  double log_total_of_first(int count) const;

  /// Makes of begin()'s belief the whole mixture: one Gaussian, or as many components as `keep`
  /// says at most. Its S has room for added_columns(its columns) more. False, with everything as it
  /// was, where no hypothesis has a finite weight.
  bool collapse(int keep, Belief& belief);
  static constexpr Eigen::Index added_columns(Eigen::Index columns) {
    return (most_within - 1) * columns + Eigen::Index{2} * capacity +
           Eigen::Index{Belief::most_components} * (capacity + 1);
  }

 private:
  // Of a hypothesis: the share of a component in its weight, and what is off for it.
  struct Part {
    double share, shift_phi, shift_psi, alpha;
  };

  void reflect(Belief& belief);
  void mix_components();
  void factor(Eigen::Index n);
  double least_kept(int keep) const;

  Eigen::Index columns_ = 0;  // without components
  int components_ = 0;
  int size_ = 0;
  Hypothesis hypotheses_[capacity];  // over all components
  Part parts_[capacity][Belief::most_components];
  Within within_[most_within];
  int within_size_ = 0;
  Eigen::MatrixXd component_q_, component_u_;  // what each one's mean is off by
  Eigen::MatrixXd phi_, psi_;                  // columns x hypotheses
  Eigen::MatrixXd b_q_, b_u_;                  // coordinates x hypotheses

  // Scratch of a collapse.
  Eigen::VectorXd w_, mean_phi_, reflection_, xi_, delta_;
  Eigen::VectorXd off_q_, off_u_, between_q_, between_u_;
  Eigen::MatrixXd mixed_q_, mixed_u_;  // of components, a column each hypothesis
  Eigen::VectorXd all_mixed_q_, all_mixed_u_;
  Eigen::MatrixXd S_q_, S_u_;  // the new S
  Eigen::MatrixXd joint_;      // within hypotheses, of xi, y and each one's y; then its root
  Eigen::MatrixXd basis_q_, basis_u_;  // what these are coordinates of
};

}  // namespace sprag
