#include "sprag/detail/analysis/assessment.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <utility>

#include "sprag/detail/mechanics/master.h"

namespace sprag {
namespace {

using Eigen::Index;

constexpr double two_pi = 2.0 * std::numbers::pi;
// More closings of one contact in a period of the slowest mode are bursts. The shipped scenes have
// 97 at most, chatter included; stiff finite-element models of a beam with a stop some 500.
constexpr double most_closings_per_period = 200.0;
constexpr double vibrates = 1e-6;  // least omega of a mode that vibrates, relative to the largest
constexpr double periods = 50.0;
constexpr double time_constants = 3.0;
// Duration of the trial if nothing vibrates, in the scene's unit of time.
constexpr double trial_without_periods = 100.0;
// A linearly growing motion doubles from the trial's second quarter to its last.
constexpr double steady_growth = 1.7;
// Beyond it a double loses more than half of its digits.
constexpr double ill_conditioned = 1e6;

std::string list(const std::vector<int>& from_zero) {
  std::string text;
  for (std::size_t k = 0; k < from_zero.size(); ++k) {
    const bool last = k + 1 == from_zero.size();
    text += (k == 0 ? "" : (last ? " and " : ", ")) + std::to_string(from_zero[k] + 1);
  }
  return text;
}

std::string percent(double share) { return readable(100.0 * share) + " %"; }

/// "q = (0.7071, 0.7071)"; for many coordinates only the largest.
std::string motion_text(const Eigen::VectorXd& direction) {
  constexpr Index few = 6;
  Index most = 0;
  const double largest = direction.cwiseAbs().maxCoeff(&most);
  if (direction.size() > few) return "mostly q_" + std::to_string(most + 1);
  const double sign = direction[most] < 0.0 ? -1.0 : 1.0;
  std::string text;
  for (const double entry : direction) {
    const bool rounding = std::abs(entry) < 1e-12 * largest;
    text += (text.empty() ? "" : ", ") + readable(rounding ? 0.0 : sign * entry);
  }
  return "q = (" + text + ")";
}

std::string motions_text(const Eigen::MatrixXd& motions) {
  constexpr Index few = 3;
  std::string text;
  for (Index k = 0; k < std::min(motions.cols(), few); ++k) {
    text += (text.empty() ? "" : "; ") + motion_text(motions.col(k));
  }
  if (motions.cols() > few) text += "; and " + std::to_string(motions.cols() - few) + " more";
  return text;
}

Finding definite_finding(const std::string& id, const Definiteness& matrix,
                         const std::string& consequence, const std::string& change) {
  const std::string smallest = "smallest eigenvalue " + readable(matrix.smallest);
  if (matrix.definite()) return {id, true, true, id + " is positive definite, " + smallest};
  if (!matrix.semidefinite) {
    return {
        id, true, false, id + " is not positive semidefinite, " + smallest,
        "negative values (an inverted pendulum, a buckled beam, flutter) are not supported: the "
        "motion would grow between impacts. Otherwise correct " +
            id};
  }
  return {id, true, false,
          id + " is only semidefinite. " + consequence + ": " + motions_text(matrix.null_motions),
          change};
}

// Text about stops on either side of one coordinate.
std::string opposing_text(const OpposingStops& stops) {
  const std::string pair = "Contacts " + list({stops.i, stops.j}) + " are opposing stops with ";
  if (stops.room > 0.0) {
    return pair + "at least " + readable(stops.room) +
           " between them: they cannot close together. ";
  }
  return pair + "no room between them at times (" + readable(stops.room) +
         "): they may close together. ";
}

// Eq. (17): the remaining error c satisfies K c = W (mean contact force). In a time window with all
// contacts open the right side is zero for any rank of W.
Finding dependent_directions(const Assessment& a, int contacts) {
  const std::string rank = "W has rank " + std::to_string(a.W.rank) + " with " +
                           std::to_string(contacts) + " contacts: the directions of contacts " +
                           list(a.W.dependent) + " are linearly dependent. ";
  std::string checked;
  for (const OpposingStops& stops : a.opposing) checked += opposing_text(stops);
  const Trial& trial = a.trial;
  if (!trial.error.empty() || !(trial.longest_open > 0.0)) {
    return {"W", true, false,
            rank + checked +
                "The theorem needs independent directions, or time windows in which "
                "all contacts are open, and the trial ends without such a window",
            "leave out or turn one of these contacts, or excite the machine so that all of them "
            "open at once, again and again"};
  }
  const std::string condition = "time windows in which all contacts are open recur";
  return {.id = "W",
          .what = "provided that " + condition +
                  ": in them K c = 0 follows from eq. (17) for the error c that is left, and the "
                  "directions need not be independent. " +
                  rank + checked + "In the last quarter of the trial all contacts are open " +
                  percent(trial.open_share) + " of the time, for up to " +
                  readable(trial.longest_open) + " at once",
          .provided = condition};
}

Finding directions_finding(const Assessment& a, int contacts) {
  const Directions& W = a.W;
  if (contacts == 0) return {"W", true, true, "no contacts"};
  const std::string m = std::to_string(contacts);
  if (W.rank < contacts) return dependent_directions(a, contacts);
  const std::string what = "W has full column rank " + m + ", condition number " +
                           readable(W.condition) + " in the metric M^-1, columns normalised";
  const bool ill = W.condition > ill_conditioned;
  return {"W", true, true, what,
          ill ? "the directions are nearly dependent: impulses lose digits" : ""};
}

// A condition of the theorem that a trial without any time does not show.
Finding not_shown(const std::string& id, const std::string& condition) {
  return {.id = id,
          .what = "provided that " + condition + ": the trial ends at its start and shows nothing",
          .provided = condition};
}

Finding contacts_open_again(const Trial& trial) {
  if (trial.contacts.empty()) return {"A1", true, true, "no contacts"};
  if (!(trial.duration > 0.0)) return not_shown("A1", "each contact opens again and again");
  std::vector<int> permanent;
  std::string shares;
  for (std::size_t i = 0; i < trial.contacts.size(); ++i) {
    const ContactUse& use = trial.contacts[i];
    if (use.last_share >= 1.0) permanent.push_back(static_cast<int>(i));
    shares += (i == 0 ? "" : ", ") + percent(use.share);
  }
  const std::string seen = "in a trial of " + readable(trial.duration) + " units of time";
  if (!permanent.empty()) {
    const bool one = permanent.size() == 1;
    return {"A1", true, false,
            "contact" + std::string(one ? " " : "s ") + list(permanent) + (one ? " is" : " are") +
                " closed throughout the last quarter of the trial (" + readable(trial.duration) +
                " units of time). The theorem needs contacts that open again and again",
            "excite the machine, so that the contact opens again and again; V stalls where it "
            "stays closed"};
  }
  return {"A1", true, true,
          "no contact stays closed " + seen + " (sustained contact: " + shares +
              " of the time): each opens again, as far as a trial can show"};
}

Finding bounded_motion(const Assessment& a) {
  const Trial& trial = a.trial;
  if (!(trial.duration > 0.0)) return not_shown("A2", "the motion stays bounded");
  // A transient to a steady state grows, too.
  const bool long_enough =
      trial.duration == trial.planned &&
      (a.slow_root == 0.0 || -a.slow_root * trial.duration >= 0.9 * time_constants);
  const std::string seen = readable(trial.duration) + " units of time";
  if (long_enough && trial.growth > steady_growth) {
    return {"A2", true, false,
            "the motion still grows after " + seen + ": " + readable(trial.growth) +
                " times from the second quarter to the last",
            "where the machine has a stiffness, damping or smaller force, give it to the scene"};
  }
  return {"A2", true, true,
          "the forcing is bounded, and the motion shows no steady growth in " + seen +
              ": bounded, as far as a trial can show"};
}

// Two stops on either side of one coordinate with room between them never close together.
bool never_together(const Assessment& a, int contacts) {
  return contacts == 2 && !a.opposing.empty() && a.opposing[0].room > 0.0;
}

Finding monotone_law(const Assessment& a, int contacts) {
  const Monotonicity& law = a.monotonicity;
  const bool newton = a.law == ImpactLaw::newton;
  const std::string name = newton ? "Newton's" : "Poisson's";
  if (contacts < 2) {
    return {"A3", true, true, "one contact: Newton's and Poisson's law coincide and are monotone"};
  }
  if (never_together(a, contacts)) {
    return {"A3", true, true,
            "the two contacts cannot close together: each impact is of one contact, where Newton's "
            "and Poisson's law coincide and are monotone"};
  }
  if (law.by_speed) {
    return {"A3", true, false,
            "restitutions that depend on the speed: an impact of one contact brings two machines "
            "no further apart, but for impacts of several at one instant this does not follow",
            "where contacts close together, restitutions that do not depend on the speed"};
  }
  if (law.common) {
    return {"A3", true, true,
            name +
                " law with one restitution for all contacts is maximal monotone (but a contact "
                "that closes to stay has restitution 0, which differs if another one bounces at "
                "the same instant)"};
  }
  const std::string criterion =
      newton ? "DG + GD with D = diag((1 - eps_i)/(1 + eps_i))" : "G - EGE";
  const std::string margin =
      ", smallest eigenvalue " + readable(law.margin) + " with G brought to a unit diagonal";
  const std::string change =
      "where the machine allows it, one restitution for all contacts, or values closer to each "
      "other";
  if (law.holds()) {
    return {
        "A3", true, true,
        name + " law with unlike restitutions: " + criterion + " is positive semidefinite" +
            margin +
            (newton ? "; this criterion is exact, the law is monotone"
                    : "; no impact was ever seen to expand distances then, but this is known "
                      "from sampling, not from a proof"),
        newton ? "" : "to be certain, one restitution for all contacts, if that is the machine's"};
  }
  return {"A3", true, false,
          name + " law with unlike restitutions: " + criterion + " is not positive semidefinite" +
              margin +
              (newton ? "; this criterion is exact, some impacts bring two machines apart"
                      : "; impacts may bring two machines apart (the criterion is sufficient as "
                        "far as sampling shows, not necessary)"),
          change};
}

Finding law_fits_clutches(const Assessment& a, int contacts) {
  if (a.law == ImpactLaw::newton && contacts >= 2 && !never_together(a, contacts)) {
    return {"clutches", true, false,
            "Newton's law with " + std::to_string(contacts) +
                " contacts allows gamma+ < 0 at a closed contact, which a clutch cannot follow",
            "set impact.law = \"poisson\""};
  }
  return {"clutches", true, true, "the impact law fits one-way clutches"};
}

Finding trial_finding(const Trial& trial) {
  std::string seen = readable(trial.duration) + " units of time, " +
                     std::to_string(trial.closings) + " closings, " +
                     readable(trial.closings_per_time()) + " per unit of time";
  if (trial.duration < trial.planned && trial.error.empty()) {
    seen += "; cut short of " + readable(trial.planned) + " units: too many events";
  }
  if (!trial.error.empty()) {
    return {"trial", true, false, "the master's simulation fails: " + trial.error,
            "see what the machine does at this time; a larger impact.chatter_time or contacts that "
            "do not close at one instant may help"};
  }
  std::vector<int> idle;
  for (std::size_t i = 0; i < trial.contacts.size(); ++i) {
    if (trial.contacts[i].closings == 0) idle.push_back(static_cast<int>(i));
  }
  if (trial.duration < 0.01 * trial.planned) {
    return {
        "trial", false, false, seen,
        "see what the machine does at this time: contacts that chatter against each other, or a "
        "support that squeezes the machine"};
  }
  if (!idle.empty()) {
    return {"trial", false, false,
            seen + "; never closed: contact" + (idle.size() > 1 ? "s " : " ") + list(idle),
            "a smaller clearance or more excitation; without contacts, damping alone synchronizes"};
  }
  return {"trial", false, true, seen};
}

Finding seen_modes(const std::vector<Mode>& modes) {
  std::string hidden;
  for (std::size_t k = 0; k < modes.size(); ++k) {
    const Mode& mode = modes[k];
    if (!mode.barely_seen()) continue;
    hidden += (hidden.empty() ? "" : "; ") + std::string("mode ") + std::to_string(k + 1) +
              " (omega " + readable(mode.omega);
    if (mode.contact >= 0) hidden += ", w^T phi = " + readable(mode.projection);
    hidden += mode.decades > 0.0
                  ? ", " + readable(mode.decades) + " decades of its V per unit of time)"
                  : std::string(", undamped: it does not converge)");
  }
  if (hidden.empty()) return {"seen_modes", false, true, "the contacts see every mode"};
  return {"seen_modes", false, false,
          "barely seen by the contacts, so that only damping can make them converge: " + hidden,
          "for a faster convergence move a contact away from the nodes of these modes, or damp "
          "them more"};
}

// Bursts: a stiff structure that hits a stop many times while it is pressed against it. A sensor
// cannot tell these hits apart. Nullopt if there are none.
std::optional<Finding> bursts_finding(const Assessment& a) {
  double slowest = a.omega_max;
  for (const Mode& mode : a.modes) {
    if (mode.omega > vibrates * a.omega_max) slowest = std::min(slowest, mode.omega);
  }
  if (slowest == 0.0 || a.trial.contacts.empty() || !(a.trial.duration > 0.0)) return std::nullopt;
  const auto busiest = std::ranges::max_element(a.trial.contacts, {}, &ContactUse::closings);
  const double per_period =
      static_cast<double>(busiest->closings) / a.trial.duration * two_pi / slowest;
  if (per_period <= most_closings_per_period) return std::nullopt;
  return Finding{
      "bursts", false, false,
      "contact " + std::to_string(busiest - a.trial.contacts.begin() + 1) + " closes " +
          readable(per_period) + " times per period of the slowest mode (omega " +
          readable(slowest) + "), more than " + readable(most_closings_per_period) +
          ": a stiff structure hits its stop in bursts, and a sensor reports a burst as one "
          "contact",
      "record each burst as a sustained contact, from its first closing to its last opening "
      "(import_events without --pulse-shorter-than); as pulses they are for a scene with fewer "
      "modes, whose periods are long compared with a burst"};
}

// Restitutions of the replica that differ from the master's.
std::string own_restitutions(const Model& model) {
  std::string own;
  for (const Contact& contact : model.contacts) {
    if (!contact.replica_restitution) continue;
    own += (own.empty() ? "" : ", ") + readable(*contact.replica_restitution);
  }
  return own;
}

Finding by_replica(const Assessment& a) {
  std::string broken;
  for (const Finding& finding : a.findings) {
    if (finding.required && !finding.holds) broken += (broken.empty() ? "" : ", ") + finding.id;
  }
  if (broken.empty()) {
    std::string provided;
    for (const std::string& condition : a.conditions()) provided += ", provided that " + condition;
    return {"by_replica", false, true, "--estimator replica synchronizes, by Theorem 1" + provided};
  }
  return {"by_replica", false, false,
          "--estimator replica has no promise of Theorem 1, for " + broken +
              ": some of its error may stay"};
}

Finding by_filter(const Assessment& a) {
  const std::string name = "--estimator timing ";
  if (!a.filter) {
    return {"by_filter", false, false,
            name + "is of no use for a machine that something is left out of"};
  }
  const FilterTrial& trial = *a.filter;
  if (!trial.ran()) {
    const bool events = a.trial.closings > 0;
    return {
        "by_filter", false, false,
        name + (events ? "was not tried for want of time" : "needs events; the trial has none")};
  }
  const std::string seen = std::to_string(trial.closings) + " closings in " +
                           readable(trial.duration) + " units of time";
  if (!std::isfinite(trial.left)) {
    return {"by_filter", false, false,
            name + "does not know the machine after " + seen +
                " (where nothing but the machine's own state moves it, jittered events do not "
                "determine the size of its motion)"};
  }
  const bool cut_short = trial.duration < 0.99 * a.trial.duration;
  const std::string left = readable(trial.left) + " of the uncertainty of the start is left after ";
  if (trial.follows()) {
    return {"by_filter", false, true,
            name +
                "follows the machine, if the scene is right, whether or not Theorem 1 holds: from "
                "t = " +
                readable(trial.known_from) +
                " of the trial on less than a hundredth of the uncertainty of the start is left"};
  }
  return {"by_filter", false, false,
          name +
              (cut_short ? "was tried for a part of the trial only: "
                         : "does not get to know all of the motion: ") +
              left + seen};
}

// Text about the smallest sufficient number of coordinates and its correction.
std::string corrected(const Accuracy& found) {
  const Reduction& fewest = found.fewest;
  std::string with = std::to_string(fewest.modes) + (fewest.modes == 1 ? " mode" : " modes");
  if (fewest.share) {
    with += " with the " + fewest.correction + " for the replica";
  } else {
    with += " and static vectors of the contacts (" + fewest.correction + ")";
  }
  return with + " are enough as well: " + std::to_string(found.coordinates()) +
         " coordinates, and it changes by " + readable(found.change);
}

// Keys of a [system] for the smallest sufficient number of coordinates.
std::string keys_of(const Accuracy& found) {
  const Reduction& fewest = found.fewest;
  std::string keys = "system.modes = " + std::to_string(fewest.modes);
  if (!fewest.static_vectors.empty()) {
    keys += ", system.static_vectors = [";
    for (const int j : fewest.static_vectors) {
      keys += (j != fewest.static_vectors.front() ? ", " : "") + std::to_string(j);
    }
    keys += "]";
    if (fewest.least_zeta > 0.0) {
      keys += ", system.static_damping_ratio = " + readable(fewest.least_zeta);
    }
  }
  if (fewest.share) {
    keys += ", replica.restitution = ";
    const std::vector<Contact>& contacts = fewest.machine.model.contacts;
    if (contacts.size() > 1) keys += "[";
    for (const Contact& contact : contacts) {
      keys +=
          (&contact != &contacts.front() ? ", " : "") + readable(restitution_of_replica(contact));
    }
    if (contacts.size() > 1) keys += "]";
  }
  return keys;
}

double trial_duration(const Scene& scene, const Dynamics& dynamics, const Assessment& a) {
  double slowest = std::numeric_limits<double>::infinity();
  for (const Mode& mode : a.modes) {
    if (mode.omega > 0.0) slowest = std::min(slowest, mode.omega);
  }
  for (const double frequency : dynamics.frequencies()) slowest = std::min(slowest, frequency);
  if (scene.model.contacts.empty()) return 0.0;
  if (!std::isfinite(slowest)) return trial_without_periods;
  const double period = two_pi / slowest;
  const double decay = a.slow_root < 0.0 ? -1.0 / a.slow_root : 0.0;
  // Limits the trial of machines with little damping.
  return std::min(std::max(periods * period, time_constants * decay), 10.0 * periods * period);
}

}  // namespace

bool Assessment::synchronizes() const {
  return std::all_of(findings.begin(), findings.end(),
                     [](const Finding& finding) { return finding.holds || !finding.required; });
}

const char* Assessment::verdict() const {
  return synchronizes() ? "will synchronize" : "may not synchronize";
}

std::vector<std::string> Assessment::conditions() const {
  std::vector<std::string> conditions;
  for (const Finding& finding : findings) {
    if (finding.required && !finding.provided.empty()) conditions.push_back(finding.provided);
  }
  return conditions;
}

bool Assessment::both_follows() const { return synchronizes() || (filter && filter->follows()); }

Assessment assess(const Scene& scene, const TrialLimits& limits) {
  const Model& model = scene.model;
  Assessment a;
  a.scene = scene.name;
  a.coordinates = static_cast<int>(model.coordinates());
  a.law = model.law;
  a.M = definiteness(model.M);
  a.C = definiteness(model.C);
  a.K = definiteness(model.K);
  auto& findings = a.findings;
  findings.push_back(definite_finding("M", a.M, "Massless motions", "give every motion a mass"));
  findings.push_back(
      definite_finding("C", a.C, "Motions that it does not damp",
                       "if the machine damps them, however little, say so in the scene"));
  findings.push_back(
      definite_finding("K", a.K,
                       "Rigid motions, whose positions damping does not "
                       "bring together and V does not contain",
                       "nothing where the machine is free: take the timing filter, see by_filter"));
  if (!a.M.definite()) return a;

  const Dynamics dynamics(model);
  const Flow free_flight(dynamics, 0);
  const int contacts = dynamics.contacts();
  a.path = free_flight.path();
  a.slow_root = slow_root(free_flight);
  if (!a.C.definite()) {
    // Rounding must not count as damping.
    if (a.slow_root > -1e-14 * free_flight.oscillators().root_kappa().maxCoeff()) a.slow_root = 0.0;
    findings[1].what += a.slow_root < 0.0
                            ? ". All the same every free motion decays, by its coupling to others; "
                              "the theorem does not cover this"
                            : ". Some free motion never decays";
  }
  a.decades = decades_of_V(a.slow_root);
  a.W = directions(dynamics);
  a.opposing = opposing_stops(model);
  a.monotonicity = monotonicity(dynamics);
  a.modes = modes(dynamics);
  for (const Mode& mode : a.modes) a.omega_max = std::max(a.omega_max, mode.omega);
  // A trial ends with the recorded inputs.
  const double longest = std::min(trial_duration(scene, dynamics, a), end_of_inputs(scene.model));
  a.trial = run_trial(scene, longest, limits);

  findings.push_back(directions_finding(a, contacts));
  findings.push_back(contacts_open_again(a.trial));
  findings.push_back(bounded_motion(a));
  findings.push_back(monotone_law(a, contacts));
  findings.push_back(law_fits_clutches(a, contacts));
  findings.push_back(trial_finding(a.trial));
  findings.push_back(seen_modes(a.modes));
  if (auto bursts = bursts_finding(a)) findings.push_back(std::move(*bursts));
  if (const std::string own = own_restitutions(model); own.empty()) {
    a.filter = try_filter(scene, a.trial.events, a.trial.duration, limits);
  } else {
    findings.push_back({"replica", false, true,
                        "the replica's pulses have a restitution of their own, " + own +
                            ": it follows a machine of which this one is a part, not this scene's "
                            "own master"});
  }
  findings.push_back(by_replica(a));
  findings.push_back(by_filter(a));
  findings.push_back({"by_both", false, true,
                      "--estimator both, the default, shows the filter while it fits the events, "
                      "else the replica"});
  return a;
}

void assess_accuracy(const Scene& scene, double tolerance, const TrialLimits& limits,
                     Assessment& a) {
  Finding finding{"accuracy", false, true, ""};
  try {
    a.accuracy = find_accuracy(scene, tolerance, a.trial.duration, limits);
    const Accuracy& found = *a.accuracy;
    const std::string observed = scene.beam ? "tip" : "gaps";
    finding.what = (found.modes < a.coordinates
                        ? "of " + std::to_string(a.coordinates) + " modes the first " +
                              std::to_string(found.modes) + " are enough"
                        : "all " + std::to_string(a.coordinates) + " modes are needed") +
                   " for the " + observed + " to " + readable(tolerance) + " in a run of " +
                   readable(found.duration);
    for (const Accuracy::Change& change : found.changes) {
      if (change.modes > found.modes || change.modes == a.coordinates) break;
      finding.what +=
          ", with " + std::to_string(change.modes) + " it changes by " + readable(change.change);
    }
    if (found.coordinates() < found.modes) finding.what += "; " + corrected(found);
    if (!scene.beam && !scene.kept && found.coordinates() < a.coordinates) {
      finding.what += "; the scene keeps these with " + keys_of(found);
    }
  } catch (const ModelError& error) {
    finding.what = error.what();
  } catch (const SimulationError& error) {
    finding.what = error.what();
  }
  a.findings.push_back(finding);
}

std::string readable(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

}  // namespace sprag
