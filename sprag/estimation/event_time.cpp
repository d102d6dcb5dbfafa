// When a reported event may have been: where on the time axis the hypotheses lie.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "sprag/estimation/unknown_time.h"
#include "sprag/mechanics/scalars.h"

namespace sprag {
namespace {

// A first look at tau, over +- so many sigma.
constexpr double scan_reach = 4.5;
// What is narrower than so many of its steps is looked at more closely.
constexpr double resolved = 1.2;
constexpr double closer = 1.5;
constexpr int bisections = 40;
// A signal that changes by so many of its deviations from one node to the next.
constexpr double scan_resolves = 2.0;
// From one node to the best place beside it, the exponent falls by less.
constexpr double nearly_least = 4.0;
// In steps of 1.1 deviations: the variance of a Gaussian by such a sum is right to 1e-5.
constexpr double node_density = 5.6;
constexpr int least_nodes = 5, most_nodes = 30;
constexpr int looks_at_nodes = 3;
// Deviations of a contact's last event; and how much is held against an event before that.
constexpr double surely_before = 3.0;
constexpr double most_against_order = 50.0;
// So many deviations are no tail of a belief that is not quite Gaussian.
constexpr double certainly = 100.0;

// Mean and deviation of nodes with these weights, given as logarithms, from the first node in
// steps; `total` is 0 where there is none.
struct Moments {
  double total = 0.0, mean = 0.0, deviation = 0.0;
};
Moments moments_of(std::span<const double> log_weights) {
  double highest = -infinity;
  for (const double weight : log_weights) {
    if (weight > highest) highest = weight;
  }
  double total = 0.0, first = 0.0, second = 0.0;
  for (std::size_t i = 0; i < log_weights.size(); ++i) {
    const double w = std::exp(log_weights[i] - highest);
    if (!(w > 0.0)) continue;
    const auto x = static_cast<double>(i);
    total += w;
    first += w * x;
    second += w * x * x;
  }
  if (!(total > 0.0)) return {};
  const double mean = first / total;
  return {total, mean, std::sqrt(std::max(second / total - square(mean), 0.0))};
}

}  // namespace

// What has released was closed before, at a time that is not known better. And no event is before
// the contact's last one, where going back on the flow behind that would find another, nor behind
// what had to bring it about before.
double UnknownTime::log_prior(double age) const {
  double log_weight = -0.5 * square((age - delay_) / sigma_);
  if (closed_since_ < infinity) log_weight += log_normal_cdf((closed_since_ - age) / sigma_);
  const double before_last = (age - oldest_) / oldest_deviation_ - surely_before;
  if (before_last > 0.0) log_weight -= std::min(0.5 * square(before_last), most_against_order);
  if (age < over_since_) log_weight -= most_against_order;
  return log_weight;
}

void UnknownTime::set_order(const UncertainEvent& event, const Motion& motion) {
  oldest_ = delay_ + event.since_last;
  oldest_deviation_ =
      std::max(event.since_deviation, release_rounding * time_step * std::abs(motion.t.hi));
  quiet_since_ = delay_ + event.quiet_for;
  over_since_ = -infinity;
}

// log of the weight of a reported event's age. Remembers how well the best one fits.
double UnknownTime::weigh(const Sight& sight, double age) {
  const double weight = sight.log_weight + log_prior(age);
  if (weight > best_weight_) {
    best_weight_ = weight;
    best_age_ = age;
    // The least of tau^2 / sigma^2 + g^2 / s^2 as if g were linear; what is further away is not.
    const double tau = age - delay_;
    const double here = square(tau / sigma_) + square(sight.value) / sight.all_s2;
    const double there =
        square(sight.value + sight.rate * tau) / (sight.all_s2 + square(sight.rate * sigma_));
    innovation_.square = here - there < nearly_least ? there : here;
  }
  return weight;
}

// Where the event has certainly happened by one of these ages, it has not happened later.
bool UnknownTime::find_over(const Scan& scan) {
  for (int i = scan_nodes - 1; i > 0; --i) {
    if (!(scan.age(i) < quiet_since_)) continue;
    if (!(scan.values[i] < -certainly * std::sqrt(scan.all_s2[i]))) continue;
    over_since_ = scan.age(i);
    return true;
  }
  return false;
}

// Where the signal is zero to a tenth of its deviation, between two ages where it is not of one
// sign: by Newton's steps, or by halves. Where it rises from a touch it has yet to fall.
double UnknownTime::find_zero(double low, double high, double at_low) {
  double age = 0.5 * (low + high);
  for (int i = 0; i < bisections; ++i) {
    belief_.go_back(age);
    const double value = belief_.value();
    const bool is_zero =
        square(value) < 0.01 * (belief_.phi().squaredNorm() + square(value_rounding_));
    const bool rises = at_low < 0.0 && belief_.rate() > 0.0;
    if (is_zero && !rises) break;
    (!is_zero && (value < 0.0) == (at_low < 0.0) ? low : high) = age;
    const double next = age + value / belief_.rate();
    age = next > low && next < high ? next : 0.5 * (low + high);
  }
  return age;
}

// Where the signal crosses zero from one node of a scan to the next, far faster than it is unknown:
// what is known better elsewhere may be the best of the nodes without being likely at all.
bool UnknownTime::find_crossing(UncertainEvent::Kind kind, const Scan& scan, double& age,
                                double& weight) {
  bool found = false;
  for (int i = 1; i < scan_nodes; ++i) {
    // At the contact's last event it leaves zero.
    const bool is_behind_last = scan.age(i) < oldest_;
    const double high = is_behind_last ? scan.age(i) : oldest_;
    const double before = scan.values[i - 1], behind = is_behind_last ? scan.values[i] : 0.0;
    if (!(scan.age(i - 1) < high) || (before < 0.0) == (behind < 0.0)) continue;
    if (std::abs(behind - before) < scan_resolves * std::sqrt(scan.all_s2[i])) continue;
    const double zero = find_zero(scan.age(i - 1), high, before);
    const double risen = weigh(see(kind, zero), zero);
    if (!(risen > weight)) continue;
    weight = risen;
    age = zero;
    found = true;
  }
  return found;
}

// From `age`, where the weight is this, to where it is highest, by Gauss-Newton on the exponent as
// long as it rises, within the scan. Whether it got there; the deviation there.
bool UnknownTime::climb(UncertainEvent::Kind kind, const Scan& scan, double& age, double weight,
                        double& deviation) {
  for (int i = 0; i < 8; ++i) {
    const Sight sight = see(kind, age);
    const double precision = 1.0 / square(sigma_) + square(sight.rate) / sight.all_s2;
    const double next = delay_ + sight.rate * (sight.value + sight.rate * (age - delay_)) /
                                     (sight.all_s2 * precision);
    deviation = 1.0 / std::sqrt(precision);
    if (std::abs(next - age) < 0.05 * deviation) return true;
    if (!(next > scan.low && next < scan.age(scan_nodes - 1))) return false;
    const double risen = weigh(see(kind, next), next);
    if (!(risen > weight)) return false;
    weight = risen;
    age = next;
  }
  return false;
}

UnknownTime::Nodes UnknownTime::find_nodes(UncertainEvent::Kind kind) {
  double low = delay_ - scan_reach * sigma_;
  double high = delay_ + scan_reach * sigma_;
  double mean = 0.0;
  bool first_scan = true;
  double deviation = 0.0;  // NOLINT(clang-analyzer-deadcode.DeadStores): g++ warns without
  while (true) {
    Scan scan{low, (high - low) / (scan_nodes - 1)};
    double weights[scan_nodes];
    int best = 0;
    for (int i = 0; i < scan_nodes; ++i) {
      const Sight sight = see(kind, scan.age(i));
      scan.values[i] = sight.value;
      scan.all_s2[i] = sight.all_s2;
      weights[i] = weigh(sight, scan.age(i));
      if (!(weights[i] <= weights[best]) && weights[i] > -infinity) best = i;
    }
    if (first_scan && kind != UncertainEvent::Kind::stays && find_over(scan)) {
      best = scan_nodes - 1;
      best_weight_ = -infinity;
      for (int i = best; i >= 0; --i) {
        weights[i] = weigh(see(kind, scan.age(i)), scan.age(i));
        if (weights[i] > weights[best]) best = i;
      }
    }
    double age = scan.age(best);
    double weight = weights[best];
    const bool crosses = first_scan && find_crossing(kind, scan, age, weight);
    first_scan = false;
    const Moments moments = moments_of(weights);
    mean = low + moments.mean * scan.step;
    deviation = moments.deviation * scan.step;
    const bool is_seen = deviation >= resolved * scan.step && !crosses;
    if (is_seen || !(scan.step > time_rounding_) || !(weight > -infinity)) break;
    const double around = age;
    if (climb(kind, scan, age, weight, deviation) && deviation < resolved * scan.step) {
      mean = age;
      break;
    }
    low = around - closer * scan.step;
    high = around + closer * scan.step;
  }
  // What lies where is then seen by the nodes themselves, which may have to move.
  Nodes nodes{};
  for (int look = 0; look < looks_at_nodes; ++look) {
    // Each component knows the time better than all of them do.
    const Sight sight = see(kind, mean);
    const double of_one = 1.0 / std::sqrt(1.0 / square(sigma_) + square(sight.rate) / sight.s2);
    nodes = nodes_about(mean, std::max(deviation, time_rounding_),
                        std::max(std::min(deviation, of_one), time_rounding_));
    double weights[EventMixture::capacity];
    for (int i = 0; i < nodes.count; ++i) {
      const double age = nodes.first + i * nodes.step;
      weights[i] = weigh(see(kind, age), age);
    }
    const Moments moments =
        moments_of(std::span(weights).first(static_cast<std::size_t>(nodes.count)));
    const double centre = nodes.first + moments.mean * nodes.step;
    const double width = moments.deviation * nodes.step;
    const bool fits =
        std::abs(centre - mean) < 0.3 * deviation && std::abs(width - deviation) < 0.15 * deviation;
    if (fits || !(width > 0.0)) break;
    mean = centre;
    deviation = width;
  }
  return nodes;
}

UnknownTime::Nodes UnknownTime::nodes_about(double mean, double deviation, double narrowest) const {
  const double spacing =
      2.0 * std::numbers::pi / (2.0 * belief_.fastest() + node_density / narrowest);
  const double wanted = std::ceil(2.0 * node_reach * deviation / spacing) + 1.0;
  const int count = static_cast<int>(
      std::clamp(wanted, static_cast<double>(least_nodes), static_cast<double>(most_nodes)));
  return {mean - node_reach * deviation, 2.0 * node_reach * deviation / (count - 1), count};
}

}  // namespace sprag
