// Predicts the next contact events of a machine from a belief about its state.
//
// The belief has mean m and covariance S S^T of x = (q, u). The exact master (master.h) continues
// from the mean, with events at T_k. Masters from m +- c S_j for each column j, c = 2, give the
// derivatives of the event times:
//
//     tau_kj = (T_k(m + c S_j) - T_k(m - c S_j)) / (2 c),   sigma_k = |tau_k|
//
// This includes the saltation of all impacts, chatters and releases, for any impact law. 32 more
// masters start from corners m + S xi, xi_j = +-c. The list ends before the first event k at which
//
// - one of these masters has another event, or the events in another order;
// - the interval before it is too uncertain: |tau_k - tau_(k-1)| > 1/4 (T_k - T_(k-1));
// - T_k is not linear: at a corner it differs from its linearization by more than sigma_k.
//
// Contacts are counted from 0.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/estimates/belief.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/model.h"
#include "sprag/prediction.h"

namespace sprag {

/// Predicts events of one machine.
class Predictor {
 public:
  /// Throws ModelError if the machine has no exact flow.
  explicit Predictor(Model model) : flows_(std::move(model)) {}

  /// Machine at m + S xi where parameters are uncertain too. xi has one entry for each
  /// column of S.
  using MachineOf = std::function<std::shared_ptr<const Flows>(const Eigen::VectorXd& xi)>;
  /// Predicts the events in (t, t + ahead], ahead > 0 [s], at most 1000, from the belief and the
  /// closed contacts at t >= 0. The list is empty if one of the masters starts inside a support and
  /// does not move out of it. `machine_of` empty: the machine of the constructor. Throws
  /// Interrupted if the stop token of the thread is requested (StopScope).
  Prediction predict(double t, ContactSet closed, const Belief& belief, double ahead,
                     const MachineOf& machine_of = {}) const;

 private:
  Flows flows_;
};

}  // namespace sprag
