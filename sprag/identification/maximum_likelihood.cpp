#include "sprag/identification/maximum_likelihood.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sprag/mechanics/interrupt.h"
#include "sprag/mechanics/linear_algebra.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

constexpr double untimed_weight = 1e-3;  // square root of 1e-6
constexpr double undetermined_below = 1e-8;
// An unknown of whose effect the starts take up all but this share is scaled by the effect itself,
// so that one of which they take up all but rounding is found to be undetermined.
constexpr double least_effect_share = 1e-4;

// The constraints of one stretch, solved for what is its own: x0 and tau. Contacts that were closed
// at its start are R = 2 of them each, beside those of N impacts.
struct Block {
  Eigen::VectorXd scale;      // of x0's columns
  Eigen::MatrixXd Q2;         // null space, (2n + N) x (2n - R)
  Eigen::VectorXd step;       // least (x0, tau) that satisfies them
  Eigen::MatrixXd step_rate;  // for each unknown, (2n + N) x P
  Eigen::MatrixXd B2;         // what Q2 does to weighted times, N x (2n - R)
  PivotedQR qr;               // of B2
  Eigen::VectorXd e0;         // weighted times for no change of the unknowns
  Eigen::MatrixXd eJ;         // and what they change
};

class Maximization {
 public:
  Maximization(const MachineFamily& family, const Stretches& measured, Likelihood start)
      : family_(family), measured_(measured), at_(std::move(start)) {}

  Likelihood run();

 private:
  void linearize();
  void jacobian(std::size_t s, const PathRows& rows, Eigen::MatrixXd& J) const;
  Eigen::VectorXd gaps(const Machine& machine, const Eigen::VectorXd& inputs, std::size_t s,
                       const Path& path) const;
  double step();
  void finish();
  void set_leverages();

  Eigen::Index unknowns() const { return static_cast<Eigen::Index>(family_.unknowns().size()); }

  const MachineFamily& family_;
  const Stretches& measured_;
  Likelihood at_;
  Machine machine_;
  Flights flights_;
  Harmonics harmonics_;
  std::vector<Path> paths_;
  std::vector<std::vector<Eigen::VectorXd>> nonlinear_columns_;  // of each unknown, by stretch
  std::vector<Block> blocks_;
  Eigen::MatrixXd M_;  // weighted times by unknown, beyond what each stretch takes up itself
  Eigen::VectorXd r_;
  Eigen::VectorXd M_scale_;
  Eigen::VectorXd dp_;
};

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

// What is to be zero: gaps at the impacts, then gaps and gap velocities at the start.
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
  constexpr double difference = 4e-6;
  const Eigen::Index n2 = 2 * family_.n();
  const std::size_t S = measured_.size();
  machine_ = family_.at(at_.values);
  const Eigen::VectorXd inputs = family_.inputs(at_.values);
  flights_.set(machine_, at_.path);
  harmonics_.set(machine_.frequencies, at_.path);
  paths_.resize(S);
  blocks_.resize(S);
  at_.gamma.resize(S);
  nonlinear_columns_.assign(static_cast<std::size_t>(unknowns()), {});
  Flights flights;
  Harmonics harmonics;
  Path path;
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    const Unknown& unknown = family_.unknowns()[static_cast<std::size_t>(k)];
    if (unknown.linear()) continue;
    std::vector<Eigen::VectorXd>& columns = nonlinear_columns_[static_cast<std::size_t>(k)];
    columns.resize(S);
    for (const double side : {1.0, -1.0}) {
      Eigen::VectorXd values = at_.values;
      values[k] = unknown.value(unknown.coordinate(values[k]) + side * difference);
      const Machine machine = family_.at(values);
      const Eigen::VectorXd of_values = family_.inputs(values);
      flights.set(machine, at_.path);
      harmonics.set(machine.frequencies, at_.path);
      for (std::size_t s = 0; s < S; ++s) {
        follow(machine, flights, harmonics, at_.path[s], s, at_.x0[s], of_values, path);
        const Eigen::VectorXd of_side = gaps(machine, of_values, s, path) / (2.0 * difference);
        if (side > 0.0) {
          columns[s] = of_side;
        } else {
          columns[s] -= of_side;
        }
      }
    }
  }
  Eigen::Index rows_in_all = 0;
  Eigen::VectorXd effects = Eigen::VectorXd::Zero(unknowns());
  PathRows rows, start;
  RowMatrix G;
  for (std::size_t s = 0; s < S; ++s) {
    Block& block = blocks_[s];
    Path& of = paths_[s];
    const auto N = static_cast<Eigen::Index>(at_.path[s].size());
    const auto R = static_cast<Eigen::Index>(at_.path[s].of_start());
    check_interrupt();
    follow(machine_, flights_, harmonics_, at_.path[s], s, at_.x0[s], inputs, of);
    at_.gamma[s] = of.gamma;
    path_rows(machine_, flights_, harmonics_, at_.path[s], s, rows);
    time_derivatives(machine_, flights_, at_.path[s], s, of, G);
    const double speed = of.gamma.cwiseAbs().mean();
    Eigen::VectorXd weight(N + R);
    weight.head(N) = of.gamma.cwiseAbs()
                         .cwiseMax(1e-6 * speed + std::numeric_limits<double>::min())
                         .cwiseInverse();
    if (R > 0) {
      start_rows(machine_, at_.path[s], start);
      rows.A.conservativeResize(N + R, Eigen::NoChange);
      rows.A.bottomRows(R) << start.A, start.Gamma;
      const double interval =
          (at_.path[s].impacts.back().t - at_.path[s].start) / static_cast<double>(N);
      weight.segment(N, R / 2).setConstant(1.0 / speed);
      weight.tail(R / 2).setConstant(interval / speed);
    }
    Eigen::MatrixXd J;
    jacobian(s, rows, J);
    Eigen::MatrixXd constraints = Eigen::MatrixXd::Zero(N + R, n2 + N);
    constraints.leftCols(n2) = weight.asDiagonal() * rows.A.leftCols(n2);
    constraints.topRightCorner(N, N) = weight.head(N).asDiagonal() * G;
    block.scale = constraints.leftCols(n2).colwise().norm().transpose().cwiseMax(
        std::numeric_limits<double>::min());
    constraints.leftCols(n2) =
        (constraints.leftCols(n2) * block.scale.cwiseInverse().asDiagonal()).eval();
    const QR qr(constraints.transpose());
    Eigen::MatrixXd right(n2 + N, 1 + unknowns());
    right.setZero();
    right.col(0).head(N + R) = -weight.cwiseProduct(gaps(machine_, inputs, s, of));
    right.block(0, 1, N + R, unknowns()) = -(weight.asDiagonal() * J);
    effects += right.rightCols(unknowns()).colwise().squaredNorm().transpose();
    right.topRows(N + R) = qr.solve_R_transposed(right.topRows(N + R));
    right = qr.Q_times(right);
    block.step = right.col(0);
    block.step_rate = right.rightCols(unknowns());
    block.Q2 = Eigen::MatrixXd::Zero(n2 + N, n2 - R);
    block.Q2.bottomRows(n2 - R).setIdentity();
    block.Q2 = qr.Q_times(block.Q2);
    Eigen::VectorXd time_weight(N), d(N);
    for (Eigen::Index k = 0; k < N; ++k) {
      const auto i = static_cast<std::size_t>(k);
      const Impact& impact = measured_[s].impacts[i];
      time_weight[k] = impact.timed ? 1.0 : untimed_weight;
      d[k] = at_.path[s].impacts[i].t - impact.t;
    }
    block.B2 = time_weight.asDiagonal() * block.Q2.bottomRows(N);
    block.e0 = time_weight.cwiseProduct(d + block.step.tail(N));
    block.eJ = time_weight.asDiagonal() * block.step_rate.bottomRows(N);
    block.qr = PivotedQR(block.B2, 1e-12);
    rows_in_all += N - block.qr.rank();
  }
  M_.resize(rows_in_all, unknowns());
  r_.resize(rows_in_all);
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
  M_scale_ = M_.colwise()
                 .norm()
                 .transpose()
                 .cwiseMax(least_effect_share * effects.cwiseSqrt())
                 .cwiseMax(std::numeric_limits<double>::min());
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    if (M_.col(k).norm() < undetermined_below * M_scale_[k]) M_.col(k).setZero();
  }
}

// Moves to the next iterate; how far the times and unknowns moved, in units of what they may.
double Maximization::step() {
  const Eigen::Index n2 = 2 * family_.n();
  dp_ = Eigen::VectorXd::Zero(unknowns());
  if (unknowns() > 0) {
    const PivotedQR qr(M_ * M_scale_.cwiseInverse().asDiagonal(), undetermined_below);
    dp_ = -qr.solve(r_).col(0).cwiseQuotient(M_scale_);
  }
  double longest = dp_.size() > 0 ? dp_.cwiseAbs().maxCoeff() : 0.0;
  std::vector<Eigen::VectorXd> moves(blocks_.size());
  double share = 1.0;
  constexpr double most = 1.0;  // of a coordinate in one step
  if (longest > most) share = most / longest;
  for (std::size_t s = 0; s < blocks_.size(); ++s) {
    const Block& block = blocks_[s];
    const Eigen::VectorXd v = -block.qr.solve(block.e0 + block.eJ * dp_);
    moves[s] = block.step + block.step_rate * dp_ + block.Q2 * v;
    // Impacts keep their order. One of unknown time goes along with the one before it: where the
    // gap is zero its time is told by the path alone.
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
    const Unknown& unknown = family_.unknowns()[static_cast<std::size_t>(k)];
    double coordinate = unknown.coordinate(at_.values[k]) + share * dp_[k];
    if (unknown.upper_limit > 0.0) {
      coordinate = std::min(coordinate, unknown.coordinate(unknown.upper_limit));
    }
    at_.values[k] = unknown.value(coordinate);
  }
  for (std::size_t s = 0; s < blocks_.size(); ++s) {
    at_.x0[s] += share * moves[s].head(n2).cwiseQuotient(blocks_[s].scale);
    for (std::size_t k = 0; k < at_.path[s].impacts.size(); ++k) {
      const double move = share * moves[s][n2 + static_cast<Eigen::Index>(k)];
      at_.path[s].impacts[k].t += move;
      largest = std::max(largest, std::abs(move));
    }
  }
  return share < 1.0 ? std::numeric_limits<double>::infinity() : largest;
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
  const Eigen::Index P = unknowns();
  at_.covariance = Eigen::MatrixXd::Zero(P, P);
  at_.undetermined.resize(P, 0);
  Eigen::Index determined = 0;
  if (P > 0) {
    const auto [values, V] = singular_values(M_ * M_scale_.cwiseInverse().asDiagonal());
    const Eigen::MatrixXd directions = M_scale_.cwiseInverse().asDiagonal() * V;
    for (Eigen::Index k = 0; k < P; ++k) {
      if (k < values.size() && values[k] > undetermined_below * std::max(values[0], 1e-3)) {
        at_.covariance += directions.col(k) * directions.col(k).transpose() / square(values[k]);
        ++determined;
      } else {
        at_.undetermined.conservativeResize(P, at_.undetermined.cols() + 1);
        at_.undetermined.rightCols(1) = directions.col(k).normalized();
      }
    }
  }
  at_.x0_covariance.clear();
  Eigen::Index states = 0;
  for (const Block& block : blocks_) {
    const Eigen::Index rank = block.qr.rank();
    states += rank;
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
  at_.freedom = at_.timed - static_cast<int>(states + determined);
}

// The diagonal of the projection onto what x0 and the unknowns do to the times.
void Maximization::set_leverages() {
  Eigen::MatrixXd of_unknowns(M_.rows(), 0);
  if (unknowns() > 0) {
    const PivotedQR qr(M_ * M_scale_.cwiseInverse().asDiagonal(), undetermined_below);
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
    at_.leverage.emplace_back(block.qr.Q_times(basis).rowwise().squaredNorm());
    row += N - own;
  }
}

Likelihood Maximization::run() {
  constexpr int most_steps = 20;
  double duration = 0.0;
  for (const Stretch& stretch : measured_) {
    duration = std::max(duration, std::abs(stretch.impacts.back().t));
  }
  const double rounding = 1e-14 * duration;
  double last = std::numeric_limits<double>::infinity();
  for (int i = 0; i < most_steps; ++i) {
    linearize();
    const double moved = step();
    if (!std::isfinite(moved) && !at_.values.allFinite()) return at_;
    double rms = 0.0;
    for (std::size_t s = 0; s < measured_.size(); ++s) {
      for (std::size_t k = 0; k < measured_[s].size(); ++k) {
        if (!measured_[s].impacts[k].timed) continue;
        rms = std::max(rms, std::abs(at_.path[s].impacts[k].t - measured_[s].impacts[k].t));
      }
    }
    // As near as rounding allows, or as the jitter makes it worth.
    if (moved < 1e-5 * rms + rounding || (moved < 1e-2 * rms + 10.0 * rounding && moved > last)) {
      at_.converged = true;
      break;
    }
    // Steps that shrink slowly, each by the same factor: what is still to come is of no account.
    const double to_come = moved < last ? moved * moved / (last - moved) : moved;
    if (i + 1 == most_steps && to_come < 1e-2 * rms) at_.converged = true;
    last = moved;
  }
  linearize();
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
  // The scale at which an amplitude that is held is what it is.
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
      case Kind::constant:
        at.values[i] = unknown.nominal * inputs[family.constant_input(unknown.index)];
        break;
      case Kind::phase:
      case Kind::amplitude: {
        // Of one group of harmonics, or of all, along what they are and a quarter turned.
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
                               Likelihood start) {
  return Maximization(family, stretches, std::move(start)).run();
}

}  // namespace sprag
