#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "sprag/detail/analysis/reduction_choice.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/replica/replica.h"
#include "sprag/energy.h"
#include "studies/convergence/mode_limit.h"
#include "studies/convergence/study.h"

namespace sprag::studies {
namespace {

constexpr int all_modes = 40;
constexpr double T = 100.0;
constexpr double settled = 80.0;  // errors count from here on
constexpr double h = 1e-3;
constexpr double zeta = 0.01;
constexpr std::array kept_modes{1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 30, 35};

struct Truth {
  std::vector<ContactEvent> events;
  Eigen::MatrixXd q, u;  // at the ticks that count
  std::int64_t begin = last_tick(settled, h);
};

Truth run_master(const ModalMachine& machine) {
  Master master(machine.model, machine.master);
  Truth truth;
  truth.q.resize(machine.model.coordinates(), last_tick(T, h) - truth.begin + 1);
  truth.u = truth.q;
  for (std::int64_t k = truth.begin; k <= last_tick(T, h); ++k) {
    master.advance(tick_instant(k, h), truth.events);
    master.state(tick_instant(k, h), truth.q.col(k - truth.begin), truth.u.col(k - truth.begin));
  }
  return truth;
}

void follow(const ModalMachine& whole, const Truth& truth, const Reduction& reduction,
            const char* damping, const char* method, Table& table) {
  const ModalMachine& part = reduction.machine;
  const Eigen::Index f = part.model.coordinates();
  const Eigen::Index n = reduction.modes;
  const std::int64_t ticks = truth.begin + truth.q.cols() - 1;
  Eigen::MatrixXd q(f, ticks + 1);
  Eigen::MatrixXd u(f, ticks + 1);
  const double seconds = shortest_cpu_time(
      [&] {
        Replica replica(part.model, h);
        Replica::State state;
        replica.start(part.replica, 0, 0, state);
        auto next = truth.events.begin();
        for (std::int64_t k = 1; k <= ticks; ++k) {
          const auto first = next;
          while (next != truth.events.end() && next->t <= tick_instant(k, h).hi) ++next;
          replica.tick({first, next}, state);
          replica.output(state, q.col(k), u.col(k));
        }
      },
      0.15);

  const Eigen::ArrayXd mass = whole.model.M.diagonal().head(n);
  const Eigen::ArrayXd stiffness = whole.model.K.diagonal().head(n);
  std::vector<double> V;
  double squares = 0.0;
  for (Eigen::Index i = 0; i < truth.q.cols(); ++i) {
    const Eigen::VectorXd q_s = q.col(truth.begin + i);
    const Eigen::VectorXd u_s = u.col(truth.begin + i);
    const Eigen::ArrayXd dq = q_s.head(n) - truth.q.col(i).head(n);
    const Eigen::ArrayXd du = u_s.head(n) - truth.u.col(i).head(n);
    V.push_back(0.5 * (mass * du.square() + stiffness * dq.square()).sum());
    squares += square((part.observed * q_s - whole.observed * truth.q.col(i))[0]);
  }
  std::nth_element(V.begin(), V.begin() + static_cast<std::ptrdiff_t>(V.size() / 2), V.end());
  std::string correction = reduction.correction;
  std::erase(correction, ',');
  table.add({damping, method, correction.c_str(), static_cast<double>(n), static_cast<double>(f),
             V[V.size() / 2], std::sqrt(squares / static_cast<double>(V.size())),
             1e9 * seconds / static_cast<double>(ticks)});
}

// Two limits: the error of n exact modes with the omitted modes at rest, and the least error if the
// omitted modes act on the kept modes like noise.
void add_limits(const ModalMachine& whole, const Truth& truth, int n, const char* damping,
                bool noise, Table& table) {
  const Eigen::Index rest = whole.model.coordinates() - n;
  const Eigen::RowVectorXd left_out = whole.observed.rightCols(rest) * truth.q.bottomRows(rest);
  const double tip = std::sqrt(left_out.squaredNorm() / static_cast<double>(left_out.size()));
  const auto add = [&](const char* method, double error) {
    table.add(
        {damping, method, "", static_cast<double>(n), static_cast<double>(n), 0.0, error, 0.0});
  };
  add("exact", tip);
  if (!noise) return;
  add("optimistic limit",
      mode_limit(whole, truth.events, n, settled, tip, LeftOutGap::new_at_each_pulse));
  add("cautious limit",
      mode_limit(whole, truth.events, n, settled, tip, LeftOutGap::same_in_a_cluster));
}

Scene damped(const std::string& damping) {
  Scene scene = paper_beam(all_modes);
  scene.prior.uncertainty.resize(0);  // it is given for three modes
  if (damping == "uniform") return scene;
  const Eigen::VectorXd omega =
      scene.model.K.diagonal().cwiseQuotient(scene.model.M.diagonal()).cwiseSqrt();
  Eigen::VectorXd ratio = Eigen::VectorXd::Constant(all_modes, zeta);
  if (damping == "stiffness") ratio = zeta * omega / omega[0];
  scene.model.C = damping_of_ratios(scene.model, ratio);
  return scene;
}

}  // namespace

void modes(Table& table) {
  for (const char* damping : {"uniform", "modal", "stiffness"}) {
    const ModalMachine whole = modal_machine(damped(damping));
    const Truth truth = run_master(whole);
    const std::vector<Eigen::Index> order = by_frequency(whole);
    for (const int n : kept_modes) {
      const auto all =
          reductions(whole, {order.begin(), order.begin() + n}, second_half(truth.events));
      const auto plain = std::find_if(all.begin(), all.end(), [](const Reduction& reduction) {
        return reduction.correction == "none";
      });
      follow(whole, truth, *plain, damping, "plain", table);
      follow(whole, truth, all.front(), damping, "corrected", table);
      // With stiffness-proportional damping the omitted modes follow the contact force: they are no
      // noise.
      add_limits(whole, truth, n, damping, std::string_view(damping) != "stiffness", table);
    }
  }
}

}  // namespace sprag::studies
