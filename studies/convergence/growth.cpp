#include <memory>

#include "sprag/beam.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/detail/replica/replica.h"
#include "studies/convergence/study.h"

namespace sprag::studies {
namespace {

constexpr double h = 1e-3;

// Supports under the beam at m places. Impacts without loss leave no contact at rest, so the
// figures measure impacts only.
void add_supports(int n, int m, Model& model) {
  const Beam beam{n, 1.0, 1.0, 1.0, 0.17};
  for (int i = 1; i <= m; ++i) {
    const double x = 0.868 * i / m;
    model.contacts.push_back({mode_shapes(beam, x), 0.01, {0.03, 9.5, 0.0}, 1.0});
  }
}

double ns_per_tick(const Model& model) {
  Replica replica(model, h);
  // On the heap, as in a time line. The address of a stack differs between processes, which changes
  // the time by a few ns.
  const auto memory = std::make_unique<Replica::State>();
  Replica::State& state = *memory;
  const int n = static_cast<int>(model.coordinates());
  replica.start(paper_beam(n).truth.start, 0, 0, state);
  const int ticks = std::max(100, 1000000 / n);
  const double seconds = shortest_cpu_time([&] {
    for (int k = 0; k < ticks; ++k) replica.tick({}, state);
  });
  return 1e9 * seconds / ticks;
}

double us_per_impact(const Model& model) {
  constexpr std::size_t impacts = 300;
  const int n = static_cast<int>(model.coordinates());
  const State start = paper_beam(n).truth.start;
  const double seconds = shortest_cpu_time([&] {
    Master master(model, start);
    std::vector<ContactEvent> events;
    master.advance(at(1e6), events, impacts);
  });
  return 1e6 * seconds / static_cast<double>(impacts);
}

// Minimal tick: one exact rotation per mode, the gap, its sign.
double ns_per_least_tick(int n) {
  const Replica replica(free_beam(n).model, h);
  const TickTable table(replica.flows()[0].oscillators(), h);
  const Eigen::VectorXd w = mode_shapes({n, 1.0, 1.0, 1.0, 0.17}, 0.868);
  const auto size = static_cast<std::size_t>(n);
  std::vector<double> zz(size), zv(size), vz(size), vv(size), z(size, 0.01), v(size, 0.01);
  for (std::size_t i = 0; i < size; ++i) {
    const auto k = static_cast<Eigen::Index>(i) + 1;  // after the excitation's oscillator
    zz[i] = table.zz[k];
    zv[i] = table.zv[k];
    vz[i] = table.vz[k];
    vv[i] = table.vv[k];
  }
  const double* direction = w.data();
  const int ticks = std::max(100, 1000000 / n);
  long below = 0;
  const double seconds = shortest_cpu_time([&] {
    for (int k = 0; k < ticks; ++k) {
      double g = 0.0;
      for (std::size_t i = 0; i < size; ++i) {
        const double moved = zz[i] * z[i] + zv[i] * v[i];
        v[i] = vz[i] * z[i] + vv[i] * v[i];
        z[i] = moved;
        g += direction[i] * moved;
      }
      if (g < 0.0) ++below;
    }
  });
  // The count is used, so that the loop is not optimized away.
  return below < 0 ? 0.0 : 1e9 * seconds / ticks;
}

}  // namespace

void growth(Table& table) {
  for (const int n : {3, 10, 30, 100, 300, 1000, 3000}) {
    table.add({"ns per tick", "modes", double(n), ns_per_tick(free_beam(n).model)});
  }
  for (const int n : {3, 10, 30, 100, 300, 1000}) {
    Model model = free_beam(n).model;
    add_supports(n, 1, model);
    table.add({"us per impact", "modes", double(n), us_per_impact(model)});
  }
  for (const int m : {1, 2, 4, 8, 16}) {
    constexpr int n = 20;
    Model model = free_beam(n).model;
    add_supports(n, m, model);
    table.add({"ns per tick", "contacts", double(m), ns_per_tick(model)});
    table.add({"us per impact", "contacts", double(m), us_per_impact(model)});
  }
}

// Alternating, so that a slow minute of a shared machine affects both. Also at different memory
// addresses, which matter for small loops: a load waits for an earlier store at an address that
// differs by a multiple of 4096 bytes.
void limit(Table& table) {
  constexpr std::size_t turns = 9;
  for (const int n : {3, 10, 100, 1000}) {
    std::vector<std::vector<char>> fillers;
    for (std::size_t i = 0; i < turns; ++i) {
      fillers.emplace_back(16 * (1 + 37 * i));
      const double ours = ns_per_tick(free_beam(n).model);
      table.add({double(n), double(i + 1), ours, ns_per_least_tick(n)});
    }
  }
}

}  // namespace sprag::studies
