// Events whose times are known up to tau ~ N(0, sigma^2): what they say of the state and do to it,
// and what it says that none has come. A mixture over the true time (event_mixture.h): given the
// time, the machine is linear, however fast its modes are against sigma.
//
// An event of contact i, reported at t_m, happened at t_m - tau. Then g_i = 0 there (lambda_i = 0
// where it was locked and releases), and the gap velocity has the density of a crossing. So tau has
// the weight
//
//   exp(-tau^2 / (2 sigma^2)) N(g; 0, s^2) E[(-gamma)^+ + v 1(gamma < 0) | g = 0],
//
// g, gamma and the deviation s of g from mean and covariance, which have gone back by tau; and the
// impact that it means has moved since. v = s^2 / (|gamma| sigma^2) at t_m makes the weight that of
// Jeffreys' prior (event_mixture.h): the better a time is known, the less the flux counts.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "sprag/estimation/belief.h"
#include "sprag/estimation/event_mixture.h"
#include "sprag/estimation/retrodiction.h"
#include "sprag/mechanics/flow.h"
#include "sprag/mechanics/flows.h"

namespace sprag {

class UnknownTime {
 public:
  /// sigma > 0 [s]. For beliefs of up to `columns` columns, with room for what a mixture adds.
  /// `flows` must outlive this.
  UnknownTime(const Flows& flows, double sigma, Eigen::Index columns);

  /// That of the machine behind an event; null where it has not been built.
  const Flow* flow_after(const UncertainEvent& event) const;

  /// A pulse that follows on the contact's last one by less is a burst: its time says nothing.
  double indistinct() const { return 2.0 * sigma_; }
  /// What is reported at t has happened before t + latest(), and what happens is reported by then.
  double latest() const { return 4.5 * sigma_; }

  /// Square of the innovation, over the variance that it should have, and the gap's own part.
  struct Innovation {
    double square = 0.0;                ///< chi^2 of one degree of freedom
    double gap = 0.0, deviation = 0.0;  ///< at the reported time
    bool measured = false;
    double to_come = 0.0;  ///< probability that it has not happened by the time of the motion
  };

  /// Conditions a belief on a report that came `delay` before `motion`, and takes the event. The
  /// belief is that at the motion's time, and the motion its mean, as if the event had not been: on
  /// the flow before. With `so_far`, what would be later than that time has not happened.
  /// Afterwards the belief has more columns, and components behind a pulse. False where no time at
  /// all is possible; the belief is then as it was.
  bool take(const UncertainEvent& event, const Motion& motion, const Terms& terms, double delay,
            bool so_far, Belief& belief, Innovation& innovation);

  /// The innovation's square alone, of a report that comes at `motion`, and when that was [s].
  struct Misfit {
    double square, age;
  };
  Misfit misfit(const UncertainEvent& event, const Motion& motion, const Terms& terms,
                const Belief& belief);

  /// What the last event that was taken did, and when: mean and deviation over its hypotheses.
  struct Moment {
    double mean = 0.0, deviation = 0.0;
  };
  struct Impact {
    Moment age;            ///< before the motion [s]
    Moment before, after;  ///< gap velocities
    Moment change;         ///< the one less the other
  };
  Impact impact() const;

  /// log of the probability that by now, at `motion`, nothing has been reported of a contact: that
  /// it has closed (due.kind pulse or sticks), or that it has released. Of the belief only
  /// components are merged.
  double log_of_silence(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                        Belief& belief);

  /// Conditions the belief on that; `is_over`: beyond doubt it has happened.
  void take_silence(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                    bool is_over, Belief& belief);

  /// When that was, by the mean, if it has happened: how long before the motion [s].
  double unheard_age() const { return unheard_age_; }

  /// Of several contacts that have released unheard, each was taken as if the others were held.
  /// What they do to each other is one more unknown of the belief: a column. The earliest comes
  /// first.
  struct Release {
    int contact;
    double age;
  };
  void add_interplay(std::span<const Release> releases, const Motion& motion, Belief& belief);

  /// After an unheard pulse: if the contact has met its support once more beyond doubt, it may have
  /// done so many times. Then its gap and gap velocity are nothing, up to what they would be
  /// without. Returns whether this was so.
  bool bring_to_rest(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                     Belief& belief);

  /// How far it was from that `age` before, in standard deviations of the belief.
  double margin(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                const Belief& belief, double age);

  /// How far it is now; negative where it must have happened, though it may be over.
  double margin(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                const Belief& belief);

 private:
  // Of a variance: what is known exactly is divided by it.
  static constexpr double least_square = 1e-200;
  // Standard deviations.
  static constexpr double beyond_doubt = 4.0;
  // The hypotheses: +- so many deviations of the time.
  static constexpr double node_reach = 5.0;
  // Of the rounding of a time: what several contacts do to each other when they let go at nearly
  // one instant is not known better.
  static constexpr double release_rounding = 256.0;

  // What a hypothesis about the age tau of an event says, up to what the impact does.
  struct Sight {
    double value, rate;          // of the signal that is zero at the event
    double s2;                   // variance of the value in a component, with its rounding
    double all_s2;               // and in the belief
    double d;                    // deviation of the rate given that the value is zero
    double mean_rate, variance;  // and weighted by the flux, or known to be nothing
    double log_weight;           // but for that of tau itself
    double rest_phi;
  };
  // And what it says of one component.
  struct View {
    double value;
    double mu;                   // mean of the rate given that the value is zero
    double mean_rate, variance;  // and weighted
    double log_weight;
  };
  // A look at some ages.
  static constexpr int scan_nodes = 17;
  struct Scan {
    double low, step;
    double values[scan_nodes]{}, all_s2[scan_nodes]{};

    double age(int i) const { return low + i * step; }
  };
  // Where on the time axis the hypotheses lie.
  struct Nodes {
    double first, step;
    int count;
  };

  void look(const Signal& signal, double value_rounding, double rate_rounding, double time_rounding,
            const Motion& motion, const Belief& belief);
  void look_for(const UncertainEvent& event, const Motion& motion, const Terms& terms,
                const Belief& belief);
  Sight see(UncertainEvent::Kind kind, double age);
  double even_of(const Sight& sight) const;
  View view(UncertainEvent::Kind kind, const Sight& sight, double kappa, double value,
            double rate) const;
  bool is_bent(const Motion& motion, const Nodes& nodes) const;
  double log_prior(double age) const;
  void set_order(const UncertainEvent& event, const Motion& motion);
  double weigh(const Sight& sight, double age);
  bool find_over(const Scan& scan);
  double find_zero(double low, double high, double at_low);
  bool find_crossing(UncertainEvent::Kind kind, const Scan& scan, double& age, double& weight);
  bool climb(UncertainEvent::Kind kind, const Scan& scan, double& age, double weight,
             double& deviation);
  Nodes find_nodes(UncertainEvent::Kind kind);
  Nodes nodes_about(double mean, double deviation, double narrowest) const;
  void set_impact(const UncertainEvent& event);
  void move_impact(double age);
  void add_moved_impact(double age);
  void go_on(const Flow& flow, Instant from, Instant to, Eigen::VectorXd& q, Eigen::VectorXd& u);
  void add_changed_flow(const Flow& after, double gap_velocity_change);
  void add(const UncertainEvent& event, double age, double log_weight, bool has_happened);
  void add_covariances(const UncertainEvent& event, const Belief& belief);
  void add_covariance(const UncertainEvent& event, double age, double share, const Flow* after,
                      const Belief& belief);
  double margin_at(double age);
  double find_least_margin(const UncertainEvent& due);
  void hear_nothing(const UncertainEvent& due, const Motion& motion, const Terms& terms,
                    Belief& belief);
  void add_burst(const UncertainEvent& event, double age, bool has_happened);

  // What a hypothesis says of the gap velocity; each a mean and a variance.
  struct Seen {
    double log_weight, age;
    double before, var_before, after, var_after, change, var_change;
    bool changes_flow = false;  // by now
  };
  Seen seen_[EventMixture::capacity];
  int seen_size_ = 0;

  const Flows* flows_;
  double sigma_;
  double delay_ = 0.0;
  double closed_since_ = 0.0;  // the contact that releases, by the reports
  double quiet_since_ = 0.0, over_since_ = 0.0;
  double oldest_ = 0.0, oldest_deviation_ = 1.0;  // age of the contact's last event
  EventMixture mixture_;
  double best_weight_ = 0.0, best_age_ = 0.0;
  double unheard_age_ = 0.0;
  double least_age_ = 0.0;  // of the least margin
  Innovation innovation_;

  // What is looked at.
  Retrodiction belief_;
  double value_rounding_ = 0.0, rate_rounding_ = 0.0, time_rounding_ = 0.0, rate_noise_ = 0.0;
  double even_ = 0.0;         // weight that does not go with the flux, of flux_moments()
  Eigen::Index columns_ = 0;  // without components
  int components_ = 0;
  std::array<double, Belief::most_components> roots_{}, log_weights_{};  // of components

  // At one age.
  std::array<View, Belief::most_components> views_{};
  std::array<EventMixture::Hypothesis, Belief::most_components> of_components_{};
  Motion after_;
  Eigen::VectorXd psi_, xi_, q_, u_, q_after_, u_after_;

  bool changes_flow_ = false;  // the event
  double kick_ = 0.0;          // change of the gap velocity by the impact, over that
  // The impact for one unit of change of the gap velocity.
  Eigen::VectorXd no_q_, impact_u_;
  Eigen::MatrixXd impact_z_, impact_v_, moved_z_, moved_v_, moved_q_, moved_u_;
};

}  // namespace sprag
