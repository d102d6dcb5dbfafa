// What the settled estimates of a run said of their own error: told as it happens, summed up at the
// end.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "sprag/detail/estimates/confidence.h"

namespace sprag {

class ConfidenceRecord {
 public:
  /// Notes what has happened by the settled tick at t [s], in order. A filter that no longer fits
  /// the events is told on `out` in a line, the first 20 times; so are contacts that others hold
  /// already, or that cannot be held together, and covariances that were gone.
  void note(double t, const Confidence& confidence, std::ostream& out);

  /// So many more ticks, the last one at t, of which note() would tell nothing: their estimates are
  /// of whom that of the last tick was.
  void pass(std::int64_t ticks, double t) {
    ticks_ += ticks;
    if (from_filter_) ticks_from_filter_ += ticks;
    t_ = t;
  }

  /// Notes the depth of a settled estimate inside a support [m], 0: it is inside none.
  void take_penetration(double depth);

  /// The confidence of the last settled tick so far, in full; `initial` is B(0).
  void conclude(const Confidence& confidence, double initial);

  /// How often the filter did not fit the events, in all sessions.
  std::int64_t inconsistencies() const { return inconsistencies_.total; }

  /// Adds "redundant_closings" and "refused_impacts" to a report, and "confidence" if there is
  /// anything to say.
  void to_json(nlohmann::ordered_json& report) const;

  /// A line or two for people.
  void print(std::ostream& out) const;

 private:
  void take_inconsistencies(const Confidence& confidence, std::ostream& out);
  void take_contacts(const Confidence& confidence, std::ostream& out);
  void take_forgotten(const Confidence& confidence, std::ostream& out);
  void take_parameters(const Confidence& confidence, std::ostream& out);

  struct Told {
    std::int64_t seen = 0;   // of the present session
    std::int64_t total = 0;  // of all
    std::int64_t lines = 0;
    bool more(std::int64_t now, std::ostream& out);
  };

  bool any_ = false;
  double t_ = 0.0;
  double initial_ = 0.0;
  Confidence last_;
  std::int64_t ticks_ = 0;
  bool from_filter_ = false;  // the last tick
  std::int64_t ticks_from_filter_ = 0;
  Told refutations_;
  std::vector<Inconsistency> first_;  // a bounded number of them
  // Of the settled estimates that were known in full: how many, how many of them penetrate, and
  // the largest depth [m].
  std::int64_t ticks_in_full_ = 0, penetrating_ticks_ = 0;
  double deepest_ = 0.0;
  Told inconsistencies_, redundant_, refused_, forgotten_;
  Told identified_;
  double accepted_ = -1.0;              // what was told last
  std::vector<double> accepted_times_;  // a bounded number of them
};

}  // namespace sprag
