// What is shown, as the JSON objects that the page reads. docs/reference/messages.md has the
// members.
#pragma once

#include <optional>
#include <string>

#include "tools/view/frame.h"
#include "tools/view/json_text.h"
#include "tools/view/watch.h"

namespace sprag::view {

/// The machine, its contacts and the quantities that have curves: what does not change. `speed`:
/// of a replay, infinite for one that does not wait; nothing: live.
void put_scene(const Watch& watch, std::optional<double> speed, JsonText& to);
void put_frame(const Frame& frame, JsonText& to);
/// `extent`: the first and last time that there is.
void put_curves(const Curves& curves, const Watch& watch, std::pair<double, double> extent,
                JsonText& to);
/// The observer's health, `age` seconds ago, and what was heard here; null for the first if there
/// is none.
void put_health(const Watch& watch, double age, JsonText& to);

}  // namespace sprag::view
