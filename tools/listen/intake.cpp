#include "tools/listen/intake.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace sprag {

namespace {

constexpr std::size_t longest_shown = 80;  // bytes of a line in a message
// A time that falls by more than this is that of a restarted device once a second line confirms it.
// A smaller step needs a third line: edges of two contacts may change places.
constexpr double least_restart = 0.1;  // s
constexpr std::size_t enough_lines = 2;
constexpr std::size_t enough_lines_of_a_small_step = 3;

std::string seconds_text(double t) {
  std::array<char, 32> text;
  const int length = std::snprintf(text.data(), text.size(), "%.6g s", t);
  return {text.data(), static_cast<std::size_t>(length)};
}

IntakeOptions completed(IntakeOptions options) {
  options.lines.needs_time = !options.stamp_arrival;
  return options;
}

}  // namespace

Intake::Intake(const IntakeOptions& options, IntakeSink& sink)
    : options_(completed(options)),
      sink_(sink),
      parser_(options_.lines),
      clock_(options_.clock),
      stream_(options_.lines.contacts, options_.rules),
      grid_(options_.input.dt),
      levels_(static_cast<std::size_t>(options_.lines.contacts), new_level()),
      earlier_(static_cast<std::size_t>(options_.lines.contacts)) {}

// A device that prints edges prints none before the first one: its contacts are open until then.
LevelEdges Intake::new_level() const {
  return {options_.lines.threshold.value_or(0.5), options_.inverted, !parser_.has_all_levels()};
}

void Intake::refuse(const Line& line, const std::string& why) {
  ++counts_.bad_lines;
  std::string shown = line.text.substr(0, longest_shown);
  if (shown.size() < line.text.size()) shown += "...";
  sink_.problem(line.number, shown, why);
}

void Intake::take(std::string_view bytes, double arrival) {
  splitter_.take(
      bytes,
      [&](std::string_view text) {
        ++counts_.lines;
        take_line({splitter_.number(), std::string(text), parser_.parse(text), arrival});
      },
      [&](std::string_view begin) {
        refuse({splitter_.number() + 1, std::string(begin)}, "the line is longer than 4096 bytes");
      });
  flush();
}

void Intake::take_line(Line line) {
  using Kind = ParsedLine::Kind;
  const Kind kind = line.parsed.kind;
  if (kind == Kind::problem) return refuse(line, line.parsed.problem);
  if (stalled_) {
    stalled_ = false;
    sink_.notice("lines arrive again");
  }
  last_line_ = line.arrival;
  if (kind == Kind::header) header_again_ = any_session_;
  if (kind == Kind::header || kind == Kind::units) {
    if (const auto unit = parser_.time_unit(); unit && unit->seconds) {
      clock_.set_named_unit(*unit->seconds);
      if (kind == Kind::units && !options_.clock.unit)
        sink_.notice("times are in " + unit->text + ", as the row of units says");
    } else if (unit && !options_.clock.unit) {
      refuse(line, "times are in " + unit->text + "; say how long that is: --unit SECONDS");
    }
  }
  if (kind != Kind::levels) return;
  if (!options_.stamp_arrival) return take_timed(std::move(line));

  if (!connected_) begin_session();
  const double t = options_.clock.speed * line.arrival;
  const bool repeats = take_levels(line, t);
  latest_ = std::max(latest_.value_or(t), t);
  if (!line.parsed.time) {
    scatter_.add_untimed(line.arrival, repeats);
    return;
  }
  const DeviceClock::Reading reading = read_clock(line);
  if (!reading.problem.empty()) return;
  if (reading.order == DeviceClock::Order::falls) {
    scatter_.restart();
    clock_.restart();
  }
  clock_.accept(reading, line.arrival);
  scatter_.add_timed(reading.t, t);
}

void Intake::take_timed(Line line) {
  using Order = DeviceClock::Order;
  line.reading = read_clock(line);
  if (!line.reading.problem.empty()) return refuse(line, line.reading.problem);
  if (!connected_) {
    if (line.reading.order == Order::falls) {
      restart_clock(line.reading.t);
      line.reading = read_clock(line);
    }
    begin_session();
    return use(line);
  }
  if (line.reading.order != Order::follows) return hold(std::move(line));
  // A line that seemed to lie in the future is right if a later one is later.
  if (!held_.empty() && held_.front().reading.order == Order::leaps &&
      line.reading.t >= held_.back().reading.t) {
    release_held(false);
    line.reading = read_clock(line);
  }
  drop_held();
  use(line);
}

void Intake::hold(Line line) {
  const DeviceClock::Reading& reading = line.reading;
  if (!held_.empty() &&
      (held_.back().reading.order != reading.order || reading.t < held_.back().reading.t)) {
    drop_held();
  }
  held_.push_back(std::move(line));
  const DeviceClock::Reading& first = held_.front().reading;
  if (first.order == DeviceClock::Order::leaps) {
    if (held_.size() >= enough_lines) release_held(false);
    return;
  }
  const double step =
      std::isinf(options_.clock.speed) ? least_restart : least_restart * options_.clock.speed;
  const bool large = *clock_.last() - first.t > step;
  if (held_.size() >= (large ? enough_lines : enough_lines_of_a_small_step) || header_again_) {
    release_held(true);
  }
}

// The lines that were held agree with each other.
void Intake::release_held(bool restarted) {
  std::vector<Line> held = std::exchange(held_, {});
  if (restarted) {
    restart_clock(held.front().reading.t);
    begin_session();
  }
  for (Line& line : held) {
    line.reading = read_clock(line);
    if (!line.reading.problem.empty()) {
      refuse(line, line.reading.problem);
    } else {
      use(line);
    }
  }
}

// A later line follows the last one that was accepted: those between are damaged or late.
void Intake::drop_held() {
  for (const Line& line : std::exchange(held_, {})) {
    const bool falls = line.reading.order == DeviceClock::Order::falls;
    refuse(line, "the time is " + seconds_text(std::abs(line.reading.t - *clock_.last())) +
                     (falls ? " before" : " after") +
                     " that of the line before, and no other line agrees");
  }
}

void Intake::use(const Line& line) {
  const double t = line.reading.t;
  if (!any_session_) begin_session();
  if (line.reading.wraps) ++counts_.wraps;
  header_again_ = false;
  clock_.accept(line.reading, line.arrival);
  if (!std::isinf(options_.clock.speed)) {
    scatter_.add_timed(t, options_.clock.speed * line.arrival);
    check_rate(t, line.arrival);
  }
  take_levels(line, t);
  if (line.parsed.sample) take_sample(line);
  latest_ = std::max(latest_.value_or(t), t);
}

bool Intake::take_levels(const Line& line, double t) {
  if (!any_session_) begin_session();
  bool repeats = true;
  for (const ContactLevel& of : line.parsed.levels) {
    ContactEdge edge{t, of.contact, EdgeKind::impact};
    if (of.level) {
      LevelEdges& level = levels_[static_cast<std::size_t>(of.contact)];
      // Before its first edge a level is low, as in lines of one contact.
      if (of.edge && !level.high())
        level = {options_.lines.threshold.value_or(0.5), options_.inverted, true};
      const bool first = !level.high();
      const LevelChange change = level.take(*of.level);
      const bool starts_closed = first && *level.high() && options_.impacts == Edge::closed;
      if (change == LevelChange::none && !starts_closed) continue;
      const bool rises = change != LevelChange::falls;
      repeats = false;
      if (options_.impacts == Edge::closed) {
        edge.kind = rises ? EdgeKind::closes : EdgeKind::opens;
      } else if (options_.impacts != Edge::both && rises != (options_.impacts == Edge::rising)) {
        continue;
      }
    }
    repeats = false;
    const bool late = t < stream_.now();
    if (const std::string why = stream_.take(edge); why.empty()) {
      ++counts_.edges;
    } else {
      if (late) ++counts_.late_edges;
      refuse(line, late ? why + "; a larger --latency waits longer for lines" : why);
    }
  }
  return repeats;
}

void Intake::take_sample(const Line& line) {
  const bool first = !grid_.t0();
  const InputGrid::Place place = grid_.take(machine_time(options_.input.clock, line.reading.t));
  if (!place.problem.empty()) {
    ++counts_.bad_samples;
    return refuse(line, place.problem);
  }
  if (first) sink_.start_input(*grid_.t0(), grid_.dt());
  if (place.missing > 0 && !std::exchange(said_missing_, true)) {
    sink_.notice("samples of the input are missing before line " + std::to_string(line.number) +
                 " (" + std::to_string(place.missing) +
                 " of them): observers interpolate them linearly; later ones are counted");
  }
  counts_.missing_samples += place.missing;
  ++counts_.samples;
  sink_.sample(place.k, options_.input.unit * *line.parsed.sample);
}

void Intake::begin_session() {
  if (any_session_) {
    flush();
    for (int i = 0; i < options_.lines.contacts; ++i) {
      earlier_[static_cast<std::size_t>(i)] = edge_counts(i);
    }
    stream_ = ContactStream(options_.lines.contacts, options_.rules);
    levels_.assign(levels_.size(), new_level());
    scatter_.restart();
    first_.reset();
    grid_.restart();
    said_missing_ = false;
    sink_.new_session();
  }
  any_session_ = connected_ = true;
  header_again_ = false;
  ++counts_.sessions;
}

// Finds a wrong unit, as of a header that was missed.
void Intake::check_rate(double t, double arrival) {
  constexpr double long_enough = 1.0;  // s
  constexpr double largest_factor = 2.0;
  if (!first_) first_ = {t, arrival};
  const double elapsed = arrival - first_->second;
  if (said_rate_ || elapsed < long_enough) return;
  said_rate_ = true;
  const double rate = (t - first_->first) / (options_.clock.speed * elapsed);
  if (rate < largest_factor && rate > 1.0 / largest_factor) return;
  std::array<char, 160> text;
  std::snprintf(
      text.data(), text.size(),
      "the device's time runs %.3g times as fast as this host's clock: --unit says the unit "
      "of its times, --speed its pace",
      rate);
  sink_.notice(text.data());
}

// The device's time goes on from `t`.
void Intake::restart_clock(double t) {
  constexpr double counter_end = 4294967296.0, close_to_it = 0.95;
  std::string text = "the device's time went back from " + seconds_text(*clock_.last()) + " to " +
                     seconds_text(t) + ": it was restarted, and a new session begins";
  const double count = difference_in(clock_.last_value(), {}, {1, 0});
  if (options_.clock.counter_bits == 0 && count > close_to_it * counter_end && count < counter_end)
    text += " (if its counter of 32 bits has wrapped: --counter-bits 32)";
  if (options_.clock.offset.mantissa != 0) {
    text += "; --offset is of the old clock, and t = 0 is now the device's zero";
    options_.clock.offset = {0, 0};
  }
  sink_.notice(text);
  flush();
  clock_.restart();
}

// Gives all that is known after the last line.
void Intake::flush() {
  if (latest_) stream_.advance(*std::exchange(latest_, std::nullopt));
  if (!any_session_ || !(stream_.watermark() >= 0.0)) return;
  const std::vector<ContactEvent> events = stream_.take_events();
  sink_.events(events, std::min(stream_.watermark(), options_.rules.duration));
}

void Intake::pass(double now) {
  if (std::isinf(options_.clock.speed) || !connected_) return;
  if (!stalled_ && now - last_line_.value_or(0.0) > options_.stall) {
    stalled_ = true;
    ++counts_.stalls;
    sink_.notice("no line for " + seconds_text(options_.stall) +
                 (any_session_ ? ": the watermark stops, and estimates settle no further until a "
                                 "line arrives"
                               : ": nothing is published until one arrives"));
  }
  if (stalled_ || !any_session_) return;
  if (options_.stamp_arrival) {
    stream_.advance(options_.clock.speed * now);
  } else if (const auto present = clock_.now(now)) {
    stream_.advance(*present - options_.clock.speed * options_.clock.latency);
  }
  flush();
}

void Intake::disconnect() {
  if (!splitter_.begun().empty())
    refuse({splitter_.number() + 1, std::string(splitter_.begun())}, "the line is not complete");
  splitter_.clear();
  if (clock_.last()) drop_held();
  flush();
  if (any_session_) connected_ = false;
}

void Intake::finish() {
  disconnect();
  if (!any_session_) return;
  stream_.finish();
  flush();
}

EdgeCounts Intake::edge_counts(int contact) const {
  EdgeCounts sum = earlier_[static_cast<std::size_t>(contact)];
  return sum += stream_.counts(contact);
}

EdgeCounts Intake::edge_counts() const {
  EdgeCounts sum;
  for (int i = 0; i < options_.lines.contacts; ++i) sum += edge_counts(i);
  return sum;
}

}  // namespace sprag
