// The classical Runge-Kutta method of order 4 with a fixed step, restarted at events
// (event_loop.h). A state inside a step, in particular for the event search, comes from a shortened
// step.
#include <vector>

#include "studies/work_precision/methods/event_loop.h"
#include "studies/work_precision/methods/methods.h"

namespace sprag::work_precision {
namespace {

class RungeKutta4 {
 public:
  RungeKutta4(ContactPhases& phases, double h)
      : phases_(&phases), h_(h), size_(static_cast<std::size_t>(2 * phases.f())) {
    for (auto* v : {&x_0_, &x_1_, &stage_, &k1_, &k2_, &k3_, &k4_}) v->resize(size_);
  }

  void restart(double t, std::span<const double> x) {
    start_ = t_1_ = t;
    steps_ = 0;
    std::copy(x.begin(), x.end(), x_1_.begin());
  }

  double step() {
    std::swap(x_0_, x_1_);
    t_0_ = t_1_;
    t_1_ = start_ + static_cast<double>(++steps_) * h_;
    phases_->derivative(t_0_, x_0_.data(), k1_.data());
    advance(t_1_ - t_0_, x_1_.data());
    return t_1_;
  }

  void interpolate(double t, double* x) {
    if (t == t_1_) {
      std::copy(x_1_.begin(), x_1_.end(), x);
    } else {
      advance(t - t_0_, x);
    }
  }

  ContactSet fired() const { return 0; }

 private:
  // From t_0, where k1 is known.
  void advance(double h, double* x) {
    for (std::size_t i = 0; i < size_; ++i) stage_[i] = x_0_[i] + 0.5 * h * k1_[i];
    phases_->derivative(t_0_ + 0.5 * h, stage_.data(), k2_.data());
    for (std::size_t i = 0; i < size_; ++i) stage_[i] = x_0_[i] + 0.5 * h * k2_[i];
    phases_->derivative(t_0_ + 0.5 * h, stage_.data(), k3_.data());
    for (std::size_t i = 0; i < size_; ++i) stage_[i] = x_0_[i] + h * k3_[i];
    phases_->derivative(t_0_ + h, stage_.data(), k4_.data());
    for (std::size_t i = 0; i < size_; ++i) {
      x[i] = x_0_[i] + h / 6.0 * (k1_[i] + 2.0 * (k2_[i] + k3_[i]) + k4_[i]);
    }
  }

  ContactPhases* phases_;
  double h_;
  std::size_t size_;
  double start_ = 0.0, t_0_ = 0.0, t_1_ = 0.0;  // the last step goes from t_0 to t_1
  std::int64_t steps_ = 0;                      // since start_
  std::vector<double> x_0_, x_1_, stage_, k1_, k2_, k3_, k4_;
};

}  // namespace

void run_rk4(const Task& task, double h, Outcome& outcome) try {
  ContactPhases phases(task, outcome);
  RungeKutta4 integrator(phases, h);
  run_events(task, phases, integrator, outcome);
} catch (const std::exception& error) {
  outcome.failure = error.what();
}

}  // namespace sprag::work_precision
