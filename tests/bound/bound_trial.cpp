#include "tests/bound/bound_trial.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/energy.h"
#include "tests/support/by_speed.h"
#include "tests/support/random_model.h"

namespace sprag::test {
namespace {

double times_sign(Random& random, double size) { return random.chance(0.5) ? size : -size; }

double off_by(Random& random, double tolerance, bool corner) {
  return corner ? times_sign(random, tolerance) : random.uniform(-tolerance, tolerance);
}

Model random_known_machine(Random& random, int contacts, bool unlike) {
  const int f = random.integer(contacts, 6);
  constexpr std::array kinds{Structure::diagonal, Structure::rayleigh, Structure::simultaneous,
                             Structure::coupled,  Structure::repeated, Structure::strongly_damped};
  const auto kind = static_cast<std::size_t>(random.integer(0, int{kinds.size()} - 1));
  Model model = random_machine(random, kinds.at(kind), f);
  if (random.chance(0.7)) model.C *= random.log_uniform(0.05, 0.5);
  add_forces(random, model, random.integer(1, 2));
  add_contacts(random, model, contacts);
  const double restitution = random.chance(0.1) ? 0.0 : random.uniform(0.2, 0.9);
  for (Contact& contact : model.contacts) {
    contact.restitution = restitution;
    model.forces.push_back({-contact.w, random.uniform(0.5, 5.0), {}});
  }
  if (unlike) {
    if (random.chance(0.5)) model.law = ImpactLaw::newton;
    for (Contact& contact : model.contacts) contact.restitution = random.uniform(0.1, 0.9);
  }
  if (random.chance(0.25)) test::let_restitutions_fall(random, 3.0, model);
  return model;
}

Tolerance random_tolerance(Random& random, double time_scale) {
  Tolerance tolerance;
  if (random.chance(0.8)) tolerance.time = random.log_uniform(1e-6, 1e-2) * time_scale;
  if (random.chance(0.5)) tolerance.restitution = random.log_uniform(1e-4, 3e-2);
  if (random.chance(0.5)) tolerance.stiffness = random.log_uniform(1e-5, 1e-2);
  if (random.chance(0.5)) tolerance.damping = random.log_uniform(1e-4, 1e-1);
  if (random.chance(0.3)) tolerance.force = random.log_uniform(1e-4, 1e-1);
  if (random.chance(0.3)) tolerance.clearance = random.log_uniform(1e-5, 1e-2);
  if (!tolerance.any()) tolerance.time = 1e-4 * time_scale;
  return tolerance;
}

Model true_machine(Random& random, const Scene& scene, bool corners) {
  Model truth = scene.model;
  const Tolerance& tolerance = scene.prior.tolerance;
  truth.K *= 1.0 + off_by(random, tolerance.stiffness, corners);
  truth.C *= 1.0 + off_by(random, tolerance.damping, corners);
  for (Contact& contact : truth.contacts) {
    contact.restitution =
        std::clamp(contact.restitution + off_by(random, tolerance.restitution, corners), 0.0, 1.0);
    contact.clearance += off_by(random, tolerance.clearance, corners);
  }
  if (tolerance.force > 0.0) {
    Force force{random.vector(truth.coordinates()), 0.0, {}};
    const double size = CholeskyFactor(truth.M).solve_L(force.direction).norm();
    force.direction *= tolerance.force / size;
    if (random.chance(0.5)) {
      force.constant = 1.0;
    } else {
      force.harmonic = {1.0, random.uniform(0.5, 10.0), random.phase()};
    }
    truth.forces.push_back(force);
  }
  return truth;
}

// A grid, and times on both sides of each report and of each event.
std::vector<double> sample_times(const BoundCase& machine,
                                 const std::vector<ContactEvent>& reports) {
  const double delta = machine.scene.prior.tolerance.time;
  std::vector<double> times;
  constexpr int grid = 200;
  for (int i = 0; i <= grid; ++i) times.push_back(machine.end * i / grid);
  const auto about = [&](double t) {
    for (const double s : {-0.999, -0.5, -1e-3, 0.0, 1e-3, 0.5, 0.999, 1.001}) {
      times.push_back(t + s * delta);
    }
    times.push_back(t + 1e-9 * machine.end);
  };
  for (const ContactEvent& event : reports) about(event.t);
  for (const ContactEvent& event : machine.events) about(event.t);
  std::erase_if(times, [&](double t) { return t < 0.0 || t > machine.end; });
  std::sort(times.begin(), times.end());
  times.erase(std::unique(times.begin(), times.end()), times.end());
  return times;
}

// The received reports, and the gap between them.
struct Received {
  std::vector<ContactEvent> reports;
  std::size_t before_gap = 0;
  DegradedInterval gap;
  bool has_gap = false;
};

Received received(const BoundCase& machine, const std::vector<ContactEvent>& reports) {
  Received all{reports, reports.size(), {}, false};
  const auto first =
      static_cast<std::size_t>(machine.lost_after * static_cast<double>(reports.size()));
  const std::size_t last = first + machine.lost;
  if (machine.lost == 0 || first == 0 || last >= reports.size()) return all;
  // All events up to the time of a received one are known.
  if (reports[first].t <= reports[first - 1].t) return all;
  ContactSet chi = 0;
  for (std::size_t k = 0; k < first; ++k) chi = after(chi, reports[k]);
  ContactSet then = chi;
  for (std::size_t k = first; k < last; ++k) then = after(then, reports[k]);
  if (then != chi) return all;
  all.reports.erase(all.reports.begin() + static_cast<std::ptrdiff_t>(first),
                    all.reports.begin() + static_cast<std::ptrdiff_t>(last));
  all.before_gap = first;
  all.gap = {.from = reports[first - 1].t, .to = reports[last].t};
  all.has_gap = true;
  return all;
}

// The replica alone, advanced in steps.
class FollowedReplica {
 public:
  FollowedReplica(const BoundCase& machine, std::vector<ContactEvent> reports)
      : replica_(machine.scene.model, 1.0), reports_(std::move(reports)) {
    replica_.start(machine.scene.prior.start, 0, 0, state_);
  }

  void to(double t, Eigen::VectorXd& q, Eigen::VectorXd& u) {
    const std::size_t first = next_;
    while (next_ < reports_.size() && reports_[next_].t <= t) ++next_;
    for_each_instant(std::span<const ContactEvent>(reports_).subspan(first, next_ - first),
                     [&](std::span<const ContactEvent> of_one) { replica_.take(of_one, state_); });
    replica_.advance(at(t), state_);
    state_.motion.flow->state(state_.motion, q, u);
  }
  bool refused() const { return state_.refused_impacts > 0; }
  Flows& flows() { return replica_.flows(); }

 private:
  Replica replica_;
  Replica::State state_;
  std::vector<ContactEvent> reports_;
  std::size_t next_ = 0;
};

}  // namespace

BoundCase random_bound_case(Random& random, const BoundCaseSettings& settings, int most_events) {
  for (;;) {
    BoundCase machine;
    Scene& scene = machine.scene;
    scene.model = random_known_machine(random, settings.contacts, settings.unlike);
    machine.lost = settings.lost;
    machine.lost_after = random.uniform(0.2, 0.7);
    const Eigen::Index f = scene.model.coordinates();
    machine.start = random_state(random, scene.model);
    const double fastest = std::sqrt(eigenpairs(scene.model.K, scene.model.M).values.maxCoeff());
    scene.prior.tolerance = random_tolerance(random, 1.0 / std::max(fastest, 1e-3));
    for (Contact& contact : scene.model.contacts) {
      contact.clearance -= gap(contact, machine.start.q, 0.0) - random.uniform(0.0, 0.3) -
                           scene.prior.tolerance.clearance;
    }
    scene.model.chatter_time = 1e-9;
    machine.truth = true_machine(random, scene, settings.corners);
    scene.prior.start = machine.start;
    if (!settings.exact_start) {
      const State off = random_state(random, scene.model);
      scene.prior.start.q += 0.3 * off.q;
      scene.prior.start.u += 0.3 * off.u;
    }
    const double V0 = ErrorEnergy(scene.model)(machine.start.q, machine.start.u,
                                               scene.prior.start.q, scene.prior.start.u)[0];
    // Upper limit of the rounding errors of machine and replica.
    const double rounding = 1e-26 * (1.0 + machine.start.u.dot(scene.model.M * machine.start.u) +
                                     machine.start.q.dot(scene.model.K * machine.start.q));
    scene.prior.uncertainty = Eigen::VectorXd::Constant(
        f, std::max(V0 * (1.0 + 1e-12), rounding) / static_cast<double>(f));
    try {
      Master master(machine.truth, machine.start);
      const double longest = 40.0 / std::max(fastest, 1e-3) * 6.0;
      for (int step = 1; step <= 200 && std::ssize(machine.events) < most_events; ++step) {
        machine.end = longest * step / 200;
        if (!master.advance(at(machine.end), machine.events,
                            4 * static_cast<std::size_t>(most_events)))
          break;
      }
    } catch (const SimulationError&) {
      continue;
    }
    if (std::ssize(machine.events) > 2 * most_events) {
      // A cut within a burst is a valid case.
      machine.events.resize(static_cast<std::size_t>(most_events));
      machine.end = machine.events.back().t;
      // The cut may separate simultaneous events at the end.
      while (!machine.events.empty() && machine.events.back().t == machine.end) {
        machine.events.pop_back();
      }
      machine.end = std::nextafter(machine.end, 0.0);
    }
    if (machine.events.size() >= 4) return machine;
  }
}

std::vector<ContactEvent> shifted(const BoundCase& machine, const std::vector<double>& shifts) {
  std::vector<ContactEvent> reports = machine.events;
  std::array<double, max_contacts> last;
  last.fill(-1.0);
  for (std::size_t k = 0; k < reports.size(); ++k) {
    ContactEvent& report = reports[k];
    double& before = last[index(report.contact)];
    const double t = std::max(report.t + shifts[k], 0.0);
    report.t = std::max(t, before < 0.0 ? 0.0 : std::nextafter(before, infinity));
    before = report.t;
  }
  std::stable_sort(reports.begin(), reports.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
  return reports;
}

BoundRun run_bound_case(const BoundCase& machine, const std::vector<double>& shifts,
                        const BoundSettings& settings) {
  const Received all = received(machine, shifted(machine, shifts));
  const std::vector<ContactEvent>& reports = all.reports;
  const double delta = machine.scene.prior.tolerance.time;
  FollowedReplica replica(machine, reports);
  BoundTracker tracker(machine.scene, replica.flows(), 1.0, settings);
  EventHistory history(static_cast<int>(machine.scene.model.contacts.size()), reports.size() + 1);
  history.restart(0, 0, no_horizon);
  for (std::size_t k = 0; k < reports.size(); ++k) {
    if (all.has_gap && k == all.before_gap) {
      history.degrade(all.gap.from, all.gap.to);
    }
    history.add(reports[k]);
  }
  history.set_horizon(machine.end + 2.0 * delta);
  Master master(machine.truth, machine.start);
  const ErrorEnergy energy(machine.scene.model);
  const Eigen::Index f = machine.scene.model.coordinates();
  Eigen::VectorXd q_m(f), u_m(f), q_s(f), u_s(f);
  std::vector<ContactEvent> ignored;
  BoundRun run;
  std::vector<double> late;
  for (const double t : sample_times(machine, reports)) {
    master.advance(at(t), ignored);
    master.state(at(t), q_m, u_m);
    replica.to(t, q_s, u_s);
    tracker.follow(history, t);
    const double B = tracker.bound(history, t, q_s, u_s);
    const double V = energy(q_m, u_m, q_s, u_s)[0];
    ++run.samples;
    if (!std::isfinite(B)) ++run.infinite;
    const bool in_window = std::any_of(reports.begin(), reports.end(), [&](const auto& report) {
      return std::abs(report.t - t) <= 1.01 * delta;
    });
    if (t > 0.5 * machine.end && !in_window) late.push_back(B);
    run.final_B = B;
    run.final_V = V;
    if (V <= run.worst * B) continue;
    run.worst = B > 0.0 ? V / B : infinity;
    run.worst_t = t;
  }
  if (!late.empty()) {
    const auto middle = late.begin() + std::ssize(late) / 2;
    std::nth_element(late.begin(), middle, late.end());
    run.median_B = *middle;
  }
  return run;
}

std::vector<double> make_shifts(const BoundCase& machine, ShiftPattern pattern, Random& random,
                                const BoundSettings& settings) {
  const double delta = machine.scene.prior.tolerance.time * (1.0 - 1e-9);
  std::vector<double> shifts(machine.events.size(), 0.0);
  for (std::size_t k = 0; k < shifts.size(); ++k) {
    switch (pattern) {
      case ShiftPattern::early:
        shifts[k] = -delta;
        break;
      case ShiftPattern::late:
        shifts[k] = delta;
        break;
      case ShiftPattern::alternating:
        shifts[k] = k % 2 == 0 ? delta : -delta;
        break;
      case ShiftPattern::uniform:
        shifts[k] = random.uniform(-delta, delta);
        break;
      default:
        shifts[k] = times_sign(random, delta);
    }
  }
  if (pattern != ShiftPattern::greedy && pattern != ShiftPattern::optimized) return shifts;
  if (delta == 0.0) return shifts;
  // Each shift in turn takes the value that makes the run worse: once, or until no shift changes.
  const int sweeps = pattern == ShiftPattern::greedy ? 1 : 3;
  double worst = run_bound_case(machine, shifts, settings).worst;
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    bool better = false;
    for (double& shift : shifts) {
      const double kept = shift;
      for (const double other : {-delta, 0.0, delta}) {
        if (other == kept) continue;
        shift = other;
        const double now = run_bound_case(machine, shifts, settings).worst;
        if (now > worst) {
          worst = now;
          better = true;
          break;
        }
        shift = kept;
      }
    }
    if (!better) break;
  }
  return shifts;
}

std::string describe(const BoundCase& machine) {
  const Tolerance& t = machine.scene.prior.tolerance;
  std::ostringstream text;
  text << (machine.scene.model.law == ImpactLaw::newton ? "Newton, " : "") << "lost "
       << machine.lost << ", f " << machine.scene.model.coordinates() << ", m "
       << machine.scene.model.contacts.size() << ", events " << machine.events.size() << " to "
       << machine.end << ", tolerance time " << t.time << " restitution " << t.restitution
       << " stiffness " << t.stiffness << " damping " << t.damping << " force " << t.force
       << " clearance " << t.clearance << ", epsilon "
       << machine.scene.model.contacts.front().restitution << ' '
       << machine.scene.model.contacts.back().restitution << ", B(0) "
       << machine.scene.prior.uncertainty.sum();
  return text.str();
}

}  // namespace sprag::test
