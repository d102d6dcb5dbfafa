// Search for parameters and for errors of the record: candidates on a window of events, growth of
// the window to the whole record, and hypotheses about events where it does not grow.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "sprag/detail/identification/gauss_newton.h"

namespace sprag {

/// Bound of a chi^2, in its standard deviations; and of a time, in those of the times.
inline constexpr double six = 6.0;
/// Half of a 95 % interval, in standard deviations.
inline constexpr double of_interval = 1.96;
/// A difference of so many standard deviations is no chance.
inline constexpr double ruled_out = 4.0;
/// Largest chi^2 of a fit, per degree of freedom.
double largest_misfit(int freedom);
/// Largest rise of the chi^2 of a fit by n more events that agree. Without a given jitter that of
/// the fit is uncertain.
double largest_rise(double n, const EventFit& fit, bool given);
/// The cost need not be quadratic within a standard deviation above this share of the range.
inline constexpr double weakly_determined = 2e-3;
/// Largest share of the events that an explanation may change.
inline constexpr double largest_share_changed = 0.2;
/// Least share of the events that an explanation spans.
inline constexpr double least_share_explained = 0.9;
/// A lost impact differs from the next event by more than this share of the time between the
/// events.
inline constexpr double beside_event = 0.1;

/// Scatter that the search neglects, in usual intervals: it shows no error of the record.
inline constexpr double negligible_scatter = 1e-7;
/// Largest scatter about a path that follows the events, in usual intervals; and largest velocity,
/// in typical speeds, of an impact that may not have happened.
inline constexpr double largest_scatter = 0.02;
/// Steps of a refinement.
inline constexpr int most_iterations = 40;

struct EventChange {
  double t = 0.0;         ///< [s]
  int contact = 0;        ///< from 0
  bool inserted = false;  ///< an impact without an event; else a spurious event
  std::size_t index = 0;  ///< number of the spurious event in the record
};

/// Consecutive events of a stretch of the record with one start, after changes.
struct Piece {
  std::size_t stretch = 0;        ///< number in FitRecord::stretches
  std::size_t low = 0, high = 0;  ///< events of it that the piece spans
  FitStretch part;
};

/// Pieces of the record and the fit to all of them. Between two pieces of one stretch the record
/// has an error.
struct Chain {
  std::vector<Piece> pieces;
  EventFit fit;
  std::vector<EventChange> changes;
  bool explained = false;  ///< its changes were sought

  std::vector<FitStretch> parts() const;
  std::size_t spanned() const;
  void sort_by_time();
};

class FitSearch {
 public:
  /// `changes`: events may be inserted and dropped.
  /// `neglected`: scatter that shows no error of the record, in usual intervals.
  /// `progress`: called with the number of events that a path is sought through.
  FitSearch(GaussNewton& solver, const FitRecord& record, std::optional<double> jitter,
            bool changes, double neglected = negligible_scatter,
            std::function<void(std::size_t)> progress = {});

  /// Explanations of the record, the best first. Empty: no window of events fits.
  std::vector<Chain> run();
  /// Whether a chain spans enough events.
  bool explains(const Chain& chain) const;

  /// Variance of the times that a fit claims.
  double variance(const EventFit& fit) const;
  /// Rounding of times [s].
  double floor() const { return floor_; }
  /// Twice the negative logarithm of the likelihood of the record.
  double price(const Chain& chain) const;
  /// Cuts that a chain leaves unexplained.
  std::size_t unexplained(const Chain& chain) const;
  /// Events of the record in stretches that are long enough for a start of their own.
  std::size_t usable() const;

 private:
  std::vector<Eigen::VectorXd> design(std::size_t count) const;
  void report(const std::vector<FitStretch>& parts) const;
  std::vector<Chain> candidates(const std::vector<Piece>& pieces);
  std::vector<std::vector<Piece>> windows(std::size_t number, bool split) const;
  void prune(Chain& chain);
  void restore(Chain& chain);
  void polish(Chain& chain);
  bool descend(Chain& chain);
  void begin_record(Chain& chain);
  std::optional<std::pair<FitEvent, std::size_t>> unrecorded(const Chain& chain, std::size_t piece);
  void insert_unrecorded(Chain& chain);
  void explain(Chain& chain);
  std::optional<EventFit> refit(std::vector<FitStretch> parts, const EventFit& from);
  bool is_certain(const EventFit& fit) const;
  bool plausible(const EventFit& fit) const;
  bool agrees(const EventFit& wider, const EventFit& fit, double added) const;
  bool replace(Chain& chain, std::size_t piece, Piece by, double added);
  void grow(Chain& chain, std::size_t piece, bool forwards, bool repairs);
  bool begin_piece(Chain& chain, std::size_t stretch, std::size_t low, std::size_t high,
                   bool forwards);
  void complete(Chain& chain);
  void continue_in(Chain& chain, std::size_t stretch, std::size_t from, std::size_t to,
                   bool forwards);
  void mend(Chain& chain);
  bool connect(Chain& chain, std::size_t first);
  bool repair(Chain& chain, std::size_t piece, bool forwards);
  struct Option {
    std::optional<Chain> chain = {};
    double price = 0.0;
  };
  static void restore_moved(Chain& chain, double beside);
  void consider(Chain changed, const Chain& chain, double added, Option& best);
  static bool drop(std::span<const FitEvent> events, Chain& chain);
  std::optional<Chain> continued(const Chain& chain, std::size_t first, std::size_t from_a,
                                 std::size_t low, std::span<const FitEvent> next, std::size_t high,
                                 std::size_t most);
  std::optional<Chain> preceded(const Chain& chain, std::size_t piece, std::size_t from_a,
                                std::size_t low, std::size_t high);
  std::optional<Chain> aligned(const Chain& chain, std::size_t piece, std::size_t from_a,
                               bool forwards);
  double tolerated(const EventFit& fit) const;
  PathPoint beyond(const Chain& chain, std::size_t piece, std::size_t from_a, bool forwards);
  std::optional<std::vector<FitEvent>> lost_events(const Chain& chain, std::size_t piece,
                                                   std::size_t events, const FitEvent& next,
                                                   std::size_t most);
  std::optional<std::vector<FitEvent>> earlier_events(const Chain& chain, std::size_t piece,
                                                      std::size_t from_a, const FitEvent& last);
  std::optional<FitEvent> next_impact(const Eigen::VectorXd& x, double t, double until,
                                      ContactSet held);
  std::size_t shortest() const;
  double sigma(double rms) const;

  GaussNewton* solver_;
  const FitRecord* record_;
  std::optional<double> jitter_;
  bool changes_;
  double neglected_;
  double floor_;
  std::function<void(std::size_t)> progress_;
};

}  // namespace sprag
