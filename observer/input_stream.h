// The streamed excitation of a scene: takes the messages on SPRAG_INPUT into the input of the
// flows, and makes the time line compute again what was estimated without the new samples. After
// the newest sample the input keeps its value, and the standard deviations of estimates grow. Only
// the constructor allocates.
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <memory>
#include <vector>

#include "observer/estimate_sample.h"
#include "sprag/detail/events/contact_message.h"
#include "sprag/detail/events/input_history.h"
#include "sprag/detail/filter/tracking_estimator.h"
#include "sprag/detail/live/time_line.h"
#include "sprag/detail/mechanics/event_gap.h"
#include "sprag/scene.h"

namespace sprag {

/// The scene of an estimator. If its excitation is streamed, `input` is the streamed input.
struct StreamedScene {
  explicit StreamedScene(const Scene& of);

  std::shared_ptr<SampledInput> input;
  Scene scene;
};

class InputStream {
 public:
  /// `flows` are those of all estimators of the time line. All must outlive this.
  InputStream(const StreamedScene& of, Flows& flows, TimeLine& time_line);

  /// Forgets all samples: another session begins. To be called before the time line restarts.
  void restart();

  /// Takes a message of the followed session.
  void take(const InputMessage& message);

  /// Restarts the time line after a contact message if the first known sample is later than the
  /// first tick; returns whether it did. To be called before the time line receives the message.
  bool restarts_after(const ContactMessage& message);

  /// Adds the possible change of the input since the newest sample to the standard deviations: a
  /// constant error of sqrt(2) times the rms of all samples. Without samples they are infinite.
  void widen(EstimateSample& sample) const;

  /// A line about losses and refused messages, if there were any.
  void print(std::ostream& out) const;

  bool started() const { return history_.started(); }
  double newest() const { return history_.newest(); }
  const InputCounts& counts() const { return history_.counts(); }
  /// Intervals whose samples were interpolated, at most 100.
  const std::vector<EventGap>& lost() const { return lost_; }

 private:
  StreamedScene of_;
  Flows& flows_;
  TimeLine& time_line_;
  InputHistory history_;
  Eigen::VectorXd push_;          // |M^-1 w| of the input's force: acceleration by a = 1, f entries
  Eigen::VectorXd push_gaps_;     // of the gaps, m entries
  Eigen::VectorXd push_outputs_;  // of the outputs
  std::vector<EventGap> lost_;
  std::vector<bool> velocities_;  // whether an output is a velocity
  // The first sample is later than the first tick, so that the time line must restart after it. Set
  // by the first message of a session; cleared by restarts_after() and restart().
  bool late_ = false;
};

}  // namespace sprag
