#include <Eigen/Core>
#include <cmath>
#include <limits>
#include <numbers>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "tools/report/sections.h"

namespace sprag::report {
namespace {

using Rows = std::vector<std::vector<std::string>>;

std::string text_of(const Harmonic& harmonic) {
  std::string text =
      rounded(harmonic.amplitude, 6) + " cos(" + rounded(harmonic.frequency, 8) + " t";
  if (harmonic.phase != 0.0) {
    text += (harmonic.phase < 0.0 ? " - " : " + ") + rounded(std::abs(harmonic.phase), 6);
  }
  return text + ")";
}

std::string hertz(double frequency) {
  return rounded(frequency / (2.0 * std::numbers::pi), 4) + " Hz";
}

// Undamped natural frequencies of K - omega^2 M.
std::string frequencies(const Model& model) {
  constexpr Eigen::Index most = 8;
  const Eigen::VectorXd squares = eigenpairs(model.K, model.M).values;
  std::string text;
  for (Eigen::Index i = 0; i < std::min(squares.size(), most); ++i) {
    text += (i > 0 ? ", " : "") + hertz(std::sqrt(std::max(squares[i], 0.0)));
  }
  return text + (squares.size() > most ? ", …" : "");
}

std::string list(const Eigen::VectorXd& values) {
  constexpr Eigen::Index most = 8;
  std::string text;
  for (Eigen::Index i = 0; i < std::min(values.size(), most); ++i) {
    text += (i > 0 ? ", " : "") + rounded(values[i], 5);
  }
  return text + (values.size() > most ? ", …" : "");
}

void add_machine(const Scene& scene, Rows& rows) {
  const Model& model = scene.model;
  if (scene.beam) {
    const Beam& beam = *scene.beam;
    rows.push_back(
        {"machine", "clamped-free Euler-Bernoulli beam, " + std::to_string(beam.modes) + " modes"});
    rows.push_back({"length", rounded(beam.length, 6) + " m"});
    rows.push_back({"bending stiffness EI", rounded(beam.bending_stiffness, 6) + " N m²"});
    rows.push_back({"mass per length", rounded(beam.mass_per_length, 6) + " kg/m"});
    if (beam.damping_ratio.size() > 0) {
      rows.push_back({"damping ratios", list(beam.damping_ratio)});
    } else {
      rows.push_back({"damping d", rounded(beam.damping, 6) + " N s/m²"});
    }
  } else {
    rows.push_back({"machine", "general system M, C, K"});
    rows.push_back({"coordinates", std::to_string(model.coordinates())});
  }
  rows.push_back({"natural frequencies", frequencies(model)});
  rows.push_back({"impact law", model.law == ImpactLaw::poisson ? "Poisson" : "Newton"});
  if (scene.frame && scene.frame->motion.amplitude != 0.0) {
    rows.push_back({"motion of the frame e(t) [m]",
                    text_of(scene.frame->motion) + ", " + hertz(scene.frame->motion.frequency)});
  }
  for (std::size_t i = 0; i < model.forces.size(); ++i) {
    const Force& force = model.forces[i];
    std::string text;
    if (force.constant != 0.0) text += rounded(force.constant, 6);
    if (force.harmonic.amplitude != 0.0) {
      text += (text.empty() ? "" : " + ") + text_of(force.harmonic) + ", " +
              hertz(force.harmonic.frequency);
    }
    if (force.input) text += std::string(text.empty() ? "" : " + ") + "a recorded input";
    if (!text.empty()) {
      rows.push_back({"force " + std::to_string(i + 1) + ", times its direction", text});
    }
  }
}

void add_prior(const Prior& prior, Rows& rows) {
  rows.push_back({"jitter of event times", rounded(prior.jitter, 4) + " s"});
  if (prior.uncertainty.size() > 0) {
    rows.push_back({"uncertainty of the start, as energies", list(prior.uncertainty)});
  }
  if (prior.sigma) {
    rows.push_back({"sigma of the start, q", list(prior.sigma->q)});
    rows.push_back({"sigma of the start, u", list(prior.sigma->u)});
  }
  if (prior.drift > 0.0) {
    rows.push_back({"drift, energy per unit of time", rounded(prior.drift, 4)});
  }
  const Tolerance& tolerance = prior.tolerance;
  const auto add = [&](const char* name, double value, const char* unit) {
    if (value > 0.0) {
      rows.push_back({std::string("tolerance of ") + name, rounded(value, 4) + unit});
    }
  };
  add("event times", tolerance.time, " s");
  add("restitutions", tolerance.restitution, "");
  add("stiffness, relative", tolerance.stiffness, "");
  add("damping, relative", tolerance.damping, "");
  add("forces", tolerance.force, "");
  add("clearances", tolerance.clearance, " m");
  const ParameterUncertainty& parameters = prior.parameters;
  for (Eigen::Index k = 0; k < parameters.size(); ++k) {
    const auto i = static_cast<std::size_t>(k);
    rows.push_back(
        {"sigma of " + parameters.keys[i],
         rounded(parameters.sigma[k], 4) + (parameters.consider[i] ? ", considered only" : "")});
  }
}

TextTable contacts_of(const Scene& scene) {
  TextTable table{"Contacts", {"contact", "clearance [m]", "restitution", "support"}, {}};
  const bool beam = !scene.positions.empty();
  if (beam) table.head.insert(table.head.begin() + 1, "position [m]");
  for (std::size_t i = 0; i < scene.model.contacts.size(); ++i) {
    const Contact& contact = scene.model.contacts[i];
    std::string support = "rests";
    if (contact.motion.amplitude != 0.0) support = "moves by " + text_of(contact.motion) + " m";
    if (contact.input) support += ", and by a recorded input";
    std::vector<std::string> row{std::to_string(i + 1), rounded(contact.clearance, 6),
                                 rounded(contact.restitution, 6), support};
    if (beam) {
      row.insert(row.begin() + 1,
                 i < scene.positions.size() ? rounded(scene.positions[i], 6) : std::string());
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

}  // namespace

Section machine_section(const Scene& scene) {
  Section section{"Machine and scene", {}};
  TextTable table{"Scene " + scene.name, {"quantity", "value"}, {}};
  add_machine(scene, table.rows);
  add_prior(scene.prior, table.rows);
  section.blocks.emplace_back(std::move(table));
  section.blocks.emplace_back(contacts_of(scene));
  for (const std::string& remark : scene.remarks) section.blocks.emplace_back(Paragraph{remark});
  return section;
}

}  // namespace sprag::report
