#include "studies/work_precision/methods/event_loop.h"

#include <bit>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag::work_precision {
namespace {

// As in master.cpp and detail/mechanics/contact_solver.cpp.
constexpr double touching = 1e-12;    // share of the gap's terms
constexpr double zero_share = 1e-12;  // of velocities and accelerations
// Share of the time, and of the gap's terms, below which a bounce vanishes in rounding.
constexpr double resolvable_share = 1e-14;
constexpr int events_of_standstill = 10000;

std::size_t index(int i) { return static_cast<std::size_t>(i); }

double resolvable_time(double t) { return resolvable_share * (1.0 + t); }

}  // namespace

ContactPhases::ContactPhases(const Task& task, Outcome& outcome, double tolerance)
    : machine_(task.model), outcome_(&outcome), tolerance_(tolerance) {
  completions_.assign(index(m()), infinity);
  partings_.resize(index(m()));
  rate_.resize(static_cast<std::size_t>(2 * f()));
  epsilon_.resize(index(m()));
}

void ContactPhases::fail(double t, const std::string& what) const {
  throw std::runtime_error("t = " + std::to_string(t) + ": " + what);
}

double ContactPhases::signal(int contact, double t, const double* x) {
  if (completions_[index(contact)] != infinity) return 1.0;
  if (contains(locked_, contact)) {
    ++outcome_->right_hand_sides;
    (void)machine_.accelerate_locked(t, x, x + f(), locked_, rate_.data(), lambda_);
    // Rounding noise neither presses nor opens a touching contact: it stays closed.
    const double noise = zero_share * acceleration_scale(contact, t, rate_.data());
    const double least = std::numeric_limits<double>::min();
    return lambda_[std::popcount(locked_ & (bit(contact) - 1))] +
           std::max(noise / machine_.G()(contact, contact), least);
  }
  const double g = machine_.gap(contact, t, x);
  const Parting& parting = partings_[index(contact)];
  if (parting.t == -infinity) return g;
  if (parting.near) return g - parting.gap + resolvable_height(contact, x);
  const double flight = t - parting.t;
  return flight > 0.0 ? (g - parting.gap) / flight : parting.velocity;
}

void ContactPhases::settle(double t, const double* x) {
  if (near_ == 0) return;
  for_each(near_, [&](int i) {
    Parting& parting = partings_[index(i)];
    if (machine_.gap(i, t, x) - parting.gap <= resolvable_height(i, x)) return;
    parting.near = false;
    near_ &= ~bit(i);
  });
}

// Sum of the magnitudes of the gap's terms.
double ContactPhases::gap_scale(int contact, const double* q) const {
  const Contact& c = machine_.model().contacts[index(contact)];
  double scale = std::abs(c.motion.amplitude) + std::abs(c.clearance);
  for (Eigen::Index i = 0; i < f(); ++i) scale += std::abs(c.w[i] * q[i]);
  return scale;
}

// Height of a bounce below the rounding of the gap or the tolerance.
double ContactPhases::resolvable_height(int contact, const double* q) const {
  const Contact& c = machine_.model().contacts[index(contact)];
  double error = 0.0;
  for (Eigen::Index i = 0; i < f(); ++i) error += std::abs(c.w[i]) * (1.0 + std::abs(q[i]));
  return std::max(resolvable_share * gap_scale(contact, q), tolerance_ * error);
}

double ContactPhases::gap_acceleration(int contact, double t, const double* u_dot) const {
  const Contact& c = machine_.model().contacts[index(contact)];
  double sum = machine_.support_acceleration(contact, t);
  for (Eigen::Index i = 0; i < f(); ++i) sum += c.w[i] * u_dot[i];
  return sum;
}

// Sum of the magnitudes of its terms.
double ContactPhases::acceleration_scale(int contact, double t, const double* u_dot) const {
  const Contact& c = machine_.model().contacts[index(contact)];
  double scale = std::abs(machine_.support_acceleration(contact, t));
  for (Eigen::Index i = 0; i < f(); ++i) scale += std::abs(c.w[i] * u_dot[i]);
  return scale;
}

// Rounding error of gamma_i.
double ContactPhases::velocity_noise(int contact, const double* u) const {
  const Contact& c = machine_.model().contacts[index(contact)];
  double scale = std::abs(c.motion.amplitude * c.motion.frequency);
  for (Eigen::Index i = 0; i < f(); ++i) scale += std::abs(c.w[i] * u[i]);
  return 4.0 * std::numeric_limits<double>::epsilon() * scale;
}

// velocity: 0 for a contact that opens without an impulse.
void ContactPhases::part(int contact, double t, double velocity, const double* x) {
  const bool near = !(velocity > 0.0);
  partings_[index(contact)] = {t, machine_.gap(contact, t, x), velocity, near};
  near_ = near ? near_ | bit(contact) : near_ & ~bit(contact);
}

// The contacts of `resting` (g = 0, gamma = 0) that stay closed: 0 <= lambda _|_ gamma' >= 0.
ContactSet ContactPhases::sustained(double t, ContactSet resting, const double* x) {
  if (resting == 0) return 0;
  const int n = std::popcount(resting);
  ++outcome_->right_hand_sides;
  double* acceleration = rate_.data();
  machine_.accelerate(t, x, x + f(), acceleration);
  ContactVector rate(n), magnitude(n), lambda, rate_plus;
  Eigen::Index row = 0;
  for_each(resting, [&](int i) {
    rate[row] = gap_acceleration(i, t, acceleration);
    magnitude[row++] = acceleration_scale(i, t, acceleration);
  });
  ++outcome_->solves;
  if (solve_lcp(of_contacts(machine_.G(), resting), rate, lambda, rate_plus) != Solved::yes) {
    fail(t, "locked contacts have linearly dependent directions");
  }
  ContactSet staying = 0;
  row = 0;
  for_each(resting, [&](int i) {
    if (rate_plus[row] <= zero_share * magnitude[row]) staying |= bit(i);
    ++row;
  });
  return staying;
}

// Integration keeps only gamma' = 0; this projects the drift back to g = 0 and gamma = 0.
void ContactPhases::project(double t, double* x) const {
  if (locked_ == 0) return;
  const int n = std::popcount(locked_);
  ContactVector g(n), gamma(n), shift, kick;
  Eigen::Index row = 0;
  for_each(locked_, [&](int i) {
    g[row] = machine_.gap(i, t, x);
    gamma[row++] = machine_.gap_velocity(i, t, x + f());
  });
  const ContactMatrix G = of_contacts(machine_.G(), locked_);
  if (arrest(G, g, shift) != Solved::yes || arrest(G, gamma, kick) != Solved::yes) {
    fail(t, "locked contacts have linearly dependent directions");
  }
  Eigen::Map<Eigen::VectorXd> q(x, f()), u(x + f(), f());
  row = 0;
  for_each(locked_, [&](int i) {
    q += shift[row] * machine_.MinvW().col(i);
    u += kick[row++] * machine_.MinvW().col(i);
  });
}

void ContactPhases::start(double* x) {
  ContactSet closing = 0;
  ContactSet touched = 0;
  for (int i = 0; i < m(); ++i) {
    const double scale = gap_scale(i, x);
    const double g = machine_.gap(i, 0.0, x);
    const double gamma = machine_.gap_velocity(i, 0.0, x + f());
    if (g > touching * scale) continue;
    if (g < -touching * scale) fail(0.0, "starts inside a contact");
    if (gamma < 0.0) {
      closing |= bit(i);
    } else if (gamma == 0.0) {
      touched |= bit(i);
    } else {
      part(i, 0.0, gamma, x);
    }
  }
  locked_ = sustained(0.0, touched, x);
  for_each(touched, [&](int i) {
    if (contains(locked_, i)) {
      outcome_->impacts.push_back(0.0);
    } else {
      part(i, 0.0, 0.0, x);
    }
  });
  if (closing != 0) close(0.0, closing, 0, x);
}

void ContactPhases::take(double t, ContactSet fired, double* x) {
  if (t - since_ > events_of_standstill * resolvable_time(t)) {
    events_since_ = 0;
    since_ = t;
  } else if (++events_since_ > events_of_standstill) {
    fail(t, "time stands still");
  }
  project(t, x);
  const ContactSet releasing = fired & locked_;
  locked_ &= ~releasing;
  for_each(releasing, [&](int i) { part(i, t, 0.0, x); });
  ContactSet completed = 0;
  for (int i = 0; i < m(); ++i) {
    if (completions_[index(i)] <= t) completed |= bit(i);
  }
  const ContactSet closing = (fired & ~releasing) | completed;
  if (closing == 0) return;
  completed |= wedged(t, closing);
  close(t, closing | completed, completed, x);
}

double ContactPhases::shortest_chatter(double t) const {
  return std::max(machine_.model().chatter_time, resolvable_time(t));
}

// The contacts whose mutual impacts chatter, the present impact included.
ContactSet ContactPhases::wedged(double t, ContactSet closing) {
  constexpr int repeatedly = 3;
  constexpr double window = 16.0;  // chatter times
  recent_[static_cast<std::size_t>(impacts_++ % static_cast<std::int64_t>(recent_.size()))] = {
      t, closing};
  const Impact& oldest =
      recent_[static_cast<std::size_t>(impacts_ % static_cast<std::int64_t>(recent_.size()))];
  if (t - oldest.t > window * shortest_chatter(t)) return 0;
  ContactSet wedged = 0;
  for (int i = 0; i < m(); ++i) {
    const auto count = std::count_if(recent_.begin(), recent_.end(), [&](const Impact& impact) {
      return contains(impact.closing, i);
    });
    if (count >= repeatedly) wedged |= bit(i);
  }
  if (std::popcount(wedged) < 2) return 0;
  recent_.fill({});
  return wedged;
}

// Sets gamma of those `participants` to zero whose parting velocity is negligible, and of those
// that this would press in, and adds them to `resting`. Their flight is not resolvable; the
// impulses of their remaining bounces have the same sum. For contacts `staying` a flight shorter
// than the rest of a chatter counts as negligible, too. They would return at once, force the
// release of others in turn, and so on without end.
void ContactPhases::hold_hardly_parted(double t, ContactSet staying, ContactSet participants,
                                       double* x, ContactSet& resting) {
  double* u = x + f();
  const ContactSet parting = participants & ~locked_ & ~resting;
  if (parting == 0) return;
  derivative(t, x, rate_.data());
  ContactSet held = 0;
  for_each(parting, [&](int i) {
    const double gamma = machine_.gap_velocity(i, t, u);
    const double acceleration = gap_acceleration(i, t, rate_.data() + f());
    if (gamma <= 0.0 || acceleration >= 0.0) return;
    const double flight = 2.0 * gamma / -acceleration;
    const double height = 0.25 * flight * gamma;
    if (flight < (contains(staying, i) ? shortest_chatter(t) : resolvable_time(t)) ||
        height < resolvable_height(i, x)) {
      held |= bit(i);
    }
  });
  if (held == 0) return;
  held |= resting;
  while (true) {
    ContactVector gamma(std::popcount(held)), Lambda;
    Eigen::Index row = 0;
    for_each(held, [&](int i) { gamma[row++] = machine_.gap_velocity(i, t, u); });
    if (arrest(of_contacts(machine_.G(), held), gamma, Lambda) != Solved::yes) return;
    ContactSet pressed = 0;
    for_each(participants & ~held, [&](int i) {
      double gamma_held = machine_.gap_velocity(i, t, u);
      Eigen::Index column = 0;
      for_each(held, [&](int j) { gamma_held += machine_.G()(i, j) * Lambda[column++]; });
      if (gamma_held <= 0.0) pressed |= bit(i);
    });
    held |= pressed;
    if (pressed != 0) continue;
    Eigen::Map<Eigen::VectorXd> velocity(u, f());
    row = 0;
    for_each(held, [&](int i) { velocity += Lambda[row++] * machine_.MinvW().col(i); });
    resting = held;
    locked_ = sustained(t, resting, x);
    return;
  }
}

// Impact of the contacts `closing` on the machine in its present state; those of `to_stay` become
// sustained contacts.
void ContactPhases::close(double t, ContactSet closing, ContactSet to_stay, double* x) {
  const std::vector<Contact>& contacts = machine_.model().contacts;
  double* u = x + f();
  const ContactSet closed_before = locked_;
  ContactSet touched = 0;
  for (int i = 0; i < m(); ++i) {
    if (contains(closed_before | closing, i)) continue;
    if (std::abs(machine_.gap(i, t, x)) <= touching * gap_scale(i, x)) touched |= bit(i);
  }
  closing |= touched;
  const ContactSet participants = closed_before | closing;
  for_each(closing, [&](int i) { completions_[index(i)] = infinity; });

  const std::vector<double> u_minus(u, u + f());
  double fastest = 0.0;
  for_each(participants, [&](int i) {
    fastest = std::max(fastest, std::abs(machine_.gap_velocity(i, t, u_minus.data())));
  });
  // A closing contact that stays closed takes restitution 0. This may change which contacts stay
  // closed.
  ContactSet staying = to_stay;
  ContactSet resting = 0;
  while (true) {
    for (int i = 0; i < m(); ++i) {
      epsilon_[index(i)] = contains(staying, i) ? 0.0 : contacts[index(i)].restitution;
    }
    ++outcome_->solves;
    if (!machine_.impact(t, participants, epsilon_, u)) {
      fail(t, "contacts that close at once have linearly dependent directions");
    }
    resting = 0;
    for_each(participants, [&](int i) {
      const double noise = std::max(zero_share * fastest, velocity_noise(i, u_minus.data()));
      if (std::abs(machine_.gap_velocity(i, t, u)) <= noise) resting |= bit(i);
    });
    locked_ = sustained(t, resting, x);
    const ContactSet sticking = closing & locked_ & ~staying;
    bool restitution_matters = false;
    for_each(sticking, [&](int i) { restitution_matters |= epsilon_[index(i)] != 0.0; });
    staying |= sticking;
    if (!restitution_matters) break;
    std::copy(u_minus.begin(), u_minus.end(), u);
  }
  hold_hardly_parted(t, (closed_before | to_stay) & participants, participants, x, resting);
  project(t, x);

  for_each(closing, [&](int i) {
    const double gamma_minus = machine_.gap_velocity(i, t, u_minus.data());
    if (contains(locked_, i) || gamma_minus < 0.0) outcome_->impacts.push_back(t);
  });
  const ContactSet parting = participants & ~locked_;
  if (parting != 0) derivative(t, x, rate_.data());
  for_each(parting, [&](int i) {
    const double gamma = contains(resting, i) ? 0.0 : machine_.gap_velocity(i, t, u);
    const double acceleration = gap_acceleration(i, t, rate_.data() + f());
    part(i, t, acceleration < 0.0 ? gamma : 0.0, x);
    if (!contains(closing & ~to_stay & ~resting, i)) return;
    // The rest of the sequence, 2 gamma+ / (|g''| (1 - epsilon)).
    const double share_lost = 1.0 - contacts[index(i)].restitution;
    if (2.0 * gamma < -acceleration * share_lost * shortest_chatter(t)) {
      completions_[index(i)] = t + 2.0 * gamma / (-acceleration * share_lost);
    }
  });
  completion_ = infinity;
  for (const double completion : completions_) completion_ = std::min(completion_, completion);
}

}  // namespace sprag::work_precision
