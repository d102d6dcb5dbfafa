#include "studies/robustness/tables.h"

#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "sprag/files/output_file.h"

namespace sprag::robustness {
namespace {

std::string text(double value) {
  char number[32];
  std::snprintf(number, sizeof number, "%.4g", value);
  return number;
}

const std::string& text(const std::string& value) { return value; }

template <typename... Fields>
void add(OutputFile& file, const std::string& first, const Fields&... fields) {
  std::string line = first;
  ((line += ',' + text(fields)), ...);
  file.write(line + '\n');
}

void close(OutputFile& file) {
  if (!file.close()) throw std::runtime_error(file.error());
}

}  // namespace

void write_tables(const std::filesystem::path& folder, const std::vector<Measured>& all) {
  OutputFile floors(folder / "floors.csv");
  OutputFile slopes(folder / "slopes.csv");
  OutputFile tolerances(folder / "tolerances.csv");
  OutputFile worse(folder / "worse.csv");
  floors.write("study,amount,method,V_5,V_50,V_95\n");
  slopes.write("study,method,exponent,factor,off,points,from,to\n");
  tolerances.write("study,method,amount,still_below\n");
  worse.write("study,amount,method,ratio,share_worse\n");
  for (const auto& [study, points] : all) {
    for (std::size_t j = 0; j < study.methods.size(); ++j) {
      const std::string method = name(study.methods[j]);
      for (const Point& point : points) {
        const auto& of = point.floors[j];
        add(floors, study.name, point.amount, method, quantile(of, 0.05), quantile(of, 0.5),
            quantile(of, 0.95));
        if (j == 0) continue;
        add(worse, study.name, point.amount, method, point.median(j) / point.median(0),
            point.share_worse[j]);
      }
      const Slope fit = slope(study, points, j);
      add(slopes, study.name, method, fit.law.exponent, fit.law.factor, fit.law.off,
          static_cast<double>(fit.points), fit.from, fit.to);
      const Threshold threshold = tolerance(points, j);
      add(tolerances, study.name, method, threshold.x, threshold.beyond ? 1.0 : 0.0);
    }
  }
  close(floors);
  close(slopes);
  close(tolerances);
  close(worse);
}

}  // namespace sprag::robustness
