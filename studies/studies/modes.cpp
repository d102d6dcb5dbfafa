#include <algorithm>

#include "sprag/analysis/reduction.h"
#include "sprag/estimation/replica.h"
#include "sprag/mechanics/energy.h"
#include "sprag/mechanics/master.h"
#include "studies/studies/study.h"

namespace sprag::studies {
namespace {

constexpr int all_modes = 40;
constexpr double T = 100.0;
constexpr double settled = 80.0;  // floors are taken from here on
constexpr double h = 1e-3;

struct Truth {
  std::vector<ContactEvent> events;
  Eigen::MatrixXd q, u;  // at every tick
};

Truth run_master(const ModalMachine& machine, std::int64_t ticks) {
  Master master(machine.model, machine.master);
  Truth truth;
  truth.q.resize(machine.model.coordinates(), ticks + 1);
  truth.u.resize(machine.model.coordinates(), ticks + 1);
  for (std::int64_t k = 0; k <= ticks; ++k) {
    master.advance(tick_instant(k, h), truth.events);
    master.state(tick_instant(k, h), truth.q.col(k), truth.u.col(k));
  }
  return truth;
}

void follow(const ModalMachine& whole, const Truth& truth, const std::vector<Eigen::Index>& kept,
            const char* order, Table& table) {
  const ModalMachine part = reduced(whole, kept);
  const auto n = static_cast<Eigen::Index>(kept.size());
  const std::int64_t ticks = truth.q.cols() - 1;
  Eigen::MatrixXd q = Eigen::MatrixXd::Zero(n, ticks + 1);
  Eigen::MatrixXd u = q;
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

  const ErrorEnergy energy(whole.model);
  std::vector<double> V;
  double tip_error = 0.0;
  Eigen::VectorXd q_s = Eigen::VectorXd::Zero(whole.model.coordinates());
  Eigen::VectorXd u_s = q_s;
  for (std::int64_t k = last_tick(settled, h); k <= ticks; ++k) {
    q_s(kept) = q.col(k);
    u_s(kept) = u.col(k);
    V.push_back(energy(truth.q.col(k), truth.u.col(k), q_s, u_s)[0]);
    tip_error = std::max(tip_error, (whole.observed * (q_s - truth.q.col(k))).cwiseAbs()[0]);
  }
  std::nth_element(V.begin(), V.begin() + static_cast<std::ptrdiff_t>(V.size() / 2), V.end());
  table.add({order, static_cast<double>(n), V[V.size() / 2], tip_error,
             1e9 * seconds / static_cast<double>(ticks)});
}

}  // namespace

void modes(Table& table) {
  const ModalMachine whole = modal_machine(paper_beam(all_modes));
  const Truth truth = run_master(whole, last_tick(T, h));
  for (const auto& [name, order] :
       {std::pair("frequency", by_frequency(whole)),
        std::pair("share in the contact", by_share_in_contact(whole))}) {
    for (int n = 1; n <= all_modes; ++n) {
      follow(whole, truth, {order.begin(), order.begin() + n}, name, table);
    }
  }
}

}  // namespace sprag::studies
