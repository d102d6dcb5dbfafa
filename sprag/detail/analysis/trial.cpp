#include "sprag/detail/analysis/trial.h"

#include <algorithm>
#include <cmath>

#include "sprag/detail/mechanics/master.h"

namespace sprag {
namespace {

constexpr int samples = 2000;
constexpr std::size_t events_between_looks = 1000;  // between checks of the limits

struct Sample {
  double t, speed, distance;
};

// Length of the part of [from, to] after `begin`.
double after(double begin, double from, double to) {
  return std::max(to - std::max(from, begin), 0.0);
}

void summarize(const std::vector<ContactEvent>& events, Trial& trial) {
  const double last_quarter = 0.75 * trial.duration;
  std::vector<double> closed_since(trial.contacts.size(), -1.0);
  const auto add = [&](std::size_t i, double until) {
    ContactUse& use = trial.contacts[i];
    use.share += after(0.0, closed_since[i], until);
    use.last_share += after(last_quarter, closed_since[i], until);
    closed_since[i] = -1.0;
  };
  for (const ContactEvent& event : events) {
    if (event.t > trial.duration) break;
    const auto i = static_cast<std::size_t>(event.contact);
    if (event.kind != ContactEventKind::opens) ++trial.contacts[i].closings;
    if (event.kind == ContactEventKind::closes) {
      closed_since[i] = event.t;
    } else if (closed_since[i] >= 0.0) {
      add(i, event.t);
    }
  }
  for (std::size_t i = 0; i < trial.contacts.size(); ++i) {
    if (closed_since[i] >= 0.0) add(i, trial.duration);
    ContactUse& use = trial.contacts[i];
    trial.closings += use.closings;
    if (!(trial.duration > 0.0)) continue;
    use.share /= trial.duration;
    // The same difference as in add(), so that the share is exactly 1 for a contact that is always
    // closed.
    use.last_share /= trial.duration - last_quarter;
  }
}

// Intervals of the last quarter in which all contacts are open.
void measure_open_windows(const std::vector<ContactEvent>& events, Trial& trial) {
  const double last_quarter = 0.75 * trial.duration;
  ContactSet closed = 0;
  double since = 0.0;  // time at which the last contact opened, or the start
  double sum = 0.0;
  const auto add = [&](double until) {
    const double window = after(last_quarter, since, until);
    trial.longest_open = std::max(trial.longest_open, window);
    sum += window;
  };
  for (const ContactEvent& event : events) {
    const ContactSet now = sprag::after(closed, event);
    if (closed == 0 && now != 0) add(event.t);
    if (closed != 0 && now == 0) since = event.t;
    closed = now;
  }
  if (closed == 0) add(trial.duration);
  if (trial.duration > 0.0) trial.open_share = sum / (trial.duration - last_quarter);
}

double growth(const std::vector<Sample>& run, double duration) {
  const auto largest = [&](double Sample::*what, double from, double to) {
    double value = 0.0;
    for (const Sample& sample : run) {
      if (sample.t >= from * duration && sample.t <= to * duration) {
        value = std::max(value, sample.*what);
      }
    }
    return value;
  };
  double result = 0.0;
  for (double Sample::*what : {&Sample::speed, &Sample::distance}) {
    const double before = largest(what, 0.25, 0.5);
    const double now = largest(what, 0.75, 1.0);
    // A motion that has come to rest does not grow.
    if (now > 1e-9 * largest(what, 0.0, 1.0)) result = std::max(result, now / before);
  }
  return result;
}

}  // namespace

Trial run_trial(const Scene& scene, double duration, const TrialLimits& limits) {
  Trial trial;
  trial.planned = duration;
  trial.contacts.resize(scene.model.contacts.size());
  const State& start = scene.truth.given ? scene.truth.start : scene.prior.start;
  Master master(scene.model, start);

  std::vector<ContactEvent>& events = trial.events;
  const auto stopped = [&] {
    return static_cast<long>(events.size()) >= limits.events ||
           (limits.out_of_time && limits.out_of_time());
  };
  std::vector<Sample> run;
  Eigen::VectorXd q = start.q;
  Eigen::VectorXd u = start.u;
  const Eigen::MatrixXd& M = scene.model.M;
  try {
    for (int k = 0; k <= samples && !stopped(); ++k) {
      const double t = k == samples ? duration : duration * k / samples;
      bool arrived = false;
      while (!arrived && !stopped()) {
        arrived = master.advance(at(t), events, events_between_looks);
      }
      if (!arrived) {
        if (!events.empty()) trial.duration = std::max(trial.duration, events.back().t);
        break;
      }
      trial.duration = t;
      master.state(at(t), q, u);
      run.push_back({t, std::sqrt(u.dot(M * u)), std::sqrt(q.dot(M * q))});
    }
  } catch (const SimulationError& error) {
    trial.error = error.what();
  } catch (const ModelError& error) {
    trial.error = error.what();  // no flow for a locked set; that of free flight exists
  }
  std::erase_if(events, [&](const ContactEvent& event) { return event.t > trial.duration; });
  summarize(events, trial);
  measure_open_windows(events, trial);
  trial.growth = growth(run, trial.duration);
  return trial;
}

}  // namespace sprag
