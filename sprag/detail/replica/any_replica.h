// Replica with exact flow or with Moreau's time stepping, selected at run time. Satisfies Estimator
// (estimator.h).
#pragma once

#include <cstdint>
#include <memory>
#include <variant>
#include <vector>

#include "sprag/detail/estimates/estimator.h"
#include "sprag/detail/replica/moreau.h"
#include "sprag/replica.h"
#include "sprag/scene.h"

namespace sprag {

class AnyReplica {
 public:
  struct State {
    std::int64_t tick = 0;
    ContactSet chi = 0;
    std::variant<ReplicaState, MoreauState> of;
  };

  /// Tick h > 0 [s]. Throws ModelError.
  AnyReplica(const Scene& scene, double h, StepperKind stepper = StepperKind::exact);

  void start(const sprag::State& start, std::int64_t k, ContactSet chi, State& state);
  void tick(std::span<const ContactEvent> events, State& state);
  /// The same, and calls visit(of_one_instant) after the events of each instant. In visit()
  /// output() is the estimate at that instant with exact flow, at the tick with Moreau's stepper.
  template <typename Visit>
  void tick(std::span<const ContactEvent> events, State& state, Visit visit) {
    auto* replica = std::get_if<Replica>(&replica_);
    if (replica == nullptr || events.empty()) {
      tick(events, state);
      for_each_instant(events, visit);
      return;
    }
    auto& of = std::get<ReplicaState>(state.of);
    replica->open_tick(of);
    for_each_instant(events, [&](std::span<const ContactEvent> of_one) {
      replica->take(of_one, of);
      visit(of_one);
    });
    replica->close_tick(of);
    state.tick = of.tick;
    state.chi = of.chi;
  }
  /// As Replica::coast(); returns 0 with Moreau's stepper.
  std::int64_t coast(std::int64_t n, State& state);
  bool coasts() const { return is_exact(); }
  void apply(std::span<const ContactEvent> events, State& state);
  void output(const State& state, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u);
  Confidence no_confidence() const;
  void note(const State& state, Confidence& confidence) const;
  double h() const { return h_; }

  /// Appends a record of each event from now on to `records`, which must outlive this. Only one
  /// state may be moved then, and never back; moving it allocates. Returns false with Moreau's
  /// stepper, which has no states at event times.
  bool record_in(std::vector<ImpactRecord>& records);

  /// output() of a state with exact flow, also between ticks.
  static void exact_output(const State& state, Eigen::Ref<Eigen::VectorXd> q,
                           Eigen::Ref<Eigen::VectorXd> u);
  bool is_exact() const { return std::holds_alternative<Replica>(replica_); }
  /// Flows of the replica; null with Moreau's stepper.
  Flows* flows();
  /// Kind of free flight: the path of the exact flow, or "moreau".
  const char* flow_path();

 private:
  double h_;
  std::variant<Replica, MoreauReplica> replica_;
  std::unique_ptr<ImpactRecorder> recorder_;
};

}  // namespace sprag
