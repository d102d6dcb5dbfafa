// When contacts were closed, as reported: the last closures of all contacts, and for a window as
// many of them as can be told apart in its pixels.
#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "sprag/contact_event.h"
#include "tools/view/history.h"

namespace sprag::view {

/// A contact was closed from `from` to `to`: at one instant for an impact; `to` infinite while it
/// is closed.
struct Closure {
  double from, to;
};

class Raster {
 public:
  /// Of as many contacts; keeps at most `most` closures of each.
  explicit Raster(std::size_t contacts, std::size_t most = 1U << 16U);

  /// Takes an event, in order of time.
  void add(const ContactEvent& event);
  /// After events that nobody heard of: these contacts are closed at t, the others open.
  void correct(ContactSet closed, double t);
  void clear();

  /// Of each contact, the closures that touch the window; those with less than a pixel between them
  /// are one.
  std::vector<std::vector<Closure>> thinned(const Window& window) const;

  std::size_t events(std::size_t contact) const { return contacts_[contact].events; }
  std::optional<double> last(std::size_t contact) const { return contacts_[contact].last; }
  bool closed(std::size_t contact) const { return contacts_[contact].closed(); }

 private:
  struct OfContact {
    std::deque<Closure> closures;
    std::size_t events = 0;
    std::optional<double> last;  // time of its last event

    bool closed() const;
  };

  std::size_t most_;
  std::vector<OfContact> contacts_;
};

}  // namespace sprag::view
