#include "sprag/detail/parameters/scene_number.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string>

#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

using Index = Eigen::Index;

template <class T>
T* at(std::vector<T>& list, Index i) {
  return i < std::ssize(list) ? &list[static_cast<std::size_t>(i)] : nullptr;
}

double* at(Eigen::VectorXd& vector, Index i) { return i < vector.size() ? &vector[i] : nullptr; }

// An entry of a system's matrix as given.
double* at(const Scene& scene, Eigen::MatrixXd& matrix, Index i, Index j) {
  const bool given = !scene.beam && !scene.kept;
  return given && i < matrix.rows() && j < matrix.cols() ? &matrix(i, j) : nullptr;
}

Beam* beam_of(Scene& scene, bool by_ratio) {
  return scene.beam && (scene.beam->damping_ratio.size() > 0) == by_ratio ? &*scene.beam : nullptr;
}

// A force of the file, not that of a shaken frame.
Force* force_of(Scene& scene, Index i) {
  const bool of_frame = scene.frame && scene.frame->force == static_cast<std::size_t>(i);
  return scene.beam || of_frame ? nullptr : at(scene.model.forces, i);
}

// The motion of a support that does not follow from that of a frame.
Harmonic* motion_of(Scene& scene, Index i) {
  Contact* contact = scene.beam ? nullptr : at(scene.model.contacts, i);
  const bool of_frame =
      scene.frame && std::find(scene.frame->on_ground.begin(), scene.frame->on_ground.end(), i) !=
                         scene.frame->on_ground.end();
  return contact != nullptr && !of_frame && contact->motion.frequency > 0.0 ? &contact->motion
                                                                            : nullptr;
}

template <class T, class Member>
double* member(T* of, Member number) {
  return of != nullptr ? &(of->*number) : nullptr;
}

template <double Harmonic::*number>
double* of_force(Scene& scene, Index i, Index) {
  Force* force = force_of(scene, i);
  return force != nullptr && force->harmonic.frequency > 0.0 ? &(force->harmonic.*number) : nullptr;
}

template <double Harmonic::*number>
double* of_support(Scene& scene, Index i, Index) {
  return member(motion_of(scene, i), number);
}

struct Pattern {
  std::string_view key;  // # for a number
  std::string_view unit;
  double* (*at)(Scene&, Index, Index);
};

constexpr auto patterns = std::to_array<Pattern>({
    {"contact.#.clearance", "m",
     [](Scene& s, Index i, Index) { return member(at(s.model.contacts, i), &Contact::clearance); }},
    {"contact.#.restitution", "",
     [](Scene& s, Index i, Index) {
       return member(at(s.model.contacts, i), &Contact::restitution);
     }},
    {"contact.#.restitution.value", "",
     [](Scene& s, Index i, Index) {
       return member(at(s.model.contacts, i), &Contact::restitution);
     }},
    {"contact.#.restitution.slope", "s/m",
     [](Scene& s, Index i, Index) {
       Contact* of = at(s.model.contacts, i);
       return of != nullptr ? &of->curve.slope : nullptr;
     }},
    {"contact.#.position", "m",
     [](Scene& s, Index i, Index) { return s.beam ? at(s.positions, i) : nullptr; }},
    {"contact.#.direction.#", "",
     [](Scene& s, Index i, Index j) {
       Contact* of = s.beam || s.kept ? nullptr : at(s.model.contacts, i);
       return of != nullptr ? at(of->w, j) : nullptr;
     }},
    {"contact.#.motion.amplitude", "m", &of_support<&Harmonic::amplitude>},
    {"contact.#.motion.frequency", "rad/s", &of_support<&Harmonic::frequency>},
    {"contact.#.motion.phase", "rad", &of_support<&Harmonic::phase>},
    {"force.#.constant", "N",
     [](Scene& s, Index i, Index) { return member(force_of(s, i), &Force::constant); }},
    {"force.#.amplitude", "N", &of_force<&Harmonic::amplitude>},
    {"force.#.frequency", "rad/s", &of_force<&Harmonic::frequency>},
    {"force.#.phase", "rad", &of_force<&Harmonic::phase>},
    {"force.#.direction.#", "",
     [](Scene& s, Index i, Index j) {
       Force* of = s.kept ? nullptr : force_of(s, i);
       return of != nullptr ? at(of->direction, j) : nullptr;
     }},
    {"excitation.influence.#", "",
     [](Scene& s, Index i, Index) {
       return s.frame && !s.kept ? at(s.frame->influence, i) : nullptr;
     }},
    {"system.M.#.#", "kg", [](Scene& s, Index i, Index j) { return at(s, s.model.M, i, j); }},
    {"system.C.#.#", "N s/m", [](Scene& s, Index i, Index j) { return at(s, s.model.C, i, j); }},
    {"system.K.#.#", "N/m", [](Scene& s, Index i, Index j) { return at(s, s.model.K, i, j); }},
    {"beam.length", "m",
     [](Scene& s, Index, Index) { return s.beam ? &s.beam->length : nullptr; }},
    {"beam.mass_per_length", "kg/m",
     [](Scene& s, Index, Index) { return s.beam ? &s.beam->mass_per_length : nullptr; }},
    {"beam.bending_stiffness", "N m^2",
     [](Scene& s, Index, Index) { return s.beam ? &s.beam->bending_stiffness : nullptr; }},
    {"beam.damping", "N s/m^2",
     [](Scene& s, Index, Index) { return member(beam_of(s, false), &Beam::damping); }},
    {"beam.damping_ratio.#", "",
     [](Scene& s, Index i, Index) {
       Beam* of = beam_of(s, true);
       return of != nullptr ? at(of->damping_ratio, i) : nullptr;
     }},
    {"clock.rate", "", [](Scene& s, Index, Index) { return &s.clock.rate; }},
    {"clock.offset", "s", [](Scene& s, Index, Index) { return &s.clock.offset; }},
});

bool is_number(std::string_view word) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  return !word.empty() && std::all_of(word.begin(), word.end(), is_digit);
}

// Replaces the numbers of a key by # and appends them to `numbers`, from 0. Empty: a number is 0 or
// too large.
std::string pattern_of(std::string_view key, std::vector<Index>& numbers) {
  std::string pattern;
  for (std::size_t begin = 0; begin <= key.size();) {
    const std::size_t end = std::min(key.find('.', begin), key.size());
    const std::string_view word = key.substr(begin, end - begin);
    if (begin > 0) pattern += '.';
    if (is_number(word)) {
      int number = 0;
      const auto read = std::from_chars(word.data(), word.data() + word.size(), number);
      if (read.ec != std::errc() || word.front() == '0') return {};
      numbers.push_back(number - 1);
      pattern += '#';
    } else {
      pattern += word;
    }
    begin = end + 1;
  }
  return pattern;
}

}  // namespace

void SceneNumber::set(double to, Scene& scene) const {
  *at(scene, i, j) = to;
  if (symmetric) *at(scene, j, i) = to;
}

std::optional<SceneNumber> scene_number(Scene scene, std::string_view key) {
  std::vector<Index> numbers;
  const std::string pattern = pattern_of(key, numbers);
  numbers.resize(2, 0);
  const auto known = std::find_if(patterns.begin(), patterns.end(),
                                  [&](const Pattern& of) { return of.key == pattern; });
  if (known == patterns.end()) return std::nullopt;
  const double* const number = known->at(scene, numbers[0], numbers[1]);
  if (number == nullptr) return std::nullopt;
  const bool symmetric = pattern.starts_with("system.");
  return SceneNumber{known->unit, known->at, numbers[0], numbers[1], symmetric, *number};
}

void update_from(const Scene& nominal, Scene& scene) {
  Model& model = scene.model;
  const auto number = [](Index i) { return static_cast<std::size_t>(i); };
  if (scene.beam) {
    const Beam &beam = *scene.beam, &before = *nominal.beam;
    const double mass = beam.mass_per_length * beam.length;
    const double inertia = mass / (before.mass_per_length * before.length);
    const double bending = beam.bending_stiffness / before.bending_stiffness /
                           (square(beam.length / before.length) * (beam.length / before.length));
    for (Index i = 0; i < model.K.rows(); ++i) {
      const double k = nominal.model.K(i, i) * bending;
      model.M(i, i) = nominal.model.M(i, i) * inertia;
      model.K(i, i) = k;
      model.C(i, i) = beam.damping_ratio.size() == 0
                          ? beam.damping * beam.length
                          : 2.0 * beam.damping_ratio[i] * std::sqrt(mass * k);
    }
    for (std::size_t j = 0; j < model.forces.size(); ++j) {
      model.forces[j].direction = inertia * nominal.model.forces[j].direction;
    }
    return;
  }
  if (!scene.frame) return;
  const ShakenFrame& frame = *scene.frame;
  const bool moved = frame.influence != nominal.frame->influence;
  if (moved || model.M != nominal.model.M) {
    model.forces[frame.force].direction.noalias() = -model.M.lazyProduct(frame.influence);
  }
  for (const int i : frame.on_ground) {
    Contact& contact = model.contacts[number(i)];
    const Contact& before = nominal.model.contacts[number(i)];
    if (!moved && contact.w == before.w) continue;
    const double share = contact.w.dot(frame.influence);
    contact.motion.amplitude = share * frame.motion.amplitude;
    if (contact.input) contact.input_share = share;
  }
}

std::string_view quantity(std::string_view key) {
  while (!key.empty()) {
    const std::size_t dot = key.rfind('.');
    const std::string_view word = key.substr(dot == key.npos ? 0 : dot + 1);
    if (dot == key.npos || (word != "value" && !is_number(word))) return word;
    key = key.substr(0, dot);
  }
  return key;
}

bool is_of_harmonic(std::string_view key) {
  const std::string_view of = quantity(key);
  return of == "amplitude" || of == "frequency" || of == "phase";
}

bool is_of_entry(std::string_view key) { return is_number(key.substr(key.rfind('.') + 1)); }

}  // namespace sprag
