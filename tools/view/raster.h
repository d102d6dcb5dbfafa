// Reported closed intervals of the contacts: the last closures of every contact, merged to the
// resolution of a window.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "sprag/contact_event.h"
#include "tools/view/history.h"

namespace sprag::view {

/// A contact was closed from `from` to `to`. The two are equal for an isolated impact; `to` is
/// infinite while the contact is closed.
struct Closure {
  double from, to;
};

class Raster {
 public:
  /// Keeps at most `most` closures of each contact.
  explicit Raster(std::size_t contacts, std::size_t most = 1U << 16U);

  /// Takes an event, in order of time.
  void add(const ContactEvent& event);
  /// Sets the state at t after missed events: contacts in `closed` are closed, the others open.
  void correct(ContactSet closed, double t);
  void clear();

  /// For each contact, the closures that intersect the window. Closures less than a pixel apart are
  /// merged.
  std::vector<std::vector<Closure>> thinned(const Window& window) const;

  std::size_t events(std::size_t contact) const { return contacts_[contact].events; }
  std::optional<double> last(std::size_t contact) const { return contacts_[contact].last; }
  bool closed(std::size_t contact) const { return contacts_[contact].closed(); }

 private:
  struct OfContact {
    std::deque<Closure> closures;
    std::size_t events = 0;
    std::optional<double> last;  // time of the last event

    bool closed() const;
  };

  std::size_t most_;
  std::vector<OfContact> contacts_;
};

}  // namespace sprag::view
