// Runs of the shipped scenes: the master's events, and an observer's replica with the master.
#pragma once

#include <string>
#include <vector>

#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/energy.h"
#include "sprag/scene_file.h"

namespace sprag::test {

inline Scene shipped_scene(const std::string& name) {
  return read_scene(SPRAG_SOURCE_DIR "/scenes/" + name + ".toml");
}

inline std::vector<ContactEvent> events_of(const Scene& scene, double T) {
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  master.advance(at(T), events);
  return events;
}

/// A master and a replica of E, tick by tick. After step() both are at tick k, and `passed`
/// contains the events since the previous tick.
template <Estimator E>
struct Pair {
  Pair(const Scene& scene, double h)
      : master(scene.model, scene.truth.start), estimator(scene.model, h), energy(scene.model) {
    const Eigen::Index f = scene.model.coordinates();
    q_m = u_m = q_s = u_s = Eigen::VectorXd::Zero(f);
    estimator.start(scene.prior.start, 0, 0, state);
    master.advance(at(0.0), passed);
    if (!passed.empty()) estimator.apply(passed, state);
    read();
  }

  void step() {
    ++k;
    passed.clear();
    master.advance(tick_instant(k, estimator.h()), passed);
    estimator.tick(passed, state);
    read();
  }

  double V() const { return V_i[0]; }
  double t() const { return tick_instant(k, estimator.h()).hi; }

  Master master;
  E estimator;
  ErrorEnergy energy;
  typename E::State state;
  std::vector<ContactEvent> passed;
  std::int64_t k = 0;
  Eigen::VectorXd q_m, u_m, q_s, u_s, V_i;

 private:
  void read() {
    master.state(tick_instant(k, estimator.h()), q_m, u_m);
    estimator.output(state, q_s, u_s);
    V_i = energy(q_m, u_m, q_s, u_s);
  }
};

}  // namespace sprag::test
