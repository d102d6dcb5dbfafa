// Studies for the charts of docs/measurements/speed_accuracy.md, one CSV each.
#pragma once

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "sprag/detail/files/output_file.h"
#include "sprag/scene.h"
#include "studies/common/cpu_time.h"

namespace sprag::studies {

/// A CSV's field: text, or a number with 6 significant digits.
struct Field {
  Field(const char* given) : text(given) {}
  Field(double value);

  std::string text;
};

/// A CSV with a header line.
class Table {
 public:
  Table(const std::string& file, const std::string& header) : out_(file) {
    out_.write(header + "\n");
  }
  void add(const std::vector<Field>& fields);
  /// Throws std::runtime_error if not everything could be written.
  void close();

 private:
  OutputFile out_;
};

/// V after 20 and 100 units of time on the paper's beam, and the cost of a unit of time, over
/// estimators and ticks, with exact events and with jitter.
void observer(Table& table);
inline constexpr const char* observer_columns = "method,jitter,tick,V20,V100,cpu_us_per_time";

/// V of a salted Kalman filter with a position sensor, and of the timing filter, over their noise.
void position_sensor(Table& table);
inline constexpr const char* position_sensor_columns = "scene,start,what,rate_hz,sigma,V";

/// A 40-mode master with three kinds of damping, observed with fewer modes: without correction,
/// with the correction that its events choose, and the lower limit.
void modes(Table& table);
inline constexpr const char* modes_columns =
    "damping,method,correction,modes,coordinates,V_kept,tip_rms,ns_per_tick";

/// ns per tick and us per impact against modes and contacts.
void growth(Table& table);
inline constexpr const char* growth_columns = "what,against,count,value";

/// ns per tick compared with a minimal loop written by hand, measured alternately.
void limit(Table& table);
inline constexpr const char* limit_columns = "modes,turn,ours_ns,limit_ns";

/// Missed and spurious impacts of each method on the paper's beam with more and more modes.
void stability(Table& table);
inline constexpr const char* stability_columns = "method,modes,step,result,found,impacts";

/// The paper's beam with another number of modes than three.
Scene paper_beam(int modes);
/// The same in free flight, without its contact. This saves building the flow of a thousand locked
/// modes.
Scene free_beam(int modes);

/// Shortest CPU time [s] of run(), repeated for about `seconds`.
template <typename Run>
double shortest_cpu_time(const Run& run, double seconds = 0.3) {
  using common::cpu_seconds;
  double shortest = std::numeric_limits<double>::infinity();
  const double begin = cpu_seconds();
  do {
    const double start = cpu_seconds();
    run();
    shortest = std::min(shortest, cpu_seconds() - start);
  } while (cpu_seconds() - begin < seconds);
  return shortest;
}

}  // namespace sprag::studies
