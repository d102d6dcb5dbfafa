#include "tools/diagnose/prediction.h"

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "sprag/mechanics/interrupt.h"
#include "tools/diagnose/linear_filter.h"

namespace sprag {
namespace {

// Below this share of its usual value a velocity of closing is not known well enough for J.
constexpr double slow = 1e-3;

struct Closing {
  double square, variance, gamma;
};

bool closes(std::span<const ContactEvent> events) {
  for (const ContactEvent& event : events) {
    if (event.kind != ContactEventKind::opens) return true;
  }
  return false;
}

void follow(const Scene& scene, const Model& model, double jitter,
            std::span<const ContactEvent> events, bool with_inside, const Beginning& beginning,
            Prediction& prediction) {
  Uncertainty uncertainty = uncertainty_of(scene);
  uncertainty.jitter = jitter;
  LinearFilter filter(model, std::move(uncertainty), scene.replica, at(beginning.t),
                      beginning.closed);
  std::vector<Closing> closings;
  double flights = 0.0;
  int to_start = closings_to_start(scene);
  for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
    check_interrupt();
    const double last = filter.expected().t;
    filter.follow(of_one);
    const ExpectedClosing& expected = filter.expected();
    if (expected.t == last || !(expected.deviation > 0.0)) return;
    if (to_start-- > 0) return;
    const double variance = expected.deviation * expected.deviation;
    closings.push_back(
        {expected.gap * expected.gap / variance, variance, expected.gamma * expected.gamma});
    if (!with_inside) return;
    const double flight = expected.t - last;
    flights += flight;
    prediction.inside += flight * filter.inside(expected.contact);
  });
  prediction.length = filter.length();
  prediction.unsure = filter.ambiguous_impacts() + filter.refused_impacts();
  prediction.count = static_cast<int>(closings.size());
  if (closings.empty()) return;
  double gamma = 0.0;
  for (const Closing& closing : closings) gamma += closing.gamma;
  const double n = prediction.count;
  const double slowest = slow * slow * gamma / n;
  prediction.J = 0.0;
  for (const Closing& closing : closings) {
    prediction.misfit += closing.square / n;
    prediction.J += closing.square + std::log(closing.variance / (closing.gamma + slowest));
  }
  if (flights > 0.0) prediction.inside /= flights;
  if (!std::isfinite(prediction.J)) prediction.J = std::numeric_limits<double>::infinity();
}

}  // namespace

int closings_to_start(const Scene& scene) {
  return 2 * static_cast<int>(scene.model.coordinates());
}

int closings_of(std::span<const ContactEvent> events) {
  int count = 0;
  for_each_instant(events, [&](auto of_one) { count += closes(of_one) ? 1 : 0; });
  return count;
}

Prediction predict(const Scene& scene, const Model& model, double jitter,
                   std::span<const ContactEvent> events, bool with_inside,
                   const Beginning& beginning) {
  Prediction prediction;
  prediction.J = prediction.misfit = std::numeric_limits<double>::infinity();
  try {
    prediction.misfit = 0.0;
    follow(scene, model, jitter, events, with_inside, beginning, prediction);
  } catch (const ModelError&) {  // defective modes, for one
  }
  if (!std::isfinite(prediction.J)) prediction.misfit = prediction.J;
  return prediction;
}

}  // namespace sprag
