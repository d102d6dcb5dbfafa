// Effect of lost events on the bound.
#include <algorithm>
#include <cmath>

#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Largest number of nodes along a gap with one lost impact. A longer gap is treated as if more
// events were lost.
constexpr double most_nodes = 2000.0;

}  // namespace

// Passes the gaps that begin before t. Within a gap, widened by the tolerance on both sides, b is
// unknown, unless exactly one impact was lost. At the beginning of a gap b is still known: the lost
// events are later.
void BoundTracker::pass_gaps(const EventHistory& events, double t, double next_event) {
  const std::vector<DegradedInterval>& gaps = events.degraded();
  while (gap_ < gaps.size()) {
    const DegradedInterval& gap = gaps[gap_];
    if (gap.start == events.start()) {
      const double from = gap.from - tolerance_.time;
      if (from >= t) return;
      if (gap.one_pulse && can_miss_one(gap)) {
        if (gap.from >= next_event) return;
        miss_one(gap);
        ++gap_;
        continue;
      }
      if (b_ < infinity && from >= since_) advance(from);
      b_ = infinity;
      first_order_.stop();
      lost_until_ = std::max(lost_until_, gap.to + tolerance_.time);
      if (gap.to + tolerance_.time >= t) return;
    }
    ++gap_;
  }
}

// Whether the lost event is one impact of the machine's only contact, in free flight. Events of one
// contact keep their order, so that it lies between the neighbouring events.
bool BoundTracker::can_miss_one(const DegradedInterval& gap) const {
  return metric_.dynamics().contacts() == 1 && state_.chi == 0 && b_ < infinity && !failed_ &&
         gap.from >= lost_until_ - tolerance_.time &&
         gap.to - gap.from < most_nodes * defect_.longest_step();
}

// The replica lacks one impact at an unknown time of the gap: a jump J of its path, with the
// supremum of gamma^- over the gap, and a shift D by the time error of the neighbouring events. No
// contraction counts in the gap. The neighbouring events belong to the same cluster.
void BoundTracker::miss_one(const DegradedInterval& gap) {
  const double delta = tolerance_.time;
  const double opens = gap.from - delta;
  if (opens >= since_) {
    advance(opens);
    cluster_.begin(b_, gap.from);
  }
  first_order_.stop();
  cluster_.close_windows(opens);
  cluster_.first_speed = infinity;  // the momentum limit of a burst does not apply
  // Without stiffness and damping one step covers the gap.
  const double step = std::min(defect_.longest_step(), std::max(gap.to - gap.from, 1.0));
  const double rho = std::exp(2.0 * delta * metric_.damping()) * cluster_.moved();
  EventCost worst;
  double defect = 0.0;
  for (double t = gap.from; t <= gap.to; t += step) {
    const double duration = std::min(step, gap.to - t);
    state_.motion.flow->propagate(state_.motion, at(std::max(t, state_.motion.t.hi)), free_);
    const EventCost cost = single_cost(metric_, tolerance_, SingleEvent::impact, 0,
                                       largest_change(metric_.dynamics().model()),
                                       approach(free_, 0, duration + delta), rho);
    worst.D = std::max(worst.D, cost.D);
    worst.J = std::max(worst.J, cost.J);
    if (!defect_.any()) continue;
    take_state(t);
    const DefectNode node = defect_.node(modal_, t, false);
    const double edges = t == gap.from || t + step > gap.to ? 2.0 * delta : 0.0;
    defect += defect_.closed_step(node, duration + edges);
  }
  cluster_.D += factors_.D * worst.D;
  cluster_.E += factors_.J * worst.J;

  const double length = gap.to - gap.from + 2.0 * delta;
  cluster_.R += defect + defect_.lipschitz() * length * (rho + worst.D + worst.J);
  conclude(gap.to);
}

}  // namespace sprag
