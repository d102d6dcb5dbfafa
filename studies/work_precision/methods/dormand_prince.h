// Dormand and Prince's Runge-Kutta pair 5(4) with dense output by Boost.Odeint: Hairer, Norsett &
// Wanner, "Solving Ordinary Differential Equations I", 2nd ed., II.5 and II.6. The error of each
// entry is controlled to tolerance (1 + |x| + h |x'|).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/dense_output_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>
#include <span>
#include <vector>

#include "sprag/contact_event.h"

namespace sprag::work_precision {

/// x' = rate(t, x). State is std::vector<double>, or std::array for a fixed size, for which
/// odeint's loops are unrolled.
template <typename State, typename Rate>
class DormandPrince {
 public:
  DormandPrince(std::size_t size, double tolerance, Rate rate)
      : rate_(rate),
        stepper_(boost::numeric::odeint::make_dense_output(
            tolerance, tolerance, boost::numeric::odeint::runge_kutta_dopri5<State>())) {
    if constexpr (requires { scratch_.resize(size); }) scratch_.resize(size);
  }

  /// Continues with the step size of the controller.
  void restart(double t, std::span<const double> x) {
    std::copy(x.begin(), x.end(), scratch_.begin());
    constexpr double first_step = 1e-3;
    stepper_.initialize(scratch_, t, started_ ? stepper_.current_time_step() : first_step);
    started_ = true;
  }

  double step() {
    return stepper_
        .do_step(
            [this](const State& x, State& x_dot, double t) { rate_(t, x.data(), x_dot.data()); })
        .second;
  }

  void interpolate(double t, double* x) {
    if (t == stepper_.current_time()) {
      std::copy(stepper_.current_state().begin(), stepper_.current_state().end(), x);
      return;
    }
    stepper_.calc_state(t, scratch_);
    std::copy(scratch_.begin(), scratch_.end(), x);
  }

  ContactSet fired() const { return 0; }

 private:
  using Stepper = typename boost::numeric::odeint::result_of::make_dense_output<
      boost::numeric::odeint::runge_kutta_dopri5<State>>::type;

  Rate rate_;
  Stepper stepper_;
  State scratch_{};
  bool started_ = false;
};

/// Calls visit(State{}) with a state of 2 f entries; State is an array for small f.
template <typename Visit>
void with_state(Eigen::Index f, Visit visit) {
  switch (f) {
    case 1:
      return visit(std::array<double, 2>{});
    case 2:
      return visit(std::array<double, 4>{});
    case 3:
      return visit(std::array<double, 6>{});
    case 5:
      return visit(std::array<double, 10>{});
    default:
      return visit(std::vector<double>(static_cast<std::size_t>(2 * f)));
  }
}

}  // namespace sprag::work_precision
