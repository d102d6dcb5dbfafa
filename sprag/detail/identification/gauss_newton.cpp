#include "sprag/detail/identification/gauss_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sprag/detail/estimates/uncertainty.h"
#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/mechanics/wide_product.h"

namespace sprag {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
// Slack of a gap, in sigma times the speed.
constexpr double slack = 1e-3;
// Standard deviation of the prior of a parameter, in ranges.
constexpr double prior_of_parameters = 3.0;
// Ridge of starts that the events do not determine, relative to the columns.
constexpr double ridge = 1e-11, least_ridge = 1e-150;  // whose square is a normal number
// Standard deviation of the prior of a start: the energy of each coordinate, in energies of a
// typical impact.
constexpr double prior_of_energy = 1e4;
// Largest change of a parameter in one step, in ranges.
constexpr double largest_step = 0.5;
// Weights of the gaps along recorded times, relative to the typical one.
constexpr double least_gap_weight = 0.33, largest_gap_weight = 6.0;
// Weight of the guessed time of an event that the record lost.
constexpr double weight_of_guess = 1e-6;
// An impact from inside multiplies the score by up to 1 plus this.
constexpr double penalty_of_inside = 10.0;
// A search this far from the minimum, in costs per event, gives up if a step leaves this share.
constexpr double hopeless = 30.0, slow_progress = 0.7;
// Slowest impact with a weight of its own, relative to the typical speed.
constexpr double grazing = 1e-3;

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::vector<double> recorded_times(const FitStretch& stretch) {
  std::vector<double> times;
  for (const FitEvent& event : stretch.events) times.push_back(event.t);
  return times;
}

MatrixXd columns_of(const MatrixXd& S, const std::vector<Index>& columns) {
  MatrixXd A(S.rows(), std::ssize(columns));
  for (Index j = 0; j < A.cols(); ++j) A.col(j) = S.col(columns[static_cast<std::size_t>(j)]);
  return A;
}

// Least squares of S = (columns | rhs) over the columns in `free`.
VectorXd solve(const MatrixXd& S, const VectorXd& rhs, const std::vector<Index>& free) {
  VectorXd x = VectorXd::Zero(S.cols() - 1);
  if (free.empty()) return x;
  const MatrixXd A = columns_of(S, free);
  const VectorXd norms = A.colwise().norm().transpose().cwiseMax(1e-300);
  const VectorXd y = least_squares(A * norms.cwiseInverse().asDiagonal(), rhs);
  for (Index j = 0; j < A.cols(); ++j) x[free[static_cast<std::size_t>(j)]] = y[j] / norms[j];
  return x;
}

}  // namespace

void triangularize_rows(Eigen::Ref<MatrixXd> M) {
  const Index rows = M.rows(), columns = std::min(M.cols(), rows - 1);
  for (Index j = 0; j < columns; ++j) {
    Index last = rows - 1;  // that is not zero
    while (last > j && M(last, j) == 0.0) --last;
    if (last == j) continue;
    auto below = M.col(j).segment(j + 1, last - j);
    const double of_below = below.squaredNorm();
    if (of_below == 0.0) {
      below.setZero();
      continue;
    }
    const double norm = std::sqrt(of_below + square(M(j, j)));
    const double alpha = M(j, j) > 0.0 ? -norm : norm;
    const double v = M(j, j) - alpha;
    const double beta = -v / alpha;  // of H = I - beta w w^T, w = (1, below / v)
    below /= v;
    for (Index k = j + 1; k < M.cols(); ++k) {
      auto column = M.col(k).segment(j + 1, last - j);
      const double share = beta * (M(j, k) + below.dot(column));
      M(j, k) -= share;
      column -= share * below;
    }
    M(j, j) = alpha;
    below.setZero();
  }
}

namespace {

// X with X X^T = (A^T A)^-1, also where A is nearly singular.
MatrixXd inverse_root(MatrixXd A) {
  const VectorXd norms = A.colwise().norm().transpose().cwiseMax(1e-300);
  A = A * norms.cwiseInverse().asDiagonal();
  triangularize_rows(A);
  const Index P = A.cols();
  MatrixXd R = A.topRows(P);
  R.diagonal() = R.diagonal().unaryExpr([](double r) { return std::abs(r) > 1e-30 ? r : 1e-30; });
  const MatrixXd inverse = R.triangularView<Eigen::Upper>().solve(MatrixXd::Identity(P, P));
  return norms.cwiseInverse().asDiagonal() * inverse;
}

}  // namespace

std::size_t EventFit::events() const {
  std::size_t count = 0;
  for (const FitStretch& stretch : stretches) count += stretch.size();
  return count;
}

std::vector<double> EventFit::residuals() const {
  std::vector<double> all;
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    for (std::size_t k = 0; k < stretches[i].size(); ++k) {
      const FitEvent& event = stretches[i].events[k];
      if (event.timed && event.informs) all.push_back(point.times[i][k] - event.t);
    }
  }
  return all;
}

GaussNewton::GaussNewton(const Scene& scene, const std::vector<Parameter>& unknowns,
                         bool strictly_within)
    : flight_(scene, unknowns),
      is_linear_(!has_curves(scene.model)),
      n_(flight_.n()),
      P_(flight_.unknowns()) {
  Scene drifting = scene;
  drifting.prior.drift = 1.0;
  const Uncertainty uncertainty = uncertainty_of(drifting);
  const MatrixXd& of_q = uncertainty.drift_q;
  const MatrixXd& of_u = uncertainty.drift_u;
  drift_.resize(2 * n_, of_q.cols() + of_u.cols());
  drift_ << product(flight_.from_state().leftCols(n_), of_q),
      product(flight_.from_state().rightCols(n_), of_u);
  low_.setConstant(P_, -infinity);
  high_ = -low_;
  scale_.setOnes(P_);
  for (Index k = 0; k < P_; ++k) {
    const Parameter& unknown = unknowns[static_cast<std::size_t>(k)];
    low_[k] = unknown.lowest();
    high_[k] = unknown.highest();
    if (unknown.reach > 0.0 || !unknown.relative || is_of_clock(unknown)) continue;
    scale_[k] = unknown.within;
    if (!strictly_within) continue;
    constexpr double margin = 1.05;
    const double within = margin * unknown.within;
    const double below = unknown.logarithmic ? std::min(within, 0.95) : within;
    const auto [low, high] = std::minmax({unknown.coordinate(unknown.nominal * (1.0 - below)),
                                          unknown.coordinate(unknown.nominal * (1.0 + within))});
    low_[k] = std::max(low_[k], low);
    high_[k] = std::min(high_[k], high);
  }
}

void GaussNewton::linearize(const FitEvent& event, ContactSet held, double tau, Index columns,
                            Row& row) {
  const bool of_force = !event.impact();
  const Flight::Gap gap = of_force ? flight_.force(event.contact) : flight_.gap(event.contact);
  row.g = gap.g;
  row.gamma = gap.velocity;
  VectorXd gradient(2 * n_), of_velocity(2 * n_);
  flight_.gradients(event.contact, of_force, gradient, of_velocity);
  row.A.setIdentity(2 * n_, 2 * n_);
  flight_.carry(row.A);
  row.by_x.noalias() = row.A.transpose() * gradient;
  row.velocity_by_x.noalias() = row.A.transpose() * of_velocity;
  row.by_c.setZero(columns);
  row.of_time.setZero(columns);
  if (columns > 0 && P_ > 0) {
    VectorXd velocity(P_);
    flight_.differences(event.contact, of_force, row.by_c.head(P_), velocity);
  }
  row.s.setZero(2 * n_);
  row.noise.resize(2 * n_, 0);
  if (noise_.drift > 0.0) row.noise = std::sqrt(noise_.drift * std::max(tau, 0.0)) * drift_;
  row.by_noise.noalias() = row.noise.transpose() * gradient;
  if (event.impact()) {
    flight_.strike(event.contact, event.kind == ContactEventKind::closes, held);
    flight_.carry_through(row.A);
    if (row.noise.cols() > 0) flight_.carry_through(row.noise);
    row.s = flight_.by_time();
  }
  if (noise_.restitution > 0.0 && event.kind == ContactEventKind::pulse) {
    VectorXd along(2 * n_);
    flight_.along(event.contact, along);
    row.noise.conservativeResize(Eigen::NoChange, row.noise.cols() + 1);
    row.noise.rightCols(1) = noise_.restitution * std::abs(row.gamma) * along;
    row.by_noise.conservativeResize(row.noise.cols());
    row.by_noise.tail(1).setZero();
  }
  row.B.setZero(2 * n_, columns);
  if (columns > 0) row.B.leftCols(P_) = flight_.by_unknowns();
}

void GaussNewton::fly(const FitStretch& stretch, const VectorXd& start,
                      const std::vector<double>& times, Index columns, Path& path) {
  check_interrupt();
  path.rows.resize(std::max(path.rows.size(), stretch.size()));
  start_rows(stretch, start, columns, path);
  VectorXd x = start;
  double t = stretch.start;
  ContactSet held = stretch.held;
  for (std::size_t k = 0; k < stretch.size(); ++k) {
    const FitEvent& event = stretch.events[k];
    flight_.fly(x, t, times[k] - t, held);
    linearize(event, held, times[k] - t, columns, path.rows[k]);
    x = flight_.x();
    t = times[k];
    held = after(held, {t, event.contact, event.kind});
  }
  path.end = x;
  path.set_typical(stretch);
  if (path.prior.size() == 0) path.prior.setZero(2 * n_);
}

// The median speed of the impacts.
void GaussNewton::Path::set_typical(const FitStretch& stretch) {
  std::vector<double> speeds;
  for (std::size_t k = 0; k < stretch.size(); ++k) {
    if (stretch.events[k].impact()) speeds.push_back(std::abs(rows[k].gamma));
  }
  typical = median(std::move(speeds));
  if (!(typical > 0.0)) typical = 1.0;
}

// A contact that is closed at the start has no gap and no gap velocity. Without a scale the first
// contact's gap has velocity -1.
void GaussNewton::start_rows(const FitStretch& stretch, const VectorXd& start, Index columns,
                             Path& path) {
  const Index held = 2 * std::popcount(stretch.held);
  path.of_held.setZero(held + (fixes_speed_ ? 1 : 0), 2 * n_ + columns + 1);
  if (path.of_held.rows() == 0) return;
  flight_.fly(start, stretch.start, 0.0, stretch.held);
  Index row = 0;
  VectorXd of_g(2 * n_), of_velocity(2 * n_), g_by_c(P_), velocity_by_c(P_);
  for_each(stretch.held, [&](int contact) {
    const Flight::Gap gap = flight_.gap(contact);
    flight_.gradients(contact, false, of_g, of_velocity);
    path.of_held.row(row).head(2 * n_) = of_g.transpose();
    path.of_held.row(row + 1).head(2 * n_) = of_velocity.transpose();
    if (columns > 0) {
      flight_.differences(contact, false, g_by_c, velocity_by_c);
      path.of_held.row(row).segment(2 * n_, P_) = g_by_c.transpose();
      path.of_held.row(row + 1).segment(2 * n_, P_) = velocity_by_c.transpose();
    }
    path.of_held(row, 2 * n_ + columns) = -gap.g;
    path.of_held(row + 1, 2 * n_ + columns) = -gap.velocity;
    row += 2;
  });
  if (!fixes_speed_) return;
  const int contact = stretch.events.front().contact;
  flight_.gradients(contact, false, of_g, of_velocity);
  path.of_held.row(held).head(2 * n_) = of_velocity.transpose();
  path.of_held(held, 2 * n_ + columns) = -1.0 - flight_.gap(contact).velocity;
}

// First-order effects of the causes on the path after an impact, and on the recorded times.
void GaussNewton::add_causes(const FitStretch& stretch, const std::vector<double>& times,
                             Path& path) {
  VectorXd along(2 * n_);
  const double middle = 0.5 * (times.front() + times.back());
  const double half = std::max(0.5 * (times.back() - times.front()), 1e-300);
  const auto column = [&](Cause cause) {
    return P_ + std::distance(linear_causes.begin(),
                              std::find(linear_causes.begin(), linear_causes.end(), cause));
  };
  for (std::size_t k = 0; k < stretch.size(); ++k) {
    Row& row = path.rows[k];
    const FitEvent& event = stretch.events[k];
    row.of_time[column(Cause::clock_rate)] = -times[k];
    if (event.kind != ContactEventKind::pulse) continue;
    flight_.along(event.contact, along);
    const double speed = std::abs(row.gamma);
    row.B.col(column(Cause::restitution_by_speed)) = (speed / path.typical - 1.0) * speed * along;
    row.B.col(column(Cause::friction)) = path.typical * along;
    row.B.col(column(Cause::restitution_by_time)) = (times[k] - middle) / half * speed * along;
    // A soft stop reverses the velocity half the duration of the contact after the gap closes.
    row.B.col(column(Cause::soft_stop)) = row.s;
  }
}

void GaussNewton::sweep(const FitStretch& stretch, const VectorXd& at,
                        const std::vector<double>& times, Times mode, double sigma, Index columns,
                        Path& path) {
  const Index N = 2 * n_, m = N + columns + 1, f = mode == Times::free ? 1 : 0;
  MatrixXd& R = path.R;
  R.setZero(m, m);
  path.logs = 0.0;
  for (std::size_t k = stretch.size(); k-- > 0;) {
    Row& row = path.rows[k];
    const FitEvent& event = stretch.events[k];
    const auto by_x = R.topLeftCorner(N, N);
    const Index D = f == 1 ? row.noise.cols() : 0, e = f + D;  // eliminated: the time, the noise
    // First the rows that depend on the state: those of the parameters are triangular already.
    const Index first = 1 + e;
    work_.setZero(m + first, m + e);
    if (f == 1) work_.col(0).segment(first, N).noalias() = by_x * row.s;
    if (D > 0) work_.block(first, 1, N, D).noalias() = by_x * row.noise;
    multiply(by_x, row.A, work_.block(first, e, N, N));
    work_.block(first, e + N, m, columns) = R.middleCols(N, columns);
    work_.block(first, e + N, N, columns).noalias() += by_x * row.B;
    work_.col(e + N + columns).segment(first, m) = R.col(m - 1);
    const double w = f == 1 ? row.weight / (slack * sigma) : row.weight;
    if (f == 1) work_(0, 0) = w * row.gamma;
    if (D > 0) work_.row(0).segment(1, D) = w * row.by_noise.transpose();
    work_.row(0).segment(e, N) = w * row.by_x.transpose();
    work_.row(0).segment(e + N, columns) = w * row.by_c.transpose();
    work_(0, e + N + columns) = -w * row.g;
    if (f == 1) {
      const double of_time = (event.timed ? 1.0 : weight_of_guess) / sigma;
      work_(1, 0) = of_time;
      work_.row(1).segment(e + N, columns) = of_time * row.of_time.transpose();
      work_(1, e + N + columns) = of_time * (event.t - times[k]);
    }
    for (Index j = 0; j < D; ++j) work_(1 + f + j, 1 + j) = 1.0;
    triangularize_rows(work_);
    for (Index j = 0; j < e; ++j) path.logs += 2.0 * std::log(std::abs(work_(j, j)));
    if (f == 1 && w > 0.0) path.logs -= 2.0 * std::log(w);
    if (f == 1) row.eliminated = work_.row(0).transpose();
    R = work_.block(e, e, m, m);
  }
  // Closed contacts at the start, and the prior of the start.
  MatrixXd start = MatrixXd::Zero(m + path.of_held.rows() + N, m);
  start.topRows(m) = R;
  if (path.of_held.rows() > 0) {
    const double w = f == 1 ? 1.0 / (slack * sigma * path.typical) : 1.0 / path.typical;
    start.middleRows(m, path.of_held.rows()) = w * path.of_held;
  }
  const double size = f == 1 ? 1.0 : resolution_;
  for (Index i = 0; i < N; ++i) {
    const double least = std::max(ridge * R.col(i).norm(), least_ridge);
    start(start.rows() - N + i, i) = std::max(least, size * path.prior[i]);
    start(start.rows() - N + i, m - 1) = -size * path.prior[i] * at[i];
  }
  triangularize_rows(start);
  R = start.topRows(m);
}

VectorXd GaussNewton::start_step(const Path& path, const VectorXd& dc) const {
  const Index N = 2 * n_, columns = path.R.cols() - N - 1;
  VectorXd rhs = path.R.col(N + columns).head(N);
  if (dc.size() > 0) rhs -= path.R.block(0, N, N, dc.size()) * dc;
  return path.R.topLeftCorner(N, N).triangularView<Eigen::Upper>().solve(rhs);
}

// Norms of the columns of theta before the starts are eliminated.
VectorXd GaussNewton::effects_with_starts(std::size_t stretches, Index columns) const {
  VectorXd squares = VectorXd::Zero(columns);
  for (std::size_t i = 0; i < stretches; ++i) {
    squares += paths_[i].R.middleCols(2 * n_, columns).colwise().squaredNorm().transpose();
  }
  return squares.cwiseSqrt();
}

// Rows of (theta | rhs) of all stretches.
MatrixXd GaussNewton::shared(std::size_t stretches, Index columns) const {
  const Index rows = columns + 1;
  MatrixXd S(rows * static_cast<Index>(stretches), rows);
  for (std::size_t i = 0; i < stretches; ++i) {
    S.middleRows(rows * static_cast<Index>(i), rows) = paths_[i].R.bottomRightCorner(rows, rows);
  }
  return S;
}

void GaussNewton::fly_recorded(const std::vector<FitStretch>& stretches, const Held& held,
                               Index columns) {
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    fly(stretches[i], held.starts[i], recorded_times(stretches[i]), columns, paths_[i]);
  }
}

// Moves a path along held times by a change of its start.
void GaussNewton::shift(const FitStretch& stretch, VectorXd dx, Path& path) const {
  path.of_held.rightCols(1) -= path.of_held.leftCols(2 * n_) * dx;
  for (std::size_t k = 0; k < stretch.size(); ++k) {
    Row& row = path.rows[k];
    row.g += row.by_x.dot(dx);
    row.gamma += row.velocity_by_x.dot(dx);
    dx = row.A * dx;
  }
  path.end += dx;
  path.set_typical(stretch);
}

// The best starts along the recorded times at these parameters, from the paths of `held`, which
// move to them.
double GaussNewton::move_starts(const std::vector<FitStretch>& stretches, Held& held) {
  double squares = 0.0;
  std::size_t events = 0;
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    sweep(stretches[i], held.starts[i], recorded_times(stretches[i]), Times::held, 1.0, 0,
          paths_[i]);
    const VectorXd dx = start_step(paths_[i], VectorXd());
    held.starts[i] += dx;
    if (is_linear_) shift(stretches[i], dx, paths_[i]);
    squares += square(paths_[i].R(2 * n_, 2 * n_));
    events += stretches[i].size();
  }
  if (!is_linear_) fly_recorded(stretches, held, 0);
  held.rms = std::sqrt(squares / static_cast<double>(std::max<std::size_t>(events, 1)));
  return held.rms;
}

// Sets the weights from the speeds.
void GaussNewton::score(const std::vector<FitStretch>& stretches, Held& held) {
  double squares = 0.0;
  int events = 0, impacts = 0, inside = 0;
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    Path& path = paths_[i];
    const FitStretch& stretch = stretches[i];
    std::vector<double> rates;
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      if (!stretch.events[k].impact()) rates.push_back(std::abs(path.rows[k].gamma));
    }
    const double of_force = std::max(median(rates), std::numeric_limits<double>::min());
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      Row& row = path.rows[k];
      const bool impact = stretch.events[k].impact();
      const double typical = impact ? path.typical : of_force;
      const double ratio = typical / std::max(std::abs(row.gamma), 1e-12 * typical);
      row.weight = std::clamp(ratio, least_gap_weight, largest_gap_weight) / typical;
      if (!stretch.events[k].informs) row.weight = 0.0;
      squares += square(row.weight * row.g);
      events += stretch.events[k].informs;
      impacts += impact;
      inside += impact && row.gamma > 0.0;
    }
  }
  held.rms = std::sqrt(squares / std::max(events, 1));
  held.score = held.rms * (1.0 + penalty_of_inside * inside / std::max(impacts, 1));
  if (!std::isfinite(held.score)) held.score = infinity;
}

GaussNewton::Held GaussNewton::project(const std::vector<FitStretch>& stretches,
                                       const VectorXd& c) {
  Held held{c, {}, infinity, infinity};
  flight_.set(c, false);
  paths_.resize(std::max(paths_.size(), stretches.size()));
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    held.starts.emplace_back(VectorXd::Zero(2 * n_));
    Path& path = paths_[i];
    path.rows.resize(std::max(path.rows.size(), stretches[i].size()));
    path.typical = 1.0;
    path.prior.setZero(2 * n_);
    // Without speeds, the gaps of impacts alone.
    for (std::size_t k = 0; k < stretches[i].size(); ++k) {
      path.rows[k].weight = stretches[i].events[k].impact() ? 1.0 : 0.0;
    }
  }
  fly_recorded(stretches, held, 0);
  move_starts(stretches, held);
  score(stretches, held);
  for (std::size_t i = 0; i < stretches.size(); ++i) set_prior(paths_[i]);
  move_starts(stretches, held);
  score(stretches, held);
  return held;
}

GaussNewton::Held GaussNewton::hold(const std::vector<FitStretch>& stretches, const VectorXd& c,
                                    int iterations) {
  Held best = project(stretches, c);
  double lambda = 1e-3, events = 0.0;
  for (const FitStretch& stretch : stretches) events += static_cast<double>(stretch.size());
  for (int iteration = 0; P_ > 0 && iteration < iterations && best.score < infinity; ++iteration) {
    flight_.set(best.c, true);
    fly_recorded(stretches, best, P_);
    for (std::size_t i = 0; i < stretches.size(); ++i) {
      sweep(stretches[i], best.starts[i], recorded_times(stretches[i]), Times::held, 1.0, P_,
            paths_[i]);
    }
    const MatrixXd S = shared(stretches.size(), P_);
    if (!S.allFinite()) break;
    const VectorXd norms = S.leftCols(P_).colwise().norm().transpose().cwiseMax(1e-300);
    const double before = S.col(P_).squaredNorm();
    bool better = false;
    Held trial;
    for (int attempt = 0; attempt < 6 && !better; ++attempt) {
      MatrixXd damped = MatrixXd::Zero(S.rows() + P_, P_ + 1);
      damped.topRows(S.rows()) = S;
      damped.bottomLeftCorner(P_, P_).diagonal() = std::sqrt(lambda) * norms;
      VectorXd dc = bounded(damped, best.c, -1);
      dc = dc.cwiseMax(-largest_step * scale_).cwiseMin(largest_step * scale_);
      trial = {(best.c + dc).cwiseMax(low_).cwiseMin(high_), best.starts, 0.0, 0.0};
      flight_.set(trial.c, false);
      fly_recorded(stretches, trial, 0);
      const double rms = move_starts(stretches, trial);
      better = events * square(rms) <= before * (1.0 + 1e-12);
      lambda = better ? std::max(lambda / 9.0, 1e-12) : std::max(4.0 * lambda, 1e-6);
    }
    if (!better) break;
    const double gain = 1.0 - square(trial.rms) / std::max(square(best.rms), 1e-300);
    const double moved = ((trial.c - best.c).cwiseQuotient(scale_)).cwiseAbs().maxCoeff();
    score(stretches, trial);
    best = trial;
    if (std::abs(gain) < 1e-7 || moved < 1e-10) break;
  }
  return best;
}

// Each gap is weighted by its own speed.
void GaussNewton::weigh(const FitStretch& stretch, Path& path) const {
  for (std::size_t k = 0; k < stretch.size(); ++k) {
    const double least = stretch.events[k].impact() ? grazing * path.typical : 1e-300;
    path.rows[k].weight =
        stretch.events[k].informs ? 1.0 / std::max(std::abs(path.rows[k].gamma), least) : 0.0;
  }
}

// Sets the prior of the start by the typical speed.
void GaussNewton::set_prior(Path& path) const {
  double of_impact = 0.0;
  VectorXd along(2 * n_);
  for (int contact = 0; contact < flight_.contacts(); ++contact) {
    flight_.along(contact, along);
    of_impact = std::max(of_impact, flight_.twice_energy(along));
  }
  path.prior.resize(2 * n_);
  for (Index i = 0; i < 2 * n_; ++i) {
    const double of = flight_.twice_energy(VectorXd::Unit(2 * n_, i));
    path.prior[i] = std::sqrt(of / (prior_of_energy * of_impact)) / path.typical;
  }
}

double GaussNewton::cost_of_paths(const std::vector<FitStretch>& stretches, const FitPoint& point,
                                  double sigma) const {
  double sum = (point.c.cwiseQuotient(prior_of_parameters * scale_)).squaredNorm();
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    sum += paths_[i].prior.cwiseProduct(point.starts[i]).squaredNorm();
    for (std::size_t k = 0; k < stretches[i].size(); ++k) {
      const FitEvent& event = stretches[i].events[k];
      const Row& row = paths_[i].rows[k];
      const double weight = event.timed ? 1.0 : weight_of_guess;
      sum += square(weight * (point.times[i][k] - event.t) / sigma) +
             square(row.g * row.weight / (slack * sigma));
    }
  }
  return std::isfinite(sum) ? sum : infinity;
}

double GaussNewton::cost(const std::vector<FitStretch>& stretches, const FitPoint& point,
                         double sigma) {
  if (!point.c.allFinite()) return infinity;
  flight_.set(point.c, false);
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    const auto finite = [](double t) { return std::isfinite(t); };
    if (!std::all_of(point.times[i].begin(), point.times[i].end(), finite)) return infinity;
    fly(stretches[i], point.starts[i], point.times[i], 0, paths_[i]);
  }
  return cost_of_paths(stretches, point, sigma);
}

// The least squares step of c within the bounds, by the active set method of Stark and Parker
// (1995): a parameter at its bound is released if the cost falls inwards.
VectorXd GaussNewton::bounded(const MatrixXd& S, const VectorXd& c, Index fixed) const {
  VectorXd dc = VectorXd::Zero(P_);
  std::vector<int> side(static_cast<std::size_t>(P_), 0);  // of the bound it is at; 0: free
  for (Index round = 0; round <= 4 * P_; ++round) {
    std::vector<Index> free;
    VectorXd rhs = S.col(P_);
    for (Index k = 0; k < P_; ++k) {
      if (k != fixed && side[static_cast<std::size_t>(k)] == 0) {
        free.push_back(k);
      } else {
        rhs -= S.col(k) * dc[k];
      }
    }
    const VectorXd to = solve(S, rhs, free);
    // Up to the first bound.
    double share = 1.0;
    Index first = -1;
    for (const Index k : free) {
      const bool inside = c[k] + to[k] >= low_[k] && c[k] + to[k] <= high_[k];
      if (inside) continue;
      const double end = (to[k] < dc[k] ? low_[k] : high_[k]) - c[k];
      const double part = (end - dc[k]) / (to[k] - dc[k]);
      if (part < share) share = std::max(part, 0.0), first = k;
    }
    for (const Index k : free) dc[k] += share * (to[k] - dc[k]);
    if (first >= 0) {
      const bool lower = to[first] < dc[first];
      dc[first] = (lower ? low_[first] : high_[first]) - c[first];
      side[static_cast<std::size_t>(first)] = lower ? -1 : 1;
      continue;
    }
    const VectorXd slope = S.leftCols(P_).transpose() * (S.leftCols(P_) * dc - S.col(P_));
    Index release = -1;
    double steepest = 0.0;
    for (Index k = 0; k < P_; ++k) {
      const double inwards = slope[k] * side[static_cast<std::size_t>(k)];
      const double norm = S.col(k).norm();
      if (inwards > 1e-9 * norm * S.col(P_).norm() && inwards / norm > steepest) {
        steepest = inwards / norm;
        release = k;
      }
    }
    if (release < 0) break;
    side[static_cast<std::size_t>(release)] = 0;
  }
  return dc;
}

// Steps of a start and, from it, of all times.
std::pair<VectorXd, std::vector<double>> GaussNewton::path_step(const FitStretch& stretch,
                                                                const Path& path,
                                                                const VectorXd& dc) const {
  const VectorXd start = start_step(path, dc);
  const Index columns = dc.size();
  VectorXd dx = start;
  std::vector<double> times;
  for (std::size_t k = 0; k < stretch.size(); ++k) {
    const Row& row = path.rows[k];
    const VectorXd& of = row.eliminated;
    const double d = (of[2 * n_ + columns + 1] - of.segment(1, 2 * n_).dot(dx) -
                      of.segment(1 + 2 * n_, columns).dot(dc)) /
                     (of[0] != 0.0 ? of[0] : 1e-300);
    times.push_back(d);
    VectorXd next = row.A * dx + row.s * d;
    if (columns > 0) next += row.B * dc;
    dx = next;
  }
  return {start, times};
}

// A step of starts and times at fixed parameters. It removes the curvature of the gaps, which
// would shorten the steps of the parameters (Maratos effect). Returns the cost.
double GaussNewton::restore(const std::vector<FitStretch>& stretches, FitPoint& point,
                            double sigma) {
  double now = cost(stretches, point, sigma);
  for (int round = 0; round < 3 && now < infinity; ++round) {
    FitPoint next = point;
    for (std::size_t i = 0; i < stretches.size(); ++i) {
      sweep(stretches[i], point.starts[i], point.times[i], Times::free, sigma, 0, paths_[i]);
      const auto [dx, dt] = path_step(stretches[i], paths_[i], VectorXd());
      next.starts[i] += dx;
      for (std::size_t k = 0; k < dt.size(); ++k) next.times[i][k] += dt[k];
    }
    const double after = cost(stretches, next, sigma);
    if (!(after < now)) break;
    const bool small = now - after < 0.1 * now;
    point = std::move(next);
    now = after;
    if (small) break;
  }
  return now;
}

// Rows of theta and of the prior of the parameters.
MatrixXd GaussNewton::with_prior(const MatrixXd& rows, const VectorXd& c) const {
  MatrixXd S = MatrixXd::Zero(rows.rows() + P_, P_ + 1);
  S.topRows(rows.rows()) = rows;
  for (Index k = 0; k < P_; ++k) {
    S(rows.rows() + k, k) = 1.0 / (prior_of_parameters * scale_[k]);
    S(rows.rows() + k, P_) = -c[k] * S(rows.rows() + k, k);
  }
  return S;
}

FitPoint GaussNewton::step(const std::vector<FitStretch>& stretches, const VectorXd& dc) const {
  FitPoint step{dc, {}, {}};
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    auto [dx, dt] = path_step(stretches[i], paths_[i], dc);
    step.starts.push_back(std::move(dx));
    step.times.push_back(std::move(dt));
  }
  return step;
}

FitPoint GaussNewton::moved(FitPoint point, const FitPoint& step, double share) const {
  point.c = (point.c + share * step.c).cwiseMax(low_).cwiseMin(high_);
  for (std::size_t i = 0; i < point.starts.size(); ++i) {
    point.starts[i] += share * step.starts[i];
    for (std::size_t k = 0; k < point.times[i].size(); ++k) {
      point.times[i][k] += share * step.times[i][k];
    }
  }
  return point;
}

EventFit GaussNewton::stepped(EventFit fit) {
  linearize(fit, P_, {});
  const MatrixXd S = with_prior(shared(fit.stretches.size(), P_), fit.point.c);
  fit.point = moved(std::move(fit.point), step(fit.stretches, bounded(S, fit.point.c, -1)), 1.0);
  fit.squares = 0.0;
  for (const double residual : fit.residuals()) fit.squares += square(residual);
  return fit;
}

EventFit GaussNewton::refine(std::vector<FitStretch> stretches, FitPoint point, double sigma,
                             int iterations, Index fixed) {
  EventFit fit;
  fit.sigma = sigma;
  paths_.resize(std::max(paths_.size(), stretches.size()));
  MatrixXd S;
  double now = infinity;
  for (int iteration = 0; iteration <= iterations; ++iteration) {
    flight_.set(point.c, P_ > 0);
    for (std::size_t i = 0; i < stretches.size(); ++i) {
      fly(stretches[i], point.starts[i], point.times[i], P_, paths_[i]);
    }
    for (std::size_t i = 0; i < stretches.size(); ++i) {
      if (iteration == 0) set_prior(paths_[i]);
      weigh(stretches[i], paths_[i]);
      sweep(stretches[i], point.starts[i], point.times[i], Times::free, sigma, P_, paths_[i]);
    }
    fit.own_share = effects_with_starts(stretches.size(), P_);
    S = with_prior(shared(stretches.size(), P_), point.c);
    if (!S.allFinite()) return fit;
    if (fit.converged || iteration == iterations) break;
    now = cost_of_paths(stretches, point, sigma);
    const FitPoint step = this->step(stretches, bounded(S, point.c, fixed));
    fit.remaining = now - (S.col(P_) - S.leftCols(P_) * step.c).squaredNorm();
    const double largest = P_ > 0 ? step.c.cwiseQuotient(scale_).cwiseAbs().maxCoeff() : 0.0;
    const double full = std::min(1.0, largest_step / std::max(largest, 1e-300));
    bool better = false;
    double share = 1.0, next_cost = infinity;
    FitPoint next;
    for (const double part : {1.0, 0.5, 0.25, 0.1, 0.03}) {
      share = part * full;
      next = moved(point, step, share);
      next_cost = restore(stretches, next, sigma);
      better = next_cost <= now * (1.0 + 1e-9) + 1e-9;
      if (better) break;
    }
    if (!better) break;
    const bool small = now - next_cost < 1e-3 * std::max(1.0, 1e-3 * now);
    const bool slow = share < 1.0 || next_cost > slow_progress * now;
    point = std::move(next);
    now = next_cost;
    fit.converged = small && share == 1.0;
    const auto count = static_cast<double>(stretches.front().size());
    if (iteration >= 4 && now > hopeless * (count + 3.0) && slow) break;
  }
  fit.cost = now;
  fit.stretches = std::move(stretches);
  fit.point = std::move(point);
  finish(fit, S, fixed);
  return fit;
}

void GaussNewton::finish(EventFit& fit, const MatrixXd& S, Index fixed) {
  int timed = 0;
  for (std::size_t i = 0; i < fit.stretches.size(); ++i) {
    const FitStretch& stretch = fit.stretches[i];
    std::vector<double> velocities;
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      velocities.push_back(paths_[i].rows[k].gamma);
      if (!stretch.events[k].timed || !stretch.events[k].informs) continue;
      const Row& row = paths_[i].rows[k];
      // Where the search did not converge, the path's own time counts.
      const double off = row.g * row.weight * (row.gamma < 0.0 ? -1.0 : 1.0);
      const double tau = fit.point.times[i][k] - (fit.converged ? 0.0 : off);
      fit.squares += square(tau - stretch.events[k].t);
      ++timed;
    }
    timed += 2 * std::popcount(stretch.held) + (fixes_speed_ ? 1 : 0);
    fit.velocities.push_back(std::move(velocities));
  }
  fit.last = paths_[0].end;
  const Index unknowns = 2 * n_ * std::ssize(fit.stretches) + P_ - static_cast<Index>(fixed >= 0);
  fit.freedom = std::max(1, timed - static_cast<int>(unknowns));
  fit.covariance.setZero(P_, P_);
  std::vector<Index> free;
  for (Index k = 0; k < P_; ++k) {
    if (k != fixed) free.push_back(k);
  }
  if (free.empty()) return;
  const MatrixXd inverse = inverse_root(columns_of(S, free));
  const MatrixXd covariance = product(inverse, inverse.transpose());
  for (Index i = 0; i < covariance.rows(); ++i) {
    for (Index j = 0; j < covariance.cols(); ++j) {
      fit.covariance(free[static_cast<std::size_t>(i)], free[static_cast<std::size_t>(j)]) =
          covariance(i, j);
    }
    const Index k = free[static_cast<std::size_t>(i)];
    fit.own_share[k] = 1.0 / std::max(std::sqrt(covariance(i, i)) * fit.own_share[k], 1.0);
  }
}

// Rows of all stretches about a fit.
void GaussNewton::linearize(const EventFit& fit, Index columns, const FitNoise& noise) {
  noise_ = noise;
  flight_.set(fit.point.c, P_ > 0);
  paths_.resize(std::max(paths_.size(), fit.stretches.size()));
  for (std::size_t i = 0; i < fit.stretches.size(); ++i) {
    fly(fit.stretches[i], fit.point.starts[i], fit.point.times[i], columns, paths_[i]);
    set_prior(paths_[i]);
    weigh(fit.stretches[i], paths_[i]);
    if (columns > P_) add_causes(fit.stretches[i], fit.point.times[i], paths_[i]);
    sweep(fit.stretches[i], fit.point.starts[i], fit.point.times[i], Times::free, fit.sigma,
          columns, paths_[i]);
  }
  noise_ = {};
}

std::vector<Index> GaussNewton::inside(const VectorXd& c) const {
  std::vector<Index> free;
  for (Index k = 0; k < P_; ++k) {
    if (c[k] > low_[k] + 1e-9 && c[k] < high_[k] - 1e-9) free.push_back(k);
  }
  return free;
}

std::array<GaussNewton::Effect, linear_causes.size()> GaussNewton::effects(const EventFit& fit,
                                                                           const FitNoise& noise) {
  const Index columns = P_ + std::ssize(linear_causes);
  linearize(fit, columns, noise);
  const MatrixXd S = shared(fit.stretches.size(), columns);
  std::array<Effect, linear_causes.size()> effects{};
  if (!S.allFinite()) return effects;
  const std::vector<Index> base = inside(fit.point.c);
  // What the parameters leave of a column.
  const auto rest = [&](Index column) -> VectorXd {
    return S.col(column) - S.leftCols(columns) * solve(S, S.col(column), base);
  };
  const VectorXd residual = rest(columns),
                 norms = effects_with_starts(fit.stretches.size(), columns);
  for (std::size_t cause = 0; cause < effects.size(); ++cause) {
    const Index column = P_ + static_cast<Index>(cause);
    const VectorXd own = rest(column);
    const double squares = own.squaredNorm();
    // Starts and parameters explain the cause, up to the errors of their differences.
    if (std::sqrt(squares) <= least_own_share * norms[column]) continue;
    const double value = own.dot(residual) / squares;
    effects[cause] = {value, 1.0 / std::sqrt(squares), square(value) * squares};
  }
  return effects;
}

GaussNewton::Likelihood GaussNewton::likelihood(const EventFit& fit, const FitNoise& noise) {
  linearize(fit, P_, noise);
  const MatrixXd S = shared(fit.stretches.size(), P_);
  const std::vector<Index> free = inside(fit.point.c);
  Likelihood likelihood{0.0, 0.0, solve(S, S.col(P_), free), VectorXd::Zero(P_)};
  likelihood.squares = (S.col(P_) - S.leftCols(P_) * likelihood.changes).squaredNorm();
  if (!free.empty()) {
    MatrixXd A = columns_of(S, free);
    const VectorXd sigmas = inverse_root(A).rowwise().norm();
    for (Index j = 0; j < sigmas.size(); ++j) {
      likelihood.sigmas[free[static_cast<std::size_t>(j)]] = sigmas[j];
    }
    triangularize_rows(A);
    likelihood.logs = 2.0 * A.diagonal().cwiseAbs().array().log().sum();
  }
  for (std::size_t i = 0; i < fit.stretches.size(); ++i) {
    likelihood.logs += paths_[i].logs;
    for (Index k = 0; k < 2 * n_; ++k) {
      likelihood.logs += 2.0 * std::log(std::abs(paths_[i].R(k, k)));
    }
  }
  return likelihood;
}

GaussNewton::Spread GaussNewton::spread(const EventFit& fit) {
  linearize(fit, P_, {});
  Spread spread;
  const Index N = 2 * n_;
  // Root of the covariance of c.
  const CholeskyFactor of_c(fit.covariance + 1e-300 * MatrixXd::Identity(P_, P_));
  MatrixXd root_of_c = of_c.L();
  if (!of_c.exists()) {
    root_of_c = fit.covariance.diagonal().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  }
  for (std::size_t i = 0; i < fit.stretches.size(); ++i) {
    const Path& path = paths_[i];
    // Deviations (x, c) = S xi of unit variances; each time adds one.
    MatrixXd S = MatrixXd::Zero(N + P_, N + P_);
    const auto R = path.R.topLeftCorner(N, N).triangularView<Eigen::Upper>();
    S.topLeftCorner(N, N) = R.solve(MatrixXd::Identity(N, N));
    S.bottomRightCorner(P_, P_) = root_of_c;
    if (P_ > 0) S.topRightCorner(N, P_) = -R.solve(product(path.R.block(0, N, N, P_), root_of_c));
    if (i == 0) spread.start = product(S.topRows(N), S.topRows(N).transpose());
    spread.leverage.emplace_back();
    for (std::size_t k = 0; k < fit.stretches[i].size(); ++k) {
      const Row& row = path.rows[k];
      Eigen::RowVectorXd of_time = -(row.eliminated.segment(1, N + P_).transpose() * S);
      of_time.conservativeResize(S.cols() + 1);
      of_time[S.cols()] = 1.0;
      of_time /= row.eliminated[0];
      spread.leverage.back().push_back(
          std::clamp(of_time.squaredNorm() / square(fit.sigma), 0.0, 1.0));
      MatrixXd next = MatrixXd::Zero(N + P_, S.cols() + 1);
      next.topLeftCorner(N, S.cols()) = product(row.A, S.topRows(N));
      if (P_ > 0) next.topLeftCorner(N, S.cols()) += product(row.B.leftCols(P_), S.bottomRows(P_));
      next.topRows(N) += row.s * of_time;
      next.bottomLeftCorner(P_, S.cols()) = S.bottomRows(P_);
      MatrixXd transposed = next.transpose();
      triangularize_rows(transposed);
      S = transposed.topRows(N + P_).transpose();
    }
  }
  return spread;
}

std::vector<std::vector<double>> GaussNewton::misses(const EventFit& fit) {
  flight_.set(fit.point.c, false);
  std::vector<std::vector<double>> misses;
  for (std::size_t i = 0; i < fit.stretches.size(); ++i) {
    Path& path = paths_[i];
    fly(fit.stretches[i], fit.point.starts[i], recorded_times(fit.stretches[i]), 0, path);
    misses.emplace_back();
    for (std::size_t k = 0; k < fit.stretches[i].size(); ++k) {
      if (!fit.stretches[i].events[k].impact()) continue;
      // The time of a grazing impact is uncertain, so that its speed is limited from below.
      const double speed = std::max(std::abs(path.rows[k].gamma), path.typical / 3.0);
      misses.back().push_back(std::abs(path.rows[k].g) / speed);
    }
  }
  return misses;
}

}  // namespace sprag
