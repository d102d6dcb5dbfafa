#include "sprag/detail/identification/maximum_likelihood.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

constexpr double untimed_weight = 1e-3;  // square root of 1e-6
constexpr double undetermined_below = 1e-12;
// Standard deviations of the weak prior: of an unknown in ranges of its search, of a start in units
// of the largest motion on the path.
constexpr double prior_ranges = 3.0, prior_motions = 30.0;
// Relative resolution of times, of the usual interval. The prior is never weaker than that.
constexpr double resolution = 1e-11;
constexpr double largest_radius = 1.0;  // trust region: largest step of an unknown's coordinate

// The weighted constraints of one stretch, linearized: A (x0, tau) + J p + violation = 0. There are
// N for the impacts and R others: two for each contact that was closed at the start, one if the
// scale is free.
struct Constraints {
  Eigen::MatrixXd A;          // (N + R) x (2n + N)
  Eigen::MatrixXd J;          // (N + R) x P
  Eigen::VectorXd violation;  // N + R
};

// The constraints of one stretch, solved for its own variables x0 and tau.
struct Block {
  Eigen::VectorXd scale;      // scale of x0's columns
  Eigen::MatrixXd Q2;         // null space, (2n + N) x (2n - R)
  Eigen::VectorXd step;       // minimum-norm (x0, tau) that satisfies them
  Eigen::MatrixXd step_rate;  // its derivative by the unknowns, (2n + N) x P
  // Residuals: N weighted times, then 2n of the prior of x0.
  Eigen::MatrixXd B2;  // their change along Q2, (N + 2n) x (2n - R)
  PivotedQR qr;        // of B2
  Eigen::VectorXd e0;  // residuals for unchanged unknowns
  Eigen::MatrixXd eJ;  // derivative of the residuals by the unknowns
};

// Standard deviation of the prior of an unknown, in its coordinate.
double prior_deviation(const Unknown& unknown) {
  if (unknown.kind == Kind::phase || unknown.kind == Kind::clock_offset ||
      unknown.kind == Kind::delay) {
    return prior_ranges * std::numbers::pi;
  }
  if (unknown.kind == Kind::clearance) return prior_ranges;
  return prior_ranges * std::max(std::abs(unknown.lowest()), std::abs(unknown.highest()));
}

class Maximization {
 public:
  Maximization(const MachineFamily& family, const Stretches& measured, Likelihood start,
               std::span<const std::size_t> held)
      : family_(family),
        measured_(measured),
        at_(std::move(start)),
        held_(held.begin(), held.end()) {}

  Likelihood run();
  Likelihood as_it_is();

 private:
  void linearize();
  void follow_paths();
  void difference_nonlinear(Eigen::Index k);
  Constraints constraints_of(std::size_t s);
  void eliminate(const Constraints& of, Block& block) const;
  void set_residuals(std::size_t s, Block& block) const;
  void jacobian(std::size_t s, const PathRows& rows, Eigen::MatrixXd& J) const;
  Eigen::VectorXd gaps(const Machine& machine, const Eigen::VectorXd& inputs, std::size_t s,
                       const Path& path) const;
  void stack();
  Eigen::VectorXd prior_of_x0(std::size_t s) const;
  void set_noise();
  void adapt_radius();
  Eigen::VectorXd change_of_unknowns();
  double step();
  void finish();
  void set_leverages();

  Eigen::Index unknowns() const { return static_cast<Eigen::Index>(family_.unknowns().size()); }
  const Unknown& unknown(Eigen::Index k) const {
    return family_.unknowns()[static_cast<std::size_t>(k)];
  }

  const MachineFamily& family_;
  const Stretches& measured_;
  Likelihood at_;
  Machine machine_;
  Flights flights_;
  Harmonics harmonics_;
  std::vector<Path> paths_;
  std::vector<std::vector<Eigen::VectorXd>> nonlinear_columns_;  // of each unknown, by stretch
  std::vector<Block> blocks_;
  // Residuals by unknown that remain after each stretch has eliminated its own variables. The last
  // rows are the prior of the unknowns.
  Eigen::MatrixXd M_;
  Eigen::VectorXd r_;
  Eigen::VectorXd dp_;
  std::vector<std::size_t> held_;   // unknowns that keep their values
  std::vector<Eigen::Index> free_;  // unknowns that are neither held nor at a bound
  std::vector<bool> at_bound_;      // unknowns that end at a bound of their range
  std::vector<double> constraint_;  // g / |gamma-| of the impacts [s]
  double most_speed_ = 0.0;         // largest |gamma-| of the impacts
  double interval_ = 0.0;           // mean time between impacts
  double noise_ = 0.0;              // standard deviation of times that the prior is weighed with
  std::optional<double> expected_squares_;  // sum of (tau - t)^2 that the last step predicts [s^2]
  // Radius of the trust region, in the unknowns' coordinates.
  double radius_ = largest_radius;
  double longest_ = 0.0;    // largest change of a coordinate in the last step
  double decrement_ = 0.0;  // reduction of the objective by the last step in full, predicted [s^2]
};

// Prior of a start: about as large as the motion on the path. It keeps unobservable directions
// finite.
Eigen::VectorXd Maximization::prior_of_x0(std::size_t s) const {
  const Eigen::Index n = family_.n();
  const Stretch& stretch = at_.path[s];
  const double duration = std::abs(stretch.impacts.back().t - stretch.start) + 1e-300;
  const double least_w = machine_.W.colwise().norm().minCoeff();
  const Eigen::VectorXd inputs = family_.inputs(at_.values);
  double length = 0.0;
  for (int i = 0; i < family_.contacts(); ++i) {
    length = std::max(length, std::abs(inputs[family_.clearance_input(i)]) / least_w);
  }
  const double speed = prior_motions * most_speed_ / least_w;
  Eigen::VectorXd prior(2 * n);
  // The free part also offsets the response to the records, which may have drifted.
  Eigen::VectorXd recorded_y = Eigen::VectorXd::Zero(n), recorded_u = recorded_y;
  add_recorded_motion(machine_, inputs, stretch.start, recorded_y, recorded_u);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double k = machine_.modal ? machine_.K(i, 0) : machine_.K(i, i);
    const double period = k > 0.0 ? std::min(1.0 / std::sqrt(k), duration) : duration;
    double constant = 0.0;
    if (k > 0.0) {
      for (Eigen::Index j = 0; j < machine_.constant_forces.cols(); ++j) {
        constant += std::abs(machine_.constant_forces(i, j) * inputs[machine_.driving() + j]) / k;
      }
    }
    prior[i] = speed * period + prior_motions * (length + constant + std::abs(recorded_y[i]));
    prior[n + i] = speed + prior_motions * std::abs(recorded_u[i]);
  }
  return prior;
}

// The scatter of times about the path: as the last step predicts it. Before the first step it
// follows from the violation of the constraints.
void Maximization::set_noise() {
  double squares = 0.0, first = std::numeric_limits<double>::infinity(), last = 0.0;
  int timed = 0;
  std::size_t i = 0;
  for (std::size_t s = 0; s < measured_.size(); ++s) {
    for (std::size_t k = 0; k < measured_[s].size(); ++k, ++i) {
      const Impact& impact = measured_[s].impacts[k];
      if (!impact.timed) continue;
      first = std::min(first, impact.t);
      last = std::max(last, impact.t);
      squares += square(at_.path[s].impacts[k].t - impact.t) + square(constraint_[i]);
      ++timed;
    }
  }
  if (expected_squares_) squares = *expected_squares_;
  const auto starts = 2 * family_.n() * static_cast<Eigen::Index>(measured_.size());
  const double freedom = std::max<double>(1.0, static_cast<double>(timed - unknowns() - starts));
  interval_ = (last - first) / std::max(1, timed);
  noise_ = std::max(std::sqrt(squares / freedom), resolution * interval_);
}

// Trust region for curved valleys. The violation of the constraints grows with the square of the
// step. The radius keeps it near the scatter of the times, or near a small part of a flight.
void Maximization::adapt_radius() {
  constexpr double least = 1e-4, of_flight = 1e-6;
  double squares = 0.0;
  for (const double time : constraint_) squares += square(time);
  const double violation = std::sqrt(squares / static_cast<double>(constraint_.size()));
  const double allowed = std::max(2.0 * noise_, of_flight * interval_);
  const double factor = std::sqrt(allowed / std::max(violation, 1e-3 * allowed));
  radius_ = std::clamp(longest_ * std::clamp(factor, 0.1, 8.0), least, largest_radius);
}

void Maximization::jacobian(std::size_t s, const PathRows& rows, Eigen::MatrixXd& J) const {
  J.resize(rows.A.rows(), unknowns());
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    const Unknown& unknown = family_.unknowns()[static_cast<std::size_t>(k)];
    if (unknown.linear()) {
      J.col(k) = rows.A.rightCols(machine_.inputs()) *
                 family_.inputs_rate(at_.values, static_cast<std::size_t>(k)) *
                 unknown.slope(at_.values[k]);
    } else {
      J.col(k) = nonlinear_columns_[static_cast<std::size_t>(k)][s];
    }
  }
}

// The constraints' values: gaps at the impacts, then gaps and gap velocities at the start.
Eigen::VectorXd Maximization::gaps(const Machine& machine, const Eigen::VectorXd& inputs,
                                   std::size_t s, const Path& path) const {
  const Stretch& stretch = at_.path[s];
  if (stretch.closed == 0) return path.g;
  Eigen::VectorXd z(at_.x0[s].size() + inputs.size());
  Eigen::VectorXd gaps(path.g.size() + static_cast<Eigen::Index>(stretch.of_start()));
  z << at_.x0[s], inputs;
  PathRows start;
  start_rows(machine, stretch, start);
  gaps << path.g, start.A * z, start.Gamma * z;
  return gaps;
}

void Maximization::linearize() {
  machine_ = family_.at(at_.values);
  flights_.set(machine_, at_.path);
  harmonics_.set(machine_.frequencies, at_.path);
  nonlinear_columns_.assign(static_cast<std::size_t>(unknowns()), {});
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    if (!unknown(k).linear()) difference_nonlinear(k);
  }
  follow_paths();
  set_noise();
  if (expected_squares_) adapt_radius();
  blocks_.resize(measured_.size());
  for (std::size_t s = 0; s < measured_.size(); ++s) {
    check_interrupt();
    eliminate(constraints_of(s), blocks_[s]);
    set_residuals(s, blocks_[s]);
  }
  stack();
}

// Sets the column of a nonlinear unknown by central differences.
void Maximization::difference_nonlinear(Eigen::Index k) {
  constexpr double difference = 4e-6;
  std::vector<Eigen::VectorXd>& columns = nonlinear_columns_[static_cast<std::size_t>(k)];
  columns.resize(measured_.size());
  const auto [low, high] = unknown(k).neighbours(unknown(k).coordinate(at_.values[k]), difference);
  Flights flights;
  Harmonics harmonics;
  Path path;
  for (const double side : {1.0, -1.0}) {
    Eigen::VectorXd values = at_.values;
    values[k] = unknown(k).value(side > 0.0 ? high : low);
    const Machine machine = family_.at(values);
    const Eigen::VectorXd inputs = family_.inputs(values);
    flights.set(machine, at_.path);
    harmonics.set(machine.frequencies, at_.path);
    for (std::size_t s = 0; s < measured_.size(); ++s) {
      follow(machine, flights, harmonics, at_.path[s], s, at_.x0[s], inputs, path);
      const Eigen::VectorXd of_side = gaps(machine, inputs, s, path) / (2.0 * difference);
      if (side > 0.0) {
        columns[s] = of_side;
      } else {
        columns[s] -= of_side;
      }
    }
  }
}

// Computes the paths of all stretches from x0, and the violation of the constraints in units of
// time.
void Maximization::follow_paths() {
  const Eigen::VectorXd inputs = family_.inputs(at_.values);
  paths_.resize(measured_.size());
  at_.gamma.resize(measured_.size());
  most_speed_ = 0.0;
  constraint_.clear();
  for (std::size_t s = 0; s < measured_.size(); ++s) {
    follow(machine_, flights_, harmonics_, at_.path[s], s, at_.x0[s], inputs, paths_[s]);
    at_.gamma[s] = paths_[s].gamma;
    const Eigen::VectorXd speeds = paths_[s].gamma.cwiseAbs();
    most_speed_ = std::max(most_speed_, speeds.maxCoeff());
    for (Eigen::Index k = 0; k < speeds.size(); ++k) {
      constraint_.push_back(paths_[s].g[k] / std::max(speeds[k], 0.1 * speeds.mean() + 1e-300));
    }
  }
}

Constraints Maximization::constraints_of(std::size_t s) {
  const Eigen::Index n2 = 2 * family_.n();
  const Eigen::VectorXd inputs = family_.inputs(at_.values);
  const bool scale_is_free = inputs.isZero(0.0);
  Path& path = paths_[s];
  const auto N = static_cast<Eigen::Index>(at_.path[s].size());
  const auto closed = static_cast<Eigen::Index>(at_.path[s].of_start());
  const Eigen::Index R = closed + (scale_is_free ? 1 : 0);
  PathRows rows, start;
  RowMatrix G;
  path_rows(machine_, flights_, harmonics_, at_.path[s], s, rows);
  time_derivatives(machine_, flights_, at_.path[s], s, path, G);
  const double speed = path.gamma.cwiseAbs().mean();
  const double interval =
      (at_.path[s].impacts.back().t - at_.path[s].start) / static_cast<double>(N);
  Eigen::VectorXd weight = Eigen::VectorXd::Zero(N + R);
  weight.head(N) = path.gamma.cwiseAbs()
                       .cwiseMax(1e-6 * speed + std::numeric_limits<double>::min())
                       .cwiseInverse();
  if (closed > 0) {
    start_rows(machine_, at_.path[s], start);
    rows.A.conservativeResize(N + closed, Eigen::NoChange);
    rows.A.bottomRows(closed) << start.A, start.Gamma;
    weight.segment(N, closed / 2).setConstant(1.0 / speed);
    weight.segment(N + closed / 2, closed / 2).setConstant(interval / speed);
  }
  Constraints of;
  jacobian(s, rows, of.J);
  of.violation = gaps(machine_, inputs, s, path);
  of.A = Eigen::MatrixXd::Zero(N + R, n2 + N);
  of.A.topLeftCorner(N + closed, n2) = weight.head(N + closed).asDiagonal() * rows.A.leftCols(n2);
  of.A.topRightCorner(N, N) = weight.head(N).asDiagonal() * G;
  if (scale_is_free) {
    // The scale is unobservable: this constraint keeps the size of the motion.
    of.A.bottomLeftCorner(1, n2) = (interval / speed) * rows.Gamma.leftCols(n2).colwise().mean();
    of.violation.conservativeResize(N + R);
    of.violation[N + R - 1] = 0.0;
    of.J.conservativeResize(N + R, Eigen::NoChange);
    of.J.bottomRows(1).setZero();
  }
  of.violation = weight.cwiseProduct(of.violation).eval();
  of.J = (weight.asDiagonal() * of.J).eval();
  return of;
}

// The minimum-norm (x0, tau) that satisfies the constraints, its derivative by the unknowns, and
// the null space, by an orthogonal factorization of A^T.
void Maximization::eliminate(const Constraints& of, Block& block) const {
  const Eigen::Index n2 = 2 * family_.n();
  const Eigen::Index rows = of.A.rows(), columns = of.A.cols();
  Eigen::MatrixXd A = of.A;
  block.scale =
      A.leftCols(n2).colwise().norm().transpose().cwiseMax(std::numeric_limits<double>::min());
  A.leftCols(n2) = (A.leftCols(n2) * block.scale.cwiseInverse().asDiagonal()).eval();
  const QR qr(A.transpose());
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(columns, 1 + unknowns());
  right.col(0).head(rows) = -of.violation;
  right.block(0, 1, rows, unknowns()) = -of.J;
  right.topRows(rows) = qr.solve_R_transposed(right.topRows(rows));
  right = qr.Q_times(right);
  block.step = right.col(0);
  block.step_rate = right.rightCols(unknowns());
  block.Q2 = Eigen::MatrixXd::Zero(columns, columns - rows);
  block.Q2.bottomRows(columns - rows).setIdentity();
  block.Q2 = qr.Q_times(block.Q2);
}

// The residuals to minimize over the null space and the unknowns: distances from the measured
// times, and the prior of x0.
void Maximization::set_residuals(std::size_t s, Block& block) const {
  const Eigen::Index n2 = 2 * family_.n();
  const auto N = static_cast<Eigen::Index>(at_.path[s].size());
  Eigen::VectorXd time_weight(N), d(N);
  for (Eigen::Index k = 0; k < N; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const Impact& impact = measured_[s].impacts[i];
    time_weight[k] = impact.timed ? 1.0 : untimed_weight;
    d[k] = at_.path[s].impacts[i].t - impact.t;
  }
  const Eigen::VectorXd prior = noise_ * prior_of_x0(s).cwiseInverse();
  const Eigen::VectorXd of_step = prior.cwiseQuotient(block.scale);
  block.B2.resize(N + n2, block.Q2.cols());
  block.B2 << time_weight.asDiagonal() * block.Q2.bottomRows(N),
      of_step.asDiagonal() * block.Q2.topRows(n2);
  block.e0.resize(N + n2);
  block.e0 << time_weight.cwiseProduct(d + block.step.tail(N)),
      prior.cwiseProduct(at_.x0[s]) + of_step.cwiseProduct(block.step.head(n2));
  block.eJ.resize(N + n2, unknowns());
  block.eJ << time_weight.asDiagonal() * block.step_rate.bottomRows(N),
      of_step.asDiagonal() * block.step_rate.topRows(n2);
  block.qr = PivotedQR(block.B2, 1e-12);
}

void Maximization::stack() {
  Eigen::Index rows = unknowns();
  for (const Block& block : blocks_) rows += block.B2.rows() - block.qr.rank();
  M_.resize(rows, unknowns());
  r_.resize(rows);
  Eigen::Index row = 0;
  for (Block& block : blocks_) {
    const Eigen::Index left = block.B2.rows() - block.qr.rank();
    Eigen::MatrixXd rotated(block.B2.rows(), unknowns() + 1);
    rotated << block.eJ, block.e0;
    rotated = block.qr.Q_transposed_times(rotated);
    M_.middleRows(row, left) = rotated.bottomLeftCorner(left, unknowns());
    r_.segment(row, left) = rotated.col(unknowns()).tail(left);
    row += left;
  }
  M_.bottomRows(unknowns()).setZero();
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    const double prior = noise_ / prior_deviation(unknown(k));
    M_(row + k, k) = prior;
    double coordinate = unknown(k).coordinate(at_.values[k]);
    if (unknown(k).kind == Kind::phase) {
      coordinate = std::remainder(coordinate, 2.0 * std::numbers::pi / unknown(k).unit_step);
    }
    r_[row + k] = prior * coordinate;
  }
}

// The change of the unknowns' coordinates that minimizes the residuals. Ranges are active
// constraints: an unknown that would leave its range stays at its end.
Eigen::VectorXd Maximization::change_of_unknowns() {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(unknowns());
  std::vector<bool> fixed(static_cast<std::size_t>(unknowns()), false);
  for (const std::size_t k : held_) fixed[k] = true;
  at_bound_.assign(fixed.size(), false);
  for (bool again = true; again;) {
    again = false;
    std::vector<Eigen::Index> free;
    Eigen::VectorXd right = r_;
    for (Eigen::Index k = 0; k < unknowns(); ++k) {
      if (fixed[static_cast<std::size_t>(k)]) {
        right += change[k] * M_.col(k);
      } else {
        free.push_back(k);
      }
    }
    if (free.empty()) break;
    const Eigen::MatrixXd M = M_(Eigen::all, free);
    const Eigen::VectorXd scale =
        M.colwise().norm().transpose().cwiseMax(std::numeric_limits<double>::min());
    const PivotedQR qr(M * scale.cwiseInverse().asDiagonal(), undetermined_below);
    const Eigen::VectorXd of_free = -qr.solve(right).col(0).cwiseQuotient(scale);
    for (std::size_t j = 0; j < free.size(); ++j) {
      const Eigen::Index k = free[j];
      change[k] = of_free[static_cast<Eigen::Index>(j)];
      if (unknown(k).linear()) continue;
      const double at = unknown(k).coordinate(at_.values[k]);
      const double within = std::clamp(at + change[k], unknown(k).lowest(), unknown(k).highest());
      if (within == at + change[k]) continue;
      change[k] = within - at;
      fixed[static_cast<std::size_t>(k)] = true;
      at_bound_[static_cast<std::size_t>(k)] = true;
      again = true;
    }
  }
  return change;
}

// Moves to the next iterate. Returns the largest move of an event time [s], infinity if the step
// was shortened.
double Maximization::step() {
  const Eigen::Index n2 = 2 * family_.n();
  dp_ = change_of_unknowns();
  decrement_ = r_.squaredNorm() - (r_ + M_ * dp_).squaredNorm();
  longest_ = dp_.size() > 0 ? dp_.cwiseAbs().maxCoeff() : 0.0;
  const bool limited = longest_ > radius_;
  if (limited) dp_ *= radius_ / longest_;
  longest_ = std::min(longest_, radius_);
  std::vector<Eigen::VectorXd> moves(blocks_.size());
  double share = 1.0;
  double expected = 0.0;
  for (std::size_t s = 0; s < blocks_.size(); ++s) {
    const Block& block = blocks_[s];
    const Eigen::VectorXd v = -block.qr.solve(block.e0 + block.eJ * dp_);
    moves[s] = block.step + block.step_rate * dp_ + block.Q2 * v;
    for (std::size_t k = 0; k < measured_[s].size(); ++k) {
      const Impact& impact = measured_[s].impacts[k];
      if (!impact.timed) continue;
      expected +=
          square(at_.path[s].impacts[k].t + moves[s][n2 + static_cast<Eigen::Index>(k)] - impact.t);
    }
    // Impacts keep their order. An impact of unknown time moves along with the previous one,
    // because the path alone determines its time.
    const auto& impacts = at_.path[s].impacts;
    for (std::size_t k = 1; k < impacts.size(); ++k) {
      const auto i = n2 + static_cast<Eigen::Index>(k);
      const double most_closing = 0.9 * (impacts[k].t - impacts[k - 1].t);
      const double closing = moves[s][i - 1] - moves[s][i];
      if (!(closing > 0.0) || !(share * closing > most_closing)) continue;
      if (measured_[s].impacts[k].timed) {
        share = most_closing / closing;
      } else {
        moves[s][i] = moves[s][i - 1] - most_closing / share;
      }
    }
  }
  double largest = 0.0;
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    at_.values[k] = unknown(k).value(unknown(k).coordinate(at_.values[k]) + share * dp_[k]);
  }
  for (std::size_t s = 0; s < blocks_.size(); ++s) {
    at_.x0[s] += share * moves[s].head(n2).cwiseQuotient(blocks_[s].scale);
    for (std::size_t k = 0; k < at_.path[s].impacts.size(); ++k) {
      const double move = share * moves[s][n2 + static_cast<Eigen::Index>(k)];
      at_.path[s].impacts[k].t += move;
      largest = std::max(largest, std::abs(move));
    }
  }
  expected_squares_ = expected;
  return share < 1.0 || limited ? std::numeric_limits<double>::infinity() : largest;
}

void Maximization::finish() {
  const Eigen::Index n2 = 2 * family_.n();
  at_.squares = 0.0;
  at_.timed = 0;
  for (std::size_t s = 0; s < measured_.size(); ++s) {
    for (std::size_t k = 0; k < measured_[s].size(); ++k) {
      const Impact& impact = measured_[s].impacts[k];
      if (!impact.timed) continue;
      at_.squares += square(at_.path[s].impacts[k].t - impact.t);
      ++at_.timed;
    }
  }
  // A value that is held or at a bound counts as known.
  const Eigen::Index P = unknowns();
  at_.covariance = Eigen::MatrixXd::Zero(P, P);
  std::vector<Eigen::Index> free;
  for (Eigen::Index k = 0; k < P; ++k) {
    const auto number = static_cast<std::size_t>(k);
    const bool held = std::find(held_.begin(), held_.end(), number) != held_.end();
    if (!held && !at_bound_[number]) free.push_back(k);
  }
  free_ = free;
  if (!free.empty()) {
    const Eigen::MatrixXd M = M_(Eigen::all, free);
    const Eigen::VectorXd scale = M.colwise().norm().transpose();
    const auto [values, V] = singular_values(M * scale.cwiseInverse().asDiagonal());
    const Eigen::MatrixXd root =
        scale.cwiseInverse().asDiagonal() * V * values.cwiseInverse().asDiagonal();
    at_.covariance(free, free) = product(root, root.transpose());
  }
  at_.at_bound = at_bound_;
  at_.x0_covariance.clear();
  for (const Block& block : blocks_) {
    const Eigen::Index rank = block.qr.rank();
    const Eigen::MatrixXd own = product(
        block.Q2.topRows(n2), block.qr.solve_rotated(Eigen::MatrixXd::Identity(rank, rank)));
    const Eigen::MatrixXd by_unknowns =
        block.step_rate.topRows(n2) - product(block.Q2.topRows(n2), block.qr.solve(block.eJ));
    const Eigen::MatrixXd covariance =
        product(own, own.transpose()) + congruent(by_unknowns.transpose(), at_.covariance);
    const Eigen::VectorXd unit = block.scale.cwiseInverse();
    at_.x0_covariance.emplace_back(unit.asDiagonal() * covariance * unit.asDiagonal());
  }
  set_leverages();
  at_.violation = 0.0;
  for (const double time : constraint_) at_.violation = std::max(at_.violation, std::abs(time));
  at_.largest_start = 0.0;
  for (std::size_t s = 0; s < measured_.size(); ++s) {
    const Eigen::VectorXd of_prior = at_.x0[s].cwiseQuotient(prior_of_x0(s));
    at_.largest_start = std::max(at_.largest_start, prior_motions * of_prior.cwiseAbs().maxCoeff());
  }
  // The sum of leverages is the number of parameters that the times determine.
  double taken_up = 0.0;
  for (std::size_t s = 0; s < measured_.size(); ++s) {
    for (std::size_t k = 0; k < measured_[s].size(); ++k) {
      if (measured_[s].impacts[k].timed) taken_up += at_.leverage[s][static_cast<Eigen::Index>(k)];
    }
  }
  at_.freedom = at_.timed - static_cast<int>(std::lround(taken_up));
}

// Leverages: the diagonal of the projection onto the range of x0 and the unknowns in the times.
void Maximization::set_leverages() {
  Eigen::MatrixXd of_unknowns(M_.rows(), 0);
  if (!free_.empty()) {
    const Eigen::MatrixXd M = M_(Eigen::all, free_);
    const Eigen::VectorXd scale = M.colwise().norm().transpose();
    const PivotedQR qr(M * scale.cwiseInverse().asDiagonal(), undetermined_below);
    of_unknowns = qr.Q_times(Eigen::MatrixXd::Identity(M_.rows(), qr.rank()));
  }
  const Eigen::Index rank = of_unknowns.cols();
  at_.leverage.clear();
  Eigen::Index row = 0;
  for (const Block& block : blocks_) {
    const Eigen::Index N = block.B2.rows(), own = block.qr.rank();
    Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(N, own + rank);
    basis.topLeftCorner(own, own).setIdentity();
    basis.bottomRightCorner(N - own, rank) = of_unknowns.middleRows(row, N - own);
    at_.leverage.emplace_back(
        block.qr.Q_times(basis).rowwise().squaredNorm().head(N - 2 * family_.n()));
    row += N - own;
  }
}

Likelihood Maximization::run() {
  constexpr int most_steps = 40;
  double duration = 0.0;
  for (const Stretch& stretch : measured_) {
    duration = std::max(duration, std::abs(stretch.impacts.back().t));
  }
  const double rounding = 1e-14 * duration;
  double last = std::numeric_limits<double>::infinity();
  double least_noise = last;
  int stalled = 0;
  for (int i = 0; i < most_steps; ++i) {
    linearize();
    // Gives up: far from an optimum, and the steps make no progress.
    constexpr double far = 100.0, progress = 0.8;
    constexpr int most_stalled = 6;
    stalled = noise_ < progress * least_noise ? 0 : stalled + 1;
    least_noise = std::min(least_noise, noise_);
    if (stalled > most_stalled && decrement_ > far * square(noise_)) break;
    const double moved = step();
    if (!std::isfinite(moved) && !at_.values.allFinite()) return at_;
    double rms = 0.0;
    for (std::size_t s = 0; s < measured_.size(); ++s) {
      for (std::size_t k = 0; k < measured_[s].size(); ++k) {
        if (!measured_[s].impacts[k].timed) continue;
        rms = std::max(rms, std::abs(at_.path[s].impacts[k].t - measured_[s].impacts[k].t));
      }
    }
    // Converged: the steps are below rounding or a small share of the jitter, or the likelihood no
    // longer changes, although undetermined directions may still move.
    constexpr double negligible = 1e-4;
    double violation = 0.0;
    for (const double time : constraint_) violation = std::max(violation, std::abs(time));
    const bool is_optimum =
        i > 2 && decrement_ < negligible * square(noise_) && violation < 1e-2 * noise_ + rounding;
    if (is_optimum || moved < 1e-5 * rms + rounding ||
        (moved < 1e-2 * rms + 10.0 * rounding && moved > last)) {
      at_.converged = true;
      break;
    }
    // Linear convergence: the sum of the remaining steps, as a geometric series, is negligible.
    const double to_come = moved < last ? moved * moved / (last - moved) : moved;
    if (i + 1 == most_steps && to_come < 1e-2 * rms) at_.converged = true;
    last = moved;
  }
  linearize();
  change_of_unknowns();
  finish();
  constexpr double satisfied = 1e-2;
  if (!(at_.violation < satisfied * noise_ + rounding)) at_.converged = false;
  return at_;
}

Likelihood Maximization::as_it_is() {
  linearize();
  at_bound_.assign(static_cast<std::size_t>(unknowns()), false);
  finish();
  return at_;
}

}  // namespace

double Likelihood::scatter() const { return freedom > 0 ? std::sqrt(squares / freedom) : 0.0; }

Likelihood along_measured_times(const MachineFamily& family, const Stretches& stretches,
                                const PathFit& fit) {
  Likelihood at;
  at.values = fit.values;
  at.x0 = fit.x0;
  at.path = stretches;
  // The scale at which an amplitude that is not sought has its value.
  double scale = 1.0;
  const std::vector<Unknown>& unknowns = family.unknowns();
  const auto is_sought = [&](Kind kind, int index) {
    return std::any_of(unknowns.begin(), unknowns.end(), [&](const Unknown& unknown) {
      return unknown.kind == kind && unknown.index == index;
    });
  };
  const Projection projection(family);
  if (projection.homogeneous()) {
    for (std::size_t g = 0; g < family.groups().size(); ++g) {
      const int group = static_cast<int>(g);
      const double size = fit.inputs.segment(family.harmonic_input(group), 2).norm();
      if (is_sought(Kind::amplitude, group) || is_sought(Kind::amplitude, -1) || !(size > 0.0)) {
        continue;
      }
      scale = std::abs(family.groups()[g].amplitude) / size;
      break;
    }
  }
  const Eigen::VectorXd inputs = scale * fit.inputs;
  const Eigen::VectorXd nominal_inputs = family.inputs(family.nominal());
  for (Eigen::VectorXd& x0 : at.x0) x0 *= scale;
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    const Unknown& unknown = unknowns[k];
    const auto i = static_cast<Eigen::Index>(k);
    switch (unknown.kind) {
      case Kind::clearance:
        at.values[i] = inputs[family.clearance_input(unknown.index)];
        break;
      case Kind::gain:
        at.values[i] = inputs[family.gain_input(unknown.index)];
        break;
      case Kind::constant:
        at.values[i] = unknown.nominal * inputs[family.constant_input(unknown.index)];
        break;
      case Kind::phase:
      case Kind::amplitude: {
        // Components of one group of harmonics, or of all, along the nominal ones and a quarter
        // turned.
        double along = 0.0, across = 0.0, square_of_nominal = 0.0;
        for (int g = 0; g < static_cast<int>(family.groups().size()); ++g) {
          if (unknown.index >= 0 && unknown.index != g) continue;
          const Eigen::Index a = family.harmonic_input(g);
          const double c = nominal_inputs[a], d = nominal_inputs[a + 1];
          along += c * inputs[a] + d * inputs[a + 1];
          across += c * inputs[a + 1] - d * inputs[a];
          square_of_nominal += c * c + d * d;
        }
        at.values[i] = unknown.kind == Kind::phase
                           ? unknown.nominal + std::atan2(across, along)
                           : unknown.nominal * std::hypot(along, across) / square_of_nominal;
        break;
      }
      default:
        break;
    }
  }
  return at;
}

Likelihood maximize_likelihood(const MachineFamily& family, const Stretches& stretches,
                               Likelihood start, std::span<const std::size_t> held) {
  return Maximization(family, stretches, std::move(start), held).run();
}

Likelihood linearized_at(const MachineFamily& family, const Stretches& stretches, Likelihood at) {
  return Maximization(family, stretches, std::move(at), {}).as_it_is();
}

}  // namespace sprag
