#include "sprag/detail/replica/any_replica.h"

#include <type_traits>

namespace sprag {
namespace {

using Any = std::variant<Replica, MoreauReplica>;

template <typename E>
using StateOf = typename std::remove_cvref_t<E>::State;

Any make(const Scene& scene, double h, StepperKind stepper) {
  if (stepper == StepperKind::moreau) return Any(std::in_place_type<MoreauReplica>, scene, h);
  return Any(std::in_place_type<Replica>, scene, h);
}

// Calls act(estimator, its state) and copies tick and chi to the common state.
template <typename Act>
void change(Any& any, AnyReplica::State& state, const Act& act) {
  std::visit(
      [&](auto& estimator) {
        auto& of = std::get<StateOf<decltype(estimator)>>(state.of);
        act(estimator, of);
        state.tick = of.tick;
        state.chi = of.chi;
      },
      any);
}

template <typename Of, typename Act>
void read(Of& any, const AnyReplica::State& state, const Act& act) {
  std::visit(
      [&](auto& estimator) { act(estimator, std::get<StateOf<decltype(estimator)>>(state.of)); },
      any);
}

}  // namespace

static_assert(Estimator<Replica>);
static_assert(Estimator<MoreauReplica>);
static_assert(Estimator<AnyReplica>);

AnyReplica::AnyReplica(const Scene& scene, double h, StepperKind stepper)
    : h_(h), replica_(make(scene, h, stepper)) {}

void AnyReplica::start(const sprag::State& start, std::int64_t k, ContactSet chi, State& state) {
  std::visit(
      [&](auto& estimator) {
        using Of = StateOf<decltype(estimator)>;
        if (!std::holds_alternative<Of>(state.of)) state.of.emplace<Of>();
      },
      replica_);
  change(replica_, state, [&](auto& replica, auto& of) { replica.start(start, k, chi, of); });
}

void AnyReplica::tick(std::span<const ContactEvent> events, State& state) {
  change(replica_, state, [&](auto& replica, auto& of) { replica.tick(events, of); });
}

std::int64_t AnyReplica::coast(std::int64_t n, State& state) {
  auto* of = std::get_if<Replica>(&replica_);
  if (of == nullptr) return 0;
  auto& moved = std::get<ReplicaState>(state.of);
  const std::int64_t taken = of->coast(n, moved);
  state.tick = moved.tick;
  return taken;
}

void AnyReplica::apply(std::span<const ContactEvent> events, State& state) {
  change(replica_, state, [&](auto& replica, auto& of) { replica.apply(events, of); });
}

void AnyReplica::output(const State& state, Eigen::Ref<Eigen::VectorXd> q,
                        Eigen::Ref<Eigen::VectorXd> u) {
  read(replica_, state, [&](auto& replica, const auto& of) { replica.output(of, q, u); });
}

Confidence AnyReplica::no_confidence() const {
  return std::visit([](const auto& estimator) { return estimator.no_confidence(); }, replica_);
}

void AnyReplica::note(const State& state, Confidence& confidence) const {
  read(replica_, state,
       [&](const auto& estimator, const auto& of) { estimator.note(of, confidence); });
}

bool AnyReplica::record_in(std::vector<ImpactRecord>& records) {
  auto* of = std::get_if<Replica>(&replica_);
  if (of == nullptr) return false;
  recorder_ = std::make_unique<ImpactRecorder>(of->flows().dynamics(), records, 0.0, false);
  of->record_in(recorder_.get());
  return true;
}

void AnyReplica::exact_output(const State& state, Eigen::Ref<Eigen::VectorXd> q,
                              Eigen::Ref<Eigen::VectorXd> u) {
  const Motion& motion = std::get<ReplicaState>(state.of).motion;
  motion.flow->state(motion, q, u);
}

Flows* AnyReplica::flows() {
  return std::visit(
      [](auto& estimator) -> Flows* {
        if constexpr (requires { estimator.flows(); }) {
          return &estimator.flows();
        } else {
          return nullptr;
        }
      },
      replica_);
}

const char* AnyReplica::flow_path() {
  const Flows* of = flows();
  return of == nullptr ? "moreau" : name((*of)[0].path());
}

}  // namespace sprag
