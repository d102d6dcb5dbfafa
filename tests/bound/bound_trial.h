// Trials that search for violations of the bound B under tolerances: a random machine, a true one
// at or within its tolerances, and event times shifted within theirs so that V / B becomes large.
#pragma once

#include <string>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/bound/bound_tracker.h"
#include "sprag/scene.h"
#include "tests/support/random.h"

namespace sprag::test {

/// A machine as specified, and the true machine.
struct BoundCase {
  Scene scene;  ///< with tolerance and uncertainty
  Model truth;
  State start;  ///< of the true machine
  double end = 0.0;
  std::vector<ContactEvent> events;  ///< true ones up to `end`
  /// Lost reports: `lost` in succession, after the share `lost_after` of all reports. None is lost
  /// if this would change the set of closed contacts.
  std::size_t lost = 0;
  double lost_after = 0.5;
};

struct BoundCaseSettings {
  int contacts = 1;
  bool exact_start = false;  ///< V(0) = 0
  bool corners = false;      ///< parameters at the ends of their ranges
  bool unlike = false;       ///< Newton's law or different restitutions
  std::size_t lost = 0;      ///< number of reports
};

/// A case with at least four and at most `most_events` events; the parameter errors are drawn as
/// well.
BoundCase random_bound_case(Random& random, const BoundCaseSettings& settings, int most_events);

enum class ShiftPattern { early, late, alternating, signs, uniform, greedy, optimized };
inline constexpr int shift_patterns = 7;

/// Largest V / B of a run, and B at its end.
struct BoundRun {
  double worst = 0.0;  ///< V / B
  double worst_t = 0.0;
  double final_B = 0.0, final_V = 0.0;
  double median_B = 0.0;  ///< in the second half, outside windows of events
  int samples = 0;
  int infinite = 0;
};

/// Runs tracker, replica and machine with shifts s_k of the events, |s_k| <= tolerance.time.
BoundRun run_bound_case(const BoundCase& machine, const std::vector<double>& shifts,
                        const BoundSettings& settings = {});

/// Shifts of a pattern. Greedy and optimized patterns run the case to find them.
std::vector<double> make_shifts(const BoundCase& machine, ShiftPattern pattern, Random& random,
                                const BoundSettings& settings = {});

/// The events at their reported times, in order; each contact's events keep their order. None is
/// lost.
std::vector<ContactEvent> shifted(const BoundCase& machine, const std::vector<double>& shifts);

std::string describe(const BoundCase& machine);

}  // namespace sprag::test
