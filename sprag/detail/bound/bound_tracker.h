// Bound B on the error energy V of a replica whose machine is known within tolerances, from the
// reported events alone: V(t) <= B(t) for every machine and all true event times within the
// tolerances.
//
// b bounds the distance between machine and replica in the energy norm with the true stiffness. It
// obeys
//
//   free flight of length tau    b -> sigma(tau) b + I     (flight_contraction.h, model_defect.h)
//   contacts closed              b -> b + I
//   event, window t' +- delta    b -> b + D + E + R, and J on top while the window is open
//                                                           (event_cost.h, event_cluster.h)
//
// where delta is the tolerance of the times, and a window is longer by their rounding on each side;
// and sqrt B = b / sqrt(1 - k_K). A second bound needs no events (dissipation_cap.h). It limits b,
// and b restarts from it after a gap. Principle: the evolution of the true machine with given
// switching times is nonexpansive on every path. All defects are therefore evaluated on the
// replica's own path, which is known, and none is multiplied by b.
//
// For machines with few coordinates a second distance keeps its first-order terms in a set that
// rotates and contracts with the motion (first_order_bound.h). It is several times smaller. When a
// window opens, b becomes the smaller of both.
//
// B(t) needs every event up to t + delta, because an event before t may be reported with a time up
// to t + delta. The tracker moves its own replica from event to event, in order, without rollback.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "sprag/detail/bound/dissipation_cap.h"
#include "sprag/detail/bound/energy_metric.h"
#include "sprag/detail/bound/event_cluster.h"
#include "sprag/detail/bound/event_cost.h"
#include "sprag/detail/bound/first_order_bound.h"
#include "sprag/detail/bound/flight_contraction.h"
#include "sprag/detail/bound/impact_remainder.h"
#include "sprag/detail/bound/model_defect.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/scene.h"

namespace sprag {

/// Factors of an event's terms. Tests show that values below 1 break the bound.
struct BoundFactors {
  double D = 1.0, J = 1.0, E = 1.0;
};

struct BoundSettings {
  BoundFactors factors;
  bool first_order = true;  ///< false: b alone, as for machines with many coordinates
};

class BoundTracker {
 public:
  /// For a scene with tolerances, which may be zero; `flows` are the machine's and must outlive
  /// this. B(0) is the sum of the scene's `uncertainty`. Without one the machine is assumed to be
  /// within DissipationCap::ultimate() at the start. Throws ModelError.
  BoundTracker(const Scene& scene, Flows& flows, double h, const BoundSettings& settings = {});
  BoundTracker(const BoundTracker&) = delete;
  BoundTracker& operator=(const BoundTracker&) = delete;

  /// Starts with the time line at tick k, with chi closed. At k = 0 the machine is within the
  /// scene's `uncertainty` of the replica; for a later tick it was so at some earlier time.
  void start(std::int64_t k, ContactSet chi);

  /// Takes the events up to t from a history that begins at this start. Ignores a t before that of
  /// the last call. Does not allocate once the locked sets that occur have been met.
  void follow(const EventHistory& events, double t);

  /// B at t, after follow(events, t); q and u of the replica at t, f entries each. Infinite if the
  /// history is not known up to t + tolerance.time. Does not allocate.
  double bound(const EventHistory& events, double t, const Eigen::VectorXd& q,
               const Eigen::VectorXd& u);

  /// The same for a time line (time_line.h); restarts with it.
  template <typename Line>
  void follow(const Line& line, double t) {
    if (starts_ != line.starts()) {
      starts_ = line.starts();
      start(line.first_tick(), line.first_closed());
    }
    follow(line.events(), t);
  }
  template <typename Line>
  double bound(const Line& line, double t, const Eigen::VectorXd& q, const Eigen::VectorXd& u) {
    return bound(line.events(), t, q, u);
  }

  /// No bound after t [s] will be requested. Events after t are then not used.
  void set_end(double t) { end_ = t; }

  const EnergyMetric& metric() const { return metric_; }
  const DissipationCap& cap() const { return cap_; }
  const Tolerance& tolerance() const { return tolerance_; }

 private:
  struct Impact;  // one event or several of one instant

  double known_up_to(const EventHistory& events) const;
  double half_window(double t) const;  // of an event [s]
  void pass_gaps(const EventHistory& events, double t);
  void take_state(double t);
  void integrate(double t);
  void advance(double t);
  void limit_by_cap(double t);
  void start_first_order(double t);
  void pass_first_order(const Impact& impact, const Approach& near, const EventCost& cost,
                        double defect);
  Impact impact_of(std::span<const ContactEvent> of_one_instant) const;
  bool is_alone(const Impact& impact) const;
  void event(std::span<const ContactEvent> of_one_instant);
  void take_unbounded(std::span<const ContactEvent> of_one_instant);
  void take_free_branch(const Impact& impact);
  void conclude(double t);
  void add(const Impact& impact, const EventCost& cost);
  EventCost single(const Impact& impact, const Approach& near, double rho);
  void opening(const Impact& impact, double rho, double fastest);
  void joint(const Impact& impact, double rho, double speed_before, double speed_after);

  Tolerance tolerance_;
  BoundFactors factors_;
  EnergyMetric metric_;
  ToleratedContraction contraction_;
  ModelDefect defect_;
  DissipationCap cap_;
  ImpactRemainder remainder_;
  FirstOrderBound first_order_;
  bool use_first_order_ = false;
  Replica replica_;
  const State start_;
  double initial_;                   // B(0); infinity: unknown
  bool law_ = false;                 // the replica has the machine's law
  bool monotone_ = false;            // joint impacts are nonexpansive
  bool joint_is_unlimited_ = false;  // no limit of their expansion is known
  bool cap_holds_ = false;
  double in_ = 1.0, out_ = 1.0;  // from the nominal energy norm to the true one and back

  ReplicaState state_;
  std::int64_t starts_ = 0;
  std::int64_t consumed_ = 0;  // number of events taken since the start
  std::size_t gap_ = 0;        // index of the next degraded interval
  double end_ = infinity;
  double followed_ = 0.0;  // time of the last follow()
  bool failed_ = false;    // no bound holds, until the next start
  double b_ = 0.0;         // distance bound at since_
  double since_ = 0.0;     // end of the last window, or where b was last advanced to
  double integral_ = 0.0;  // integral of the defect since since_
  double integrated_to_ = 0.0;
  DefectNode node_;  // defect at integrated_to_, if node_is_known_
  bool node_is_known_ = false;
  double lost_until_ = 0.0;  // b is unknown before this time
  double W_ = 0.0, W_t_ = 0.0;
  EventCluster cluster_;

  // scratch
  Motion path_;    // the replica in free flight after its last event
  Motion before_;  // just before an event
  Motion free_;    // before_ on the free flow
  ModalState modal_;
  Eigen::VectorXd q_, u_;
  const Eigen::VectorXd no_gaps_;
};

/// Why B cannot be finite with this scene's tolerances; empty: it can.
std::string why_no_bound(const Scene& scene);

}  // namespace sprag
