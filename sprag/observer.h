// The observer as a library: contact events in, in any order and late; estimates of the full state
// out. One object is what a process `observer` or its --replay is, without LCM and without a clock:
// settled estimates are the same bits.
//
//   sprag::Observer observer(sprag::read_scene("scenes/paper_beam.toml"), {.tick = 0.01});
//   observer.take({0.4565, 0, sprag::ContactEventKind::pulse});
//   observer.set_horizon(1.0);                     // every event up to t = 1 has been taken
//   for (const sprag::Estimate& estimate : observer.settle()) use(estimate.t, estimate.q);
//   sprag::Estimate now = observer.at(1.2);        // provisional: events may still come
//
// An object belongs to one thread at a time; different objects do not share anything. Everything
// allocates: what must not, takes TimeLine (time_line.h) and an estimator. An adaptive observer
// identifies the machine where it settles, so that settle() takes some tenths of a second there.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/estimates/confidence.h"
#include "sprag/detail/events/event_history.h"
#include "sprag/detail/replica/any_replica.h"
#include "sprag/scene.h"

namespace sprag {

/// What an observer says of one tick. f coordinates, m contacts, in the scene's units.
struct Estimate {
  std::int64_t tick = 0;
  double t = 0.0;            ///< tick h [s]
  Eigen::VectorXd q, u;      ///< f entries each
  ContactSet closed = 0;     ///< chi: bit i for contact i, as reported
  bool settled = false;      ///< it never changes: every event up to t was taken
  bool of_filter = false;    ///< q and u are a filter's; else the replica's
  bool penetrating = false;  ///< q lies inside a support, where the machine cannot be
  /// Standard deviations of q, u (f entries each) and of the gaps (m entries); infinite where
  /// nothing is known, empty without a timing filter.
  Eigen::VectorXd sigma_q, sigma_u, sigma_gap;
  /// Of the model's outputs, one each; infinite where nothing is known.
  Eigen::VectorXd outputs, sigma_outputs;
  /// The replica's V is at most this; infinite where nothing guarantees it.
  double bound = std::numeric_limits<double>::infinity();
  /// The same as guaranteed half-widths about q, the gaps and the outputs; infinite where nothing
  /// is guaranteed, empty where the scene allows no bound.
  Eigen::VectorXd bound_q, bound_gap, bound_outputs;
  /// Of an adaptive observer: what it has found of the machine's parameters; else empty.
  ParameterEstimates parameters;
};

struct ObserverSettings {
  double tick = 0.01;  ///< h > 0 [s]
  EstimatorKind estimator = EstimatorKind::both;
  StepperKind stepper = StepperKind::exact;  ///< of EstimatorKind::replica
};

class Observer {
 public:
  /// At tick 0, in scene.replica. Throws ModelError, also where there is no adaptive estimator of
  /// this scene, and std::invalid_argument for a tick that is not > 0, an estimator that has no
  /// such stepper, or a key in scene.adaptation that is none.
  explicit Observer(const Scene& scene, const ObserverSettings& settings = {});
  ~Observer();
  Observer(Observer&&) noexcept;
  Observer& operator=(Observer&&) noexcept;

  /// Takes an event of any time behind the horizon, in any order: estimates are as if it had come
  /// in time. False if it is refused: at or before the horizon, at a time that is no number or
  /// negative, or of a contact that the machine does not have. Events that contradict those before
  /// them (a contact closes that is closed) are skipped where they settle. Both leave the bound
  /// infinite; events() counts them.
  bool take(const ContactEvent& event);

  /// Every event up to t has been taken; never goes back.
  void set_horizon(double t);

  /// No estimate after t will be asked for. The ticks up to t then settle when every event up to t
  /// is known; else, with a tolerance of event times, when every event up to so much later is.
  void set_end(double t);

  /// The estimates of the ticks up to the horizon that were not handed out yet, in order.
  std::vector<Estimate> settle();

  /// The estimate at the last tick at or before t, with all events that have been taken; t is not
  /// before the last settled tick, else it throws std::invalid_argument. It costs the ticks from
  /// the last call, or from the last settled tick where an event came late.
  Estimate at(double t);

  double tick() const;  ///< h [s]
  /// Events taken and skipped, and where they may be missing.
  const EventHistory& events() const;

 private:
  class Core;
  std::unique_ptr<Core> core_;
};

/// Estimates of many ticks, one a row: row k is tick k.
struct Estimates {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::VectorXd t;                 ///< n entries [s]
  Rows q, u;                         ///< n x f
  Rows sigma_q, sigma_u, sigma_gap;  ///< n x f, n x f, n x m; no columns without a timing filter
  Rows outputs, sigma_outputs;       ///< n x the model's outputs
  Eigen::VectorXd bound;             ///< n entries
  Rows bound_q, bound_gap, bound_outputs;  ///< no columns where the scene allows no bound
  std::vector<std::uint8_t> of_filter;     ///< n entries, 0 or 1
  std::vector<std::uint8_t> penetrating;   ///< n entries, 0 or 1
  /// Of an adaptive observer: the parameters that it seeks, P of them, as the scene file names
  /// them, with their values and standard deviations, n x P; infinite until they are found.
  std::vector<std::string> keys;
  Rows parameters, sigma_parameters;
  EventCounts counts;  ///< events taken and skipped
};

/// What an observer says of recorded events, in any order, up to `duration`: as --replay. Throws
/// ModelError, std::invalid_argument, or Interrupted (interrupt.h).
Estimates observe(const Scene& scene, std::span<const ContactEvent> events, double duration,
                  const ObserverSettings& settings = {});

/// The same with an observer that has taken nothing yet.
Estimates observe(Observer observer, std::span<const ContactEvent> events, double duration);

}  // namespace sprag
