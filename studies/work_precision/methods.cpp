#include "studies/work_precision/methods/methods.h"

#include "studies/work_precision/method.h"
#if defined(SPRAG_HAS_SICONOS) || defined(SPRAG_HAS_CVODE) || defined(SPRAG_HAS_MUJOCO)
#include "studies/peers/peers.h"
#endif

namespace sprag::work_precision {
namespace {

using Settings = std::vector<double>;

// Steps divide the samples' 0.5 and 0.01.
const Settings& steps() {
  static const Settings all{1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5, 1e-5};
  return all;
}

// Only methods of optional packages have a tolerance.
[[maybe_unused]] const Settings& tolerances() {
  static const Settings all{1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12};
  return all;
}

void add_rivals(std::vector<Method>& all) {
  all.push_back({"Moreau-Jean 1/2", Kind::rival, "step [s]", steps(), run_moreau_jean});
  all.push_back({"Moreau-Jean 1", Kind::rival, "step [s]", steps(), run_moreau_jean_implicit});
  all.push_back({"generalized-alpha", Kind::rival, "step [s]", steps(), run_generalized_alpha});
#ifdef SPRAG_HAS_ODEINT
  all.push_back({"odeint dopri5", Kind::rival, "tolerance", tolerances(), run_odeint});
#endif
  all.push_back({"RK4", Kind::rival, "step [s]", steps(), run_rk4});
#ifdef SPRAG_HAS_ODEINT
  const Settings stiffnesses{1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10};
  all.push_back({"penalty", Kind::rival, "stiffness [N/m]", stiffnesses, run_penalty});
#endif
}

void add_peers([[maybe_unused]] std::vector<Method>& all) {
  [[maybe_unused]] const Settings peer_steps{1e-2, 1e-3, 1e-4, 1e-5};
#ifdef SPRAG_HAS_SICONOS
  all.push_back(
      {"Siconos Moreau-Jean", Kind::peer, "step [s]", peer_steps, run_siconos_moreau_jean});
  all.push_back({"Siconos Bilbao", Kind::peer, "step [s]", peer_steps, run_siconos_bilbao});
  all.push_back(
      {"Siconos event-driven", Kind::peer, "tolerance", tolerances(), run_siconos_event_driven});
#endif
#ifdef SPRAG_HAS_CVODE
  all.push_back({"CVODE Adams", Kind::peer, "tolerance", tolerances(), run_cvode_adams});
  all.push_back({"CVODE BDF", Kind::peer, "tolerance", tolerances(), run_cvode_bdf});
#endif
#ifdef SPRAG_HAS_MUJOCO
  all.push_back({"MuJoCo", Kind::peer, "step [s]", peer_steps, run_mujoco});
#endif
}

}  // namespace

std::span<const Method> methods() {
  static const std::vector<Method> table = [] {
    std::vector<Method> all{{"exact", Kind::ours, "none", {0.0}, run_exact}};
    add_rivals(all);
    add_peers(all);
    return all;
  }();
  return table;
}

}  // namespace sprag::work_precision
