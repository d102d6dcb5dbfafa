#include "sprag/identification/linear_path.h"

#include <algorithm>
#include <complex>

#include "sprag/identification/coupled_step.h"

namespace sprag {
namespace {

std::vector<std::vector<double>> intervals_of(const Stretches& stretches) {
  std::vector<std::vector<double>> intervals(stretches.size());
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    double t = stretches[s].start;
    intervals[s].reserve(stretches[s].size());
    for (const Impact& impact : stretches[s].impacts) {
      intervals[s].push_back(impact.t - t);
      t = impact.t;
    }
  }
  return intervals;
}

std::vector<std::vector<double>> times_of(const Stretches& stretches) {
  std::vector<std::vector<double>> times(stretches.size());
  for (std::size_t s = 0; s < stretches.size(); ++s) {
    times[s].reserve(stretches[s].size());
    for (const Impact& impact : stretches[s].impacts) times[s].push_back(impact.t);
  }
  return times;
}

bool same(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return a.rows() == b.rows() && a.cols() == b.cols() && a == b;
}

}  // namespace

void Flights::set(const Machine& machine, const Stretches& stretches) {
  std::vector<std::vector<double>> intervals = intervals_of(stretches);
  if (machine.modal == modal_ && same(machine.C, C_) && same(machine.K, K_) &&
      intervals == intervals_) {
    return;
  }
  modal_ = machine.modal;
  n_ = machine.n();
  C_ = machine.C;
  K_ = machine.K;
  constant_forces_ = machine.constant_forces;
  intervals_ = std::move(intervals);
  first_.clear();
  modes_.clear();
  transitions_.clear();
  std::size_t flights = 0;
  for (const std::vector<double>& of : intervals_) {
    first_.push_back(flights);
    flights += of.size();
  }
  if (modal_) {
    modes_.reserve(flights * static_cast<std::size_t>(n_));
    for (const std::vector<double>& of : intervals_) {
      for (const double tau : of) {
        for (Eigen::Index i = 0; i < n_; ++i) {
          modes_.push_back(oscillator_step(0.5 * C_(i, 0), K_(i, 0), tau));
        }
      }
    }
    return;
  }
  transitions_.reserve(flights);
  for (const std::vector<double>& of : intervals_) {
    for (const double tau : of) {
      transitions_.push_back(coupled_step(C_, K_, constant_forces_, tau));
    }
  }
}

void Flights::move(std::size_t s, std::size_t k, RowMatrix& Y, RowMatrix& U, Eigen::Index columns,
                   Eigen::Index forced) const {
  const std::size_t flight = first_[s] + k;
  const Eigen::Index J = constant_forces_.cols();
  if (modal_) {
    const OscillatorStep* const of = modes_.data() + flight * static_cast<std::size_t>(n_);
    for (Eigen::Index i = 0; i < n_; ++i) {
      const OscillatorStep& mode = of[i];
      double* const y = &Y(i, 0);
      double* const u = &U(i, 0);
      for (Eigen::Index j = 0; j < columns; ++j) {
        const double before = y[j];
        y[j] = mode.zz * before + mode.zv * u[j];
        u[j] = mode.vz * before + mode.vv * u[j];
      }
      for (Eigen::Index j = 0; j < J && forced + j < columns; ++j) {
        y[forced + j] += mode.z_alpha * constant_forces_(i, j);
        u[forced + j] += mode.zv * constant_forces_(i, j);
      }
    }
    return;
  }
  const Eigen::MatrixXd& Phi = transitions_[flight];
  X_.resize(2 * n_, columns);
  X_.topRows(n_) = Y.leftCols(columns);
  X_.bottomRows(n_) = U.leftCols(columns);
  moved_columns_.noalias() = Phi.leftCols(2 * n_).lazyProduct(X_);
  for (Eigen::Index j = 0; j < J && forced + j < columns; ++j) {
    moved_columns_.col(forced + j) += Phi.col(2 * n_ + j);
  }
  Y.leftCols(columns) = moved_columns_.topRows(n_);
  U.leftCols(columns) = moved_columns_.bottomRows(n_);
}

void Flights::move(std::size_t s, std::size_t k, Eigen::VectorXd& y, Eigen::VectorXd& u,
                   const Eigen::VectorXd& constants) const {
  const std::size_t flight = first_[s] + k;
  const Eigen::Index J = constant_forces_.cols();
  if (modal_) {
    const OscillatorStep* const of = modes_.data() + flight * static_cast<std::size_t>(n_);
    for (Eigen::Index i = 0; i < n_; ++i) {
      of[i].apply(J > 0 ? constant_forces_.row(i).dot(constants) : 0.0, y[i], u[i]);
    }
    return;
  }
  const Eigen::MatrixXd& Phi = transitions_[flight];
  x_.resize(2 * n_ + J);
  x_ << y, u, constants;
  moved_.noalias() = Phi.lazyProduct(x_);
  y = moved_.head(n_);
  u = moved_.tail(n_);
}

void Harmonics::set(const Eigen::VectorXd& frequencies, const Stretches& stretches) {
  std::vector<std::vector<double>> times = times_of(stretches);
  if (frequencies_.size() == frequencies.size() && frequencies_ == frequencies && times == times_) {
    return;
  }
  frequencies_ = frequencies;
  times_ = std::move(times);
  values.resize(times_.size());
  for (std::size_t s = 0; s < times_.size(); ++s) {
    values[s].resize(frequencies.size(), static_cast<Eigen::Index>(times_[s].size()));
    for (std::size_t k = 0; k < times_[s].size(); ++k) {
      for (Eigen::Index g = 0; g < frequencies.size(); ++g) {
        values[s](g, static_cast<Eigen::Index>(k)) = std::polar(1.0, frequencies[g] * times_[s][k]);
      }
    }
  }
}

void path_rows(const Machine& machine, const Flights& flights, const Harmonics& harmonics,
               const Stretch& stretch, std::size_t s, PathRows& rows) {
  const Eigen::Index n = machine.n(), G = machine.groups(), J = machine.constant_forces.cols();
  // A clearance moves nothing: its columns stay zero and are left out until the gap.
  const Eigen::Index moving = 2 * n + 2 * G + J;
  const Eigen::Index columns = 2 * n + machine.inputs();
  const auto N = static_cast<Eigen::Index>(stretch.size());
  rows.A.resize(N, columns);
  rows.Gamma.resize(N, columns);
  RowMatrix Y = RowMatrix::Zero(n, moving), U = RowMatrix::Zero(n, moving);
  Y.leftCols(n).setIdentity();
  U.middleCols(n, n).setIdentity();
  for (Eigen::Index k = 0; k < N; ++k) {
    const int contact = stretch.impacts[static_cast<std::size_t>(k)].contact;
    flights.move(s, static_cast<std::size_t>(k), Y, U, moving, 2 * n + 2 * G);
    double* const a = &rows.A(k, 0);
    double* const gamma = &rows.Gamma(k, 0);
    std::fill(a, a + columns, 0.0);
    std::fill(gamma, gamma + columns, 0.0);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double w = machine.W(i, contact);
      const double* const y = &Y(i, 0);
      const double* const u = &U(i, 0);
      for (Eigen::Index j = 0; j < moving; ++j) {
        a[j] += w * y[j];
        gamma[j] += w * u[j];
      }
    }
    for (Eigen::Index g = 0; g < G; ++g) {
      const std::complex<double> steady =
          machine.gap_response(contact, g) * harmonics.values[s](g, k);
      const double Omega = machine.frequencies[g];
      a[2 * n + 2 * g] += steady.real();
      a[2 * n + 2 * g + 1] -= steady.imag();
      gamma[2 * n + 2 * g] -= Omega * steady.imag();
      gamma[2 * n + 2 * g + 1] -= Omega * steady.real();
    }
    a[2 * n + 2 * G + J + contact] = 1.0;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double jump = machine.jump(i, contact);
      double* const u = &U(i, 0);
      for (Eigen::Index j = 0; j < moving; ++j) u[j] -= jump * gamma[j];
    }
  }
}

void release_rows(const Machine& machine, const Stretch& stretch, PathRows& rows) {
  const Eigen::Index n = machine.n(), G = machine.groups(), J = machine.constant_forces.cols();
  const auto w = machine.W.col(stretch.released).transpose();
  rows.A.setZero(1, 2 * n + machine.inputs());
  rows.Gamma = rows.A;
  rows.A.row(0).head(n) = w;
  rows.Gamma.row(0).segment(n, n) = w;
  for (Eigen::Index g = 0; g < G; ++g) {
    const double Omega = machine.frequencies[g];
    const std::complex<double> steady =
        machine.gap_response(stretch.released, g) * std::polar(1.0, Omega * stretch.start);
    rows.A(0, 2 * n + 2 * g) = steady.real();
    rows.A(0, 2 * n + 2 * g + 1) = -steady.imag();
    rows.Gamma(0, 2 * n + 2 * g) = -Omega * steady.imag();
    rows.Gamma(0, 2 * n + 2 * g + 1) = -Omega * steady.real();
  }
  rows.A(0, 2 * n + 2 * G + J + stretch.released) = 1.0;
}

void follow(const Machine& machine, const Flights& flights, const Harmonics& harmonics,
            const Stretch& stretch, std::size_t s, const Eigen::VectorXd& x0,
            const Eigen::VectorXd& inputs, Path& path) {
  const Eigen::Index n = machine.n(), G = machine.groups(), J = machine.constant_forces.cols();
  const auto N = static_cast<Eigen::Index>(stretch.size());
  path.g.resize(N);
  path.gamma.resize(N);
  path.gamma_rate.resize(N);
  path.y = x0.head(n);
  path.u = x0.tail(n);
  const Eigen::VectorXd constants = inputs.segment(2 * G, J);
  Eigen::VectorXd force_rate = Eigen::VectorXd::Zero(machine.W.cols());
  if (J > 0) force_rate = machine.W.transpose() * (machine.constant_forces * constants);
  for (Eigen::Index k = 0; k < N; ++k) {
    const int contact = stretch.impacts[static_cast<std::size_t>(k)].contact;
    flights.move(s, static_cast<std::size_t>(k), path.y, path.u, constants);
    const auto w = machine.W.col(contact);
    double g = w.dot(path.y) + inputs[2 * G + J + contact];
    double gamma = w.dot(path.u);
    double rate = force_rate[contact];
    if (machine.modal) {
      for (Eigen::Index i = 0; i < n; ++i) {
        rate -= w[i] * (machine.C(i, 0) * path.u[i] + machine.K(i, 0) * path.y[i]);
      }
    } else {
      rate -= w.dot(machine.C * path.u + machine.K * path.y);
    }
    for (Eigen::Index j = 0; j < G; ++j) {
      const std::complex<double> steady = machine.gap_response(contact, j) *
                                          harmonics.values[s](j, k) *
                                          std::complex<double>(inputs[2 * j], inputs[2 * j + 1]);
      const double Omega = machine.frequencies[j];
      g += steady.real();
      gamma -= Omega * steady.imag();
      rate -= Omega * Omega * steady.real();
    }
    path.g[k] = g;
    path.gamma[k] = gamma;
    path.gamma_rate[k] = rate;
    path.u -= machine.jump.col(contact) * gamma;
  }
}

void time_derivatives(const Machine& machine, const Flights& flights, const Stretch& stretch,
                      std::size_t s, const Path& path, RowMatrix& G, RowMatrix* end) {
  const Eigen::Index n = machine.n();
  const auto N = static_cast<Eigen::Index>(stretch.size());
  G.setZero(N, N);
  RowMatrix Y = RowMatrix::Zero(n, N), U = RowMatrix::Zero(n, N);
  Eigen::VectorXd gamma(N);
  for (Eigen::Index k = 0; k < N; ++k) {
    const int contact = stretch.impacts[static_cast<std::size_t>(k)].contact;
    const auto w = machine.W.col(contact);
    const Eigen::VectorXd jump = machine.jump.col(contact);
    if (k > 0) {
      flights.move(s, static_cast<std::size_t>(k), Y, U, k, k);
      G.row(k).head(k).noalias() = w.transpose().lazyProduct(Y.leftCols(k));
      gamma.head(k).noalias() = U.leftCols(k).transpose().lazyProduct(w);
      U.leftCols(k).noalias() -= jump.lazyProduct(gamma.head(k).transpose());
    }
    G(k, k) = path.gamma[k];
    // What the impact does comes later, and with another velocity.
    Y.col(k) = jump * path.gamma[k];
    if (machine.modal) {
      U.col(k) = -jump * path.gamma_rate[k] - machine.C.col(0).cwiseProduct(Y.col(k));
    } else {
      U.col(k) = -jump * path.gamma_rate[k] - machine.C * Y.col(k);
    }
  }
  if (end == nullptr) return;
  end->resize(2 * n, N);
  *end << Y, U;
}

}  // namespace sprag
