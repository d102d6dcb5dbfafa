#include "sprag/estimation/smoother.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "sprag/estimation/event_mixture.h"
#include "sprag/estimation/timing_filter.h"
#include "sprag/mechanics/interrupt.h"
#include "sprag/mechanics/linear_algebra.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

constexpr double order_is_certain = 8.0;  // jitters between impacts of two contacts
constexpr double first_spacing = 1.0;     // and, to begin with, between two of one
constexpr double longest_step = 2.0;      // jitters by which an impact moves at once
constexpr int most_iterations = 60;
// Full steps may swing to and fro where an impact grazes; half ones then do not.
constexpr int full_steps = 6;
constexpr double settled_times = 0.05;  // of their deviations
constexpr double time_rounding_of_path = 64.0 * std::numeric_limits<double>::epsilon();
constexpr double still_uncertain = 5.0;  // deviations of an impact's time
constexpr double largest_misfit = 4.0;
constexpr int looks_a_flight = 16;
constexpr double deviations_inside = 7.0;
// Beside those that determine the state: fewer may have more than one path.
constexpr Eigen::Index events_to_tell = 8;
// Roundings of a path add up.
constexpr double rounding_of_path = 16.0 * measurement_rounding;
constexpr double rounding_of_variance = 4096.0 * std::numeric_limits<double>::epsilon();

// Times between which a filter has to do.
struct Obscure {
  double from, to;
  std::size_t first, end;  // events
};

// Where contacts are closed or nearer to each other in time than their order is certain.
std::vector<Obscure> obscure_times(std::span<const ContactEvent> events, double apart) {
  std::vector<Obscure> all;
  ContactSet closed = 0;
  for (std::size_t i = 0; i < events.size(); ++i) {
    const bool near = i > 0 && events[i].t - events[i - 1].t < apart;
    const bool held = closed != 0 || events[i].kind != ContactEventKind::pulse;
    closed = after(closed, events[i]);
    if (!near && !held) continue;
    const std::size_t first = near ? i - 1 : i;
    if (!all.empty() && all.back().end >= first) {
      all.back().end = i + 1;
    } else {
      all.push_back({0.0, 0.0, first, i + 1});
    }
  }
  for (Obscure& of : all) {
    of.from = events[of.first].t - 0.5 * apart;
    of.to = events[of.end - 1].t + apart;
  }
  return all;
}

}  // namespace

Smoother::Smoother(const Scene& scene)
    : scene_(&scene),
      flows_(std::make_shared<Flows>(scene.model)),
      uncertainty_(uncertainty_of(scene)) {
  if (!(scene.jitter > 0.0)) {
    throw SmoothingError(
        "the scene's event times are exact, and a filter knows the state after a few of them; give "
        "[events] jitter");
  }
  if (is_homogeneous(scene.model)) {
    throw SmoothingError(
        "the events of this machine do not tell how large its motion is: nothing but its own state "
        "moves it");
  }
  const Eigen::Index f = scene.model.coordinates();
  const Eigen::Index columns = 12 * f + 8;
  columns_ = BeliefColumns((*flows_)[0], f, columns);
  const auto make_room = [&](Belief& belief) {
    belief.q.setZero(f);
    belief.u.setZero(f);
    belief.S_q.setZero(f, columns);
    belief.S_u.setZero(f, columns);
  };
  make_room(start_);
  make_room(unit_);
  make_room(here_);
  MinvC_ = CholeskyFactor(scene.model.M).solve(scene.model.C);
  start();
}

void Smoother::start() {
  begins_ = 0.0;
  impacts_.clear();
  start_.q = scene_->replica.q;
  start_.u = scene_->replica.u;
  set_start(uncertainty_, start_);
}

void Smoother::start(double t, const Eigen::VectorXd& q, const Eigen::VectorXd& u,
                     const Eigen::MatrixXd& covariance) {
  const Eigen::Index f = q.size();
  begins_ = t;
  impacts_.clear();
  start_.q = q;
  start_.u = u;
  start_.columns = 2 * f;
  // q and u are of different units: by their deviations first.
  const Eigen::VectorXd scale =
      covariance.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt();
  const Eigen::MatrixXd correlation =
      scale.cwiseInverse().asDiagonal() * covariance * scale.cwiseInverse().asDiagonal();
  const ExtendedEigenpairs pairs = eigenpairs(correlation.cast<Extended>());
  const Eigen::MatrixXd S = scale.asDiagonal() * pairs.vectors.cast<double>() *
                            pairs.values.cast<double>().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  start_.S_q.leftCols(2 * f) = S.topRows(f);
  start_.S_u.leftCols(2 * f) = S.bottomRows(f);
}

// The columns of the flight's transition matrix.
Eigen::MatrixXd Smoother::transition(double tau) {
  const Eigen::Index f = start_.q.size();
  unit_.columns = 2 * f;
  unit_.S_q.setZero();
  unit_.S_u.setZero();
  unit_.S_q.leftCols(f).setIdentity();
  unit_.S_u.middleCols(f, f).setIdentity();
  columns_.move((*flows_)[0], tau, unit_);
  Eigen::MatrixXd Phi(2 * f, 2 * f);
  Phi << unit_.S_q.leftCols(2 * f), unit_.S_u.leftCols(2 * f);
  return Phi;
}

// The columns alone; the mean is moved with the motion.
void Smoother::fly(double tau, Belief& belief) {
  columns_.merge(belief);
  columns_.move((*flows_)[0], tau, belief);
  if (tau > 0.0) add_drift(uncertainty_, tau, belief);
}

void Smoother::take(std::span<const ContactEvent> events) {
  impacts_.clear();
  double last = -infinity;
  for (const ContactEvent& event : events) {
    const std::string when = " at t = " + std::to_string(event.t);
    if (event.kind != ContactEventKind::pulse) {
      throw SmoothingError("contact " + std::to_string(event.contact + 1) + " stays closed" + when +
                           ": only impacts are smoothed");
    }
    const bool same = !impacts_.empty() && impacts_.back().event.contact == event.contact;
    if (!same && event.t - last < order_is_certain * scene_->jitter) {
      throw SmoothingError("the impact" + when +
                           " and the one before it, of another contact, are nearer than 8 jitters: "
                           "their order is not certain");
    }
    impacts_.emplace_back();
    impacts_.back().event = event;
    impacts_.back().s = last = std::max(event.t, last + first_spacing * scene_->jitter);
  }
  if (impacts_.empty()) return;
  // Before anything is known of gamma: by what the start may have.
  speed_ = 0.0;
  for (const Contact& contact : scene_->model.contacts) {
    speed_ = std::max(speed_, (contact.w.transpose() * start_.S_u.leftCols(start_.columns)).norm());
  }
  if (!(speed_ > 0.0)) speed_ = 1.0;
  linear_ = false;
  bool done = false;
  for (int i = 0; i < most_iterations && !done; ++i) {
    check_interrupt();
    run_filter();
    run_back();
    const double moved = move_times(i < full_steps ? 1.0 : 0.5);
    done = linear_ && moved < settled_times;
    linear_ = true;
  }
  const bool all_hit = std::all_of(impacts_.begin(), impacts_.end(),
                                   [](const Impact& impact) { return impact.gamma < 0.0; });
  if (!done || !all_hit || !(misfit_ < largest_misfit)) {
    throw SmoothingError(
        "no path of this machine is found that all events fit: a wrong model, or missing or "
        "spurious events; see diagnose");
  }
  run_filter();
  run_back();
  if (passes_through()) {
    throw SmoothingError("the path that fits the events goes through a support between them");
  }
}

// Whether the path does so beyond doubt: it is then another one than the machine's.
bool Smoother::passes_through() {
  const std::vector<Contact>& contacts = scene_->model.contacts;
  Estimate estimate;
  for (std::size_t k = 0; k + 1 < impacts_.size(); ++k) {
    const double from = impacts_[k].s;
    const double step = (impacts_[k + 1].s - from) / looks_a_flight;
    for (int i = 1; i < looks_a_flight; ++i) {
      const double t = from + i * step;
      at(sprag::at(t), estimate);
      for (std::size_t j = 0; j < contacts.size(); ++j) {
        const double sigma = estimate.sigma_gap[static_cast<Eigen::Index>(j)];
        if (gap(contacts[j], estimate.q, t) < -deviations_inside * sigma) return true;
      }
    }
  }
  return false;
}

// About the smoothed path.
void Smoother::linearize(Impact& impact) const {
  const Dynamics& dynamics = flows_->dynamics();
  const Eigen::Index f = start_.q.size();
  const int i = impact.event.contact;
  const Contact& contact = dynamics.model().contacts[static_cast<std::size_t>(i)];
  const Flow& free = (*flows_)[0];
  Motion motion;
  free.enter(impact.before.head(f), impact.before.tail(f), sprag::at(impact.s), Eigen::VectorXd(0),
             motion);
  impact.gamma = value(free.gap_velocity(i), motion);
  const Eigen::VectorXd d = dynamics.MinvW().col(i) / dynamics.G()(i, i);
  const double kick = 1.0 + contact.restitution;
  impact.jump = -kick * impact.gamma * d;
  impact.b.resize(2 * f);
  impact.b.head(f) = -impact.jump;
  impact.b.tail(f) = -kick * rate(free.gap_velocity(i), motion) * d + MinvC_ * impact.jump;
}

void Smoother::run_filter() {
  const Dynamics& dynamics = flows_->dynamics();
  const Flow& free = (*flows_)[0];
  const Eigen::Index f = start_.q.size();
  const double sigma = scene_->jitter;
  Belief now = start_;
  double t = begins_;
  for (Impact& impact : impacts_) {
    const int i = impact.event.contact;
    const Contact& contact = dynamics.model().contacts[static_cast<std::size_t>(i)];
    const double tau = impact.s - t;
    free.enter(now.q, now.u, sprag::at(t), Eigen::VectorXd(0), motion_);
    free.propagate(motion_, sprag::at(impact.s), motion_);
    free.state(motion_, now.q, now.u);
    fly(tau, now);
    impact.Phi = transition(tau);
    impact.predicted = now;

    // With d as one more unknown and one more column.
    const double gamma = linear_ ? impact.gamma : -speed_;
    Eigen::VectorXd delta(1);
    delta[0] = impact.event.t - impact.s;
    const Eigen::Index c = now.columns;
    now.S_q.col(c).setZero();
    now.S_u.col(c).setZero();
    now.columns = c + 1;
    Eigen::MatrixXd S_delta = Eigen::MatrixXd::Zero(1, c + 1);
    S_delta(0, c) = sigma;
    Eigen::VectorXd phi(c + 1);
    phi.head(c) = now.S_q.leftCols(c).transpose() * contact.w;
    phi[c] = gamma * sigma;
    terms_.include(contact, now.q, now.u);
    const double r = square(measurement_rounding * terms_.length);
    impact.y = -(gap(contact, now.q, impact.s) + gamma * delta[0]);
    impact.v = phi.squaredNorm() + r;
    impact.H.setZero(2 * f + 1);
    impact.H.head(f) = contact.w;
    impact.H[2 * f] = gamma;
    impact.K.resize(2 * f + 1);
    impact.K.head(f) = now.S_q.leftCols(c + 1) * phi / impact.v;
    impact.K.segment(f, f) = now.S_u.leftCols(c + 1) * phi / impact.v;
    impact.K[2 * f] = S_delta.row(0).dot(phi) / impact.v;
    const PotterUpdate update(phi, impact.y, r);
    update.apply(now.q, now.S_q.leftCols(c + 1));
    update.apply(now.u, now.S_u.leftCols(c + 1));
    update.apply(delta, S_delta);

    // The impact.
    const Eigen::VectorXd d =
        (1.0 + contact.restitution) / dynamics.G()(i, i) * dynamics.MinvW().col(i);
    if (impact.b.size() == 0 || !linear_) impact.b.setZero(2 * f);
    impact.F.setZero(2 * f, 2 * f + 1);
    impact.F.leftCols(2 * f).setIdentity();
    impact.F.block(f, f, f, f) -= d * contact.w.transpose();
    impact.F.col(2 * f) = impact.b;
    now.u -= gap_velocity(contact, now.u, impact.s) * d;
    now.q += delta[0] * impact.b.head(f);
    now.u += delta[0] * impact.b.tail(f);
    const Eigen::RowVectorXd seen = contact.w.transpose() * now.S_u.leftCols(c + 1);
    now.S_u.leftCols(c + 1) -= d * seen;
    now.S_q.leftCols(c + 1) += impact.b.head(f) * S_delta.row(0);
    now.S_u.leftCols(c + 1) += impact.b.tail(f) * S_delta.row(0);
    columns_.merge(now);
    impact.behind = now;
    t = impact.s;
  }
}

void Smoother::run_back() {
  const Eigen::Index n = 2 * start_.q.size();
  const double sigma2 = square(scene_->jitter);
  Eigen::VectorXd lambda = Eigen::VectorXd::Zero(n);
  Eigen::MatrixXd Lambda = Eigen::MatrixXd::Zero(n, n);
  double squares = 0.0, free = 0.0;
  for (std::size_t k = impacts_.size(); k-- > 0;) {
    Impact& impact = impacts_[k];
    // Through the impact and what was heard of it.
    const Eigen::MatrixXd I_KH =
        Eigen::MatrixXd::Identity(n + 1, n + 1) - impact.K * impact.H.transpose();
    const Eigen::MatrixXd back = product(impact.F, I_KH);
    const Eigen::VectorXd of_all = impact.H * (impact.y / impact.v) + back.transpose() * lambda;
    const Eigen::MatrixXd L = impact.H * impact.H.transpose() / impact.v + congruent(back, Lambda);
    impact.lambda = of_all.head(n);
    impact.Lambda = L.topLeftCorner(n, n);
    const Eigen::Index c = impact.predicted.columns;
    const Eigen::Index f = n / 2;
    const auto S_q = impact.predicted.S_q.leftCols(c);
    const auto S_u = impact.predicted.S_u.leftCols(c);
    const Eigen::VectorXd along =
        S_q.transpose() * impact.lambda.head(f) + S_u.transpose() * impact.lambda.tail(f);
    impact.before.resize(n);
    impact.before.head(f) = impact.predicted.q + S_q * along;
    impact.before.tail(f) = impact.predicted.u + S_u * along;
    const double off = impact.event.t - impact.s;
    const double moved = sigma2 * of_all[n];
    const double variance = sigma2 * std::max(1.0 - sigma2 * L(n, n), 0.0);
    impact.sigma_time = std::sqrt(variance);
    // Where it was is s + off + moved.
    impact.step = off + moved;
    squares += square(moved) / sigma2;
    free += 1.0 - variance / sigma2;
    lambda = impact.Phi.transpose() * impact.lambda;
    Lambda = congruent(impact.Phi, impact.Lambda);
  }
  misfit_ = free > 0.0 ? squares / std::max(free, 1.0) : 0.0;
}

// Each impact to where the smoothed path has it, or a share of the way; the furthest that one is to
// move, in its deviations.
double Smoother::move_times(double share) {
  double most = 0.0;
  const double reach = longest_step * scene_->jitter;
  double last = begins_;
  for (Impact& impact : impacts_) {
    const double step = std::clamp(impact.step, -reach, reach);
    linearize(impact);
    const double to = std::max(impact.s + share * step, last);
    const double rounding = time_rounding_of_path * impact.s;
    most = std::max(most, std::abs(step) / (impact.sigma_time + rounding / settled_times));
    impact.s = last = to;
  }
  return most;
}

void Smoother::at(Instant t, Estimate& estimate) {
  const Flow& free = (*flows_)[0];
  const Eigen::Index f = start_.q.size();
  std::size_t next = 0;
  while (next < impacts_.size() && impacts_[next].s <= t.hi) ++next;
  const Belief& from = next == 0 ? start_ : impacts_[next - 1].behind;
  const Instant begin = sprag::at(next == 0 ? begins_ : impacts_[next - 1].s);
  here_ = from;
  free.enter(from.q, from.u, begin, Eigen::VectorXd(0), motion_);
  if (t - begin > 0.0) free.propagate(motion_, t, motion_);
  free.state(motion_, here_.q, here_.u);
  fly(t - begin, here_);

  const Eigen::Index c = here_.columns;
  Eigen::MatrixXd S(2 * f, c);
  S << here_.S_q.leftCols(c), here_.S_u.leftCols(c);
  Eigen::VectorXd x(2 * f);
  x << here_.q, here_.u;
  Eigen::MatrixXd kept = Eigen::MatrixXd::Identity(c, c);
  if (next < impacts_.size()) {
    const Impact& coming = impacts_[next];
    const Eigen::MatrixXd seen = product(transition(sprag::at(coming.s) - t), S);
    x += S * (seen.transpose() * coming.lambda);
    kept -= congruent(seen, coming.Lambda);
  }
  // What is left of large deviations that cancel is known to their rounding.
  const auto deviation = [&](const Eigen::RowVectorXd& row, double unseen) {
    const double variance = std::max(row.dot(kept * row.transpose()), 0.0);
    return std::sqrt(variance + rounding_of_variance * row.squaredNorm() +
                     square(rounding_of_path * unseen));
  };
  const double largest_w = flows_->dynamics().W().cwiseAbs().maxCoeff();
  estimate.q = x.head(f);
  estimate.u = x.tail(f);
  const Terms terms = terms_.of_coordinates(estimate.q, estimate.u, largest_w);
  estimate.sigma_q.resize(f);
  estimate.sigma_u.resize(f);
  for (Eigen::Index i = 0; i < f; ++i) {
    estimate.sigma_q[i] = deviation(S.row(i), terms.length);
    estimate.sigma_u[i] = deviation(S.row(f + i), terms.speed);
  }
  const std::vector<Contact>& contacts = scene_->model.contacts;
  estimate.sigma_gap.resize(static_cast<Eigen::Index>(contacts.size()));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    estimate.sigma_gap[static_cast<Eigen::Index>(i)] =
        deviation(contacts[i].w.transpose() * S.topRows(f), terms.length * largest_w);
  }
  const std::vector<Output>& outputs = scene_->model.outputs;
  estimate.sigma_outputs.resize(std::ssize(outputs));
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    const Output& of = outputs[i];
    estimate.sigma_outputs[static_cast<Eigen::Index>(i)] =
        deviation(of.direction.transpose() * S.middleRows(of.velocity ? f : 0, f),
                  (of.velocity ? terms.speed : terms.length) * of.direction.norm());
  }
  // What may be over already, or not yet.
  const auto mix = [&](const Impact& impact, double sign) {
    const double away = std::abs(t.hi - impact.s) / impact.sigma_time;
    if (!(away < still_uncertain)) return;
    const double other = std::exp(log_normal_cdf(-away));
    estimate.u += sign * other * impact.jump;
    const auto widen = [other](double& sigma, double jump) {
      sigma = std::sqrt(square(sigma) + other * (1.0 - other) * square(jump));
    };
    for (Eigen::Index i = 0; i < f; ++i) widen(estimate.sigma_u[i], impact.jump[i]);
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      if (!outputs[i].velocity) continue;
      widen(estimate.sigma_outputs[static_cast<Eigen::Index>(i)],
            outputs[i].direction.dot(impact.jump));
    }
  };
  if (next > 0) mix(impacts_[next - 1], -1.0);
  if (next < impacts_.size()) mix(impacts_[next], 1.0);
}

std::vector<SmoothedStretch> smooth(
    const Scene& scene, std::span<const ContactEvent> events, double h, std::int64_t last,
    const std::function<void(std::int64_t, const Smoother::Estimate&, bool)>& take) {
  Smoother smoother(scene);
  TimingFilter filter(scene, h);
  TimingState state;
  filter.start(scene.replica, 0, 0, state);
  const Eigen::Index f = scene.model.coordinates();
  Smoother::Estimate estimate;
  for (Eigen::VectorXd* x : {&estimate.q, &estimate.u, &estimate.sigma_q, &estimate.sigma_u}) {
    x->setZero(f);
  }
  estimate.sigma_gap.setZero(std::ssize(scene.model.contacts));
  estimate.sigma_outputs.setZero(std::ssize(scene.model.outputs));
  const std::vector<Obscure> obscure = obscure_times(events, order_is_certain * scene.jitter);
  std::vector<SmoothedStretch> stretches;
  std::size_t heard = 0, next = 0;
  bool running = false;  // a stretch is
  for (std::int64_t k = 0; k <= last; ++k) {
    check_interrupt();
    const Instant t = tick_instant(k, h);
    const std::size_t first = heard;
    while (heard < events.size() && first_tick_after(events[heard].t, h) <= k) ++heard;
    if (k == 0) {
      filter.apply(events.first(heard), state);
    } else {
      filter.tick(events.subspan(first, heard - first), state);
    }
    for (; next < obscure.size() && !(t.hi < obscure[next].to); ++next) running = false;
    const double until = next < obscure.size() ? obscure[next].from : infinity;
    const bool clear = t.hi < until;
    if (clear && !running && !state.unknown) {
      const std::size_t end = next < obscure.size() ? obscure[next].first : events.size();
      const auto enough = static_cast<std::size_t>(2 * f + events_to_tell);
      if (k == 0) {
        smoother.start();
      } else {
        filter.output(state, estimate.q, estimate.u);
        smoother.start(t.hi, estimate.q, estimate.u, filter.covariance(state));
      }
      SmoothedStretch stretch{
          t.hi, std::min(until, tick_instant(last, h).hi), end - heard, 0.0, {}};
      if (end < heard + enough) stretch.failure = "too few events";
      try {
        if (stretch.failure.empty()) smoother.take(events.subspan(heard, end - heard));
        stretch.misfit = smoother.misfit();
      } catch (const SmoothingError& error) {
        stretch.failure = error.what();
      }
      stretches.push_back(stretch);
    }
    running = clear && (running || !state.unknown);
    const bool smoothed = running && stretches.back().failure.empty();
    if (smoothed) {
      smoother.at(t, estimate);
    } else {
      filter.output(state, estimate.q, estimate.u);
      filter.deviations(state, estimate.sigma_q, estimate.sigma_u, estimate.sigma_gap);
      filter.output_deviations(state, estimate.sigma_outputs);
    }
    take(k, estimate, smoothed);
  }
  return stretches;
}

}  // namespace sprag
