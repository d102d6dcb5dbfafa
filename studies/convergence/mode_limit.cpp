#include "studies/convergence/mode_limit.h"

#include <Eigen/QR>
#include <cmath>
#include <numbers>
#include <numeric>

#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag::studies {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int samples = 16;  // of P in a flight

struct Cluster {
  double begin, end;
  VectorXd state = {};    // q_n and u_n at its begin
  double left_out = 0.0;  // r [m]
  double impulse = 0.0;   // on the kept modes [N s]
};

std::vector<Cluster> clusters(const std::vector<ContactEvent>& events, double apart) {
  std::vector<Cluster> found;
  ContactSet chi = 0;
  for (const ContactEvent& event : events) {
    if (found.empty() || (chi == 0 && event.t - found.back().end > apart)) {
      found.push_back({event.t, event.t});
    }
    found.back().end = event.t;
    chi = after(chi, event);
  }
  return found;
}

// Runs the master through the clusters and records the kept modes in each.
void measure(const ModalMachine& machine, const ModalMachine& part, std::vector<Cluster>& found) {
  const Index n = part.model.coordinates();
  const Index f = machine.model.coordinates();
  const Contact& contact = part.model.contacts[0];
  const Contact& whole = machine.model.contacts[0];
  const VectorXd mass = part.model.M.diagonal();
  const VectorXd b = contact.w.cwiseQuotient(mass);
  const Flows whole_flows(machine.model);
  const Flows flows(part.model);
  const VectorXd no_gaps;
  Master master(machine.model, machine.master);
  std::vector<ContactEvent> events;
  VectorXd q = machine.master.q;
  VectorXd u = machine.master.u;
  double last = 0.0;
  Motion motion;
  VectorXd q_free(n), u_free(n);
  for (Cluster& cluster : found) {
    // Before the first impact: from the end of the previous cluster.
    Motion flight;
    whole_flows[0].enter(q, u, at(last), no_gaps, flight);
    whole_flows[0].propagate(flight, at(cluster.begin), flight);
    whole_flows[0].state(flight, q, u);
    cluster.state.resize(2 * n);
    cluster.state << q.head(n), u.head(n);
    cluster.left_out = whole.w.tail(f - n).dot(q.tail(f - n));
    flows[0].enter(q.head(n), u.head(n), at(cluster.begin), no_gaps, motion);
    flows[0].propagate(motion, at(cluster.end), motion);
    flows[0].state(motion, q_free, u_free);
    master.advance(at(cluster.end), events);
    master.state(at(cluster.end), q, u);
    last = cluster.end;
    cluster.impulse = contact.w.dot(u.head(n) - u_free) / contact.w.dot(b);
  }
}

// Homogeneous flight of n modes over tau, on (q, u).
MatrixXd flight(const Model& model, double tau) {
  const Index n = model.coordinates();
  MatrixXd F = MatrixXd::Zero(2 * n, 2 * n);
  for (Index i = 0; i < n; ++i) {
    const double delta = 0.5 * model.C(i, i) / model.M(i, i);
    const double kappa = model.K(i, i) / model.M(i, i);
    const std::complex<double> omega = std::sqrt(std::complex<double>(kappa - delta * delta));
    const std::complex<double> sine = omega == 0.0 ? tau : std::sin(omega * tau) / omega;
    const double c = std::cos(omega * tau).real();
    const double s = sine.real();
    const double decay = std::exp(-delta * tau);
    F(i, i) = decay * (c + delta * s);
    F(i, n + i) = decay * s;
    F(n + i, i) = -decay * kappa * s;
    F(n + i, n + i) = decay * (c - delta * s);
  }
  return F;
}

}  // namespace

double mode_limit(const ModalMachine& machine, const std::vector<ContactEvent>& events, Index n,
                  double settled, double left_out_tip, LeftOutGap r) {
  std::vector<Index> kept(static_cast<std::size_t>(n));
  std::iota(kept.begin(), kept.end(), Index{0});
  const ModalMachine part = reduced(machine, kept);
  const Model& model = machine.model;
  std::vector<Cluster> found =
      clusters(events, std::numbers::pi / std::sqrt(model.K(n, n) / model.M(n, n)));
  measure(machine, part, found);

  // Lambda = k^T (q_n, u_n) + a function of the support's phase + eta.
  const auto count = static_cast<Index>(found.size());
  const Harmonic& support = part.model.contacts[0].motion;
  MatrixXd known(count, 2 * n + 3);
  VectorXd impulse(count), left_out(count);
  for (Index i = 0; i < count; ++i) {
    const Cluster& cluster = found[static_cast<std::size_t>(i)];
    const double phase = support.frequency * cluster.begin;
    known.row(i) << cluster.state.transpose(), 1.0, std::cos(phase), std::sin(phase);
    impulse[i] = cluster.impulse;
    left_out[i] = cluster.left_out;
  }
  const VectorXd scale = known.colwise().norm();
  const Eigen::ColPivHouseholderQR<MatrixXd> fit(known * scale.cwiseInverse().asDiagonal());
  const VectorXd k = fit.solve(impulse).cwiseQuotient(scale);
  const auto freedom = static_cast<double>(std::max<Index>(count - known.cols(), 1));
  const double residual = (impulse - known * k).squaredNorm() / freedom;
  const double variance = (left_out.array() - left_out.mean()).square().mean();

  const VectorXd& w = part.model.contacts[0].w;
  const VectorXd b = w.cwiseQuotient(part.model.M.diagonal());
  VectorXd H = VectorXd::Zero(2 * n);
  H.head(n) = w;
  MatrixXd J = MatrixXd::Identity(2 * n, 2 * n);
  J.bottomRows(n) += b * k.head(2 * n).transpose();
  VectorXd B = VectorXd::Zero(2 * n);
  B.tail(n) = b;
  VectorXd tip = VectorXd::Zero(2 * n);
  tip.head(n) = part.observed.row(0).transpose();
  MatrixXd P = MatrixXd::Identity(2 * n, 2 * n);
  double time = 0.0;
  double integral = 0.0;
  double last = 0.0;
  const auto measure_gap = [&] {
    const VectorXd PH = P * H;
    P -= PH * PH.transpose() / (H.dot(PH) + variance);
    P = 0.5 * (P + P.transpose()).eval();
  };
  const auto fly = [&](double until, int steps) {
    const double step = (until - last) / steps;
    const MatrixXd F = flight(part.model, step);
    for (int i = 0; i < steps; ++i) {
      P = F * P * F.transpose();
      if (last < settled) continue;
      integral += step * tip.dot(P * tip);
      time += step;
    }
    last = until;
  };
  auto event = events.begin();
  for (const Cluster& cluster : found) {
    fly(cluster.begin, samples);
    measure_gap();
    P = J * P * J.transpose() + residual * B * B.transpose();
    for (; event != events.end() && event->t <= cluster.end; ++event) {
      if (event->t <= last || event->kind == ContactEventKind::opens) continue;
      if (r == LeftOutGap::same_in_a_cluster) continue;
      fly(event->t, 1);
      measure_gap();
    }
  }
  return std::sqrt(integral / time + square(left_out_tip));
}

}  // namespace sprag::studies
