#include "sprag/detail/filter/family_flight.h"

#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "sprag/detail/mechanics/impact_law.h"
#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/polynomial_response.h"
#include "sprag/detail/mechanics/scalars.h"
#include "sprag/detail/replica/active_impact.h"

namespace sprag {
namespace {

using Complex = std::complex<double>;

// a, a', a'', a''' of each record are inputs.
constexpr Eigen::Index chain = 4;

// Propagation of y'' + c y' + k y = 1 over tau, which may be negative.
OscillatorStep step_of(double c, double k, double tau) {
  if (tau >= 0.0) return oscillator_step(0.5 * c, k, tau);
  const OscillatorStep on = oscillator_step(0.5 * c, k, -tau);
  const double growth = std::exp(-c * tau);
  OscillatorStep back{{growth * on.vv, -growth * on.zv, -growth * on.vz, growth * on.zz}, 0.0};
  back.z_alpha = -(back.zz * on.z_alpha + back.zv * on.zv);
  return back;
}

}  // namespace

FamilyFlight::FamilyFlight(const Scene& scene, std::vector<Parameter> unknowns)
    : family_(scene, std::move(unknowns)),
      exponential_(first_record() + chain * std::ssize(family_.records())) {
  const Eigen::Index n2 = 2 * n();
  const Eigen::Index size = first_record() + chain * std::ssize(family_.records());
  for (const RecordedInput& record : family_.records()) cursors_.emplace_back(record.input);
  Variant variant;
  variant.machine = family_.nominal();
  variant.x.setZero(n2);
  variant.harmonics.resize(static_cast<std::size_t>(variant.machine.frequencies.size()));
  variant.recorded.resize(cursors_.size());
  variant.steps.resize(static_cast<std::size_t>(n()));
  for (Transition* of : {&variant.part, &variant.interval}) of->Phi.setZero(n2, size);
  for (Transition* of : {&variant.whole, &turn_}) of->Phi.setZero(n2, n2);
  variants_.resize(1 + 2 * static_cast<std::size_t>(this->unknowns()), variant);
  for (std::size_t j = 1; j < variants_.size(); ++j) {
    variants_[j].own_flow = changes_flow(static_cast<Eigen::Index>(j - 1) / 2);
  }
  c_.setConstant(this->unknowns(), std::numeric_limits<double>::quiet_NaN());
  values_.setZero(this->unknowns());
  turn_steps_ = variant.steps;
  for (Eigen::VectorXd* of : {&x_, &by_time_, &column_}) of->setZero(n2);
  if (has_curves(scene.model)) bend_.setZero(2 * n());
  for (Eigen::VectorXd* of : {&a_, &rate_, &change_.direction, &jump_.direction}) of->setZero(n());
  by_c_.setZero(n2, this->unknowns());
  generator_.setZero(size, size);
  scale_.setZero(size);
  inputs_.setZero(size);
  stiffness_ = variant.machine.K.diagonal();
  to_state_.setZero(n2, n2);
  from_state_ = to_state_;
  const Eigen::MatrixXd to_modes = product(family_.V().transpose(), scene.model.M);
  for (const Eigen::Index i : {Eigen::Index{0}, n()}) {
    to_state_.block(i, i, n(), n()) = family_.V();
    from_state_.block(i, i, n(), n()) = to_modes;
  }
}

// Inputs follow the state: 1, cos and sin of each harmonic, then those of the records.
Eigen::Index FamilyFlight::first_record() const {
  return 2 * n() + 1 + 2 * family_.nominal().frequencies.size();
}

void FamilyFlight::set(const ConstVector& c, bool derivatives) {
  if (c_ == c && (derivatives_ || !derivatives)) return;  // the machines are already set
  derivatives_ = derivatives;
  c_ = c;
  const std::vector<Parameter>& all = family_.unknowns();
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    values_[k] = all[static_cast<std::size_t>(k)].value(c[k]);
  }
  family_.set(values_, centre().machine, centre().machine);
  for (Eigen::Index k = 0; derivatives && k < unknowns(); ++k) {
    const Parameter& unknown = all[static_cast<std::size_t>(k)];
    const double value = values_[k];
    for (int side = 0; side < 2; ++side) {
      Variant& variant = variants_[static_cast<std::size_t>(1 + 2 * k + side)];
      values_[k] = unknown.value(c[k] + (side == 0 ? difference_step : -difference_step));
      family_.set(values_, centre().machine, variant.machine);
      variant.moves_like_centre = variant.machine.moves_like(centre().machine);
    }
    values_[k] = value;
  }
  for (Variant& variant : variants_) {
    variant.part.known = variant.interval.known = variant.whole.known = false;
    variant.harmonics_at = std::numeric_limits<double>::quiet_NaN();
  }
  turn_.known = false;
}

ContactSet FamilyFlight::independent(ContactSet first, ContactSet closed) const {
  return first | independent_of(centre().machine.G, first, closed & ~first);
}

void FamilyFlight::set_phases(double t, Variant& variant) const {
  if (variant.harmonics_at == t) return;
  variant.harmonics_at = t;
  // Most machines of the family have the centre's frequencies.
  const bool of_centre = &variant != &centre() && centre().harmonics_at == t;
  for (std::size_t h = 0; h < variant.harmonics.size(); ++h) {
    const double frequency = variant.machine.frequencies[static_cast<Eigen::Index>(h)];
    const bool same =
        of_centre && frequency == centre().machine.frequencies[static_cast<Eigen::Index>(h)];
    variant.harmonics[h] = same ? centre().harmonics[h] : std::polar(1.0, frequency * t);
  }
}

// Adds `sign` times the steady response to the harmonics, at the present phases.
void FamilyFlight::add_steady(double sign, Variant& variant) const {
  const FamilyMachine& machine = variant.machine;
  for (Eigen::Index h = 0; h < machine.frequencies.size(); ++h) {
    const Complex z = sign * variant.harmonics[static_cast<std::size_t>(h)];
    for (Eigen::Index i = 0; i < n(); ++i) {
      const Complex steady = machine.response(i, h) * z;
      variant.x[i] += steady.real();
      variant.x[n() + i] -= machine.frequencies[h] * steady.imag();
    }
  }
}

void FamilyFlight::find_steps(const FamilyMachine& machine, double tau,
                              std::vector<OscillatorStep>& steps) const {
  for (Eigen::Index i = 0; i < n(); ++i) {
    steps[static_cast<std::size_t>(i)] = step_of(machine.C(i, i), machine.K(i, i), tau);
  }
}

// Calls move(from, part) for each part of a flight from t by tau in which every record is a
// polynomial. variant.recorded is that at the start of the part.
template <class Move>
void FamilyFlight::along_records(double t, double tau, Variant& variant, const Move& move) {
  const bool forwards = tau >= 0.0;
  const double end = t + tau;
  for (std::size_t r = 0; r < cursors_.size(); ++r) {
    const SampledInput::Settings& nominal = family_.records()[r].input->settings();
    const GainAndDelay& of = variant.machine.records[r];
    cursors_[r].start(t, forwards, of.gain / nominal.gain, of.delay - nominal.delay);
  }
  const auto set_recorded = [&](double at) {
    for (std::size_t r = 0; r < cursors_.size(); ++r) variant.recorded[r] = cursors_[r].at(at);
  };
  double from = t;
  for (;;) {
    double to = end;
    for (const InputCursor& cursor : cursors_) {
      to = forwards ? std::min(to, cursor.next()) : std::max(to, cursor.next());
    }
    set_recorded(from);
    move(from, from == t && to == end ? tau : to - from, from != t && to != end);
    if (!(forwards ? to < end : to > end)) break;  // also if end is not a number
    for (InputCursor& cursor : cursors_) {
      if (cursor.next() == to) cursor.pass();
    }
    from = to;
  }
  set_recorded(end);
}

// Moves the motion of uncoupled modes without their steady response.
void FamilyFlight::move_free(double part, const std::vector<OscillatorStep>& steps,
                             Variant& variant) const {
  const FamilyMachine& machine = variant.machine;
  for (Eigen::Index i = 0; i < n(); ++i) {
    double& y = variant.x[i];
    double& u = variant.x[n() + i];
    if (variant.recorded.empty()) {
      steps[static_cast<std::size_t>(i)].apply(machine.constant_force[i], y, u);
      continue;
    }
    PolynomialForce force{machine.constant_force[i]};
    for (std::size_t r = 0; r < variant.recorded.size(); ++r) {
      const InputDerivatives& of = variant.recorded[r];
      const double share = machine.recorded_forces(i, static_cast<Eigen::Index>(r));
      for (std::size_t k = 2; k < of.size(); ++k) force[k - 2] += share * of[k];
    }
    move_under_force(0.5 * machine.C(i, i), machine.K(i, i), force, part, y, u);
  }
}

// Sets A of (x, i)' = A (x, i), or of x' = A x.
void FamilyFlight::set_generator(const FamilyMachine& machine, ContactSet held, bool with_inputs,
                                 Eigen::Ref<Eigen::MatrixXd> A) const {
  A.setZero();
  A.block(0, n(), n(), n()).setIdentity();
  A.block(n(), 0, n(), n()) = -machine.K;
  A.block(n(), n(), n(), n()) = -machine.C;
  const Eigen::Index first = 2 * n() + 1;
  if (with_inputs) {
    A.col(2 * n()).segment(n(), n()) = machine.constant_force;
    for (Eigen::Index h = 0; h < machine.frequencies.size(); ++h) {
      const Eigen::Index j = first + 2 * h;
      A.col(j).segment(n(), n()) = machine.forces.col(h).real();
      A.col(j + 1).segment(n(), n()) = -machine.forces.col(h).imag();
      A(j, j + 1) = -machine.frequencies[h];
      A(j + 1, j) = machine.frequencies[h];
    }
    for (Eigen::Index r = 0; r < machine.recorded_forces.cols(); ++r) {
      const Eigen::Index j = first_record() + chain * r;
      A.col(j).segment(n(), n()) = machine.recorded_forces.col(r);
      for (Eigen::Index k = j; k + 1 < j + chain; ++k) A(k, k + 1) = 1.0;
    }
  }
  if (held == 0) return;
  // Each column's contact forces.
  const ContactMatrix G = of_contacts(machine.G, held);
  ContactVector gaps(G.rows()), lambda(G.rows());
  for (Eigen::Index j = 0; j < A.cols(); ++j) {
    auto column = A.col(j).segment(n(), n());
    Eigen::Index row = 0;
    for_each(held, [&](int i) {
      double acceleration = machine.W.col(i).dot(column);
      if (j >= first_record()) {
        if ((j - first_record()) % chain == 0) {
          acceleration += machine.shares(i, (j - first_record()) / chain);
        }
      } else if (j >= first) {
        const Eigen::Index h = (j - first) / 2;
        const Complex support = square(machine.frequencies[h]) * machine.motions(i, h);
        acceleration += (j - first) % 2 == 0 ? -support.real() : support.imag();
      }
      gaps[row++] = acceleration;
    });
    if (arrest(G, gaps, lambda) == Solved::yes) add_forces(machine, held, lambda, column);
  }
}

// Adds M^-1 W_H lambda.
void FamilyFlight::add_forces(const FamilyMachine& machine, ContactSet held,
                              const ContactVector& lambda, Eigen::Ref<Eigen::VectorXd> u) const {
  Eigen::Index row = 0;
  for_each(held, [&](int i) { u += lambda[row++] * machine.D.col(i); });
}

void FamilyFlight::find(const FamilyMachine& machine, double tau, ContactSet held, bool with_inputs,
                        Transition& of) {
  const double rounding = 4.0 * std::numeric_limits<double>::epsilon() * std::abs(end_);
  if (of.known && of.held == held && std::abs(of.tau - tau) <= rounding) return;
  of.known = true;
  of.held = held;
  of.tau = tau;
  const Eigen::Index n2 = 2 * n(), size = of.Phi.cols();
  auto A = generator_.topLeftCorner(size, size);
  set_generator(machine, held, with_inputs, A);
  // Balances A: positions by the frequencies, inputs by their forces.
  const double least = 1.0 / std::abs(tau);
  double fastest = least;
  for (Eigen::Index i = 0; i < n(); ++i) {
    scale_[i] = std::max(std::sqrt(std::max(machine.K(i, i), 0.0)), least);
    scale_[n() + i] = 1.0;
    fastest = std::max(fastest, scale_[i]);
  }
  const auto force_of = [&](Eigen::Index j) {
    const double force = A.col(j).segment(n(), n()).cwiseAbs().maxCoeff() / fastest;
    return force > 0.0 ? force : 1.0;
  };
  if (size > n2) scale_[n2] = force_of(n2);
  for (Eigen::Index j = n2 + 1; j < std::min(first_record(), size); j += 2) {
    scale_[j] = scale_[j + 1] = std::max(force_of(j), force_of(j + 1));
  }
  for (Eigen::Index j = first_record(); j < size; j += chain) {
    scale_[j] = force_of(j);
    for (Eigen::Index k = j; k + 1 < j + chain; ++k) scale_[k + 1] = scale_[k] / fastest;
  }
  for (Eigen::Index j = 0; j < size; ++j) {
    for (Eigen::Index i = 0; i < size; ++i) A(i, j) *= tau * (scale_[i] / scale_[j]);
  }
  exponential_.apply(A);
  for (Eigen::Index j = 0; j < size; ++j) {
    for (Eigen::Index i = 0; i < n2; ++i) of.Phi(i, j) = A(i, j) * (scale_[j] / scale_[i]);
  }
}

void FamilyFlight::move(double part, Transition& with, Variant& variant) {
  if (part == 0.0) return;
  const FamilyMachine& machine = variant.machine;
  find(machine, part, held_, true, with);
  inputs_.head(2 * n()) = variant.x;
  inputs_[2 * n()] = 1.0;
  for (std::size_t h = 0; h < variant.harmonics.size(); ++h) {
    const auto j = 2 * n() + 1 + 2 * static_cast<Eigen::Index>(h);
    inputs_[j] = variant.harmonics[h].real();
    inputs_[j + 1] = variant.harmonics[h].imag();
  }
  for (std::size_t r = 0; r < variant.recorded.size(); ++r) {
    const Eigen::Index j = first_record() + chain * static_cast<Eigen::Index>(r);
    for (Eigen::Index k = 0; k < chain; ++k) {
      inputs_[j + k] = variant.recorded[r][static_cast<std::size_t>(k) + 2];
    }
  }
  variant.x.noalias() = with.Phi.lazyProduct(inputs_);
}

// Removes the gap velocities of the held contacts, which rounding or a prior has left.
void FamilyFlight::close(ContactSet held, Variant& variant) const {
  const FamilyMachine& machine = variant.machine;
  const ContactMatrix G = of_contacts(machine.G, held);
  ContactVector gamma(G.rows()), lambda(G.rows());
  Eigen::Index row = 0;
  for_each(held, [&](int i) { gamma[row++] = gap(i, variant).velocity; });
  if (arrest(G, gamma, lambda) == Solved::yes) {
    add_forces(machine, held, lambda, variant.x.tail(n()));
  }
}

void FamilyFlight::close(ContactSet held, Columns dx) const {
  const FamilyMachine& machine = centre().machine;
  const ContactMatrix G = of_contacts(machine.G, held);
  ContactVector gamma(G.rows()), lambda(G.rows());
  for (auto column : dx.colwise()) {
    Eigen::Index row = 0;
    for_each(held, [&](int i) { gamma[row++] = machine.W.col(i).dot(column.tail(n())); });
    if (arrest(G, gamma, lambda) == Solved::yes) {
      add_forces(machine, held, lambda, column.tail(n()));
    }
  }
}

void FamilyFlight::fly(const ConstVector& x, double t, double tau, Variant& variant) {
  variant.x = x;
  set_phases(t, variant);
  if (in_closed_form(held_)) {
    const bool own = variant.own_flow || &variant == &centre();
    if (own) find_steps(variant.machine, tau, variant.steps);
    const std::vector<OscillatorStep>& steps = own ? variant.steps : centre().steps;
    add_steady(-1.0, variant);
    along_records(t, tau, variant,
                  [&](double, double part, bool) { move_free(part, steps, variant); });
    set_phases(t + tau, variant);
    add_steady(1.0, variant);
    return;
  }
  Variant& same = variant.moves_like_centre ? centre() : variant;
  along_records(t, tau, variant, [&](double from, double part, bool is_interval) {
    set_phases(from, variant);
    if (from == t && held_ != 0) close(held_, variant);
    move(part, is_interval ? same.interval : same.part, variant);
  });
  set_phases(t + tau, variant);
}

void FamilyFlight::start(double tau, ContactSet held) {
  tau_ = tau;
  held_ = held;
  for (Variant& variant : variants_) variant.whole.known = false;
}

void FamilyFlight::fly(const ConstVector& x, double t, double tau, ContactSet held) {
  end_ = t + tau;
  start(tau, held);
  for (std::size_t j = 0; j < used(); ++j) fly(x, t, tau, variants_[j]);
  difference();
}

void FamilyFlight::fly_on(double tau, ContactSet held) {
  const double t = end_;
  end_ += tau;
  start(tau, held);
  for (std::size_t j = 0; j < used(); ++j) {
    column_ = variants_[j].x;
    fly(column_, t, tau, variants_[j]);
  }
  difference();
}

void FamilyFlight::difference() {
  x_ = centre().x;
  for (Eigen::Index k = 0; derivatives_ && k < unknowns(); ++k) {
    const auto j = static_cast<std::size_t>(1 + 2 * k);
    by_c_.col(k) = (variants_[j].x - variants_[j + 1].x) / (2.0 * difference_step);
  }
}

// x -> x over the last flight.
const Eigen::MatrixXd& FamilyFlight::whole(Variant& variant) {
  Transition& of = variant.whole;
  if (of.known) return of.Phi;
  const Transition& part = variant.moves_like_centre ? centre().part : variant.part;
  if (tau_ == 0.0) {
    of.Phi.setIdentity();
    of.known = true;
  } else if (part.known && part.held == held_ && part.tau == tau_) {
    of.Phi = part.Phi.leftCols(2 * n());
    of.known = true;
  } else {
    find(variant.machine, tau_, held_, false, of);
  }
  return of.Phi;
}

void FamilyFlight::apply(const std::vector<OscillatorStep>& steps, Columns dx) const {
  for (auto column : dx.colwise()) {
    for (Eigen::Index i = 0; i < n(); ++i) {
      steps[static_cast<std::size_t>(i)].apply(0.0, column[i], column[n() + i]);
    }
  }
}

void FamilyFlight::apply(const Eigen::MatrixXd& Phi, ContactSet held, Columns dx) const {
  if (held != 0) close(held, dx);
  for (auto column : dx.colwise()) {
    column_ = column;
    column.noalias() = Phi.lazyProduct(column_);
  }
}

void FamilyFlight::carry(Columns dx) {
  if (in_closed_form(held_)) {
    apply(centre().steps, dx);
  } else {
    apply(whole(centre()), held_, dx);
  }
}

void FamilyFlight::turn(double tau, ContactSet held, Columns dx) {
  if (in_closed_form(held)) {
    find_steps(centre().machine, tau, turn_steps_);
    apply(turn_steps_, dx);
  } else if (tau != 0.0) {
    find(centre().machine, tau, held, false, turn_);
    apply(turn_.Phi, held, dx);
  }
}

void FamilyFlight::carry_by_unknown(Eigen::Index k, Vector dx) {
  const auto j = static_cast<std::size_t>(1 + 2 * k);
  const double h = 2.0 * difference_step;
  if (!in_closed_form(0)) {
    column_ = dx;
    dx.noalias() = (whole(variants_[j]) - whole(variants_[j + 1])).lazyProduct(column_) / h;
    return;
  }
  for (Eigen::Index i = 0; i < n(); ++i) {
    const OscillatorStep& above = variants_[j].steps[static_cast<std::size_t>(i)];
    const OscillatorStep& below = variants_[j + 1].steps[static_cast<std::size_t>(i)];
    const double z = dx[i], v = dx[n() + i];
    dx[i] = ((above.zz - below.zz) * z + (above.zv - below.zv) * v) / h;
    dx[n() + i] = ((above.vz - below.vz) * z + (above.vv - below.vv) * v) / h;
  }
}

double FamilyFlight::largest_frequency() const {
  return std::sqrt(std::max(centre().machine.K.diagonal().maxCoeff(), 0.0));
}

double FamilyFlight::smallest_frequency() const {
  double least = infinity;
  for (const double k : centre().machine.K.diagonal()) {
    if (k > 0.0) least = std::min(least, k);
  }
  return least < infinity ? std::sqrt(least) : 1.0;
}

// Derivative `order`, 0 or 1, of F_i.
double FamilyFlight::applied(Eigen::Index i, int order, const Variant& variant) const {
  const FamilyMachine& machine = variant.machine;
  double force = order == 0 ? machine.constant_force[i] : 0.0;
  for (Eigen::Index h = 0; h < machine.frequencies.size(); ++h) {
    const Complex F = machine.forces(i, h) * variant.harmonics[static_cast<std::size_t>(h)];
    force += order == 0 ? F.real() : -machine.frequencies[h] * F.imag();
  }
  for (std::size_t r = 0; r < variant.recorded.size(); ++r) {
    force += machine.recorded_forces(i, static_cast<Eigen::Index>(r)) *
             variant.recorded[r][static_cast<std::size_t>(order) + 2];
  }
  return force;
}

// Sets a = y'' with the contacts `held` closed.
void FamilyFlight::accelerate(const Variant& variant, ContactSet held, Eigen::VectorXd& a) const {
  const FamilyMachine& machine = variant.machine;
  const auto y = variant.x.head(n()), u = variant.x.tail(n());
  a.noalias() = -machine.K.lazyProduct(y);
  a.noalias() -= machine.C.lazyProduct(u);
  for (Eigen::Index i = 0; i < n(); ++i) a[i] += applied(i, 0, variant);
  if (held == 0) return;
  const ContactMatrix G = of_contacts(machine.G, held);
  ContactVector gaps(G.rows()), lambda(G.rows());
  Eigen::Index row = 0;
  for_each(held, [&](int i) {
    gaps[row++] = machine.W.col(i).dot(a) + support(i, variant).acceleration;
  });
  if (arrest(G, gaps, lambda) == Solved::yes) add_forces(machine, held, lambda, a);
}

// s_i(t) + c_i.
Flight::Gap FamilyFlight::support(int contact, const Variant& variant) const {
  const FamilyMachine& machine = variant.machine;
  Gap gap;
  gap.g = machine.clearance[contact];
  gap.length = std::abs(gap.g);
  for (std::size_t r = 0; r < variant.recorded.size(); ++r) {
    const InputDerivatives& of = variant.recorded[r];
    const double share = machine.shares(contact, static_cast<Eigen::Index>(r));
    gap.g += share * of[0];
    gap.length += std::abs(share * of[0]);
    gap.velocity += share * of[1];
    gap.acceleration += share * of[2];
  }
  for (Eigen::Index h = 0; h < machine.frequencies.size(); ++h) {
    const Complex z = machine.motions(contact, h) * variant.harmonics[static_cast<std::size_t>(h)];
    const double Omega = machine.frequencies[h];
    gap.g += z.real();
    gap.velocity -= Omega * z.imag();
    gap.acceleration -= square(Omega) * z.real();
  }
  return gap;
}

// Without the acceleration.
Flight::Gap FamilyFlight::gap(int contact, const Variant& variant) const {
  const FamilyMachine& machine = variant.machine;
  Gap gap = support(contact, variant);
  for (Eigen::Index i = 0; i < n(); ++i) {
    const double w = machine.W(i, contact);
    gap.g += w * variant.x[i];
    gap.length += std::abs(w * variant.x[i]);
    gap.velocity += w * variant.x[n() + i];
  }
  // The rounding error of an angle Omega t is proportional to it.
  const double angle =
      machine.frequencies.size() > 0 ? machine.frequencies.maxCoeff() * std::abs(end_) : 0.0;
  gap.rounding = (1.0 + angle) * gap.length;
  return gap;
}

Flight::Gap FamilyFlight::gap(int contact) const {
  Gap of = gap(contact, centre());
  accelerate(centre(), 0, a_);
  of.acceleration += centre().machine.W.col(contact).dot(a_);
  return of;
}

Flight::Gap FamilyFlight::force(int contact, const Variant& variant) const {
  const FamilyMachine& machine = variant.machine;
  const ContactSet held = held_ | bit(contact);
  const ContactMatrix G = of_contacts(machine.G, held);
  ContactVector gaps(G.rows()), lambda(G.rows());
  accelerate(variant, 0, a_);
  double terms = 0.0;
  for (Eigen::Index i = 0; i < n(); ++i) {
    const double w = machine.W(i, contact), y = variant.x[i], u = variant.x[n() + i];
    terms += std::abs(w) * (std::abs(applied(i, 0, variant)) + std::abs(machine.C(i, i) * u) +
                            std::abs(machine.K(i, i) * y));
  }
  const auto solve = [&](const auto& acceleration_of) {
    Eigen::Index row = 0, of_contact = 0;
    for_each(held, [&](int i) {
      if (i == contact) of_contact = row;
      gaps[row++] = acceleration_of(i);
    });
    return arrest(G, gaps, lambda) == Solved::yes ? lambda[of_contact] : 0.0;
  };
  Gap of;
  of.g = solve([&](int i) { return machine.W.col(i).dot(a_) + support(i, variant).acceleration; });
  add_forces(machine, held, lambda, a_);
  for (Eigen::Index i = 0; i < n(); ++i) rate_[i] = applied(i, 1, variant);
  of.velocity = solve([&](int i) {
    double rate = machine.W.col(i).dot(rate_) - machine.KW.col(i).dot(variant.x.tail(n())) -
                  machine.CW.col(i).dot(a_);
    for (Eigen::Index h = 0; h < machine.frequencies.size(); ++h) {
      const double Omega = machine.frequencies[h];
      const Complex z = machine.motions(i, h) * variant.harmonics[static_cast<std::size_t>(h)];
      rate += Omega * square(Omega) * z.imag();
    }
    for (std::size_t r = 0; r < variant.recorded.size(); ++r) {
      rate += machine.shares(i, static_cast<Eigen::Index>(r)) * variant.recorded[r][3];
    }
    return rate;
  });
  const double angle =
      machine.frequencies.size() > 0 ? machine.frequencies.maxCoeff() * std::abs(end_) : 0.0;
  of.length = of.rounding = 2.0 * (1.0 + angle) * terms / machine.G(contact, contact);
  return of;
}

void FamilyFlight::differences(int contact, bool of_force, Vector of_g, Vector of_velocity) const {
  const auto at = [&](std::size_t j) {
    return of_force ? force(contact, variants_[j]) : gap(contact, variants_[j]);
  };
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    const auto j = static_cast<std::size_t>(1 + 2 * k);
    const Gap above = at(j), below = at(j + 1);
    of_g[k] = (above.g - below.g) / (2.0 * difference_step);
    of_velocity[k] = (above.velocity - below.velocity) / (2.0 * difference_step);
  }
}

void FamilyFlight::gradients(int contact, bool of_force, Vector of_g, Vector of_velocity) const {
  const FamilyMachine& machine = centre().machine;
  of_g.setZero();
  of_velocity.setZero();
  if (!of_force) {
    of_g.head(n()) = of_velocity.tail(n()) = machine.W.col(contact);
    return;
  }
  const ContactSet held = held_ | bit(contact);
  const ContactMatrix G = of_contacts(machine.G, held);
  ContactVector unit(G.rows()), share(G.rows());
  Eigen::Index row = 0;
  for_each(held, [&](int i) { unit[row++] = i == contact ? -1.0 : 0.0; });
  if (arrest(G, unit, share) != Solved::yes) return;
  row = 0;
  for_each(held, [&](int i) {
    of_g.head(n()) += share[row] * machine.KW.col(i);
    of_g.tail(n()) += share[row++] * machine.CW.col(i);
  });
}

void FamilyFlight::acceleration_gradient(int contact, Vector of) const {
  of.head(n()) = -centre().machine.KW.col(contact);
  of.tail(n()) = -centre().machine.CW.col(contact);
}

ImpactRestitution FamilyFlight::at_impact(int contact, double gamma, double sigma,
                                          const Variant& variant) const {
  const FamilyMachine& machine = variant.machine;
  const Contact& of = machine.scene.model.contacts[static_cast<std::size_t>(contact)];
  // Speeds are those of the machine's own time.
  const double scale = machine.clock_scale;
  const auto [epsilon, slope, scatter] = restitution_over(of, scale * gamma, scale * sigma);
  return {epsilon, scale * slope, scatter / scale};
}

// Impact of a contact with restitution `epsilon` while `others` are held.
void FamilyFlight::find_jump(int contact, double epsilon, bool ends_chatter, ContactSet others,
                             const Variant& variant, Jump& jump) const {
  const FamilyMachine& machine = variant.machine;
  jump.change = 1.0 + epsilon;
  jump.direction = machine.D.col(contact) / machine.G(contact, contact);
  jump.staying = others;
  if (others == 0) return;
  const SingleImpact impact = single_impact(machine.G, family_.scene().model.law,
                                            machine.restitution, contact, epsilon, others);
  if (impact.solved != Solved::yes) return;
  jump.change = impact.change;
  jump.direction.setZero();
  add_forces(machine, others | bit(contact), impact.Lambda, jump.direction);
  // The end of a completed chatter releases no contact.
  if (!ends_chatter) jump.staying = impact.staying;
}

ContactSet FamilyFlight::strike(int contact, bool stays, ContactSet held, double sigma) {
  contact_ = contact;
  const ContactSet own = bit(contact), others = held & ~own;
  // by_time_ = f-(x-) - f+(x+) - (d/dt jump), with the rates f- and f+ of x before and after the
  // impact, which include the forces of held contacts.
  accelerate(centre(), others, a_);
  by_time_.tail(n()) = a_;
  const double acceleration =
      centre().machine.W.col(contact).dot(a_) + support(contact, centre()).acceleration;
  ContactSet after = 0;
  for (std::size_t j = 0; j < used(); ++j) {
    Variant& variant = variants_[j];
    const double velocity = gap(contact, variant).velocity;
    const auto [epsilon, slope, scatter] =
        stays ? ImpactRestitution{} : at_impact(contact, velocity, sigma, variant);
    const bool ends_chatter = stays && variant.machine.restitution[contact] > 0.0;
    find_jump(contact, epsilon, ends_chatter, others, variant, jump_);
    variant.x.tail(n()) -= (jump_.change * velocity) * jump_.direction;
    if (j > 0) continue;
    after = stays ? jump_.staying | own : jump_.staying;
    by_time_.head(n()) = (jump_.change * velocity) * jump_.direction;
    std::swap(change_, jump_);
    if (bend_.size() > 0) {
      // The jump is linear in epsilon, which depends on gamma-.
      find_jump(contact, epsilon + difference_step, ends_chatter, others, variant, jump_);
      change_.direction *= change_.change;
      change_.change = 1.0;
      bend_.tail(n()) = (jump_.change * jump_.direction - change_.direction) / difference_step;
      change_.direction -= (slope * velocity) * bend_.tail(n());
      bend_ *= scatter;
    }
    by_time_.tail(n()) -= (change_.change * acceleration) * change_.direction;
  }
  accelerate(centre(), after, a_);
  by_time_.tail(n()) -= a_;
  difference();
  return after;
}

void FamilyFlight::carry_through(Columns dx) const {
  const auto w = centre().machine.W.col(contact_);
  for (auto column : dx.colwise()) {
    column.tail(n()) -= (change_.change * w.dot(column.tail(n()))) * change_.direction;
  }
}

void FamilyFlight::along(int contact, Vector dx) const {
  const FamilyMachine& machine = centre().machine;
  dx.head(n()).setZero();
  dx.tail(n()) = machine.D.col(contact) / machine.G(contact, contact);
}

void FamilyFlight::enter(const ConstVector& q, const ConstVector& u, double, Vector x) {
  x.head(n()).noalias() = from_state_.topLeftCorner(n(), n()).lazyProduct(q);
  x.tail(n()).noalias() = from_state_.topLeftCorner(n(), n()).lazyProduct(u);
}

void FamilyFlight::state(const ConstVector& x, double, Vector q, Vector u) {
  q.noalias() = family_.V().lazyProduct(x.head(n()));
  u.noalias() = family_.V().lazyProduct(x.tail(n()));
}

double FamilyFlight::twice_energy(const Eigen::Ref<const Eigen::MatrixXd>& dx) const {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < n(); ++i) {
    sum += dx.row(n() + i).squaredNorm() + stiffness_[i] * dx.row(i).squaredNorm();
  }
  return sum;
}

}  // namespace sprag
