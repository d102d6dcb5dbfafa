#include "tools/listen/options.h"

#include <CLI/CLI.hpp>
#include <string_view>

#include "sprag/detail/files/csv.h"
#include "tools/import_events/options.h"

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

}  // namespace

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
  add_level_columns(app, run.intake.lines.levels);
  add_level_options(app, run.levels);
  add_text(app, "--input", run.intake.lines.input, "NAME",
           "Column of samples of the excitation, for a scene with excitation.stream");
  add_format_options(app, run.intake.lines.names, run.intake.lines.separator);
  add_time_options(app, run.intake.clock.unit, run.intake.clock.offset, run.intake.clock.rate);
  add_count(app, "--counter-bits", run.intake.clock.counter_bits, "N",
            "Times are a counter of N bits that wraps, as 32 for micros() of an Arduino", 64);
  add_choice(app, "--stamp", run.intake.stamp_arrival, {{"device", false}, {"arrival", true}},
             "Times of edges: those of the device, or the times of arrival here [device]");
  add_positive(app, "--latency", run.intake.clock.latency, "T",
               "Longest time from an edge to the arrival of its line [s] [0.05]");
  add_positive(app, "--stall", run.intake.stall, "T",
               "Without a line for T [s] the watermark stops [1]");
  add_edge_rules(app, run.intake.rules.debounce, run.intake.rules.pulse_shorter_than);
  add_positive(app, "--duration", run.intake.rules.duration, "T", "End at this time [s]");
  add_positive_or_max(app, "--speed", run.intake.clock.speed, "R|max",
                      "Device seconds per second; max: lines of a file, as fast as they come [1]");
  add_file(app, common, "--record", NamedFile::Use::written, run.record, "F.lcmlog",
           "Record the messages that are sent");
}

}  // namespace sprag
