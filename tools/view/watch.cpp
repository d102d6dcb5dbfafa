#include "tools/view/watch.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "sprag/detail/mechanics/scale.h"
#include "sprag/detail/parameters/unknowns.h"
#include "sprag/detail/replica/penetration.h"

namespace sprag::view {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t usual_events = 4096;
constexpr std::size_t most_provisional = 4096;
constexpr std::size_t most_truth = 512;
constexpr std::size_t most_suspects = 1000;
constexpr Eigen::Index most_coordinates = 12;  // that have curves
constexpr std::size_t history_memory = 24U << 20U;
constexpr std::int64_t second = 1'000'000'000;  // ns
constexpr std::int64_t contacts_silence = second / 2;
constexpr std::int64_t estimate_silence = second;
constexpr std::int64_t truth_silence = second / 2;
constexpr std::int64_t health_silence = 3 * second;
constexpr std::int64_t another_estimate =
    second / 4;  // silence after which an earlier time is accepted: the observer was restarted
constexpr double near = 100.0;  // s; a first message with a later watermark joins a running session

std::vector<Quantity> quantities_of(const Model& model) {
  std::vector<Quantity> quantities;
  const auto add = [&](Quantity::Kind kind, std::size_t i, std::string name, std::string label) {
    quantities.push_back({kind, i, std::move(name), std::move(label)});
  };
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    const std::string& name = model.outputs[i].name;
    add(Quantity::Kind::output, i, name, name);
  }
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    const std::string number = std::to_string(i + 1);
    add(Quantity::Kind::gap, i, "g" + number, "gap g" + number + " [m]");
  }
  for (Eigen::Index i = 0; i < model.coordinates(); ++i) {
    if (model.coordinates() > most_coordinates && !quantities.empty()) break;
    const std::string number = std::to_string(i + 1);
    add(Quantity::Kind::coordinate, static_cast<std::size_t>(i), "q" + number,
        "coordinate q" + number);
  }
  return quantities;
}

std::size_t without_outputs(const std::vector<Quantity>& quantities) {
  return static_cast<std::size_t>(std::count_if(
      quantities.begin(), quantities.end(),
      [](const Quantity& quantity) { return quantity.kind != Quantity::Kind::output; }));
}

// Number of unpaired samples to keep, of f coordinates: about 16 MiB.
std::size_t pairing_window(Eigen::Index coordinates) {
  const auto bytes = static_cast<std::size_t>(16 * coordinates + 160);
  return std::clamp<std::size_t>((16U << 20U) / bytes, 1000, 20000);
}

template <class Message>
Shown shown(const Message& sample) {
  return {sample.tick, sample.t, as_vector(sample.q), as_vector(sample.u)};
}

double sigma_at(const std::vector<double>& sigmas, std::size_t i) {
  return i < sigmas.size() ? sigmas[i] : std::numeric_limits<double>::infinity();
}

// Writes mean - 2 sigma, mean, mean + 2 sigma; nan for the first and last if sigma is unknown.
void put_band(double mean, double sigma, double* to) {
  const bool known = std::isfinite(sigma);
  to[0] = known ? mean - 2.0 * sigma : nan;
  to[1] = mean;
  to[2] = known ? mean + 2.0 * sigma : nan;
}

// Name and unit of a recorded input: the frame's acceleration or displacement, or a force.
std::string label_of(const Scene& scene, const RecordedInput& record) {
  if (!scene.beam && !(scene.frame && scene.frame->input == record.input)) {
    return record.key + " [unit of the force]";
  }
  return record.input->settings().displacement ? record.key + " displacement [m]"
                                               : record.key + " acceleration [m/s^2]";
}

void append(Rows& rows, double t, std::span<const double> values) {
  rows.t.push_back(t);
  for (std::size_t c = 0; c < values.size(); ++c) rows.values[c].push_back(values[c]);
}

}  // namespace

Watch::Watch(const Scene& scene, Freshness freshness)
    : scene_(scene),
      machine_(scene),
      quantities_(quantities_of(scene.model)),
      f_(scene.model.coordinates()),
      length_(length_scale(scene.model, scene.prior.start)),
      tracker_(freshness),
      freshness_(freshness),
      events_(static_cast<int>(scene.model.contacts.size()), usual_events),
      raster_(scene.model.contacts.size()),
      penetrating_(1),
      pairing_(scene.model, pairing_window(f_)),
      estimates_(3 * without_outputs(quantities_), history_memory),
      outputs_(3 * scene.model.outputs.size(), history_memory),
      guaranteed_(2 * quantities_.size(), history_memory),
      truths_(quantities_.size(), history_memory),
      bounds_(1, history_memory),
      energies_(1, history_memory),
      innovations_(1, history_memory),
      inputs_(1, history_memory),
      streamed_(scene.stream_duration > 0.0) {
  const std::vector<RecordedInput> records = recorded_inputs(scene);
  if (records.empty()) return;
  input_ = records.front().input;
  input_label_ = label_of(scene, records.front());
}

bool Watch::follows(std::int64_t session, std::int64_t utime, const Arrival& arrival) {
  if (session_ == session) return true;
  // Contact messages select the session. Before the first of them, any other message does.
  const bool any_contacts = tracker_.counts().sessions > 0;
  if (session_ || any_contacts || !freshness_.allows(utime, arrival.wall)) {
    ++of_others_;
    return false;
  }
  freshness_.note(utime);
  begin(session);
  return true;
}

void Watch::begin(std::int64_t session) {
  session_ = session;
  for (History* history : {&estimates_, &outputs_, &guaranteed_, &truths_, &bounds_, &energies_,
                           &innovations_, &inputs_}) {
    history->clear();
  }
  raster_.clear();
  penetrating_.clear();
  suspects_.clear();
  provisional_.clear();
  truth_.clear();
  settled_.reset();
  latest_.reset();
  energy_.reset();
  innovation_.reset();
  parameters_.reset();
  inconsistencies_ = 0;
  estimate_arrival_ = truth_arrival_ = never;
}

void Watch::take(const ContactMessage& message, const Arrival& arrival) {
  if (message.contacts != static_cast<int>(scene_.model.contacts.size())) {
    ++misfits_;
    return;
  }
  const SessionTracker::Verdict verdict = tracker_.receive(message, arrival);
  if (verdict == SessionTracker::Verdict::ignored) return;
  contacts_arrival_ = arrival.monotonic;
  speed_ = message.speed;
  if (verdict == SessionTracker::Verdict::starts) {
    if (session_ != message.session) begin(message.session);
    events_.restart(0, 0, no_horizon);
    if (message.records_total > message.records || message.horizon > near) {
      events_.restart(message.records_total, message.closed, message.horizon);
      raster_.correct(message.closed, message.horizon);
    }
  }
  const bool back =
      message.horizon < events_.horizon() || message.records_total < events_.next_record();
  if (verdict == SessionTracker::Verdict::resumes && back) {
    begin(message.session);  // times of a history must rise
    events_.restart(message.records_total, message.closed, message.horizon);
    raster_.correct(message.closed, message.horizon);
  }
  events_.add(message);
  for (const ContactEvent& event : events_.events()) raster_.add(event);
  events_.drop(events_.events().size());
}

template <class Message>
double Watch::value_of(const Quantity& quantity, const Message& message) const {
  const Eigen::Index n = message.f;
  const auto q = as_vector(message.q), u = as_vector(message.u);
  switch (quantity.kind) {
    case Quantity::Kind::gap: {
      const Contact& contact = scene_.model.contacts[quantity.index];
      return contact.w.head(n).dot(q) + support_motion(contact, message.t) + contact.clearance;
    }
    case Quantity::Kind::coordinate: {
      const auto i = static_cast<Eigen::Index>(quantity.index);
      return i < n ? q[i] : 0.0;
    }
    case Quantity::Kind::output: {
      const Output& output = scene_.model.outputs[quantity.index];
      return output.direction.head(n).dot(output.velocity ? u : q);
    }
  }
  return nan;
}

std::vector<double> Watch::estimate_row(const estimate_t& sample) const {
  std::vector<double> row(3 * without_outputs(quantities_));
  double* to = row.data();
  for (const Quantity& quantity : quantities_) {
    if (quantity.kind == Quantity::Kind::output) continue;
    const bool is_gap = quantity.kind == Quantity::Kind::gap;
    // Only the filter's estimate has deviations.
    const double sigma = sample.from_filter == 1
                             ? sigma_at(is_gap ? sample.sigma_g : sample.sigma_q, quantity.index)
                             : nan;
    put_band(value_of(quantity, sample), sigma, to);
    to += 3;
  }
  return row;
}

// Messages do not carry the penetration. The estimate of an adaptive filter obeys its own estimated
// supports, so the scene's gaps give no penetration for it.
double Watch::penetration_of(const estimate_t& sample) const {
  if (parameters_ && sample.from_filter == 1) return 0.0;
  return penetration(scene_.model.contacts, as_vector(sample.q), sample.t,
                     as_vector(sample.sigma_g), length_);
}

void Watch::take_estimate(const estimate_t& sample, const Arrival& arrival) {
  if (!fits(sample.f <= f_) || !follows(sample.session, sample.utime, arrival)) return;
  const bool newer = !latest_ || sample.t >= latest_->t ||
                     arrival.monotonic - estimate_arrival_ > another_estimate;
  if (newer) {
    latest_ = sample;
    estimate_arrival_ = arrival.monotonic;
  }
  if (sample.t > estimates_.last_t()) keep_provisional(sample);
}

// If no estimate settles for long, every second sample is dropped and the minimum distance grows,
// so that the samples span all of the time since the last settled estimate.
void Watch::keep_provisional(const estimate_t& sample) {
  if (provisional_.size() < most_provisional / 4) spacing_ = 0.0;
  if (provisional_.size() > 1 && sample.t > provisional_.rbegin()->first) {
    const auto last = std::prev(provisional_.end());
    if (last->first - std::prev(last)->first < spacing_) provisional_.erase(last);
  }
  provisional_.insert_or_assign(sample.t, sample);
  if (provisional_.size() <= most_provisional) return;
  bool drop = false;
  std::erase_if(provisional_, [&drop](const auto&) { return std::exchange(drop, !drop); });
  spacing_ = 2.0 * (provisional_.rbegin()->first - provisional_.begin()->first) / most_provisional;
}

void Watch::take_settled(const estimate_t& sample, const Arrival& arrival) {
  if (!fits(sample.f <= f_) || !follows(sample.session, sample.utime, arrival)) return;
  estimate_arrival_ = std::max(estimate_arrival_, arrival.monotonic);
  if (!estimates_.add(sample.t, estimate_row(sample))) return;
  bounds_.add(sample.t, std::span(&sample.bound, 1));
  settled_ = sample;
  const bool inside = penetration_of(sample) > 0.0;
  if (inside != penetrating_.closed(0)) {
    penetrating_.add({sample.t, 0, inside ? ContactEventKind::closes : ContactEventKind::opens});
  }
  provisional_.erase(provisional_.begin(), provisional_.upper_bound(sample.t));
  inconsistencies_ = sample.inconsistencies;
  if (sample.suspect_t >= 0.0 && (suspects_.empty() || suspects_.back().t != sample.suspect_t)) {
    suspects_.push_back({sample.suspect_t, std::max(sample.suspect_contact - 1, 0),
                         static_cast<Suspicion>(sample.suspicion)});
    if (suspects_.size() > most_suspects) suspects_.pop_front();
  }
  add_innovation(sample);
  add_energy(pairing_.add_estimate(sample));
}

void Watch::take(const state_t& truth, const Arrival& arrival) {
  if (!fits(truth.f == f_) || !follows(truth.session, truth.utime, arrival)) return;
  truth_arrival_ = arrival.monotonic;
  std::vector<double> row;
  row.reserve(quantities_.size());
  for (const Quantity& quantity : quantities_) row.push_back(value_of(quantity, truth));
  if (truths_.add(truth.t, row)) {
    truth_.push_back(truth);
    if (truth_.size() > most_truth) truth_.pop_front();
  }
  add_energy(pairing_.add_truth(truth));
}

void Watch::add_energy(const SyncRow* row) {
  if (row == nullptr) return;
  energy_ = Energy{row->k, row->t, row->energy[0]};
  energies_.add(row->t, std::span(&row->energy[0], 1));
}

// Every estimate carries the last closing, so the history takes each closing once. Of several
// closings within a tick only the last one arrives.
void Watch::add_innovation(const estimate_t& sample) {
  const double deviation = sample.sigma_filter_gap;
  const bool predicted = deviation > 0.0 && std::isfinite(deviation);
  const double ratio = predicted ? sample.filter_gap / deviation : nan;
  if (predicted && innovations_.add(sample.closing, std::span(&ratio, 1))) {
    innovation_ = ClosingInnovation{sample.closing, std::max(sample.closing_contact - 1, 0), ratio};
  }
}

void Watch::take(const outputs_t& sample, const Arrival& arrival) {
  if (!fits(ends_with_outputs(sample.name, 0))) return;
  if (sample.settled != 1 || !follows(sample.session, sample.utime, arrival)) return;
  std::vector<double> row(3 * sample.value.size());
  for (std::size_t i = 0; i < sample.value.size(); ++i) {
    put_band(sample.value[i], sample.sigma[i], &row[3 * i]);
  }
  outputs_.add(sample.t, row);
}

void Watch::take(const bounds_t& sample, const Arrival& arrival) {
  const std::size_t contacts = scene_.model.contacts.size();
  const std::size_t others = contacts + scene_.model.outputs.size();
  const std::size_t count = sample.name.size();
  const std::size_t coordinates = count - others;  // used only if count >= others
  if (!fits(count >= others && coordinates <= static_cast<std::size_t>(f_) &&
            ends_with_outputs(sample.name, coordinates + contacts))) {
    return;
  }
  if (!follows(sample.session, sample.utime, arrival)) return;
  if (!settled_ || settled_->tick != sample.tick) return;
  std::vector<double> row;
  row.reserve(2 * quantities_.size());
  for (const Quantity& quantity : quantities_) {
    const std::size_t first = quantity.kind == Quantity::Kind::coordinate ? 0
                              : quantity.kind == Quantity::Kind::gap      ? coordinates
                                                                          : coordinates + contacts;
    const bool beyond =
        quantity.kind == Quantity::Kind::coordinate && quantity.index >= coordinates;
    const double half_width = beyond ? nan : sample.half_width[first + quantity.index];
    const double mean = value_of(quantity, *settled_);
    row.push_back(mean - half_width);
    row.push_back(mean + half_width);
  }
  guaranteed_.add(settled_->t, row);
}

// Whether the names after the first `others` are those of the scene's outputs.
bool Watch::ends_with_outputs(const std::vector<std::string>& names, std::size_t others) const {
  const std::vector<Output>& outputs = scene_.model.outputs;
  return std::equal(
      outputs.begin(), outputs.end(), names.begin() + static_cast<std::ptrdiff_t>(others),
      names.end(),
      [](const Output& output, const std::string& name) { return output.name == name; });
}

void Watch::take(const parameters_t& sample, const Arrival& arrival) {
  if (follows(sample.session, sample.utime, arrival)) parameters_ = sample;
}

void Watch::take(const health_t& health, const Arrival& arrival) {
  health_ = health;
  health_arrival_ = arrival.monotonic;
}

void Watch::take(const InputMessage& message, const Arrival& arrival) {
  if (!streamed_) {
    ++misfits_;
    return;
  }
  if (!follows(message.session, message.utime, arrival)) return;
  const SampledInput::Settings& settings = input_->settings();
  for (std::int64_t k = message.first(); k < message.total; ++k) {
    const double value = settings.gain * message.sample(k);
    inputs_.add(message.t0 + static_cast<double>(k) * message.dt + settings.delay,
                std::span(&value, 1));
  }
}

// Of a record: its samples, or the least and the greatest one in each interval of a pixel.
Rows Watch::input_in(const Window& window) const {
  const std::vector<History::Wanted> first{{0, Keep::both}};
  if (streamed_) return inputs_.thinned(window, first);
  Rows rows;
  rows.values.resize(1);
  if (!input_) return rows;
  const std::vector<double>& knots = input_->knots();
  const std::size_t order = input_->settings().displacement ? 0 : 2;
  const std::size_t end = window.to < input_->first() ? 0 : input_->interval(window.to) + 1;
  std::size_t k = input_->interval(window.from);
  const std::size_t samples = end > k ? end - k : 0;
  const auto pixels = static_cast<std::size_t>(std::max(window.pixels, 1));
  const std::size_t each = std::max<std::size_t>(1, samples / pixels);
  for (; k < end; k += each) {
    const std::size_t last = std::min(end, k + each);
    double low = input_->at_knot(k)[order], high = low;
    for (std::size_t i = k + 1; i < last; ++i) {
      low = std::min(low, input_->at_knot(i)[order]);
      high = std::max(high, input_->at_knot(i)[order]);
    }
    append(rows, knots[k], std::span(&low, 1));
    if (last > k + 1) append(rows, knots[last - 1], std::span(&high, 1));
  }
  return rows;
}

// The last estimate not later than the machine's last state, so that both are drawn at the same
// instant.
const estimate_t* Watch::shown_estimate() const {
  const estimate_t* settled = settled_ ? &*settled_ : nullptr;
  const estimate_t* latest = latest_ ? &*latest_ : settled;
  if (latest != nullptr && settled != nullptr && settled->t > latest->t) latest = settled;
  if (truth_.empty() || latest == nullptr || latest->t <= truth_.back().t) return latest;
  const auto later = provisional_.upper_bound(truth_.back().t);
  if (later != provisional_.begin()) return &std::prev(later)->second;
  return settled != nullptr ? settled : latest;
}

const state_t* Watch::nearest_truth(double t) const {
  if (truth_.empty()) return nullptr;
  const state_t* nearest = &truth_.back();
  for (const state_t& state : truth_) {
    if (std::abs(state.t - t) < std::abs(nearest->t - t)) nearest = &state;
  }
  const double tick = truth_.size() > 1 ? truth_.back().t - truth_[truth_.size() - 2].t : 0.0;
  return std::abs(nearest->t - t) <= 3.0 * tick + 1e-9 * t ? nearest : nullptr;
}

// No contact messages arrive, either here or, by its health message, at the observer.
bool Watch::runs_free(std::int64_t now) const {
  if (tracker_.counts().sessions > 0 && now - contacts_arrival_ > contacts_silence) return true;
  const bool health_is_current = health_ && !health_->last && health_->session == session_ &&
                                 now - health_arrival_ <= health_silence;
  return health_is_current && static_cast<MasterState>(health_->master) >= MasterState::silent;
}

Frame Watch::frame(std::int64_t now) const {
  Frame frame;
  frame.session = session_;
  if (settled_) frame.settled = shown(*settled_);
  if (settled_) frame.bound = settled_->bound;
  if (latest_) frame.now = shown(*latest_);
  if (!truth_.empty()) frame.truth = shown(truth_.back());
  frame.energy = energy_;
  frame.innovation = innovation_;
  frame.speed = speed_;
  frame.inconsistencies = inconsistencies_;
  if (!suspects_.empty()) frame.suspect = suspects_.back();
  if (parameters_) {
    for (std::size_t i = 0; i < parameters_->key.size(); ++i) {
      frame.parameters.push_back(
          {parameters_->key[i], parameters_->value[i], parameters_->sigma[i]});
    }
  }

  const estimate_t* estimate = nullptr;
  const bool truth_lives = now - truth_arrival_ <= truth_silence;
  if (truth_lives) {
    estimate = shown_estimate();
  } else {
    estimate = latest_ ? &*latest_ : settled_ ? &*settled_ : nullptr;
  }
  const state_t* truth = nullptr;
  if (truth_lives) truth = estimate != nullptr ? nearest_truth(estimate->t) : &truth_.back();
  if (estimate != nullptr) {
    frame.from_filter = estimate->from_filter == 1;
    frame.penetration = penetration_of(*estimate);
    constexpr std::array shown_by{EstimatorShown::replica, EstimatorShown::replica,
                                  EstimatorShown::timing, EstimatorShown::both};
    frame.estimator = parameters_ ? EstimatorShown::adaptive
                                  : shown_by[static_cast<std::size_t>(estimate->estimators)];
    frame.t = estimate->t;
    frame.estimate = machine_.shape(as_vector(estimate->q), estimate->t);
    const Eigen::VectorXd sigma = as_vector(estimate->sigma_q);
    if (frame.from_filter && sigma.allFinite() && sigma.size() > 0) {
      frame.sigma = machine_.sigma(sigma);
    }
    const bool estimated = now - estimate_arrival_ <= estimate_silence;
    frame.badge = !estimated          ? Badge::waiting
                  : runs_free(now)    ? Badge::free
                  : frame.from_filter ? Badge::filter
                                      : Badge::replica;
  } else if (truth != nullptr) {
    frame.t = truth->t;
  }
  frame.base = machine_.base(frame.t);
  if (truth != nullptr) frame.truth_shape = machine_.shape(as_vector(truth->q), truth->t);

  const std::size_t contacts = scene_.model.contacts.size();
  for (std::size_t i = 0; i < contacts; ++i) {
    ContactShown contact;
    const Quantity gap{Quantity::Kind::gap, i, {}, {}};
    if (estimate != nullptr) {
      contact.gap = value_of(gap, *estimate);
      const double sigma = sigma_at(estimate->sigma_g, i);
      if (frame.from_filter && std::isfinite(sigma)) contact.sigma = sigma;
    }
    if (truth != nullptr) contact.truth = value_of(gap, *truth);
    if (machine_.stops()[i].has_height) contact.height = machine_.stop(i, frame.t);
    contact.closed = raster_.closed(i);
    contact.events = raster_.events(i);
    contact.last = raster_.last(i);
    frame.contacts.push_back(contact);
  }
  return frame;
}

Curves Watch::curves(std::size_t quantity, const Window& window) const {
  Curves curves;
  curves.window = window;
  curves.quantity = std::min(quantity, quantities_.size() - 1);
  const Quantity& of = quantities_[curves.quantity];
  const bool is_output = of.kind == Quantity::Kind::output;
  const std::size_t outputs = scene_.model.outputs.size();
  const std::size_t column = 3 * (is_output ? of.index : curves.quantity - outputs);
  using Wanted = History::Wanted;
  const std::vector<Wanted> band{
      {column, Keep::least}, {column + 1, Keep::both}, {column + 2, Keep::greatest}};
  const std::vector<Wanted> first{{0, Keep::both}}, own{{curves.quantity, Keep::both}};
  const History& history = is_output ? outputs_ : estimates_;
  curves.estimate = history.thinned(window, band);
  const std::size_t low = 2 * curves.quantity;
  curves.guaranteed = guaranteed_.thinned(
      window, std::vector<Wanted>{{low, Keep::least}, {low + 1, Keep::greatest}});
  curves.truth = truths_.thinned(window, own);
  curves.energy = energies_.thinned(window, first);
  curves.bound = bounds_.thinned(window, first);
  curves.innovation = innovations_.thinned(window, first);
  curves.input = input_in(window);

  // Provisional estimates continue the curve after the last settled estimate.
  const std::size_t stride =
      1 + provisional_.size() / static_cast<std::size_t>(2 * std::max(window.pixels, 1));
  std::size_t i = 0;
  for (const auto& [t, sample] : provisional_) {
    if (t <= history.last_t() || t < window.from || i++ % stride != 0) continue;
    if (t > window.to) break;
    if (is_output) {
      append(curves.estimate, t, std::vector<double>{nan, value_of(of, sample), nan});
    } else {
      const std::vector<double> row = estimate_row(sample);
      append(curves.estimate, t, std::span(row).subspan(column, 3));
    }
  }
  curves.closures = raster_.thinned(window);
  curves.penetrating = penetrating_.thinned(window).front();
  for (const Suspect& suspect : suspects_) {
    if (suspect.t >= window.from && suspect.t <= window.to) curves.suspects.push_back(suspect);
  }
  return curves;
}

std::pair<double, double> Watch::extent() const {
  double from = std::numeric_limits<double>::infinity(), to = -from;
  for (const History* history : {&estimates_, &truths_}) {
    if (history->empty()) continue;
    from = std::min(from, history->first_t());
    to = std::max(to, history->last_t());
  }
  if (!provisional_.empty()) {
    from = std::min(from, provisional_.begin()->first);
    to = std::max(to, provisional_.rbegin()->first);
  }
  return from <= to ? std::pair(from, to) : std::pair(0.0, 0.0);
}

const char* name(Badge badge) {
  switch (badge) {
    case Badge::free:
      return "free";
    case Badge::replica:
      return "replica";
    case Badge::filter:
      return "filter";
    default:
      return "waiting";
  }
}

const char* name(EstimatorShown estimator) {
  switch (estimator) {
    case EstimatorShown::replica:
      return "replica";
    case EstimatorShown::timing:
      return "timing";
    case EstimatorShown::both:
      return "both";
    case EstimatorShown::adaptive:
      return "adaptive";
    default:
      return "unknown";
  }
}

}  // namespace sprag::view
