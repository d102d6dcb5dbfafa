#include "sprag/simulate.h"

#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/state_size.h"

namespace sprag {

Simulation simulate(const Model& model, const State& start, double duration, double h,
                    std::stop_token stop) {
  const StopScope scope(std::move(stop));
  if (!(duration >= 0.0) || !std::isfinite(duration)) {
    throw std::invalid_argument("duration is " + std::to_string(duration) + "; must be >= 0");
  }
  if (!(h >= 0.0) || !std::isfinite(h)) {
    throw std::invalid_argument("tick is " + std::to_string(h) + "; must be >= 0");
  }
  require_size(start, model.coordinates(), "the start");
  Master master(model, start);
  Simulation run;
  const Eigen::Index n = h > 0.0 ? last_tick(duration, h) + 1 : 0;
  run.t.resize(n);
  run.q.resize(n, model.coordinates());
  run.u.resize(n, model.coordinates());
  Eigen::VectorXd q(model.coordinates()), u(model.coordinates());
  for (Eigen::Index k = 0; k < n; ++k) {
    const Instant t = tick_instant(k, h);
    master.advance(t, run.events);
    master.state(t, q, u);
    run.t[k] = t.hi;
    run.q.row(k) = q;
    run.u.row(k) = u;
  }
  master.advance(at(duration), run.events);
  return run;
}

}  // namespace sprag
