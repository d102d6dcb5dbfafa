#include "sprag/detail/filter/linearized_flight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

// Gauss-Legendre nodes and weights on [0, 1]: exact for the covariance of a flight in which the
// propagator is a cubic, accurate up to about a period of the fastest mode that is pushed.
constexpr std::array<std::array<double, 2>, 4> kick_nodes{{
    {0.06943184420297371, 0.17392742256872693},
    {0.33000947820757187, 0.32607257743127307},
    {0.66999052179242813, 0.32607257743127307},
    {0.93056815579702629, 0.17392742256872693},
}};

}  // namespace

LinearizedFlight::LinearizedFlight(Flight& flight, const FilterModel& model)
    : flight_(&flight), model_(&model) {
  considers_ =
      std::find(model.considered.begin(), model.considered.end(), true) != model.considered.end();
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    if (flight.changes_flow(k)) flow_unknowns_.push_back(k);
  }
  const auto kicks = std::ssize(kick_nodes) * model.kicks.cols();
  const Eigen::Index before = size() + model.walk.size() + model.drift.cols() + kicks;
  kick_.setZero(2 * n(), model.kicks.cols());
  // Second-order columns; one for the Schmidt update or time rounding; three for the published
  // estimate.
  const Eigen::Index columns = before * (1 + std::ssize(flow_unknowns_)) + 4;
  A.setZero(size(), before);
  X.setZero(2 * n(), columns);
  T.setZero(unknowns(), columns);
  for (Eigen::VectorXd* of_columns : {&phi, &psi}) of_columns->setZero(columns);
  for (Eigen::VectorXd* of_x : {&x, &of_g, &of_velocity, &dx}) of_x->setZero(2 * n());
  for (Eigen::VectorXd* of_c : {&by_c, &velocity_by_c}) of_c->setZero(unknowns());
  for (Eigen::VectorXd* of_z : {&gain_, &past_gain_, &past_mean}) of_z->setZero(size());
}

void LinearizedFlight::keep_past(bool keep) {
  keeps_past_ = keep;
  if (keep) past.setZero(size(), X.cols());
}

void LinearizedFlight::spread(const FilterBelief& belief, double duration) {
  A.setZero();
  A.leftCols(size()) = belief.S;
  const double root = std::sqrt(std::max(duration, 0.0));
  for (Eigen::Index k = 0; k < model_->walk.size(); ++k) {
    A(2 * n() + k, size() + k) = model_->walk[k] * root;
  }
  const Eigen::Index drifts = model_->drift.cols();
  const Eigen::Index first = size() + model_->walk.size();
  if (drifts > 0) A.block(0, first, 2 * n(), drifts) = root * model_->drift;
  if (model_->kicks.cols() > 0) spread_kicks(first + drifts, duration, belief.held);
}

// Kicks at some times of the flight, each taken back to its start. White noise during the flight
// leaves position and velocity imperfectly correlated. One kick at the start would not: a measured
// position would then determine the velocity.
void LinearizedFlight::spread_kicks(Eigen::Index column, double duration, ContactSet held) {
  constexpr double most_growth = 1e8;
  for (const auto& [at, weight] : kick_nodes) {
    const double size = std::sqrt(weight * std::max(duration, 0.0));
    kick_ = size * model_->kicks;
    const double largest = kick_.cwiseAbs().maxCoeff();
    flight_->turn(-at * std::max(duration, 0.0), held, kick_);
    // Strongly damped modes grow backward in time.
    if (!(kick_.cwiseAbs().maxCoeff() <= most_growth * largest)) kick_ = size * model_->kicks;
    A.block(0, column, 2 * n(), kick_.cols()) = kick_;
    column += kick_.cols();
  }
}

void LinearizedFlight::fly(double t, const Eigen::VectorXd& z, const FilterBelief& belief,
                           bool second_order) {
  flight_->set(z.tail(unknowns()), unknowns() > 0);
  flight_->fly(z.head(2 * n()), belief.t, t - belief.t, belief.held);
  x = flight_->x();
  const Eigen::Index known = A.cols();
  X.leftCols(known) = A.topRows(2 * n());
  X.rightCols(X.cols() - known).setZero();
  flight_->carry(X.leftCols(known));
  if (unknowns() > 0) {
    X.leftCols(known).noalias() += flight_->by_unknowns().lazyProduct(A.bottomRows(unknowns()));
    T.rightCols(T.cols() - known).setZero();
    T.leftCols(known) = A.bottomRows(unknowns());
  }
  if (keeps_past_) {
    past.setZero();
    past.leftCols(size()).setIdentity();
    past_mean.setZero();
  }
  if (belief.held != 0 || !second_order) return;
  Eigen::Index first = known;
  for (const Eigen::Index k : flow_unknowns_) {
    const double sigma = A.row(2 * n() + k).norm();
    for (Eigen::Index j = 0; j < known; ++j) {
      dx = A.col(j).head(2 * n());
      flight_->carry_by_unknown(k, dx);
      X.col(first + j) = sigma * dx;
    }
    first += known;
  }
}

void LinearizedFlight::carry(const Eigen::Ref<const Eigen::VectorXd>& dz) {
  dx = dz.head(2 * n());
  flight_->carry(dx);
  if (unknowns() > 0) dx.noalias() += flight_->by_unknowns().lazyProduct(dz.tail(unknowns()));
}

void LinearizedFlight::look(int contact, bool of_force, double t) {
  of = of_force ? flight_->force(contact) : flight_->gap(contact);
  flight_->gradients(contact, of_force, of_g, of_velocity);
  phi.noalias() = X.transpose().lazyProduct(of_g);
  psi.noalias() = X.transpose().lazyProduct(of_velocity);
  if (unknowns() > 0) {
    // Partial derivatives by c: the total ones since the last event, minus the part through x.
    flight_->differences(contact, of_force, by_c, velocity_by_c);
    by_c.noalias() -= flight_->by_unknowns().transpose().lazyProduct(of_g);
    velocity_by_c.noalias() -= flight_->by_unknowns().transpose().lazyProduct(of_velocity);
    phi.noalias() += T.transpose().lazyProduct(by_c);
    if (!of_force) psi.noalias() += T.transpose().lazyProduct(velocity_by_c);
  }
  noise = square(measurement_rounding * of.rounding) +
          square(measurement_rounding * t) * (square(of.velocity) + psi.squaredNorm());
}

void LinearizedFlight::update_along(const Eigen::VectorXd& row, double shift, double share,
                                    Eigen::VectorXd& mean_x, Eigen::VectorXd& mean_c) {
  gain_.head(2 * n()).noalias() = X.lazyProduct(row);
  gain_.tail(unknowns()).noalias() = T.lazyProduct(row);
  for (Eigen::Index k = 0; considers_ && k < unknowns(); ++k) {
    if (model_->considered[static_cast<std::size_t>(k)]) gain_[2 * n() + k] = 0.0;
  }
  mean_x += shift * gain_.head(2 * n());
  mean_c += shift * gain_.tail(unknowns());
  for (Eigen::Index j = 0; j < row.size(); ++j) {
    X.col(j) -= (share * row[j]) * gain_.head(2 * n());
    T.col(j) -= (share * row[j]) * gain_.tail(unknowns());
  }
  if (!keeps_past_) return;
  past_gain_.noalias() = past.lazyProduct(row);
  past_mean += shift * past_gain_;
  for (Eigen::Index j = 0; j < row.size(); ++j) past.col(j) -= (share * row[j]) * past_gain_;
}

void LinearizedFlight::measure(double residual, double of_noise, Eigen::VectorXd& mean_x,
                               Eigen::VectorXd& mean_c) {
  const double variance = phi.squaredNorm() + of_noise;
  if (!(variance > 0.0)) return;
  const double shrink = 1.0 / (variance * (1.0 + std::sqrt(of_noise / variance)));
  update_along(phi, -residual / variance, considers_ ? 1.0 / variance : shrink, mean_x, mean_c);
  if (!considers_) return;
  const Eigen::Index last = event_columns() - 1;
  X.col(last) += (std::sqrt(of_noise) / variance) * gain_.head(2 * n());
  T.col(last) += (std::sqrt(of_noise) / variance) * gain_.tail(unknowns());
}

}  // namespace sprag
