// Drives Siconos' C++ kernel (INRIA, 4.4.0): its time-stepping schemes of Moreau-Jean and of
// Bilbao, and its event-driven scheme on ODEPACK's LSODAR. Contacts are LagrangianLinearTIR with
// NewtonImpactNSL: with at most one closed contact this is Poisson's law as well. Moreau-Jean and
// the event-driven scheme run in coordinates in which the supports rest, because the latter refuses
// moving supports in sustained contact. Bilbao's scheme has no forces. The machine's forced motion
// is subtracted from q and represented, with the supports, by free oscillators that are too heavy
// to be moved.
#include <dlfcn.h>

#include <algorithm>
#include <boost/exception/get_error_info.hpp>
#include <boost/numeric/ublas/storage.hpp>
#include <cmath>
#include <complex>
#include <cstdint>
#include <iostream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

class NonSmoothLaw;

// Siconos' headers instantiate this constructor. Boost implements it with
// std::allocator::construct, which C++20 has removed.
template <>
inline boost::numeric::ublas::unbounded_array<std::shared_ptr<NonSmoothLaw>>::unbounded_array(
    size_type size, const std::allocator<std::shared_ptr<NonSmoothLaw>>& allocator)
    : alloc_(allocator), size_(size), data_(size != 0 ? alloc_.allocate(size) : nullptr) {
  std::uninitialized_value_construct_n(data_, size_);
}

#include <SiconosKernel.hpp>

#include "studies/peers/peers.h"
#include "studies/peers/resting_supports.h"
#include "studies/work_precision/machine.h"

extern "C" void xsetf_(int* flag);  // ODEPACK: 0 switches messages off

namespace sprag::work_precision {
namespace {

/// Suppresses the libraries' output to std::cout, and OpenBLAS's threads.
class Quiet {
 public:
  Quiet() : cout_(std::cout.rdbuf(nullptr)) {
    int off = 0;
    xsetf_(&off);
    using SetThreads = void (*)(int);
    // OpenBLAS reads its environment variable when the library is loaded: too late here.
    if (void* set = dlsym(RTLD_DEFAULT, "openblas_set_num_threads")) {
      reinterpret_cast<SetThreads>(set)(1);
    }
  }
  ~Quiet() {
    std::cout.rdbuf(cout_);
    std::cout.clear();
  }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  std::streambuf* cout_;
};

std::shared_ptr<SiconosVector> vector(const Eigen::VectorXd& from) {
  auto to = std::make_shared<SiconosVector>(static_cast<unsigned>(from.size()));
  for (Eigen::Index i = 0; i < from.size(); ++i) (*to)(static_cast<unsigned>(i)) = from[i];
  return to;
}

std::shared_ptr<SimpleMatrix> matrix(const Eigen::MatrixXd& from) {
  auto to = std::make_shared<SimpleMatrix>(static_cast<unsigned>(from.rows()),
                                           static_cast<unsigned>(from.cols()));
  for (Eigen::Index i = 0; i < from.rows(); ++i) {
    for (Eigen::Index j = 0; j < from.cols(); ++j) {
      to->setValue(static_cast<unsigned>(i), static_cast<unsigned>(j), from(i, j));
    }
  }
  return to;
}

void copy(const SiconosVector& from, Eigen::Ref<Eigen::VectorXd> to) {
  for (Eigen::Index i = 0; i < to.size(); ++i) to[i] = from(static_cast<unsigned>(i));
}

/// A linear machine with f(t), in coordinates in which its supports rest.
class ForcedMachine : public LagrangianLinearTIDS {
 public:
  ForcedMachine(const Model& model, const State& start)
      : LagrangianLinearTIDS(vector(start.q), vector(start.u), matrix(model.M), matrix(model.K),
                             matrix(model.C)),
        machine_(model),
        f_(model.coordinates()) {
    if (!model.forces.empty()) _fExt = std::make_shared<SiconosVector>(_ndof);
  }

  void computeRhs(double t) override {
    ++right_hand_sides_;
    LagrangianLinearTIDS::computeRhs(t);
  }
  std::int64_t right_hand_sides() const { return right_hand_sides_; }

  void computeFExt(double t) override {
    machine_.force(t, f_);
    for (unsigned i = 0; i < _ndof; ++i) (*_fExt)(i) = f_[static_cast<Eigen::Index>(i)];
  }

 private:
  Machine machine_;
  Eigen::VectorXd f_;
  std::int64_t right_hand_sides_ = 0;
};

/// gap = w^T q + c
std::shared_ptr<Interaction> contact(const Eigen::VectorXd& w, double clearance,
                                     double restitution) {
  auto c = std::make_shared<SiconosVector>(1u);
  (*c)(0) = clearance;
  return std::make_shared<Interaction>(
      std::make_shared<NewtonImpactNSL>(restitution),
      std::make_shared<LagrangianLinearTIR>(matrix(w.transpose()), c));
}

/// The impulses of one step or event: which contacts close, and whether Newton's law and the
/// scene's law agree on them.
class Impulses {
 public:
  Impulses(const Model& model, std::vector<std::shared_ptr<Interaction>> contacts)
      : poisson_(model.law == ImpactLaw::poisson),
        contacts_(std::move(contacts)),
        pushed_(contacts_.size(), false) {}

  /// Clears all but the resting contacts. Their next impulse would otherwise count as a closing.
  void forget(const InteractionsGraph& resting) {
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      pushed_[i] = resting.is_vertex(contacts_[i]);
    }
  }

  /// False if several contacts are active and Poisson's law may give another result.
  bool record(double t, std::size_t active, Outcome& outcome) {
    bool any = false;
    for (std::size_t i = 0; i < contacts_.size(); ++i) {
      const bool pushed = (*contacts_[i]->lambda(1))(0) > 0.0;
      if (pushed && !pushed_[i]) outcome.impacts.push_back(t);
      pushed_[i] = pushed;
      any = any || pushed;
    }
    return !(any && active > 1 && poisson_);
  }

 private:
  bool poisson_;
  std::vector<std::shared_ptr<Interaction>> contacts_;
  std::vector<bool> pushed_;
};

constexpr const char* poisson_needed = "Poisson's law for several contacts at once";

/// Removes Siconos' exclamation marks.
std::string plain(std::string message) {
  return message.erase(message.find_last_not_of(" !.\n") + 1);
}

/// Runs `body`; an exception becomes the outcome's failure.
template <typename Body>
void guarded(Outcome& outcome, Body body) {
  const Quiet quiet;
  try {
    body();
  } catch (const Siconos::exception& error) {
    const std::string* message = boost::get_error_info<Siconos::exception::extra_message>(error);
    outcome.failure = "exception: " + plain(message != nullptr ? *message : "no message");
  } catch (const std::exception& error) {
    outcome.failure = error.what();
  } catch (...) {
    outcome.failure = "exception";
  }
}

bool diverged(const SiconosVector& q) {
  for (unsigned i = 0; i < q.size(); ++i) {
    if (!(std::abs(q(i)) < 1e100)) return true;
  }
  return false;
}

/// The time-stepping loop; `sample` puts the state at step k into the sample's columns.
template <typename Sample>
void step_through(const Task& task, double h, TimeStepping& simulation, LagrangianDS& machine,
                  Impulses& impulses, Outcome& outcome, Sample sample) {
  const std::int64_t steps = std::llround(task.horizon / h);
  Eigen::Index next = 0;
  std::int64_t next_step = task.sample_step > 0.0 ? 0 : steps + 1;
  const auto take_sample = [&](std::int64_t k) {
    if (k != next_step) return;
    sample(k, next++);
    next_step = next < task.samples() ? std::llround(task.sample_time(next) / h) : steps + 1;
  };
  take_sample(0);
  for (std::int64_t k = 1; k <= steps; ++k) {
    simulation.computeOneStep();
    const std::size_t active = simulation.indexSet(1)->size();
    outcome.steps = k;
    if (active > 0) ++outcome.solves;
    const double t = static_cast<double>(k) * h;
    if (!impulses.record(t, active, outcome)) {
      outcome.failure = poisson_needed;
      return;
    }
    if (diverged(*machine.q())) {
      outcome.failure = "diverged";
      return;
    }
    take_sample(k);
    simulation.nextStep();
  }
}

std::shared_ptr<TimeStepping> time_stepping(
    const Task& task, double h, const std::shared_ptr<DynamicalSystem>& machine,
    const std::vector<std::shared_ptr<Interaction>>& contacts,
    const std::shared_ptr<OneStepIntegrator>& scheme) {
  const auto system = std::make_shared<NonSmoothDynamicalSystem>(0.0, task.horizon + 10.0 * h);
  system->insertDynamicalSystem(machine);
  for (const auto& c : contacts) system->link(c, machine);
  const auto simulation = std::make_shared<TimeStepping>(
      system, std::make_shared<TimeDiscretisation>(0.0, h), scheme,
      std::make_shared<LCP>(contacts.size() > 1 ? SICONOS_LCP_LEMKE : SICONOS_LCP_ENUM));
  simulation->setNewtonOptions(SICONOS_TS_LINEAR);
  return simulation;
}

/// The motion under f(t) alone of a diagonal machine, and the free oscillators that carry its share
/// of the gaps and the supports' motion: cosine and sine of each frequency.
class ForcedMotion {
 public:
  explicit ForcedMotion(const Model& model) : model_(model) {
    rest_ = Eigen::VectorXd::Zero(model.coordinates());
    for (const Force& force : model.forces) {
      rest_ += force.direction * force.constant;
      add(force.harmonic);
    }
    for (const Contact& c : model.contacts) add(c.motion);
    amplitude_ =
        Eigen::MatrixXcd::Zero(model.coordinates(), static_cast<Eigen::Index>(frequencies_.size()));
    for (const Force& force : model.forces) {
      const Harmonic& harmonic = force.harmonic;
      if (harmonic.frequency == 0.0) {
        rest_ += force.direction * value(harmonic, 0.0);
      } else if (harmonic.amplitude != 0.0) {
        amplitude_.col(index(harmonic.frequency)) +=
            force.direction * std::polar(harmonic.amplitude, harmonic.phase);
      }
    }
    rest_ = rest_.cwiseQuotient(model.K.diagonal());
    for (std::size_t k = 0; k < frequencies_.size(); ++k) {
      const double w = frequencies_[k];
      for (Eigen::Index i = 0; i < model.coordinates(); ++i) {
        amplitude_(i, static_cast<Eigen::Index>(k)) /=
            std::complex(model.K(i, i) - w * w * model.M(i, i), w * model.C(i, i));
      }
    }
  }

  Eigen::Index oscillators() const { return 2 * static_cast<Eigen::Index>(frequencies_.size()); }

  void at(double t, Eigen::VectorXd& q, Eigen::VectorXd& u) const {
    q = rest_;
    u.setZero();
    for (std::size_t k = 0; k < frequencies_.size(); ++k) {
      const std::complex<double> turn = std::polar(1.0, frequencies_[k] * t);
      const auto column = amplitude_.col(static_cast<Eigen::Index>(k));
      q += (column * turn).real();
      u += (column * (turn * std::complex(0.0, frequencies_[k]))).real();
    }
  }

  /// The oscillators' last entries of q, of (q_0 - q_(-h)) / h and of the stiffness.
  void start_oscillators(double h, Eigen::VectorXd& q, Eigen::VectorXd& v,
                         Eigen::VectorXd& stiffness) const {
    Eigen::Index i = model_.coordinates();
    for (const double w : frequencies_) {
      const double half_sine = std::sin(w * h / 2);
      q[i] = heavy;
      v[i] = heavy * 2.0 * half_sine * half_sine / h;
      stiffness[i++] = w * w;
      q[i] = 0.0;
      v[i] = heavy * std::sin(w * h) / h;
      stiffness[i++] = w * w;
    }
  }

  /// The contact's share of the forced motion: returns the constant part and sets w's entries of
  /// the oscillators.
  double gap(const Contact& c, Eigen::VectorXd& w) const {
    Eigen::Index i = model_.coordinates();
    for (std::size_t k = 0; k < frequencies_.size(); ++k) {
      std::complex<double> share = 0.0;
      for (Eigen::Index j = 0; j < model_.coordinates(); ++j) {
        share += c.w[j] * amplitude_(j, static_cast<Eigen::Index>(k));
      }
      if (c.motion.frequency == frequencies_[k]) {
        share += std::polar(1.0, c.motion.phase) * c.motion.amplitude;
      }
      w[i++] = share.real() / heavy;
      w[i++] = -share.imag() / heavy;
    }
    return c.w.dot(rest_) + (c.motion.frequency == 0.0 ? value(c.motion, 0.0) : 0.0);
  }

 private:
  // Amplitude of the oscillators, sqrt of their mass: an impulse moves them by 1e-16 of the
  // machine's motion.
  static constexpr double heavy = 1e8;

  void add(const Harmonic& harmonic) {
    if (harmonic.amplitude == 0.0 || harmonic.frequency == 0.0) return;
    if (std::ranges::find(frequencies_, harmonic.frequency) == frequencies_.end()) {
      frequencies_.push_back(harmonic.frequency);
    }
  }
  Eigen::Index index(double frequency) const {
    return std::ranges::find(frequencies_, frequency) - frequencies_.begin();
  }

  const Model& model_;
  std::vector<double> frequencies_;
  Eigen::VectorXd rest_;
  Eigen::MatrixXcd amplitude_;  // q = Re(amplitude exp(i frequency t)), a column for each frequency
};

/// One step backwards in free flight: q(-h) = a q + b q', between q' and Bilbao's difference.
class Backward {
 public:
  Backward(double stiffness, double damping, double h) : h_(h) {
    const double sigma = damping / 2;
    const std::complex<double> mu = std::sqrt(std::complex(sigma * sigma - stiffness));
    const std::complex<double> sine = mu == 0.0 ? -h : -std::sinh(mu * h) / mu;
    a_ = std::exp(sigma * h) * (std::cosh(mu * h) + sigma * sine).real();
    b_ = std::exp(sigma * h) * sine.real();
  }
  double difference(double q, double u) const { return (q - a_ * q - b_ * u) / h_; }
  double velocity(double q, double difference) const { return (q - h_ * difference - a_ * q) / b_; }

 private:
  double h_, a_, b_;
};

constexpr int max_lsodar_steps = 1'000'000;
constexpr int max_standstill = 1000;
// Without samples: with a single sample, at the horizon, Siconos misses an impact.
constexpr double intervals = 40;

}  // namespace

void run_siconos_moreau_jean(const Task& task, double setting, Outcome& outcome) {
  guarded(outcome, [&] {
    const double h = setting;
    const RestingSupports supports(task.model);
    const auto machine =
        std::make_shared<ForcedMachine>(supports.model(), supports.into(task.start));
    std::vector<std::shared_ptr<Interaction>> contacts;
    for (const Contact& c : supports.model().contacts) {
      contacts.push_back(contact(c.w, c.clearance, c.restitution));
    }
    const auto simulation =
        time_stepping(task, h, machine, contacts, std::make_shared<MoreauJeanOSI>(0.5));
    Impulses impulses(task.model, contacts);
    step_through(task, h, *simulation, *machine, impulses, outcome,
                 [&](std::int64_t k, Eigen::Index column) {
                   copy(*machine->q(), outcome.q.col(column));
                   copy(*machine->velocity(), outcome.u.col(column));
                   supports.out_of(static_cast<double>(k) * h, outcome.q.col(column),
                                   outcome.u.col(column));
                 });
    outcome.solves += outcome.steps;  // of the iteration matrix
  });
}

void run_siconos_bilbao(const Task& task, double setting, Outcome& outcome) {
  guarded(outcome, [&] {
    const Model& model = task.model;
    const double h = setting;
    if (!model.M.isDiagonal(0.0) || !model.C.isDiagonal(0.0) || !model.K.isDiagonal(0.0)) {
      outcome.failure = "diagonal machines only";
      return;
    }
    if ((model.K.diagonal().array() <= 0.0).any()) {
      outcome.failure = "needs stiffness in every coordinate";
      return;
    }
    const ForcedMotion forced(model);
    const Eigen::Index f = model.coordinates();
    const Eigen::Index n = f + forced.oscillators();

    // The scheme requires unit masses, and its velocity is (q_k - q_(k-1)) / h.
    const Eigen::VectorXd root = model.M.diagonal().cwiseSqrt();
    Eigen::VectorXd z(n), v(n);
    Eigen::VectorXd stiffness(n), damping = Eigen::VectorXd::Zero(n);
    Eigen::VectorXd q_p(f), u_p(f);
    forced.at(0.0, q_p, u_p);
    std::vector<Backward> backward;
    for (Eigen::Index i = 0; i < f; ++i) {
      stiffness[i] = model.K(i, i) / model.M(i, i);
      damping[i] = model.C(i, i) / model.M(i, i);
      backward.emplace_back(stiffness[i], damping[i], h);
      z[i] = root[i] * (task.start.q[i] - q_p[i]);
      v[i] = backward.back().difference(z[i], root[i] * (task.start.u[i] - u_p[i]));
    }
    forced.start_oscillators(h, z, v, stiffness);

    std::vector<std::shared_ptr<Interaction>> contacts;
    for (const Contact& c : model.contacts) {
      Eigen::VectorXd w(n);
      w.head(f) = c.w.cwiseQuotient(root);
      const double clearance = c.clearance + forced.gap(c, w);
      contacts.push_back(contact(w, clearance, c.restitution));
    }
    const auto machine = std::make_shared<LagrangianLinearDiagonalDS>(
        vector(z), vector(v), vector(stiffness), vector(damping));
    const auto simulation =
        time_stepping(task, h, machine, contacts, std::make_shared<MoreauJeanBilbaoOSI>());
    Impulses impulses(model, contacts);
    step_through(task, h, *simulation, *machine, impulses, outcome,
                 [&](std::int64_t k, Eigen::Index column) {
                   copy(*machine->q(), z);
                   copy(*machine->velocity(), v);
                   forced.at(static_cast<double>(k) * h, q_p, u_p);
                   for (Eigen::Index i = 0; i < f; ++i) {
                     const Backward& back = backward[static_cast<std::size_t>(i)];
                     outcome.q(i, column) = z[i] / root[i] + q_p[i];
                     outcome.u(i, column) = back.velocity(z[i], v[i]) / root[i] + u_p[i];
                   }
                 });
  });
}

void run_siconos_event_driven(const Task& task, double setting, Outcome& outcome) {
  guarded(outcome, [&] {
    const RestingSupports supports(task.model);
    const auto machine =
        std::make_shared<ForcedMachine>(supports.model(), supports.into(task.start));
    const auto system = std::make_shared<NonSmoothDynamicalSystem>(0.0, task.horizon);
    system->insertDynamicalSystem(machine);
    std::vector<std::shared_ptr<Interaction>> contacts;
    for (const Contact& c : supports.model().contacts) {
      contacts.push_back(contact(c.w, c.clearance, c.restitution));
      system->link(contacts.back(), machine);
    }
    const double interval = task.sample_step > 0.0 ? task.sample_step : task.horizon / intervals;
    const auto simulation =
        std::make_shared<EventDriven>(system, std::make_shared<TimeDiscretisation>(0.0, interval));
    const auto lsodar = std::make_shared<LsodarOSI>();
    simulation->insertIntegrator(lsodar);
    simulation->insertNonSmoothProblem(std::make_shared<LCP>(), SICONOS_OSNSP_ED_IMPACT);
    simulation->insertNonSmoothProblem(std::make_shared<LCP>(), SICONOS_OSNSP_ED_SMOOTH_ACC);
    simulation->initialize();
    lsodar->setTol(1, setting, setting);
    lsodar->setMaxNstep(max_lsodar_steps);  // between two events; the default is 500

    Impulses impulses(task.model, contacts);
    Eigen::Index next = 0;
    const auto take_sample = [&] {
      copy(*machine->q(), outcome.q.col(next));
      copy(*machine->velocity(), outcome.u.col(next));
      supports.out_of(task.sample_time(next), outcome.q.col(next), outcome.u.col(next));
      ++next;
    };
    if (task.sample_step > 0.0) take_sample();
    double last = 0.0;
    int standstill = 0;
    while (simulation->hasNextEvent()) {
      impulses.forget(*simulation->indexSet(2));
      simulation->advanceToEvent();
      simulation->processEvents();
      const double t = simulation->startingTime();
      ++outcome.steps;
      outcome.right_hand_sides = machine->right_hand_sides();
      const std::size_t active = simulation->indexSet(1)->size();
      if (active > 0) ++outcome.solves;
      if (!impulses.record(t, active, outcome)) {
        outcome.failure = poisson_needed;
        return;
      }
      if (next < task.samples() && std::abs(t - task.sample_time(next)) <= 1e-12 * (1.0 + t)) {
        take_sample();
      }
      standstill = t - last > 1e-12 * (1.0 + t) ? 0 : standstill + 1;
      last = t;
      if (standstill > max_standstill) {
        outcome.failure = "events without end at one instant";
        return;
      }
    }
    if (last < task.horizon * (1.0 - 1e-12)) outcome.failure = "stopped before the horizon";
  });
}

}  // namespace sprag::work_precision
