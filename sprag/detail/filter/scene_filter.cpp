#include "sprag/detail/filter/scene_filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/filter/fall.h"
#include "sprag/detail/filter/family_flight.h"
#include "sprag/detail/filter/model_flight.h"
#include "sprag/detail/identification/task.h"
#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/wide_product.h"

namespace sprag {
namespace {

// The pool holds as many beliefs as fit into these bytes, within limits.
constexpr std::size_t pool_bytes = 16 << 20, most_kept = 4096, fewest_kept = 64;
// Rounding error of a state after a long run, relative to its largest terms.
constexpr double run_rounding = 4.0 * measurement_rounding;
// Least jitter with uncertain parameters, in periods of the slowest mode over 2 pi. The filter is
// of second order in the parameters; with exact times their third order would not be covered.
constexpr double least_sigma = 1e-6;

std::shared_ptr<const std::vector<std::string>> keys_of(const std::vector<Parameter>& unknowns) {
  auto keys = std::make_shared<std::vector<std::string>>();
  for (const Parameter& unknown : unknowns) keys->push_back(unknown.key);
  return keys;
}

FilterModel model_of(const Scene& scene, const Flight& flight, bool from_prior) {
  FilterModel model;
  const Eigen::Index f = flight.n(), P = flight.unknowns();
  const Uncertainty uncertainty = uncertainty_of(scene);
  const Eigen::Index of_q = uncertainty.drift_q.cols(), of_u = uncertainty.drift_u.cols();
  model.drift.setZero(2 * f, of_q + of_u);
  if (of_q > 0) model.drift.topLeftCorner(f, of_q) = uncertainty.drift_q;
  if (of_u > 0) model.drift.bottomRightCorner(f, of_u) = uncertainty.drift_u;
  model.drift = product(flight.from_state(), model.drift);
  if (const Eigen::MatrixXd& noise = uncertainty.input_noise; noise.cols() > 0) {
    model.kicks = product(flight.from_state().rightCols(f), noise);
  }
  model.chatter_time = scene.model.chatter_time;
  model.homogeneous = is_homogeneous(scene.model);
  if (P > 0 && from_prior) model.considered = scene.prior.parameters.consider;
  if (P > 0 && !from_prior) model.walk = walk_of(scene, P);
  return model;
}

// Throws ModelError if the filter cannot estimate these. `where`: the table or key of the scene
// that lists them.
void check(const std::vector<Parameter>& unknowns, const std::string& where) {
  for (const Parameter& unknown : unknowns) {
    if (can_be_filtered(unknown)) continue;
    throw ModelError(where + ": " + unknown.key +
                     " is of the contact clock, which a filter cannot estimate");
  }
  if (unknowns.empty()) throw ModelError("adaptive estimation has nothing that is free");
}

}  // namespace

SceneFilter::SceneFilter(const Scene& scene, std::shared_ptr<Flows> flows)
    : flight(std::make_unique<ModelFlight>(std::move(flows))),
      filter(*flight, model_of(scene, *flight, true)),
      sigma(scene.prior.jitter) {
  scale_is_open = is_homogeneous(scene.model) && sigma > 0.0;
  set_up(scene);
}

SceneFilter::SceneFilter(const Scene& scene, std::vector<Parameter> unknowns, bool from_prior)
    : family(std::make_unique<SceneValues>(scene, unknowns)),
      flight(std::make_unique<FamilyFlight>(scene, std::move(unknowns))),
      filter(*flight, model_of(scene, *flight, from_prior)),
      keys(keys_of(family->unknowns())) {
  check(family->unknowns(), from_prior ? "parameters" : "adapt.free");
  sigma = std::max(scene.prior.jitter, least_sigma / flight->smallest_frequency());
  if (from_prior) {
    prior = scene.prior.parameters.root_of_covariance();
    for (Eigen::Index k = 0; k < prior.rows(); ++k) {
      const Parameter& unknown = family->unknowns()[static_cast<std::size_t>(k)];
      prior.row(k) /= unknown.slope(unknown.nominal);
    }
  }
  set_up(scene);
}

void SceneFilter::set_up(const Scene& scene) {
  const Eigen::Index f = flight->n();
  const Uncertainty uncertainty = uncertainty_of(scene);
  may_start_inside = uncertainty.may_start_inside;
  M = scene.model.M;
  K = scene.model.K;
  outputs.setZero(2 * f, std::ssize(scene.model.outputs));
  for (Eigen::Index k = 0; k < outputs.cols(); ++k) {
    const Output& output = scene.model.outputs[static_cast<std::size_t>(k)];
    outputs.col(k).segment(output.velocity ? f : 0, f) = output.direction;
  }
  for (const Contact& contact : scene.model.contacts) {
    largest_w = std::max(largest_w, contact.w.cwiseAbs().maxCoeff());
  }
  start.setZero(2 * f, 2 * f);
  start.topLeftCorner(f, f) = uncertainty.q;
  start.bottomRightCorner(f, f) = uncertainty.u;
  start = product(flight->from_state(), start);
  inflated = start;
  of_start = flight->twice_energy(start);
  next = nothing = filter.no_belief();
  const double period = 2.0 * std::numbers::pi / flight->largest_frequency();
  first_flight = 2.0 * std::numbers::pi / flight->smallest_frequency();
  longest_look = std::max(period / looks, first_flight / square(1.0 * looks));
  least_look = std::max(scene.model.chatter_time, sigma);
  const std::size_t bytes = sizeof(double) * static_cast<std::size_t>(next.S.size());
  pool = std::make_unique<BeliefPool>(next, std::clamp(pool_bytes / bytes, fewest_kept, most_kept));
  q.setZero(f);
  u.setZero(f);
  x.setZero(2 * f);
  off = x;
  of_state.setZero(2 * f, next.S.cols());
  const Eigen::Index columns = filter.deviations().cols();
  of_gaps_.setZero(flight->contacts(), columns);
  columns_.setZero(2 * f, columns);
  row_.setZero(columns);
}

void SceneFilter::set_prior(FilterBelief& belief) const {
  const Eigen::Index P = prior.rows(), n2 = 2 * flight->n();
  for (Eigen::Index k = 0; k < P; ++k) {
    const Parameter& unknown = family->unknowns()[static_cast<std::size_t>(k)];
    belief.z[n2 + k] = unknown.coordinate(unknown.nominal);
  }
  belief.S.bottomRows(P).setZero();
  belief.S.rightCols(P).setZero();
  belief.S.bottomRightCorner(P, P) = prior;
}

double SceneFilter::motion_energy() const {
  double energy = 0.0;
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    energy += q[i] * K.col(i).dot(q) + u[i] * M.col(i).dot(u);
  }
  return energy;
}

SceneFilter::LastFlight SceneFilter::last_flight(int contact, double t,
                                                 const FilterBelief& before) {
  constexpr int samples = 64, near = 3;
  LastFlight last;
  if (contains(before.held, contact)) return last;
  const double tau = t - before.t;
  for (int i = 1; i <= samples + near; ++i) {
    filter.fly_mean(before.t + tau * i / samples, before);
    const double gap = filter.gap(contact);
    if (i >= samples - near && gap <= 0.0) last.ends_near = true;
    if (i >= samples) continue;
    if (gap < 0.0) last.inside += 1.0 / samples;
    last.lowest = std::min(last.lowest, gap);
    last.highest = std::max(last.highest, gap);
  }
  return last;
}

double SceneFilter::crossing_before(double t, int contact, const FilterBelief& belief) {
  const std::optional<Fall> fall = latest_fall(belief.t, t, [&](double when) {
    filter.fly_mean(when, belief);
    return filter.gap(contact);
  });
  return fall && fall->t > belief.t ? fall->t : -infinity;
}

void SceneFilter::publish(double t, const FilterBelief& of, Eigen::Ref<Eigen::VectorXd> of_q,
                          Eigen::Ref<Eigen::VectorXd> of_u) {
  flight->state(filter.publish(t, of), t, of_q, of_u);
}

void SceneFilter::fill_deviations(double t, const FilterBelief& of, Confidence& confidence) {
  const Eigen::Index f = flight->n();
  filter.gap_deviations(of, of_gaps_);
  multiply(flight->to_state(), filter.deviations(), columns_);
  // The covariance does not include the rounding errors of a run.
  flight->state(filter.estimate(), t, q, u);
  const bool several = flight->contacts() > 1;
  const double length =
      std::max(of.length, q.cwiseAbs().maxCoeff()) * (several ? contact_rounding : run_rounding);
  const double speed =
      std::max(of.speed, u.cwiseAbs().maxCoeff()) * (several ? contact_rounding : run_rounding);
  for (Eigen::Index i = 0; i < f; ++i) {
    confidence.sigma_q[i] = std::hypot(columns_.row(i).norm(), length);
    confidence.sigma_u[i] = std::hypot(columns_.row(f + i).norm(), speed);
  }
  for (Eigen::Index i = 0; i < of_gaps_.rows(); ++i) {
    confidence.sigma_g[i] = std::hypot(of_gaps_.row(i).norm(), length * largest_w);
  }
  for (Eigen::Index i = 0; i < outputs.cols(); ++i) {
    const auto output = outputs.col(i);
    row_.noalias() = output.transpose().lazyProduct(columns_);
    confidence.sigma_outputs[i] =
        std::hypot(row_.norm(), length * output.head(f).norm(), speed * output.tail(f).norm());
  }
}

void SceneFilter::fill_parameters(double t, const FilterBelief* of,
                                  ParameterEstimates& parameters) const {
  for (Eigen::Index k = 0; k < parameters.values.size(); ++k) {
    const Parameter& unknown = family->unknowns()[static_cast<std::size_t>(k)];
    if (of == nullptr) {
      parameters.values[k] = unknown.nominal;
      parameters.sigmas[k] = infinity;
      continue;
    }
    const Eigen::Index of_k = 2 * flight->n() + k;
    parameters.values[k] = unknown.value(of->z[of_k]);
    const Eigen::VectorXd& walk = filter.model().walk;
    const double walked = walk.size() > 0 ? square(walk[k]) * std::max(t - of->t, 0.0) : 0.0;
    const double variance = of->S.row(of_k).squaredNorm() + walked;
    parameters.sigmas[k] = std::sqrt(variance) * std::abs(unknown.slope(parameters.values[k]));
  }
}

Eigen::MatrixXd SceneFilter::belief(double t, const FilterBelief& of, Belief& belief) {
  const Eigen::Index f = flight->n(), P = flight->unknowns();
  const Eigen::VectorXd mean = filter.mean(t, of);
  Eigen::MatrixXd columns(2 * f + P, filter.deviations().cols());
  columns << product(flight->to_state(), filter.deviations()), filter.parameter_deviations();
  const Eigen::MatrixXd S = QR(columns.transpose()).R().transpose();
  belief.q.resize(f);
  belief.u.resize(f);
  flight->state(mean, t, belief.q, belief.u);
  belief.columns = S.cols();
  belief.S_q = S.topRows(f);
  belief.S_u = S.middleRows(f, f);
  return S.bottomRows(P);
}

}  // namespace sprag
