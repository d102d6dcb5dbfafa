#include "sprag/adaptation/joint_filter.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "sprag/estimation/belief.h"

namespace sprag {
namespace {

constexpr int most_steps = 6;
constexpr double settled = 1e-3;  // of a residual's deviation
// Deviations of what nothing is known of: of the largest value on the path, and of coordinates.
constexpr double wide_state = 3.0;
constexpr double wide_share = 2.0;

}  // namespace

JointFilter::JointFilter(const MachineFamily& family)
    : family_(&family), flight_(family), present_(family) {
  const Eigen::VectorXd& walk = family.scene().adaptation.walk;
  walk_ = walk.size() > 1 ? walk : Eigen::VectorXd::Constant(unknowns(), walk[0]);
  const Eigen::Index columns = size() + unknowns() + 1;
  A_.setZero(size(), columns);
  tau_row_.setZero(columns);
  h_.setZero(size());
  phi_.setZero(columns);
  gain_.setZero(size());
  dx_.setZero(2 * n());
  column_.setZero(columns);
  point_.z.setZero(size());
}

JointBelief JointFilter::no_belief() const {
  JointBelief belief;
  belief.z.setZero(size());
  belief.S.setZero(size(), size());
  return belief;
}

// What the unknowns do in the meantime is taken as done at the beginning.
void JointFilter::spread(const JointBelief& belief, double duration, double sigma) {
  A_.setZero();
  A_.leftCols(size()) = belief.S;
  const double root = std::sqrt(std::max(duration, 0.0));
  for (Eigen::Index k = 0; k < unknowns(); ++k) A_(2 * n() + k, size() + k) = walk_[k] * root;
  tau_row_.setZero();
  tau_row_[tau_row_.size() - 1] = sigma;
}

// At point_, before the impact.
void JointFilter::linearize(int contact, double t0, double t) {
  flight_.set(point_.z.tail(unknowns()), true);
  flight_.fly(point_.z.head(2 * n()), t0, t - point_.tau - t0);
  gap_ = flight_.gap(contact);
  flight_.gap_derivatives(contact, h_);
}

// Of the mean; tau is expected to be 0.
JointFilter::Residual JointFilter::expect(const JointBelief& belief) {
  const double by_tau = -gap_.velocity;
  phi_.noalias() = A_.transpose().lazyProduct(h_);
  phi_ += by_tau * tau_row_;
  Residual residual;
  residual.noise = square(measurement_rounding * gap_.rounding);
  residual.variance = phi_.squaredNorm() + residual.noise;
  residual.value = by_tau * point_.tau - gap_.g;
  for (Eigen::Index i = 0; i < size(); ++i) {
    residual.value -= h_[i] * (belief.z[i] - point_.z[i]);
  }
  return residual;
}

void JointFilter::condition(const Residual& residual) {
  const double shrink =
      1.0 / (residual.variance * (1.0 + std::sqrt(residual.noise / residual.variance)));
  gain_.noalias() = A_.lazyProduct(phi_);
  gain_of_tau_ = tau_row_.dot(phi_);
  for (Eigen::Index i = 0; i < size(); ++i) A_.row(i) -= (shrink * gain_[i]) * phi_.transpose();
  tau_row_ -= (shrink * gain_of_tau_) * phi_;
}

// Behind the impact.
void JointFilter::carry_columns(bool struck) {
  for (Eigen::Index j = 0; j < A_.cols(); ++j) {
    dx_ = A_.col(j).head(2 * n());
    flight_.carry(dx_);
    if (struck) flight_.carry_through(dx_);
    dx_.noalias() += flight_.by_unknowns().lazyProduct(A_.col(j).tail(unknowns()));
    if (struck) dx_ -= tau_row_[j] * flight_.by_time();
    A_.col(j).head(2 * n()) = dx_;
  }
}

// The last `rows` rows of A_, without a change of A A^T, lower triangular in the first columns.
void JointFilter::triangularize(Eigen::Index rows, Eigen::Index columns) {
  const Eigen::Index first = size() - rows;
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Eigen::Index length = columns - i;
    auto row = A_.row(first + i).segment(i, length);
    const double norm = row.norm();
    if (!(norm > 0.0)) continue;
    auto v = column_.head(length);
    v = row.transpose();
    const double head = v[0] > 0.0 ? -norm : norm;
    v[0] -= head;
    const double scale = 2.0 / v.squaredNorm();
    row.setZero();
    row[0] = head;
    for (Eigen::Index k = first + i + 1; k < size(); ++k) {
      auto below = A_.row(k).segment(i, length);
      const double share = scale * below.dot(v);
      below -= share * v.transpose();
    }
  }
}

void JointFilter::keep(JointBelief& belief) const { belief.S = A_.leftCols(size()); }

bool JointFilter::take(int contact, double t, bool stays, JointBelief& belief) {
  const double t0 = belief.t;
  spread(belief, t - t0, belief.sigma);
  point_.z = belief.z;
  point_.tau = 0.0;
  Residual residual;
  double before = 0.0;
  for (int step = 0; step < most_steps; ++step) {
    if (!(t - point_.tau > t0)) return false;
    linearize(contact, t0, t);
    residual = expect(belief);
    if (!std::isfinite(residual.value) || !(residual.variance > 0.0)) return false;
    if (step == 0) {
      belief.innovation = {t, contact, -residual.value, std::sqrt(residual.variance)};
    }
    const double factor = residual.value / residual.variance;
    gain_.noalias() = A_.lazyProduct(phi_);
    point_.z = belief.z + factor * gain_;
    point_.tau = factor * tau_row_.dot(phi_);
    const double moved = std::abs(residual.value - before);
    before = residual.value;
    if (step > 0 && moved < settled * std::sqrt(residual.variance)) break;
  }
  condition(residual);
  if (!(t - point_.tau > t0)) return false;
  linearize(contact, t0, t);
  flight_.strike(contact, stays);
  carry_columns(true);
  triangularize(size(), A_.cols());
  belief.t = t - point_.tau;
  belief.held = stays ? contact : -1;
  belief.z.head(2 * n()) = flight_.x();
  belief.z.tail(unknowns()) = point_.z.tail(unknowns());
  belief.square = residual.square();
  belief.length = std::max(belief.length, gap_.length);
  keep(belief);
  return belief.z.allFinite() && belief.S.allFinite();
}

bool JointFilter::take_burst(int contact, double t, double longest, JointBelief& belief) {
  if (!(t >= belief.t)) return false;
  spread(belief, t - belief.t, belief.sigma);
  flight_.set(belief.z.tail(unknowns()), true);
  flight_.fly(belief.z.head(2 * n()), belief.t, t - belief.t);
  gap_ = flight_.gap(contact);
  // How long and how far a machine bounces that leaves with this speed.
  const double speed = std::abs(gap_.velocity);
  const double duration = 2.0 * speed / (std::abs(gap_.acceleration) * flight_.lost_share(contact));
  if (!(duration < longest)) return false;
  flight_.strike(contact, true);
  tau_row_.setZero();
  carry_columns(true);
  // In place of tau: what it does on the way is not followed.
  flight_.along(contact, dx_.head(n()));
  A_.col(A_.cols() - 1).head(n()) = (speed * duration) * dx_.head(n());
  triangularize(size(), A_.cols());
  belief.t = t;
  belief.held = contact;
  belief.burst = true;
  belief.z.head(2 * n()) = flight_.x();
  keep(belief);
  return belief.z.allFinite() && belief.S.allFinite();
}

void JointFilter::release(double t, JointBelief& belief) {
  spread(belief, t - belief.t, 0.0);
  flight_.set(belief.z.tail(unknowns()), true);
  flight_.fly(belief.z.head(2 * n()), belief.t, t - belief.t, belief.held);
  carry_columns(false);
  triangularize(size(), A_.cols());
  belief.t = t;
  belief.held = -1;
  belief.burst = false;
  belief.z.head(2 * n()) = flight_.x();
  keep(belief);
}

double JointFilter::cost(double t, const JointBelief& belief) const {
  return belief.held < 0 ? 1.0 : present_.cost_of_holding(t - belief.t);
}

void JointFilter::restart(double t, const Eigen::Ref<const Eigen::VectorXd>& x,
                          const Eigen::Ref<const Eigen::MatrixXd>& S_x, JointBelief& belief) {
  spread(belief, t - belief.t, belief.sigma);
  const Eigen::Index known = size() + unknowns();
  triangularize(unknowns(), known);
  // From the last column on: the blocks may overlap.
  for (Eigen::Index k = unknowns() - 1; k >= 0; --k) {
    A_.col(2 * n() + k).tail(unknowns()) = A_.col(k).tail(unknowns());
  }
  A_.block(2 * n(), 0, unknowns(), 2 * n()).setZero();
  A_.topRows(2 * n()).setZero();
  A_.topLeftCorner(2 * n(), 2 * n()) = S_x;
  belief.t = t;
  belief.held = -1;
  belief.burst = false;
  belief.z.head(2 * n()) = x;
  keep(belief);
}

// (y, y') at the start of a stretch, of which the path holds the free part.
Eigen::VectorXd JointFilter::start_of(const Likelihood& path, std::size_t s) const {
  const Machine machine = family_->at(path.values);
  const Eigen::VectorXd inputs = family_->inputs(path.values);
  Eigen::VectorXd x = path.x0[s];
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const std::complex<double> z = std::complex<double>(inputs[2 * g], inputs[2 * g + 1]) *
                                   std::polar(1.0, machine.frequencies[g] * path.path[s].start);
    const std::complex<double> rate(0.0, machine.frequencies[g]);
    x.head(n()) += (machine.response.col(g) * z).real();
    x.tail(n()) += (machine.response.col(g) * (z * rate)).real();
  }
  return x;
}

// Of |y| and |y'| on the path.
std::vector<double> JointFilter::largest(const Likelihood& path, const Eigen::VectorXd& c) {
  std::vector<double> sizes(static_cast<std::size_t>(2 * n()), 0.0);
  flight_.set(c, true);
  for (std::size_t s = 0; s < path.path.size(); ++s) {
    Eigen::VectorXd x = start_of(path, s);
    double t = path.path[s].start;
    for (const Impact& impact : path.path[s].impacts) {
      flight_.fly(x, t, impact.t - t);
      flight_.strike(impact.contact);
      x = flight_.x();
      t = impact.t;
      for (Eigen::Index i = 0; i < 2 * n(); ++i) {
        double& size = sizes[static_cast<std::size_t>(i)];
        size = std::max(size, std::abs(x[i]));
      }
    }
  }
  return sizes;
}

void JointFilter::follow(const Likelihood& path, const Stretches& measured, double sigma,
                         JointBelief& belief) {
  const std::vector<Unknown>& all = family_->unknowns();
  Eigen::VectorXd c(unknowns());
  belief = no_belief();
  belief.sigma = sigma;
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    const Unknown& unknown = all[static_cast<std::size_t>(k)];
    c[k] = unknown.coordinate(path.values[k]);
    belief.S(2 * n() + k, 2 * n() + k) = unknown.logarithmic ? wide_share * unknown.within : 1.0;
  }
  belief.z.tail(unknowns()) = c;
  belief.t = path.path.front().start;
  const std::vector<double> sizes = largest(path, c);
  Eigen::MatrixXd wide = Eigen::MatrixXd::Zero(2 * n(), 2 * n());
  for (Eigen::Index i = 0; i < 2 * n(); ++i) {
    wide(i, i) = wide_state * sizes[static_cast<std::size_t>(i)];
  }
  Eigen::VectorXd behind(size());
  for (std::size_t s = 0; s < path.path.size(); ++s) {
    const Stretch& stretch = path.path[s];
    Point on;
    on.z.resize(size());
    on.z << start_of(path, s), c;
    restart(stretch.start, on.z.head(2 * n()), wide, belief);
    double t0 = stretch.start;
    for (std::size_t k = 0; k < stretch.size(); ++k) {
      const Impact& impact = stretch.impacts[k];
      const double t = measured[s].impacts[k].t;
      on.tau = t - impact.t;
      point_ = on;
      spread(belief, impact.t - t0, impact.timed ? sigma : impact.t - t0);
      linearize(impact.contact, t0, t);
      const Residual residual = expect(belief);
      condition(residual);
      const double factor = residual.value / residual.variance;
      // gain_ is that of the columns before they were conditioned.
      const Eigen::VectorXd off = belief.z + factor * gain_ - on.z;
      const double off_tau = factor * gain_of_tau_ - on.tau;
      flight_.strike(impact.contact);
      carry_columns(true);
      triangularize(size(), A_.cols());
      dx_ = off.head(2 * n());
      flight_.carry(dx_);
      flight_.carry_through(dx_);
      dx_ += flight_.by_unknowns() * off.tail(unknowns()) - off_tau * flight_.by_time();
      belief.z << flight_.x() + dx_, c + off.tail(unknowns());
      belief.t = t0 = impact.t;
      belief.length = std::max(belief.length, gap_.length);
      belief.square = residual.square();
      keep(belief);
      on.z.head(2 * n()) = flight_.x();
    }
  }
}

const Eigen::VectorXd& JointFilter::at(double t, const JointBelief& belief) {
  present_.set(belief.z.tail(unknowns()), false);
  present_.fly(belief.z.head(2 * n()), belief.t, t - belief.t, belief.held);
  return present_.x();
}

void JointFilter::deviations(double t, const JointBelief& belief, JointBelief::Rows& of_x,
                             JointBelief::Rows& of_gaps) {
  present_.set(belief.z.tail(unknowns()), true);
  present_.fly(belief.z.head(2 * n()), belief.t, t - belief.t, belief.held);
  for (Eigen::Index j = 0; j < size(); ++j) {
    dx_ = belief.S.col(j).head(2 * n());
    present_.carry(dx_);
    dx_.noalias() += present_.by_unknowns().lazyProduct(belief.S.col(j).tail(unknowns()));
    of_x.col(j) = dx_;
  }
  for (Eigen::Index i = 0; i < of_gaps.rows(); ++i) {
    present_.gap_derivatives(static_cast<int>(i), h_);
    of_gaps.row(i).noalias() = h_.transpose().lazyProduct(belief.S);
  }
}

}  // namespace sprag
