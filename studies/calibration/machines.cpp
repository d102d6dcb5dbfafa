#include "studies/calibration/machines.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/energy.h"
#include "sprag/scene_file.h"
#include "studies/common/random.h"

namespace sprag::calibration {
namespace {

using common::Random;

constexpr double usual_periods = 120.0;
constexpr double of_first_energy = 3.0;  // uncertainty over V(0)
// Limits on the number of events of random machines.
constexpr std::size_t fewest_events = 60;
constexpr std::size_t most_events = 1500;
constexpr std::ptrdiff_t fewest_chatters = 8;

constexpr std::string_view of_modes = "modes:";
constexpr std::string_view of_random = "random:";
constexpr std::string_view of_chatter = "chatter:";

double uniform(Random& random, double low, double high) {
  return low + (high - low) * random.uniform();
}

double log_uniform(Random& random, double low, double high) {
  return low * std::pow(high / low, random.uniform());
}

int integer(Random& random, int low, int high) {
  return low + static_cast<int>(random.uniform() * (high - low + 1));
}

std::string text(double value) {
  std::string number;
  append_number(number, value);
  return number;
}

template <typename Values>
std::string list(const Values& values) {
  std::string line = "[";
  for (const double value : values) {
    if (line.size() > 1) line += ", ";
    line += text(value);
  }
  return line + "]";
}

std::string impact(Random& random) {
  return "[impact]\nrestitution = " + text(uniform(random, 0.3, 0.8)) + '\n';
}

// A start of the replica whose error is a few times the machine's own motion.
std::string starts(Random& random, const std::vector<double>& sizes) {
  std::vector<double> q_m, q_s;
  for (const double size : sizes) {
    q_m.push_back(0.5 * size * random.normal());
    q_s.push_back(2.0 * size * random.normal());
  }
  return "[master]\nq = " + list(q_m) + "\n[replica]\nq = " + list(q_s) + '\n';
}

std::string beam_table(const Beam& beam) {
  return "[beam]\nmodes = " + std::to_string(beam.modes) +
         "\nlength = 1.0\nbending_stiffness = 1.0\nmass_per_length = 1.0\ndamping = " +
         text(beam.damping) + '\n';
}

// Deflections with equal energy in each mode.
std::vector<double> sizes(const Beam& beam) {
  std::vector<double> all;
  const Eigen::VectorXd K = stiffness(beam);
  for (const double k : K) all.push_back(0.03 * std::sqrt(K[0] / k));
  return all;
}

// Keys of an excitation or a force. Each draw has its own statement, because C++ does not fix the
// order of operands.
std::string shaking(Random& random, double amplitude) {
  std::string keys = "amplitude = " + text(amplitude);
  keys += "\nfrequency = " + text(uniform(random, 3.0, 25.0));
  keys += "\nphase = " + text(uniform(random, 0.0, 6.0)) + '\n';
  return keys;
}

std::string random_beam(Random& random) {
  Beam beam;
  beam.modes = integer(random, 2, 8);
  beam.damping = log_uniform(random, 0.2, 2.0);
  const double amplitude = log_uniform(random, 0.01, 0.1);
  std::string scene = beam_table(beam) + "[excitation]\n" + shaking(random, amplitude);
  scene += impact(random);
  for (int i = integer(random, 1, 3); i > 0; --i) {
    scene += "[[contact]]\nposition = " + text(uniform(random, 0.4, 1.0));
    scene += "\nclearance = " + text(uniform(random, 0.0, 0.03));
    scene += random.uniform() < 0.6 ? "\nside = \"below\"" : "\nside = \"above\"";
    scene += random.uniform() < 0.5 ? "\nmount = \"ground\"\n" : "\nmount = \"frame\"\n";
  }
  return scene + starts(random, sizes(beam));
}

std::string unit_vector(int of, double sign, int f) {
  Eigen::VectorXd e = Eigen::VectorXd::Zero(f);
  e[of] = sign;
  return list(e);
}

std::string chain(Random& random, int f) {
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(f, f);
  Eigen::MatrixXd C = M;
  Eigen::MatrixXd K = M;
  for (int i = 0; i < f; ++i) {
    M(i, i) = log_uniform(random, 0.5, 2.0);
    // A spring and a dashpot to the previous mass, for the first mass to the wall.
    const double k = log_uniform(random, 20.0, 400.0);
    const double c = log_uniform(random, 0.2, 2.0);
    for (const auto& [A, value] : {std::pair(&K, k), std::pair(&C, c)}) {
      (*A)(i, i) += value;
      if (i == 0) continue;
      (*A)(i - 1, i - 1) += value;
      (*A)(i, i - 1) -= value;
      (*A)(i - 1, i) -= value;
    }
  }
  const auto matrix = [&](const char* name, const Eigen::MatrixXd& A) {
    std::string line = std::string(name) + " = [";
    for (int i = 0; i < f; ++i) {
      if (i > 0) line += ", ";
      line += list(A.row(i));
    }
    return line + "]\n";
  };
  return "[system]\n" + matrix("M", M) + matrix("C", C) + matrix("K", K);
}

std::string random_chain(Random& random) {
  const int f = integer(random, 2, 5);
  std::string scene = chain(random, f);
  scene += "[[force]]\ndirection = " + unit_vector(integer(random, 0, f - 1), 1.0, f) + '\n';
  const double amplitude = log_uniform(random, 2.0, 10.0);
  scene += shaking(random, amplitude);
  scene += impact(random);
  // Each contact has its own mass: two at one mass would be stops on both sides.
  for (int i = integer(random, 1, std::min(f, 3)); i > 0; --i) {
    const double sign = random.uniform() < 0.5 ? 1.0 : -1.0;
    scene += "[[contact]]\ndirection = " + unit_vector(f - i, sign, f);
    scene += "\nclearance = " + text(uniform(random, 0.0, 0.03)) + '\n';
  }
  return scene + starts(random, std::vector<double>(static_cast<std::size_t>(f), 0.03));
}

// Masses that are pressed against supports and shaken: contacts are sustained.
std::string random_loaded_chain(Random& random) {
  const int f = integer(random, 2, 5);
  std::string scene = chain(random, f);
  const int supported = integer(random, 1, std::min(f, 3));
  Eigen::VectorXd pressed = Eigen::VectorXd::Zero(f);
  pressed.tail(supported).setConstant(-1.0);
  const double amplitude = log_uniform(random, 2.0, 10.0);
  scene += "[[force]]\ndirection = " + list(pressed);
  scene += "\nconstant = " + text(amplitude * uniform(random, 0.3, 1.5)) + '\n';
  scene += shaking(random, amplitude);
  scene += impact(random);
  for (int i = supported; i > 0; --i) {
    scene += "[[contact]]\ndirection = " + unit_vector(f - i, 1.0, f) + '\n';
  }
  return scene + starts(random, std::vector<double>(static_cast<std::size_t>(f), 0.03));
}

// A beam that swings freely on a support at its rest position: chatter until the end.
std::string random_free_beam(Random& random) {
  Beam beam;
  beam.modes = integer(random, 3, 8);
  beam.damping = log_uniform(random, 0.05, 0.3);
  std::string scene = beam_table(beam);
  scene += impact(random);
  scene += "[[contact]]\nposition = " + text(uniform(random, 0.5, 1.0)) + '\n';
  return scene + starts(random, sizes(beam));
}

// Whether the master can start, and is hit repeatedly or chatters.
bool is_of_use(const Scene& scene, Kind kind) {
  const double T = usual_duration(scene.model);
  try {
    Master master(scene.model, scene.truth.start);
    std::vector<ContactEvent> events;
    const bool few = master.advance(at(0.5 * T), events, most_events);
    if (kind == Kind::chattering) {
      return std::count_if(events.begin(), events.end(), [](const ContactEvent& event) {
               return event.kind == ContactEventKind::closes;
             }) >= fewest_chatters;
    }
    const std::size_t first_half = events.size();
    return few && master.advance(at(T), events, most_events) &&
           events.size() >= first_half + fewest_events / 2;
  } catch (const SimulationError&) {
    return false;
  }
}

Scene with_uncertainty(Scene scene) {
  if (scene.prior.uncertainty.size() > 0) return scene;
  const double V = ErrorEnergy(scene.model)(scene.truth.start.q, scene.truth.start.u,
                                            scene.prior.start.q, scene.prior.start.u)[0];
  const Eigen::Index f = scene.model.coordinates();
  if (V > 0.0) scene.prior.uncertainty.setConstant(f, of_first_energy * V / static_cast<double>(f));
  return scene;
}

std::uint64_t number(std::string_view digits, const std::string& name) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc{} || end != digits.data() + digits.size() || value == 0) {
    throw std::invalid_argument(name + ": must be a scene file, modes:N, random:SEED, " +
                                "chatter:SEED, or FIRST-LAST for SEED, counted from 1");
  }
  return value;
}

}  // namespace

std::vector<std::string> usual_machines() {
  const std::string folder = SPRAG_SOURCE_DIR "/scenes/";
  return {folder + "paper_beam_frame.toml",
          folder + "paper_beam_chatter.toml",
          folder + "two_stops_beam.toml",
          folder + "lab_rig.toml",
          folder + "steel_ruler.toml",
          "modes:8",
          "modes:20",
          "modes:60",
          "random:1",
          "random:2",
          "random:3",
          "random:4"};
}

std::vector<Scene> machines(const std::string& name) {
  std::vector<Scene> scenes;
  if (name.starts_with(of_modes)) {
    const std::uint64_t modes = number(name.substr(of_modes.size()), name);
    // The start of the paper's beam has three modes only.
    if (modes < 3 || modes > 200) throw std::invalid_argument(name + ": must have 3 to 200 modes");
    const std::string file = SPRAG_SOURCE_DIR "/scenes/paper_beam.toml";
    const SceneValue value{"beam.modes", {static_cast<double>(modes)}};
    scenes.push_back(parse_scene(with_values(read_whole(file), {value}, file), file));
    scenes.back().name = name;
  } else if (name.starts_with(of_random) || name.starts_with(of_chatter)) {
    const Kind kind = name.starts_with(of_random) ? Kind::hit : Kind::chattering;
    const std::string prefix = name.substr(0, name.find(':') + 1);
    const std::string seeds = name.substr(prefix.size());
    const std::size_t dash = seeds.find('-');
    const std::uint64_t first = number(seeds.substr(0, dash), name);
    const std::uint64_t last =
        dash == std::string::npos ? first : number(seeds.substr(dash + 1), name);
    for (std::uint64_t seed = first; seed <= last; ++seed) {
      const std::string one = prefix + std::to_string(seed);
      scenes.push_back(parse_scene(random_scene(kind, seed), one));
      scenes.back().name = one;
    }
  } else {
    scenes.push_back(read_scene(name));
  }
  for (Scene& scene : scenes) scene = with_uncertainty(scene);
  return scenes;
}

std::string random_scene(Kind kind, std::uint64_t seed) {
  Random random(seed);
  const bool odd = seed % 2 == 1;
  const auto draw = [&] {
    if (kind == Kind::hit) return odd ? random_beam(random) : random_chain(random);
    return odd ? random_free_beam(random) : random_loaded_chain(random);
  };
  while (true) {
    std::string scene = draw();
    try {
      if (is_of_use(parse_scene(scene, "random"), kind)) return scene;
    } catch (const SceneError&) {  // the start is inside a support
    }
  }
}

double usual_duration(const Model& model) {
  const NaturalModes modes = natural_modes(model);
  double slowest = std::numeric_limits<double>::infinity();
  const auto take = [&](double omega) {
    if (omega > 0.0) slowest = std::min(slowest, omega);
  };
  for (Eigen::Index i = 0; i < modes.mass.size(); ++i) {
    take(std::sqrt(modes.stiffness[i] / modes.mass[i]));
  }
  for (const Force& force : model.forces) take(force.harmonic.frequency);
  for (const Contact& contact : model.contacts) take(contact.motion.frequency);
  if (!std::isfinite(slowest)) return 0.0;
  return to_digits(usual_periods * 2.0 * std::numbers::pi / slowest, 2);
}

double to_digits(double value, int digits) {
  // Powers of ten >= 1 are exact in double. The quotient by one is the double closest to the
  // decimal number.
  const double power = std::floor(std::log10(value)) - digits + 1;
  const double scale = std::pow(10.0, std::abs(power));
  return power < 0.0 ? std::round(value * scale) / scale : scale * std::round(value / scale);
}

double highest_frequency(const Model& model) {
  const NaturalModes modes = natural_modes(model);
  return std::sqrt(modes.stiffness.cwiseQuotient(modes.mass).maxCoeff());
}

}  // namespace sprag::calibration
