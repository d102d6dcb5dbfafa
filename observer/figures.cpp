#include "observer/figures.h"

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string>

#include "command_line/program.h"
#include "observer/report.h"

namespace sprag {
namespace {

using Json = nlohmann::ordered_json;

constexpr double nanosecond = 1e-9;
constexpr std::int64_t heartbeat = 10'000'000;  // ns
constexpr std::int64_t usual_medians = 4;

Json quantiles(const Histogram& histogram, double unit) {
  const auto value = [unit](std::int64_t v) { return unit * static_cast<double>(v); };
  return {{"count", histogram.count()},
          {"p50", value(histogram.quantile(0.5))},
          {"p99", value(histogram.quantile(0.99))},
          {"p999", value(histogram.quantile(0.999))},
          {"max", value(histogram.largest())}};
}

std::int64_t total(const Json& counts) {
  std::int64_t sum = 0;
  for (const auto& [cause, count] : counts.items()) sum += count.get<std::int64_t>();
  return sum;
}

void print_times(const char* what, const Histogram& histogram, std::ostream& out) {
  if (histogram.count() == 0) return;
  const auto us = [](std::int64_t ns) { return std::to_string((ns + 500) / 1000); };
  out << what << " p50 " << us(histogram.quantile(0.5)) << ", p99 " << us(histogram.quantile(0.99))
      << ", p99.9 " << us(histogram.quantile(0.999)) << ", max " << us(histogram.largest())
      << " us\n";
}

}  // namespace

DelayedEvents delayed(const Histogram& event_latency) {
  const std::int64_t usual = usual_medians * event_latency.quantile(0.5);
  const std::int64_t after = std::max(heartbeat, usual);
  return {after, event_latency.count_above(after)};
}

Json refused_by_cause(const ReceptionFigures& reception, const MessageCounts& messages) {
  Json refused = refusals(reception.refused, reception.bus);
  const auto add = [&refused](const char* cause, std::int64_t count) {
    if (count > 0) refused[cause] = count;
  };
  add("other_machine", reception.other_machine);
  add("implausible", messages.implausible);
  return refused;
}

void write_json(const LiveFigures& figures, Json& report) {
  const IntegrationFigures& integration = figures.integration;
  const ReceptionFigures& reception = figures.reception;
  const MessageCounts& messages = figures.messages;
  report["ticks"] = figures.ticks;
  report["unsettled_ticks"] = integration.unsettled_ticks;
  report["ticks_with_deadline"] = integration.lateness.count();
  report["missed_deadlines"] = integration.missed;
  report["lateness_s"] = quantiles(integration.lateness, nanosecond);
  report["execution_s"] = quantiles(integration.execution, nanosecond);
  report["event_latency_s"] = quantiles(integration.event_latency, nanosecond);
  report["late_events"] = integration.late_events;
  const DelayedEvents late = delayed(integration.event_latency);
  report["delayed_events"] = {{"count", late.count},
                              {"of_events", integration.event_latency.count()},
                              {"latency_above_s", nanosecond * static_cast<double>(late.after)}};
  report["real_time"] = {{"losses", integration.real_time_losses},
                         {"lost_s", nanosecond * static_cast<double>(integration.real_time_lost)}};
  report["estimates_dropped"] = integration.estimates_dropped;
  report["messages"] = {{"received", messages.received},
                        {"refused", refused_by_cause(reception, messages)},
                        {"lost", messages.lost},
                        {"repaired_events", integration.repaired_events},
                        {"doubled", messages.doubled},
                        {"reordered", messages.reordered},
                        {"of_past_sessions", messages.of_past_sessions},
                        {"of_other_masters", messages.of_other_masters},
                        {"stale", messages.stale},
                        {"resumed", messages.resumed},
                        {"overflowed", reception.overflowed + reception.bus.overflowed},
                        {"unsent", figures.unsent}};
  report["sessions"] = messages.sessions;
  report["rollbacks"] = to_json(figures.rollbacks);
  report["rollbacks"]["depth_ticks"] = quantiles(figures.rollbacks.depth, 1.0);
  report["rollbacks"]["cost_s"] = quantiles(integration.rollback_cost, nanosecond);
}

void print(const LiveFigures& figures, bool verbose, std::ostream& out) {
  const IntegrationFigures& integration = figures.integration;
  const MessageCounts& messages = figures.messages;
  out << "ticks " << figures.ticks << " settled, " << integration.unsettled_ticks
      << " unsettled; missed deadlines " << integration.missed << " of "
      << integration.lateness.count() << "; events " << figures.events.events << ", lost "
      << figures.events.lost_records << ", skipped " << all_skipped(figures.events) << '\n';
  if (!verbose) return;
  print_times("lateness ", integration.lateness, out);
  print_times("execution", integration.execution, out);
  print_times("event latency", integration.event_latency, out);
  out << "messages " << messages.received << ": lost " << messages.lost << ", doubled "
      << messages.doubled << ", reordered " << messages.reordered << ", refused "
      << total(refused_by_cause(figures.reception, messages)) << "; events repaired "
      << integration.repaired_events << "; sessions " << messages.sessions << '\n';
  const DelayedEvents late = delayed(integration.event_latency);
  out << "events reported after the tick of their time: " << integration.late_events << " of "
      << figures.events.events << ", rollbacks for them: " << figures.rollbacks.rollbacks
      << " (normal: a report follows its event), deepest " << figures.rollbacks.depth.largest()
      << " ticks\n";
  out << "events delayed by more than " << (late.after + 500'000) / 1'000'000
      << " ms (not normal): " << late.count
      << ", deeper than the history: " << figures.rollbacks.beyond_history << '\n';
  if (messages.of_other_masters > 0) {
    out << "another master was on the channel: " << messages.of_other_masters
        << " messages of it were ignored\n";
  }
  if (integration.real_time_losses > 0) {
    out << "real time was lost " << integration.real_time_losses << " times, "
        << nanosecond * static_cast<double>(integration.real_time_lost) << " s in all\n";
  }
}

}  // namespace sprag
