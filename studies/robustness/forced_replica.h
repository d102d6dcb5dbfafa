// A replica that does what the machine does instead of what a clutch does, for comparison: at each
// impact u+ = u- - (1 + epsilon) M^-1 w G^-1 gamma-, epsilon = 0 where the contact closes to stay,
// whatever the sign of gamma-; a closed contact holds the gap at which it closed, whatever the sign
// of its force. One contact.
#pragma once

#include <cstdint>
#include <span>

#include "sprag/mechanics/contact_event.h"
#include "sprag/mechanics/flow.h"
#include "sprag/mechanics/flows.h"

namespace sprag::robustness {

class ForcedReplica {
 public:
  struct State {
    std::int64_t tick = 0;
    Motion motion;
  };

  /// Tick h > 0. Throws ModelError.
  ForcedReplica(Model model, double h) : flows_(std::move(model)), h_(h) {}

  /// As Replica's.
  void start(const sprag::State& start, std::int64_t k, ContactSet chi, State& state);
  void tick(std::span<const ContactEvent> events, State& state);
  void output(const State& state, Eigen::Ref<Eigen::VectorXd> q,
              Eigen::Ref<Eigen::VectorXd> u) const;

  double h() const { return h_; }

 private:
  void enter(const sprag::State& x, ContactSet locked, Instant t, State& state);

  Flows flows_;
  double h_;
};

}  // namespace sprag::robustness
