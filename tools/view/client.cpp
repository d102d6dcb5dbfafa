#include "tools/view/client.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace sprag::view {
namespace {

constexpr std::int64_t millisecond = 1'000'000;  // ns
constexpr std::int64_t curves_period = 45 * millisecond;
constexpr std::int64_t health_period = 500 * millisecond;
constexpr int most_pixels = 4000;

std::optional<double> number_in(const nlohmann::json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  const auto number = found->get<double>();
  return std::isfinite(number) ? std::optional(number) : std::nullopt;
}

}  // namespace

void Client::receive(std::string_view message) {
  const nlohmann::json said = nlohmann::json::parse(message, nullptr, false);
  if (!said.is_object()) return;
  if (const auto seen = number_in(said, "seen"); seen && *seen >= 0.0 && *seen < 1e15) {
    seen_ = std::clamp(static_cast<std::int64_t>(*seen), seen_, sent_);
  }
  const auto view = said.find("view");
  if (view == said.end() || !view->is_object()) return;
  const auto from = number_in(*view, "from"), to = number_in(*view, "to");
  const auto length = number_in(*view, "window");
  if (from && to && *from < *to) {
    follow_ = false;
    from_ = *from;
    to_ = *to;
  } else if (length && *length > 0.0) {
    follow_ = true;
    length_ = *length;
  }
  if (const auto pixels = number_in(*view, "pixels"); pixels && *pixels >= 1.0) {
    pixels_ = static_cast<int>(std::min(*pixels, double{most_pixels}));
  }
  if (const auto quantity = view->find("quantity");
      quantity != view->end() && quantity->is_string()) {
    quantity_ = quantity->get<std::string>();
  }
  changed_ = true;
}

Window Client::window(std::pair<double, double> extent) const {
  if (!follow_) return {from_, to_, pixels_};
  // The window fills from the left before it moves.
  const double to = std::max(extent.second, extent.first + length_);
  return {to - length_, to, pixels_};
}

bool Client::curves_due(std::pair<double, double> extent, std::int64_t wall) const {
  if (changed_) return true;
  if (wall - curves_sent_ < curves_period || extent.second == curves_end_) return false;
  return follow_ || curves_end_ <= to_;
}

std::string Client::next(const Watch& watch, std::optional<double> speed, std::int64_t now,
                         std::int64_t wall, bool over) {
  JsonText text;
  text.open('{');
  text.member("n", ++sent_);
  if (sent_ == 1) {
    text.key("scene");
    put_scene(watch, speed, text);
  }
  text.member("over", over);
  const Frame frame = watch.frame(now);
  if (frame.session != session_) changed_ = true;
  session_ = frame.session;
  text.key("frame");
  put_frame(frame, text);
  const std::pair<double, double> extent = watch.extent();
  if (curves_due(extent, wall)) {
    const auto& quantities = watch.quantities();
    const auto chosen =
        std::find_if(quantities.begin(), quantities.end(),
                     [this](const Quantity& quantity) { return quantity.name == quantity_; });
    const auto index = chosen == quantities.end() ? 0 : chosen - quantities.begin();
    text.key("curves");
    put_curves(watch.curves(static_cast<std::size_t>(index), window(extent)), watch, extent, text);
    curves_sent_ = wall;
    curves_end_ = extent.second;
    changed_ = false;
  }
  if (sent_ == 1 || wall - health_sent_ >= health_period) {
    text.key("health");
    put_health(watch, 1e-9 * static_cast<double>(now - watch.health_arrival()), text);
    health_sent_ = wall;
  }
  text.close('}');
  return std::move(text).take();
}

}  // namespace sprag::view
