// Options that say where the times of contacts are in lines and how they become events.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "sprag/contact_clock.h"
#include "sprag/detail/import/levels.h"
#include "tools/import_events/choice.h"

namespace CLI {
class App;
}

namespace sprag {

/// What the options fill must outlive `app`.
/// --level.
void add_level_columns(CLI::App& app, std::vector<ColumnOption>& columns);
/// --time, --threshold, --inverted, --impacts-at.
void add_level_options(CLI::App& app, LevelOptions& levels);
/// --unit, --offset, --rate.
void add_time_options(CLI::App& app, std::optional<Decimal>& unit, Decimal& offset, double& rate);
/// Throws UsageError if --rate and the scene's [clock] would both correct the rate of the clock.
/// Says on stderr that two offsets add up.
void check_clock(const ContactClock& clock, double rate, const Decimal& offset);
/// --columns, --separator.
void add_format_options(CLI::App& app, std::vector<std::string>& names,
                        std::optional<char>& separator);
/// --debounce, --pulse-shorter-than.
void add_edge_rules(CLI::App& app, double& debounce, double& pulse_shorter_than);

}  // namespace sprag
