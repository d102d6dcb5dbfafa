// Turns columns of time stamps into the contact events of a machine.
//
// A column of impacts has the time of each: all are pulses. A pair of columns has the times at
// which a contact closes (on) and opens (off), each in any order. What is measured, all in seconds:
// * debounce: of closings and openings, from the last opening of a contact to its next closing; if
//   that is shorter, both are one contact, which closes at its first closing and opens at its last
//   opening. A closing while closed, or an opening while open, within the same time after the one
//   before is such a bounce as well. Of impacts, from the last impact to the next: if that is
//   shorter, they are one, at the first one's time. Bounces chain.
// * pulse: from a contact's closing to its opening, after debouncing; if that is shorter, or zero,
//   it is a pulse at the closing's time. Other contacts are sustained.
// A span as long as the limit, to within the rounding of its ends, is not shorter.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "sprag/contact_event.h"
#include "tools/import_events/choice.h"
#include "tools/import_events/column_file.h"
#include "tools/import_events/decimal.h"

namespace sprag {

struct ImportOptions {
  Decimal unit{1, 0};               ///< seconds per unit of the file, > 0
  Decimal offset{0, 0};             ///< the machine's t = 0, in the file's unit and on its clock
  double debounce = 0.0;            ///< [s]; 0: none
  double pulse_shorter_than = 0.0;  ///< [s]; 0: only contacts without any duration
  double duration = std::numeric_limits<double>::infinity();  ///< later events are left out [s]
};

struct ContactFigures {
  int contact = 0;             ///< from 0
  std::int64_t pulses = 0;     ///< that are imported
  std::int64_t sustained = 0;  ///< the same
  std::int64_t merged = 0;     ///< bounces that became part of the contact or impact before
};

/// A closing as it is stamped, before debouncing.
struct Closing {
  double t;             ///< [s]
  int contact;          ///< from 0
  bool impact = false;  ///< of a column of impacts
};

struct Import {
  std::vector<ContactEvent> events;     ///< times ascending, from 0 to the duration
  std::vector<Closing> closings;        ///< all that are readable, times ascending
  std::vector<ContactFigures> figures;  ///< of each contact that has columns
  std::vector<RowProblem> problems;  ///< what is left out, lines ascending; those of `columns` too
  std::int64_t before_start = 0;     ///< events left out since they lie before t = 0
  std::int64_t after_duration = 0;   ///< or after the duration
  bool of_clock = false;             ///< some times are dates or times of day
};

/// The events of the contacts in `chosen`. A contact that closes before t = 0 and opens later
/// closes at t = 0; one that closes last and never opens stays closed. Problems are cells that are
/// no number, a closing while closed, an opening while open, and two impacts at one time.
Import import_events(const ColumnFile& columns, const std::vector<ContactColumns>& chosen,
                     const ImportOptions& options);

}  // namespace sprag
