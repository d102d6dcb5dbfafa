#include "sprag/detail/identification/linearized_filter.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {
namespace {

constexpr double resolved = 1e-10;  // of the usual interval

}  // namespace

bool is_near(const Identification& fit) {
  constexpr double near = 0.01;  // of the usual interval
  return fit.converged() && fit.scatter < near * fit.interval;
}

bool is_exact(const Identification& fit) { return fit.scatter < resolved * fit.interval; }

LinearizedFilter::LinearizedFilter(const Scene& scene, const Identification& fit, About about)
    : family_(scene,
              [&] {
                std::vector<Unknown> unknowns;
                for (const FittedUnknown& fitted : fit.unknowns) unknowns.push_back(fitted.unknown);
                return unknowns;
              }()),
      stretches_(about == About::fit ? fit.likelihood.path : fit.measured),
      measured_(fit.measured),
      speeds_(fit.likelihood.gamma),
      interval_(fit.interval) {
  jitter_given_ = fit.jitter_given && fit.jitter > resolved * interval_;
  base_ = std::max(jitter_given_ ? fit.jitter : fit.scatter, resolved * interval_);
  // The filter does not use the equations of contacts that were closed at a start.
  taken_up_ = fit.likelihood.timed - fit.freedom +
              static_cast<int>(equations(stretches_) - count(stretches_));
  const Eigen::VectorXd& values = fit.likelihood.values;
  machine_ = family_.at(values);
  Harmonics harmonics;
  flights_.set(machine_, stretches_);
  harmonics.set(machine_.frequencies, stretches_);
  paths_.resize(stretches_.size());
  std::vector<double> speeds;
  for (std::size_t s = 0; s < stretches_.size(); ++s) {
    follow(machine_, flights_, harmonics, stretches_[s], s, fit.likelihood.x0[s],
           family_.inputs(values), paths_[s]);
    for (const double gamma : speeds_[s]) speeds.push_back(std::abs(gamma));
  }
  const auto middle = speeds.begin() + static_cast<std::ptrdiff_t>(speeds.size() / 2);
  std::nth_element(speeds.begin(), middle, speeds.end());
  speed_ = *middle;
  set_parameter_columns(fit, values);
  set_drift(fit.fitted);
}

void LinearizedFilter::set_parameter_columns(const Identification& fit,
                                             const Eigen::VectorXd& values) {
  constexpr double difference = 4e-6;
  const auto P = static_cast<Eigen::Index>(family_.unknowns().size());
  for (const Stretch& stretch : stretches_) {
    J_.emplace_back(static_cast<Eigen::Index>(stretch.size()), P);
  }
  Flights flights;
  Harmonics harmonics;
  Path path;
  for (Eigen::Index k = 0; k < P; ++k) {
    const Unknown& unknown = family_.unknowns()[static_cast<std::size_t>(k)];
    const auto [low, high] = unknown.neighbours(unknown.coordinate(values[k]), difference);
    for (const double side : {1.0, -1.0}) {
      Eigen::VectorXd moved = values;
      moved[k] = unknown.value(side > 0.0 ? high : low);
      const Machine machine = family_.at(moved);
      flights.set(machine, stretches_);
      harmonics.set(machine.frequencies, stretches_);
      for (std::size_t s = 0; s < stretches_.size(); ++s) {
        follow(machine, flights, harmonics, stretches_[s], s, fit.likelihood.x0[s],
               family_.inputs(moved), path);
        if (side > 0.0) {
          J_[s].col(k) = path.g / (2.0 * difference);
        } else {
          J_[s].col(k) -= path.g / (2.0 * difference);
        }
      }
    }
  }
}

void LinearizedFilter::add_restitution_trend() {
  const Eigen::Index P = parameters();
  const Eigen::VectorXd no_inputs = Eigen::VectorXd::Zero(machine_.inputs());
  for (std::size_t s = 0; s < stretches_.size(); ++s) {
    J_[s].conservativeResize(Eigen::NoChange, P + 1);
    Eigen::VectorXd y = Eigen::VectorXd::Zero(family_.n()), u = y;
    for (std::size_t k = 0; k < stretches_[s].size(); ++k) {
      const auto i = static_cast<Eigen::Index>(k);
      const Impact& impact = stretches_[s].impacts[k];
      const int contact = impact.contact;
      const auto w = machine_.W.col(contact);
      flights_.move(s, k, y, u, no_inputs);
      J_[s](i, P) = w.dot(y);
      const double gamma = paths_[s].gamma[i];
      const double more = std::abs(gamma) - speed_;  // change of the restitution by a trend of 1
      u -= jump_of(machine_, contact, impact.staying) * w.dot(u);
      // A contact that stays closed has no restitution.
      if (impact.staying == 0) u -= w * (more * gamma / w.squaredNorm());
    }
  }
  ++taken_up_;
}

void LinearizedFilter::set_drift(const Scene& fitted) {
  Scene scene = fitted;
  scene.prior.drift = 1.0;
  const Uncertainty uncertainty = uncertainty_of(scene);
  const Eigen::Index n = family_.n();
  drift_y_.resize(n, uncertainty.drift_q.cols());
  drift_u_.resize(n, uncertainty.drift_u.cols());
  for (Eigen::Index j = 0; j < drift_y_.cols(); ++j) {
    drift_y_.col(j) = family_.to_modes(uncertainty.drift_q.col(j));
    drift_u_.col(j) = family_.to_modes(uncertainty.drift_u.col(j));
  }
  const double moves =
      product(machine_.W.transpose(), drift_y_).squaredNorm() * interval_ +
      product(machine_.W.transpose(), drift_u_).squaredNorm() * std::pow(interval_, 3);
  unit_ = speed_ * speed_ / moves;
}

bool LinearizedFilter::meets_the_supports() const {
  // Of the usual interval; beyond it the path has parted from the times.
  constexpr double parted = 0.1;
  double squares = 0.0;
  for (const Path& path : paths_) squares += path.g.squaredNorm();
  const double off = std::sqrt(squares / static_cast<double>(count(stretches_))) / speed_;
  return off < parted * interval_;
}

// Mean and square root of the covariance of (y, u, parameters), and the likelihood so far.
struct LinearizedFilter::Estimate {
  Eigen::Index n = 0, P = 0, columns = 0;
  Eigen::VectorXd x;
  Eigen::MatrixXd S;  // the first `columns` columns
  double logs = 0.0, squares = 0.0;
  std::vector<double> innovations;  // in units of their deviations

  Eigen::Index states() const { return 2 * n + P; }
  void merge();
  void begin_stretch(double of_y, double of_u);
};

void LinearizedFilter::Estimate::merge() {
  const Eigen::MatrixXd R = QR(S.leftCols(columns).transpose()).R();
  S.setZero();
  S.leftCols(R.rows()) = R.transpose();
  columns = R.rows();
}

// Keeps the marginal distribution of the parameters and gives the state a diffuse prior.
void LinearizedFilter::Estimate::begin_stretch(double of_y, double of_u) {
  x.head(2 * n).setZero();
  Eigen::MatrixXd of_parameters(P, P);
  if (P > 0) {
    of_parameters =
        QR(S.block(2 * n, 0, P, std::max(columns, P)).transpose()).R().topRows(P).transpose();
  }
  S.setZero();
  S.block(2 * n, 0, P, P) = of_parameters;
  S.block(0, P, n, n).diagonal().setConstant(of_y);
  S.block(n, P + n, n, n).diagonal().setConstant(of_u);
  columns = states();
}

// Predicts to impact k of stretch s. `per_root`: factor of the process noise per root of a unit of
// time.
void LinearizedFilter::fly(std::size_t s, std::size_t k, double per_root, Estimate& of) const {
  const Eigen::Index n = of.n, D = drift_y_.cols();
  const Stretch& stretch = stretches_[s];
  Eigen::VectorXd y = of.x.head(n), u = of.x.segment(n, n);
  flights_.move(s, k, y, u, Eigen::VectorXd::Zero(machine_.inputs()));
  of.x.head(n) = y;
  of.x.segment(n, n) = u;
  // `inputs` = columns: deviations take no inputs.
  RowMatrix Y = of.S.topLeftCorner(n, of.columns), U = of.S.block(n, 0, n, of.columns);
  flights_.move(s, k, Y, U, of.columns, of.columns);
  of.S.topLeftCorner(n, of.columns) = Y;
  of.S.block(n, 0, n, of.columns) = U;
  if (!(per_root > 0.0)) return;
  const double from = k > 0 ? stretch.impacts[k - 1].t : stretch.start;
  // A path that begins at the measured time of its first impact may have that impact before its
  // start.
  const double root = per_root * std::sqrt(std::max(stretch.impacts[k].t - from, 0.0));
  of.S.block(0, of.columns, n, D) = root * drift_y_;
  of.S.block(n, of.columns + D, n, D) = root * drift_u_;
  of.columns += 2 * D;
}

// Measurement by the time of impact k of stretch s, and the impact itself.
void LinearizedFilter::update(std::size_t s, std::size_t k, double restitution_scatter,
                              Estimate& of) const {
  constexpr double rounding = 1e-13;   // of gaps, in usual flights
  constexpr double least_speed = 0.1;  // of the usual one
  const Impact& impact = stretches_[s].impacts[k];
  const Path& path = paths_[s];
  const auto i = static_cast<Eigen::Index>(k);
  const Eigen::Index n = of.n, P = of.P, states = of.states(), columns = of.columns;
  const auto w = machine_.W.col(impact.contact);
  const Eigen::VectorXd jump = jump_of(machine_, impact.contact, impact.staying);
  const double gamma = path.gamma[i];
  // At slow impacts of a chatter a drift of positions exceeds the gap; their times are not
  // measured.
  const bool slow = !(std::abs(speeds_[s][i]) > least_speed * speed_);
  const auto strike = [&](auto u_of_x, auto u_of_S) {
    const double gamma_of_x = w.dot(u_of_x);
    const Eigen::RowVectorXd gamma_of_S = w.transpose() * u_of_S;
    u_of_x -= jump * gamma_of_x;
    u_of_S -= jump * gamma_of_S;
  };
  if (slow && !impact.timed) {
    strike(of.x.segment(n, n), of.S.block(n, 0, n, columns));
    of.merge();
    return;
  }
  const bool measured = impact.timed && !slow;
  const double sigma = impact.timed ? base_ : interval_;
  const double later = impact.timed ? measured_[s].impacts[k].t - impact.t : 0.0;
  // The last column, and an extra row, are those of the delay e.
  Eigen::VectorXd x(states + 1);
  x << of.x, later;
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(states + 1, columns + 1);
  S.topLeftCorner(states, columns) = of.S.leftCols(columns);
  S(states, columns) = sigma;
  if (measured || !impact.timed) {
    const double noise = std::pow(rounding * speed_ * interval_, 2);
    Eigen::VectorXd phi(columns + 1);
    phi.head(columns) = S.topLeftCorner(n, columns).transpose() * w +
                        S.block(2 * n, 0, P, columns).transpose() * J_[s].row(i).transpose();
    phi[columns] = gamma * sigma;
    const double expected =
        path.g[i] + w.dot(of.x.head(n)) + J_[s].row(i).dot(of.x.tail(P)) + gamma * later;
    const double variance = phi.squaredNorm() + noise;
    PotterUpdate(phi, -expected, noise).apply(x, S);
    if (measured) {
      of.logs += std::log(variance / (gamma * gamma));
      of.squares += expected * expected / variance;
      of.innovations.push_back(expected / std::sqrt(variance));
    }
  }
  // Effect of the delay on the state after the impact.
  Eigen::VectorXd after = Eigen::VectorXd::Zero(states), on_y, on_u;
  effect_of_time(machine_, stretches_[s], k, path, on_y, on_u);
  after.head(n) = on_y;
  after.segment(n, n) = on_u;
  strike(x.segment(n, n), S.block(n, 0, n, columns + 1));
  of.x = x.head(states) + after * x[states];
  of.columns = columns + 1;
  of.S.leftCols(of.columns) = S.topRows(states) + after * S.row(states);
  // Independent error of this impact's restitution. It is negligible for slow impacts of a chatter.
  if (restitution_scatter > 0.0 && measured && impact.staying == 0) {
    of.S.col(of.columns).setZero();
    of.S.col(of.columns).segment(n, n) = w * (restitution_scatter * gamma / w.squaredNorm());
    ++of.columns;
  }
  of.merge();
}

LinearizedFilter::Value LinearizedFilter::at(double ratio, double restitution_scatter) const {
  // Deviation of the diffuse prior: of a start in usual motions, of a parameter in its coordinate.
  constexpr double unknown = 3.0;
  check_interrupt();
  Estimate of;
  of.n = family_.n();
  of.P = parameters();
  of.x.setZero(of.states());
  of.S.setZero(of.states(), of.states() + 2 * drift_y_.cols() + 2);
  of.S.block(2 * of.n, 0, of.P, of.P).diagonal().setConstant(unknown);
  of.columns = of.P;
  const double per_root = std::sqrt(ratio * unit(base_));
  const double of_u = unknown * speed_ * static_cast<double>(machine_.W.cols()) / machine_.W.norm();
  for (std::size_t s = 0; s < stretches_.size(); ++s) {
    of.begin_stretch(of_u * interval_, of_u);
    for (std::size_t k = 0; k < stretches_[s].size(); ++k) {
      fly(s, k, per_root, of);
      update(s, k, restitution_scatter, of);
    }
  }
  Value value{-0.5 * (of.logs + of.squares),          of.squares,    base_, of.x.tail(of.P),
              of.S.bottomRows(of.P).rowwise().norm(), of.innovations};
  if (jitter_given_) return value;
  // All variances but those of the diffuse prior are proportional to the jitter squared.
  const double freedom = std::max(1, static_cast<int>(of.innovations.size()) - taken_up_);
  const double factor = of.squares / freedom;
  value.jitter = base_ * std::sqrt(factor);
  value.sigmas *= std::sqrt(factor);
  value.log = -0.5 * (of.logs + freedom * (std::log(factor) + 1.0));
  return value;
}

}  // namespace sprag
