// The contact events of a whole machine from the edges of its contacts as they arrive, in order of
// time.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "sprag/detail/import/contact_edges.h"

namespace sprag {

enum class EdgeKind { closes, opens, impact };

struct ContactEdge {
  double t = 0.0;   ///< [s]
  int contact = 0;  ///< from 0
  EdgeKind kind = EdgeKind::closes;
};

class ContactStream {
 public:
  ContactStream(int contacts, const EdgeRules& rules);

  /// Takes the next edge. Returns why it is refused; empty: it is taken. An edge at the time of the
  /// last advance() is moved by one unit of rounding, since the events up to that time are final;
  /// one before it is refused.
  std::string take(const ContactEdge& edge);

  /// Every later edge comes after `t`.
  void advance(double t);

  /// No edge follows.
  void finish();

  /// Every event up to this time is in take_events() or an earlier call of it. Never falls.
  double watermark() const { return watermark_; }

  /// The time of the last advance(), or of an edge that was moved.
  double now() const { return now_; }

  /// The final events since the last call, by time, then by contact.
  std::vector<ContactEvent> take_events();

  /// Sums over all contacts.
  EdgeCounts counts() const;
  EdgeCounts counts(int contact) const {
    return contacts_.at(static_cast<std::size_t>(contact)).counts();
  }

 private:
  void collect();

  std::vector<ContactEdges> contacts_;
  std::vector<ContactEvent> waiting_;  // later than the watermark
  double now_ = -std::numeric_limits<double>::infinity();
  double latest_ = now_;  // of the edges
  double watermark_ = now_;
};

}  // namespace sprag
