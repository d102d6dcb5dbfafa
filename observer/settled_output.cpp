#include "observer/settled_output.h"

#include <iostream>
#include <nlohmann/json.hpp>

#include "observer/report.h"
#include "sprag/detail/files/confidence_columns.h"

namespace sprag {

SettledOutput::SettledOutput(const std::filesystem::path& states, const EstimateSample& empty,
                             double initial, std::vector<Output> outputs)
    : initial_bound_(initial), outputs_(std::move(outputs)) {
  if (states.empty()) return;
  std::vector<std::string> columns = confidence_columns(empty.confidence, initial);
  bounded_ = empty.confidence.bound_q.size() > 0;
  says_penetrating_ = !columns.empty();
  for (std::string& name : output_columns(outputs_, true, bounded_))
    columns.push_back(std::move(name));
  if (says_penetrating_) columns.emplace_back("penetrating");
  states_.emplace(states, empty.q.size(), columns);
  states_->require_good();
}

void SettledOutput::note(const EstimateSample& settled) {
  record_.note(settled.t, settled.confidence, std::cerr);
}

void SettledOutput::pass(std::int64_t ticks, double t) { record_.pass(ticks, t); }

void SettledOutput::conclude(const EstimateSample& settled) {
  record_.conclude(settled.confidence, initial_bound_);
}

void SettledOutput::take(const EstimateSample& settled) {
  note(settled);
  conclude(settled);
  record_.take_penetration(settled.confidence.penetration);
  if (!states_) return;
  to_columns(settled.confidence, initial_bound_, columns_);
  add_outputs(outputs_, settled.q, settled.u, settled.confidence.sigma_outputs, columns_,
              bounded_ ? &settled.confidence.bound_outputs : nullptr);
  if (says_penetrating_) columns_.push_back(settled.confidence.penetration > 0.0 ? 1.0 : 0.0);
  states_->write(settled.tick, settled.t, settled.q, settled.u, columns_);
}

void SettledOutput::flush() {
  if (states_) states_->flush();
}

void SettledOutput::sum_up(const EventHistory& events, bool verbose,
                           nlohmann::ordered_json& report) const {
  for (const DegradedInterval& gap : events.degraded()) {
    std::cerr << "events may be missing between t = " << gap.from << " and " << gap.to << '\n';
  }
  record_.to_json(report);
  report.update(to_json(events));
  record_.print(verbose, std::cerr);
}

void SettledOutput::close() {
  if (states_) states_->finish();
}

}  // namespace sprag
