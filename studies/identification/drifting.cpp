#include "studies/identification/drifting.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/mechanics/master.h"
#include "studies/common/later.h"
#include "studies/common/random.h"

namespace sprag::identification_study {

std::vector<ContactEvent> drifting_events(const Scene& scene, double drift, double jitter,
                                          double end, double push, std::uint64_t seed) {
  common::Random draw(seed);
  Scene drifting = scene;
  drifting.prior.drift = 1.0;
  // The kick puts all energy into velocities; half of it is in positions a little later.
  const Eigen::MatrixXd kick = std::sqrt(2.0) * uncertainty_of(drifting).drift_u;
  std::vector<ContactEvent> events;
  State state = scene.truth.start;
  double begin = 0.0;
  while (begin < end) {
    Master master(common::later(scene.model, begin), state);
    std::vector<ContactEvent> of_part;
    double t = drift > 0.0 ? push : end;
    master.advance(at(t), of_part);
    while (master.closed() != 0 && begin + t < end) {
      t += push;
      master.advance(at(t), of_part);
    }
    master.state(at(t), state.q, state.u);
    for (ContactEvent event : of_part) {
      event.t += begin;
      events.push_back(event);
    }
    Eigen::VectorXd normal(kick.cols());
    for (double& entry : normal) entry = draw.normal();
    state.u += std::sqrt(drift * t) * (kick * normal);
    begin += t;
  }
  for (ContactEvent& event : events) event.t += jitter * draw.normal();
  std::sort(events.begin(), events.end(),
            [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  return events;
}

}  // namespace sprag::identification_study
