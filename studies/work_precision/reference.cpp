#include "studies/work_precision/reference.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "sprag/detail/files/csv.h"

namespace sprag::work_precision {
namespace {

struct Source {
  std::string scene;
  std::string files;  // empty: closed form
  double horizon, early;
};

const std::array<Source, 6>& sources() {
  // Times up to which a method with rounding errors only is far better than 1e-6. Errors grow by at
  // most 10^(0.2 t) in the scenes of three modes, but by 10^(2.3 t) in two_stops_beam and by 10^(3
  // t) in stiff_beam.
  static const std::array<Source, 6> all{{{"paper_beam", "A_n3_c0", 20.0, 5.0},
                                          {"paper_beam_chatter", "B_n3_c0.0125", 20.0, 5.0},
                                          {"paper_beam_frame", "D_n3_s0_c0.005", 20.0, 5.0},
                                          {"two_stops_beam", "E_two_stops", 3.0, 1.0},
                                          {"stiff_beam", "C_n20_c0", 1.0, 0.5},
                                          {"bouncing_ball", "", 20.0, 20.0}}};
  return all;
}

struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<double>> rows;

  std::size_t column(const std::filesystem::path& file, const std::string& name) const {
    const auto found = std::find(columns.begin(), columns.end(), name);
    if (found == columns.end()) throw InputError(file.string() + ": has no column " + name);
    return static_cast<std::size_t>(found - columns.begin());
  }
};

Table read_table(const std::filesystem::path& file) {
  LineReader reader(file);
  Table table;
  std::string_view line;
  std::vector<std::string_view> fields;
  LineReader::Result result = LineReader::Result::line;
  const auto damaged = [&](const std::string& what) {
    return InputError(file.string() + ":" + std::to_string(reader.number()) + ": " + what);
  };
  while ((result = reader.next(line)) == LineReader::Result::line) {
    if (line.empty() || line.front() == '#') continue;
    split_fields(line, fields);
    if (table.columns.empty()) {
      table.columns.assign(fields.begin(), fields.end());
      continue;
    }
    if (fields.size() != table.columns.size()) throw damaged("wrong number of fields");
    std::vector<double>& row = table.rows.emplace_back();
    for (const std::string_view field : fields) {
      const std::optional<double> number = parse_double(field);
      if (!number) throw damaged(std::string(field) + " is not a number");
      row.push_back(*number);
    }
  }
  if (result != LineReader::Result::end) throw damaged(describe(result));
  return table;
}

std::vector<ReferenceImpact> read_impacts(const std::filesystem::path& file, double horizon) {
  const Table table = read_table(file);
  const std::size_t t = table.column(file, "t");
  const std::size_t gamma = table.column(file, "gamma_minus");
  std::vector<ReferenceImpact> impacts;
  for (const auto& row : table.rows) {
    if (row[t] <= horizon) impacts.push_back({row[t], row[gamma]});
  }
  return impacts;
}

void read_samples(const std::filesystem::path& file, Eigen::Index f, Reference& reference) {
  const Table table = read_table(file);
  if (static_cast<Eigen::Index>(table.columns.size()) != 1 + 2 * f) {
    throw InputError(file.string() + ": is of a machine with another number of coordinates");
  }
  Eigen::Index samples = 0;
  for (const auto& row : table.rows) {
    if (row[0] > reference.horizon) break;
    if (row[0] != static_cast<double>(samples) * reference.sample_step) {
      throw InputError(file.string() + ": samples are not " +
                       std::to_string(reference.sample_step) + " apart");
    }
    ++samples;
  }
  reference.q.resize(f, samples);
  reference.u.resize(f, samples);
  for (Eigen::Index k = 0; k < samples; ++k) {
    const auto& row = table.rows[static_cast<std::size_t>(k)];
    reference.q.col(k) = Eigen::Map<const Eigen::VectorXd>(row.data() + 1, f);
    reference.u.col(k) = Eigen::Map<const Eigen::VectorXd>(row.data() + 1 + f, f);
  }
}

}  // namespace

std::span<const std::string> reference_scenes() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Source& source : sources()) all.push_back(source.scene);
    return all;
  }();
  return names;
}

Reference reference(const Scene& scene, const std::filesystem::path& directory) {
  const auto source = std::find_if(sources().begin(), sources().end(),
                                   [&](const Source& s) { return s.scene == scene.name; });
  if (source == sources().end()) throw InputError(scene.name + ": has no reference solution");
  Reference reference;
  if (source->files.empty()) {
    return bouncing_mass(scene.model, scene.truth.start, source->horizon, reference.sample_step);
  }
  reference.horizon = source->horizon;
  reference.early = source->early;
  reference.impacts = read_impacts(directory / (source->files + "_impacts.csv"), reference.horizon);
  read_samples(directory / (source->files + "_samples.csv"), scene.model.coordinates(), reference);
  return reference;
}

Reference bouncing_mass(const Model& model, const State& start, double horizon,
                        double sample_step) {
  constexpr long double least_impact = 1e-12L;
  const bool fits = model.coordinates() == 1 && model.contacts.size() == 1 &&
                    model.C(0, 0) == 0.0 && model.K(0, 0) == 0.0 && model.forces.size() == 1 &&
                    model.forces[0].harmonic.amplitude == 0.0 && model.contacts[0].w[0] == 1.0 &&
                    model.contacts[0].clearance == 0.0 &&
                    model.contacts[0].motion.amplitude == 0.0 &&
                    model.contacts[0].restitution < 1.0 && start.u[0] == 0.0 && start.q[0] > 0.0;
  const long double weight =
      fits ? -static_cast<long double>(model.forces[0].direction[0]) * model.forces[0].constant
           : 0.0L;
  if (!(weight > 0.0L)) throw ModelError("not a mass that falls from rest onto a fixed floor");
  const long double fall = weight / model.M(0, 0);
  const long double height = start.q[0];
  const long double epsilon = model.contacts[0].restitution;

  // Impact k = 0, 1, ... is at t_1 (1 + 2 (epsilon + ... + epsilon^k)).
  const long double t_1 = std::sqrt(2 * height / fall);
  std::vector<long double> times{t_1};
  std::vector<long double> speeds{fall * t_1};  // before the impact
  while (speeds.back() * epsilon > least_impact) {
    speeds.push_back(speeds.back() * epsilon);
    times.push_back(times.back() + 2 * speeds.back() / fall);
  }
  const long double rest = t_1 * (1 + epsilon) / (1 - epsilon);

  Reference reference;
  reference.horizon = reference.early = horizon;
  reference.sample_step = sample_step;
  for (std::size_t k = 0; k < times.size() && times[k] <= horizon; ++k) {
    reference.impacts.push_back({static_cast<double>(times[k]), -static_cast<double>(speeds[k])});
  }
  const auto samples = static_cast<Eigen::Index>(horizon / sample_step + 1e-9) + 1;
  reference.q.setZero(1, samples);
  reference.u.setZero(1, samples);
  for (Eigen::Index k = 0; k < samples; ++k) {
    const long double t = static_cast<double>(k) * sample_step;
    if (t >= rest) break;
    const auto next = std::upper_bound(times.begin(), times.end(), t) - times.begin();
    const auto last = static_cast<std::size_t>(next > 0 ? next - 1 : 0);
    const long double tau = next > 0 ? t - times[last] : t;
    const long double rise = next > 0 ? epsilon * speeds[last] : 0.0L;
    const long double from = next > 0 ? 0.0L : height;
    reference.q(0, k) = static_cast<double>(from + rise * tau - fall * tau * tau / 2);
    reference.u(0, k) = static_cast<double>(rise - fall * tau);
  }
  return reference;
}

}  // namespace sprag::work_precision
