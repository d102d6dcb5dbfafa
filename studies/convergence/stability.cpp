#include "sprag/detail/mechanics/master.h"
#include "studies/convergence/study.h"
#include "studies/work_precision/matching.h"

namespace sprag::studies {
namespace {

using work_precision::Kind;
using work_precision::Method;
using work_precision::Outcome;
using work_precision::ReferenceImpact;
using work_precision::Task;

struct Case {
  int modes;
  double horizon;  // with more modes chaos takes over sooner
};
constexpr Case cases[] = {{3, 10.0}, {10, 4.0}, {20, 1.0}, {40, 1.0}};
constexpr double just_before = 1e-9;

std::vector<ReferenceImpact> impacts_of(const Scene& scene, double horizon) {
  Master master(scene.model, scene.truth.start);
  Master before(scene.model, scene.truth.start);
  std::vector<ContactEvent> events;
  std::vector<ContactEvent> ignored;
  master.advance(at(horizon), events);
  State x = scene.truth.start;
  std::vector<ReferenceImpact> impacts;
  for (const ContactEvent& event : events) {
    if (event.kind == ContactEventKind::opens) continue;
    const double t = event.t - just_before;
    before.advance(at(t), ignored);
    before.state(at(t), x.q, x.u);
    impacts.push_back({event.t, gap_velocity(scene.model.contacts[0], x.u, t)});
  }
  return impacts;
}

const char* verdict(const Outcome& outcome, int missed) {
  if (!outcome.failure.empty()) {
    for (const char* sign : {"unstable", "diverged", "not finite"}) {
      if (outcome.failure.find(sign) != std::string::npos) return "unstable";
    }
    return "stopped";
  }
  return missed == 0 ? "all impacts" : "misses impacts";
}

}  // namespace

void stability(Table& table) {
  for (const auto& [modes, horizon] : cases) {
    const Scene scene = paper_beam(modes);
    const std::vector<ReferenceImpact> reference = impacts_of(scene, horizon);
    const Task task{scene.model, scene.truth.start, horizon, 0.0};
    for (const Method& method : work_precision::methods()) {
      const bool stepping = std::string(method.knob) == "step [s]";
      if (!stepping && method.kind != Kind::ours) continue;
      for (const double step : {1e-2, 1e-3, 1e-4}) {
        Outcome outcome;
        work_precision::prepare(task, outcome);
        method.run(task, stepping ? step : method.settings.front(), outcome);
        const auto score = work_precision::score(reference, outcome.impacts, horizon);
        table.add({method.name, double(modes), step, verdict(outcome, score.missed),
                   double(score.found), double(score.found + score.missed)});
      }
    }
  }
}

}  // namespace sprag::studies
