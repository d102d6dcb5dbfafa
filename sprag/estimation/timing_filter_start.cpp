// Where the timing filter starts, and starts again: how sure it is of a start, and whether it is
// believed behind one.
#include <algorithm>
#include <cmath>

#include "sprag/estimation/innovation.h"
#include "sprag/estimation/timing_filter.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// A restart takes this multiple of the squares by which two estimates differ, and not nothing.
constexpr double reserve = 4.0;
constexpr double least_share = 1e-12;
// A start was too sure where one of so many events behind it did not fit. Of what comes later it is
// not at fault.
constexpr std::int64_t at_once = 2;

}  // namespace

void TimingFilter::start(const sprag::State& start, std::int64_t k, ContactSet chi,
                         TimingState& state) {
  state.tick = k;
  state.chi = chi;
  state.instants = -1;
  state.inside = state.touched = 0;
  state.redundancy = {};
  state.refused_impacts = 0;
  state.ambiguous_impacts = 0;
  state.misfits = state.silences = state.forgotten = 0;
  state.unknown = state.began_again = false;
  state.trusted = true;
  state.probation = {};
  state.widened = 1.0;
  state.fitted = 0;
  state.last = {};
  state.innovation = {};
  state.consistency = {};
  state.terms = {};
  for (const Contact& contact : flows_->dynamics().model().contacts) {
    state.terms.include(contact, start.q, start.u);
  }
  state.last_report.setConstant(flows_->dynamics().contacts(), -infinity);
  state.bursts.setZero(flows_->dynamics().contacts());
  event_ = {};
  last_published_ = {};
  if (recorder_ != nullptr) recorder_->start();
  start_ = start;
  forget(state);
  state.motion.flow = &(*flows_)[0];
  state.motion.t = tick_instant(k, h_);
  go_on(state);
}

void TimingFilter::restart(const Eigen::Ref<const Eigen::VectorXd>& q,
                           const Eigen::Ref<const Eigen::VectorXd>& u,
                           std::optional<std::int64_t> believed, double more, double most,
                           TimingState& state) {
  const Instant t = state.motion.t;
  last_published_ = {};
  share_.setConstant(std::min(more, most));
  if (believed && slot(*believed).instants == *believed) {
    const Covariance& from = slot(*believed);
    load(from, t);
    from.mean.flow->propagate(from.mean, t, sample_);
    sample_.flow->state(sample_, now_.q, now_.u);
    off_q_ = q - now_.q;
    off_u_ = u - now_.u;
    for (Eigen::Index i = 0; i < f(); ++i) {
      // In terms of the mode's deviations at a start.
      const auto of_q = from_start_q_.row(i);
      const auto of_u = from_start_u_.row(i);
      const double apart = square(of_q.dot(off_q_)) + square(of_u.dot(off_u_));
      double unsure = 0.0;
      for (Eigen::Index j = 0; j < now_.columns; ++j) {
        unsure += square(of_q.dot(now_.S_q.col(j))) + square(of_u.dot(now_.S_u.col(j)));
      }
      share_[i] = std::clamp(more * 0.5 * std::max(unsure, reserve * apart), least_share, most);
    }
  }
  state.widened = 1.0;
  forget(state);
  for (Eigen::Index i = 0; i < f(); ++i) {
    now_.S_q.col(i) *= std::sqrt(share_[i]);
    now_.S_u.col(f() + i) *= std::sqrt(share_[i]);
  }
  now_.q = q;
  now_.u = u;
  state.consistency = {};
  state.trusted = true;
  event_ = {};
  go_on(state);
}

// As if the machine were started now; of events no more is known than what was reported.
void TimingFilter::forget(TimingState& state) {
  now_.q = start_.q;
  now_.u = start_.u;
  set_start(uncertainty_, now_);
  now_.S_q.leftCols(now_.columns) *= state.widened;
  now_.S_u.leftCols(now_.columns) *= state.widened;
  state.log_left = 0.0;
  state.thrown = 0;
  state.last_time = state.last_report;
  state.last_deviation.setConstant(state.last_report.size(), uncertainty_.jitter);
}

// Where what came at once behind a start did not fit, that was told to be too sure: the next one is
// less, as long as its deviations are below what the machine moves by from one end to the other.
void TimingFilter::widen_start(TimingState& state) const {
  if (state.consistency.count > at_once) {
    state.widened = std::max(state.widened / start_widening, 1.0);
    return;
  }
  const auto is_narrow = [&](const Eigen::VectorXd& told, double terms) {
    return std::ranges::any_of(
        told, [&](double sigma) { return 0.0 < sigma && state.widened * sigma < 2.0 * terms; });
  };
  if (is_narrow(start_gaps_, state.terms.length) || is_narrow(start_speeds_, state.terms.speed)) {
    state.widened *= start_widening;
  }
}

// Behind events that did not fit at all. No event fits less than one after which nothing is known.
void TimingFilter::begin_again(TimingState& state) {
  widen_start(state);
  forget(state);
  const double largest = state.consistency.is_lost() ? state.consistency.largest : infinity;
  state.consistency = {};
  state.consistency.largest = largest;
  event_ = {};
}

// By what these events say, of which so many have been measured.
void TimingFilter::judge(std::span<const ContactEvent> events, std::int64_t measured,
                         TimingState& state) const {
  const bool fits = state.consistency.fits();
  if (fits && !state.began_again) {
    state.fitted += measured;
    // How large the motion of a homogeneous machine is, nothing but its start tells.
    if (state.probation.pass(state.fitted, f()) && !is_homogeneous_) {
      state.trusted = true;
      state.widened = 1.0;
    }
    return;
  }
  // On probation, too, where events had fitted since.
  if (!fits && (state.trusted || state.consistency.is_lost() || state.fitted > 0)) {
    ++state.misfits;
    state.last = {state.motion.t.hi, events.back().contact, Suspicion::model,
                  state.consistency.largest};
  }
  if (!fits && state.trusted) state.probation.fail();
  state.fitted = 0;
  state.trusted = false;
}

}  // namespace sprag
