// Turns columns of time stamps into the contact events of a machine.
//
// A column of impacts contains their times: all are pulses. A pair of columns contains the times at
// which a contact closes (on) and opens (off), each in any order. The rules for bounces
// and pulses are those of sprag/detail/import/contact_edges.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "sprag/contact_event.h"
#include "sprag/detail/import/column_file.h"
#include "sprag/detail/import/decimal.h"

namespace sprag {

/// Size of the largest file with time stamps [bytes].
inline constexpr std::size_t largest_capture = std::size_t{16} << 30U;

/// The columns of one contact: either `impacts`, or `on` and `off`, or `level`, which is converted
/// to one of these (sprag/detail/import/levels.h). Indices from 0.
struct ContactColumns {
  int contact = 0;
  std::optional<std::size_t> impacts, on, off;
  std::optional<std::size_t> level = {};
};

struct ImportOptions {
  Decimal unit{1, 0};               ///< seconds per unit of the file, > 0
  Decimal offset{0, 0};             ///< time of the machine's t = 0, in the file's unit and clock
  double rate = 1.0;                ///< seconds of the file's clock per second of the machine, > 0
  double debounce = 0.0;            ///< [s]; 0: none
  double pulse_shorter_than = 0.0;  ///< [s]; 0: only contacts of zero duration
  double duration = std::numeric_limits<double>::infinity();  ///< later events are left out [s]
};

struct ContactFigures {
  int contact = 0;             ///< from 0
  std::int64_t pulses = 0;     ///< imported
  std::int64_t sustained = 0;  ///< imported
  std::int64_t merged = 0;     ///< bounces merged with the contact or impact before
};

/// A closing as recorded, before debouncing.
struct Closing {
  double t;             ///< [s]
  int contact;          ///< from 0
  bool impact = false;  ///< from a column of impacts
};

struct Import {
  std::vector<ContactEvent> events;     ///< times ascending, from 0 to the duration
  std::vector<Closing> closings;        ///< all readable ones, times ascending
  std::vector<ContactFigures> figures;  ///< of each contact that has columns
  std::vector<RowProblem> problems;     ///< omitted data by ascending line, with those of `columns`
  std::int64_t before_start = 0;        ///< events omitted because they lie before t = 0
  std::int64_t after_duration = 0;      ///< events omitted because they lie after the duration
  bool of_clock = false;                ///< some times are dates or times of day
  /// First row of each column of times whose time is before that of the row above it. The events
  /// are sorted all the same.
  std::vector<RowProblem> falls;
};

/// The events of the contacts in `chosen`. A contact that closes before t = 0 and opens later
/// closes at t = 0; one that never opens stays closed. Problems are cells that are not numbers, a
/// closing while closed, an opening while open, and two impacts at one time.
Import import_events(const ColumnFile& columns, const std::vector<ContactColumns>& chosen,
                     const ImportOptions& options);

}  // namespace sprag
