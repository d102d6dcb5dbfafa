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

void add_own(std::vector<Method>& all) {
  all.push_back({"exact",
                 Kind::ours,
                 0,
                 "none",
                 {0.0},
                 "closed-form flow and bounded event search: no step and no tolerance; completes "
                 "chatter; sustained contact; wedges",
                 run_exact});
}

void add_rivals(std::vector<Method>& all) {
  all.push_back({"Moreau-Jean 1/2", Kind::rival, 2, "step [s]", steps(),
                 "theta = 1/2; impacts at the end of the step, any number at once; chatter and "
                 "sustained contact without special cases; stays inside a support a little",
                 run_moreau_jean});
  all.push_back({"Moreau-Jean 1", Kind::rival, 1, "step [s]", steps(),
                 "theta = 1: as with 1/2, and damps what is fast", run_moreau_jean_implicit});
  all.push_back({"exact flow + Moreau", Kind::rival, 0, "step [s]", steps(),
                 "exact free flight, impacts at the end of the step; contacts as in Moreau-Jean",
                 run_bilbao});
  all.push_back({"Paoli-Schatzman", Kind::rival, 2, "step [s]", steps(),
                 "central differences, contact in positions: no velocity of its own; explicit, so "
                 "that fast modes limit the step",
                 run_paoli_schatzman});
  all.push_back({"generalized-alpha", Kind::rival, 2, "step [s]", steps(),
                 "nonsmooth generalized-alpha: gaps hold as well as gap velocities",
                 run_generalized_alpha});
#ifdef SPRAG_HAS_ODEINT
  all.push_back({"odeint dopri5", Kind::rival, 5, "tolerance", tolerances(),
                 "adaptive Dormand-Prince, events by sign changes on its dense output; chatter and "
                 "sustained contact added here",
                 run_odeint});
#endif
  all.push_back({"RK4", Kind::rival, 4, "step [s]", steps(),
                 "fixed step, events by sign changes at steps; chatter and sustained contact added "
                 "here",
                 run_rk4});
#ifdef SPRAG_HAS_ODEINT
  all.push_back(
      {"penalty",
       Kind::rival,
       5,
       "stiffness [N/m]",
       {1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10},
       "contacts as springs and dashpots, no events, adaptive Dormand-Prince: penetrates, "
       "restitution by the dashpot",
       run_penalty});
#endif
}

void add_peers([[maybe_unused]] std::vector<Method>& all) {
  [[maybe_unused]] const Settings peer_steps{1e-2, 1e-3, 1e-4, 1e-5};
#ifdef SPRAG_HAS_SICONOS
  all.push_back({"Siconos Moreau-Jean", Kind::peer, 2, "step [s]", peer_steps,
                 "Siconos MoreauJeanOSI, theta = 1/2; Newton's law only", run_siconos_moreau_jean});
  all.push_back({"Siconos Bilbao", Kind::peer, 0, "step [s]", peer_steps,
                 "Siconos MoreauJeanBilbaoOSI, exact free flight per mode; Newton's law only",
                 run_siconos_bilbao});
  all.push_back({"Siconos event-driven", Kind::peer, 12, "tolerance", tolerances(),
                 "Siconos EventDriven with LsodarOSI: stops at the first accumulation of impacts",
                 run_siconos_event_driven});
#endif
#ifdef SPRAG_HAS_CVODE
  all.push_back({"CVODE Adams", Kind::peer, 12, "tolerance", tolerances(),
                 "SUNDIALS CVODE, Adams of orders 1 to 12, with its root finding; chatter and "
                 "sustained contact added here",
                 run_cvode_adams});
  all.push_back({"CVODE BDF", Kind::peer, 5, "tolerance", tolerances(),
                 "SUNDIALS CVODE, BDF of orders 1 to 5, with its root finding; chatter and "
                 "sustained contact added here",
                 run_cvode_bdf});
#endif
#ifdef SPRAG_HAS_MUJOCO
  all.push_back({"MuJoCo", Kind::peer, 1, "step [s]", peer_steps,
                 "MuJoCo with contacts as limits of tendons: soft, restitution only by tuning",
                 run_mujoco});
#endif
}

}  // namespace

std::span<const Method> methods() {
  static const std::vector<Method> table = [] {
    std::vector<Method> all;
    add_own(all);
    add_rivals(all);
    add_peers(all);
    return all;
  }();
  return table;
}

}  // namespace sprag::work_precision
