// The bound B on the error energy V of a replica of a machine that is known within tolerances, from
// its reported events alone: V(t) <= B(t) for every machine and every true event time within them.
//
// b bounds the distance between machine and replica in the norm of the true stiffness. It obeys
//
//   free flight of length tau    b -> sigma(tau) b + I     (flight_contraction.h, model_defect.h)
//   contacts closed              b -> b + I
//   event, window t' +- delta    b -> b + D + E + R, and J on top while the window is open
//                                                           (event_cost.h, event_cluster.h)
//
// and sqrt B = b / sqrt(1 - k_K). Beside it runs a bound that needs no events at all
// (dissipation_cap.h), which limits b, and from which b starts again after a gap. The principle:
// the evolution of the true machine with given switching times expands no distance, whatever the
// path, so that all defects are evaluated on the replica's own path, which is known; none is
// multiplied by b.
//
// For machines of few coordinates a second distance has its terms of first order in a set that
// turns and shrinks with the motion (first_order_bound.h), which is several times less. Where a
// window opens b becomes the smaller of both.
//
// B(t) needs every event up to t + delta: one that happened before t may be reported as late as
// that. The tracker runs a replica of its own from event to event, in order, and never goes back.
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
#include "sprag/detail/bound/model_defect.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/replica.h"
#include "sprag/scene.h"

namespace sprag {

/// By what an event's terms are multiplied: 1. Tests show that less breaks the bound.
struct BoundFactors {
  double D = 1.0, J = 1.0, E = 1.0;
};

struct BoundSettings {
  BoundFactors factors;
  bool first_order = true;  ///< false: b alone, as of machines of many coordinates
};

class BoundTracker {
 public:
  /// For a scene with tolerances; `flows` are the machine's and must outlive this. The
  /// `uncertainty` of the scene is B(0). Without one the machine is taken to move, at the start, no
  /// more than its forces sustain (DissipationCap::ultimate()). Throws ModelError.
  BoundTracker(const Scene& scene, Flows& flows, double h, const BoundSettings& settings = {});
  BoundTracker(const BoundTracker&) = delete;
  BoundTracker& operator=(const BoundTracker&) = delete;

  /// Begins where the time line begins: at tick k, with chi closed. At k = 0 the machine is within
  /// the scene's `uncertainty` of the replica; at a later tick it was at some time before.
  void start(std::int64_t k, ContactSet chi);

  /// Takes what happened up to t from a history that begins at this start. Earlier ones than the
  /// last are passed over. Does not allocate once the locked sets that occur have been met.
  void follow(const EventHistory& events, double t);

  /// B at t, after follow(events, t); q and u of the replica there, f entries each. Infinite where
  /// the history is not known up to t + tolerance.time. Does not allocate.
  double bound(const EventHistory& events, double t, const Eigen::VectorXd& q,
               const Eigen::VectorXd& u);

  /// The same for a time line (time_line.h), whose restarts are followed.
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

  /// Nothing after t will be asked for, so that nothing is known of events after it [s].
  void set_end(double t) { end_ = t; }

  const EnergyMetric& metric() const { return metric_; }
  const DissipationCap& cap() const { return cap_; }
  const Tolerance& tolerance() const { return tolerance_; }

 private:
  struct Impact;  // what an event is

  double known_up_to(const EventHistory& events) const;
  void pass_gaps(const EventHistory& events, double t, double next_event);
  bool can_miss_one(const DegradedInterval& gap) const;
  void miss_one(const DegradedInterval& gap);
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
  FirstOrderBound first_order_;
  bool use_first_order_ = false;
  Replica replica_;
  const State start_;
  double initial_;         // B(0); infinity: nothing is known
  bool law_ = false;       // the replica's is the machine's
  bool monotone_ = false;  // joint impacts expand nothing
  bool cap_holds_ = false;
  double in_ = 1.0, out_ = 1.0;  // from the nominal norm to the true one and back

  ReplicaState state_;
  std::int64_t starts_ = 0;
  std::int64_t consumed_ = 0;  // events since the start
  std::size_t gap_ = 0;        // degraded interval that comes next
  double end_ = infinity;
  double followed_ = 0.0;  // up to here
  bool failed_ = false;    // nothing holds any longer
  double b_ = 0.0;         // at since_
  double since_ = 0.0;     // end of the last window, or where b was last advanced to
  double integral_ = 0.0;  // of the defect since then
  double integrated_to_ = 0.0;
  DefectNode node_;  // there, if it is known
  bool node_is_known_ = false;
  double lost_until_ = 0.0;  // before that b is not known
  double W_ = 0.0, W_t_ = 0.0;
  EventCluster cluster_;

  // scratch
  Motion path_;    // the replica in free flight after its last event
  Motion before_;  // just before an event
  Motion free_;    // the same on the free flow
  ModalState modal_;
  Eigen::VectorXd q_, u_;
  const Eigen::VectorXd no_gaps_;
};

/// Whether B can be finite with this scene's tolerances, and if not why; empty: it can.
std::string why_no_bound(const Scene& scene);

}  // namespace sprag
