#include "sprag/estimation/timing_filter.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sprag/mechanics/linear_algebra.h"
#include "sprag/mechanics/scalars.h"
#include "sprag/mechanics/wide_product.h"

namespace sprag {
namespace {

constexpr std::size_t kept_bytes = 64 << 20;
constexpr double looks_a_period = 16.0;

}  // namespace

TimingFilter::TimingFilter(Model model, double h, Uncertainty uncertainty)
    : TimingFilter(std::make_shared<Flows>(std::move(model)), h, std::move(uncertainty)) {}

TimingFilter::TimingFilter(std::shared_ptr<Flows> flows, double h, Uncertainty uncertainty)
    : flows_(std::move(flows)),
      h_(h),
      uncertainty_(std::move(uncertainty)),
      impact_(flows_->dynamics()) {
  is_homogeneous_ = is_homogeneous(flows_->dynamics().model());
  build_foreseeable(*flows_);
  flight_ = TickedFlight((*flows_)[0], h);
  const int m = flows_->dynamics().contacts();
  for (int i = 0; i < m; ++i) acceleration_.push_back(flows_->dynamics().free_acceleration(i));
  const Eigen::Index of_drift = uncertainty_.drift_q.cols() + uncertainty_.drift_u.cols();
  // What merging leaves and a flight adds, and an event before columns are merged again.
  const bool jitters = uncertainty_.jitter > 0.0;
  const Eigen::Index merged = 4 * f() + (jitters ? Belief::most_components : 0);
  const Eigen::Index flown = merged + of_drift + 2;
  const Eigen::Index columns = flown + (jitters ? EventMixture::added_columns(flown) : 3L * m);
  now_.q.setZero(f());
  now_.u.setZero(f());
  now_.S_q.setZero(f(), columns);
  now_.S_u.setZero(f(), columns);
  no_gaps_.setZero(m);
  if (m > 0) largest_w_ = flows_->dynamics().W().cwiseAbs().maxCoeff();
  if (jitters) {
    unknown_time_.emplace(*flows_, uncertainty_.jitter, flown);
  }
  (*flows_)[0].enter(now_.q, now_.u, Instant{}, no_gaps_.head(0), sample_);
  published_ = stuck_ = hit_ = sample_;
  // As many columns as merging leaves. Not initialized: memory that is never used
  // stays the system's.
  const auto bytes = static_cast<std::size_t>(2 * f() * merged) * sizeof(double);
  covariances_.resize(std::clamp<std::size_t>(kept_bytes / bytes, 16, 1024));
  for (Covariance& S : covariances_) {
    S.S_q.resize(f(), merged);
    S.S_u.resize(f(), merged);
    S.mean = sample_;
  }
  for (Eigen::VectorXd* x :
       {&u_before_, &before_impact_, &u_sequence_, &on_u_, &share_, &off_q_, &off_u_, &on_flow_}) {
    x->setZero(f());
  }
  from_start_q_ = inverse(uncertainty_.q);
  from_start_u_ = inverse(uncertainty_.u);
  Wt_ = flows_->dynamics().W().transpose();
  start_gaps_ = product(Wt_, uncertainty_.q).rowwise().norm();
  start_speeds_ = product(Wt_, uncertainty_.u).rowwise().norm();
  closings_.reserve(static_cast<std::size_t>(m));
  phi_.setZero(columns);
  seen_of_gaps_.setZero(m, columns);
  const Flow& free = (*flows_)[0];
  columns_ = BeliefColumns(free, f(), columns);
  set_looks(free);
  set_start(uncertainty_, now_);
  energy_of_start_ = energy_of_error();
}

double TimingFilter::energy(const Eigen::Ref<const Eigen::VectorXd>& q,
                            const Eigen::Ref<const Eigen::VectorXd>& u) const {
  const Model& model = flows_->dynamics().model();
  const auto square_in = [&](const Eigen::MatrixXd& A, const auto& x) {
    if (flows_->dynamics().diagonal()) return (A.diagonal().array() * x.array().square()).sum();
    double sum = 0.0;
    for (Eigen::Index i = 0; i < f(); ++i) sum += x[i] * A.col(i).dot(x);
    return sum;
  };
  return 0.5 * (square_in(model.K, q) + square_in(model.M, u));
}

// Expected, by the covariance.
double TimingFilter::energy_of_error() const {
  double sum = 0.0;
  for (Eigen::Index j = 0; j < now_.columns; ++j) sum += energy(now_.S_q.col(j), now_.S_u.col(j));
  return sum;
}

// Silence is judged when a share of the slowest motion has passed since an instant, and then again
// and again, less and less often at first.
void TimingFilter::set_looks(const Flow& free) {
  const Eigen::Index n = free.frequencies() + free.modes();
  double slowest = infinity;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double omega = free.oscillators().root_kappa()[i];
    if (omega > 0.0) slowest = std::min(slowest, omega);
  }
  const double period = 2.0 * std::numbers::pi / slowest;
  longest_look_ = slowest < infinity ? period / looks_a_period : infinity;
  first_look_ =
      slowest < infinity ? longest_look_ / looks_a_period : flows_->dynamics().model().chatter_time;
}

// Mean and covariance, `now_`, go on from the motion's instant.
void TimingFilter::go_on(TimingState& state) {
  const Instant t = state.motion.t;
  const ContactSet all = closed(state);
  const ContactSet kept = state.motion.flow->locked() & all;
  enter(kept | independent_of(flows_->dynamics().G(), kept, all), t, state);
  ++state.instants;
  Covariance& S = slot(state.instants);
  S.instants = state.instants;
  S.columns = now_.columns;
  S.components = now_.components;
  S.weights = now_.weights;
  S.S_q.leftCols(S.columns) = now_.S_q.leftCols(S.columns);
  S.S_u.leftCols(S.columns) = now_.S_u.leftCols(S.columns);
  state.covariance_time = t;
  state.watched = 0.0;
  state.unknown = false;
  if (unknown_time_) state.expected_energy = energy_of_error();
  S.mean = state.motion;
  S.event = event_;
}

// The mean goes on from t with these contacts locked at g = 0.
void TimingFilter::enter(ContactSet locked, Instant t, TimingState& state) {
  const Flow* flow = flows_->find(locked);
  if (flow == nullptr) {
    ++state.refused_impacts;
    flow = &(*flows_)[0];
  }
  enter(*flow, t, state.motion);
  TickedFlight::set_anchor(state.motion, state.anchor);
}

// What is not known to fit the locked contacts moves by as little energy as it takes, so that what
// is expected of the error does not grow.
void TimingFilter::enter(const Flow& flow, Instant t, Motion& motion) {
  enter_motion(flow, t, motion);
  flow.close_gap_differences(now_.S_q.leftCols(now_.columns));
}

// The mean alone.
void TimingFilter::enter_motion(const Flow& flow, Instant t, Motion& motion) {
  on_flow_ = now_.q;
  flow.enter_closed(on_flow_, now_.u, t, motion);
}

void TimingFilter::tick(std::span<const ContactEvent> events, TimingState& state) {
  if (events.empty() && state.chi == 0) {
    ++state.tick;
    flight_.step(state.tick, state.motion, state.anchor);
    listen(tick_instant(state.tick, h_), state);
    return;
  }
  open_tick(state);
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) { take(of_one, state); });
  close_tick(state);
}

void TimingFilter::open_tick(TimingState& state) const {
  state.motion.t = tick_instant(state.tick, h_);
  ++state.tick;
}

void TimingFilter::take(std::span<const ContactEvent> of_one_instant, TimingState& state) {
  const Instant t = at(of_one_instant.front().t);
  // In one step from the last instant, so that roundings do not depend on the tick.
  const Covariance& last = slot(state.instants);
  const Motion& from = last.instants == state.instants ? last.mean : state.motion;
  from.flow->propagate(from, t, state.motion);
  listen(t, state);
  take_instant(of_one_instant, state);
}

void TimingFilter::close_tick(TimingState& state) {
  const Instant t = tick_instant(state.tick, h_);
  Motion& motion = state.motion;
  if (t - motion.t > 0.0) motion.flow->propagate(motion, t, motion);
  TickedFlight::set_anchor(motion, state.anchor);
  listen(t, state);
}

void TimingFilter::apply(std::span<const ContactEvent> events, TimingState& state) {
  take_instant(events, state);
}

void TimingFilter::follow(std::span<const ContactEvent> events, TimingState& state) {
  take(events, state);
}

void TimingFilter::output(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
                          Eigen::Ref<Eigen::VectorXd> u) {
  if (unknown_time_ && !state.unknown && publish(state)) {
    q = now_.q;
    u = now_.u;
  } else {
    state.motion.flow->state(state.motion, q, u);
  }
}

// The covariance of a state, moved to t. False where it is gone: as if nothing had been learnt.
bool TimingFilter::load(const TimingState& state, Instant t) {
  const Covariance& S = slot(state.instants);
  if (S.instants == state.instants) {
    load(S, t);
    return true;
  }
  last_published_ = {};
  set_start(uncertainty_, now_);
  columns_.move(*state.motion.flow, t - state.covariance_time, now_);
  return false;
}

void TimingFilter::load(const Covariance& from, Instant t) {
  last_published_ = {};
  const double tau = t - from.mean.t;
  now_.columns = from.columns;
  now_.components = from.components;
  now_.weights = from.weights;
  now_.S_q.leftCols(from.columns) = from.S_q.leftCols(from.columns);
  now_.S_u.leftCols(from.columns) = from.S_u.leftCols(from.columns);
  columns_.move(*from.mean.flow, tau, now_);
  if (tau > 0.0) add_drift(uncertainty_, tau, now_);
}

// Of each coordinate.
Terms TimingFilter::terms_of_mean(const TimingState& state) {
  state.motion.flow->state(state.motion, on_flow_, u_before_);
  return state.terms.of_coordinates(on_flow_, u_before_, largest_w_);
}

void TimingFilter::deviations(const TimingState& state, Eigen::Ref<Eigen::VectorXd> q,
                              Eigen::Ref<Eigen::VectorXd> u, Eigen::Ref<Eigen::VectorXd> gap) {
  if (!is_known(state)) {
    q.setConstant(infinity);
    u.setConstant(infinity);
    gap.setConstant(infinity);
    return;
  }
  if (!unknown_time_ || !publish(state)) load(state, tick_instant(state.tick, h_));
  const Eigen::Index c = now_.columns;
  const Terms terms = terms_of_mean(state);
  for (Eigen::Index i = 0; i < f(); ++i) {
    q[i] = std::hypot(now_.S_q.row(i).head(c).norm(), measurement_rounding * terms.length);
    u[i] = std::hypot(now_.S_u.row(i).head(c).norm(), measurement_rounding * terms.speed);
  }
  multiply(Wt_, now_.S_q.leftCols(c), seen_of_gaps_.leftCols(c));
  for (Eigen::Index i = 0; i < gap.size(); ++i) {
    gap[i] = std::hypot(seen_of_gaps_.row(i).head(c).norm(),
                        measurement_rounding * terms.length * largest_w_);
  }
}

void TimingFilter::output_deviations(const TimingState& state,
                                     Eigen::Ref<Eigen::VectorXd> outputs) {
  if (outputs.size() == 0) return;
  if (!is_known(state)) {
    outputs.setConstant(infinity);
    return;
  }
  if (!unknown_time_ || !publish(state)) load(state, tick_instant(state.tick, h_));
  const Terms terms = terms_of_mean(state);
  const std::vector<Output>& wanted = flows_->dynamics().model().outputs;
  for (Eigen::Index k = 0; k < outputs.size(); ++k) {
    const Output& of = wanted[static_cast<std::size_t>(k)];
    const Eigen::MatrixXd& S = of.velocity ? now_.S_u : now_.S_q;
    double variance = square(measurement_rounding * (of.velocity ? terms.speed : terms.length)) *
                      of.direction.squaredNorm();
    for (Eigen::Index j = 0; j < now_.columns; ++j) variance += square(of.direction.dot(S.col(j)));
    outputs[k] = std::sqrt(variance);
  }
}

TimingFilter::LastFlight TimingFilter::last_flight(int contact, const TimingState& state) {
  constexpr int samples = 64, near = 3;
  LastFlight flight;
  if (state.instants < 1) return flight;
  const Covariance& from = slot(state.instants - 1);
  if (from.instants != state.instants - 1 || from.mean.flow == nullptr ||
      contains(from.mean.flow->locked(), contact)) {
    return flight;
  }
  const double tau = state.covariance_time - from.mean.t;
  for (int i = 1; i <= samples + near; ++i) {
    from.mean.flow->propagate(from.mean, from.mean.t + tau * i / samples, sample_);
    const double gap = value(from.mean.flow->gap(contact), sample_);
    if (i >= samples - near && gap <= 0.0) flight.ends_near = true;
    if (i >= samples) continue;
    if (gap < 0.0) flight.inside += 1.0 / samples;
    flight.lowest = std::min(flight.lowest, gap);
    flight.highest = std::max(flight.highest, gap);
  }
  return flight;
}

bool TimingFilter::belief(const TimingState& state, double ahead, Belief& belief) {
  if (!is_known(state) || !remembers(state)) return false;
  load(state, tick_instant(state.tick, h_));
  state.motion.flow->state(state.motion, now_.q, now_.u);
  const Eigen::Index known = now_.columns;
  const Eigen::Index of_drift = uncertainty_.drift_q.cols() + uncertainty_.drift_u.cols();
  belief = {now_.q, now_.u, Eigen::MatrixXd::Zero(f(), known + of_drift + 2),
            Eigen::MatrixXd::Zero(f(), known + of_drift + 2), known};
  belief.S_q.leftCols(known) = now_.S_q.leftCols(known);
  belief.S_u.leftCols(known) = now_.S_u.leftCols(known);
  if (ahead > 0.0) add_drift(uncertainty_, ahead, belief);
  const Terms terms = terms_of_mean(state);
  belief.S_q.col(belief.columns++).setConstant(measurement_rounding * terms.length);
  belief.S_u.col(belief.columns++).setConstant(measurement_rounding * terms.speed);
  return is_sane(belief);
}

Eigen::MatrixXd TimingFilter::covariance(const TimingState& state) {
  if (!unknown_time_ || !publish(state)) load(state, tick_instant(state.tick, h_));
  Eigen::MatrixXd S(2 * f(), now_.columns);
  S << now_.S_q.leftCols(now_.columns), now_.S_u.leftCols(now_.columns);
  return product(S, S.transpose());
}

Confidence TimingFilter::no_confidence() const {
  Confidence confidence;
  confidence.has_filter = confidence.from_filter = true;
  confidence.sigma_q.setZero(f());
  confidence.sigma_u.setZero(f());
  confidence.sigma_g.setZero(flows_->dynamics().contacts());
  confidence.sigma_outputs.setZero(std::ssize(flows_->dynamics().model().outputs));
  return confidence;
}

void TimingFilter::confidence(const TimingState& state, double, Confidence& confidence) {
  note(state, confidence);
  deviations(state, confidence.sigma_q, confidence.sigma_u, confidence.sigma_g);
  output_deviations(state, confidence.sigma_outputs);
}

void TimingFilter::note(const TimingState& state, Confidence& confidence) const {
  confidence.remembered = remembers(state);
  confidence.forgotten = state.forgotten;
  confidence.filter = state.innovation;
  confidence.inconsistencies = state.silences + state.misfits;
  confidence.last = state.last;
  confidence.scale_is_lost = is_homogeneous_ && (state.unknown || !state.trusted);
  confidence.redundancy = state.redundancy;
  confidence.refused_impacts = state.refused_impacts;
}

}  // namespace sprag
