#include "sprag/detail/parameters/parameters.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "sprag/detail/parameters/unknowns.h"

namespace sprag {
namespace {

constexpr double largest_error_share = 0.3;  // largest relative error of a positive number
constexpr double largest_clearance = 0.2;    // of a clearance, over the displacement
constexpr double largest_detuning = 0.1;     // largest relative error of a frequency

template <typename Visit>
void for_each_harmonic(Model& model, Visit visit) {
  const auto moves = [](const Harmonic& harmonic) {
    return harmonic.amplitude != 0.0 && harmonic.frequency > 0.0;
  };
  for (Force& force : model.forces) {
    if (moves(force.harmonic)) visit(force.harmonic);
  }
  for (Contact& contact : model.contacts) {
    if (moves(contact.motion)) visit(contact.motion);
  }
}

std::vector<Harmonic> harmonics_of(Model model) {
  std::vector<Harmonic> harmonics;
  for_each_harmonic(model, [&](const Harmonic& harmonic) { harmonics.push_back(harmonic); });
  return harmonics;
}

// Whether a value is the same for all.
template <typename Of, typename Value>
bool same(const std::vector<Of>& all, Value value) {
  return std::all_of(all.begin(), all.end(),
                     [&](const Of& one) { return value(one) == value(all.front()); });
}

bool is_one_restitution(const Model& model) {
  return same(model.contacts, [](const Contact& contact) { return contact.restitution; });
}

// Whether the frame is the machine's only excitation.
bool is_shaken_alone(const Scene& scene, const std::vector<Harmonic>& harmonics) {
  if (scene.beam) return true;
  if (!scene.frame) return false;
  const auto moved = [&](int i) {
    return scene.model.contacts[static_cast<std::size_t>(i)].motion.amplitude != 0.0;
  };
  const auto& ground = scene.frame->on_ground;
  return std::ssize(harmonics) == 1 + std::count_if(ground.begin(), ground.end(), moved);
}

// Amplitude of a beam's frame motion e(t), from its force -e''(t). Other machines have one
// amplitude for each harmonic.
double amplitude_of(const Scene& scene, const std::vector<Harmonic>& harmonics) {
  const Harmonic& first = harmonics.front();
  if (scene.beam) return std::abs(first.amplitude) / (first.frequency * first.frequency);
  if (is_shaken_alone(scene, harmonics)) return scene.frame->motion.amplitude;
  return harmonics.size() == 1 ? first.amplitude : 1.0;
}

Parameter around(Quantity quantity, std::string name, std::string unit, double nominal) {
  Parameter parameter{
      .quantity = quantity, .name = std::move(name), .unit = std::move(unit), .nominal = nominal};
  const double width = largest_error_share * std::abs(nominal);
  parameter.lowest = nominal - width;
  parameter.highest = nominal + width;
  return parameter;
}

std::string of_contact(const char* name, int contact, std::size_t contacts) {
  return contacts == 1 ? name : std::string(name) + " of contact " + std::to_string(contact + 1);
}

void add_restitutions(const Model& model, std::vector<Parameter>& parameters) {
  const std::size_t m = model.contacts.size();
  if (is_one_restitution(model)) {
    Parameter all = around(Quantity::restitution, m == 1 ? "restitution" : "restitution of all", "",
                           model.contacts.front().restitution);
    all.lowest = 0.0;
    all.highest = 1.0;
    all.relative = all.nominal != 0.0;
    parameters.push_back(all);
  } else {
    double largest = 0.0;
    for (const Contact& contact : model.contacts) largest = std::max(largest, contact.restitution);
    Parameter all = around(Quantity::restitution, "factor on restitutions", "", 1.0);
    all.lowest = 0.0;
    all.highest = 1.0 / largest;
    parameters.push_back(all);
  }
  for (int i = 0; m > 1 && i < static_cast<int>(m); ++i) {
    Parameter own = around(Quantity::restitution, of_contact("restitution", i, m), "",
                           model.contacts[static_cast<std::size_t>(i)].restitution);
    own.contact = i;
    own.lowest = 0.0;
    own.highest = 1.0;
    own.relative = own.nominal != 0.0;
    parameters.push_back(own);
  }
}

void add_excitation(const Scene& scene, std::vector<Parameter>& parameters) {
  const std::vector<Harmonic> harmonics = harmonics_of(scene.model);
  if (harmonics.empty()) return;
  const bool of_frame = is_shaken_alone(scene, harmonics);
  const bool one = of_frame || harmonics.size() == 1;
  parameters.push_back(around(Quantity::amplitude,
                              one ? "excitation amplitude" : "factor on excitations",
                              of_frame ? "m" : "", amplitude_of(scene, harmonics)));
  Parameter phase{.quantity = Quantity::phase,
                  .name = one ? "excitation phase" : "phase of all excitations",
                  .unit = "rad"};
  phase.nominal = one ? harmonics.front().phase : 0.0;
  phase.lowest = phase.nominal - std::numbers::pi;
  phase.highest = phase.nominal + std::numbers::pi;
  phase.cyclic = true;
  phase.relative = false;
  parameters.push_back(phase);
  const double common = only_frequency(scene.model);
  Parameter frequency =
      around(Quantity::frequency, common > 0.0 ? "excitation frequency" : "factor on frequencies",
             common > 0.0 ? "rad/s" : "", common > 0.0 ? common : 1.0);
  frequency.lowest = (1.0 - largest_detuning) * frequency.nominal;
  frequency.highest = (1.0 + largest_detuning) * frequency.nominal;
  parameters.push_back(frequency);
  if (common > 0.0 || has_sampled_inputs(scene.model)) return;
  // A larger offset than half of the slowest period is equivalent to a smaller one.
  double slowest = harmonics.front().frequency;
  for (const Harmonic& harmonic : harmonics) slowest = std::min(slowest, harmonic.frequency);
  Parameter offset{.quantity = Quantity::clock_offset, .name = "clock offset", .unit = "s"};
  const double half_a_period = scene.clock.rate * std::numbers::pi / slowest;
  offset.nominal = scene.clock.offset;
  offset.lowest = offset.nominal - half_a_period;
  offset.highest = offset.nominal + half_a_period;
  offset.relative = false;
  parameters.push_back(offset);
}

// Gain and delay of each record, by their keys in the scene file.
void add_records(const Scene& scene, std::vector<Parameter>& parameters) {
  int record = 0;
  for (const RecordedInput& input : recorded_inputs(scene)) {
    const SampledInput::Settings& settings = input.input->settings();
    Parameter gain = around(Quantity::gain, input.key + ".gain", "", settings.gain);
    Parameter delay{.quantity = Quantity::delay, .name = input.key + ".delay", .unit = "s"};
    const double half_a_period = std::numbers::pi / mean_frequency(*input.input);
    delay.nominal = settings.delay;
    delay.lowest = delay.nominal - half_a_period;
    delay.highest = delay.nominal + half_a_period;
    delay.relative = false;
    gain.record = delay.record = record++;
    parameters.push_back(gain);
    parameters.push_back(delay);
  }
}

// The machine with another gain or delay of a record.
void set_record(const Scene& scene, const Parameter& parameter, double value, Model& model) {
  const RecordedInput record = recorded_inputs(scene)[static_cast<std::size_t>(parameter.record)];
  const SampledInput::Settings& settings = record.input->settings();
  const bool is_gain = parameter.quantity == Quantity::gain;
  const auto changed = std::make_shared<const SampledInput>(with_gain_and_delay(
      *record.input, is_gain ? value : settings.gain, is_gain ? settings.delay : value));
  replace_input(record, changed, model);
}

}  // namespace

std::vector<Parameter> parameters_of(const Scene& scene, double length) {
  const Model& model = scene.model;
  std::vector<Parameter> parameters;
  add_restitutions(model, parameters);
  const bool has_damping = scene.beam && scene.beam->damping_ratio.size() == 0;
  if (has_damping) {
    Parameter damping = around(Quantity::damping, "damping", "N s/m^2", scene.beam->damping);
    damping.lowest = 0.0;
    // Range for an undamped beam: up to 10 % of critical damping of its first mode.
    const double usual = 0.2 * std::sqrt(stiffness(*scene.beam)[0] / mass(*scene.beam)[0]) *
                         scene.beam->mass_per_length;
    damping.highest = damping.nominal > 0.0 ? 2.0 * damping.nominal : usual;
    damping.relative = damping.nominal > 0.0;
    parameters.push_back(damping);
  } else if (!model.C.isZero(0.0)) {
    parameters.push_back(around(Quantity::damping, "factor on C", "", 1.0));
    parameters.back().lowest = 0.0;
    parameters.back().highest = 2.0;
  }
  if (scene.beam) {
    parameters.push_back(
        around(Quantity::stiffness, "bending stiffness", "N m^2", scene.beam->bending_stiffness));
  } else if (!model.K.isZero(0.0)) {
    parameters.push_back(around(Quantity::stiffness, "factor on K", "", 1.0));
  }
  const std::size_t contacts = model.contacts.size();
  for (int i = 0; i < static_cast<int>(contacts); ++i) {
    Parameter clearance{.quantity = Quantity::clearance,
                        .contact = i,
                        .name = of_contact("clearance", i, contacts),
                        .unit = "m"};
    clearance.nominal = model.contacts[static_cast<std::size_t>(i)].clearance;
    clearance.lowest = clearance.nominal - largest_clearance * length;
    clearance.highest = clearance.nominal + largest_clearance * length;
    clearance.relative = clearance.nominal != 0.0;
    parameters.push_back(clearance);
  }
  for (int i = 0; i < static_cast<int>(scene.positions.size()); ++i) {
    Parameter position = around(Quantity::position, of_contact("position", i, contacts), "m",
                                scene.positions[static_cast<std::size_t>(i)]);
    position.contact = i;
    position.highest = std::min(position.highest, scene.beam->length);
    parameters.push_back(position);
  }
  add_excitation(scene, parameters);
  add_records(scene, parameters);
  return parameters;
}

Parameter clock_rate_of(const Scene& scene) {
  constexpr double largest_error = 0.01;
  Parameter rate = around(Quantity::clock_rate, "clock rate", "", scene.clock.rate);
  rate.lowest = (1.0 - largest_error) * rate.nominal;
  rate.highest = (1.0 + largest_error) * rate.nominal;
  return rate;
}

namespace {

// The machine in a time that runs `scale` times as fast.
void rescale_time(double scale, Model& model) {
  model.C /= scale;
  model.K /= scale * scale;
  for (Force& force : model.forces) {
    force.constant /= scale * scale;
    force.harmonic.amplitude /= scale * scale;
  }
  for_each_harmonic(model, [&](Harmonic& of) { of.frequency /= scale; });
}

}  // namespace

Model with(const Scene& scene, const Parameter& parameter, double value) {
  Model model = scene.model;
  const auto contact = static_cast<std::size_t>(std::max(parameter.contact, 0));
  switch (parameter.quantity) {
    case Quantity::restitution:
      if (parameter.contact >= 0) {
        model.contacts[contact].restitution = value;
      } else {
        const bool one = is_one_restitution(model);
        for (Contact& of : model.contacts) of.restitution = one ? value : value * of.restitution;
      }
      break;
    case Quantity::damping:
      if (scene.beam && scene.beam->damping_ratio.size() == 0) {
        Beam beam = *scene.beam;
        beam.damping = value;
        model.C = damping(beam).asDiagonal();
      } else {
        model.C *= value;
      }
      break;
    case Quantity::stiffness:
      if (scene.beam) {
        Beam beam = *scene.beam;
        beam.bending_stiffness = value;
        model.K = stiffness(beam).asDiagonal();
        if (beam.damping_ratio.size() > 0) model.C = damping(beam).asDiagonal();
      } else {
        model.K *= value;
      }
      break;
    case Quantity::clearance:
      model.contacts[contact].clearance = value;
      break;
    case Quantity::amplitude:
      for_each_harmonic(model, [&](Harmonic& of) { of.amplitude *= value / parameter.nominal; });
      break;
    case Quantity::phase:
      for_each_harmonic(model, [&](Harmonic& of) { of.phase += value - parameter.nominal; });
      break;
    case Quantity::frequency: {
      const double ratio = value / parameter.nominal;
      for_each_harmonic(model, [&](Harmonic& of) { of.frequency *= ratio; });
      // The amplitude of a frame's motion stays, so that its acceleration grows with the frequency.
      for (std::size_t j = 0; j < model.forces.size(); ++j) {
        if (!scene.beam && !(scene.frame && scene.frame->force == j)) continue;
        model.forces[j].harmonic.amplitude *= ratio * ratio;
      }
      break;
    }
    case Quantity::position: {
      Eigen::VectorXd& w = model.contacts[contact].w;
      w = moved_direction(*scene.beam, w, scene.positions[contact], value);
      break;
    }
    case Quantity::clock_offset: {
      const double shift = (value - parameter.nominal) / scene.clock.rate;
      for_each_harmonic(model, [&](Harmonic& of) { of.phase -= of.frequency * shift; });
      break;
    }
    case Quantity::clock_rate:
      rescale_time(value / parameter.nominal, model);
      break;
    case Quantity::gain:
    case Quantity::delay:
      set_record(scene, parameter, value, model);
      break;
  }
  return model;
}

double only_frequency(const Model& model) {
  const std::vector<Harmonic> harmonics = harmonics_of(model);
  if (harmonics.empty()) return 0.0;
  const auto frequency = [](const Harmonic& harmonic) { return harmonic.frequency; };
  return same(harmonics, frequency) ? frequency(harmonics.front()) : 0.0;
}

}  // namespace sprag
