#include "studies/identification/records.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>

#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/parameters/scene_with.h"
#include "sprag/scene_file.h"
#include "studies/common/random.h"

namespace sprag::identification_study {

const std::vector<std::string> kinds{
    "beam, 1 unknown", "beam, 3", "beam, 7", "rattle", "oscillator", "near resonance", "ball, drag",
    "locked orbit", "one lost", "two lost", "one spurious", "one lost, one spurious",
    "2 lost, 2 spurious", "ball, lost bounces", "two masses", "plastic impacts",
    "all contacts last", "no scale",
    // Outside of the family.
    "damping law", "mode too few", "clock 1 %", "quadratic drag", "restitution by speed",
    "friction", "soft stop",
    // In the family again: its slope is sought.
    "slope sought"};
const std::size_t right_kinds = 18;

namespace {

using common::Random;
constexpr double pi = std::numbers::pi;
constexpr double unknown_truth = std::numeric_limits<double>::quiet_NaN();

std::string number(double value) {
  char buffer[32];
  std::snprintf(buffer, sizeof buffer, "%.17g", value);
  return buffer;
}

// A single mass in front of a stop.
struct Oscillator {
  double c = 0.0, k = 0.0, force = 0.0, frequency = 1.0, phase = 0.0, weight = 0.0;
  double clearance = 0.0, other_clearance = 0.0;  // other_clearance 0: one stop
  double restitution = 0.7, q = 0.0;
  // Departures from the model.
  double quadratic = 0.0, by_speed = 0.0, friction = 0.0, stop_stiffness = 0.0;
  bool has_slope = false;  // the scene has the restitution by speed

  Scene scene() const {
    std::string text =
        "[system]\nM = [[1.0]]\nC = [[" + number(c) + "]]\nK = [[" + number(k) + "]]\n";
    if (weight != 0.0) text += "[[force]]\ndirection = [1.0]\nconstant = " + number(-weight) + "\n";
    if (force != 0.0) {
      text += "[[force]]\ndirection = [1.0]\namplitude = " + number(force) +
              "\nfrequency = " + number(frequency) + "\nphase = " + number(phase) + "\n";
    }
    const std::string of_impacts =
        has_slope ? "{ value = " + number(restitution) + ", slope = " + number(-by_speed) + " }"
                  : number(restitution);
    text += "[impact]\nlaw = \"newton\"\nrestitution = " + of_impacts +
            "\n[[contact]]\ndirection = [1.0]\nclearance = " + number(clearance) + "\n";
    if (other_clearance > 0.0) {
      text += "[[contact]]\ndirection = [-1.0]\nclearance = " + number(other_clearance) + "\n";
    }
    return parse_scene(text + "[master]\nq = [" + number(q) + "]\n[replica]\n", "drawn.toml");
  }

  double acceleration(double t, double x, double u) const {
    double a = force * std::cos(frequency * t + phase) - weight - c * u - k * x -
               quadratic * u * std::abs(u);
    if (friction > 0.0) a -= friction * std::tanh(u / 1e-3);
    if (stop_stiffness > 0.0 && x + clearance < 0.0)
      a -= stop_stiffness * (x + clearance) + 2.0 * damper() * u;
    return a;
  }
  double damper() const {
    const double log = std::log(restitution);
    return -log / std::sqrt(pi * pi + log * log) * std::sqrt(stop_stiffness);
  }

  // Runge-Kutta steps, for machines outside of the family.
  std::vector<ContactEvent> simulated(double T, std::size_t most) const {
    std::vector<ContactEvent> events;
    double t = 0.0, x = q, u = 0.0;
    const double fastest = std::max({std::sqrt(k), frequency, std::sqrt(stop_stiffness), 10.0});
    const double h0 = 0.02 / fastest;
    const auto step = [&](double h, double& X, double& U) {
      const double k1 = acceleration(t, X, U);
      const double k2 = acceleration(t + h / 2, X + h / 2 * U, U + h / 2 * k1);
      const double k3 = acceleration(t + h / 2, X + h / 2 * U + h * h / 4 * k1, U + h / 2 * k2);
      const double k4 = acceleration(t + h, X + h * U + h * h / 2 * k2, U + h * k3);
      X += h * U + h * h / 6 * (k1 + k2 + k3);
      U += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    };
    while (t < T && events.size() < most) {
      double X = x, U = u;
      step(h0, X, U);
      const auto crossed = [&](double at, int contact) {
        return contact == 0 ? at + clearance < 0.0
                            : other_clearance > 0.0 && other_clearance - at < 0.0;
      };
      int contact = -1;
      for (const int i : {0, 1}) {
        if (!crossed(x, i) && crossed(X, i)) contact = i;
      }
      if (contact < 0) {
        x = X, u = U, t += h0;
        continue;
      }
      double low = 0.0, high = h0;
      for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (low + high);
        X = x, U = u;
        step(middle, X, U);
        (crossed(X, contact) ? high : low) = middle;
      }
      X = x, U = u;
      const bool soft = stop_stiffness > 0.0 && contact == 0;
      const double h = soft ? high : low;
      step(h, X, U);
      x = X, u = U, t += h;
      events.push_back({t, contact, ContactEventKind::pulse});
      if (soft) continue;
      u *= -std::clamp(restitution - by_speed * std::abs(u), 0.05, 1.0);
      if (std::abs(u) < 1e-4) break;
    }
    return events;
  }
};

Oscillator drawn_oscillator(Random& draw, bool two_stops) {
  Oscillator o;
  o.k = std::pow(draw.uniform(6.0, 20.0), 2);
  const double natural = std::sqrt(o.k);
  o.c = 2.0 * draw.uniform(0.01, 0.05) * natural;
  o.frequency = natural * draw.uniform(0.6, 2.2);
  o.force = draw.uniform(0.5, 3.0);
  o.phase = draw.uniform(-pi, pi);
  o.restitution = draw.uniform(0.5, 0.85);
  const double reach = o.force / o.k;
  o.clearance = reach * draw.uniform(0.2, 1.0);
  if (two_stops) o.other_clearance = reach * draw.uniform(0.5, 1.5);
  o.q = reach * draw.uniform(-0.1, 0.3);
  return o;
}

Oscillator drawn_ball(Random& draw) {
  Oscillator o;
  o.weight = 9.81;
  o.c = draw.uniform(0.05, 0.3);
  o.restitution = draw.uniform(0.8, 0.97);
  o.q = draw.uniform(0.2, 0.6);
  o.frequency = 0.0;
  return o;
}

Scene beam(Random& draw, int modes, const std::string& damping) {
  return parse_scene(
      "[beam]\nmodes = " + std::to_string(modes) + "\n" + damping +
          "\nlength = 1.0\nbending_stiffness = 1.0\nmass_per_length = 1.0\n[excitation]\namplitude "
          "= "
          "0.03\nfrequency = " +
          number(9.5 * draw.uniform(0.85, 1.15)) + "\nphase = " + number(draw.uniform(-pi, pi)) +
          "\n[impact]\nlaw = \"newton\"\nrestitution = " + number(draw.uniform(0.55, 0.85)) +
          "\n[[contact]]\nposition = " + number(draw.uniform(0.8, 0.95)) + "\nclearance = " +
          number(draw.uniform(0.0, 0.01)) + "\n[master]\nq = [-0.05]\n[replica]\n",
      "beam.toml");
}

Scene rattle(Random& draw) {
  const double k = 0.2 * std::pow(2.0 * pi * draw.uniform(1.0, 12.0), 2);
  return parse_scene(
      "[system]\nM = [[0.2]]\nK = [[" + number(k) + "]]\nC = [[" + number(draw.uniform(0.1, 0.6)) +
          "]]\n[excitation]\ninfluence = 1.0\namplitude = 0.5e-3\nfrequency = " +
          number(2.0 * pi * draw.uniform(15.0, 40.0)) +
          "\nphase = " + number(draw.uniform(-3.0, 3.0)) +
          "\n[impact]\nlaw = \"newton\"\nrestitution = " + number(draw.uniform(0.4, 0.85)) +
          "\n[[contact]]\ndirection = [1.0]\nclearance = " + number(draw.uniform(0.2e-3, 0.6e-3)) +
          "\nmount = \"frame\"\n[[contact]]\ndirection = [-1.0]\nclearance = " +
          number(draw.uniform(0.2e-3, 0.8e-3)) + "\nmount = \"frame\"\n[master]\n[replica]\n",
      "rattle.toml");
}

Scene two_masses(Random& draw) {
  const double k = draw.uniform(600.0, 1000.0), c = draw.uniform(0.001, 0.003);
  const std::string K =
      "[[" + number(2.5 * k) + ", " + number(-k) + "], [" + number(-k) + ", " + number(k) + "]]";
  const std::string C = "[[" + number(2.5 * c * k) + ", " + number(-c * k) + "], [" +
                        number(-c * k) + ", " + number(c * k) + "]]";
  return parse_scene(
      "[system]\nM = [[0.9, 0.0], [0.0, 0.6]]\nC = " + C + "\nK = " + K +
          "\n[[force]]\ndirection = [1.0, 0.0]\namplitude = " + number(draw.uniform(4.0, 8.0)) +
          "\nfrequency = " + number(draw.uniform(24.0, 34.0)) +
          "\nphase = " + number(draw.uniform(-pi, pi)) +
          "\n[impact]\nlaw = \"newton\"\nrestitution = " + number(draw.uniform(0.5, 0.8)) +
          "\n[[contact]]\ndirection = [0.0, 1.0]\nclearance = " +
          number(draw.uniform(0.001, 0.003)) + "\n[master]\n[replica]\n",
      "two.toml");
}

Scene locked(Random& draw) {
  // A ball on a shaken plate with one impact a period: amplitude and phase of the stationary orbit.
  const double restitution = draw.uniform(0.4, 0.7), frequency = draw.uniform(50.0, 80.0);
  const double period = 2.0 * pi / frequency, u = 9.81 * period / 2.0;
  // u is the speed after and before the impact; the plate's velocity v = u (1 - eps) / (1 + eps).
  const double v = u * (1.0 - restitution) / (1.0 + restitution);
  const double amplitude = v / frequency / draw.uniform(0.7, 0.95);
  const double sine = std::asin(std::min(v / (amplitude * frequency), 1.0));
  // s(t) = a cos(w t + phase) lowers the gap's support by -s; impact at t = 0+.
  const double phase = pi - (pi - sine);
  const double start = 0.0;
  (void)start;
  return parse_scene(
      "[system]\nM = [[1.0]]\nC = [[0.0]]\nK = [[0.0]]\n[[force]]\ndirection = [1.0]\nconstant = "
      "-9.81\n"
      "[impact]\nlaw = \"newton\"\nrestitution = " +
          number(restitution) + "\n[[contact]]\ndirection = [1.0]\nmotion = { amplitude = " +
          number(amplitude) + ", frequency = " + number(frequency) + ", phase = " + number(phase) +
          " }\n[master]\nq = [" + number(amplitude * 1.5) + "]\nu = [" + number(u) +
          "]\n[replica]\n",
      "locked.toml");
}

std::vector<ContactEvent> simulated(const Scene& scene, double T, std::size_t most) {
  Master master(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  master.advance(at(T), events, most);
  if (events.size() > most) events.resize(most);
  return events;
}

bool has_held(const std::vector<ContactEvent>& events) {
  return std::any_of(events.begin(), events.end(), [](const ContactEvent& event) {
    return event.kind != ContactEventKind::pulse;
  });
}

double slowest_period(const std::vector<ContactEvent>& events) {
  return (events.back().t - events.front().t) / static_cast<double>(events.size());
}

// The scene of a user: each unknown is off by up to `share`, phases by up to a radian.
Scene off(const Scene& scene, const std::vector<std::string>& keys, double share, Random& draw) {
  const std::vector<Parameter> unknowns = parameters_named(scene, keys);
  Eigen::VectorXd values = nominal_values(unknowns);
  for (std::size_t k = 0; k < keys.size(); ++k) {
    double& value = values[static_cast<Eigen::Index>(k)];
    const Parameter& unknown = unknowns[k];
    const double d = draw.uniform(-1.0, 1.0);
    if (quantity(unknown.key) == "phase") {
      value += d;
    } else if (quantity(unknown.key) == "frequency") {
      value *= 1.0 + 0.2 * share * d;
    } else {
      value *= 1.0 + share * d;
    }
    if (quantity(unknown.key) == "restitution") value = std::min(value, 0.995);
    if (quantity(unknown.key) == "position") value = std::min(value, 0.99);
  }
  return with(scene, unknowns, values);
}

double truth_of(const Scene& machine, const Scene& nominal, const std::string& key) {
  if (key == "system.C") return machine.model.C(0, 0) / nominal.model.C(0, 0);
  if (key == "system.K") return machine.model.K(0, 0) / nominal.model.K(0, 0);
  return parameter_of(machine, key).nominal;
}

void lose(std::vector<ContactEvent>& events, int count, Random& draw) {
  for (int i = 0; i < count; ++i) {
    const auto k =
        3 + static_cast<std::size_t>(draw.uniform() * static_cast<double>(events.size() - 6));
    events.erase(events.begin() + static_cast<std::ptrdiff_t>(k));
  }
}

void add_spurious(std::vector<ContactEvent>& events, int count, int contacts, Random& draw) {
  const double from = events.front().t, to = events.back().t;
  for (int i = 0; i < count; ++i) {
    events.push_back({draw.uniform(from, to), static_cast<int>(draw.uniform() * contacts),
                      ContactEventKind::pulse});
  }
  std::stable_sort(events.begin(), events.end(),
                   [](const ContactEvent& a, const ContactEvent& b) { return a.t < b.t; });
}

struct Drawn {
  Scene machine;
  std::vector<ContactEvent> events;
  std::vector<std::string> keys;
  bool right = true;
};

Drawn drawn_machine(const std::string& kind, std::uint64_t trial, Random& draw) {
  Drawn d;
  if (kind.starts_with("beam") || kind == "damping law" || kind == "mode too few") {
    const bool right = kind.starts_with("beam");
    d.machine = beam(draw, kind == "mode too few" ? 4 : 3,
                     kind == "damping law" ? "damping_ratio = 0.04" : "damping = 0.2");
    d.events = simulated(d.machine, 200.0, 60);
    d.right = right;
    d.keys = usual_keys(d.machine);
    if (kind == "beam, 1 unknown") d.keys = {"beam.bending_stiffness"};
    if (kind == "beam, 3")
      d.keys = {"impact.restitution", "beam.bending_stiffness", "excitation.phase"};
    if (!right) {  // the user's scene has three modes and a damping of the usual kind
      Random again(trial);
      Scene three = beam(again, 3, "damping = 0.2");
      three.beam->bending_stiffness = 1.0;
      d.machine = std::move(three);
      d.keys = usual_keys(d.machine);
    }
  } else if (kind == "rattle" || kind == "clock 1 %") {
    d.machine = rattle(draw);
    d.events = simulated(d.machine, 8.0, 70);
    d.keys = usual_keys(d.machine);
    if (kind == "clock 1 %") {
      for (ContactEvent& event : d.events) event.t *= 1.01;
      std::erase(d.keys, "excitation.frequency");
      d.right = false;
    }
  } else if (kind == "ball, drag" || kind == "ball, lost bounces") {
    d.machine = drawn_ball(draw).scene();
    d.events = simulated(d.machine, 20.0, kind == "ball, drag" ? 24 : 18);
    d.keys = {"impact.restitution", "system.C"};
  } else if (kind == "locked orbit") {
    d.machine = locked(draw);
    d.events = simulated(d.machine, 12.0, 140);
    if (d.events.size() > 60) d.events.erase(d.events.begin(), d.events.end() - 60);
    d.keys = {"impact.restitution", "contact.1.motion.phase", "contact.1.motion.frequency"};
    if (has_held(d.events) || d.events.size() < 60) d.events.clear();
    for (std::size_t k = 2; k < d.events.size(); ++k) {
      const double a = d.events[k].t - d.events[k - 1].t, b = d.events[k - 1].t - d.events[k - 2].t;
      if (std::abs(a - b) > 2e-3 * a) {
        d.events.clear();
        break;
      }
    }
  } else if (kind == "two masses") {
    d.machine = two_masses(draw);
    d.events = simulated(d.machine, 20.0, 50);
    d.keys = usual_keys(d.machine);
  } else if (kind == "plastic impacts" || kind == "all contacts last") {
    Oscillator o = drawn_oscillator(draw, false);
    o.frequency = std::sqrt(o.k) * draw.uniform(0.3, 0.9);
    o.clearance *= 0.3;
    o.restitution = 0.0;
    d.machine = o.scene();
    d.events = simulated(d.machine, 100.0, 60);
    d.keys = {"system.K", "system.C", "excitation.phase", "contact.1.clearance"};
    for (std::string& key : d.keys)
      if (key == "excitation.phase") key = "force.1.phase";
    if (kind == "plastic impacts") d.keys = {"system.K", "force.1.phase"};
    if (!has_held(d.events)) d.events.clear();
    return d;
  } else if (kind == "no scale") {
    Oscillator o;
    o.k = draw.uniform(50.0, 500.0);
    o.c = draw.uniform(0.02, 0.1);
    o.restitution = draw.uniform(0.9, 0.98);
    o.q = 0.2;
    d.machine = o.scene();
    d.events = simulated(d.machine, 20.0, 20);
    d.keys = {"system.K"};
  } else {
    Oscillator o = drawn_oscillator(
        draw, draw.uniform() < 0.5 && kind != "soft stop" && kind != "near resonance");
    if (kind == "near resonance") {
      o.frequency = std::sqrt(o.k) * draw.uniform(0.97, 1.05);
      o.clearance *= 3.0;
    }
    if (kind == "quadratic drag")
      o.quadratic = draw.uniform(0.2, 1.0) / std::max(o.clearance, 1e-3);
    const bool has_slope = kind == "slope sought";
    if (kind == "restitution by speed" || has_slope) {
      o = drawn_ball(draw);
      o.by_speed = draw.uniform(0.01, 0.04);
      o.has_slope = has_slope;
    }
    if (kind == "friction") o.friction = draw.uniform(0.01, 0.05) * o.force;
    if (kind == "soft stop") o.stop_stiffness = o.k * std::pow(draw.uniform(30.0, 100.0), 2);
    d.machine = o.scene();
    const bool wrong =
        o.quadratic > 0.0 || o.by_speed > 0.0 || o.friction > 0.0 || o.stop_stiffness > 0.0;
    d.right = o.by_speed == 0.0 || has_slope;
    d.events = wrong ? o.simulated(60.0, o.weight > 0.0 ? 22 : 50) : simulated(d.machine, 60.0, 50);
    d.keys = has_slope
                 ? std::vector<std::string>{"impact.restitution.value", "impact.restitution.slope"}
             : o.weight > 0.0 ? std::vector<std::string>{"impact.restitution", "system.C"}
                              : usual_keys(d.machine);
  }
  if (has_held(d.events) && kind != "locked orbit") d.events.clear();
  return d;
}

}  // namespace

std::vector<std::string> usual_keys(const Scene& scene) {
  std::vector<std::string> keys;
  const std::vector<Parameter> all = parameters_of(scene);
  const bool one = all.front().key == "impact.restitution";
  for (const Parameter& unknown : all) {
    const std::string_view of = quantity(unknown.key);
    const bool of_contact = of == "restitution" && unknown.key.starts_with("contact.");
    if (of == "amplitude" || of == "constant") continue;
    if (one && of_contact) continue;
    keys.push_back(unknown.key);
  }
  return keys;
}

double error_of(const Parameter& unknown, double value, double truth) {
  const double error = unknown.coordinate(value) - unknown.coordinate(truth);
  return quantity(unknown.key) == "phase" ? std::remainder(error, 2.0 * std::numbers::pi) : error;
}

Record drawn(const std::string& kind, std::uint64_t trial) {
  const auto at =
      static_cast<std::uint64_t>(std::find(kinds.begin(), kinds.end(), kind) - kinds.begin());
  for (std::uint64_t again = 0;; ++again) {
    const std::uint64_t seed = 1'000'000 * (at + 1) + 1000 * trial + again;
    Random draw(seed);
    Drawn d;
    try {
      d = drawn_machine(kind, seed, draw);
    } catch (const Error&) {
      continue;
    }
    const bool ball =
        kind.starts_with("ball") || kind == "restitution by speed" || kind == "slope sought";
    if (d.events.size() < (ball ? 14U : kind == "no scale" ? 12U : 30U)) continue;
    Record record;
    const double share = trial % 3 == 0 ? 0.0 : trial % 3 == 1 ? 1e-4 : 1e-3;
    record.jitter = share * slowest_period(d.events);
    const int lost =
        kind == "one lost" || kind == "one lost, one spurious"                               ? 1
        : kind == "two lost" || kind == "2 lost, 2 spurious" || kind == "ball, lost bounces" ? 2
                                                                                             : 0;
    const int spurious = kind == "2 lost, 2 spurious" ? 2 : kind.ends_with("one spurious") ? 1 : 0;
    lose(d.events, kind == "ball, lost bounces" ? 1 + static_cast<int>(trial % 2) : lost, draw);
    std::vector<double> last(d.machine.model.contacts.size(), -1e300);
    double before = -1e300;
    for (ContactEvent& event : d.events) {
      before = event.t = std::max(before, event.t + record.jitter * draw.normal());
    }
    add_spurious(d.events, spurious, static_cast<int>(d.machine.model.contacts.size()), draw);
    record.nominal = off(d.machine, d.keys, 0.1, draw);
    record.events = d.events;
    record.settings.unknowns = parameters_named(record.nominal, d.keys);
    if (trial % 2 == 0 && record.jitter > 0.0) record.settings.jitter = record.jitter;
    for (const std::string& key : d.keys) {
      record.truth.push_back(d.right ? truth_of(d.machine, record.nominal, key) : unknown_truth);
    }
    return record;
  }
}

}  // namespace sprag::identification_study
