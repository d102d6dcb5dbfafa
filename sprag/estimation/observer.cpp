#include "sprag/estimation/observer.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "sprag/estimation/observer_core.h"
#include "sprag/mechanics/interrupt.h"

namespace sprag {
namespace {

// As wide as its first row.
void resize(Eigen::Index n, const Estimate& first, Estimates& all) {
  all.t.resize(n);
  all.q.resize(n, first.q.size());
  all.u.resize(n, first.u.size());
  all.sigma_q.resize(n, first.sigma_q.size());
  all.sigma_u.resize(n, first.sigma_u.size());
  all.sigma_gap.resize(n, first.sigma_gap.size());
  all.outputs.resize(n, first.outputs.size());
  all.sigma_outputs.resize(n, first.sigma_outputs.size());
  all.bound.resize(n);
  all.bound_q.resize(n, first.bound_q.size());
  all.bound_gap.resize(n, first.bound_gap.size());
  all.bound_outputs.resize(n, first.bound_outputs.size());
  all.of_filter.resize(static_cast<std::size_t>(n));
  all.penetrating.resize(static_cast<std::size_t>(n));
  all.parameters.resize(n, first.parameters.values.size());
  all.sigma_parameters.resize(n, first.parameters.sigmas.size());
  if (first.parameters.any()) all.keys = *first.parameters.keys;
}

}  // namespace

void require_tick(double tick) {
  if (!(tick > 0.0) || !std::isfinite(tick)) {
    throw std::invalid_argument("tick is " + std::to_string(tick) + "; must be > 0");
  }
}

Observer::Observer(const Scene& scene, const ObserverSettings& settings) {
  require_tick(settings.tick);
  if (settings.stepper != StepperKind::exact && settings.estimator != EstimatorKind::replica) {
    throw std::invalid_argument("the moreau estimator is one of the replica alone");
  }
  if (settings.estimator == EstimatorKind::adaptive) {
    throw std::invalid_argument(
        "an adaptive observer is made by adaptive_observer (sprag/adaptation/adaptive_observer.h)");
  }
  if (settings.estimator != EstimatorKind::replica && !scene.parameters.empty()) {
    throw std::invalid_argument(
        "an observer of a scene with [parameters] is made by make_observer "
        "(sprag/adaptation/adaptive_observer.h)");
  }
  core_ = std::make_unique<ObserverCore<AnyEstimator>>(scene, settings, initial_bound(scene));
}

Observer::Observer(std::unique_ptr<Core> core) : core_(std::move(core)) {}
Observer::~Observer() = default;
Observer::Observer(Observer&&) noexcept = default;
Observer& Observer::operator=(Observer&&) noexcept = default;

bool Observer::take(const ContactEvent& event) { return core_->take(event); }
void Observer::set_horizon(double t) { core_->set_horizon(t); }
std::vector<Estimate> Observer::settle() { return core_->settle(); }
Estimate Observer::at(double t) { return core_->at(t); }
void Observer::set_end(double t) { core_->set_end(t); }
double Observer::tick() const { return core_->tick(); }
const EventHistory& Observer::events() const { return core_->events(); }

Estimates observe(const Scene& scene, std::span<const ContactEvent> events, double duration,
                  const ObserverSettings& settings) {
  return observe(Observer(scene, settings), events, duration);
}

Estimates observe(Observer observer, std::span<const ContactEvent> events, double duration) {
  if (!(duration >= 0.0) || !std::isfinite(duration)) {
    throw std::invalid_argument("duration is " + std::to_string(duration) + "; must be >= 0");
  }
  const double h = observer.tick();
  const Eigen::Index n = last_tick(duration, h) + 1;
  Estimates all;
  for (const ContactEvent& event : events) {
    if (event.t <= duration) observer.take(event);
  }
  observer.set_end(duration);
  // In pieces, so that few estimates are held twice.
  constexpr Eigen::Index piece = 4096;
  Eigen::Index last = -1;
  for (Eigen::Index k = 0; k < n;) {
    check_interrupt();
    last = std::min(last + piece, n - 1);
    observer.set_horizon(last == n - 1 ? duration : tick_instant(last, h).hi);
    for (const Estimate& estimate : observer.settle()) {
      if (k == 0) resize(n, estimate, all);
      all.t[k] = estimate.t;
      all.q.row(k) = estimate.q;
      all.u.row(k) = estimate.u;
      all.sigma_q.row(k) = estimate.sigma_q;
      all.sigma_u.row(k) = estimate.sigma_u;
      all.sigma_gap.row(k) = estimate.sigma_gap;
      all.parameters.row(k) = estimate.parameters.values;
      all.sigma_parameters.row(k) = estimate.parameters.sigmas;
      all.outputs.row(k) = estimate.outputs;
      all.sigma_outputs.row(k) = estimate.sigma_outputs;
      all.bound[k] = estimate.bound;
      all.bound_q.row(k) = estimate.bound_q;
      all.bound_gap.row(k) = estimate.bound_gap;
      all.bound_outputs.row(k) = estimate.bound_outputs;
      all.of_filter[static_cast<std::size_t>(k)] = estimate.of_filter ? 1 : 0;
      all.penetrating[static_cast<std::size_t>(k)] = estimate.penetrating ? 1 : 0;
      ++k;
    }
  }
  all.counts = observer.events().counts();
  return all;
}

}  // namespace sprag
