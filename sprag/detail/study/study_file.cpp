#include "sprag/detail/study/study_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <string_view>
#include <utility>

#include "sprag/detail/files/input_file.h"
#include "sprag/detail/files/nearest_word.h"
#include "sprag/detail/files/scene_text.h"
#include "sprag/detail/files/shipped_scenes.h"
#include "sprag/detail/files/toml_reader.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/parameters/unknowns.h"
#include "sprag/detail/study/design.h"
#include "sprag/scene_file.h"

namespace sprag::study {
namespace {

constexpr double most_indices = 9e15;    // every index is a double
constexpr int most_points = 10'000'000;  // of an axis

const std::vector<std::pair<const char*, EstimatorKind>> estimator_names = {
    {"replica", EstimatorKind::replica},
    {"timing", EstimatorKind::timing},
    {"both", EstimatorKind::both},
    {"adaptive", EstimatorKind::adaptive}};

const std::vector<std::pair<const char*, bool Record::*>> record_names = {
    {"V_floor", &Record::V_floor},
    {"V_max", &Record::V_max},
    {"rate", &Record::rate},
    {"time_below", &Record::time_below},
    {"nees", &Record::nees},
    {"beyond_3_sigma", &Record::beyond_3_sigma},
    {"trusted", &Record::trusted},
    {"worse", &Record::worse},
    {"impacts", &Record::impacts},
    {"poincare", &Record::poincare},
    {"impacts_per_period", &Record::impacts_per_period},
    {"lyapunov", &Record::lyapunov},
    {"attractor", &Record::attractor}};

// Paths of quantities that are not keys of the scene, and their limits.
struct Knob {
  const char* path;
  Target target;
  Limits limits;
};
constexpr std::array<Knob, 9> knobs = {{{"observer.modes", Target::modes, {1.0, 1e6}},
                                        {"disturbance.jitter", Target::jitter, not_negative},
                                        {"disturbance.offset", Target::offset, any_number},
                                        {"disturbance.lost", Target::lost, {0.0, 1.0}},
                                        {"disturbance.spurious", Target::spurious, not_negative},
                                        {"start.replica", Target::start_replica, not_negative},
                                        {"start.machine", Target::start_machine, not_negative},
                                        {"duration", Target::duration, positive},
                                        {"tick", Target::tick, positive}}};

std::string one_of(const std::vector<std::string_view>& words) {
  std::string text;
  for (const std::string_view word : words) text += (text.empty() ? "" : ", ") + std::string(word);
  return text;
}

// "is X; did you mean Y?", or the list of words.
std::string unknown_word(const std::string& given, const std::vector<std::string_view>& words) {
  const auto suggestion = nearest_word(given, words);
  return " is \"" + given + "\"; " +
         (suggestion ? "did you mean \"" + std::string(*suggestion) + "\"?"
                     : "must be one of " + one_of(words));
}

template <typename Value>
std::vector<Value> named_values(const TomlTable& root, const char* key,
                                const std::vector<std::pair<const char*, Value>>& names) {
  std::vector<Value> values;
  if (!root.has(key)) return values;
  std::vector<std::string_view> words;
  words.reserve(names.size());
  for (const auto& [word, value] : names) words.emplace_back(word);
  const std::vector<std::string> given = root.strings(key);
  for (std::size_t i = 0; i < given.size(); ++i) {
    const auto found = std::find(words.begin(), words.end(), given[i]);
    if (found == words.end()) root.fail(key, i, unknown_word(given[i], words));
    const Value value = names[static_cast<std::size_t>(found - words.begin())].second;
    if (std::find(values.begin(), values.end(), value) != values.end()) {
      root.fail(key, i, " is \"" + given[i] + "\" again; must be another one");
    }
    values.push_back(value);
  }
  return values;
}

std::uint64_t hash_of(std::string_view text, std::uint64_t hash) {
  for (const char c : text) {  // FNV-1a
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
  }
  return hash;
}

// The entries of [vary] with their paths, in the order of the file.
struct Leaf {
  std::string path;
  const toml::node* node;
};

void add_leaves(const toml::table& table, const std::string& path, std::vector<Leaf>& leaves) {
  for (const auto& [key, node] : table) {
    const std::string full =
        path.empty() ? std::string(key.str()) : path + "." + std::string(key.str());
    const toml::table* inner = node.as_table();
    if (inner != nullptr && !inner->is_inline()) {
      add_leaves(*inner, full, leaves);
    } else {
      leaves.push_back({full, &node});
    }
  }
}

class Reader {
 public:
  Reader(TomlDocument& document, Study& study) : document_(document), study_(study) {}

  void read_vary() {
    const toml::node* vary = document_.table().get("vary");
    if (vary == nullptr) return;
    if (!vary->is_table()) document_.fail(vary->source().begin, "vary must be a table");
    std::vector<Leaf> leaves;
    add_leaves(*vary->as_table(), "", leaves);
    std::sort(leaves.begin(), leaves.end(), [](const Leaf& a, const Leaf& b) {
      const auto& at = a.node->source().begin;
      const auto& bt = b.node->source().begin;
      return std::pair(at.line, at.column) < std::pair(bt.line, bt.column);
    });
    for (const Leaf& leaf : leaves) read_axis(leaf);
    count_points();
    for (std::size_t i = 0; i < leaves.size(); ++i) check_in_scene(leaves[i], i);
  }

 private:
  [[noreturn]] void fail(const Leaf& leaf, const std::string& message) const {
    document_.fail(leaf.node->source().begin, "vary." + leaf.path + " " + message);
  }

  const Knob* set_target(const Leaf& leaf, Axis& axis) const {
    for (const Knob& knob : knobs) {
      if (axis.path != knob.path) continue;
      axis.target = knob.target;
      return &knob;
    }
    std::vector<std::string_view> words;
    words.reserve(knobs.size());
    for (const Knob& knob : knobs) words.emplace_back(knob.path);
    const auto refuse = [&](std::string_view prefix) {
      std::erase_if(words, [&](std::string_view word) { return !word.starts_with(prefix); });
      const auto suggestion = nearest_word(axis.path, words);
      fail(leaf, suggestion
                     ? "is not known; did you mean " + std::string(*suggestion) + "?"
                     : "is not known; must be a key of the scene or one of " + one_of(words));
    };
    for (const char* prefix : {"disturbance.", "start."}) {
      if (axis.path.starts_with(prefix)) refuse(prefix);
    }
    if (axis.path.find('.') == std::string::npos) refuse("");
    constexpr std::string_view observer = "observer.";
    axis.target = axis.path.starts_with(observer) ? Target::observer : Target::scene;
    axis.key = axis.target == Target::observer ? axis.path.substr(observer.size()) : axis.path;
    return nullptr;
  }

  // The number in the scene file; nullopt if there is none.
  std::optional<double> scene_number(const std::string& key) const {
    const std::string file = study_.scene_file.string();
    const double value =
        number_of(study_.scene_text, key, std::numeric_limits<double>::quiet_NaN(), file);
    return std::isfinite(value) ? std::optional(value) : std::nullopt;
  }

  void read_axis(const Leaf& leaf) {
    Axis axis;
    axis.path = leaf.path;
    const Knob* knob = set_target(leaf, axis);
    for (const Axis& other : study_.axes) {
      if (other.path == axis.path) fail(leaf, "is there again; must be there once");
    }
    std::string zip;
    if (leaf.node->is_table()) {
      read_spread(leaf, axis, zip);
    } else {
      axis.values = numbers_of(leaf);
    }
    check_limits(leaf, axis, knob);
    if (!zip.empty() && axis.values.empty()) fail(leaf, "is random; must be without zip");
    const auto points = static_cast<std::int64_t>(std::max<std::size_t>(axis.values.size(), 1));
    const auto zipped = zips_.empty() ? zips_.end() : std::find(zips_.begin(), zips_.end(), zip);
    if (!zip.empty() && zipped != zips_.end()) {
      axis.group = static_cast<std::size_t>(zipped - zips_.begin());
      if (study_.group_size[axis.group] != points) {
        fail(leaf, "has " + std::to_string(points) + " points; must have " +
                       std::to_string(study_.group_size[axis.group]) + ", as others of zip \"" +
                       zip + "\"");
      }
    } else {
      axis.group = study_.group_size.size();
      study_.group_size.push_back(points);
      zips_.push_back(zip);
    }
    study_.axes.push_back(std::move(axis));
  }

  // A number or an array of numbers.
  std::vector<double> numbers_of(const Leaf& leaf) const {
    const auto one = [&](const toml::node& node) {
      const std::optional<double> value =
          node.is_number() ? node.value<double>() : std::optional<double>();
      if (!value || !std::isfinite(*value)) {
        document_.fail(
            node.source().begin,
            "vary." + leaf.path +
                " has an entry that is no finite number; must be a "
                "number, an array of numbers, or a table such as { linear = [0, 1], points = "
                "5 }");
      }
      return *value;
    };
    std::vector<double> values;
    const toml::array* array = leaf.node->as_array();
    if (array == nullptr) return {one(*leaf.node)};
    for (const toml::node& entry : *array) values.push_back(one(entry));
    if (values.empty()) fail(leaf, "is empty; must have a number at least");
    return values;
  }

  void read_spread(const Leaf& leaf, Axis& axis, std::string& zip) {
    const TomlTable table =
        document_.at(*leaf.node->as_table(), "vary." + leaf.path,
                     {"values", "linear", "log", "relative", "points", "random", "zip"});
    std::string kind;
    for (const char* key : {"values", "linear", "log", "relative"}) {
      if (!table.has(key)) continue;
      if (!kind.empty()) table.fail(key, "and " + kind + " exclude each other");
      kind = key;
    }
    if (kind.empty())
      table.fail_here("missing key values, linear, log or relative in vary." + leaf.path);
    const Eigen::VectorXd given = table.numbers(kind);
    axis.logarithmic = kind == "log";
    const bool random = table.boolean_or("random", false);
    const bool ranged = random || table.has("points");
    if (given.size() == 0) table.fail(kind, "is empty; must have a number at least");
    if (axis.logarithmic && !(given.minCoeff() > 0.0)) {
      table.fail(kind, "has " + to_text(given.minCoeff()) + "; must be > 0");
    }
    if (ranged && (kind == "values" || given.size() != 2)) {
      table.fail(kind, "has " + std::to_string(given.size()) +
                           " numbers; must be a range of two, "
                           "with " +
                           (random ? "random" : "points"));
    }
    if (random && table.has("points")) {
      table.fail("points", "and random exclude each other; must be one of them");
    }
    if (!ranged && (kind == "linear" || kind == "log")) {
      table.fail(kind, "is a range; must go with points = n or random = true");
    }
    axis.low = given[0];
    axis.high = given[given.size() - 1];
    if (table.has("points")) {
      const int points = table.integer("points", 1, most_points);
      for (int i = 0; i < points; ++i) axis.values.push_back(of_range(axis, i, points));
    } else if (!random) {
      axis.values.assign(given.begin(), given.end());
    }
    zip = table.string_or("zip", "");
    if (kind == "relative") make_relative(leaf, axis);
  }

  static double of_range(const Axis& axis, int i, int points) {
    if (i == 0) return axis.low;
    if (i == points - 1) return axis.high;
    const double x = static_cast<double>(i) / (points - 1);
    if (axis.logarithmic) return axis.low * std::pow(axis.high / axis.low, x);
    return axis.low + (axis.high - axis.low) * x;
  }

  void make_relative(const Leaf& leaf, Axis& axis) const {
    if (axis.target != Target::scene && axis.target != Target::observer) {
      fail(leaf, "is relative, and is no key of a scene; must be linear, log or values");
    }
    const std::optional<double> base = scene_number(axis.key);
    if (!base) {
      fail(leaf, "is relative; must be a number that " + study_.scene_file.string() + " gives");
    }
    axis.base = *base;
    if (axis.target == Target::observer) {
      axis.relative = true;
      return;
    }
    for (double& value : axis.values) value = *base * (1.0 + value);
    axis.low = *base * (1.0 + axis.low);
    axis.high = *base * (1.0 + axis.high);
  }

  void check_limits(const Leaf& leaf, const Axis& axis, const Knob* knob) const {
    if (knob == nullptr) return;
    std::vector<double> values = axis.values;
    if (values.empty()) values = {axis.low, axis.high};
    for (const double value : values) {
      const Limits& limits = knob->limits;
      const bool allowed = value >= limits.low && value <= limits.high &&
                           !(limits.without_low && value == limits.low);
      if (!allowed) {
        fail(leaf, "has " + to_text(value) + "; must be " +
                       (std::isfinite(limits.high)
                            ? "in [" + to_text(limits.low) + ", " + to_text(limits.high) + "]"
                            : (limits.without_low ? "> " : ">= ") + to_text(limits.low)));
      }
      if (axis.target != Target::modes) continue;
      const auto f = static_cast<double>(study_.scene.model.coordinates());
      if (value != std::floor(value) || value > f || axis.values.empty()) {
        fail(leaf, "has " + to_text(value) + "; must be whole numbers in 1.." + to_text(f));
      }
    }
  }

  void count_points() {
    double points = 1.0;
    for (const std::int64_t size : study_.group_size) points *= static_cast<double>(size);
    if (!(points * static_cast<double>(study_.runs) <= most_indices)) {
      document_.fail(document_.table().get("vary")->source().begin,
                     "vary has " + to_text(points * static_cast<double>(study_.runs)) +
                         " runs in all; must be at most " + to_text(most_indices));
    }
    study_.points = 1;
    for (const std::int64_t size : study_.group_size) study_.points *= size;
  }

  // Checks that the least and the largest value make a valid scene, with the first values of the
  // other axes.
  void check_in_scene(const Leaf& leaf, std::size_t i) const {
    const Axis& axis = study_.axes[i];
    if (axis.target != Target::scene && axis.target != Target::observer) return;
    if (axis.target == Target::observer && study_.varies(Target::modes) && !study_.scene.beam) {
      fail(leaf,
           "varies with observer.modes; the scene must be a [beam] then, whose modes are the "
           "same for both");
    }
    std::vector<double> values = values_at(study_, 0);
    std::vector<double> ends = axis.values;
    if (ends.empty()) ends = {axis.low, axis.high};
    if (axis.relative) {
      for (double& end : ends) end = axis.base * (1.0 + end);
    }
    const auto [least, largest] = std::minmax_element(ends.begin(), ends.end());
    for (const double value : {*least, *largest}) {
      values[i] = value;
      try {
        setting_of(study_, values);
      } catch (const SceneError& error) {
        fail(leaf,
             "= " + to_text(value) + ": " + study_.scene_file.string() + ": " + error.message);
      } catch (const Error& error) {
        fail(leaf, "= " + to_text(value) + ": " + error.what());
      }
    }
  }

  TomlDocument& document_;
  Study& study_;
  std::vector<std::string> zips_;  // zip name of each group; empty: none
};

void read_stroboscope(const TomlTable& root, Study& study) {
  const auto table =
      root.table("machine", {"period", "transient", "periods", "longest", "coordinates"});
  Stroboscope& stroboscope = study.stroboscope;
  const auto f = static_cast<int>(study.scene.model.coordinates());
  std::vector<std::string> all;
  for (const char* letter : {"q", "u"}) {
    for (int i = 1; i <= f; ++i) all.push_back(letter + std::to_string(i));
  }
  if (table) {
    if (table->has("period")) stroboscope.period = table->number("period", positive);
    constexpr int most = 100'000'000;
    if (table->has("transient")) stroboscope.transient = table->integer("transient", 0, most);
    if (table->has("periods")) stroboscope.periods = table->integer("periods", 1, most);
    if (table->has("longest")) stroboscope.longest = table->integer("longest", 1, most);
  }
  stroboscope.coordinate_names =
      table && table->has("coordinates") ? table->strings("coordinates") : all;
  const std::vector<std::string_view> words(all.begin(), all.end());
  for (std::size_t i = 0; i < stroboscope.coordinate_names.size(); ++i) {
    const std::string& given = stroboscope.coordinate_names[i];
    const auto found = std::find(all.begin(), all.end(), given);
    if (found == all.end()) table->fail("coordinates", i, unknown_word(given, words));
    const auto number = static_cast<int>(found - all.begin());
    if (std::find(stroboscope.coordinates.begin(), stroboscope.coordinates.end(), number) !=
        stroboscope.coordinates.end()) {
      table->fail("coordinates", i, " is \"" + given + "\" again; must be another one");
    }
    stroboscope.coordinates.push_back(number);
  }
  if (stroboscope.coordinates.empty()) {
    table->fail("coordinates", "is empty; must name a coordinate at least");
  }
}

void read_disturbance(const TomlTable& root, Study& study) {
  const auto table = root.table("disturbance", {"jitter", "offset", "lost", "spurious"});
  if (!table) return;
  study.jitter_given = table->has("jitter");
  study.disturbance = {.jitter = table->number_or("jitter", 0.0, not_negative),
                       .offset = table->number_or("offset", 0.0, any_number),
                       .lost = table->number_or("lost", 0.0, {0.0, 1.0}),
                       .spurious = table->number_or("spurious", 0.0, not_negative)};
}

void read_start(const TomlTable& root, Study& study) {
  const auto table = root.table("start", {"replica", "machine"});
  if (!table) return;
  if (table->has("replica")) study.start_replica = table->number("replica", not_negative);
  study.start_machine = table->number_or("machine", 0.0, not_negative);
}

void check_completeness(const TomlTable& root, const Study& study) {
  const Record& record = study.record;
  if (record.of_estimators() && study.estimators.empty()) {
    root.fail("record", "has quantities of an estimator; must go with estimators = [...]");
  }
  const bool filter =
      std::any_of(study.estimators.begin(), study.estimators.end(),
                  [](EstimatorKind kind) { return kind != EstimatorKind::replica; });
  if (record.of_filter() && !filter) {
    root.fail("record",
              "has nees, beyond_3_sigma or trusted, which a replica does not tell; must "
              "go with the estimator timing, both or adaptive");
  }
  const auto& estimators = study.estimators;
  if (record.worse && (!filter || std::find(estimators.begin(), estimators.end(),
                                            EstimatorKind::replica) == estimators.end())) {
    root.fail("record",
              "has worse, which is against the replica; must go with the estimators replica and "
              "timing, both or adaptive");
  }
  if (std::find(estimators.begin(), estimators.end(), EstimatorKind::adaptive) !=
      estimators.end()) {
    if (study.varies(Target::modes)) {
      root.fail("estimators",
                "has adaptive, which seeks keys of the scene; must be without it where "
                "observer.modes varies");
    }
    try {
      const TrackingEstimator possible(study.scene, 1.0, EstimatorKind::adaptive);
    } catch (const ModelError& error) {
      root.fail("estimators", std::string("has adaptive: ") + error.what());
    }
  }
  if (!record.of_estimators() && !study.estimators.empty()) {
    root.fail("estimators",
              "has nothing that is recorded of them; must be left out, or record one "
              "of V_floor, V_max, rate, time_below, nees, beyond_3_sigma, trusted, worse");
  }
  const bool needs_duration = record.of_estimators() || record.impacts;
  if (needs_duration && !(study.duration > 0.0) && !study.varies(Target::duration)) {
    root.fail_here("missing key duration");
  }
  if (record.of_recurrence() && !(study.stroboscope.period > 0.0) &&
      !(only_frequency(study.scene.model) > 0.0)) {
    root.fail("record",
              "has quantities of a stroboscope, and the scene has not one frequency; must "
              "go with machine.period");
  }
  const Scene& scene = study.scene;
  if ((needs_duration || record.of_recurrence()) && !scene.truth.given) {
    root.fail("scene", "has no [master]; must say where the machine starts");
  }
}

}  // namespace

bool Study::varies(Target target) const {
  return std::any_of(axes.begin(), axes.end(),
                     [&](const Axis& axis) { return axis.target == target; });
}

const char* name(EstimatorKind kind) {
  for (const auto& [word, value] : estimator_names) {
    if (value == kind) return word;
  }
  return "";
}

Study read_study(const std::filesystem::path& file, const std::filesystem::path& scenes,
                 const std::function<void(const std::filesystem::path&)>& names) {
  const std::filesystem::path studies = scenes.empty() ? scenes : scenes / "studies";
  if (const std::string why = scene_not_found(file, studies); !why.empty()) {
    throw InputError(file.string() + ": " + why);
  }
  return parse_study(read_whole(file), file, scenes, names);
}

Study parse_study(const std::string& text, const std::filesystem::path& file,
                  const std::filesystem::path& scenes,
                  const std::function<void(const std::filesystem::path&)>& names) {
  Study study;
  study.file = file.string();
  study.text = text;
  TomlDocument document(study.text, {study.file, file.parent_path()});
  const TomlTable root = document.root({"name", "scene", "seed", "draws", "runs", "duration",
                                        "tick", "samples", "estimators", "threshold", "record",
                                        "machine", "disturbance", "start", "vary"});
  study.name = root.string_or("name", file.stem().string());
  const std::string scene = root.required_string("scene");
  study.scene_file = file.parent_path() / scene;
  if (!std::filesystem::is_regular_file(study.scene_file)) {
    study.scene_file = shipped_file(scene, scenes);
  }
  if (study.scene_file.empty()) {
    root.fail("scene", "is \"" + scene +
                           "\"; must be a scene file, seen from the study's folder, or the name of "
                           "a scene that comes with Sprag");
  }
  const auto add_input = [&](const std::filesystem::path& named) {
    study.inputs.push_back(named);
    if (names) names(named);
  };
  add_input(study.scene_file);
  study.scene_text = read_whole(study.scene_file);
  study.scene = read_scene(study.scene_file, add_input);

  constexpr std::int64_t most = 1'000'000'000;
  if (root.has("seed")) {
    study.seed = static_cast<std::uint64_t>(root.integer("seed", 0, static_cast<int>(most)));
  }
  study.common_draws = root.choice("draws", {"independent", "common"}) == "common";
  if (root.has("runs")) study.runs = root.integer("runs", 1, static_cast<int>(most));
  if (root.has("duration")) study.duration = root.number("duration", positive);
  if (root.has("tick")) study.tick = root.number("tick", positive);
  if (root.has("samples")) study.samples = root.integer("samples", 2, 10'000'000);
  if (root.has("threshold")) study.threshold = root.number("threshold", positive);
  study.estimators = named_values(root, "estimators", estimator_names);
  for (bool Record::*what : named_values(root, "record", record_names)) study.record.*what = true;
  read_stroboscope(root, study);
  read_disturbance(root, study);
  read_start(root, study);
  Reader(document, study).read_vary();
  check_completeness(root, study);

  study.hash = hash_of(study.text, 0xcbf29ce484222325U);
  for (const std::filesystem::path& input : study.inputs) {
    study.hash = hash_of(read_whole(input), study.hash);
  }
  return study;
}

}  // namespace sprag::study
