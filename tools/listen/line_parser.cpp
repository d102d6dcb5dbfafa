#include "tools/listen/line_parser.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "command_line/program.h"
#include "sprag/contact_event.h"
#include "sprag/detail/files/csv.h"
#include "sprag/detail/files/nearest_word.h"

namespace sprag {

namespace {

constexpr std::string_view blanks = " \t";
constexpr char any_blanks = ' ';  // as a separator: one or more blanks

bool names_time(std::string_view name) { return lower_case(name).starts_with("time"); }

/// Length of the field at the beginning of `text`, up to its separator; nullopt if a quote is not
/// closed. A doubled quote closes and reopens the quotes, which gives the same length.
std::optional<std::size_t> field_length(std::string_view text, char separator) {
  const std::size_t first = text.find_first_not_of(' ');
  if (first == std::string_view::npos || text[first] != '"')
    return std::min(text.find(separator), text.size());
  bool in_quotes = false;
  for (std::size_t i = first; i < text.size(); ++i) {
    if (text[i] == '"') in_quotes = !in_quotes;
    if (text[i] == separator && !in_quotes) return i;
  }
  return in_quotes ? std::nullopt : std::optional(text.size());
}

/// Splits a line into its fields, without surrounding blanks and quotes. Returns false if a quote
/// is not closed.
bool split_line(std::string_view line, char separator, std::vector<std::string_view>& fields) {
  fields.clear();
  while (true) {
    const auto length = field_length(line, separator);
    if (!length) return false;
    std::string_view field = trimmed(line.substr(0, *length));
    if (field.size() >= 2 && field.front() == '"' && field.back() == '"')
      field = trimmed(field.substr(1, field.size() - 2));
    fields.push_back(field);
    if (*length == line.size()) return true;
    line.remove_prefix(*length + 1);
  }
}

/// The columns of --level; without numbers contacts are counted in the order given. Throws
/// UsageError.
std::vector<LevelColumn> level_columns(const std::vector<std::string>& options, int contacts) {
  std::vector<LevelColumn> columns;
  std::size_t numbered = 0;
  for (const std::string& text : options) {
    const std::size_t sign = text.find('=');
    const std::string digits = text.substr(0, sign);
    const bool has_number = sign != std::string::npos && !digits.empty() &&
                            digits.find_first_not_of("0123456789") == std::string::npos;
    numbered += has_number ? 1 : 0;
    // A number that does not fit is larger than the number of contacts of every scene.
    const std::int64_t contact =
        has_number ? parse_integer(digits).value_or(max_contacts + 1) : std::ssize(columns) + 1;
    const std::string name = has_number ? text.substr(sign + 1) : text;
    if (contact < 1 || contact > contacts) {
      throw UsageError("--level " + name + " is for contact " + std::to_string(contact) +
                       "; the scene has " + std::to_string(contacts) +
                       (contacts == 1 ? " contact" : " contacts") + ", counted from 1");
    }
    columns.push_back({name, static_cast<int>(contact) - 1});
  }
  if (numbered > 0 && numbered < columns.size()) {
    throw UsageError("some columns are given as CONTACT=NAME and some as NAME; must all be alike");
  }
  std::ranges::stable_sort(columns, {}, &LevelColumn::contact);
  const auto second = std::ranges::adjacent_find(columns, std::equal_to{}, &LevelColumn::contact);
  if (second != columns.end()) {
    throw UsageError("--level " + (second + 1)->name + " is a second --level for contact " +
                     std::to_string(second->contact + 1));
  }
  return columns;
}

/// Place of the only column of this name. Returns why there is none in `problem`.
std::optional<std::size_t> place_of(const std::string& name, const std::vector<std::string>& names,
                                    std::string& problem) {
  const auto count = std::ranges::count(names, name);
  if (count == 1) return static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
  problem = (count == 0 ? "there is no column '" : "there is more than one column '") + name + "'";
  const std::vector<std::string_view> others(names.begin(), names.end());
  if (const auto nearest = nearest_word(name, others); nearest && count == 0)
    problem.append(" (did you mean '").append(*nearest).append("'?)");
  problem += "; the columns are ";
  for (std::size_t i = 0; i < names.size(); ++i)
    problem.append(i > 0 ? ", '" : "'").append(names[i]).append("'");
  return std::nullopt;
}

/// The level after an edge of this name.
std::optional<double> level_after(std::string_view edge) {
  constexpr double infinity = std::numeric_limits<double>::infinity();  // beyond any threshold
  if (edge == "rising" || edge == "RISING") return infinity;
  if (edge == "falling" || edge == "FALLING") return -infinity;
  return std::nullopt;
}

/// An edge as gpiomon prints it.
struct GpioEdge {
  std::string_view time, edge;
  std::vector<std::string_view> line;  ///< names of the GPIO line: chip, offset, name
};

// libgpiod 1: "event:  RISING EDGE offset: 17 timestamp: [    2116.701523641]".
// libgpiod 2: "2116.701523641\trising\tgpiochip0 17 \"NAME\"", where one or two names may lack.
std::optional<GpioEdge> parse_gpiomon(std::string_view line) {
  std::vector<std::string_view> words;
  if (line.starts_with("event:")) {
    split_words(line, words);
    const bool complete = words.size() >= 7 && words[2] == "EDGE" && words[3] == "offset:" &&
                          words[5] == "timestamp:" && words.back().ends_with(']');
    if (!complete) return std::nullopt;
    std::string_view time = words.back();
    time.remove_suffix(1);
    if (time.starts_with('[')) time.remove_prefix(1);
    return GpioEdge{time, words[1], {words[4]}};
  }
  const std::size_t first = line.find('\t');
  const std::size_t second = line.find('\t', first + 1);
  if (first == std::string_view::npos || second == std::string_view::npos) return std::nullopt;
  GpioEdge edge{line.substr(0, first), line.substr(first + 1, second - first - 1), {}};
  if (!level_after(edge.edge)) return std::nullopt;
  std::string_view names = line.substr(second + 1);
  if (const std::size_t quote = names.find('"'); quote != std::string_view::npos) {
    edge.line.push_back(names.substr(quote + 1, names.rfind('"') - quote - 1));
    names = names.substr(0, quote);
  }
  split_words(names, words);
  edge.line.insert(edge.line.end(), words.begin(), words.end());
  return edge;
}

std::string counted_fields(std::size_t count) {
  return std::to_string(count) + (count == 1 ? " field" : " fields");
}

}  // namespace

LineParser::LineParser(const LineOptions& options)
    : options_(options), levels_(level_columns(options.levels, options.contacts)) {
  if (!options_.names.empty()) {
    if (const std::string what = assign(options_.names); !what.empty())
      throw UsageError("--columns: " + what);
  } else if (levels_.empty()) {
    std::vector<std::string> usual{"contact", "level"};
    if (options_.needs_time) usual.insert(usual.begin(), "time");
    assign(usual);
  } else {
    // Finds names that contradict each other before the header arrives.
    std::vector<std::string> found{options_.time.empty() ? "Time" : options_.time};
    for (const LevelColumn& level : levels_) found.push_back(level.name);
    if (!options_.input.empty()) found.push_back(options_.input);
    const std::string what = assign(found);
    names_.clear();
    if (!what.empty()) throw UsageError("--level: " + what);
  }
}

std::optional<NamedUnit> LineParser::time_unit() const {
  if (row_unit_ || !roles_.time || names_.empty()) return row_unit_;
  return unit_in(names_[*roles_.time]);
}

// Reads a line of gpiomon. Returns false if it is none.
bool LineParser::read_gpiomon(std::string_view line, ParsedLine& result) const {
  if (!options_.names.empty() || headed_) return false;
  const std::optional<GpioEdge> edge = parse_gpiomon(line);
  if (!edge) return false;
  result.kind = ParsedLine::Kind::problem;
  result.time = parse_clock_time(edge->time, DecimalMark::point);
  const auto level = level_after(edge->edge);
  const auto contact = std::ranges::find_if(levels_, [&](const LevelColumn& of) {
    return std::ranges::find(edge->line, of.name) != edge->line.end();
  });
  if (!result.time || !level) {
    result.problem = "is like a line of gpiomon, but has no time or no edge";
  } else if (contact == levels_.end()) {
    result.problem = "is of a GPIO line without a contact; --level CONTACT=LINE names it";
  } else {
    result.kind = ParsedLine::Kind::levels;
    result.levels.push_back({contact->contact, level, true});
  }
  return true;
}

// Splits a line into fields_, if possible into `wanted` of them. Returns false if a quote is open.
bool LineParser::split(std::string_view line, std::size_t wanted) {
  if (options_.separator) {
    separator_ = *options_.separator;
    return split_line(line, separator_, fields_);
  }
  for (const char candidate : {'\t', ';', ','}) {
    if (line.find(candidate) == std::string_view::npos) continue;
    if (!split_line(line, candidate, fields_)) return false;
    separator_ = candidate;
    if (wanted == 0 || fields_.size() == wanted || candidate == ',') return true;
  }
  separator_ = any_blanks;
  split_words(line, fields_);
  return true;
}

// A header names the columns that the options ask for, or at least one of the usual ones.
bool LineParser::is_header() const {
  bool known = false;
  for (const std::string_view field : fields_) {
    if (parse_clock_time(field, DecimalMark::point_or_comma)) return false;
    const std::string name = lower_case(field);
    known = known || name == "contact" || name == "level" || names_time(name) ||
            (!field.empty() && (field == options_.time || field == options_.input)) ||
            std::ranges::find(levels_, field, &LevelColumn::name) != levels_.end();
  }
  return known && fields_.size() > 1;
}

// Assigns the columns of these names to their roles. Returns why that is not possible.
std::string LineParser::assign(const std::vector<std::string>& names) {
  Roles roles;
  const auto only = [&](const auto& fits, std::optional<std::size_t>& place) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (!fits(names[i])) continue;
      if (place) return false;
      place = i;
    }
    return true;
  };
  const bool one_time = only(
      [&](const std::string& name) {
        return options_.time.empty() ? names_time(name) : name == options_.time;
      },
      roles.time);
  if (!one_time) return "more than one column has times; say which one: --time NAME";
  if (!roles.time && (options_.needs_time || !options_.time.empty())) {
    return options_.time.empty() ? "no column's name begins with 'time'; name it with --time NAME, "
                                   "or stamp the lines "
                                   "on arrival: --stamp arrival"
                                 : "there is no column '" + options_.time + "'";
  }
  if (levels_.empty()) {
    const bool unique =
        only([](const std::string& name) { return lower_case(name) == "contact"; },
             roles.contact) &&
        only([](const std::string& name) { return lower_case(name) == "level"; }, roles.level);
    if (!unique) return "there is more than one column 'contact' or 'level'";
    if (!roles.contact && options_.contacts > 1) {
      return "there is no column 'contact', and the scene has " +
             std::to_string(options_.contacts) +
             " contacts; name columns of levels with --level CONTACT=NAME";
    }
  }
  for (const LevelColumn& level : levels_) {
    std::string problem;
    const auto place = place_of(level.name, names, problem);
    if (!place) return problem;
    if (roles.time == place) return "the column of times has no levels";
    roles.levels.emplace_back(*place, level.contact);
  }
  if (!options_.input.empty()) {
    if (!only([&](const std::string& name) { return name == options_.input; }, roles.input))
      return "there is more than one column '" + options_.input + "' (--input)";
    if (!roles.input) return "there is no column '" + options_.input + "' (--input)";
    if (roles.input == roles.time) return "the column of times has no samples (--input)";
  }
  names_ = names;
  roles_ = std::move(roles);
  return {};
}

// Reads a row of units, which can only stand before the first time. Returns false if it is none.
bool LineParser::read_units() {
  if (begun_ || !roles_.time) return false;
  const std::optional<NamedUnit> unit = unit_of_cell(fields_[*roles_.time]);
  if (unit) row_unit_ = unit;
  return unit.has_value();
}

std::string LineParser::read_level(std::string_view text, int contact, ParsedLine& result) const {
  if (const auto level = level_after(text)) {
    result.levels.push_back({contact, level, true});
    return {};
  }
  const auto number = parse_decimal(text, mark());
  if (!number) return "the level is neither a number nor one of rising, falling";
  const double level = difference_in(*number, {}, {1, 0});
  if (!options_.threshold && level != 0.0 && level != 1.0) {
    return "the level is neither 0 nor 1; --threshold X says from where on it is high";
  }
  result.levels.push_back({contact, level});
  return {};
}

std::string LineParser::read_sample(std::string_view text, ParsedLine& result) const {
  if (text.find_first_not_of(blanks) == std::string_view::npos) return {};
  const auto number = parse_decimal(text, mark());
  if (!number) return "the sample of '" + options_.input + "' is not a number";
  result.sample = difference_in(*number, {}, {1, 0});
  return std::isfinite(*result.sample) ? "" : "the sample of '" + options_.input + "' is too large";
}

ParsedLine LineParser::parse(std::string_view line) {
  using Kind = ParsedLine::Kind;
  ParsedLine result;
  const auto refuse = [&result](std::string why) {
    result.kind = Kind::problem;
    result.problem = std::move(why);
    return std::move(result);
  };
  const std::size_t begin = line.find_first_not_of(blanks);
  if (begin == std::string_view::npos || line[begin] == '#' || line[begin] == ';') return result;
  if (read_gpiomon(line, result)) return result;
  if (!split(line, names_.size())) return refuse("a quote is not closed");
  if (is_header()) {
    if (!options_.names.empty() && !std::ranges::equal(fields_, options_.names))
      return refuse("is a header that differs from --columns");
    const std::string why = assign({fields_.begin(), fields_.end()});
    if (!why.empty()) return refuse("is a header that cannot be used: " + why);
    headed_ = true;
    begun_ = false;
    row_unit_.reset();
    result.kind = Kind::header;
    return result;
  }
  if (names_.empty()) {
    return refuse("comes before the header with the columns' names; --columns NAME,... names them");
  }
  if (fields_.size() != names_.size()) {
    return refuse("has " + counted_fields(fields_.size()) + "; must have " +
                  std::to_string(names_.size()));
  }
  if (read_units()) {
    result.kind = Kind::units;
    return result;
  }
  if (roles_.time) {
    result.time = parse_clock_time(fields_[*roles_.time], mark());
    if (!result.time) return refuse("the time is not a number");
    begun_ = true;
  }
  int contact = 0;
  if (roles_.contact) {
    const auto number = parse_integer(fields_[*roles_.contact]);
    if (!number || *number < 1 || *number > options_.contacts) {
      return refuse("the contact must be a number from 1 to " + std::to_string(options_.contacts));
    }
    contact = static_cast<int>(*number) - 1;
  }
  std::string why;
  if (roles_.level) {
    why = read_level(fields_[*roles_.level], contact, result);
  } else if (roles_.levels.empty()) {
    result.levels.push_back({contact, std::nullopt});
  }
  for (const auto& [column, of_contact] : roles_.levels) {
    if (why.empty()) why = read_level(fields_[column], of_contact, result);
  }
  if (roles_.input && why.empty()) why = read_sample(fields_[*roles_.input], result);
  if (!why.empty()) return refuse(std::move(why));
  result.kind = Kind::levels;
  return result;
}

}  // namespace sprag
