#include "sprag/estimation/retrodiction.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// A mode that has decayed by exp(12) since is not there any more, and is not made to grow back.
constexpr double most_growth = 12.0;

// Rate at which mode i grows back in time.
double growth_of(const Oscillators& of, Eigen::Index i) {
  const double excess = square(of.delta()[i]) - of.kappa()[i];
  return of.delta()[i] + (excess > 0.0 ? std::sqrt(excess) : 0.0);
}

// The largest of all modes.
double growth_of(const Flow& flow) {
  double growth = 0.0;
  for (Eigen::Index i = 0; i < flow.modes(); ++i) {
    growth = std::max(growth, growth_of(flow.oscillators(), flow.frequencies() + i));
  }
  return growth;
}

bool reaches(double growth, double tau) { return -growth * tau <= most_growth; }

}  // namespace

Retrodiction::Retrodiction(const Flows& flows, Eigen::Index columns) {
  const Eigen::Index f = flows.dynamics().coordinates();
  const Eigen::Index n = flows[0].size();
  kernels_.resize(n);
  for (Eigen::MatrixXd* x : {&Z_, &V_, &moved_Z_, &moved_V_}) x->setZero(f, columns);
  for (Eigen::VectorXd* x : {&row_z_, &row_v_, &off_z_, &off_v_}) x->setZero(f);
  phi_.setZero(columns);
  psi_.setZero(columns);
  const Eigen::VectorXd no_q = Eigen::VectorXd::Zero(f);
  const Eigen::VectorXd no_gaps = Eigen::VectorXd::Zero(flows.dynamics().contacts());
  flows[0].enter(no_q, no_q, Instant{}, no_gaps.head(0), then_);
}

void Retrodiction::begin(const Signal& signal, const Motion& motion, const Belief& belief) {
  motion_ = &motion;
  signal_ = &signal;
  columns_ = belief.columns;
  const Flow& flow = *motion.flow;
  const Oscillators& of = flow.oscillators();
  const Eigen::Index n = flow.modes();
  const Eigen::Index nf = flow.frequencies();
  flow.enter_differences(belief.S_q.leftCols(columns_), belief.S_u.leftCols(columns_),
                         Z_.topLeftCorner(n, columns_), V_.topLeftCorner(n, columns_));
  fastest_ = n > 0 ? of.root_kappa().segment(nf, n).maxCoeff() : 0.0;
  growth_ = growth_of(flow);
  then_ = motion;
}

bool Retrodiction::reaches(double tau) const { return sprag::reaches(growth_, tau); }

// move(tau, first, count) for all modes of a flow, each by no more than it reaches.
template <typename Move>
void Retrodiction::for_each_tau(const Flow& flow, double growth, double tau, const Move& move) {
  const Eigen::Index n = flow.modes();
  const Eigen::Index nf = flow.frequencies();
  if (sprag::reaches(growth, tau)) {
    move(tau, nf, n);
    return;
  }
  for (Eigen::Index i = nf; i < nf + n; ++i) {
    move(std::max(tau, -most_growth / growth_of(flow.oscillators(), i)), i, 1);
  }
}

void Retrodiction::go_back(double age) {
  const Oscillators& of = flow().oscillators();
  const Eigen::Index n = flow().modes();
  const Eigen::Index nf = flow().frequencies();
  set_kernels(flow(), growth_, -age);
  value_at(age);
  const auto depend = [&](const auto& p, const auto& r, auto on) {
    row_z_.head(n) = p * kernels_.zz.segment(nf, n) + r * kernels_.vz.segment(nf, n);
    row_v_.head(n) = p * kernels_.zv.segment(nf, n) + r * kernels_.vv.segment(nf, n);
    on.noalias() = Z_.topLeftCorner(n, columns_).transpose().lazyProduct(row_z_.head(n));
    on.noalias() += V_.topLeftCorner(n, columns_).transpose().lazyProduct(row_v_.head(n));
  };
  const auto p = signal_->p.segment(nf, n);
  const auto r = signal_->r.segment(nf, n);
  depend(p, r, phi_.head(columns_));
  const auto kappa = of.kappa().segment(nf, n);
  const auto delta = of.delta().segment(nf, n);
  depend(-r * kappa, p - 2.0 * r * delta, psi_.head(columns_));
}

double Retrodiction::value_at(double age) {
  for_each_tau(flow(), growth_, -age, [&](double tau, Eigen::Index first, Eigen::Index count) {
    flow().move_modes(*motion_, tau, first, count, then_.x);
  });
  then_.t = motion_->t + -age;
  flow().set_phases(then_.t, then_.x);
  return value();
}

void Retrodiction::set_xi(const Eigen::Ref<const Eigen::VectorXd>& xi) {
  const Eigen::Index n = flow().modes();
  const Eigen::Index nf = flow().frequencies();
  off_z_.head(n).noalias() = Z_.topLeftCorner(n, columns_).lazyProduct(xi);
  off_v_.head(n).noalias() = V_.topLeftCorner(n, columns_).lazyProduct(xi);
  const auto z = off_z_.head(n).array();
  const auto v = off_v_.head(n).array();
  then_.x.z.segment(nf, n) += kernels_.zz.segment(nf, n) * z + kernels_.zv.segment(nf, n) * v;
  then_.x.v.segment(nf, n) += kernels_.vz.segment(nf, n) * z + kernels_.vv.segment(nf, n) * v;
}

void Retrodiction::return_to_motion() {
  const Eigen::Index n = flow().modes();
  const Eigen::Index nf = flow().frequencies();
  then_.x = motion_->x;
  then_.x.z.segment(nf, n) += off_z_.head(n).array();
  then_.x.v.segment(nf, n) += off_v_.head(n).array();
  then_.t = motion_->t;
}

// What tau makes of the modes of a flow.
void Retrodiction::set_kernels(const Flow& flow, double growth, double tau) {
  for_each_tau(flow, growth, tau, [&](double of_mode, Eigen::Index first, Eigen::Index count) {
    flow.oscillators().kernels(of_mode, first, count, kernels_);
  });
}

void Retrodiction::change_flow(const Flow& after, double age, double kick,
                               const Eigen::VectorXd& impact_u, Eigen::MatrixXd& S_q,
                               Eigen::MatrixXd& S_u) {
  auto q = S_q.leftCols(columns_);
  auto u = S_u.leftCols(columns_);
  const auto modes = [&](const Flow& of) {
    return std::pair(moved_Z_.topLeftCorner(of.modes(), columns_),
                     moved_V_.topLeftCorner(of.modes(), columns_));
  };
  const auto go = [&](const Flow& on, double growth, double tau) {
    set_kernels(on, growth, tau);
    auto [z, v] = modes(on);
    kernels_.apply(on.frequencies(), z, v);
    on.state_differences(z, v, q, u);
  };
  auto [z, v] = modes(flow());
  z = Z_.topLeftCorner(flow().modes(), columns_);
  v = V_.topLeftCorner(flow().modes(), columns_);
  go(flow(), growth_, -age);
  for (Eigen::Index j = 0; j < columns_; ++j) u.col(j) += kick * psi_[j] * impact_u;
  after.close_gap_differences(q);
  auto [z_after, v_after] = modes(after);
  after.enter_differences(q, u, z_after, v_after);
  go(after, growth_of(after), age);
}

void Retrodiction::move(double tau, const Eigen::Ref<const Eigen::VectorXd>& z,
                        const Eigen::Ref<const Eigen::VectorXd>& v,
                        Eigen::Ref<Eigen::VectorXd> moved_z, Eigen::Ref<Eigen::VectorXd> moved_v) {
  set_kernels(flow(), growth_, tau);
  moved_z = z;
  moved_v = v;
  kernels_.apply(flow().frequencies(), moved_z, moved_v);
}

}  // namespace sprag
