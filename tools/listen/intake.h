// From bytes of a source to contact events and their watermark. It reads no clock and no device:
// times of arrival are arguments, in seconds since the program's start.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/import/contact_stream.h"
#include "sprag/detail/import/level_edges.h"
#include "tools/listen/arrival_scatter.h"
#include "tools/listen/device_clock.h"
#include "tools/listen/input_grid.h"
#include "tools/listen/line_parser.h"
#include "tools/listen/line_splitter.h"

namespace sprag {

/// How samples of the column LineOptions::input become those of the machine's excitation.
struct InputColumn {
  double dt = 0.0;     ///< interval between samples, on the machine's time [s]
  double unit = 1.0;   ///< one unit of the column in the unit of the excitation
  ContactClock clock;  ///< of the lines' times; samples are on the machine's time
};

struct IntakeOptions {
  LineOptions lines;
  InputColumn input;            ///< if lines.input is not empty
  bool inverted = false;        ///< contacts are closed while their level is low
  Edge impacts = Edge::closed;  ///< edges of levels that are impacts
  DeviceClockOptions clock;     ///< of lines with a time
  EdgeRules rules;
  bool stamp_arrival = false;  ///< edges are at the time of arrival of their lines
  double stall = 1.0;          ///< without a line for this time the watermark stops [s]
};

/// Receives what the intake makes of the bytes, in this order.
class IntakeSink {
 public:
  virtual ~IntakeSink() = default;
  /// New events, in order of time, and the watermark: every event up to it has been given.
  virtual void events(std::span<const ContactEvent> events, double watermark) = 0;
  /// Samples of the input begin, in this session: sample k has the machine's time t0 + k dt [s].
  virtual void start_input(double t0, double dt) = 0;
  /// Sample k, later than all before. Numbers that are left out are samples that are missing.
  virtual void sample(std::int64_t k, double value) = 0;
  /// The device was restarted or connected again. Its time begins anew.
  virtual void new_session() = 0;
  /// A line cannot be used: its number, from 1, its first bytes as they arrived, and the reason.
  virtual void problem(std::int64_t number, const std::string& text, const std::string& why) = 0;
  /// A message for the user.
  virtual void notice(const std::string& text) = 0;
};

struct IntakeCounts {
  std::int64_t lines = 0;       ///< nonempty
  std::int64_t bad_lines = 0;   ///< that cannot be used
  std::int64_t late_edges = 0;  ///< of these, older than the watermark
  std::int64_t edges = 0;       ///< taken
  std::int64_t sessions = 0;
  std::int64_t wraps = 0;  ///< of the counter
  std::int64_t stalls = 0;
  std::int64_t samples = 0;          ///< of the input
  std::int64_t bad_samples = 0;      ///< with a time that is not in its place
  std::int64_t missing_samples = 0;  ///< between samples
};

class Intake {
 public:
  /// Throws UsageError.
  Intake(const IntakeOptions& options, IntakeSink& sink);

  /// Bytes of the source that arrived at `arrival`.
  void take(std::string_view bytes, double arrival);

  /// Time passes. The watermark follows this host's clock, `latency` behind, while lines arrive.
  void pass(double now);

  /// The source is gone; another one, or the same, may follow.
  void disconnect();

  /// The next line may be the end of a longer one: skips it.
  void skip_line() { splitter_.skip_line(); }

  /// No byte follows: a contact that is closed stays closed.
  void finish();

  const IntakeCounts& counts() const { return counts_; }
  /// Of all sessions.
  EdgeCounts edge_counts() const;
  EdgeCounts edge_counts(int contact) const;
  double watermark() const { return stream_.watermark(); }
  const ArrivalScatter& scatter() const { return scatter_; }

 private:
  struct Line {
    std::int64_t number = 0;
    std::string text{};
    ParsedLine parsed{};
    double arrival = 0.0;
    DeviceClock::Reading reading{};  ///< of its time, if edges have the device's time
  };

  DeviceClock::Reading read_clock(const Line& line) const {
    return clock_.read(*line.parsed.time, line.arrival);
  }
  void take_line(Line line);
  void take_timed(Line line);
  void hold(Line line);
  void release_held(bool restarted);
  void drop_held();
  void use(const Line& line);
  /// Returns whether all levels are repetitions.
  bool take_levels(const Line& line, double t);
  void take_sample(const Line& line);
  void begin_session();
  void restart_clock(double t);
  void check_rate(double t, double arrival);
  void flush();
  void refuse(const Line& line, const std::string& why);
  LevelEdges new_level() const;

  IntakeOptions options_;
  IntakeSink& sink_;
  LineSplitter splitter_;
  LineParser parser_;
  DeviceClock clock_;
  ArrivalScatter scatter_;
  ContactStream stream_;
  InputGrid grid_;
  std::vector<LevelEdges> levels_;
  std::vector<EdgeCounts> earlier_;  // of the sessions before, by contact
  std::vector<Line> held_;           // whose times do not follow the last one; later lines show why
  IntakeCounts counts_;
  std::optional<double> latest_;     // time of the last lines, not yet given to stream_
  std::optional<double> last_line_;  // its arrival
  std::optional<std::pair<double, double>> first_;  // time and arrival of a session's first line
  bool any_session_ = false;
  bool connected_ = true;      // false: the next line is of another connection
  bool header_again_ = false;  // a header came after lines
  bool stalled_ = false;
  bool said_missing_ = false;  // samples of this session are missing
  bool said_rate_ = false;     // the rate of the device's clock has been checked
};

}  // namespace sprag
