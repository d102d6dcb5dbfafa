#include "tools/plot/figure.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "sprag/detail/files/input_file.h"
#include "sprag/model.h"

namespace sprag::plot {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t most_panels = 6;
constexpr std::size_t most_modes = 3;

std::string numbered(const char* name, std::size_t from_zero) {
  return std::string(name).append(std::to_string(from_zero + 1));
}

std::size_t coordinates(const Table& states) {
  std::size_t f = 0;
  while (states.column(numbered("q", f)) != nullptr) ++f;
  return f;
}

bool any_finite(const std::vector<double>& values) {
  return std::any_of(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
}

bool at_ticks(const Table& table) {
  return table.kind == TableKind::states || table.kind == TableKind::energy;
}

// Whether a column is a coordinate, which has a panel of its own, or an innovation.
bool is_coordinate_or_innovation(const std::string& name) {
  const bool letter = name[0] == 'q' || name[0] == 'u';
  return name == "filter_gap" ||
         (letter && name.find_first_not_of("0123456789", 1) == std::string::npos);
}

// Columns of quantities with names given by users: outputs of the scene, then parameters by their
// keys, which contain a dot. In an estimate each has a sigma. The states of a master have only
// these after its state.
std::vector<std::string> named_quantities(const std::vector<Table>& tables) {
  std::vector<std::string> names;
  for (const Table& table : tables) {
    if (table.kind != TableKind::states) continue;
    const bool estimate = is_estimate(table);
    for (std::size_t i = 2 + 2 * coordinates(table); i < table.names.size(); ++i) {
      const std::string& name = table.names[i];
      if (estimate && table.column("sigma_" + name) == nullptr) continue;
      if (name.empty() || is_coordinate_or_innovation(name)) continue;
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  }
  std::stable_partition(names.begin(), names.end(), [](const std::string& name) {
    return name.find('.') == std::string::npos;
  });
  return names;
}

// A run has one colour in all panels, identified by its label, even if it consists of several
// files.
class Colours {
 public:
  explicit Colours(const std::vector<Table>& tables) {
    for (const Table& table : tables) {
      if (table.kind == TableKind::states && !is_estimate(table)) {
        of_.emplace(table.label, Colour::black);
      }
    }
    const std::vector<Colour> order{Colour::vermilion, Colour::purple, Colour::sky, Colour::grey};
    std::size_t next = 0;
    for (const Table& table : tables) {
      if (table.kind == TableKind::events || of_.contains(table.label)) continue;
      of_.emplace(table.label, order[std::min(next++, order.size() - 1)]);
    }
  }

  Colour of(const Table& table) const { return of_.at(table.label); }

 private:
  std::map<std::string, Colour> of_;
};

// Adds a curve whose points `is_part` selects as a curve of its own. The points next to a change
// belong to both.
template <class IsPart>
void split_off(Curve& curve, const Curve& whole, const std::string& what, Line line, IsPart is_part,
               Panel& panel) {
  Curve part{whole.title + what, whole.colour, line, whole.t, whole.y};
  const std::size_t n = whole.y.size();
  bool any = false;
  for (std::size_t i = 0; i < n; ++i) {
    const bool beside = (i > 0 && is_part(i - 1)) || (i + 1 < n && is_part(i + 1));
    any = any || is_part(i);
    if (is_part(i)) {
      curve.y[i] = nan;
    } else if (!beside) {
      part.y[i] = nan;
    }
  }
  if (any) panel.curves.push_back(std::move(part));
}

// Splits the curve of an estimate. The parts where it penetrates a support (column `penetrating`)
// are dashed, those where the replica is shown in place of the filter (`from_filter`) are dotted.
void add_parted(Curve curve, const Table& table, Panel& panel) {
  const auto* penetrating = table.column("penetrating");
  const auto* from_filter = table.column("from_filter");
  const auto inside = [&](std::size_t i) {
    return penetrating != nullptr && (*penetrating)[i] > 0.5;
  };
  const auto replica = [&](std::size_t i) {
    return from_filter != nullptr && (*from_filter)[i] < 0.5 && !inside(i);
  };
  const Curve whole = curve;
  const std::size_t at = panel.curves.size();
  split_off(curve, whole, ", inside a support", Line::dashed, inside, panel);
  split_off(curve, whole, ", replica shown", Line::dotted, replica, panel);
  panel.curves.insert(panel.curves.begin() + static_cast<std::ptrdiff_t>(at), std::move(curve));
}

// y with a band of `times` half-widths, where the half-width is finite.
Band band_about(std::string title, Colour colour, const std::vector<double>& t,
                const std::vector<double>& y, const std::vector<double>& width, double times) {
  Band band{std::move(title), colour, t, y, y};
  for (std::size_t i = 0; i < y.size(); ++i) {
    const bool known = std::isfinite(width[i]);
    band.low[i] = known ? y[i] - times * width[i] : nan;
    band.high[i] = known ? y[i] + times * width[i] : nan;
  }
  return band;
}

// Adds a column of one run with its bands to a panel.
void add_curve(const Table& table, Colour colour, const std::vector<double>& t,
               std::vector<double> y, const std::string& name, Panel& panel) {
  if (const auto* bound = table.column("bound_" + name)) {
    panel.bands.push_back(
        band_about("guaranteed, of " + table.label, Colour::grey, t, y, *bound, 1.0));
  }
  if (const auto* sigma = table.column("sigma_" + name)) {
    panel.bands.push_back(band_about("± 2 sigma of " + table.label, colour, t, y, *sigma, 2.0));
  }
  const Line line = is_estimate(table) ? Line::solid : Line::thick;
  Curve curve{table.label, colour, line, t, std::move(y)};
  add_parted(std::move(curve), table, panel);
}

std::vector<double> gap_over_time(const Table& states, const Contact& contact) {
  const auto f = static_cast<std::size_t>(contact.w.size());
  if (coordinates(states) != f) {
    throw InputError(states.label + ": has " + std::to_string(coordinates(states)) +
                     " coordinates; the scene has " + std::to_string(f));
  }
  std::vector<const std::vector<double>*> q;
  for (std::size_t i = 0; i < f; ++i) q.push_back(states.column(numbered("q", i)));
  const std::vector<double>& t = *states.column("t");
  std::vector<double> g(t.size());
  Eigen::VectorXd at(contact.w.size());
  for (std::size_t k = 0; k < t.size(); ++k) {
    for (std::size_t i = 0; i < f; ++i) at[static_cast<Eigen::Index>(i)] = (*q[i])[k];
    g[k] = gap(contact, at, t[k]);
  }
  return g;
}

std::size_t contacts_of(const Table& table) {
  double most = 0.0;
  for (const double contact : *table.column("contact")) most = std::max(most, contact);
  return static_cast<std::size_t>(most);
}

std::vector<Panel::Contacts> contacts_over_time(const std::vector<Table>& tables, double end) {
  std::vector<Panel::Contacts> contacts;
  for (const Table& table : tables) {
    if (table.kind != TableKind::events) continue;
    contacts.resize(std::max(contacts.size(), contacts_of(table)));
    std::vector<double> since(contacts.size(), nan);
    const std::vector<double>& t = *table.column("t");
    const std::vector<double>& contact = *table.column("contact");
    const std::vector<double>& closed = *table.column("closed");
    for (std::size_t k = 0; k < t.size(); ++k) {
      if (!(contact[k] >= 1.0)) continue;
      const auto i = static_cast<std::size_t>(contact[k]) - 1;
      if (closed[k] > 0.5) {
        since[i] = t[k];
      } else if (since[i] == t[k]) {
        contacts[i].pulses.push_back(t[k]);
        since[i] = nan;
      } else if (!std::isnan(since[i])) {
        contacts[i].closed.emplace_back(since[i], t[k]);
        since[i] = nan;
      }
    }
    for (std::size_t i = 0; i < contacts.size(); ++i) {
      if (!std::isnan(since[i])) contacts[i].closed.emplace_back(since[i], end);
    }
  }
  return contacts;
}

// alpha of C = alpha M. Without impacts the error energy then decays as exp(-alpha t). Nullopt for
// other damping.
std::optional<double> decay_rate(const Model& model) {
  const double alpha = model.C.trace() / model.M.trace();
  const bool proportional =
      (model.C - alpha * model.M).cwiseAbs().maxCoeff() <= 1e-12 * model.C.cwiseAbs().maxCoeff();
  return alpha > 0.0 && proportional ? std::optional(alpha) : std::nullopt;
}

Panel named(std::string name, std::string y_label) {
  Panel panel;
  panel.name = std::move(name);
  panel.y_label = std::move(y_label);
  return panel;
}

// Selection of the panels shown by default: as many single quantities as are legible, all
// summaries.
enum class Rank { single, summary, unasked };

struct RankedPanel {
  Panel panel;
  Rank rank;
};

class Panels {
 public:
  Panels(const std::vector<Table>& tables, const Scene* scene, double end)
      : tables_(tables),
        scene_(scene),
        colours_(tables),
        contacts_(contacts_over_time(tables, end)) {}

  std::vector<RankedPanel> all() const {
    std::vector<RankedPanel> panels;
    const auto add = [&panels](Panel panel, Rank rank) {
      if (!panel.curves.empty() || !panel.contacts.empty() || !panel.dots.empty())
        panels.push_back({std::move(panel), rank});
    };
    const auto add_coordinates = [&](const char* letter, Rank rank) {
      std::size_t most = 0;
      each(TableKind::states,
           [&](const Table& states) { most = std::max(most, coordinates(states)); });
      for (std::size_t i = 0; i < most; ++i) add(of_column(numbered(letter, i)), rank);
    };
    for (const std::string& name : named_quantities(tables_)) add(of_column(name), Rank::single);
    const std::size_t named = panels.size();
    if (scene_ != nullptr) {
      for (std::size_t i = 0; i < scene_->model.contacts.size(); ++i) add(of_gap(i), Rank::single);
    }
    const bool gaps = panels.size() > named;
    if (!gaps) add_coordinates("q", Rank::single);
    add(of_contacts(), Rank::summary);
    add(of_impacts("impulse", "impulse", "N s"), Rank::summary);
    add(of_energy(), Rank::summary);
    add(of_impacts("velocity_before", "gap velocity before", "m/s"), Rank::unasked);
    add(of_impacts("velocity_after", "gap velocity after", "m/s"), Rank::unasked);
    if (gaps) add_coordinates("q", Rank::unasked);
    add_coordinates("u", Rank::unasked);
    return panels;
  }

 private:
  template <class Use>
  void each(TableKind kind, Use use) const {
    for (const Table& table : tables_) {
      if (table.kind == kind) use(table);
    }
  }

  Panel of_gap(std::size_t i) const {
    const std::string name = numbered("g", i);
    Panel panel = named(name, "");
    each(TableKind::states, [&](const Table& states) {
      add_curve(states, colours_.of(states), *states.column("t"),
                gap_over_time(states, scene_->model.contacts[i]), panel.name, panel);
    });
    if (i < contacts_.size()) {
      panel.impacts = contacts_[i].pulses;
      for (const auto& [from, to] : contacts_[i].closed) panel.impacts.push_back(from);
      std::sort(panel.impacts.begin(), panel.impacts.end());
    }
    set_readable_unit(panel, scene_->model.contacts.size() == 1 ? "gap g" : "gap " + name, "m");
    return panel;
  }

  Panel of_column(const std::string& name) const {
    Panel panel = named(name, name);
    each(TableKind::states, [&](const Table& states) {
      if (const auto* y = states.column(name)) {
        add_curve(states, colours_.of(states), *states.column("t"), *y, name, panel);
      }
    });
    return panel;
  }

  Panel of_contacts() const {
    Panel panel = named("contacts", "contact");
    panel.contacts = contacts_;
    return panel;
  }

  // A column of an impacts table, one set of dots for each contact.
  Panel of_impacts(const std::string& column, const std::string& quantity,
                   const std::string& unit) const {
    Panel panel = named(column, quantity + " [" + unit + "]");
    each(TableKind::impacts, [&](const Table& impacts) {
      const auto* y = impacts.column(column);
      const auto* sigma = impacts.column("sigma_" + column);
      if (y == nullptr || sigma == nullptr) return;
      const std::vector<double>& t = *impacts.column("t");
      const std::vector<double>& contact = *impacts.column("contact");
      for (int i = 1; i <= static_cast<int>(contacts_of(impacts)); ++i) {
        Dots dots;
        dots.title = impacts.label + ", contact " + std::to_string(i);
        dots.colour = colours_.of(impacts);
        dots.shape = i - 1;
        for (std::size_t k = 0; k < t.size(); ++k) {
          if (contact[k] != i || !std::isfinite((*y)[k])) continue;
          dots.t.push_back(t[k]);
          dots.y.push_back((*y)[k]);
          dots.sigma.push_back((*sigma)[k]);
        }
        if (!dots.t.empty()) panel.dots.push_back(std::move(dots));
      }
    });
    // A prefix before a product of units would not be read.
    if (unit.find(' ') == std::string::npos) set_readable_unit(panel, quantity, unit);
    return panel;
  }

  Panel of_energy() const {
    Panel panel = named("V", "error energy [J]");
    panel.logarithmic = true;
    panel.whole_run = true;
    const Table* first = nullptr;
    const auto title = [this](TableKind kind, const std::string& text, const Table& of) {
      const auto several = std::count_if(tables_.begin(), tables_.end(), [&](const Table& table) {
        return table.kind == kind && (kind == TableKind::energy || table.column("B") != nullptr);
      });
      return several > 1 ? text + ", " + of.label : text;
    };
    each(TableKind::energy, [&](const Table& energy) {
      panel.curves.push_back({title(TableKind::energy, "V", energy), colours_.of(energy),
                              first == nullptr ? Line::thick : Line::solid, *energy.column("t"),
                              *energy.column("V")});
      if (first == nullptr) first = &energy;
    });
    if (first != nullptr) add_modes(*first, panel);
    each(TableKind::states, [&](const Table& states) {
      if (const auto* B = states.column("B"); B != nullptr && any_finite(*B)) {
        panel.curves.push_back({title(TableKind::states, "B, bound on the replica's V", states),
                                colours_.of(states), Line::dashed, *states.column("t"), *B});
      }
    });
    if (first != nullptr) add_damping(*first, panel);
    return panel;
  }

  // V_i, eq. (24) of Baumann & Leine 2014, of the first run.
  static void add_modes(const Table& energy, Panel& panel) {
    const std::vector<Colour> colours{Colour::blue, Colour::green, Colour::orange};
    for (std::size_t i = 0; i < most_modes; ++i) {
      if (const auto* V = energy.column(numbered("V", i))) {
        panel.curves.push_back({numbered("V", i).append(" of mode ").append(std::to_string(i + 1)),
                                colours[i], Line::thin, *energy.column("t"), *V});
      }
    }
  }

  void add_damping(const Table& energy, Panel& panel) const {
    const std::optional<double> rate = scene_ ? decay_rate(scene_->model) : std::nullopt;
    const std::vector<double>& t = *energy.column("t");
    if (!rate || t.empty()) return;
    const double V = energy.column("V")->front();
    panel.curves.push_back({"V falling by damping alone",
                            Colour::grey,
                            Line::dotted,
                            {t.front(), t.back()},
                            {V, V * std::exp(-*rate * (t.back() - t.front()))}});
  }

  const std::vector<Table>& tables_;
  const Scene* scene_;
  Colours colours_;
  std::vector<Panel::Contacts> contacts_;
};

[[noreturn]] void unknown_panel(const std::string& name, const std::vector<RankedPanel>& panels) {
  std::string text = name + " is nothing that these files show; choose ";
  for (std::size_t i = 0; i < panels.size(); ++i) {
    text += (i == 0 ? "" : i + 1 < panels.size() ? ", " : " or ") + panels[i].panel.name;
  }
  throw std::invalid_argument(text);
}

}  // namespace

void set_readable_unit(Panel& panel, const std::string& quantity, const std::string& unit) {
  double largest = 0.0;
  const auto extend = [&largest](const std::vector<double>& y) {
    for (const double value : y) {
      if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
    }
  };
  for (const Curve& curve : panel.curves) extend(curve.y);
  for (const Dots& dots : panel.dots) extend(dots.y);
  // Largest values below 0.1 of a unit are shown in the next smaller one.
  double factor = 1.0;
  std::string prefix;
  for (const char* smaller : {"m", "µ", "n", "p"}) {
    if (!(largest > 0.0) || factor * largest >= 0.1) break;
    factor *= 1e3;
    prefix = smaller;
  }
  panel.y_label = quantity + " [" + prefix + unit + "]";
  if (factor == 1.0) return;
  const auto scale = [factor](std::vector<double>& y) {
    for (double& value : y) value *= factor;
  };
  for (Curve& curve : panel.curves) scale(curve.y);
  for (Band& band : panel.bands) {
    scale(band.low);
    scale(band.high);
  }
  for (Dots& dots : panel.dots) {
    scale(dots.y);
    scale(dots.sigma);
  }
}

Figure make_figure(const std::vector<Table>& tables, const Scene* scene,
                   const FigureOptions& options, std::vector<std::string>& left_out) {
  Figure figure;
  figure.title = options.title.empty() && scene != nullptr ? scene->name : options.title;
  figure.from = std::numeric_limits<double>::infinity();
  figure.to = -figure.from;
  // The time axis follows tables at ticks if there are any: events do not show the length of a run.
  const bool ticks = std::any_of(tables.begin(), tables.end(), [](const Table& table) {
    return at_ticks(table) && !table.columns.front().empty();
  });
  for (const Table& table : tables) {
    const std::vector<double>& t = *table.column("t");
    if (t.empty() || (ticks && !at_ticks(table))) continue;
    figure.from = std::min(figure.from, t.front());
    figure.to = std::max(figure.to, t.back());
  }
  figure.from = std::max(figure.from, options.from);
  figure.to = std::min(figure.to, options.to);
  if (!(figure.from < figure.to)) throw InputError("there is nothing to show in this time");
  figure.zoom = options.zoom;

  std::vector<RankedPanel> panels = Panels(tables, scene, figure.to).all();
  if (options.show.empty()) {
    std::size_t single = 0;
    for (auto& [panel, rank] : panels) {
      if (rank == Rank::unasked) continue;
      if (rank == Rank::single && ++single > most_panels - 2) {
        left_out.push_back(panel.name);
      } else {
        figure.panels.push_back(std::move(panel));
      }
    }
  }
  for (const std::string& name : options.show) {
    const std::size_t before = figure.panels.size();
    // Several panels may have this name, since an output may have any name.
    for (const RankedPanel& each : panels) {
      if (each.panel.name == name) figure.panels.push_back(each.panel);
    }
    if (figure.panels.size() == before) unknown_panel(name, panels);
  }
  if (figure.panels.empty()) throw InputError("there is nothing to show in these files");
  return figure;
}

}  // namespace sprag::plot
