#include "sprag/detail/identification/linear_path.h"

#include <algorithm>
#include <bit>
#include <complex>

#include "sprag/detail/identification/coupled_step.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

using Complex = std::complex<double>;

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

bool same(const Machine& a, const Machine& b) {
  return a.modal == b.modal && same(a.C, b.C) && same(a.K, b.K) && same(a.W, b.W) &&
         same(a.jump, b.jump) && same(a.frequencies, b.frequencies) &&
         same(a.constant_forces, b.constant_forces) &&
         a.gap_response.size() == b.gap_response.size() && a.gap_response == b.gap_response &&
         a.recorded == b.recorded && same(a.delays, b.delays);
}

// Whether the flight to impact k has passages or held contacts.
bool is_eventful(const Stretch& stretch, std::size_t k) {
  const ContactSet held = k > 0 ? stretch.impacts[k - 1].staying : stretch.held;
  return held != 0 || !stretch.impacts[k].passed.empty();
}

bool is_eventful(const Stretch& stretch) {
  for (std::size_t k = 0; k < stretch.size(); ++k) {
    if (is_eventful(stretch, k)) return true;
  }
  return false;
}

bool holds_any(const Stretch& stretch) {
  return std::any_of(stretch.impacts.begin(), stretch.impacts.end(),
                     [](const Impact& impact) { return (impact.held | impact.staying) != 0; });
}

// e^(i Omega t) of the harmonics.
Eigen::VectorXcd phases(const Machine& machine, double t) {
  Eigen::VectorXcd of(machine.groups());
  for (Eigen::Index g = 0; g < of.size(); ++g) of[g] = std::polar(1.0, machine.frequencies[g] * t);
  return of;
}

// d/dt of z e^(i Omega t).
Complex rate(Complex z, double Omega) { return {-Omega * z.imag(), Omega * z.real()}; }

// Adds Re z (a + i b) as a row on the inputs a and b of a group.
void add_real_part(Complex z, double* inputs) {
  inputs[0] += z.real();
  inputs[1] -= z.imag();
}

}  // namespace

void Flights::set(const Machine& machine, const Stretches& stretches) {
  std::vector<std::vector<double>> intervals = intervals_of(stretches);
  const bool as_before = machine.modal == modal_ && same(machine.C, C_) && same(machine.K, K_) &&
                         same(machine.constant_forces, constant_forces_) && intervals == intervals_;
  if (!as_before) {
    intervals_ = std::move(intervals);
    set_free(machine);
  }
  driving_ = machine.driving();
  set_composed(machine, stretches);
}

void Flights::set_free(const Machine& machine) {
  modal_ = machine.modal;
  n_ = machine.n();
  C_ = machine.C;
  K_ = machine.K;
  constant_forces_ = machine.constant_forces;
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

void Flights::set_composed(const Machine& machine, const Stretches& stretches) {
  const bool any = std::any_of(stretches.begin(), stretches.end(), [](const Stretch& stretch) {
    return is_eventful(stretch) || holds_any(stretch);
  });
  if (!any) {
    number_.clear();
    stretches_.clear();
    return;
  }
  const bool same_machine = !stretches_.empty() && same(machine, machine_);
  if (same_machine && stretches == stretches_) return;
  if (!same_machine) {
    machine_ = machine;
    held_.clear();
  }
  stretches_ = stretches;
  number_.clear();
  composed_.clear();
  for (const Stretch& stretch : stretches) {
    if (holds_any(stretch)) {
      for (const Impact& impact : stretch.impacts) {
        if (impact.held != 0) held_flight(impact.held);
        if (impact.staying != 0) held_flight(impact.staying);
      }
    }
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      number_.push_back(is_eventful(stretch, k) ? composed_.size() : none);
      if (number_.back() != none) compose(stretch, k);
    }
  }
}

const HeldFlight& Flights::held_flight(ContactSet held) {
  return held_.try_emplace(held, machine_, held).first->second;
}

void Flights::compose(const Stretch& stretch, std::size_t k) {
  const Eigen::Index J = constant_forces_.cols(), inputs = 2 * n_;
  const Eigen::Index columns = 2 * n_ + driving_ + J, G = machine_.groups();
  Eigen::MatrixXd Y = Eigen::MatrixXd::Zero(n_, columns), U = Y;
  Y.leftCols(n_).setIdentity();
  U.middleCols(n_, n_).setIdentity();
  Eigen::MatrixXd factors = Eigen::MatrixXd::Zero(driving_ + J, columns);
  factors.rightCols(driving_ + J).setIdentity();
  const auto constants = factors.bottomRows(J);
  for_each_leg(stretch, k, [&](double from, double to, ContactSet held, const Passage* passage) {
    if (held != 0) {
      held_flight(held).move(from, to - from, factors, Y, U);
    } else if (modal_) {
      const Eigen::MatrixXd alpha = product(constant_forces_, constants);
      for (Eigen::Index i = 0; i < n_; ++i) {
        const OscillatorStep step = oscillator_step(0.5 * C_(i, 0), K_(i, 0), to - from);
        for (Eigen::Index j = 0; j < columns; ++j) step.apply(alpha(i, j), Y(i, j), U(i, j));
      }
    } else {
      Eigen::MatrixXd X(2 * n_ + J, columns);
      X << Y, U, constants;
      const Eigen::MatrixXd moved = product(coupled_step(C_, K_, constant_forces_, to - from), X);
      Y = moved.topRows(n_);
      U = moved.bottomRows(n_);
    }
    if (passage == nullptr || passage->contact < 0) return;
    const int contact = passage->contact;
    Eigen::RowVectorXd gamma = machine_.W.col(contact).transpose() * U;
    const Eigen::VectorXcd phase = phases(machine_, to);
    for (Eigen::Index g = 0; g < G; ++g) {
      const Complex steady = machine_.gap_response(contact, g) * phase[g];
      add_real_part(rate(steady, machine_.frequencies[g]), &gamma[inputs + 2 * g]);
    }
    for (Eigen::Index r = 0; r < machine_.records(); ++r) {
      gamma[inputs + 2 * G + r] += recorded_gap(machine_, contact, r, to).rate;
    }
    U -= jump_of(machine_, contact, passage->staying) * gamma;
  });
  composed_.emplace_back(2 * n_, columns);
  composed_.back() << Y, U;
}

void Flights::move(std::size_t s, std::size_t k, RowMatrix& Y, RowMatrix& U, Eigen::Index columns,
                   Eigen::Index inputs) const {
  const std::size_t flight = first_[s] + k;
  const Eigen::Index J = constant_forces_.cols();
  const bool composed = !number_.empty() && number_[flight] != none;
  const Eigen::Index forced = inputs + driving_;
  if (modal_ && !composed) {
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
  const Eigen::MatrixXd& Phi = composed ? composed_[number_[flight]] : transitions_[flight];
  X_.resize(2 * n_, columns);
  X_.topRows(n_) = Y.leftCols(columns);
  X_.bottomRows(n_) = U.leftCols(columns);
  moved_columns_.noalias() = Phi.leftCols(2 * n_).lazyProduct(X_);
  const Eigen::Index first = composed ? inputs : forced;
  for (Eigen::Index j = 0; 2 * n_ + j < Phi.cols() && first + j < columns; ++j) {
    moved_columns_.col(first + j) += Phi.col(2 * n_ + j);
  }
  Y.leftCols(columns) = moved_columns_.topRows(n_);
  U.leftCols(columns) = moved_columns_.bottomRows(n_);
}

void Flights::move(std::size_t s, std::size_t k, Eigen::VectorXd& y, Eigen::VectorXd& u,
                   const Eigen::VectorXd& inputs) const {
  const std::size_t flight = first_[s] + k;
  const Eigen::Index J = constant_forces_.cols();
  const bool composed = !number_.empty() && number_[flight] != none;
  if (modal_ && !composed) {
    const auto constants = inputs.segment(driving_, J);
    const OscillatorStep* const of = modes_.data() + flight * static_cast<std::size_t>(n_);
    for (Eigen::Index i = 0; i < n_; ++i) {
      of[i].apply(J > 0 ? constant_forces_.row(i).dot(constants) : 0.0, y[i], u[i]);
    }
    return;
  }
  const Eigen::MatrixXd& Phi = composed ? composed_[number_[flight]] : transitions_[flight];
  const Eigen::Index of_inputs = Phi.cols() - 2 * n_;
  x_.resize(Phi.cols());
  x_ << y, u, inputs.segment(composed ? 0 : driving_, of_inputs);
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
  // Clearances do not affect the motion, so their columns enter at the gap only.
  const Eigen::Index driving = machine.driving(), moving = 2 * n + driving + J;
  const Eigen::Index columns = 2 * n + machine.inputs();
  const auto N = static_cast<Eigen::Index>(stretch.size());
  rows.A.resize(N, columns);
  rows.Gamma.resize(N, columns);
  Eigen::VectorXd of_contact;
  RowMatrix Y = RowMatrix::Zero(n, moving), U = RowMatrix::Zero(n, moving);
  Y.leftCols(n).setIdentity();
  U.middleCols(n, n).setIdentity();
  for (Eigen::Index k = 0; k < N; ++k) {
    const int contact = stretch.impacts[static_cast<std::size_t>(k)].contact;
    flights.move(s, static_cast<std::size_t>(k), Y, U, moving, 2 * n);
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
      const Complex steady = machine.gap_response(contact, g) * harmonics.values[s](g, k);
      add_real_part(steady, a + 2 * n + 2 * g);
      add_real_part(rate(steady, machine.frequencies[g]), gamma + 2 * n + 2 * g);
    }
    const double t = stretch.impacts[static_cast<std::size_t>(k)].t;
    for (Eigen::Index r = 0; r < machine.records(); ++r) {
      const GapMotion recorded = recorded_gap(machine, contact, r, t);
      a[2 * n + 2 * G + r] += recorded.g;
      gamma[2 * n + 2 * G + r] += recorded.rate;
    }
    a[2 * n + driving + J + contact] = 1.0;
    const ContactSet staying = stretch.impacts[static_cast<std::size_t>(k)].staying;
    if (staying != 0) of_contact = jump_of(machine, contact, staying);
    const double* const jump = staying != 0 ? of_contact.data() : &machine.jump(0, contact);
    for (Eigen::Index i = 0; i < n; ++i) {
      double* const u = &U(i, 0);
      for (Eigen::Index j = 0; j < moving; ++j) u[j] -= jump[i] * gamma[j];
    }
  }
}

void start_rows(const Machine& machine, const Stretch& stretch, PathRows& rows) {
  const Eigen::Index n = machine.n(), G = machine.groups(), J = machine.constant_forces.cols();
  rows.A.setZero(std::popcount(stretch.closed), 2 * n + machine.inputs());
  rows.Gamma = rows.A;
  const Eigen::VectorXcd phase = phases(machine, stretch.start);
  Eigen::Index row = 0;
  for_each(stretch.closed, [&](int contact) {
    const auto w = machine.W.col(contact).transpose();
    rows.A.row(row).head(n) = w;
    rows.Gamma.row(row).segment(n, n) = w;
    for (Eigen::Index g = 0; g < G; ++g) {
      const Complex steady = machine.gap_response(contact, g) * phase[g];
      add_real_part(steady, &rows.A(row, 2 * n + 2 * g));
      add_real_part(rate(steady, machine.frequencies[g]), &rows.Gamma(row, 2 * n + 2 * g));
    }
    for (Eigen::Index r = 0; r < machine.records(); ++r) {
      const GapMotion recorded = recorded_gap(machine, contact, r, stretch.start);
      rows.A(row, 2 * n + 2 * G + r) = recorded.g;
      rows.Gamma(row, 2 * n + 2 * G + r) = recorded.rate;
    }
    rows.A(row, 2 * n + machine.driving() + J + contact) = 1.0;
    ++row;
  });
}

Eigen::VectorXd Flights::force(const Machine& machine, ContactSet held, double t,
                               const Eigen::VectorXd& y, const Eigen::VectorXd& u,
                               const Eigen::VectorXd& inputs) const {
  Eigen::VectorXd moved =
      -(machine.modal
            ? Eigen::VectorXd(machine.C.col(0).cwiseProduct(u) + machine.K.col(0).cwiseProduct(y))
            : Eigen::VectorXd(machine.C * u + machine.K * y));
  const Eigen::Index G = machine.groups(), J = machine.constant_forces.cols();
  if (J > 0) moved += machine.constant_forces * inputs.segment(machine.driving(), J);
  Eigen::VectorXd rates = machine.W.transpose() * moved;
  const Eigen::VectorXcd phase = phases(machine, t);
  for (Eigen::Index g = 0; g < G; ++g) {
    const Complex z = Complex(inputs[2 * g], inputs[2 * g + 1]);
    rates -= square(machine.frequencies[g]) * (machine.gap_response.col(g) * (z * phase[g])).real();
  }
  return held_.at(held).force(rates);
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
  Eigen::VectorXd force_rate = Eigen::VectorXd::Zero(machine.W.cols());
  if (J > 0) {
    force_rate =
        machine.W.transpose() * (machine.constant_forces * inputs.segment(machine.driving(), J));
  }
  path.force_drop.setZero(n, holds_any(stretch) ? N : 0);
  for (Eigen::Index k = 0; k < N; ++k) {
    const Impact& impact = stretch.impacts[static_cast<std::size_t>(k)];
    const int contact = impact.contact;
    flights.move(s, static_cast<std::size_t>(k), path.y, path.u, inputs);
    const auto w = machine.W.col(contact);
    double g = w.dot(path.y) + inputs[machine.driving() + J + contact];
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
      const Complex steady = machine.gap_response(contact, j) * harmonics.values[s](j, k) *
                             Complex(inputs[2 * j], inputs[2 * j + 1]);
      const double Omega = machine.frequencies[j];
      g += steady.real();
      gamma -= Omega * steady.imag();
      rate -= Omega * Omega * steady.real();
    }
    for (Eigen::Index r = 0; r < machine.records(); ++r) {
      const GapMotion recorded = recorded_gap(machine, contact, r, impact.t);
      const double gain = inputs[2 * G + r];
      g += gain * recorded.g;
      gamma += gain * recorded.rate;
      rate += gain * recorded.acceleration;
    }
    if (impact.held != 0) {
      const Eigen::VectorXd force =
          flights.force(machine, impact.held, impact.t, path.y, path.u, inputs);
      path.force_drop.col(k) += force;
      rate += w.dot(force);
    }
    path.g[k] = g;
    path.gamma[k] = gamma;
    path.gamma_rate[k] = rate;
    if (impact.staying == 0) {
      path.u -= machine.jump.col(contact) * gamma;
    } else {
      path.u -= jump_of(machine, contact, impact.staying) * gamma;
      path.force_drop.col(k) -=
          flights.force(machine, impact.staying, impact.t, path.y, path.u, inputs);
    }
  }
}

void effect_of_time(const Machine& machine, const Stretch& stretch, std::size_t k, const Path& path,
                    Eigen::VectorXd& on_y, Eigen::VectorXd& on_u) {
  const Impact& impact = stretch.impacts[k];
  const auto i = static_cast<Eigen::Index>(k);
  const Eigen::VectorXd jump = jump_of(machine, impact.contact, impact.staying);
  on_y = jump * path.gamma[i];
  on_u = -jump * path.gamma_rate[i];
  if (machine.modal) {
    on_u -= machine.C.col(0).cwiseProduct(on_y);
  } else {
    on_u -= machine.C * on_y;
  }
  if (path.force_drop.cols() > 0) on_u += path.force_drop.col(i);
}

void time_derivatives(const Machine& machine, const Flights& flights, const Stretch& stretch,
                      std::size_t s, const Path& path, RowMatrix& G, RowMatrix* end) {
  const Eigen::Index n = machine.n();
  const auto N = static_cast<Eigen::Index>(stretch.size());
  G.setZero(N, N);
  RowMatrix Y = RowMatrix::Zero(n, N), U = RowMatrix::Zero(n, N);
  Eigen::VectorXd gamma(N), on_y, on_u;
  for (Eigen::Index k = 0; k < N; ++k) {
    const Impact& impact = stretch.impacts[static_cast<std::size_t>(k)];
    const auto w = machine.W.col(impact.contact);
    if (k > 0) {
      const Eigen::VectorXd jump = jump_of(machine, impact.contact, impact.staying);
      flights.move(s, static_cast<std::size_t>(k), Y, U, k, k);
      G.row(k).head(k).noalias() = w.transpose().lazyProduct(Y.leftCols(k));
      gamma.head(k).noalias() = U.leftCols(k).transpose().lazyProduct(w);
      U.leftCols(k).noalias() -= jump.lazyProduct(gamma.head(k).transpose());
    }
    G(k, k) = path.gamma[k];
    effect_of_time(machine, stretch, static_cast<std::size_t>(k), path, on_y, on_u);
    Y.col(k) = on_y;
    U.col(k) = on_u;
  }
  if (end == nullptr) return;
  end->resize(2 * n, N);
  *end << Y, U;
}

}  // namespace sprag
