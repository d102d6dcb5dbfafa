#include "sprag/estimation/estimators.h"

#include <limits>
#include <type_traits>

namespace sprag {
namespace {

using Any = std::variant<Replica, MoreauReplica, TimingFilter, SupervisedFilter>;

template <typename E>
using StateOf = typename std::remove_cvref_t<E>::State;

Any make(const Scene& scene, double h, EstimatorKind kind, StepperKind stepper) {
  switch (kind) {
    case EstimatorKind::timing:
      return Any(std::in_place_type<TimingFilter>, scene, h);
    case EstimatorKind::both:
      return Any(std::in_place_type<SupervisedFilter>, scene, h);
    default:
      if (stepper == StepperKind::moreau) {
        return Any(std::in_place_type<MoreauReplica>, scene, h);
      }
      return Any(std::in_place_type<Replica>, scene, h);
  }
}

// act(estimator, its state), and what all states have in common is kept up.
template <typename Act>
void change(Any& any, AnyEstimator::State& state, const Act& act) {
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
void read(Of& any, const AnyEstimator::State& state, const Act& act) {
  std::visit(
      [&](auto& estimator) { act(estimator, std::get<StateOf<decltype(estimator)>>(state.of)); },
      any);
}

}  // namespace

static_assert(Estimator<Replica>);
static_assert(Estimator<MoreauReplica>);
static_assert(Estimator<TimingFilter>);
static_assert(Estimator<SupervisedFilter>);
static_assert(Estimator<AnyEstimator>);

AnyEstimator::AnyEstimator(const Scene& scene, double h, EstimatorKind kind, StepperKind stepper)
    : h_(h), estimator_(make(scene, h, kind, stepper)) {}

void AnyEstimator::start(const sprag::State& start, std::int64_t k, ContactSet chi, State& state) {
  std::visit(
      [&](auto& estimator) {
        using Of = StateOf<decltype(estimator)>;
        if (!std::holds_alternative<Of>(state.of)) state.of.emplace<Of>();
      },
      estimator_);
  change(estimator_, state, [&](auto& estimator, auto& of) { estimator.start(start, k, chi, of); });
}

void AnyEstimator::tick(std::span<const ContactEvent> events, State& state) {
  change(estimator_, state, [&](auto& estimator, auto& of) { estimator.tick(events, of); });
}

std::int64_t AnyEstimator::coast(std::int64_t n, State& state) {
  auto* of = std::get_if<Replica>(&estimator_);
  if (of == nullptr) return 0;
  auto& moved = std::get<ReplicaState>(state.of);
  const std::int64_t taken = of->coast(n, moved);
  state.tick = moved.tick;
  return taken;
}

void AnyEstimator::apply(std::span<const ContactEvent> events, State& state) {
  change(estimator_, state, [&](auto& estimator, auto& of) { estimator.apply(events, of); });
}

void AnyEstimator::output(const State& state, Eigen::Ref<Eigen::VectorXd> q,
                          Eigen::Ref<Eigen::VectorXd> u) {
  read(estimator_, state, [&](auto& estimator, const auto& of) { estimator.output(of, q, u); });
}

Confidence AnyEstimator::no_confidence() const {
  return std::visit([](const auto& estimator) { return estimator.no_confidence(); }, estimator_);
}

void AnyEstimator::note(const State& state, Confidence& confidence) const {
  read(estimator_, state,
       [&](const auto& estimator, const auto& of) { estimator.note(of, confidence); });
}

void AnyEstimator::confidence(const State& state, double initial, Confidence& confidence) {
  read(estimator_, state,
       [&](auto& estimator, const auto& of) { estimator.confidence(of, initial, confidence); });
}

bool AnyEstimator::belief(const State& state, double ahead, Belief& belief) {
  if (auto* of = std::get_if<TimingFilter>(&estimator_)) {
    return of->belief(std::get<TimingState>(state.of), ahead, belief);
  }
  if (auto* of = std::get_if<SupervisedFilter>(&estimator_)) {
    const auto& supervised = std::get<SupervisedState>(state.of);
    return supervised.trusted && of->filter().belief(supervised.filter, ahead, belief);
  }
  return false;
}

bool AnyEstimator::record_in(std::vector<ImpactRecord>& records) {
  if (auto* of = std::get_if<SupervisedFilter>(&estimator_)) {
    of->record_in(records);
    return true;
  }
  if (auto* of = std::get_if<TimingFilter>(&estimator_)) {
    recorder_ = std::make_unique<ImpactRecorder>(of->flows().dynamics(), records, of->jitter(),
                                                 !of->scale_is_open());
    of->record_in(recorder_.get());
    return true;
  }
  if (auto* of = std::get_if<Replica>(&estimator_)) {
    recorder_ = std::make_unique<ImpactRecorder>(of->flows().dynamics(), records, 0.0, false);
    of->record_in(recorder_.get());
    return true;
  }
  return false;
}

bool AnyEstimator::has_replica() const {
  return std::holds_alternative<Replica>(estimator_) ||
         std::holds_alternative<SupervisedFilter>(estimator_);
}

void AnyEstimator::replica(const State& state, Eigen::Ref<Eigen::VectorXd> q,
                           Eigen::Ref<Eigen::VectorXd> u) const {
  const auto* supervised = std::get_if<SupervisedState>(&state.of);
  const ReplicaState& of = supervised != nullptr ? *supervised : std::get<ReplicaState>(state.of);
  of.motion.flow->state(of.motion, q, u);
}

Flows* AnyEstimator::flows() {
  return std::visit(
      [](auto& estimator) -> Flows* {
        if constexpr (requires { estimator.flows(); }) {
          return &estimator.flows();
        } else {
          return nullptr;
        }
      },
      estimator_);
}

const char* AnyEstimator::flow_path() {
  const Flows* of = flows();
  return of == nullptr ? "moreau" : name((*of)[0].path());
}

double initial_bound(const Scene& scene) {
  const bool exact = scene.tolerance.any() ||
                     (scene.jitter == 0.0 && scene.drift == 0.0 && scene.parameters.empty());
  return scene.uncertainty.size() > 0 && exact ? scene.uncertainty.sum()
                                               : std::numeric_limits<double>::infinity();
}

}  // namespace sprag
