#include "tools/view/frame_text.h"

#include <array>
#include <cmath>

namespace sprag::view {
namespace {

void put(const char* name, const std::optional<Shown>& shown, JsonText& to) {
  to.key(name);
  if (!shown) {
    to.null();
    return;
  }
  to.open('{');
  to.member("tick", shown->tick);
  to.member("t", shown->t);
  to.key("q");
  to.list({shown->q.data(), static_cast<std::size_t>(shown->q.size())});
  to.key("u");
  to.list({shown->u.data(), static_cast<std::size_t>(shown->u.size())});
  to.close('}');
}

void put_drawn(const char* name, const std::vector<double>& heights, JsonText& to) {
  to.key(name);
  if (heights.empty()) {
    to.null();
  } else {
    to.drawn(heights);
  }
}

void put(const Suspect& suspect, JsonText& to) {
  to.open('{');
  to.member("t", suspect.t);
  to.member("contact", std::int64_t{suspect.contact} + 1);
  to.member("suspicion", sprag::name(suspect.suspicion));
  to.close('}');
}

void put(const ContactShown& contact, JsonText& to) {
  to.open('{');
  to.member("gap", contact.gap);
  to.member("sigma", contact.sigma);
  to.member("truth", contact.truth);
  to.member("y", contact.height);
  to.member("closed", contact.closed);
  to.member("events", static_cast<std::int64_t>(contact.events));
  to.member("last", contact.last);
  to.close('}');
}

void put_rows(const char* name, const Rows& rows, std::initializer_list<const char*> columns,
              JsonText& to) {
  to.key(name);
  to.open('{');
  to.key("t");
  to.list(rows.t);
  std::size_t c = 0;
  for (const char* column : columns) {
    to.key(column);
    to.drawn(rows.values[c++]);
  }
  to.close('}');
}

void put_times(const char* name, double p50, double p99, double max, JsonText& to) {
  to.key(name);
  to.open('{');
  to.member("p50", p50);
  to.member("p99", p99);
  to.member("max", max);
  to.close('}');
}

}  // namespace

void put_scene(const Watch& watch, std::optional<double> speed, JsonText& to) {
  const Scene& scene = watch.scene();
  const DrawnMachine& machine = watch.machine();
  to.open('{');
  to.member("name", std::string_view(scene.name));
  constexpr std::array kinds{"beam", "nodes", "chain"};
  to.member("machine", kinds[static_cast<std::size_t>(machine.kind())]);
  to.member("coordinates", std::int64_t{scene.model.coordinates()});
  to.key("places");
  to.drawn(machine.places());
  to.key("names");
  to.open('[');
  for (const std::string& name : machine.names()) to.value(std::string_view(name));
  to.close(']');
  to.key("stops");
  to.open('[');
  for (const DrawnStop& stop : machine.stops()) {
    to.open('{');
    to.member("across", stop.across);
    to.member("side", std::int64_t{stop.side});
    to.member("other", stop.other);
    to.close('}');
  }
  to.close(']');
  to.key("quantities");
  to.open('[');
  for (const Quantity& quantity : watch.quantities()) {
    to.open('{');
    to.member("name", std::string_view(quantity.name));
    to.member("label", std::string_view(quantity.label));
    to.close('}');
  }
  to.close(']');
  to.key("input");
  if (watch.input_label().empty()) {
    to.null();
  } else {
    to.value(std::string_view(watch.input_label()));
  }
  to.member("period", longest_period(scene.model));
  to.member("replay", speed.has_value());
  to.member("speed", speed);
  to.close('}');
}

void put_frame(const Frame& frame, JsonText& to) {
  to.open('{');
  to.key("session");
  if (frame.session) {
    to.value(
        std::string_view(std::to_string(*frame.session)));  // a double has too few digits for it
  } else {
    to.null();
  }
  to.member("badge", name(frame.badge));
  to.member("from_filter", frame.from_filter);
  to.member("penetration", frame.penetration);
  to.member("estimator", name(frame.estimator));
  put("now", frame.now, to);
  put("settled", frame.settled, to);
  put("truth", frame.truth, to);
  to.key("energy");
  if (frame.energy) {
    to.open('{');
    to.member("k", frame.energy->k);
    to.member("t", frame.energy->t);
    to.member("V", frame.energy->V);
    to.close('}');
  } else {
    to.null();
  }
  to.key("innovation");
  if (frame.innovation) {
    to.open('{');
    to.member("t", frame.innovation->t);
    to.member("contact", std::int64_t{frame.innovation->contact} + 1);
    to.member("ratio", frame.innovation->ratio);
    to.close('}');
  } else {
    to.null();
  }
  to.member("bound", frame.bound);
  to.member("speed", frame.speed);
  to.member("inconsistencies", frame.inconsistencies);
  to.key("suspect");
  if (frame.suspect) {
    put(*frame.suspect, to);
  } else {
    to.null();
  }
  to.key("machine");
  to.open('{');
  to.member("t", frame.t);
  to.member("base", frame.base);
  put_drawn("estimate", frame.estimate, to);
  put_drawn("sigma", frame.sigma, to);
  put_drawn("truth", frame.truth_shape, to);
  to.close('}');
  to.key("contacts");
  to.open('[');
  for (const ContactShown& contact : frame.contacts) put(contact, to);
  to.close(']');
  to.key("parameters");
  to.open('[');
  for (const ParameterShown& parameter : frame.parameters) {
    to.open('{');
    to.member("key", std::string_view(parameter.key));
    to.member("value", parameter.value);
    to.member("sigma", parameter.sigma);
    to.close('}');
  }
  to.close(']');
  to.close('}');
}

void put_curves(const Curves& curves, const Watch& watch, std::pair<double, double> extent,
                JsonText& to) {
  to.open('{');
  to.member("from", curves.window.from);
  to.member("to", curves.window.to);
  to.member("first", extent.first);
  to.member("last", extent.second);
  to.member("quantity", std::string_view(watch.quantities()[curves.quantity].name));
  put_rows("estimate", curves.estimate, {"low", "mean", "high"}, to);
  put_rows("guaranteed", curves.guaranteed, {"low", "high"}, to);
  put_rows("truth", curves.truth, {"value"}, to);
  put_rows("energy", curves.energy, {"V"}, to);
  put_rows("bound", curves.bound, {"B"}, to);
  put_rows("innovation", curves.innovation, {"ratio"}, to);
  put_rows("input", curves.input, {"value"}, to);
  to.key("raster");
  to.open('[');
  for (const std::vector<Closure>& closures : curves.closures) {
    to.open('[');
    for (const Closure& closure : closures) {
      to.value(closure.from);
      to.value(closure.to);
    }
    to.close(']');
  }
  to.close(']');
  to.key("penetrating");
  to.open('[');
  for (const Closure& stretch : curves.penetrating) {
    to.value(stretch.from);
    to.value(stretch.to);
  }
  to.close(']');
  to.key("suspects");
  to.open('[');
  for (const Suspect& suspect : curves.suspects) put(suspect, to);
  to.close(']');
  to.close('}');
}

void put_health(const Watch& watch, double age, JsonText& to) {
  to.open('{');
  to.key("observer");
  if (const auto& health = watch.health()) {
    to.open('{');
    to.member("age", age);
    constexpr std::array<const char*, 4> masters{"awaited", "heard", "silent", "ended"};
    constexpr std::array<const char*, 3> inputs{"none", "heard", "silent"};
    to.member("last", health->last == 1);
    to.member("master", masters[static_cast<std::size_t>(health->master)]);
    to.member("input", inputs[static_cast<std::size_t>(health->input)]);
    to.member("tick", health->tick);
    to.member("t", health->t);
    to.member("period", health->period);
    to.member("real_time_factor", health->real_time_factor);
    to.member("speed", health->speed);
    to.member("latencies", health->latencies);
    put_times("latency", health->latency_p50, health->latency_p99, health->latency_max, to);
    put_times("lateness", health->lateness_p50, health->lateness_p99, health->lateness_max, to);
    to.member("sessions", health->sessions);
    to.member("ticks", health->ticks);
    to.member("deadlines", health->deadlines);
    to.member("missed_deadlines", health->missed_deadlines);
    to.member("real_time_losses", health->real_time_losses);
    to.member("events", health->events);
    to.member("late_events", health->late_events);
    to.member("lost_events", health->lost_events);
    to.member("gaps", health->gaps);
    to.member("skipped_events", health->skipped_events);
    to.member("rollbacks", health->rollbacks);
    to.member("inconsistencies", health->inconsistencies);
    to.member("messages", health->messages);
    to.member("lost_messages", health->lost_messages);
    to.member("doubled_messages", health->doubled_messages);
    to.member("reordered_messages", health->reordered_messages);
    to.member("other_masters", health->other_masters);
    to.member("stale", health->stale);
    to.member("overflowed", health->overflowed);
    to.member("unsent", health->unsent);
    to.key("refused");
    to.open('{');
    for (std::size_t i = 0; i < health->cause.size(); ++i) {
      to.member(std::string_view(health->cause[i]), health->refused[i]);
    }
    to.close('}');
    to.close('}');
  } else {
    to.null();
  }
  const MessageCounts& messages = watch.messages();
  to.key("here");
  to.open('{');
  to.member("messages", messages.received);
  to.member("lost_messages", messages.lost);
  to.member("of_others", watch.of_others());
  to.member("misfits", watch.misfits());
  to.close('}');
  to.close('}');
}

}  // namespace sprag::view
