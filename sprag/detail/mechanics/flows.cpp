#include "sprag/detail/mechanics/flows.h"

#include <cstddef>
#include <string>

namespace sprag {
namespace {

// With more contacts than this, locked sets of three and more are built at first use only.
constexpr int foreseeable_contacts = 4;
// Total of f^3 over the flows built in advance, about 50 ms.
constexpr double foreseeable_work = 2e6;

constexpr int slot_bits = 14;
constexpr std::size_t flow_slots = 1 << slot_bits;
constexpr std::size_t most_flows = flow_slots / 4 * 3;

}  // namespace

struct Flows::Entry {
  ContactSet locked;
  std::unique_ptr<Flow> flow;
  std::string why_not;
};

Flows::Flows(Model model) : dynamics_(std::move(model)), slots_(flow_slots) { (void)(*this)[0]; }

Flows::~Flows() = default;

// The slot of this set, or the free slot where it belongs.
std::atomic<const Flows::Entry*>& Flows::slot(ContactSet locked) const {
  // Fibonacci hashing by the top bits of the product, which depend on all contacts. Sets of few
  // contacts spread over all slots.
  std::size_t i = (locked * 0x9E3779B97F4A7C15U) >> (64 - slot_bits);
  while (true) {
    const Entry* entry = slots_[i].load(std::memory_order_acquire);
    if (entry == nullptr || entry->locked == locked) return slots_[i];
    i = (i + 1) % flow_slots;
  }
}

const Flows::Entry* Flows::entry(ContactSet locked) const {
  return slot(locked).load(std::memory_order_acquire);
}

const Flows::Entry* Flows::entry_when_built(ContactSet locked) const {
  if (const Entry* known = entry(locked)) return known;
  if (missing_) {
    missing_(locked);
  } else {
    build(locked);
  }
  return entry(locked);
}

void Flows::build(ContactSet locked) const {
  if (built(locked) || entries_.size() >= most_flows) return;
  Entry entry{locked, nullptr, {}};
  try {
    entry.flow = std::make_unique<Flow>(dynamics_, locked);
  } catch (const ModelError& error) {
    entry.why_not = error.what();
  }
  entries_.push_back(std::make_unique<Entry>(std::move(entry)));
  slot(locked).store(entries_.back().get(), std::memory_order_release);
}

void Flows::follow_input() {
  dynamics_.follow_input();
  for (const std::unique_ptr<Entry>& entry : entries_) {
    if (entry->flow) entry->flow->follow_input();
  }
}

const Flow* Flows::find(ContactSet locked) const {
  const Entry* known = entry_when_built(locked);
  return known == nullptr ? nullptr : known->flow.get();
}

const Flow& Flows::operator[](ContactSet locked) const {
  const Entry* known = entry_when_built(locked);
  if (known == nullptr) throw ModelError("too many sets of locked contacts");
  if (known->flow == nullptr) throw ModelError(known->why_not);
  return *known->flow;
}

void build_foreseeable(const Flows& flows) {
  const int m = flows.dynamics().contacts();
  const auto f = static_cast<double>(flows.dynamics().coordinates());
  double work = 0.0;
  const auto build = [&](ContactSet locked) {
    work += f * f * f;
    if (work > foreseeable_work) return;
    flows.build(locked);
  };
  for (int i = 0; i < m; ++i) build(bit(i));
  if (m <= foreseeable_contacts) {
    for (ContactSet locked = 0; locked < bit(m); ++locked) build(locked);
    return;
  }
  for (int i = 0; i < m && work <= foreseeable_work; ++i) {
    for (int j = 0; j < i; ++j) build(bit(i) | bit(j));
  }
}

}  // namespace sprag
