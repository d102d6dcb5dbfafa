// A study file (TOML): a scene, its varied keys, the disturbances of its events, and the recorded
// quantities. The format is described in docs/reference/study_files.md.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sprag/detail/replica/any_replica.h"
#include "sprag/detail/study/disturbance.h"
#include "sprag/scene.h"

namespace sprag::study {

/// The quantity that an axis varies.
enum class Target {
  scene,     ///< a key of the scene, for the machine and its observer
  observer,  ///< a key of the scene, in the observer's model only
  modes,     ///< number of lowest modes that the observer keeps
  jitter,
  offset,
  lost,
  spurious,
  start_replica,
  start_machine,
  duration,
  tick
};

struct Axis {
  std::string path;  ///< as in the study file; name of its column
  Target target = Target::scene;
  std::string key;             ///< of the scene
  std::vector<double> values;  ///< grid; empty: drawn for each run, between low and high
  double low = 0.0, high = 0.0;
  bool logarithmic = false;  ///< drawn uniformly in the logarithm
  /// Values are relative deviations of the observer's value from the machine's. `base` is the
  /// scene's.
  bool relative = false;
  double base = 0.0;
  std::size_t group = 0;  ///< axes of one group vary together
};

/// The recorded quantities, of each estimator and of the machine.
struct Record {
  bool V_floor = false, V_max = false, rate = false, time_below = false;
  bool nees = false, beyond_3_sigma = false, trusted = false;
  bool worse = false;
  bool impacts = false;
  bool poincare = false, impacts_per_period = false, lyapunov = false, attractor = false;

  bool of_errors() const { return V_floor || V_max || rate || time_below; }
  bool of_filter() const { return nees || beyond_3_sigma || trusted; }
  bool of_estimators() const { return of_errors() || of_filter() || worse; }
  bool of_recurrence() const { return poincare || impacts_per_period || lyapunov || attractor; }
};

/// Settings for quantities of the machine alone (recurrence.h).
struct Stroboscope {
  double period = 0.0;                        ///< [s]; 0: that of the excitation
  int transient = 300;                        ///< periods before recording
  int periods = 200;                          ///< recorded periods
  int longest = 32;                           ///< longest cycle to search for, in periods
  std::vector<int> coordinates;               ///< of the state (q, u), from 0
  std::vector<std::string> coordinate_names;  ///< q1, u1, ...
};

struct Study {
  std::string name;
  std::string file, text;
  std::filesystem::path scene_file;
  std::string scene_text;
  Scene scene;                                ///< without variations
  std::vector<std::filesystem::path> inputs;  ///< the scene and the files that it names
  std::uint64_t hash = 0;                     ///< of the study file and the contents of all inputs

  std::uint64_t seed = 1;
  bool common_draws = false;          ///< run r uses the same random numbers at every point
  std::int64_t runs = 1;              ///< per point
  double duration = 0.0, tick = 0.0;  ///< [s]; tick 0: the interval of samples
  int samples = 1000;
  double threshold = 0.0;  ///< of V; 0: 1e-4 of V at the start
  std::vector<EstimatorKind> estimators;
  Record record;
  Stroboscope stroboscope;
  Disturbance disturbance;
  bool jitter_given = false;  ///< else the jitter is that of the machine's scene
  std::optional<double> start_replica;
  double start_machine = 0.0;
  std::vector<Axis> axes;                ///< in the order of the file
  std::vector<std::int64_t> group_size;  ///< points of each group of axes; the last varies fastest
  std::int64_t points = 1;

  std::int64_t indices() const { return points * runs; }
  bool varies(Target target) const;
};

/// The estimator's name in study files and columns.
const char* name(EstimatorKind kind);

/// Reads and checks a study and its scene, which may be the name of one in the folder `scenes`
/// (shipped_scenes.h; empty: none). Calls `names` with each file that they name before the
/// contents are checked further. Throws SceneError, with the position in the study file,
/// InputError, and the exceptions of `names`.
Study read_study(const std::filesystem::path& file, const std::filesystem::path& scenes,
                 const std::function<void(const std::filesystem::path&)>& names = {});

/// The same from text. `file` is the name in errors; its folder is the one to which the scene's
/// path is relative.
Study parse_study(const std::string& text, const std::filesystem::path& file,
                  const std::filesystem::path& scenes,
                  const std::function<void(const std::filesystem::path&)>& names = {});

}  // namespace sprag::study
