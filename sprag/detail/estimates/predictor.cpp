#include "sprag/detail/estimates/predictor.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <span>

#include "sprag/detail/mechanics/instant.h"
#include "sprag/detail/mechanics/master.h"

namespace sprag {
namespace {

constexpr double spread_of_points = 2.0;      // c
constexpr double certain_share = 0.25;        // largest sigma of an interval, as a share of it
constexpr std::size_t most_predicted = 1000;  // events
constexpr double look_beyond =
    2.0;  // in times ahead, for events that are later than those of the mean
constexpr double rounding_of_time = 32.0 * std::numeric_limits<double>::epsilon();
constexpr int corners = 32;
constexpr double most_bent = 0.5;    // share of a corner's deviation that may be nonlinear
constexpr double inside_by = 1e-12;  // share of a gap's terms that is rounding

// Contacts just inside their supports and moving out, as after their last event. `inside`: another
// contact is inside and not moving out.
ContactSet surfacing(const Model& model, const State& start, double t, ContactSet closed,
                     bool& inside) {
  ContactSet leaving = 0;
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const Contact& contact = model.contacts[i];
    if (contains(closed, static_cast<int>(i))) continue;
    if (!(gap(contact, start.q, t) < -inside_by * gap_scale(contact, start.q))) continue;
    if (gap_velocity(contact, start.u, t) > 0.0) {
      leaving |= bit(static_cast<int>(i));
    } else {
      inside = true;
    }
  }
  return leaving;
}

// Events of a master from this state, at most `count` and up to `end`. Empty if it starts inside a
// support or cannot continue.
std::optional<std::vector<ContactEvent>> events_from(const Flows& flows, const State& start,
                                                     double t, ContactSet closed, double end,
                                                     std::size_t count) {
  bool inside = false;
  const ContactSet leaving = surfacing(flows.dynamics().model(), start, t, closed, inside);
  if (inside) return std::nullopt;
  const auto reported_first =
      static_cast<std::size_t>(std::popcount(closed) + 2 * std::popcount(leaving));
  std::vector<ContactEvent> events;
  try {
    Master master(flows, start, t, closed);
    master.advance(at(end), events, count + reported_first);
  } catch (const SimulationError&) {
    return std::nullopt;
  } catch (const ModelError&) {
    return std::nullopt;
  }
  // The master reports closed contacts again at t, and for surfacing contacts a closing and an
  // opening.
  ContactSet once = closed | leaving, then = leaving;
  std::vector<ContactEvent> ahead;
  for (const ContactEvent& event : events) {
    if (event.kind == ContactEventKind::closes && event.t == t && contains(once, event.contact)) {
      once &= ~bit(event.contact);
    } else if (event.kind == ContactEventKind::opens && contains(then, event.contact)) {
      then &= ~bit(event.contact);
    } else if (once != 0 || then != 0) {
      return std::nullopt;  // another event comes first
    } else if (ahead.size() < count) {
      ahead.push_back(event);
    }
  }
  return ahead;
}

bool same_event(const ContactEvent& a, const ContactEvent& b) {
  return a.contact == b.contact && a.kind == b.kind;
}

}  // namespace

Prediction Predictor::predict(double t, ContactSet closed, const Belief& belief, double ahead,
                              const MachineOf& machine_of) const {
  Prediction prediction{t, t, {}};
  const double end = t + ahead;
  std::shared_ptr<const Flows> changed;
  const auto machine = [&](const Eigen::VectorXd& xi) -> const Flows& {
    if (!machine_of) return flows_;
    changed = machine_of(xi);
    return *changed;
  };
  const Eigen::VectorXd center = Eigen::VectorXd::Zero(belief.columns);
  const auto mean =
      events_from(machine(center), {belief.q, belief.u}, t, closed, end, most_predicted);
  if (!mean) return prediction;
  std::size_t count = mean->size();

  const Eigen::Index columns = belief.columns;
  const auto S_q = belief.S_q.leftCols(columns);
  const auto S_u = belief.S_u.leftCols(columns);
  const auto size = static_cast<Eigen::Index>(count);
  Eigen::MatrixXd tau = Eigen::MatrixXd::Zero(size, columns);
  Eigen::VectorXd sigma(size);
  bool nothing_else = true;
  // Shortens the list to the events that another master has as well. fits(k, delay) is called for
  // each; false ends the list before it.
  const auto compare = [&](const Eigen::VectorXd& xi, const auto& fits) {
    // One more event shows whether another event comes within the time ahead.
    const auto other = events_from(machine(xi), {belief.q + S_q * xi, belief.u + S_u * xi}, t,
                                   closed, t + look_beyond * ahead, count + 1);
    std::size_t agreed = 0;
    while (other && agreed < std::min(count, other->size()) &&
           same_event((*other)[agreed], (*mean)[agreed]) &&
           fits(static_cast<Eigen::Index>(agreed), (*other)[agreed].t - (*mean)[agreed].t)) {
      ++agreed;
    }
    if (!other || (agreed < other->size() && (*other)[agreed].t <= end)) nothing_else = false;
    count = agreed;
  };
  Eigen::VectorXd xi = Eigen::VectorXd::Zero(columns);
  for (Eigen::Index j = 0; j < columns; ++j) {
    if (!machine_of && S_q.col(j).isZero(0.0) && S_u.col(j).isZero(0.0)) continue;
    for (const double side : {spread_of_points, -spread_of_points}) {
      xi[j] = side;
      compare(xi, [&](Eigen::Index k, double off) {
        tau(k, j) += off / (2.0 * side);
        return true;
      });
    }
    xi[j] = 0.0;
  }
  for (Eigen::Index k = 0; k < size; ++k) {
    sigma[k] =
        std::hypot(tau.row(k).norm(), rounding_of_time * (*mean)[static_cast<std::size_t>(k)].t);
  }
  std::mt19937_64 engine(1);
  for (int corner = 0; corner < corners && (count > 0 || nothing_else); ++corner) {
    for (double& x : xi) x = (engine() >> 63U) != 0 ? spread_of_points : -spread_of_points;
    compare(xi, [&](Eigen::Index k, double off) {
      return std::abs(off - tau.row(k).dot(xi)) <= most_bent * spread_of_points * sigma[k];
    });
  }

  for (std::size_t i = 0; i < count; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    const ContactEvent& event = (*mean)[i];
    const double rounding = rounding_of_time * event.t;
    const double interval = event.t - (i == 0 ? t : (*mean)[i - 1].t);
    const double of_interval = i == 0 ? tau.row(k).norm() : (tau.row(k) - tau.row(k - 1)).norm();
    if (of_interval > certain_share * interval + rounding) return prediction;
    prediction.events.push_back({event.t, event.contact, event.kind, sigma[k]});
    prediction.certain_until = event.t;
  }
  if (nothing_else && count == mean->size() && count < most_predicted) {
    prediction.certain_until = end;
  }
  return prediction;
}

}  // namespace sprag
