#include "tools/listen/run.h"

#include <poll.h>

#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "command_line/signals.h"
#include "sprag/detail/text/printable.h"
#include "tools/listen/publication.h"
#include "tools/listen/source.h"

namespace sprag {

namespace {

constexpr int longest_wait = 5;            // ms, between two watermarks
constexpr double progress_interval = 1.0;  // s

std::unique_ptr<EdgeSource> open_source(const ListenRun& run) {
  if (!run.serial.empty()) return serial_port(run.serial, run.baud);
  if (run.tcp) return tcp_port(*run.tcp);
  return standard_input();
}

void check(const ListenRun& run) {
  const IntakeOptions& intake = run.intake;
  if (run.record.extension() != ".lcmlog" && !run.record.empty())
    throw UsageError("--record is " + run.record.string() + "; must end in .lcmlog");
  const bool unpaced = std::isinf(intake.clock.speed);
  if (intake.stamp_arrival && unpaced)
    throw UsageError("--stamp arrival needs a finite --speed: edges get the times of this host");
  if (!intake.lines.input.empty() && intake.stamp_arrival) {
    throw UsageError(
        "--input and --stamp arrival exclude each other: samples need the device's times");
  }
  if (intake.impacts == Edge::closed || intake.rules.pulse_shorter_than == 0.0) return;
  throw UsageError(
      "--pulse-shorter-than is of contacts that close and open; with --impacts-at every "
      "event is a pulse");
}

// The intake's options that the scene gives. Throws UsageError.
void complete(ListenRun& run, const Scene& scene) {
  IntakeOptions& intake = run.intake;
  intake.lines.contacts = static_cast<int>(scene.model.contacts.size());
  // Messages are on the contact clock, which runs at this rate.
  intake.clock.speed *= scene.clock.rate;
  check(run);
  if (intake.lines.input.empty()) return;
  if (!(scene.stream_duration > 0.0)) {
    throw UsageError("--input: " + printable(scene.name) +
                     " must have a streamed excitation: stream = true in [excitation]");
  }
  for (const Force& force : scene.model.forces) {
    // The device takes samples by its own clock, at the interval of the record.
    if (force.input)
      intake.input.dt = force.input->spacing() / (scene.clock.rate * intake.clock.rate);
  }
  intake.input.unit = scene.stream_unit;
  intake.input.clock = scene.clock;
}

void say_scatter(const Intake& intake, const ListenRun& run, nlohmann::ordered_json& report) {
  const auto scatter = intake.scatter().result();
  if (scatter) {
    report["arrival"] = {
        {"sigma", scatter->sigma}, {"lines", scatter->lines}, {"timed", scatter->timed}};
  }
  if (!run.intake.stamp_arrival) return;
  if (!scatter) {
    std::cerr
        << "the scatter of arrival is not known: let the device print its time too, or repeat "
           "its level at a fixed period\n";
    return;
  }
  report["jitter"] = scatter->sigma;
  std::cerr << "arrivals scatter by " << scatter->sigma << " s (" << scatter->lines
            << (scatter->timed ? " lines against the device's times"
                               : " intervals of lines that repeat a level")
            << "); in the scene: [events] jitter = " << scatter->sigma << '\n';
}

void fill(const Intake& intake, const EdgeSource& source, const ListenPublication& publication,
          const LineOptions& lines, nlohmann::ordered_json& report) {
  const IntakeCounts& counts = intake.counts();
  report["lines"] = counts.lines;
  report["bad_lines"] = counts.bad_lines;
  report["late_edges"] = counts.late_edges;
  report["edges"] = counts.edges;
  report["events"] = publication.published();
  report["contacts"] = nlohmann::ordered_json::array();
  for (int i = 0; i < lines.contacts; ++i) {
    const EdgeCounts of = intake.edge_counts(i);
    report["contacts"].push_back({{"contact", i + 1},
                                  {"pulses", of.pulses},
                                  {"sustained", of.sustained},
                                  {"merged", of.merged}});
  }
  const EdgeCounts all = intake.edge_counts();
  report["before_start"] = all.before_start;
  report["after_duration"] = all.after_duration;
  report["sessions"] = counts.sessions;
  report["reconnections"] = source.reconnections();
  report["wraps"] = counts.wraps;
  report["stalls"] = counts.stalls;
  if (std::isfinite(intake.watermark())) report["watermark"] = intake.watermark();
  if (!lines.input.empty()) {
    report["input"] = {{"samples", counts.samples},
                       {"bad_samples", counts.bad_samples},
                       {"missing_samples", counts.missing_samples}};
  }
  report["messages"] = publication.messages();
  report["unsent"] = publication.unsent();
}

}  // namespace

int run_listen(ListenRun run, const Scene& scene, const CommonOptions& common,
               nlohmann::ordered_json& report) {
  complete(run, scene);
  const int contacts = run.intake.lines.contacts;
  (void)host_seconds();
  const std::unique_ptr<EdgeSource> source = open_source(run);
  PublisherSettings settings;
  settings.url = common.url;
  settings.key = key_of(common);
  settings.speed = run.intake.clock.speed;
  ListenPublication publication(contacts, settings, run.record, source->name());
  Intake intake(run.intake, publication);
  if (run.tcp) std::cerr << "listening on " << source->name() << '\n';

  const double duration = run.intake.rules.duration;
  bool more = true;
  double next_progress = progress_interval;
  while (more && !stop_requested() && intake.watermark() < duration) {
    pollfd ready{source->descriptor(), POLLIN, 0};
    const int count = ::poll(&ready, 1, longest_wait);
    const double now = host_seconds();
    if (count > 0 && ready.revents != 0) more = source->read(intake, publication, now);
    source->revive(publication, now);
    intake.pass(now);
    publication.pass();
    if (now < next_progress) continue;
    next_progress = now + progress_interval;
    publication.flush();
    std::cerr << "t " << intake.watermark() << "  lines " << intake.counts().lines << "  events "
              << publication.published() << '\n';
  }
  if (!more) {
    intake.finish();
  } else {
    intake.disconnect();
  }
  publication.finish();
  fill(intake, *source, publication, run.intake.lines, report);
  say_scatter(intake, run, report);
  const IntakeCounts& counts = intake.counts();
  std::cerr << counts.lines << " lines, " << publication.published()
            << " events; skipped: " << counts.bad_lines << " lines, " << counts.late_edges
            << " of them too late; sessions: " << counts.sessions << '\n';
  if (!run.intake.lines.input.empty()) {
    std::cerr << counts.samples
              << " samples of the input; not in their place: " << counts.bad_samples
              << "; missing: " << counts.missing_samples << '\n';
  }
  if (!more && counts.edges == 0)
    throw std::runtime_error(source->name() + " has ended without an edge that can be used");
  return exit_done;
}

}  // namespace sprag
