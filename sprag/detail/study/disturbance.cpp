#include "sprag/detail/study/disturbance.h"

#include "sprag/detail/study/random.h"

namespace sprag::study {

std::vector<ContactEvent> disturb(std::span<const ContactEvent> events,
                                  const Disturbance& disturbance, int contacts, double end,
                                  std::uint64_t seed, std::uint64_t run) {
  return disturb(events, disturbance, contacts, end, Random(seed, run, Purpose::jitter),
                 Random(seed, run, Purpose::losses), Random(seed, run, Purpose::spurious));
}

void drop_contradicting(std::vector<ContactEvent>& events) {
  ContactSet chi = 0;
  std::erase_if(events, [&](const ContactEvent& event) {
    const bool opens = event.kind == ContactEventKind::opens;
    if (contains(chi, event.contact) != opens) return true;
    chi = after(chi, event);
    return false;
  });
}

}  // namespace sprag::study
