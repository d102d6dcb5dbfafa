#include "sprag/detail/identification/free_flight.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "sprag/detail/identification/coupled_step.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/oscillators.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {

FreeFlight::FreeFlight(const Machine& machine, Eigen::VectorXd inputs)
    : machine_(machine), inputs_(std::move(inputs)) {
  constexpr double samples = 12.0;  // samples in a period
  constants_ = inputs_.segment(machine.driving(), machine.constant_forces.cols());
  const double stiffest = machine.modal ? machine.K.maxCoeff() : machine.K.trace();
  double fastest = std::sqrt(std::max(stiffest, 0.0));
  if (machine.groups() > 0) fastest = std::max(fastest, machine.frequencies.maxCoeff());
  for (Eigen::Index r = 0; r < machine.records(); ++r) {
    // A record also has faster content than its mean.
    constexpr double faster = 2.0;
    const RecordedResponse& response = (*machine.recorded)[static_cast<std::size_t>(r)];
    fastest = std::max(fastest, faster * response.mean_frequency());
  }
  step_ = fastest > 0.0 ? 2.0 * std::numbers::pi / fastest / samples : 0.0;
}

void FreeFlight::move(double tau, Eigen::VectorXd& y, Eigen::VectorXd& u) const {
  const Eigen::Index n = machine_.n();
  if (!machine_.modal) {
    Eigen::VectorXd x(2 * n + constants_.size());
    x << y, u, constants_;
    const Eigen::VectorXd moved =
        coupled_step(machine_.C, machine_.K, machine_.constant_forces, tau) * x;
    y = moved.head(n);
    u = moved.tail(n);
    return;
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    double force = 0.0;
    if (constants_.size() > 0) force = machine_.constant_forces.row(i).dot(constants_);
    oscillator_step(0.5 * machine_.C(i, 0), machine_.K(i, 0), tau).apply(force, y[i], u[i]);
  }
}

void FreeFlight::move(ContactSet held, double t, double tau, Eigen::VectorXd& y,
                      Eigen::VectorXd& u) const {
  if (held == 0) {
    move(tau, y, u);
    return;
  }
  const HeldFlight& flight = held_.try_emplace(held, machine_, held).first->second;
  Eigen::MatrixXd Y = y, U = u;
  flight.move(t, tau, inputs_.head(machine_.driving() + constants_.size()), Y, U);
  y = Y;
  u = U;
}

double FreeFlight::gap(int contact, const Eigen::VectorXd& y, double t) const {
  const Eigen::Index G = machine_.groups();
  double g =
      machine_.W.col(contact).dot(y) + inputs_[machine_.driving() + constants_.size() + contact];
  for (Eigen::Index j = 0; j < G; ++j) {
    g += (machine_.gap_response(contact, j) * std::polar(1.0, machine_.frequencies[j] * t) *
          std::complex<double>(inputs_[2 * j], inputs_[2 * j + 1]))
             .real();
  }
  for (Eigen::Index r = 0; r < machine_.records(); ++r) {
    g += inputs_[2 * G + r] * recorded_gap(machine_, contact, r, t).g;
  }
  return g;
}

double FreeFlight::gap_velocity(int contact, const Eigen::VectorXd& u, double t) const {
  double gamma = machine_.W.col(contact).dot(u);
  for (Eigen::Index j = 0; j < machine_.groups(); ++j) {
    const double Omega = machine_.frequencies[j];
    gamma -= Omega * (machine_.gap_response(contact, j) * std::polar(1.0, Omega * t) *
                      std::complex<double>(inputs_[2 * j], inputs_[2 * j + 1]))
                         .imag();
  }
  for (Eigen::Index r = 0; r < machine_.records(); ++r) {
    gamma += inputs_[2 * machine_.groups() + r] * recorded_gap(machine_, contact, r, t).rate;
  }
  return gamma;
}

void FreeFlight::hit(int contact, double t, Eigen::VectorXd& u, ContactSet staying) const {
  u -= jump_of(machine_, contact, staying) * gap_velocity(contact, u, t);
}

// gamma+ = -epsilon gamma-, and W^T jump = 1 + epsilon.
void FreeFlight::undo_hit(int contact, double t, Eigen::VectorXd& u) const {
  const auto jump = machine_.jump.col(contact);
  const double epsilon = machine_.W.col(contact).dot(jump) - 1.0;
  u -= jump * (gap_velocity(contact, u, t) / epsilon);
}

std::optional<Impact> FreeFlight::next_impact(Eigen::VectorXd y, Eigen::VectorXd u, double t,
                                              double until) const {
  const int contacts = static_cast<int>(machine_.W.cols());
  constexpr double most_samples = 2000.0;
  const double way = until < t ? -1.0 : 1.0;
  const double duration = std::abs(until - t);
  const double h = std::max(step_ > 0.0 ? step_ : duration, duration / most_samples);
  while (way * (until - t) > 0.0) {
    const double tau = way * std::min(h, std::abs(until - t));
    Eigen::VectorXd y_next = y, u_next = u;
    move(tau, y_next, u_next);
    int first = -1;
    double at = tau;
    for (int i = 0; i < contacts; ++i) {
      if (gap(i, y_next, t + tau) >= 0.0) continue;
      // The gap falls through zero in this step. Bisection needs its sign only.
      double low = 0.0, high = at;
      for (int halving = 0; halving < 50; ++halving) {
        const double middle = 0.5 * (low + high);
        Eigen::VectorXd y_middle = y, u_middle = u;
        move(middle, y_middle, u_middle);
        const bool still_outside = gap(i, y_middle, t + middle) >= 0.0 ||
                                   way * gap_velocity(i, u_middle, t + middle) > 0.0;
        (still_outside ? low : high) = middle;
      }
      if (first < 0 || std::abs(high) < std::abs(at)) {
        first = i;
        at = high;
      }
    }
    if (first >= 0) return Impact{t + at, first, false, 0};
    y = y_next;
    u = u_next;
    t += tau;
  }
  return std::nullopt;
}

double FreeFlight::deepest(Eigen::VectorXd y, Eigen::VectorXd u, double t, double until,
                           ContactSet held) const {
  constexpr int least = 4, most = 200;
  const double wanted = step_ > 0.0 ? (until - t) / step_ : least;
  const int samples = static_cast<int>(std::clamp(std::ceil(wanted), 1.0 * least, 1.0 * most));
  const double h = (until - t) / samples;
  double lowest = 0.0;
  for (int k = 1; k < samples; ++k) {
    move(held, t + (k - 1) * h, h, y, u);
    for (int i = 0; i < static_cast<int>(machine_.W.cols()); ++i) {
      if (contains(held, i)) continue;
      lowest = std::min(lowest, gap(i, y, t + k * h));
    }
  }
  return lowest;
}

namespace {

constexpr double sure = 5.0;  // in standard deviations

// The gaps of all contacts in the middle of each flight (of its last part, if it has passages), and
// gamma- of each impact.
Eigen::VectorXd gaps_of(const FreeFlight& flight, int contacts, const Stretch& stretch,
                        const Eigen::VectorXd& x0) {
  const Eigen::Index n = x0.size() / 2, N = static_cast<Eigen::Index>(stretch.size());
  Eigen::VectorXd y = x0.head(n), u = x0.tail(n), gaps(N * (contacts + 1));
  for (Eigen::Index k = 0; k < N; ++k) {
    const Impact& impact = stretch.impacts[static_cast<std::size_t>(k)];
    const auto in_the_middle = [&](double from, double to, ContactSet held) {
      const double half = 0.5 * (to - from);
      Eigen::VectorXd y_half = y, u_half = u;
      flight.move(held, from, half, y_half, u_half);
      for (int i = 0; i < contacts; ++i) {
        gaps[k * (contacts + 1) + i] = flight.gap(i, y_half, from + half);
      }
    };
    fly(flight, stretch, static_cast<std::size_t>(k), y, u, in_the_middle);
    gaps[k * (contacts + 1) + contacts] = flight.gap_velocity(impact.contact, u, impact.t);
    flight.hit(impact.contact, impact.t, u, impact.staying);
  }
  return gaps;
}

// Standard deviation of each of these values, from the covariance of the start.
Eigen::VectorXd deviations_of(const FreeFlight& flight, int contacts, const Stretch& stretch,
                              const Eigen::VectorXd& x0, const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd gaps = gaps_of(flight, contacts, stretch, x0);
  const Eigen::Index n2 = x0.size();
  const Eigenpairs of = eigenpairs(covariance, Eigen::MatrixXd::Identity(n2, n2));
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(gaps.size());
  for (Eigen::Index j = 0; j < n2; ++j) {
    const Eigen::VectorXd moved = x0 + std::sqrt(std::max(of.values[j], 0.0)) * of.vectors.col(j);
    squares += (gaps_of(flight, contacts, stretch, moved) - gaps).cwiseAbs2();
  }
  return squares.cwiseSqrt();
}

}  // namespace

std::vector<StretchPath> check_paths(const MachineFamily& family, const Likelihood& solution,
                                     double jitter) {
  const Machine machine = family.at(solution.values);
  const FreeFlight flight(machine, family.inputs(solution.values));
  const int contacts = family.contacts();
  double usual = 0.0;
  for (const Eigen::VectorXd& gamma : solution.gamma) usual += gamma.cwiseAbs().sum();
  usual /= static_cast<double>(count(solution.path));
  std::vector<StretchPath> checks;
  for (std::size_t s = 0; s < solution.path.size(); ++s) {
    const Stretch& stretch = solution.path[s];
    const Eigen::VectorXd& gamma = solution.gamma[s];
    const Eigen::VectorXd unknown =
        sure * deviations_of(flight, contacts, stretch, solution.x0[s],
                             square(jitter) * solution.x0_covariance[s]);
    Eigen::VectorXd y = solution.x0[s].head(family.n()), u = solution.x0[s].tail(family.n());
    const double speed = gamma.cwiseAbs().mean();
    StretchPath check;
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      const Impact& impact = stretch.impacts[k];
      const auto i = static_cast<Eigen::Index>(k);
      const double of_gaps = unknown.segment(i * (contacts + 1), contacts).maxCoeff();
      double deepest = 0.0;
      fly(flight, stretch, k, y, u, [&](double from, double to, ContactSet held) {
        deepest = std::max(deepest, -flight.deepest(y, u, from, to, held));
      });
      if ((deepest - of_gaps) / speed > check.inside) {
        check.inside = (deepest - of_gaps) / speed;
        check.inside_from = k > 0 ? stretch.impacts[k - 1].t : stretch.start;
        check.inside_to = impact.t;
      }
      check.unknown = std::max(check.unknown, of_gaps / usual);
      const double of_gamma = unknown[i * (contacts + 1) + contacts];
      if (!(gamma[i] < of_gamma)) {
        check.hit_from_inside = true;
        if (!(check.inside > 0.0)) {
          check.inside_from = k > 0 ? stretch.impacts[k - 1].t : stretch.start;
          check.inside_to = impact.t;
        }
      }
      flight.hit(impact.contact, impact.t, u, impact.staying);
    }
    checks.push_back(check);
  }
  return checks;
}

}  // namespace sprag
