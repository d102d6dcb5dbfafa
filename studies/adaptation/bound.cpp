#include "studies/adaptation/bound.h"

#include <vector>

#include "sprag/detail/identification/machine_family.h"
#include "sprag/detail/identification/path_posterior.h"
#include "sprag/detail/identification/task.h"
#include "sprag/detail/mechanics/master.h"
#include "sprag/identification.h"

namespace sprag::adaptation_study {

double least_V(const Scene& machine, int impacts, double sigma) {
  Master master(machine.model, machine.truth.start);
  std::vector<ContactEvent> events;
  const auto wanted = static_cast<std::size_t>(impacts);
  master.advance(at(1e5), events, wanted);
  events.resize(wanted);
  // With exact times the most likely path is the machine's own. A filter linearized along it, with
  // a far wider prior, has the Cramer-Rao bound as its covariance.
  IdentificationSettings settings;
  settings.unknowns = unknowns_to_adapt(machine);
  settings.jitter = sigma;
  settings.mend = false;
  const Identification found = identify(machine, events, settings);
  const MachineFamily family(machine, settings.unknowns);
  const FilterModel model{walk_of(family.scene(), std::ssize(family.unknowns()))};
  const FilterBelief belief =
      path_posterior(family, model, found.likelihood, found.measured, sigma);
  const Machine of = family.at(family.nominal());
  double V = 0.0;
  for (Eigen::Index i = 0; i < family.n(); ++i) {
    V += 0.5 *
         (belief.S.row(family.n() + i).squaredNorm() + of.K(i, 0) * belief.S.row(i).squaredNorm());
  }
  return V;
}

}  // namespace sprag::adaptation_study
