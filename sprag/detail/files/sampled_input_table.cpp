#include "sprag/detail/files/sampled_input_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/record_file.h"
#include "sprag/scene_file.h"

namespace sprag {
namespace {

// Interpolation errors up to this share of the signal's rms are not reported.
constexpr double reported_error = 0.01;
constexpr double gravity = 9.80665;

// "ax [g]", "a (g)": the unit in the name of a column.
bool is_in_g(const std::string& column) {
  return column.find("[g]") != std::string::npos || column.find("(g)") != std::string::npos;
}

Record read_record(const TomlTable& table, const RecordColumns& columns) {
  const std::string path = table.path_of("file");
  try {
    return read_record_file(table.file("file"), columns);
  } catch (const SceneError& error) {
    const std::string message = error.message + " (" + path + ")";
    if (error.line == 0) throw SceneError(error.file, message);
    throw SceneError(error.file, error.line, error.column, message);
  } catch (const InputError& error) {
    table.fail("file", std::string("names a file: ") + error.what());
  }
}

// The samples in the table `record`, and the name of the signal.
std::pair<Record, std::string> read_samples(const TomlTable& table) {
  const TomlTable record = *table.table("record", {"name", "time", "values"});
  const Eigen::VectorXd t = record.vector("time"), values = record.vector("values");
  return {{{t.begin(), t.end()}, {values.begin(), values.end()}, "", {}},
          record.string_or("name", "record")};
}

// Without a unit, values that look as if they were multiples of g.
void remark_on_gravity(const TomlTable& table, const Record& record) {
  if (table.has("unit")) return;
  const double mean = std::accumulate(record.values.begin(), record.values.end(), 0.0) /
                      static_cast<double>(record.values.size());
  if (std::abs(std::abs(mean) - 1.0) < 0.05) {
    table.remark("file", "has the mean " + rounded(mean) +
                             ": if that is gravity in units of g, set unit = 9.80665");
  } else if (std::abs(std::abs(mean) - gravity) < 0.02 * gravity) {
    table.remark("file", "has the mean " + rounded(mean) +
                             ": the record contains gravity, which acts as a constant "
                             "acceleration of the frame");
  }
}

SampledInputPointer read_input(const TomlTable& table, RecordColumns columns, bool displacement,
                               bool acceleration) {
  SampledInput::Settings settings;
  settings.displacement = displacement;
  const std::string_view interpolation = displacement
                                             ? table.choice("interpolation", {"spline", "linear"})
                                             : table.choice("interpolation", {"linear", "spline"});
  settings.interpolation =
      interpolation == "linear" ? Interpolation::linear : Interpolation::spline;
  if (displacement && interpolation == "linear") {
    table.fail("interpolation",
               "is \"linear\"; must be \"spline\" for a displacement (linear pieces would be "
               "impacts at every sample)");
  }
  const std::string_view outside = table.choice("outside", {"error", "zero", "hold"});
  settings.outside = outside == "zero"   ? Outside::zero
                     : outside == "hold" ? Outside::hold
                                         : Outside::error;
  if (displacement && settings.outside != Outside::error) {
    table.fail("outside", "is \"" + std::string(outside) +
                              "\"; must be \"error\" for a displacement, which would jump");
  }
  const double unit = table.number_or("unit", 1.0, any_number);
  if (unit == 0.0) table.fail("unit", "is 0; must be what one unit of the file is");
  // The samples of `record` are in the scene's unit; `unit` is then that of a streamed input.
  const bool of_file = table.has("file");
  const char* const key = of_file ? "file" : "record";
  settings.noise =
      (of_file ? std::abs(unit) : 1.0) * table.number_or("uncertainty", 0.0, not_negative);
  if (displacement && settings.noise > 0.0) {
    table.fail("uncertainty", "is for an acceleration or a force; must go for a displacement");
  }

  settings.gain = table.number_or("gain", 1.0, any_number);
  if (settings.gain == 0.0) table.fail("gain", "is 0; must be the gain of the sensor");
  settings.delay = table.number_or("delay", 0.0, any_number);

  Record record;
  if (of_file) {
    if (table.has("record"))
      table.fail("record",
                 "and " + table.path_of("file") + " exclude each other; must be one of them");
    settings.name = table.required_string("file");
    columns.time = table.string_or("time", "");
    record = read_record(table, columns);
    for (const std::string& remark : record.remarks) table.remark("file", remark);
    for (double& value : record.values) value *= unit;
  } else {
    std::tie(record, settings.name) = read_samples(table);
  }
  if (acceleration && is_in_g(record.column) && !table.has("unit")) {
    table.fail("file", "has the column '" + record.column +
                           "', an acceleration in g; the table must have unit = 9.80665 (or unit "
                           "= 1 if the scene's accelerations are in g)");
  }
  if (acceleration && of_file) remark_on_gravity(table, record);
  const double begin = record.t.front() + settings.delay;
  const bool is_late = settings.outside == Outside::error && begin > 0.0;
  if (is_late && settings.delay == 0.0) {
    table.fail(key, "begins at t = " + to_text(begin) +
                        "; must begin at t <= 0, or the table must have outside = \"zero\" or "
                        "\"hold\"");
  }
  if (is_late) {
    table.remark(key, "begins at t = " + rounded(begin) + " with its delay; before, its first " +
                          (displacement ? "velocity" : "value") + " is held");
  }
  SampledInputPointer input;
  try {
    input = std::make_shared<const SampledInput>(record.t, record.values, std::move(settings));
  } catch (const std::invalid_argument& error) {
    table.fail(key, std::string(": ") + error.what());
  }
  if (!std::isfinite(input->largest(2)) || !std::isfinite(input->largest(5))) {
    table.fail(key, "has values beyond the range of doubles; must be in other units");
  }
  const double error = input->interpolation_error();
  const double noise = input->noise();
  if (input->rms() > 0.0 && error > std::max(reported_error * input->rms(), noise)) {
    table.remark(key, "is not resolved by its sampling: between samples the input may be off by " +
                          rounded(error) + ", " + rounded(100.0 * error / input->rms()) +
                          " % of its rms. The estimates do not account for it; sample faster, or " +
                          (noise > 0.0 ? "raise" : "set") + " uncertainty");
  }
  return input;
}

}  // namespace

bool has_harmonic_keys(const TomlTable& table) {
  return table.has("amplitude") || table.has("frequency") || table.has("phase");
}

bool has_record(const TomlTable& table) { return table.has("file") || table.has("record"); }

void refuse_record_keys(const TomlTable& table) {
  for (const char* key : {"gain", "delay"}) {
    if (table.has(key)) table.fail(key, "is for a recorded input; the table must have a file");
  }
}

SampledInputPointer read_frame_input(const TomlTable& table) {
  if (table.has("acceleration") && table.has("displacement")) {
    table.fail("displacement",
               "and " + table.path_of("acceleration") + " exclude each other; must be one of them");
  }
  const char* const named = table.has("displacement")   ? "displacement"
                            : table.has("acceleration") ? "acceleration"
                                                        : nullptr;
  const std::string quantity =
      table.has("quantity") || named == nullptr
          ? std::string(table.choice("quantity", {"acceleration", "displacement"}))
          : named;
  if (named != nullptr && quantity != named) {
    table.fail("quantity", "is \"" + quantity + "\", but " + table.path_of(named) +
                               " names the column; must agree");
  }
  const bool displacement = quantity == "displacement";
  return read_input(table, {{}, named != nullptr ? table.required_string(named) : ""}, displacement,
                    !displacement);
}

SampledInputPointer read_force_input(const TomlTable& table) {
  return read_input(table, {{}, table.string_or("force", "")}, false, false);
}

void check_ground_supports(const TomlTable& excitation, const Model& model) {
  if (!has_record(excitation)) return;
  std::string on_ground;
  const SampledInput* input = nullptr;
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    if (!model.contacts[i].input || model.contacts[i].input_share == 0.0) continue;
    input = model.contacts[i].input.get();
    on_ground += (on_ground.empty() ? "" : ", ") + std::to_string(i + 1);
  }
  if (input == nullptr || input->settings().displacement) return;
  if (input->settings().noise > 0.0) {
    excitation.fail("uncertainty", "is not supported with supports on the ground (contact " +
                                       on_ground +
                                       "); mount must be \"frame\", or the key must go");
  }
  const double t = input->last();
  excitation.remark(excitation.has("file") ? "file" : "record",
                    "is an acceleration that moves supports on the ground (contact " + on_ground +
                        ") by its twofold integral: from rest at its begin to " +
                        rounded(input->displacement(t)) + " at t = " + rounded(t) +
                        ". Offsets and low frequencies of the sensor make that drift; "
                        "record the displacement, or mount the contact on the frame");
}

double read_stream(const TomlTable& excitation, const Scene& scene) {
  constexpr double usual = 600.0;
  const bool stream = excitation.boolean_or("stream", false);
  const double duration = excitation.number_or("stream_duration", usual, positive);
  if (!stream) {
    if (excitation.has("stream_duration")) {
      excitation.fail("stream_duration", "is for a streamed input; needs stream = true");
    }
    return 0.0;
  }
  const auto refuse = [&](const std::string& what) { excitation.fail("stream", what); };
  if (!has_record(excitation)) {
    refuse("needs a record of the sensor, for its interval and its size; needs the key file");
  }
  const std::vector<Force>& forces = scene.model.forces;
  const auto recorded = [](const Force& force) { return force.input != nullptr; };
  if (std::count_if(forces.begin(), forces.end(), recorded) != 1) {
    refuse("needs a scene without other recorded inputs");
  }
  const SampledInput& input = *std::find_if(forces.begin(), forces.end(), recorded)->input;
  const bool on_ground =
      std::any_of(scene.model.contacts.begin(), scene.model.contacts.end(),
                  [](const Contact& contact) { return contact.input != nullptr; });
  if (input.settings().displacement || on_ground) {
    refuse("is for an acceleration, with contacts on the frame (mount = \"frame\")");
  }
  if (!has_even_samples(input)) refuse("needs a record with equal intervals between samples");
  if (scene.prior.tolerance.any()) refuse("excludes [tolerance]: no bound holds");
  return duration;
}

}  // namespace sprag
