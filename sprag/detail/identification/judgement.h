// Judges the fit that a search found: uncertainty of the parameters, departures from the model, and
// the verdict.
#pragma once

#include <span>
#include <vector>

#include "sprag/detail/identification/search.h"
#include "sprag/identification.h"

namespace sprag {

/// What a search is judged by.
struct SearchContext {
  const Scene& scene;
  std::span<const ContactEvent> events;
  const IdentificationSettings& settings;
  const FitRecord& record;
};

/// Judges the first of the chains; the others are further minima.
Identification judge(const SearchContext& context, GaussNewton& solver, const FitSearch& search,
                     const std::vector<Chain>& chains);

}  // namespace sprag
