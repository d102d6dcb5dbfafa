#include "sprag/detail/identification/fitted_scene.h"

#include <algorithm>
#include <vector>

#include "sprag/detail/identification/fitted_parameters.h"
#include "sprag/detail/identification/fitted_tolerance.h"
#include "sprag/detail/mechanics/scale.h"
#include "sprag/detail/parameters/scene_with.h"

namespace sprag {
namespace {

// Undetermined parameters keep the values of the scene.
Scene with_determined(const Scene& scene, const Identification& fit) {
  std::vector<Parameter> unknowns;
  std::vector<double> values;
  for (const FittedUnknown& of : fit.unknowns) {
    if (!of.determined) continue;
    unknowns.push_back(of.unknown);
    values.push_back(of.value);
  }
  return with(scene, unknowns,
              Eigen::Map<const Eigen::VectorXd>(values.data(), std::ssize(values)));
}

bool starts_outside(const Model& model, const State& start) {
  return std::all_of(model.contacts.begin(), model.contacts.end(),
                     [&](const Contact& contact) { return gap(contact, start.q, 0.0) >= 0.0; });
}

// Bound of the error energy of the start, never 0.
double start_energy(const Identification& fit, const Model& model) {
  const double of_u = fit.start_sigma.u.cwiseAbs2().dot(model.M.diagonal());
  const double of_q = fit.start_sigma.q.cwiseAbs2().dot(model.K.diagonal());
  const double motion = fit.start.u.cwiseAbs2().dot(model.M.diagonal()) +
                        fit.start.q.cwiseAbs2().dot(model.K.diagonal());
  // Nine times the mean of V, at least the rounding error.
  return std::max(4.5 * (of_u + of_q), 1e-18 * motion);
}

// Standard deviations of the start, never 0.
Eigen::VectorXd start_deviations(const Eigen::VectorXd& sigma, const Eigen::VectorXd& start) {
  const double largest = std::max(start.cwiseAbs().maxCoeff(), sigma.maxCoeff());
  return sigma.cwiseMax(1e-9 * (largest > 0.0 ? largest : 1.0));
}

void put_start(const Identification& fit, Scene& scene) {
  if (fit.start_t != fit.begins) return;
  Prior& prior = scene.prior;
  prior.start = fit.start;
  if (prior.sigma) {
    prior.sigma = State{start_deviations(fit.start_sigma.q, fit.start.q),
                        start_deviations(fit.start_sigma.u, fit.start.u)};
  } else {
    const Eigen::Index f = scene.model.coordinates();
    prior.uncertainty =
        Eigen::VectorXd::Constant(f, start_energy(fit, scene.model) / static_cast<double>(f));
  }
  if (fit.begins == 0.0 && scene.truth.given && starts_outside(scene.model, fit.start)) {
    scene.truth.start = fit.start;
  }
}

// The chatter time that a scene has if it gives none.
double own_chatter_time(const Scene& scene) {
  Model model = scene.model;
  set_chatter_time(model, scene.truth.given ? scene.truth.start : scene.prior.start);
  return model.chatter_time;
}

}  // namespace

Scene fitted_scene(const Scene& scene, const Identification& fit) {
  Scene fitted = with_determined(scene, fit);
  put_start(fit, fitted);
  if (scene.model.chatter_time == own_chatter_time(scene)) {
    fitted.model.chatter_time = own_chatter_time(fitted);
  }
  double jitter = fit.fits() ? fit.jitter : std::max(fit.jitter, fit.scatter);
  const Departure& departure = fit.departure;
  // The scatter about a model that does not fit is taken as its jitter.
  if (departure.drift && fit.fits()) {
    const bool drifts = departure.is_drift() || departure.is_scatter();
    fitted.prior.drift = drifts ? departure.drift->drift : departure.drift->high;
    if (drifts) jitter = departure.drift->jitter;
  }
  // A jitter below the resolution of times counts as none.
  fitted.prior.jitter = jitter > 1e-9 * fit.interval ? jitter : 0.0;
  fitted.prior.parameters = fitted_parameters(fit, scene.prior.parameters, fitted);
  fitted.prior.tolerance =
      not_tolerated(fit).empty() ? fitted_tolerance(fit, fitted.prior.jitter) : Tolerance{};
  return fitted;
}

}  // namespace sprag
