// Prediction: the contact events that a machine is about to have, from what is known of its state x
// = (q, u) now, mean m and covariance S S^T.
//
// The mean goes on as the exact master (master.h). How its event times T_k move with the state is
// found by masters that start from m +- c S_j for every column j, c = 2:
//
//   tau_kj = (T_k(m + c S_j) - T_k(m - c S_j)) / (2 c),   sigma_k = |tau_k|,
//
// which is saltation through all impacts, chatters and releases, and in no need of the law by which
// they happen. A list goes on as long as all of these masters have the same events in the same
// order, and masters that start from 32 corners m + S xi, xi_j = +-c, as well. It ends before the
// first event where they have not, where the interval from the one before is known to no better
// than a share, |tau_k - tau_(k-1)| > 1/4 (T_k - T_(k-1)), or where T_k is not linear: where a
// corner's is off what tau says by more than sigma_k.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/model.h"

namespace sprag {

struct PredictedEvent {
  double t = 0.0;                                   ///< [s]
  int contact = 0;                                  ///< from 0
  ContactEventKind kind = ContactEventKind::pulse;  ///< closes: it comes to rest
  double sigma = 0.0;                               ///< of t [s]
};

struct Prediction {
  double made_at = 0.0;        ///< [s]
  double certain_until = 0.0;  ///< no other event is foreseen up to here [s]
  std::vector<PredictedEvent> events;
};

class Predictor {
 public:
  /// Throws ModelError.
  explicit Predictor(Model model) : flows_(std::move(model)) {}

  /// The events after t >= 0 and up to t + ahead [s], `ahead` > 0, at most 1000; `closed` are the
  /// contacts that are closed at t. None where the machine may be in its supports. Throws
  /// Interrupted (interrupt.h).
  Prediction predict(double t, ContactSet closed, const Belief& belief, double ahead) const {
    return predict(t, closed, belief, ahead, {});
  }

  /// The machine that goes with m + S xi, where parameters are uncertain too: xi has an entry for
  /// each column of S.
  using MachineOf = std::function<std::shared_ptr<const Flows>(const Eigen::VectorXd& xi)>;
  /// The same with machines that xi changes.
  Prediction predict(double t, ContactSet closed, const Belief& belief, double ahead,
                     const MachineOf& machine_of) const;

 private:
  Flows flows_;
};

}  // namespace sprag
