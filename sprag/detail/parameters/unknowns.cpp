#include "sprag/detail/parameters/unknowns.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>

#include "sprag/detail/files/nearest_word.h"
#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;

constexpr double beyond = 0.05;  // margin of the search range in coordinates
constexpr double slopes = 10.0;  // range of the slope of a restitution, in nominal ones

Unknown positive_unknown(Kind kind, int index, std::string key, std::string unit, double nominal) {
  Unknown unknown{.kind = kind, .index = index, .key = std::move(key), .unit = std::move(unit)};
  unknown.nominal = nominal;
  unknown.logarithmic = nominal > 0.0;
  return unknown;
}

std::string of(const char* table, std::size_t i, const char* key) {
  return std::string(table) + '.' + std::to_string(i + 1) + '.' + key;
}

void add_restitutions(const Model& model, std::vector<Unknown>& unknowns) {
  const auto& contacts = model.contacts;
  const bool one = has_one_restitution(model);
  const auto add = [&](int index, const std::string& key, const Contact& contact) {
    const bool constant = contact.curve.is_constant();
    unknowns.push_back(positive_unknown(Kind::restitution, index, constant ? key : key + ".value",
                                        "", contact.restitution));
    unknowns.back().upper_limit =
        contact.restitution > 0.0 ? contact.restitution / largest_restitution(contact) : 1.0;
    if (contact.curve.slope == 0.0) return;
    Unknown slope{.kind = Kind::restitution_slope, .index = index, .key = key + ".slope"};
    slope.unit = "s/m";
    slope.nominal = contact.curve.slope;
    slope.unit_step = -contact.curve.slope;
    slope.within = slopes;
    unknowns.push_back(slope);
  };
  if (one) add(-1, "impact.restitution", contacts.front());
  for (std::size_t i = 0; (!one || contacts.size() > 1) && i < contacts.size(); ++i) {
    add(static_cast<int>(i), of("contact", i, "restitution"), contacts[i]);
  }
}

void add_flow(const Scene& scene, std::vector<Unknown>& unknowns) {
  // Damping may be 0, so that its coordinate is linear.
  const auto damping = [](std::string key, std::string unit, double nominal) {
    Unknown unknown{.kind = Kind::damping, .key = std::move(key), .unit = std::move(unit)};
    unknown.nominal = nominal;
    if (nominal > 0.0) unknown.unit_step = nominal;
    return unknown;
  };
  if (scene.beam && scene.beam->damping_ratio.size() == 0) {
    Unknown d = damping("beam.damping", "N s/m^2", scene.beam->damping);
    // Step for an undamped beam: 2 % of critical damping of its first mode.
    if (!(d.nominal > 0.0)) {
      d.unit_step = 0.04 * std::sqrt(stiffness(*scene.beam)[0] / mass(*scene.beam)[0]) *
                    scene.beam->mass_per_length;
    }
    unknowns.push_back(d);
  } else if (!scene.model.C.isZero(0.0)) {
    unknowns.push_back(damping(scene.beam ? "beam.damping_ratio" : "system.C", "", 1.0));
  }
  if (scene.beam) {
    unknowns.push_back(positive_unknown(Kind::stiffness, -1, "beam.bending_stiffness", "N m^2",
                                        scene.beam->bending_stiffness));
  } else if (!scene.model.K.isZero(0.0)) {
    unknowns.push_back(positive_unknown(Kind::stiffness, -1, "system.K", "", 1.0));
  }
}

// Typical length of the machine: the step for clearances, which may nominally be 0.
double usual_length(const Scene& scene) {
  double length = 0.0;
  for (const Contact& contact : scene.model.contacts) {
    length = std::max({length, std::abs(contact.clearance), std::abs(contact.motion.amplitude),
                       std::abs(contact.w.dot(scene.truth.start.q)),
                       std::abs(contact.w.dot(scene.prior.start.q))});
  }
  return length > 0.0 ? length : 1.0;
}

std::string unit_of_amplitude(const HarmonicGroup& group) {
  if (group.of_frame) return "m";
  if (group.forces.size() + group.contacts.size() > 1) return "";
  return group.forces.empty() ? "m" : "N";
}

}  // namespace

bool Unknown::is_relative() const {
  return nominal != 0.0 && kind != Kind::phase && kind != Kind::delay &&
         kind != Kind::clock_offset && kind != Kind::restitution_slope;
}

double Unknown::coordinate(double of_value) const {
  return logarithmic ? std::log(of_value / nominal) : (of_value - nominal) / unit_step;
}

double Unknown::value(double of_coordinate) const {
  return logarithmic ? nominal * std::exp(of_coordinate) : nominal + unit_step * of_coordinate;
}

double Unknown::lowest() const {
  // Half of the slowest period, or of a record's mean period. Larger offsets of harmonics are
  // equivalent to smaller ones.
  if (kind == Kind::clock_offset || kind == Kind::delay) return -std::numbers::pi;
  if (kind == Kind::restitution_slope) return -within;
  if (kind == Kind::damping && nominal > 0.0) return std::max(-1.0, -(2.0 * within + beyond));
  const double share = -(std::log1p(2.0 * within) + beyond);
  if (logarithmic) return share;
  const bool may_be_zero = kind == Kind::restitution || kind == Kind::damping;
  return may_be_zero ? coordinate(0.0) : share;
}

double Unknown::highest() const {
  if (kind == Kind::clock_offset || kind == Kind::delay) return std::numbers::pi;
  if (kind == Kind::restitution_slope) return coordinate(0.0);
  if (kind == Kind::damping) return nominal > 0.0 ? 2.0 * within + beyond : 10.0;
  const double share = std::log1p(2.0 * within) + beyond;
  return upper_limit > 0.0 ? std::min(share, coordinate(upper_limit)) : share;
}

std::pair<double, double> Unknown::neighbours(double at, double step) const {
  double low = at - step;
  if (!logarithmic && (kind == Kind::damping || kind == Kind::restitution)) {
    low = std::max(low, coordinate(0.0));
  }
  return {low, low + 2.0 * step};
}

bool Unknown::is_physical_bound(double of_value) const {
  constexpr double rounding = 1e-9;
  const bool lowest_is_zero = (kind == Kind::damping || kind == Kind::restitution) &&
                              of_value <= rounding * std::abs(nominal);
  if (kind == Kind::restitution_slope) return of_value >= 0.0;
  return lowest_is_zero || (upper_limit > 0.0 && of_value >= upper_limit * (1.0 - 1e-12));
}

bool Unknown::is_within(double of_value, double tolerance) const {
  if (kind == Kind::phase || kind == Kind::clearance || kind == Kind::clock_offset ||
      kind == Kind::delay || kind == Kind::restitution_slope) {
    return true;
  }
  const double at = coordinate(of_value);
  if (nominal == 0.0) return at <= highest() + tolerance;
  const double low = logarithmic ? std::log1p(-std::min(within, 0.9)) : -within;
  const double high = logarithmic ? std::log1p(within) : within;
  return at >= low - tolerance && at <= high + tolerance;
}

namespace {

bool moves(const Harmonic& harmonic) {
  return harmonic.amplitude != 0.0 && harmonic.frequency > 0.0;
}

bool is_on_ground(const ShakenFrame& frame, int contact) {
  return std::find(frame.on_ground.begin(), frame.on_ground.end(), contact) !=
         frame.on_ground.end();
}

}  // namespace

Eigen::VectorXd nominal_values(const std::vector<Unknown>& unknowns) {
  Eigen::VectorXd values(std::ssize(unknowns));
  for (Eigen::Index k = 0; k < values.size(); ++k) {
    values[k] = unknowns[static_cast<std::size_t>(k)].nominal;
  }
  return values;
}

double only_frequency(const Model& model) {
  double common = 0.0;
  bool differ = false;
  const auto add = [&](const Harmonic& harmonic) {
    if (!moves(harmonic)) return;
    differ = differ || (common > 0.0 && harmonic.frequency != common);
    common = harmonic.frequency;
  };
  for (const Force& force : model.forces) add(force.harmonic);
  for (const Contact& contact : model.contacts) add(contact.motion);
  return differ ? 0.0 : common;
}

std::vector<HarmonicGroup> harmonic_groups(const Scene& scene) {
  std::vector<HarmonicGroup> groups;
  const Model& model = scene.model;
  const bool shaken = scene.frame && moves(scene.frame->motion);
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    const Harmonic& harmonic = model.forces[j].harmonic;
    if (!moves(harmonic) || (shaken && scene.frame->force == j)) continue;
    groups.push_back({{static_cast<int>(j)},
                      {},
                      "force." + std::to_string(j + 1),
                      harmonic.amplitude,
                      harmonic.frequency,
                      harmonic.phase});
  }
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const Harmonic& harmonic = model.contacts[i].motion;
    if (!moves(harmonic) || (shaken && is_on_ground(*scene.frame, static_cast<int>(i)))) continue;
    groups.push_back({{},
                      {static_cast<int>(i)},
                      of("contact", i, "motion"),
                      harmonic.amplitude,
                      harmonic.frequency,
                      harmonic.phase});
  }
  if (shaken) {
    HarmonicGroup frame{.forces = {static_cast<int>(scene.frame->force)},
                        .contacts = {},
                        .key = "excitation",
                        .amplitude = scene.frame->motion.amplitude,
                        .frequency = scene.frame->motion.frequency,
                        .phase = scene.frame->motion.phase,
                        .of_frame = true};
    for (const int i : scene.frame->on_ground) {
      if (moves(model.contacts[static_cast<std::size_t>(i)].motion)) frame.contacts.push_back(i);
    }
    groups.insert(groups.begin(), std::move(frame));
    return groups;
  }
  const double common = only_frequency(model);
  if (groups.empty() || common == 0.0 || (!scene.beam && groups.size() == 1)) return groups;
  HarmonicGroup all{.forces = {}, .contacts = {}, .key = "excitation", .frequency = common};
  for (const HarmonicGroup& group : groups) {
    all.forces.insert(all.forces.end(), group.forces.begin(), group.forces.end());
    all.contacts.insert(all.contacts.end(), group.contacts.begin(), group.contacts.end());
  }
  if (scene.beam) {
    // Amplitude and phase of e(t), from the frame's force -e''(t).
    all.amplitude = std::abs(groups.front().amplitude) / square(common);
    all.phase = groups.front().phase;
    all.of_frame = true;
  }
  return {all};
}

std::vector<RecordedInput> recorded_inputs(const Scene& scene) {
  std::vector<RecordedInput> records;
  const std::vector<Force>& forces = scene.model.forces;
  for (std::size_t j = 0; j < forces.size(); ++j) {
    if (!forces[j].input) continue;
    const bool of_frame = scene.beam || (scene.frame && scene.frame->force == j);
    const auto same =
        std::find_if(records.begin(), records.end(),
                     [&](const RecordedInput& record) { return record.input == forces[j].input; });
    if (same != records.end()) {
      same->forces.push_back(static_cast<int>(j));
      continue;
    }
    records.push_back({forces[j].input,
                       {static_cast<int>(j)},
                       {},
                       of_frame ? "excitation" : "force." + std::to_string(j + 1)});
  }
  for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
    for (RecordedInput& record : records) {
      if (scene.model.contacts[i].input == record.input) {
        record.contacts.push_back(static_cast<int>(i));
      }
    }
  }
  return records;
}

void replace_input(const RecordedInput& record, const SampledInputPointer& input, Model& model) {
  for (const int j : record.forces) model.forces[static_cast<std::size_t>(j)].input = input;
  for (const int i : record.contacts) model.contacts[static_cast<std::size_t>(i)].input = input;
}

void replace_input(const RecordedInput& record, const SampledInputPointer& input, Scene& scene) {
  const SampledInputPointer present =
      scene.model.forces[static_cast<std::size_t>(record.forces.front())].input;
  replace_input(record, input, scene.model);
  if (scene.frame && scene.frame->input == present) scene.frame->input = input;
}

double mean_frequency(const SampledInput& input) {
  const std::vector<double>& t = input.sample_times();
  const std::vector<double>& values = input.sample_values();
  const double mean =
      std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  double squares = 0.0, of_rate = 0.0;
  for (std::size_t k = 0; k + 1 < values.size(); ++k) {
    const double h = t[k + 1] - t[k];
    squares += h * square(values[k] - mean);
    of_rate += square(values[k + 1] - values[k]) / h;
  }
  // A constant record has no frequency: a tenth of its duration is as good as any time.
  if (!(squares > 0.0) || !(of_rate > 0.0)) return 10.0 / (t.back() - t.front());
  return std::sqrt(of_rate / squares);
}

std::vector<Unknown> unknowns_of(const Scene& scene) {
  const Model& model = scene.model;
  std::vector<Unknown> unknowns;
  add_restitutions(model, unknowns);
  add_flow(scene, unknowns);
  const double length = usual_length(scene);
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const int contact = static_cast<int>(i);
    if (scene.beam) {
      unknowns.push_back(positive_unknown(Kind::position, contact, of("contact", i, "position"),
                                          "m", scene.positions[i]));
      unknowns.back().upper_limit = scene.beam->length;
    }
    Unknown clearance{
        .kind = Kind::clearance, .index = contact, .key = of("contact", i, "clearance")};
    clearance.unit = "m";
    clearance.nominal = model.contacts[i].clearance;
    clearance.unit_step = length;
    unknowns.push_back(clearance);
  }
  const std::vector<HarmonicGroup> groups = harmonic_groups(scene);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const HarmonicGroup& group = groups[g];
    const int index = static_cast<int>(g);
    unknowns.push_back(positive_unknown(Kind::frequency, index, group.key + ".frequency", "rad/s",
                                        group.frequency));
    Unknown phase{.kind = Kind::phase, .index = index, .key = group.key + ".phase", .unit = "rad"};
    phase.nominal = group.phase;
    unknowns.push_back(phase);
    unknowns.push_back(positive_unknown(Kind::amplitude, index, group.key + ".amplitude",
                                        unit_of_amplitude(group), group.amplitude));
    unknowns.back().unit_step = std::abs(group.amplitude);
  }
  const std::vector<RecordedInput> records = recorded_inputs(scene);
  for (std::size_t r = 0; r < records.size(); ++r) {
    const SampledInput& input = *records[r].input;
    const int index = static_cast<int>(r);
    Unknown delay{
        .kind = Kind::delay, .index = index, .key = records[r].key + ".delay", .unit = "s"};
    delay.nominal = input.settings().delay;
    delay.unit_step = 1.0 / mean_frequency(input);
    unknowns.push_back(delay);
    unknowns.push_back(
        positive_unknown(Kind::gain, index, records[r].key + ".gain", "", input.settings().gain));
    unknowns.back().unit_step = std::abs(input.settings().gain);
  }
  for (std::size_t j = 0; j < model.forces.size(); ++j) {
    const double constant = model.forces[j].constant;
    if (constant == 0.0) continue;
    unknowns.push_back(positive_unknown(Kind::constant, static_cast<int>(j),
                                        of("force", j, "constant"), "N", constant));
    unknowns.back().unit_step = std::abs(constant);
  }
  return unknowns;
}

std::vector<Unknown> common_unknowns(const Scene& scene) {
  std::vector<Unknown> unknowns;
  if (!has_one_restitution(scene.model)) {
    double largest = 0.0;
    for (const Contact& contact : scene.model.contacts) {
      largest = std::max(largest, contact.restitution);
    }
    unknowns.push_back(positive_unknown(Kind::restitution, -1, "impact.restitution", "", 1.0));
    unknowns.back().upper_limit = 1.0 / largest;
  }
  if (harmonic_groups(scene).size() < 2 || has_sampled_inputs(scene.model)) return unknowns;
  const std::string table = "excitations.";
  unknowns.push_back(positive_unknown(Kind::frequency, -1, table + "frequency", "", 1.0));
  unknowns.push_back({.kind = Kind::phase, .key = table + "phase", .unit = "rad"});
  unknowns.push_back(positive_unknown(Kind::amplitude, -1, table + "amplitude", "", 1.0));
  return unknowns;
}

std::vector<Unknown> clock_unknowns(const Scene& scene) {
  // A record has a delay, which an offset of the clock would change as well.
  if (has_sampled_inputs(scene.model)) return {};
  constexpr double largest_error = 0.01;  // of a rate; a ceramic resonator is off by 0.005
  std::vector<Unknown> unknowns{
      positive_unknown(Kind::clock_rate, -1, "clock.rate", "", scene.clock.rate)};
  unknowns.back().within = largest_error;
  const std::vector<HarmonicGroup> groups = harmonic_groups(scene);
  if (groups.empty()) return unknowns;
  double slowest = groups.front().frequency;
  for (const HarmonicGroup& group : groups) slowest = std::min(slowest, group.frequency);
  unknowns.push_back({.kind = Kind::clock_offset, .key = "clock.offset", .unit = "s"});
  unknowns.back().nominal = scene.clock.offset;
  unknowns.back().unit_step = scene.clock.rate / slowest;
  return unknowns;
}

bool is_of_clock(const Unknown& unknown) {
  return unknown.kind == Kind::clock_rate || unknown.kind == Kind::clock_offset;
}

bool is_common(const Unknown& unknown) {
  using enum Unknown::Kind;
  const bool of_harmonics =
      unknown.kind == frequency || unknown.kind == phase || unknown.kind == amplitude;
  return of_harmonics && unknown.index < 0;
}

bool can_be_filtered(const Unknown& unknown) { return !is_of_clock(unknown); }

bool carries_scale(const Unknown& unknown) {
  return unknown.kind == Kind::amplitude || unknown.kind == Kind::constant ||
         unknown.kind == Kind::gain || (unknown.kind == Kind::clearance && unknown.nominal != 0.0);
}

std::vector<Unknown> all_but_the_scale(const Scene& scene, std::vector<std::string> known) {
  const std::vector<Unknown> all = unknowns_of(scene);
  const bool one = all.front().key.starts_with("impact.");
  const auto is_known = [&](const std::string& key) {
    return std::find(known.begin(), known.end(), key) != known.end();
  };
  bool held = std::any_of(all.begin(), all.end(), [&](const Unknown& unknown) {
    return is_known(unknown.key) && carries_scale(unknown);
  });
  for (const Kind kind : {Kind::amplitude, Kind::gain, Kind::constant}) {
    for (const Unknown& unknown : all) {
      if (held || unknown.kind != kind) continue;
      known.push_back(unknown.key);
      held = true;
    }
  }
  std::vector<Unknown> unknowns;
  for (const Unknown& unknown : all) {
    const bool own_restitution =
        (unknown.kind == Kind::restitution || unknown.kind == Kind::restitution_slope) &&
        unknown.index >= 0;
    if (!is_known(unknown.key) && !(one && own_restitution)) unknowns.push_back(unknown);
  }
  return unknowns;
}

namespace {

// Parses a key such as "system.K.1.2". Returns whether it names an entry of C or K.
bool read_entry(const Scene& scene, std::string_view key, Unknown& unknown) {
  constexpr std::string_view prefix = "system.";
  if (scene.beam || key.size() < prefix.size() + 5 || key.substr(0, prefix.size()) != prefix) {
    return false;
  }
  const char matrix = key[prefix.size()];
  if (matrix != 'K' && matrix != 'C') return false;
  int row = 0, column = 0;
  const char* const end = key.data() + key.size();
  const auto first = std::from_chars(key.data() + prefix.size() + 2, end, row);
  if (first.ec != std::errc() || first.ptr == end || *first.ptr != '.') return false;
  const auto second = std::from_chars(first.ptr + 1, end, column);
  if (second.ec != std::errc() || second.ptr != end) return false;
  const auto f = static_cast<int>(scene.kept ? scene.kept->given() : scene.model.coordinates());
  if (row < 1 || column < 1 || row > f || column > f) return false;
  if (scene.kept) {
    throw std::invalid_argument(std::string(key) +
                                " is a single entry, which is no parameter with system.modes; "
                                "system.K and system.C are factors on all modes");
  }
  const Eigen::MatrixXd& of_scene = matrix == 'K' ? scene.model.K : scene.model.C;
  unknown = positive_unknown(matrix == 'K' ? Kind::stiffness_entry : Kind::damping_entry, -1,
                             std::string(key), matrix == 'K' ? "N/m" : "N s/m",
                             of_scene(row - 1, column - 1));
  unknown.row = row - 1;
  unknown.column = column - 1;
  const double largest = of_scene.cwiseAbs().maxCoeff();
  unknown.unit_step = unknown.nominal != 0.0 ? std::abs(unknown.nominal)
                      : largest > 0.0        ? largest
                                             : 1.0;
  return true;
}

}  // namespace

Unknown unknown_of(const Scene& scene, std::string_view key) {
  std::vector<Unknown> unknowns = unknowns_of(scene);
  for (Unknown& common : common_unknowns(scene)) unknowns.push_back(std::move(common));
  for (Unknown& of_clock : clock_unknowns(scene)) unknowns.push_back(std::move(of_clock));
  for (const Unknown& unknown : unknowns) {
    if (unknown.key == key) return unknown;
  }
  Unknown entry;
  if (read_entry(scene, key, entry)) return entry;
  std::vector<std::string_view> keys;
  keys.reserve(unknowns.size());
  for (const Unknown& unknown : unknowns) keys.push_back(unknown.key);
  std::string text = std::string(key) + " is no parameter of this scene";
  if (const auto nearest = nearest_word(key, keys)) {
    text += "; did you mean " + std::string(*nearest) + "? It has ";
  } else {
    text += ", which has ";
  }
  for (const std::string_view of_scene : keys) {
    if (of_scene != keys.front()) text += ", ";
    text += of_scene;
  }
  throw std::invalid_argument(text);
}

std::vector<Unknown> unknowns_named(const Scene& scene, const std::vector<std::string>& keys) {
  std::vector<Unknown> unknowns;
  unknowns.reserve(keys.size());
  for (const std::string& key : keys) unknowns.push_back(unknown_of(scene, key));
  return unknowns;
}

}  // namespace sprag
