#include "sprag/detail/import/contact_stream.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace sprag {

namespace {

// Edges that are earlier than now by less than this share of it are at the same time: they were
// moved together by units of rounding.
constexpr double same_time = 1e-12;

}  // namespace

ContactStream::ContactStream(int contacts, const EdgeRules& rules) {
  contacts_.reserve(static_cast<std::size_t>(contacts));
  for (int i = 0; i < contacts; ++i) contacts_.emplace_back(i, rules);
}

std::string ContactStream::take(const ContactEdge& edge) {
  double t = edge.t;
  if (t <= now_) {
    if (t < now_ - same_time * std::max(1.0, std::abs(now_))) {
      return "is " + std::to_string(now_ - t) + " s older than events that are final";
    }
    t = now_ = std::nextafter(now_, std::numeric_limits<double>::infinity());
  }
  latest_ = std::max(latest_, t);
  ContactEdges& contact = contacts_.at(static_cast<std::size_t>(edge.contact));
  switch (edge.kind) {
    case EdgeKind::closes:
      return contact.close(t);
    case EdgeKind::opens:
      return contact.open(t);
    case EdgeKind::impact:
      break;
  }
  return contact.impact(t);
}

void ContactStream::advance(double t) {
  now_ = std::max(now_, t);
  for (ContactEdges& contact : contacts_) contact.advance(now_);
  collect();
}

void ContactStream::finish() {
  now_ = std::max(now_, latest_);
  for (ContactEdges& contact : contacts_) contact.finish();
  collect();
}

void ContactStream::collect() {
  double watermark = now_;
  for (ContactEdges& contact : contacts_) {
    const std::vector<ContactEvent> events = contact.take_events();
    waiting_.insert(waiting_.end(), events.begin(), events.end());
    watermark = std::min(watermark, contact.watermark());
  }
  watermark_ = std::max(watermark_, watermark);
}

std::vector<ContactEvent> ContactStream::take_events() {
  std::ranges::stable_sort(waiting_, [](const ContactEvent& a, const ContactEvent& b) {
    return std::tie(a.t, a.contact) < std::tie(b.t, b.contact);
  });
  const auto end = std::ranges::upper_bound(waiting_, watermark_, {}, &ContactEvent::t);
  std::vector<ContactEvent> events(waiting_.begin(), end);
  waiting_.erase(waiting_.begin(), end);
  return events;
}

EdgeCounts ContactStream::counts() const {
  EdgeCounts sum;
  for (const ContactEdges& contact : contacts_) sum += contact.counts();
  return sum;
}

}  // namespace sprag
