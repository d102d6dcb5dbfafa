// Encodes frames, curves and health as the JSON objects that the page reads. Their members are
// described in docs/reference/messages.md.
#pragma once

#include <optional>
#include <string>

#include "tools/view/frame.h"
#include "tools/view/json_text.h"
#include "tools/view/watch.h"

namespace sprag::view {

/// The constant part: the machine, its contacts and the quantities with curves. `speed`: of a
/// replay, infinite for an unpaced replay; nothing: live.
void put_scene(const Watch& watch, std::optional<double> speed, JsonText& to);
void put_frame(const Frame& frame, JsonText& to);
/// `extent`: first and last time of all curves.
void put_curves(const Curves& curves, const Watch& watch, std::pair<double, double> extent,
                JsonText& to);
/// The observer's health message, received `age` seconds ago, or null if there is none, and the
/// message counts of this program.
void put_health(const Watch& watch, double age, JsonText& to);

}  // namespace sprag::view
