#include "sprag/detail/parameters/clock_ambiguity.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/parameters/scene_parameters.h"

namespace sprag {
namespace {

using Unknowns = std::vector<Parameter>;

bool is_sought(const Unknowns& sought, const std::string& key) {
  return std::any_of(sought.begin(), sought.end(),
                     [&](const Parameter& unknown) { return unknown.key == key; });
}

bool is_sought(const Unknowns& sought, const HarmonicGroup& group, const std::string& number) {
  return is_sought(sought, group.key + number) || is_sought(sought, "excitations" + number);
}

// The keys of the parameters by which a matrix can change as a whole: its factor, or all entries
// that are not 0. Nullopt: the matrix is held.
std::optional<std::vector<std::string>> free_matrix(const Eigen::MatrixXd& matrix,
                                                    const std::string& name,
                                                    const Unknowns& sought) {
  if (is_sought(sought, name)) return std::vector{name};
  std::vector<std::string> keys;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = i; j < matrix.cols(); ++j) {
      if (matrix(i, j) == 0.0 && matrix(j, i) == 0.0) continue;
      const std::string row = '.' + std::to_string(i + 1), column = '.' + std::to_string(j + 1);
      std::string key = name + row + column;
      if (!is_sought(sought, key)) key = name + column + row;
      if (!is_sought(sought, key)) return std::nullopt;
      keys.push_back(std::move(key));
    }
  }
  return keys;
}

// Whether a length of the machine is known: the amplitude of a motion, or clearances that no other
// start replaces. A displacement q in a direction without stiffness replaces the clearances W^T q.
bool has_known_length(const Scene& scene, const Unknowns& sought) {
  const std::vector<HarmonicGroup> groups = harmonic_groups(scene);
  for (const HarmonicGroup& group : groups) {
    const bool moves = group.of_frame || !group.contacts.empty();
    if (moves && !is_sought(sought, group, ".amplitude")) return true;
  }
  const Model& model = scene.model;
  std::vector<int> held;
  for (int i = 0; i < static_cast<int>(model.contacts.size()); ++i) {
    const std::string clearance = "contact." + std::to_string(i + 1) + ".clearance";
    if (!is_sought(sought, clearance)) held.push_back(i);
  }
  const Eigen::Index f = model.coordinates();
  Eigen::MatrixXd W_held(std::ssize(held), f);
  Eigen::VectorXd c(std::ssize(held));
  for (std::size_t i = 0; i < held.size(); ++i) {
    const Contact& contact = model.contacts[static_cast<std::size_t>(held[i])];
    W_held.row(static_cast<Eigen::Index>(i)) = contact.w.transpose();
    c[static_cast<Eigen::Index>(i)] = contact.clearance;
  }
  if (c.size() == 0 || c.isZero(0.0)) return false;
  const Eigenpairs modes = eigenpairs(model.K, model.M);
  constexpr double rounding = 1e-10;
  std::vector<Eigen::VectorXd> directions;  // W^T of the modes without stiffness, orthonormal
  for (Eigen::Index k = 0; k < f; ++k) {
    if (modes.values[k] > rounding * modes.values.cwiseAbs().maxCoeff()) continue;
    Eigen::VectorXd direction = W_held * modes.vectors.col(k);
    const double size = direction.norm();
    for (const Eigen::VectorXd& other : directions) direction -= other.dot(direction) * other;
    if (direction.norm() > rounding * size) directions.push_back(direction.normalized());
  }
  Eigen::VectorXd rest = c;
  for (const Eigen::VectorXd& direction : directions) rest -= direction.dot(rest) * direction;
  return rest.norm() > rounding * c.norm();
}

bool has_known_force(const Scene& scene, const Unknowns& sought) {
  const Model& model = scene.model;
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    const bool acts = model.forces[j].constant != 0.0;
    if (acts && !is_sought(sought, "force." + std::to_string(j + 1) + ".constant")) return true;
  }
  const std::vector<HarmonicGroup> groups = harmonic_groups(scene);
  return std::any_of(groups.begin(), groups.end(), [&](const HarmonicGroup& group) {
    return !group.of_frame && !group.forces.empty() && !is_sought(sought, group, ".amplitude");
  });
}

std::optional<ClockAmbiguity> of_rate(const Scene& scene, const Unknowns& sought) {
  ClockAmbiguity ambiguity{"clock.rate", {}};
  const auto add = [&](const std::vector<std::string>& keys) {
    for (const std::string& key : keys) {
      auto& equals = ambiguity.equals;
      if (std::find(equals.begin(), equals.end(), key) == equals.end()) equals.push_back(key);
    }
  };
  const Model& model = scene.model;
  const auto masses =
      free_matrix(model.M, scene.beam ? "beam.mass_per_length" : "system.M", sought);
  if (masses) {
    add(*masses);
  } else if (!model.K.isZero(0.0)) {
    const auto keys =
        free_matrix(model.K, scene.beam ? "beam.bending_stiffness" : "system.K", sought);
    if (!keys) return std::nullopt;
    add(*keys);
  }
  // A beam's damping ratio is a number without a unit of time.
  const bool by_ratio = scene.beam && scene.beam->damping_ratio.size() > 0;
  if (!model.C.isZero(0.0) && !by_ratio) {
    const auto keys = free_matrix(model.C, scene.beam ? "beam.damping" : "system.C", sought);
    if (!keys) return std::nullopt;
    add(*keys);
  }
  const std::vector<HarmonicGroup> groups = harmonic_groups(scene);
  for (const HarmonicGroup& group : groups) {
    if (!is_sought(sought, group, ".frequency")) return std::nullopt;
    const std::string own = group.key + ".frequency";
    add({is_sought(sought, own) ? own : "excitations.frequency"});
  }
  // A force and a length give a time only with a mass.
  const bool known = has_known_force(scene, sought) && has_known_length(scene, sought);
  if (known && !masses) return std::nullopt;
  return ambiguity;
}

std::optional<ClockAmbiguity> of_offset(const Scene& scene, const Unknowns& sought) {
  ClockAmbiguity ambiguity{"clock.offset", {}};
  const std::vector<HarmonicGroup> groups = harmonic_groups(scene);
  const bool one_frequency = std::all_of(
      groups.begin(), groups.end(),
      [&](const HarmonicGroup& group) { return group.frequency == groups.front().frequency; });
  if (is_sought(sought, "excitations.phase") && one_frequency) {
    ambiguity.equals.push_back("excitations.phase");
    return ambiguity;
  }
  for (const HarmonicGroup& group : groups) {
    const std::string own = group.key + ".phase";
    if (!is_sought(sought, own)) return std::nullopt;
    ambiguity.equals.push_back(own);
  }
  return ambiguity;
}

std::string list_of_keys(const std::vector<std::string>& keys) {
  std::string text;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (i > 0) text += i + 1 < keys.size() ? ", " : " and ";
    text += keys[i];
  }
  return text;
}

}  // namespace

std::optional<ClockAmbiguity> clock_ambiguity(const Scene& scene,
                                              const std::vector<Parameter>& sought,
                                              const Parameter& unknown) {
  if (unknown.key == "clock.rate") return of_rate(scene, sought);
  if (unknown.key == "clock.offset") return of_offset(scene, sought);
  return std::nullopt;
}

std::string to_text(const ClockAmbiguity& ambiguity) {
  const std::string text = ambiguity.key + " is not determined: ";
  if (ambiguity.equals.empty()) {
    return text +
           "the machine has no stiffness, damping or excitation with a known time, and a constant "
           "force gives none without a known length. Calibrate the clock.";
  }
  const bool one = ambiguity.equals.size() == 1;
  return text + "the same event times follow from a change of " + list_of_keys(ambiguity.equals) +
         (one ? "" : " together") + ". Hold " + (one ? "it" : "one of them") +
         ": leave it out of --free.";
}

}  // namespace sprag
