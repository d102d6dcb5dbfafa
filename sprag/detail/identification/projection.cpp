#include "sprag/detail/identification/projection.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "sprag/detail/mechanics/interrupt.h"
#include "sprag/detail/mechanics/linear_algebra.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

constexpr double rank_threshold = 1e-13;
// An input is undetermined if the start absorbs all of its effect but this share, in which rounding
// is still negligible.
constexpr double least_input_share = 1e-4, least_of_inputs = 1e-8;
// Limits of an impact's weight, relative to the usual one. Without the upper limit rms tends to 0
// with epsilon.
constexpr double least_weight = 0.33, largest_weight = 6.0;
// Weight of the gap and the gap velocity at a release. Its time matters to second order only.
constexpr double weight_of_start = 100.0;

}  // namespace

class Projection::Core {
 public:
  explicit Core(const MachineFamily& of);

  void take(Stretches stretches);
  PathFit at(const Eigen::VectorXd& values);
  PathFit refine(const PathFit& from, int most_steps);

  const MachineFamily& family;
  std::vector<std::size_t> nonlinear;
  Eigen::VectorXd known;  // inputs that are not free
  Eigen::MatrixXd E;      // inputs = known + E zeta
  Eigen::VectorXd nominal_zeta;
  bool homogeneous = false;

 private:
  struct Factors {
    PivotedQR qr;
    Eigen::VectorXd scale;             // of the columns of x0
    Eigen::MatrixXd top;               // Q^T (inputs, known): rows in the range of x0
    Eigen::Index first = 0, rows = 0;  // other rows, their place among those of all stretches
  };

  void solve(const Eigen::VectorXd& values, PathFit& fit);
  Eigen::MatrixXd eliminate_start(std::size_t s, const Eigen::MatrixXd& E_now,
                                  const Eigen::VectorXd& known_now,
                                  Eigen::RowVectorXd& input_squares);
  Eigen::VectorXd solve_inputs(const Eigen::MatrixXd& stacked,
                               const Eigen::RowVectorXd& input_squares);
  void set_path(const Eigen::VectorXd& zeta, PathFit& fit);
  Eigen::MatrixXd jacobian(const PathFit& at);
  Eigen::Index rows_of(std::size_t s) const;
  Eigen::MatrixXd turned(Eigen::MatrixXd inputs, const Eigen::VectorXd& from,
                         const Eigen::VectorXd& to) const;
  RowMatrix weighted_start(const Machine& machine, std::size_t s) const;
  void weigh_equally();
  void weigh();
  double objective() const { return residual_.squaredNorm(); }

  Stretches stretches_;
  Eigen::Index impacts_ = 0;
  std::vector<Eigen::VectorXd> weights_;
  bool turns_ = false;          // an offset of the clock is an unknown; it rotates E and known
  double normalization_ = 0.0;  // weight of "mean gamma- is -1"
  double interval_ = 0.0;       // usual time between impacts

  Machine machine_;
  Flights flights_, other_flights_;
  Harmonics harmonics_, other_harmonics_;
  std::vector<PathRows> all_rows_;  // of each stretch, at the values of solve()
  PathRows rows_;
  Path path_;
  std::vector<Eigen::VectorXd> gamma_;
  std::vector<Factors> factors_;
  PivotedQR inputs_qr_;
  Eigen::VectorXd residual_;  // residual in the complement of the range of z
};

Projection::Core::Core(const MachineFamily& of) : family(of) {
  const std::vector<Unknown>& unknowns = family.unknowns();
  const Eigen::VectorXd nominal = family.nominal();
  const Eigen::VectorXd inputs = family.inputs(nominal);
  std::vector<Eigen::VectorXd> columns;
  known = inputs;
  const auto free = [&](Eigen::Index i) {
    columns.emplace_back(Eigen::VectorXd::Unit(inputs.size(), i));
    known[i] = 0.0;
  };
  const auto has = [&](Kind kind, int index) {
    return std::any_of(unknowns.begin(), unknowns.end(), [&](const Unknown& unknown) {
      return unknown.kind == kind && unknown.index == index;
    });
  };
  for (std::size_t k = 0; k < unknowns.size(); ++k) {
    const Unknown& unknown = unknowns[k];
    if (!unknown.linear()) nonlinear.push_back(k);
    if (unknown.kind == Kind::clearance) free(family.clearance_input(unknown.index));
    if (unknown.kind == Kind::constant) free(family.constant_input(unknown.index));
    if (unknown.kind == Kind::gain) free(family.gain_input(unknown.index));
    // A change of phase or amplitude stays in the plane of the harmonic and itself a quarter
    // turned.
    const bool turns = unknown.kind == Kind::phase;
    if (!turns && (unknown.kind != Kind::amplitude || has(Kind::phase, unknown.index))) continue;
    Eigen::VectorXd along = Eigen::VectorXd::Zero(inputs.size()), across = along;
    for (int g = 0; g < static_cast<int>(family.groups().size()); ++g) {
      if (unknown.index >= 0 && unknown.index != g) continue;
      const Eigen::Index a = family.harmonic_input(g);
      along.segment(a, 2) = inputs.segment(a, 2);
      across[a] = -inputs[a + 1];
      across[a + 1] = inputs[a];
      known.segment(a, 2).setZero();
    }
    columns.push_back(along);
    if (turns) columns.push_back(across);
  }
  turns_ = has(Kind::clock_offset, -1);
  E.resize(inputs.size(), static_cast<Eigen::Index>(columns.size()));
  for (std::size_t j = 0; j < columns.size(); ++j) {
    E.col(static_cast<Eigen::Index>(j)) = columns[j];
  }
  homogeneous = known.isZero(0.0);
  nominal_zeta.resize(E.cols());
  for (Eigen::Index j = 0; j < E.cols(); ++j) {
    nominal_zeta[j] = E.col(j).dot(inputs - known) / E.col(j).squaredNorm();
  }
}

// Converts columns of inputs from the clock offset in `from` to that in `to`.
Eigen::MatrixXd Projection::Core::turned(Eigen::MatrixXd inputs, const Eigen::VectorXd& from,
                                         const Eigen::VectorXd& to) const {
  if (!turns_) return inputs;
  const auto offset = [&](const Eigen::VectorXd& values, Eigen::VectorXd& frequencies) {
    frequencies.resize(static_cast<Eigen::Index>(family.groups().size()));
    family.frequencies(values, frequencies);
    frequencies *= family.clock_shift(values);
  };
  Eigen::VectorXd before, end;
  offset(from, before);
  offset(to, end);
  for (Eigen::Index g = 0; g < before.size(); ++g) {
    const double angle = before[g] - end[g];
    const Eigen::RowVectorXd a = inputs.row(2 * g), b = inputs.row(2 * g + 1);
    inputs.row(2 * g) = std::cos(angle) * a - std::sin(angle) * b;
    inputs.row(2 * g + 1) = std::sin(angle) * a + std::cos(angle) * b;
  }
  return inputs;
}

void Projection::Core::take(Stretches stretches) {
  stretches_ = std::move(stretches);
  impacts_ = static_cast<Eigen::Index>(count(stretches_));
  interval_ = usual_interval(stretches_);
  gamma_.resize(stretches_.size());
  factors_.resize(stretches_.size());
  weigh_equally();
}

void Projection::Core::weigh_equally() {
  weights_.clear();
  for (const Stretch& stretch : stretches_) {
    weights_.emplace_back(Eigen::VectorXd::Ones(static_cast<Eigen::Index>(stretch.size())));
  }
  normalization_ = homogeneous ? std::sqrt(static_cast<double>(impacts_)) : 0.0;
}

void Projection::Core::weigh() {
  double mean = 0.0;
  for (const Eigen::VectorXd& gamma : gamma_) mean += gamma.cwiseAbs().sum();
  mean /= static_cast<double>(impacts_);
  for (std::size_t s = 0; s < gamma_.size(); ++s) {
    for (Eigen::Index k = 0; k < gamma_[s].size(); ++k) {
      const double least = mean / largest_weight;
      weights_[s][k] = std::max(1.0 / std::max(std::abs(gamma_[s][k]), least), least_weight / mean);
    }
  }
}

// Rows of a stretch: its impacts, the contacts closed at its start, and for the first stretch the
// scale.
Eigen::Index Projection::Core::rows_of(std::size_t s) const {
  return static_cast<Eigen::Index>(stretches_[s].equations()) + (homogeneous && s == 0 ? 1 : 0);
}

RowMatrix Projection::Core::weighted_start(const Machine& machine, std::size_t s) const {
  PathRows rows;
  start_rows(machine, stretches_[s], rows);
  RowMatrix weighted(2 * rows.A.rows(), rows.A.cols());
  weighted << rows.A, interval_ * rows.Gamma;
  return (weight_of_start * weights_[s].mean()) * weighted;
}

void Projection::Core::solve(const Eigen::VectorXd& values, PathFit& fit) {
  machine_ = family.at(values);
  flights_.set(machine_, stretches_);
  harmonics_.set(machine_.frequencies, stretches_);
  fit.values = values;
  fit.x0.resize(stretches_.size());
  const Eigen::MatrixXd E_now = turned(E, family.nominal(), values);
  const Eigen::VectorXd known_now = turned(known, family.nominal(), values);
  all_rows_.resize(stretches_.size());
  std::vector<Eigen::MatrixXd> lower(stretches_.size());
  Eigen::Index rows = 0;
  Eigen::RowVectorXd input_squares = Eigen::RowVectorXd::Zero(E.cols());
  for (std::size_t s = 0; s < stretches_.size(); ++s) {
    lower[s] = eliminate_start(s, E_now, known_now, input_squares);
    factors_[s].first = rows;
    factors_[s].rows = lower[s].rows();
    rows += lower[s].rows();
  }
  Eigen::MatrixXd stacked(rows, E.cols() + 1);
  for (std::size_t s = 0; s < stretches_.size(); ++s) {
    stacked.middleRows(factors_[s].first, factors_[s].rows) = lower[s];
  }
  const Eigen::VectorXd zeta = solve_inputs(stacked, input_squares);
  fit.inputs = known_now + E_now * zeta;
  set_path(zeta, fit);
}

// Eliminates x0 from the rows of one stretch by a QR factorization. Returns the rows on (zeta,
// known inputs) that are orthogonal to x0's range. Adds the squares of the columns of zeta.
Eigen::MatrixXd Projection::Core::eliminate_start(std::size_t s, const Eigen::MatrixXd& E_now,
                                                  const Eigen::VectorXd& known_now,
                                                  Eigen::RowVectorXd& input_squares) {
  const Eigen::Index n2 = 2 * family.n(), zetas = E.cols();
  PathRows& of = all_rows_[s];
  path_rows(machine_, flights_, harmonics_, stretches_[s], s, of);
  const Eigen::Index N = of.A.rows();
  Eigen::MatrixXd X(rows_of(s), n2);
  Eigen::MatrixXd I(X.rows(), zetas + 1);
  X.topRows(N) = weights_[s].asDiagonal() * of.A.leftCols(n2);
  I.topLeftCorner(N, zetas) = weights_[s].asDiagonal() * product(of.A.rightCols(E.rows()), E_now);
  I.col(zetas).head(N) = weights_[s].cwiseProduct(of.A.rightCols(E.rows()) * known_now);
  if (homogeneous && s == 0) {
    const Eigen::RowVectorXd mean = normalization_ * of.Gamma.colwise().mean();
    X.row(N) = mean.head(n2);
    I.row(N).head(zetas) = mean.tail(E.rows()) * E_now;
    I(N, zetas) = normalization_;
  }
  if (stretches_[s].closed != 0) {
    const RowMatrix start = weighted_start(machine_, s);
    const Eigen::Index R = start.rows();
    X.bottomRows(R) = start.leftCols(n2);
    I.bottomLeftCorner(R, zetas) = product(start.rightCols(E.rows()), E_now);
    I.col(zetas).tail(R) = start.rightCols(E.rows()) * known_now;
  }
  input_squares += I.leftCols(zetas).colwise().squaredNorm();
  Factors& factors = factors_[s];
  factors.scale = X.colwise().norm().transpose().cwiseMax(std::numeric_limits<double>::min());
  X = (X * factors.scale.cwiseInverse().asDiagonal()).eval();
  factors.qr = PivotedQR(X, rank_threshold);
  I = factors.qr.Q_transposed_times(I);
  const Eigen::Index rank = factors.qr.rank();
  factors.top = I.topRows(rank);
  return I.bottomRows(I.rows() - rank);
}

// The coordinates zeta of the free inputs that minimize the rows without x0. Sets residual_.
Eigen::VectorXd Projection::Core::solve_inputs(const Eigen::MatrixXd& stacked,
                                               const Eigen::RowVectorXd& input_squares) {
  const Eigen::Index zetas = E.cols();
  residual_ = stacked.col(zetas);
  if (zetas == 0) return {};
  const Eigen::VectorXd scale = stacked.leftCols(zetas)
                                    .colwise()
                                    .norm()
                                    .cwiseMax(least_input_share * input_squares.cwiseSqrt())
                                    .transpose()
                                    .cwiseMax(std::numeric_limits<double>::min());
  Eigen::MatrixXd scaled = stacked.leftCols(zetas) * scale.cwiseInverse().asDiagonal();
  for (Eigen::Index j = 0; j < zetas; ++j) {
    if (scaled.col(j).norm() < least_of_inputs) scaled.col(j).setZero();
  }
  inputs_qr_ = PivotedQR(scaled, least_of_inputs);
  // An input that the events do not determine keeps its nominal value.
  Eigen::VectorXd right = residual_;
  if (!homogeneous) right += stacked.leftCols(zetas) * nominal_zeta;
  right = inputs_qr_.Q_transposed_times(right);
  residual_ = right.tail(stacked.rows() - inputs_qr_.rank());
  Eigen::VectorXd zeta = -inputs_qr_.solve_rotated(right).col(0).cwiseQuotient(scale);
  if (!homogeneous) zeta += nominal_zeta;
  return zeta;
}

// Sets the starts and the quality of the path with these inputs.
void Projection::Core::set_path(const Eigen::VectorXd& zeta, PathFit& fit) {
  Eigen::VectorXd with_known(zeta.size() + 1);
  with_known << zeta, 1.0;
  double squares = 0.0, speed = 0.0;
  Eigen::Index inside = 0;
  for (std::size_t s = 0; s < stretches_.size(); ++s) {
    const Factors& factors = factors_[s];
    fit.x0[s] = factors.qr.solve_rotated(-factors.top * with_known).cwiseQuotient(factors.scale);
    Eigen::VectorXd z(fit.x0[s].size() + E.rows());
    z << fit.x0[s], fit.inputs;
    gamma_[s] = all_rows_[s].Gamma * z;
    inside += (gamma_[s].array() > 0.0).count();
    speed += gamma_[s].cwiseAbs().sum();
    squares += (weights_[s].cwiseProduct(all_rows_[s].A * z)).squaredNorm();
  }
  // With equal weights the residuals are lengths; divide by the mean speed.
  const bool equal = weights_[0].size() > 0 && weights_[0][0] == 1.0;
  const double unit = equal && !homogeneous ? speed / static_cast<double>(impacts_) : 1.0;
  fit.rms = std::sqrt(squares / static_cast<double>(impacts_)) / unit;
  fit.inside = static_cast<double>(inside) / static_cast<double>(impacts_);
  if (!std::isfinite(fit.rms)) fit.rms = std::numeric_limits<double>::infinity();
}

PathFit Projection::Core::at(const Eigen::VectorXd& values) {
  weigh_equally();
  PathFit fit;
  solve(values, fit);
  return fit;
}

// Kaufman's Jacobian: derivative of the residual by theta for fixed z, in the complement of the
// range of z.
Eigen::MatrixXd Projection::Core::jacobian(const PathFit& at) {
  constexpr double step = 4e-6;
  const auto unknowns = static_cast<Eigen::Index>(nonlinear.size());
  const Eigen::Index rows = factors_.back().first + factors_.back().rows;
  Eigen::MatrixXd J(rows, unknowns);
  for (Eigen::Index k = 0; k < unknowns; ++k) {
    const std::size_t number = nonlinear[static_cast<std::size_t>(k)];
    const Unknown& unknown = family.unknowns()[number];
    const double value = at.values[static_cast<Eigen::Index>(number)];
    const auto [low, high] = unknown.neighbours(unknown.coordinate(value), step);
    std::vector<Eigen::VectorXd> change(stretches_.size());
    for (const double side : {1.0, -1.0}) {
      Eigen::VectorXd values = at.values;
      values[static_cast<Eigen::Index>(number)] = unknown.value(side > 0.0 ? high : low);
      const Machine machine = family.at(values);
      const Eigen::VectorXd inputs = turned(at.inputs, at.values, values);
      other_flights_.set(machine, stretches_);
      other_harmonics_.set(machine.frequencies, stretches_);
      for (std::size_t s = 0; s < stretches_.size(); ++s) {
        follow(machine, other_flights_, other_harmonics_, stretches_[s], s, at.x0[s], inputs,
               path_);
        const bool normalized = homogeneous && s == 0;
        const Eigen::Index N = path_.g.size();
        if (side > 0.0) change[s].setZero(rows_of(s));
        change[s].head(N) += side / (2.0 * step) * weights_[s].cwiseProduct(path_.g);
        if (normalized) change[s][N] += side / (2.0 * step) * normalization_ * path_.gamma.mean();
        if (stretches_[s].closed != 0) {
          Eigen::VectorXd z(at.x0[s].size() + inputs.size());
          z << at.x0[s], inputs;
          const Eigen::VectorXd start = weighted_start(machine, s) * z;
          change[s].tail(start.size()) += side / (2.0 * step) * start;
        }
      }
    }
    for (std::size_t s = 0; s < stretches_.size(); ++s) {
      J.col(k).segment(factors_[s].first, factors_[s].rows) =
          factors_[s].qr.Q_transposed_times(change[s]).col(0).tail(factors_[s].rows);
    }
  }
  if (E.cols() == 0) return J;
  return inputs_qr_.Q_transposed_times(J).bottomRows(rows - inputs_qr_.rank());
}

PathFit Projection::Core::refine(const PathFit& from, int most_steps) {
  constexpr double longest_step = 0.1;
  const std::vector<Unknown>& unknowns = family.unknowns();
  const auto p = static_cast<Eigen::Index>(nonlinear.size());
  PathFit best;
  weigh_equally();
  solve(from.values, best);
  weigh();
  solve(from.values, best);
  double lambda = 1e-3;
  for (int step = 0; step < most_steps && p > 0; ++step) {
    check_interrupt();
    const Eigen::MatrixXd J = jacobian(best);
    const Eigen::VectorXd gradient = J.transpose() * residual_;
    const Eigen::MatrixXd normal = product(J.transpose(), J);
    const double before = objective();
    if (!std::isfinite(before)) break;
    bool better = false;
    double moved = 0.0;
    while (!better && lambda < 1e9) {
      Eigen::MatrixXd damped = normal;
      damped.diagonal() *= 1.0 + lambda;
      // Regularization: undetermined directions do not move.
      damped.diagonal().array() += (1e-12 + 1e-6 * lambda) * normal.diagonal().maxCoeff() +
                                   std::numeric_limits<double>::min();
      Eigen::VectorXd change =
          -solve_definite(damped.cast<Extended>(), gradient.cast<Extended>()).cast<double>();
      const double largest = change.cwiseAbs().maxCoeff();
      if (largest > longest_step) change *= longest_step / largest;
      Eigen::VectorXd values = best.values;
      for (Eigen::Index k = 0; k < p; ++k) {
        const std::size_t number = nonlinear[static_cast<std::size_t>(k)];
        const Unknown& unknown = unknowns[number];
        double& value = values[static_cast<Eigen::Index>(number)];
        value = unknown.value(
            std::clamp(unknown.coordinate(value) + change[k], unknown.lowest(), unknown.highest()));
      }
      moved = change.cwiseAbs().maxCoeff();
      PathFit next;
      solve(values, next);
      if (objective() < before) {
        better = true;
        best = std::move(next);
        lambda = std::max(lambda / 9.0, 1e-12);
      } else {
        lambda *= 4.0;
        if (moved < 1e-15) break;
      }
    }
    if (!better) {
      solve(best.values, best);
      break;
    }
    const bool slow = objective() > (1.0 - 1e-6) * before;
    weigh();
    solve(best.values, best);
    if (moved < 1e-14 || (slow && moved < 1e-9)) break;
  }
  return best;
}

Projection::Projection(const MachineFamily& family) : core_(std::make_unique<Core>(family)) {}
Projection::~Projection() = default;
const std::vector<std::size_t>& Projection::nonlinear() const { return core_->nonlinear; }
Eigen::Index Projection::free_inputs() const { return core_->E.cols(); }
bool Projection::homogeneous() const { return core_->homogeneous; }
void Projection::take(Stretches stretches) { core_->take(std::move(stretches)); }
PathFit Projection::at(const Eigen::VectorXd& values) { return core_->at(values); }
PathFit Projection::refine(const PathFit& from, int most_steps) {
  return core_->refine(from, most_steps);
}

}  // namespace sprag
