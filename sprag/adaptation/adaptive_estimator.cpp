#include "sprag/adaptation/adaptive_estimator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "sprag/estimation/innovation.h"
#include "sprag/estimation/uncertainty.h"
#include "sprag/mechanics/instant.h"
#include "sprag/mechanics/linear_algebra.h"

namespace sprag {
namespace {

constexpr std::size_t kept = 1024, kept_bytes = 64 << 20, fewest_kept = 64;
// A window that does not fit grows up to here, then it moves on.
constexpr std::int64_t longest_window = 160;

constexpr double far_inside = 0.05;
// Of the prior standard deviations after one failure before confirmation.
constexpr double least_inflation = 4.0, most_inflation = 1e4;
// Of the machine's own.
constexpr double most_energy = 0.25;

// Least jitter where parameters are uncertain, in periods of the slowest mode over 2 pi: nothing
// else forgives what is of third order in the parameters.
constexpr double least_jitter = 1e-6;
// Steps of a flight with a contact closed, which a tick has time for.
constexpr double longest_holding = 200.0;

// What a filter follows that knows one contact at a time. Times that jitter may fall together.
bool is_of_one_contact(std::span<const ContactEvent> of_one, ContactSet before) {
  const int contact = of_one.front().contact;
  return (before & ~bit(contact)) == 0 &&
         std::all_of(of_one.begin(), of_one.end(),
                     [&](const ContactEvent& event) { return event.contact == contact; });
}

std::shared_ptr<const std::vector<std::string>> keys_of(const std::vector<Unknown>& unknowns) {
  auto keys = std::make_shared<std::vector<std::string>>();
  for (const Unknown& unknown : unknowns) keys->push_back(unknown.key);
  return keys;
}

FilterModel model_of(const Scene& scene, const MachineFamily& family, bool from_prior) {
  FilterModel model;
  const Eigen::Index P = std::ssize(family.unknowns()), n = family.n();
  const Uncertainty uncertainty = uncertainty_of(scene);
  const Eigen::Index of_q = uncertainty.drift_q.cols(), of_u = uncertainty.drift_u.cols();
  const Eigen::MatrixXd to_y = product(family.V().transpose(), scene.model.M);
  model.drift.setZero(2 * n, of_q + of_u);
  if (of_q > 0) model.drift.topLeftCorner(n, of_q) = product(to_y, uncertainty.drift_q);
  if (of_u > 0) model.drift.bottomRightCorner(n, of_u) = product(to_y, uncertainty.drift_u);
  if (from_prior) {
    model.considered = scene.parameters.consider;
  } else {
    model.walk = walk_of(scene, P);
  }
  return model;
}

// Whether the filter is that of state and parameters, which is beside the replica.
bool starts_from_prior(const Scene& scene, EstimatorKind kind) {
  return (kind == EstimatorKind::timing || kind == EstimatorKind::both) &&
         !scene.parameters.empty();
}

EstimatorKind base_of(const Scene& scene, EstimatorKind kind) {
  return kind == EstimatorKind::adaptive || starts_from_prior(scene, kind) ? EstimatorKind::replica
                                                                           : kind;
}

// Twice the expected energy of columns of (y, y'), of modes with these stiffnesses.
template <typename Columns>
double twice_energy(const Columns& columns, const Eigen::VectorXd& stiffness) {
  const Eigen::Index n = stiffness.size();
  double sum = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    sum += columns.row(n + i).squaredNorm() + stiffness[i] * columns.row(i).squaredNorm();
  }
  return sum;
}

// Smallest of the modes' stiffnesses that is not 0, of rigid ones alone 1.
double slowest(const Eigen::VectorXd& stiffness) {
  double least = infinity;
  for (const double k : stiffness) {
    if (k > 0.0) least = std::min(least, k);
  }
  return least < infinity ? least : 1.0;
}

// `where`: the table or key of the scene that lists the unknowns.
const MachineFamily& require_modal(const MachineFamily& family, const std::string& where) {
  for (const Unknown& unknown : family.unknowns()) {
    if (is_common(unknown)) {
      throw ModelError(
          where + ": " + unknown.key +
          " stands for several numbers that differ; an adaptive estimator seeks them one by "
          "one");
    }
    if (can_be_filtered(unknown)) continue;
    throw ModelError(
        where + ": " + unknown.key +
        " is a single entry; an adaptive estimator seeks system.C and system.K as factors "
        "alone");
  }
  if (!family.modal()) {
    throw ModelError("system.C couples the modes of M and K; " +
                     std::string(where == "parameters" ? "[parameters]" : "an adaptive estimator") +
                     " needs damping that does not, as C = a M + b K");
  }
  if (family.unknowns().empty()) throw ModelError("adaptive estimation has nothing that is free");
  return family;
}

}  // namespace

static_assert(Estimator<AdaptiveEstimator>);

AdaptiveEstimator::Joint::Joint(const Scene& scene, std::vector<Unknown> unknowns, bool from_prior)
    : family(scene, std::move(unknowns)),
      filter(require_modal(family, from_prior ? "parameters" : "adapt.free"),
             model_of(scene, family, from_prior)),
      keys(keys_of(family.unknowns())) {
  const Eigen::Index n = family.n();
  const Uncertainty uncertainty = uncertainty_of(scene);
  to_y = product(family.V().transpose(), scene.model.M);
  V = family.V();
  outputs.setZero(2 * n, std::ssize(scene.model.outputs));
  for (Eigen::Index k = 0; k < outputs.cols(); ++k) {
    const Output& output = scene.model.outputs[static_cast<std::size_t>(k)];
    outputs.col(k).segment(output.velocity ? n : 0, n) = V.transpose() * output.direction;
  }
  stiffness = family.at(family.nominal()).K;
  sigma = std::max(scene.jitter, least_jitter / std::sqrt(slowest(stiffness)));
  start.setZero(2 * n, 2 * n);
  start.topLeftCorner(n, n) = product(to_y, uncertainty.q);
  start.bottomRightCorner(n, n) = product(to_y, uncertainty.u);
  inflated = start;
  if (from_prior) {
    prior = scene.parameters.root_of_covariance();
    for (Eigen::Index k = 0; k < prior.rows(); ++k) {
      const Unknown& unknown = family.unknowns()[static_cast<std::size_t>(k)];
      prior.row(k) /= unknown.slope(unknown.nominal);
    }
  }
  next = filter.no_belief();
  const std::size_t bytes = sizeof(double) * static_cast<std::size_t>(next.S.size());
  beliefs.resize(std::clamp(kept_bytes / bytes, fewest_kept, kept), Belief{-1, next});
  // Those of a task, and as many again of states that run ahead.
  heard.resize(2 * static_cast<std::size_t>(most_events));
  q.setZero(n);
  u.setZero(n);
  x.setZero(2 * n);
  of_gaps.setZero(family.contacts(), filter.most_columns());
  row.setZero(filter.most_columns());
}

AdaptiveEstimator::AdaptiveEstimator(const Scene& scene, double h, EstimatorKind kind,
                                     StepperKind stepper)
    : base_(scene, h, base_of(scene, kind), stepper) {
  if (kind == EstimatorKind::adaptive) {
    joint_ = std::make_unique<Joint>(scene, unknowns_to_adapt(scene), false);
  } else if (starts_from_prior(scene, kind)) {
    joint_ = std::make_unique<Joint>(scene, unknowns_named(scene, scene.parameters.keys), true);
  }
}

std::size_t AdaptiveEstimator::most_ahead() const {
  const auto events = static_cast<std::size_t>(most_events);
  return joint_ ? std::min(joint_->beliefs.size() - 1, events) : events;
}

// As many impacts as the search's first grid takes, and some to judge it by.
std::int64_t AdaptiveEstimator::first_size() const {
  const auto n = static_cast<std::int64_t>(joint_->family.n());
  const auto unknowns = static_cast<std::int64_t>(joint_->family.unknowns().size());
  return std::max(6 * n + 6, 2 * n + unknowns + 8);
}

void AdaptiveEstimator::start(const sprag::State& start, std::int64_t k, ContactSet chi,
                              AdaptiveState& state) {
  base_.start(start, k, chi, state.base);
  AnyEstimator::State base = std::move(state.base);
  state = {};
  state.base = std::move(base);
  state.tick = k;
  state.chi = chi;
  state.closed = chi;
  state.begins = tick_instant(k, h()).hi;
  if (joint_) state.size = first_size();
  if (has_prior()) start_from_prior(start, state);
}

void AdaptiveEstimator::note_start(const FilterBelief& of) {
  if (runs_ != nullptr) runs_->push_back({of, {}, {}});
}

void AdaptiveEstimator::note_event(const ContactEvent& event, double sigma) {
  if (runs_ == nullptr || runs_->empty()) return;
  runs_->back().events.push_back(event);
  runs_->back().sigmas.push_back(sigma);
}

void AdaptiveEstimator::set_prior(FilterBelief& belief) const {
  const Eigen::Index P = joint_->prior.rows(), n2 = 2 * joint_->family.n();
  for (Eigen::Index k = 0; k < P; ++k) {
    const Unknown& unknown = joint_->family.unknowns()[static_cast<std::size_t>(k)];
    belief.z[n2 + k] = unknown.coordinate(unknown.nominal);
  }
  belief.S.bottomRows(P).setZero();
  belief.S.rightCols(P).setZero();
  belief.S.bottomRightCorner(P, P) = joint_->prior;
}

void AdaptiveEstimator::start_from_prior(const sprag::State& start, AdaptiveState& state) {
  Joint& joint = *joint_;
  joint.next = joint.filter.no_belief();
  joint.next.sigma = joint.sigma;
  set_prior(joint.next);
  const Eigen::Index n = joint.family.n();
  joint.x.head(n) = product(joint.to_y, start.q);
  joint.x.tail(n) = product(joint.to_y, start.u);
  joint.filter.restart(state.begins, joint.x, joint.start, joint.next);
  add_belief(joint.next, state);
  note_start(joint.next);
  state.adapted = true;
  state.accepted = state.begins;
  state.lost = state.chi != 0;
  state.trusted = !state.lost;
}

void AdaptiveEstimator::tick(std::span<const ContactEvent> events, AdaptiveState& state) {
  if (joint_ && state.wanted && has_result(state)) take_result(state);
  const ContactSet before = state.chi;
  recorded_ = records_ != nullptr ? records_->size() : 0;
  base_.tick(events, state.base);
  state.tick = state.base.tick;
  state.chi = state.base.chi;
  if (joint_) hear(events, before, state);
}

std::int64_t AdaptiveEstimator::coast(std::int64_t n, AdaptiveState& state) {
  if (joint_) return 0;
  const std::int64_t taken = base_.coast(n, state.base);
  state.tick = state.base.tick;
  return taken;
}

void AdaptiveEstimator::apply(std::span<const ContactEvent> events, AdaptiveState& state) {
  const ContactSet before = state.chi;
  recorded_ = records_ != nullptr ? records_->size() : 0;
  base_.apply(events, state.base);
  state.chi = state.base.chi;
  if (joint_) hear(events, before, state);
}

// What has happened up to the present tick.
void AdaptiveEstimator::hear(std::span<const ContactEvent> events, ContactSet chi,
                             AdaptiveState& state) {
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
    const bool single = is_of_one_contact(of_one, chi);
    // A start may be a little behind the first event that it knows.
    if (state.events == 0) state.begins = std::min(state.begins, of_one.front().t);
    for (const ContactEvent& event : of_one) {
      const double before = state.events > 0 ? heard(state.events - 1).event.t : state.begins;
      heard(state.events) = {event, chi, before};
      ++state.events;
      chi = after(chi, event);
    }
    if (!state.adapted || state.lost) return;
    if (!single) lose(state);
    for (const ContactEvent& event : of_one) {
      const std::int64_t number = state.beliefs;
      if (!state.lost) take(event, state);
      if (number != state.beliefs) note_event(event, belief(state.beliefs).of.sigma);
      if (records_ == nullptr || number == state.beliefs || !state.trusted) continue;
      const auto row = recorded_ + static_cast<std::size_t>(&event - events.data());
      describe(number, event, state, (*records_)[row]);
    }
  });
  if (state.events - state.window > most_events) begin_window(state.events - most_events, state);
  watch(state);
  if (state.adapted && state.lost && state.chi == 0) restart_filter(state);
  if (!identifies()) return;
  if (!state.adapted && state.events - state.window >= state.size) state.wanted = true;
}

bool AdaptiveEstimator::record_in(std::vector<ImpactRecord>& records) {
  if (!base_.record_in(records)) return false;
  if (joint_) records_ = &records;
  return true;
}

// What the filter says of an event that has led it from this belief to the present one.
void AdaptiveEstimator::describe(std::int64_t before, const ContactEvent& event,
                                 const AdaptiveState& state, ImpactRecord& record) {
  const Belief& from = belief(before);
  if (from.number != before || event.kind == ContactEventKind::opens) return;
  const FilterBelief& of = belief(state.beliefs).of;
  if (of.impact_sigma > 0.0) {
    record.time = {of.impact_time, of.impact_sigma};
  } else {
    record.time = {of.occurred[event.contact], of.sigma};
  }
  record.before = {of.speed_before, of.speed_before_sigma};
  record.after = {of.speed_after, of.speed_after_sigma};
  const double G = base_.flows()->dynamics().G()(event.contact, event.contact);
  record.impulse.value = (of.speed_after - of.speed_before) / G;
  // Both speeds have one sign of error.
  record.impulse.sigma = (of.speed_after_sigma + of.speed_before_sigma) / G;
  record.from_filter = true;
}

// Against the energy of the replica, which is about the machine's.
bool AdaptiveEstimator::is_sure(const FilterBelief& belief, const AdaptiveState& state) {
  Joint& joint = *joint_;
  find_replica(state);
  return twice_energy(belief.S, joint.stiffness) <
         most_energy * twice_energy(joint.x, joint.stiffness);
}

// (y, y') of the replica at the present tick.
void AdaptiveEstimator::find_replica(const AdaptiveState& state) {
  Joint& joint = *joint_;
  base_.output(state.base, joint.q, joint.u);
  joint.x.head(joint.q.size()).noalias() = joint.to_y.lazyProduct(joint.q);
  joint.x.tail(joint.u.size()).noalias() = joint.to_y.lazyProduct(joint.u);
}

void AdaptiveEstimator::lose(AdaptiveState& state) {
  state.lost = true;
  state.trusted = false;
  state.doubts = false;
  state.fitting = 0;
  state.mean_square = 1.0;
}

// An event of one contact, with no other closed.
void AdaptiveEstimator::take(const ContactEvent& event, AdaptiveState& state) {
  const Belief& present = belief(state.beliefs);
  if (present.number != state.beliefs) return lose(state);
  FilterBelief& next = joint_->next;
  next = present.of;
  EventFilter& filter = joint_->filter;
  const bool stays = event.kind == ContactEventKind::closes;
  if (next.held >= 0 && next.held != event.contact) return lose(state);
  const bool taken = filter.take(event, next);
  const double mean = state.mean_square + (next.square - state.mean_square) / innovation_window;
  if (!taken || !(next.square < largest_innovation) || !(mean < largest_mean_innovation)) {
    const Suspicion suspicion = next.innovation.gap > far_inside * next.length
                                    ? Suspicion::spurious_event
                                    : Suspicion::model;
    const Inconsistency inconsistency{event.t, event.contact, suspicion, next.square};
    if (suspicion == Suspicion::spurious_event && !stays && may_doubt(state)) {
      return doubt(inconsistency, state);
    }
    return fail(inconsistency, state);
  }
  state.mean_square = mean;
  state.doubts = false;
  add_belief(next, state);
  ++state.fitting;
  if (state.fitting < trial() || !is_sure(next, state)) return;
  state.trusted = true;
  state.inflation = 1.0;
}

// Events that determine the state, and a few more.
std::int64_t AdaptiveEstimator::trial() const {
  return 2 * static_cast<std::int64_t>(joint_->family.n()) + Probation::shortest;
}

// One event that was none, or one that was lost, is no reason to give up what is known; the next
// one must fit.
bool AdaptiveEstimator::may_doubt(const AdaptiveState& state) {
  return state.trusted && !state.doubts;
}

void AdaptiveEstimator::doubt(const Inconsistency& inconsistency, AdaptiveState& state) {
  state.doubts = true;
  ++state.inconsistencies;
  state.last = inconsistency;
}

// An impact of which nothing was heard, where the gap fell through zero.
bool AdaptiveEstimator::take_lost(int contact, double t, AdaptiveState& state) {
  Joint& joint = *joint_;
  const FilterBelief& present = belief(state.beliefs).of;
  const auto gap_at = [&](double when) {
    joint.filter.mean(when, present);
    return joint.filter.gap(contact);
  };
  constexpr int looks = 64, halvings = 40;
  const double step = (t - present.t) / looks;
  double inside = t, outside = t;
  for (int i = 1; i < looks && outside == t; ++i) {
    if (gap_at(t - i * step) < 0.0) {
      inside = t - i * step;
    } else {
      outside = t - i * step;
    }
  }
  if (outside == t) return false;
  for (int i = 0; i < halvings; ++i) {
    const double middle = 0.5 * (outside + inside);
    (gap_at(middle) < 0.0 ? inside : outside) = middle;
  }
  joint.next = present;
  // Its time is as uncertain as the flight makes it.
  joint.next.sigma = t - present.t;
  joint.next.reported[contact] = -infinity;
  if (!joint.filter.take({inside, contact, ContactEventKind::pulse}, joint.next)) return false;
  note_event({inside, contact, ContactEventKind::pulse}, joint.next.sigma);
  joint.next.sigma = present.sigma;
  add_belief(joint.next, state);
  return true;
}

void AdaptiveEstimator::fail(const Inconsistency& inconsistency, AdaptiveState& state) {
  const bool confirmed = state.fitting >= trial();
  const bool believed = state.trusted && (confirmed || !has_prior());
  ++state.inconsistencies;
  state.last = inconsistency;
  if (!confirmed) {
    state.inflation *= std::clamp(std::sqrt(inconsistency.square), least_inflation, most_inflation);
    if (runs_ != nullptr && !runs_->empty()) runs_->back().failed = true;
  }
  lose(state);
  if (believed) {
    // If the parameters are to blame, it is from here on.
    begin_window(std::max<std::int64_t>(state.events - 1, 0), state);
  } else if (has_prior()) {
    FilterBelief& next = joint_->next;
    next = belief(state.beliefs).of;
    set_prior(next);
    add_belief(next, state);
  } else {
    state.adapted = false;
    state.accepted = -1.0;
  }
}

void AdaptiveEstimator::begin_window(std::int64_t event, AdaptiveState& state) const {
  state.window = event;
  state.size = first_size();
  if (event >= state.events) return;
  state.begins = heard(event).before;
  state.closed = heard(event).chi_before;
}

// An event has not come that had to.
void AdaptiveEstimator::watch(AdaptiveState& state) {
  if (!state.adapted || state.lost) return;
  const Belief& present = belief(state.beliefs);
  if (present.number != state.beliefs) {
    lose(state);
    return;
  }
  const double t = tick_instant(state.tick, h()).hi;
  // A flight that has been held for long costs too much.
  if (joint_->filter.cost(t, present.of) > longest_holding) {
    lose(state);
    return;
  }
  if (!state.trusted) return;
  const int contact = joint_->filter.overdue(t, present.of);
  if (contact < 0) return;
  const Inconsistency inconsistency{t, contact, Suspicion::missing_event, 0.0};
  if (may_doubt(state) && take_lost(contact, t, state)) {
    doubt(inconsistency, state);
  } else {
    fail(inconsistency, state);
  }
}

void AdaptiveEstimator::restart_filter(AdaptiveState& state) {
  const Belief& present = belief(state.beliefs);
  Joint& joint = *joint_;
  if (present.number != state.beliefs) {
    state.adapted = false;
    return;
  }
  find_replica(state);
  joint.next = present.of;
  // At most as uncertain as the replica's motion is large.
  const double own = twice_energy(joint.x, joint.stiffness);
  const double of_start = twice_energy(joint.start, joint.stiffness);
  const double most = of_start > 0.0 ? std::sqrt(std::max(own / of_start, 1.0)) : 1.0;
  state.inflation = std::min(state.inflation, most);
  joint.inflated = state.inflation * joint.start;
  joint.filter.restart(tick_instant(state.tick, h()).hi, joint.x, joint.inflated, joint.next);
  add_belief(joint.next, state);
  note_start(joint.next);
  state.lost = false;
}

void AdaptiveEstimator::add_belief(const FilterBelief& of, AdaptiveState& state) {
  ++state.beliefs;
  Belief& next = belief(state.beliefs);
  next.of = of;
  next.number = state.beliefs;
}

bool AdaptiveEstimator::waits(const AdaptiveState& state) const {
  return identifies() && state.wanted && !has_result(state);
}

bool AdaptiveEstimator::has_result(const AdaptiveState& state) const {
  if (result_ == nullptr) return false;
  const AdaptationTask& task = result_->task;
  if (task.number != state.events || task.closed != state.closed || task.begins != state.begins ||
      static_cast<std::int64_t>(task.events.size()) != state.events - state.window) {
    return false;
  }
  for (std::size_t i = 0; i < task.events.size(); ++i) {
    if (!(heard(state.window + static_cast<std::int64_t>(i)).event == task.events[i])) return false;
  }
  return true;
}

void AdaptiveEstimator::wanted(const AdaptiveState& state, AdaptationTask& task) const {
  task.number = state.events;
  task.begins = state.begins;
  task.closed = state.closed;
  task.events.clear();
  for (std::int64_t i = state.window; i < state.events; ++i) task.events.push_back(heard(i).event);
}

void AdaptiveEstimator::take_result(AdaptiveState& state) {
  state.wanted = false;
  ++state.identifications;
  const std::int64_t first = first_size();
  if (!result_->accepted || !is_sure(result_->belief, state)) {
    state.size += state.size / 2;
    if (state.size > longest_window) {
      begin_window(state.events - 2 * first, state);
      state.size = 3 * first;
    }
    return;
  }
  lose(state);
  add_belief(result_->belief, state);
  state.adapted = true;
  state.accepted = tick_instant(state.tick, h()).hi;
  if (!result_->state_is_known || state.chi != 0) return;
  state.lost = false;
  state.trusted = true;
  state.fitting = trial();
}

void AdaptiveEstimator::output(const AdaptiveState& state, Eigen::Ref<Eigen::VectorXd> q,
                               Eigen::Ref<Eigen::VectorXd> u) {
  if (!joint_ || !state.trusted) {
    base_.output(state.base, q, u);
    return;
  }
  publish(tick_instant(state.tick, h()).hi, belief(state.beliefs).of, q, u);
}

void AdaptiveEstimator::publish(double t, const FilterBelief& of, Eigen::Ref<Eigen::VectorXd> q,
                                Eigen::Ref<Eigen::VectorXd> u) {
  const Eigen::Index n = joint_->family.n();
  const Eigen::VectorXd& x = joint_->filter.publish(t, of);
  q.noalias() = joint_->V.lazyProduct(x.head(n));
  u.noalias() = joint_->V.lazyProduct(x.tail(n));
}

Confidence AdaptiveEstimator::no_confidence() const {
  Confidence confidence = base_.no_confidence();
  if (!joint_) return confidence;
  confidence.has_filter = true;
  confidence.sigma_q.setConstant(joint_->family.n(), infinity);
  confidence.sigma_u = confidence.sigma_q;
  confidence.sigma_g.setConstant(joint_->family.contacts(), infinity);
  confidence.sigma_outputs.setConstant(joint_->outputs.cols(), infinity);
  confidence.parameters.keys = joint_->keys;
  confidence.parameters.values = joint_->family.nominal();
  confidence.parameters.sigmas.setConstant(confidence.parameters.values.size(), infinity);
  return confidence;
}

void AdaptiveEstimator::note(const AdaptiveState& state, Confidence& confidence) const {
  base_.note(state.base, confidence);
  if (!joint_) return;
  const Belief& present = belief(state.beliefs);
  confidence.from_filter = state.trusted;
  confidence.filter = {};
  if (state.adapted && !state.lost && present.number == state.beliefs) {
    confidence.filter = present.of.innovation;
  }
  confidence.inconsistencies = state.inconsistencies;
  confidence.last = state.last;
  confidence.parameters.accepted = state.accepted;
  confidence.parameters.identifications = state.identifications;
  confidence.parameters.known = state.adapted ? present.of.t : -1.0;
}

void AdaptiveEstimator::confidence(const AdaptiveState& state, double initial,
                                   Confidence& confidence) {
  base_.confidence(state.base, initial, confidence);
  note(state, confidence);
  if (!joint_) return;
  Joint& joint = *joint_;
  const Eigen::Index n = joint.family.n();
  const double t = tick_instant(state.tick, h()).hi;
  const FilterBelief& present = belief(state.beliefs).of;
  if (state.trusted) {
    joint.filter.publish(t, present);
    fill_deviations(present, confidence);
  } else {
    confidence.sigma_q.setConstant(infinity);
    confidence.sigma_u.setConstant(infinity);
    confidence.sigma_g.setConstant(infinity);
    confidence.sigma_outputs.setConstant(infinity);
  }
  ParameterEstimates& parameters = confidence.parameters;
  const std::vector<Unknown>& unknowns = joint.family.unknowns();
  for (Eigen::Index k = 0; k < parameters.values.size(); ++k) {
    const Unknown& unknown = unknowns[static_cast<std::size_t>(k)];
    if (!state.adapted) {
      parameters.values[k] = unknown.nominal;
      parameters.sigmas[k] = infinity;
      continue;
    }
    parameters.values[k] = unknown.value(present.z[2 * n + k]);
    const Eigen::VectorXd& walk = joint.filter.model().walk;
    const double walked = walk.size() > 0 ? square(walk[k]) * std::max(t - present.t, 0.0) : 0.0;
    const double variance = present.S.row(2 * n + k).squaredNorm() + walked;
    parameters.sigmas[k] = std::sqrt(variance) * std::abs(unknown.slope(parameters.values[k]));
  }
}

void AdaptiveEstimator::fill_deviations(const FilterBelief& of, Confidence& confidence) {
  Joint& joint = *joint_;
  const Eigen::Index n = joint.family.n();
  const auto of_x = joint.filter.deviations();
  joint.filter.gap_deviations(of, joint.of_gaps);
  for (Eigen::Index i = 0; i < n; ++i) {
    joint.row.noalias() = joint.V.row(i).lazyProduct(of_x.topRows(n));
    confidence.sigma_q[i] = joint.row.norm();
    joint.row.noalias() = joint.V.row(i).lazyProduct(of_x.bottomRows(n));
    confidence.sigma_u[i] = joint.row.norm();
  }
  for (Eigen::Index i = 0; i < joint.of_gaps.rows(); ++i) {
    confidence.sigma_g[i] = joint.of_gaps.row(i).norm();
  }
  for (Eigen::Index i = 0; i < joint.outputs.cols(); ++i) {
    joint.row.noalias() = joint.outputs.col(i).transpose().lazyProduct(of_x);
    confidence.sigma_outputs[i] = joint.row.norm();
  }
}

bool identify_now(AdaptiveEstimator& estimator, const AdaptiveState& state,
                  AdaptationResult& result) {
  if (!estimator.waits(state)) return false;
  AdaptationTask task;
  estimator.wanted(state, task);
  result = run(task, *estimator.family());
  estimator.put(result);
  return true;
}

Prediction AdaptiveEstimator::predict(const AdaptiveState& state, const Predictor& predictor,
                                      double ahead) {
  const double t = tick_instant(state.tick, h()).hi;
  sprag::Belief from;
  if (!joint_) {
    if (!base_.belief(state.base, ahead, from)) return {t, t, {}};
    return predictor.predict(t, state.chi, from, ahead);
  }
  if (!has_prior() || !state.trusted) return {t, t, {}};
  Joint& joint = *joint_;
  const MachineFamily& family = joint.family;
  const Eigen::Index n = family.n(), P = std::ssize(family.unknowns());
  const FilterBelief& of = belief(state.beliefs).of;
  const Eigen::VectorXd x = joint.filter.mean(t, of);
  // As many columns as state and parameters have entries.
  Eigen::MatrixXd columns(2 * n + P, joint.filter.most_columns());
  columns << joint.filter.deviations(), joint.filter.parameter_deviations();
  const Eigen::MatrixXd S = QR(columns.transpose()).R().transpose();
  from.q = joint.V * x.head(n);
  from.u = joint.V * x.tail(n);
  from.columns = S.cols();
  from.S_q = joint.V * S.topRows(n);
  from.S_u = joint.V * S.middleRows(n, n);
  const Eigen::VectorXd c = of.z.tail(P);
  return predictor.predict(t, state.chi, from, ahead, [&](const Eigen::VectorXd& xi) {
    const Eigen::VectorXd at = c + S.bottomRows(P) * xi;
    Eigen::VectorXd values(P);
    for (Eigen::Index k = 0; k < P; ++k) {
      values[k] = family.unknowns()[static_cast<std::size_t>(k)].value(at[k]);
    }
    return std::make_shared<const Flows>(family.with(values).model);
  });
}

}  // namespace sprag
