// Record of the settled estimates' own statements of their error: reported on stderr as they occur,
// and summarized at the end.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "sprag/confidence.h"

namespace sprag {

class ConfidenceRecord {
 public:
  /// Notes the settled tick at t [s]; ticks come in order. Prints to `out`, the first 20 times of
  /// each kind: gate failures of the filter, redundant closed contacts, contacts that cannot be
  /// held together, and covariances that the filter has lost.
  void note(double t, const Confidence& confidence, std::ostream& out);

  /// Counts further ticks, the last one at t, without anything to note. Their estimates have the
  /// same source as the last one.
  void pass(std::int64_t ticks, double t) {
    ticks_ += ticks;
    if (from_filter_) ticks_from_filter_ += ticks;
    t_ = t;
  }

  /// Notes the penetration depth of a settled estimate [m]; 0: none.
  void take_penetration(double depth);

  /// Sets the complete confidence of the last settled tick so far; `initial` is B(0).
  void conclude(const Confidence& confidence, double initial);

  std::int64_t ticks() const { return ticks_; }  ///< number of ticks
  double t() const { return t_; }                ///< time of the last one [s]

  /// Number of gate failures of the filter, in all sessions.
  std::int64_t inconsistencies() const { return inconsistencies_.total; }

  /// Adds "redundant_closings" and "refused_impacts" to a report, and "confidence" if the estimator
  /// has any.
  void to_json(nlohmann::ordered_json& report) const;

  /// Prints a summary of a few lines.
  void print(bool verbose, std::ostream& out) const;

 private:
  void take_inconsistencies(const Confidence& confidence, std::ostream& out);
  void take_contacts(const Confidence& confidence, std::ostream& out);
  void take_forgotten(const Confidence& confidence, std::ostream& out);
  void take_parameters(const Confidence& confidence, std::ostream& out);

  // A counter of the estimator that restarts with each session, and the lines printed about it.
  struct Counter {
    std::int64_t seen = 0;   // in the present session
    std::int64_t total = 0;  // in all sessions
    std::int64_t lines = 0;
    bool more(std::int64_t now, std::ostream& out);
  };

  bool any_ = false;
  double t_ = 0.0;
  double initial_ = 0.0;
  Confidence last_;
  std::int64_t ticks_ = 0;
  bool from_filter_ = false;  // source of the last tick
  std::int64_t ticks_from_filter_ = 0;
  Counter refutations_;
  std::vector<Inconsistency> first_;  // the first ones, a bounded number
  // Number of settled estimates with a complete confidence, number of these that penetrate a
  // support, and the largest depth [m].
  std::int64_t ticks_in_full_ = 0, penetrating_ticks_ = 0;
  double deepest_ = 0.0;
  Counter inconsistencies_, redundant_, refused_, forgotten_;
  Counter identified_;
  double accepted_ = -1.0;              // last reported value
  std::vector<double> accepted_times_;  // a bounded number
};

}  // namespace sprag
