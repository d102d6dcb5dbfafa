#include "sprag/detail/study/design.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/study/random.h"
#include "sprag/energy.h"
#include "sprag/reduction.h"
#include "sprag/scene_file.h"

namespace sprag::study {
namespace {

// Converts a relative deviation of the observer's value to the value.
double observed_value(const Study& study, const std::vector<double>& values, const Axis& axis,
                      double share) {
  double base = axis.base;
  for (std::size_t i = 0; i < study.axes.size(); ++i) {
    const Axis& other = study.axes[i];
    if (other.target == Target::scene && other.key == axis.key) base = values[i];
  }
  return base * (1.0 + share);
}

double drawn(const Axis& axis, Random& random) {
  const double x = random.uniform();
  if (axis.logarithmic) return axis.low * std::pow(axis.high / axis.low, x);
  return axis.low + (axis.high - axis.low) * x;
}

// Adds a value. An off-diagonal entry of a symmetric matrix, such as system.K.1.2, is set twice.
void add_value(const std::string& key, double value, std::vector<SceneValue>& values) {
  values.push_back({key, {value}});
  int row = 0, column = 0, length = 0;
  char matrix = 0;
  if (std::sscanf(key.c_str(), "system.%c.%d.%d%n", &matrix, &row, &column, &length) == 3 &&
      length == static_cast<int>(key.size()) && row != column) {
    const std::string mirrored =
        std::string("system.") + matrix + "." + std::to_string(column) + "." + std::to_string(row);
    values.push_back({mirrored, {value}});
  }
}

Scene scene_with(const Study& study, const std::vector<SceneValue>& values) {
  if (values.empty()) return study.scene;
  const std::string file = study.scene_file.string();
  return parse_scene(with_values(study.scene_text, values, file), file);
}

// A random state with this error energy; its direction is uniform on a sphere in the norm of (23)
// of Baumann & Leine 2014.
State drawn_offset(const Model& model, double energy, Random& random) {
  const NaturalModes modes = natural_modes(model);
  const Eigen::Index f = model.coordinates();
  Eigen::VectorXd eta = Eigen::VectorXd::Zero(f), eta_dot(f);
  double squares = 0.0;
  for (Eigen::Index i = 0; i < f; ++i) {
    const double of_q = random.normal();
    const double of_u = random.normal();
    // A rigid motion has no potential energy.
    if (modes.stiffness[i] > 0.0) {
      eta[i] = of_q / std::sqrt(modes.stiffness[i]);
      squares += of_q * of_q;
    }
    eta_dot[i] = of_u / std::sqrt(modes.mass[i]);
    squares += of_u * of_u;
  }
  const double scale = std::sqrt(2.0 * energy / squares);
  return {scale * (modes.Phi * eta), scale * (modes.Phi * eta_dot)};
}

bool outside(const Scene& scene) {
  return std::all_of(
      scene.model.contacts.begin(), scene.model.contacts.end(),
      [&](const Contact& contact) { return gap(contact, scene.truth.start.q, 0.0) >= 0.0; });
}

}  // namespace

std::vector<double> values_at(const Study& study, std::int64_t index) {
  std::int64_t rest = point_of(study, index);
  std::vector<std::int64_t> place(study.group_size.size());
  for (std::size_t g = place.size(); g-- > 0;) {
    place[g] = rest % study.group_size[g];
    rest /= study.group_size[g];
  }
  Random random(study.seed, stream_of(study, index), Purpose::axes);
  std::vector<double> values;
  for (const Axis& axis : study.axes) {
    values.push_back(axis.values.empty()
                         ? drawn(axis, random)
                         : axis.values[static_cast<std::size_t>(place[axis.group])]);
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Axis& axis = study.axes[i];
    if (axis.relative) values[i] = observed_value(study, values, axis, values[i]);
  }
  return values;
}

Setting setting_of(const Study& study, const std::vector<double>& values) {
  Setting setting;
  setting.disturbance = study.disturbance;
  setting.start_replica = study.start_replica;
  setting.start_machine = study.start_machine;
  setting.duration = study.duration;
  setting.tick = study.tick;
  std::vector<SceneValue> of_machine, of_observer;
  int modes = 0;
  bool jitter_given = study.jitter_given;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const Axis& axis = study.axes[i];
    const double value = values[i];
    switch (axis.target) {
      case Target::scene:
        add_value(axis.key, value, of_machine);
        break;
      case Target::observer:
        add_value(axis.key, value, of_observer);
        break;
      case Target::modes:
        modes = static_cast<int>(value);
        break;
      case Target::jitter:
        setting.disturbance.jitter = value;
        jitter_given = true;
        break;
      case Target::offset:
        setting.disturbance.offset = value;
        break;
      case Target::lost:
        setting.disturbance.lost = value;
        break;
      case Target::spurious:
        setting.disturbance.spurious = value;
        break;
      case Target::start_replica:
        setting.start_replica = value;
        break;
      case Target::start_machine:
        setting.start_machine = value;
        break;
      case Target::duration:
        setting.duration = value;
        break;
      case Target::tick:
        setting.tick = value;
        break;
    }
  }
  setting.machine = scene_with(study, of_machine);
  if (of_observer.empty()) {
    setting.observer = setting.machine;
  } else {
    // If both are varied, the observer's own value takes precedence.
    std::erase_if(of_machine, [&](const SceneValue& value) {
      return std::any_of(of_observer.begin(), of_observer.end(),
                         [&](const SceneValue& own) { return own.path == value.path; });
    });
    of_machine.insert(of_machine.end(), of_observer.begin(), of_observer.end());
    setting.observer = scene_with(study, of_machine);
  }
  if (setting.observer.model.coordinates() > setting.machine.model.coordinates()) {
    throw Error("the observer has more coordinates than the machine; must be as many at most");
  }
  const double end =
      std::min(end_of_inputs(setting.machine.model), end_of_inputs(setting.observer.model));
  if (setting.duration > end) {
    throw Error("the recorded input ends at t = " + std::to_string(end) +
                ", before the study's duration; the duration must be shorter, or the scene must "
                "have outside = \"zero\" or \"hold\"");
  }
  if (!jitter_given) setting.disturbance.jitter = setting.machine.prior.jitter;
  if (modes > 0) {
    setting.observer = in_modes(setting.observer, modes);
    setting.machine = in_modes(setting.machine, 0);
  }
  return setting;
}

void draw_starts(const Study& study, std::uint64_t stream, Setting& setting) {
  Scene& machine = setting.machine;
  if (setting.start_machine > 0.0) {
    const State center = machine.truth.start;
    constexpr int attempts = 1000;
    Random random(study.seed, stream, Purpose::start_of_machine);
    for (int attempt = 0;; ++attempt) {
      if (attempt == attempts)
        throw Error("no start of the machine outside its supports was drawn");
      const State offset = drawn_offset(machine.model, setting.start_machine, random);
      machine.truth.start = {center.q + offset.q, center.u + offset.u};
      if (machine.truth.release_penetration || outside(machine)) break;
    }
    machine.truth.given = true;
  }
  if (setting.start_replica) {
    Random random(study.seed, stream, Purpose::start_of_replica);
    const State offset = drawn_offset(machine.model, *setting.start_replica, random);
    const Eigen::Index f = setting.observer.model.coordinates();
    setting.observer.prior.start = {(machine.truth.start.q + offset.q).head(f),
                                    (machine.truth.start.u + offset.u).head(f)};
  }
  setting.observer.truth.start = {machine.truth.start.q.head(setting.observer.model.coordinates()),
                                  machine.truth.start.u.head(setting.observer.model.coordinates())};
}

}  // namespace sprag::study
