// The replica with exact flow or with Moreau's time stepping, chosen when the program runs; itself
// an Estimator (estimator.h).
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

enum class StepperKind { exact, moreau };

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
  /// The same; `visit(of_one_instant)` is called behind the events of each instant. What output()
  /// says then is of that instant with exact flow, of the tick with Moreau's stepper.
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
  /// As Replica's; 0 with Moreau's stepper, which has no ticks of which nothing is new.
  std::int64_t coast(std::int64_t n, State& state);
  bool coasts() const { return is_exact(); }
  void apply(std::span<const ContactEvent> events, State& state);
  void output(const State& state, Eigen::Ref<Eigen::VectorXd> q, Eigen::Ref<Eigen::VectorXd> u);
  Confidence no_confidence() const;
  void note(const State& state, Confidence& confidence) const;
  void confidence(const State& state, double initial, Confidence& confidence);
  double h() const { return h_; }

  /// Appends what it says of each event from now on to `records`, which must outlive this. For a
  /// replica of which one state alone is moved, and never back. Allocates then. False with Moreau's
  /// stepper, which knows no events' own times.
  bool record_in(std::vector<ImpactRecord>& records);

  /// output() of a replica with exact flow.
  static void exact_output(const State& state, Eigen::Ref<Eigen::VectorXd> q,
                           Eigen::Ref<Eigen::VectorXd> u);
  bool is_exact() const { return std::holds_alternative<Replica>(replica_); }
  /// What it moves on; null with Moreau's stepper, which needs none.
  Flows* flows();
  /// How it moves in free flight: the path of its exact flow, or "moreau".
  const char* flow_path();

 private:
  double h_;
  std::variant<Replica, MoreauReplica> replica_;
  std::unique_ptr<ImpactRecorder> recorder_;
};

}  // namespace sprag
