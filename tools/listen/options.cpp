#include "tools/listen/options.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <string_view>

#include "sprag/detail/files/csv.h"
#include "tools/listen/clock_time.h"
#include "tools/listen/unit.h"

namespace sprag {

namespace {

/// "7000", "127.0.0.1:7000", "localhost:7000".
std::optional<int> parse_port(std::string_view text) {
  const std::size_t colon = text.rfind(':');
  if (colon != std::string_view::npos) {
    const std::string_view host = text.substr(0, colon);
    if (host != "127.0.0.1" && host != "localhost") return std::nullopt;
    text.remove_prefix(colon + 1);
  }
  const auto port = parse_integer(text);
  if (!port || *port < 0 || *port > 65535) return std::nullopt;
  return static_cast<int>(*port);
}

std::optional<char> parse_separator(std::string_view text) {
  if (text == "comma" || text == ",") return ',';
  if (text == "semicolon" || text == ";") return ';';
  if (text == "tab" || text == "\t") return '\t';
  return std::nullopt;
}

void add_level_options(CLI::App& app, IntakeOptions& intake) {
  const auto add = [&intake](const std::string& text) { intake.lines.levels.push_back(text); };
  // Called for each option in turn, since contacts are numbered in the order of the options.
  app.add_option_function<std::string>(
         "--level", add,
         "Column of levels, high while the contact is closed; repeatable. Times are in --time")
      ->trigger_on_parse()
      ->type_name("[CONTACT=]NAME");
  add_text(app, "--time", intake.lines.time, "NAME",
           "Column of the levels' times [the one that begins with Time]");
  const auto set_threshold = [&intake](const std::string& text) {
    const auto number = parse_decimal(text);
    if (!number)
      throw CLI::ValidationError("--threshold", text + " is not allowed; must be a finite number");
    intake.lines.threshold = difference_in(*number, {}, {1, 0});
  };
  app.add_option_function<std::string>("--threshold", set_threshold,
                                       "A level above X is high [0.5, of levels 0 and 1]")
      ->type_name("X");
  add_flag(app, "--inverted", intake.inverted, "Low while the contact is closed");
  add_choice(app, "--impacts-at", intake.impacts,
             {{"rising", Edge::rising}, {"falling", Edge::falling}, {"both", Edge::both}},
             "Edges of the levels that are impacts: rising, falling or both; after "
             "--inverted, rising is where the level falls");
}

void add_format_options(CLI::App& app, LineOptions& lines) {
  const auto set_names = [&lines](const std::string& text) {
    std::vector<std::string_view> fields;
    split_fields(text, fields);
    lines.names.assign(fields.begin(), fields.end());
  };
  app.add_option_function<std::string>("--columns", set_names,
                                       "Names of the columns of lines without a header line")
      ->type_name("NAME,...");
  const auto set_separator = [&lines](const std::string& text) {
    const std::vector<std::string> choices{"comma", "semicolon", "tab"};
    lines.separator = parse_separator(text);
    if (!lines.separator) throw CLI::ValidationError("--separator", choose(text, choices));
  };
  app.add_option_function<std::string>("--separator", set_separator,
                                       "comma, semicolon or tab, if the lines do not show it")
      ->type_name("NAME");
}

void add_time_options(CLI::App& app, DeviceClockOptions& clock) {
  const auto set_unit = [&clock](const std::string& text) {
    const std::vector<std::string> choices{"s", "ms", "us", "ns", "a number of seconds > 0"};
    clock.unit = parse_unit(text);
    if (!clock.unit) throw CLI::ValidationError("--unit", choose(text, choices));
  };
  app.add_option_function<std::string>("--unit", set_unit,
                                       "Unit of the times: s, ms, us, ns or its length in "
                                       "seconds [as the columns' names say, else s]")
      ->type_name("U");
  const auto set_offset = [&clock](const std::string& text) {
    const auto time = parse_clock_time(text, DecimalMark::point);
    if (!time)
      throw CLI::ValidationError("--offset",
                                 text + " is not allowed; must be a finite number or a time");
    clock.offset = time->value;
  };
  app.add_option_function<std::string>(
         "--offset", set_offset,
         "Time that is the machine's t = 0, in the unit and on the clock of the times [0]")
      ->type_name("T");
  add_positive(app, "--rate", clock.rate, "R",
               "Seconds of the clock of the times per second of the machine: 1.0002 for a clock "
               "that is 200 ppm fast [1]");
}

}  // namespace

void check_clock(const ContactClock& clock, const DeviceClockOptions& options) {
  if (options.rate != 1.0 && clock.rate != 1.0) {
    throw UsageError(
        "--rate and clock.rate of the scene would correct the same clock twice; leave one of them "
        "out");
  }
  if (options.offset.mantissa != 0 && clock.offset != 0.0) {
    std::cerr << "clock.offset of the scene counts in addition to --offset\n";
  }
}

void add_listen_options(CLI::App& app, CommonOptions& common, ListenRun& run) {
  CLI::Option* const serial =
      add_text(app, "--serial", run.serial, "DEVICE", "Read a serial port, not stdin");
  needs(add_count(app, "--baud", run.baud, "N", "Rate of the serial port [115200]"), serial);
  const auto set_port = [&run](const std::string& text) {
    run.tcp = parse_port(text);
    if (run.tcp) return;
    throw CLI::ValidationError(
        "--tcp", text + " is not allowed; must be a port from 0 to 65535, or 127.0.0.1:PORT");
  };
  CLI::Option* const tcp =
      app.add_option_function<std::string>(
             "--tcp", set_port, "Accept a client on 127.0.0.1:PORT, one at a time; 0: a free port")
          ->type_name("PORT");
  excludes(serial, tcp);
  add_level_options(app, run.intake);
  add_text(app, "--input", run.intake.lines.input, "NAME",
           "Column of samples of the excitation, for a scene with excitation.stream");
  add_format_options(app, run.intake.lines);
  add_time_options(app, run.intake.clock);
  add_count(app, "--counter-bits", run.intake.clock.counter_bits, "N",
            "Times are a counter of N bits that wraps, as 32 for micros() of an Arduino", 64);
  add_choice(app, "--stamp", run.intake.stamp_arrival, {{"device", false}, {"arrival", true}},
             "Times of edges: those of the device, or the times of arrival here [device]");
  add_positive(app, "--latency", run.intake.clock.latency, "T",
               "Longest time from an edge to the arrival of its line [s] [0.05]");
  add_positive(app, "--stall", run.intake.stall, "T",
               "Without a line for T [s] the watermark stops [1]");
  add_positive(app, "--debounce", run.intake.rules.debounce, "T",
               "Merge closings of a contact that follow within T [s]");
  add_positive(app, "--pulse-shorter-than", run.intake.rules.pulse_shorter_than, "T",
               "Take contacts shorter than T [s] as pulses, at their closing");
  add_positive(app, "--duration", run.intake.rules.duration, "T", "End at this time [s]");
  add_positive_or_max(app, "--speed", run.intake.clock.speed, "R|max",
                      "Device seconds per second; max: lines of a file, as fast as they come [1]");
  add_file(app, common, "--record", NamedFile::Use::written, run.record, "F.lcmlog",
           "Record the messages that are sent");
}

}  // namespace sprag
