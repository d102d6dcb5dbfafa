/// \file
/// \brief The observer as a library: takes contact events in any order, returns estimates of the
/// full state.
///
/// An Observer corresponds to the program `observer`, without LCM and without a clock. Its settled
/// estimates equal those of the program bit by bit.
///
///     sprag::Observer observer(sprag::read_scene("scenes/paper_beam.toml"), {.tick = 0.01});
///     observer.take({0.4565, 0, sprag::ContactEventKind::pulse});
///     observer.set_horizon(1.0);             // every event up to t = 1 has been taken
///     for (const sprag::Estimate& estimate : observer.settle()) use(estimate.t, estimate.q);
///     sprag::Estimate now = observer.at(1.2);  // provisional: later events may change it
///
/// Use an object from one thread at a time. Different objects share nothing. All functions allocate
/// memory; a real-time loop uses TimeLine (time_line.h) with an estimator instead. An adaptive
/// observer identifies the machine in settle(), which takes some tenths of a second. Contacts are
/// counted from 0.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "sprag/confidence.h"
#include "sprag/contact_event.h"
#include "sprag/scene.h"

namespace sprag {

/// \brief Estimate of one tick, for f coordinates and m contacts, in the scene's units.
struct Estimate {
  std::int64_t tick = 0;     ///< number k of the tick
  double t = 0.0;            ///< k h [s]
  Eigen::VectorXd q, u;      ///< f entries each
  ContactSet closed = 0;     ///< chi as reported, bit i for contact i (from 0)
  bool settled = false;      ///< final: every event up to t has been taken
  bool of_filter = false;    ///< q and u are the filter's; false: the replica's
  bool penetrating = false;  ///< q lies inside a support, where the machine cannot be
  /// \brief Standard deviations of q, u (f entries each) and of the gaps (m entries). Infinite
  /// where unknown, empty for an estimator without a filter.
  Eigen::VectorXd sigma_q, sigma_u, sigma_gap;
  /// \brief The model's outputs and their standard deviations, one entry each; infinite where
  /// unknown.
  Eigen::VectorXd outputs, sigma_outputs;
  /// \brief Upper bound on the replica's error energy V; infinite where none is guaranteed.
  double bound = std::numeric_limits<double>::infinity();
  /// \brief The bound as half-widths about q, the gaps and the outputs. Infinite where nothing is
  /// guaranteed, empty if the scene admits no bound.
  Eigen::VectorXd bound_q, bound_gap, bound_outputs;
  /// \brief Parameters that an adaptive observer has identified; empty for others.
  ParameterEstimates parameters;
  std::int64_t inconsistencies = 0;  ///< number of events so far that the filter's gate has refused
  Inconsistency last;                ///< the last of them
};

/// \brief Settings of an observer.
struct ObserverSettings {
  double tick = 0.01;                             ///< step h > 0 [s]
  EstimatorKind estimator = EstimatorKind::both;  ///< kind of estimator
};

/// \brief Estimates the state of a machine from its contact events.
class Observer {
 public:
  /// \brief Starts at tick 0 in scene.prior.start.
  /// \param scene machine, start and uncertainties.
  /// \param settings tick and estimator.
  /// \throws ModelError if the machine has no exact flow, or the scene has no adaptive estimator.
  /// \throws std::invalid_argument for a tick that is not > 0, a start without f coordinates and
  /// velocities, or an unknown key in scene.prior.adaptation.
  explicit Observer(const Scene& scene, const ObserverSettings& settings = {});
  ~Observer();
  /// \brief Moves an observer.
  Observer(Observer&&) noexcept;
  /// \brief Moves an observer.
  /// \return this observer.
  Observer& operator=(Observer&&) noexcept;

  /// \brief Takes an event of any time after the horizon, in any order.
  ///
  /// Later estimates do not depend on the order in which events were taken. An event that
  /// contradicts the events before it (it closes a closed contact) is skipped when its time
  /// settles. Without a tolerance the bound is infinite after a refused or skipped event. counts()
  /// counts both.
  /// \param event contact from 0. \return false if the event is refused: its time is
  /// at or before the horizon, negative or not finite, or the machine does not have its contact.
  bool take(const ContactEvent& event);

  /// \brief Sets the horizon (watermark): every event up to t has been taken.
  /// \param t [s]; ignored if not after the present horizon.
  void set_horizon(double t);

  /// \brief Declares that no estimate after t will be requested.
  ///
  /// Without this, and with a tolerance of event times, a tick settles only when the horizon is
  /// later than the tick by that tolerance. The ticks up to t then settle with the horizon at t.
  /// \param t [s].
  void set_end(double t);

  /// \brief Returns the estimates of the ticks that have settled since the last call.
  /// \param stop after a request the function returns what it has computed; the next continues.
  /// \return settled estimates, in order.
  std::vector<Estimate> settle(std::stop_token stop = {});

  /// \brief Provisional estimate from all events taken so far.
  ///
  /// The cost is that of the ticks since the last call, or since the last settled tick after an
  /// event that was older than the last call's estimate.
  /// \param t [s].
  /// \param stop ends the call.
  /// \return the estimate at the last tick at or before t.
  /// \throws std::invalid_argument if t is before the last settled tick or not finite.
  /// \throws Interrupted if `stop` was requested; the observer can be used further.
  Estimate at(double t, std::stop_token stop = {});

  /// \brief Step h.
  /// \return h [s].
  double tick() const;
  /// \brief Events that were taken and skipped.
  /// \return their numbers since the start.
  const EventCounts& counts() const;
  /// \brief Intervals in which events may be missing.
  /// \return the intervals, in order.
  const std::vector<DegradedInterval>& degraded() const;

 private:
  class Core;
  std::unique_ptr<Core> core_;
};

/// \brief Estimates of n ticks, row k for tick k.
struct Estimates {
  /// \brief Matrix stored by rows.
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  Eigen::VectorXd t;                       ///< n entries [s]
  Rows q, u;                               ///< n x f
  Rows sigma_q, sigma_u, sigma_gap;        ///< n x f, n x f, n x m; no columns without a filter
  Rows outputs, sigma_outputs;             ///< n x number of the model's outputs
  Eigen::VectorXd bound;                   ///< n entries
  Rows bound_q, bound_gap, bound_outputs;  ///< no columns if the scene admits no bound
  std::vector<std::uint8_t> of_filter;     ///< n entries, 0 or 1
  std::vector<std::uint8_t> penetrating;   ///< n entries, 0 or 1
  /// \brief Keys of the P parameters that an adaptive observer seeks, as in the scene file.
  std::vector<std::string> keys;
  Rows parameters, sigma_parameters;  ///< n x P; sigma is infinite until a value is found
  EventCounts counts;                 ///< events taken and skipped
  /// \brief Events that the filter's gate has refused, in order of time; of several between two
  /// ticks the last one.
  std::vector<Inconsistency> inconsistencies;
};

/// \brief Settled estimates of a recording, as from `observer --replay`.
/// \param scene machine, start and uncertainties.
/// \param events in any order; contacts from 0.
/// \param duration end of the run, >= 0 [s].
/// \param settings tick and estimator.
/// \param stop token by which another thread or a signal handler cancels the computation.
/// \return estimates at the ticks from 0 to `duration`.
/// \throws ModelError as Observer does.
/// \throws std::invalid_argument as Observer does, also for a negative duration.
/// \throws Interrupted if `stop` was requested.
Estimates observe(const Scene& scene, std::span<const ContactEvent> events, double duration,
                  const ObserverSettings& settings = {}, std::stop_token stop = {});

/// \brief The same with a given observer.
/// \param observer observer that has taken no event yet.
/// \param events in any order; contacts from 0.
/// \param duration end of the run, >= 0 [s].
/// \param stop token by which another thread or a signal handler cancels the computation.
/// \return estimates at the ticks from 0 to `duration`.
/// \throws std::invalid_argument for a negative duration.
/// \throws Interrupted if `stop` was requested.
Estimates observe(Observer observer, std::span<const ContactEvent> events, double duration,
                  std::stop_token stop = {});

}  // namespace sprag
