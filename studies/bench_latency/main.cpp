// bench_latency: latency of an observer from event to estimate, compared with bare LCM and UDP
// pings.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "sprag/scene_file.h"
#include "studies/bench_latency/latency.h"

int main(int argc, char** argv) {
  CLI::App app(
      "Measures the time from the sending of a contact event to the estimate that contains it, "
      "beside bare LCM and UDP pings, and from a line that listen reads.",
      "bench_latency");
  sprag::CommonOptions common;
  sprag::bench_latency::Options options;
  sprag::add_common_options(app, common);
  sprag::add_scene(app, common, options.scene);
  app.add_option("--observer", options.observer, "The observer's program")
      ->type_name("FILE")
      ->default_val(SPRAG_OBSERVER);
  app.add_option("--listen", options.listen, "The program listen")
      ->type_name("FILE")
      ->default_val(SPRAG_LISTEN);
  app.add_option("--listen-url", options.listen_url, "LCM address of listen and its observer")
      ->capture_default_str();
  app.add_option("--ping-url", options.lcm_url, "LCM address of the ping")->capture_default_str();
  sprag::add_positive(app, "--tick", options.tick, "h", "The observer's tick [1e-3]");
  app.add_option("--events", options.events, "How many events and pings")
      ->check(CLI::Range(1, 10'000'000))
      ->capture_default_str();
  app.add_flag("--realtime", options.real_time, "Run the observer with --realtime");

  return sprag::run_program(argc, argv, app, common, [&](nlohmann::ordered_json& report) {
    const auto contacts = sprag::read_scene(options.scene).model.contacts.size();
    const std::vector<sprag::bench_latency::Samples> samples =
        sprag::bench_latency::measure(options, common, static_cast<int>(contacts));
    std::printf("%-20s %8s %8s %8s %8s  [us, there and back]\n", "", "p50", "p99", "p99.9", "max");
    for (const sprag::bench_latency::Samples& s : samples) {
      std::printf("%-20s %8.0f %8.0f %8.0f %8.0f", s.what, s.us(0.5), s.us(0.99), s.us(0.999),
                  s.us(1.0));
      if (s.lost > 0) std::printf("  %d lost", s.lost);
      std::printf("\n");
      report[s.what] = {{"count", s.ns.size()}, {"lost", s.lost},         {"p50_us", s.us(0.5)},
                        {"p99_us", s.us(0.99)}, {"p999_us", s.us(0.999)}, {"max_us", s.us(1.0)}};
    }
    const auto& event = samples[0];
    const auto& ping = samples[1];
    const double p50 = event.us(0.5) / std::max(ping.us(0.5), 1e-3);
    const double p99 = event.us(0.99) / std::max(ping.us(0.99), 1e-3);
    std::printf("event to estimate / LCM ping: p50 %.2f, p99 %.2f\n", p50, p99);
    report["event_to_ping"] = {{"p50", p50}, {"p99", p99}};
    const auto& line = samples[3];
    const double line_p50 = line.us(0.5) / std::max(event.us(0.5), 1e-3);
    const double line_p99 = line.us(0.99) / std::max(event.us(0.99), 1e-3);
    std::printf("line to estimate / event to estimate: p50 %.2f, p99 %.2f\n", line_p50, line_p99);
    report["line_to_event"] = {{"p50", line_p50}, {"p99", line_p99}};
    return sprag::exit_done;
  });
}
