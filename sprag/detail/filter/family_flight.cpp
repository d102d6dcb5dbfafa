#include "sprag/detail/filter/family_flight.h"

#include <bit>
#include <cmath>
#include <complex>
#include <limits>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/polynomial_response.h"

namespace sprag {
namespace {

using Kind = Unknown::Kind;
using Complex = std::complex<double>;

// Step of the central differences in c. Its truncation error is far below any deviation of c, and
// the rounding error of the difference stays small.
constexpr double difference_of_c = 4e-6;
// Enough for angles up to 1: the remainder is below rounding.
constexpr int terms_of_series = 20;
// Largest number of Taylor steps of a flight with a closed contact. It bounds the computing time of
// an event.
constexpr double most_held_steps = 200.0;

int contact_of(ContactSet held) { return held == 0 ? -1 : std::countr_zero(held); }

bool is_of_flow(const Unknown& unknown) {
  return unknown.kind == Kind::damping || unknown.kind == Kind::stiffness;
}

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

FamilyFlight::FamilyFlight(const MachineFamily& family) : family_(&family) {
  const Eigen::VectorXd nominal = family.nominal();
  variants_.resize(1 + 2 * static_cast<std::size_t>(unknowns()));
  for (const RecordedInput& record : family.records()) cursors_.emplace_back(record.input);
  for (Variant& variant : variants_) {
    variant.machine = family.without_responses(nominal);
    variant.inputs = family.inputs(nominal);
    variant.x.setZero(2 * n());
    variant.harmonics.resize(static_cast<std::size_t>(variant.machine.groups()));
    variant.derivatives = variant.harmonics;
    variant.recorded.resize(cursors_.size());
  }
  for (std::size_t k = 0; k < family.unknowns().size(); ++k) {
    const bool own = is_of_flow(family.unknowns()[k]);
    for (std::size_t j : {1 + 2 * k, 2 + 2 * k}) {
      variants_[j].own_flow = own;
      if (own) variants_[j].steps.resize(static_cast<std::size_t>(n()));
    }
  }
  c_.setConstant(unknowns(), std::numeric_limits<double>::quiet_NaN());
  values_ = nominal;
  steps_.resize(static_cast<std::size_t>(n()));
  turn_ = steps_;
  x_.setZero(2 * n());
  by_time_.setZero(2 * n());
  by_c_.setZero(2 * n(), unknowns());
  held_step_.setZero(2 * n(), 2 * n());
  term_.setZero(2 * n());
  next_.setZero(2 * n());
  stiffness_ = centre().machine.K;
  to_state_.setZero(2 * n(), 2 * n());
  from_state_ = to_state_;
  const Eigen::MatrixXd to_modes = product(family.V().transpose(), family.scene().model.M);
  for (const Eigen::Index i : {Eigen::Index{0}, n()}) {
    to_state_.block(i, i, n(), n()) = family.V();
    from_state_.block(i, i, n(), n()) = to_modes;
  }
}

void FamilyFlight::set_machine(const Eigen::VectorXd& values, Variant& variant) const {
  family_->at(values, variant.machine);
  family_->inputs(values, variant.inputs);
}

void FamilyFlight::set(const ConstVector& c, bool derivatives) {
  if (c_ == c && (derivatives_ || !derivatives)) return;  // the machines are already set
  derivatives_ = derivatives;
  c_ = c;
  const std::vector<Unknown>& all = family_->unknowns();
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    values_[k] = all[static_cast<std::size_t>(k)].value(c[k]);
  }
  set_machine(values_, centre());
  for (Eigen::Index k = 0; derivatives && k < unknowns(); ++k) {
    const Unknown& unknown = all[static_cast<std::size_t>(k)];
    const double value = values_[k];
    for (int side = 0; side < 2; ++side) {
      Variant& variant = variants_[static_cast<std::size_t>(1 + 2 * k + side)];
      // W and positions are the costliest part. The copy spares their computation unless this
      // unknown changes them.
      variant.machine.W = centre().machine.W;
      variant.machine.positions = centre().machine.positions;
      values_[k] = unknown.value(c[k] + (side == 0 ? difference_of_c : -difference_of_c));
      set_machine(values_, variant);
    }
    values_[k] = value;
  }
}

void FamilyFlight::find_steps(const Variant& variant, double tau,
                              std::vector<OscillatorStep>& steps) const {
  for (Eigen::Index i = 0; i < n(); ++i) {
    steps[static_cast<std::size_t>(i)] =
        step_of(variant.machine.C(i, 0), variant.machine.K(i, 0), tau);
  }
}

// Adds `sign` times the steady response to the harmonics, at the present phases.
void FamilyFlight::add_steady(double sign, Variant& variant) const {
  const Machine& machine = variant.machine;
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const Complex z = sign * Complex(variant.inputs[2 * g], variant.inputs[2 * g + 1]) *
                      variant.harmonics[static_cast<std::size_t>(g)];
    for (Eigen::Index i = 0; i < n(); ++i) {
      const Complex steady = machine.response(i, g) * z;
      variant.x[i] += steady.real();
      variant.x[n() + i] -= machine.frequencies[g] * steady.imag();
    }
  }
}

double FamilyFlight::steps_of_holding(double tau) const {
  const Machine& machine = centre().machine;
  double rate = machine.C.maxCoeff() + std::sqrt(machine.K.maxCoeff());
  if (machine.groups() > 0) rate = std::max(rate, machine.frequencies.maxCoeff());
  return std::ceil(rate * std::abs(tau));
}

// term_ <- share A term_, where x' = A x is the homogeneous motion with the contact closed: the
// contact force keeps the acceleration of its gap at zero.
void FamilyFlight::add_held_terms(const Machine& machine, int contact, double share) {
  const auto w = machine.W.col(contact);
  next_.head(n()) = term_.tail(n());
  for (Eigen::Index i = 0; i < n(); ++i) {
    next_[n() + i] = -machine.C(i, 0) * term_[n() + i] - machine.K(i, 0) * term_[i];
  }
  const double force = w.dot(next_.tail(n())) / w.squaredNorm();
  next_.tail(n()) -= force * w;
  term_ = share * next_;
}

// Adds the term of this order that constant forces, records and harmonics drive while the contact
// is closed. `power` is step^order / order!, `share` step / (order + 1).
void FamilyFlight::add_held_inputs(int contact, int order, double share, double power,
                                   Variant& variant) {
  const Machine& machine = variant.machine;
  const auto w = machine.W.col(contact);
  // The k-th derivatives of the support's motion and of the steady response.
  double drive = 0.0;
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const Complex i_Omega(0.0, machine.frequencies[g]);
    Complex& derivative = variant.derivatives[static_cast<std::size_t>(g)];
    if (order == 0) {
      derivative = Complex(variant.inputs[2 * g], variant.inputs[2 * g + 1]) *
                   machine.gap_response(contact, g) *
                   variant.harmonics[static_cast<std::size_t>(g)];
    }
    drive += square(machine.frequencies[g]) * derivative.real();
    derivative *= i_Omega * share;
  }
  for (Eigen::Index i = 0; order == 0 && i < n(); ++i) {
    const double force = constant_force(i, variant);
    term_[n() + i] += share * force;
    drive -= w[i] * force;
  }
  const auto derivative = static_cast<std::size_t>(order) + 2;
  for (Eigen::Index r = 0; r < machine.records() && derivative < InputDerivatives{}.size(); ++r) {
    const double a = power * variant.recorded[static_cast<std::size_t>(r)][derivative];
    for (Eigen::Index i = 0; i < n(); ++i) {
      const double force = machine.recorded_forces(i, r) * a;
      term_[n() + i] += share * force;
      drive -= w[i] * force;
    }
    drive -= machine.shares(contact, r) * a;
  }
  term_.tail(n()) += (share * drive / w.squaredNorm()) * w;
}

// Moves variant.x, which is the free part here, by Taylor series in steps in which no angle turns
// by more than 1.
void FamilyFlight::hold(int contact, double tau, Variant& variant) {
  const Machine& machine = variant.machine;
  const double steps = std::max(1.0, steps_of_holding(tau));
  const double step = tau / steps;
  for (int i = 0; i < static_cast<int>(steps); ++i) {
    term_ = variant.x;
    double power = 1.0;
    for (int k = 0; k < terms_of_series; ++k) {
      const double share = step / (k + 1);
      add_held_terms(machine, contact, share);
      add_held_inputs(contact, k, share, power, variant);
      power *= share;
      variant.x += term_;
    }
    for (Eigen::Index g = 0; g < machine.groups(); ++g) {
      variant.harmonics[static_cast<std::size_t>(g)] *=
          std::polar(1.0, machine.frequencies[g] * step);
    }
    for (InputDerivatives& of : variant.recorded) of = moved_by(of, step);
  }
}

// Sets held_step_ to the transition matrix of the deviations with the contact closed.
void FamilyFlight::hold_homogeneous(int contact, double tau) {
  const double steps = std::max(1.0, steps_of_holding(tau));
  for (Eigen::Index j = 0; j < 2 * n(); ++j) {
    auto column = held_step_.col(j);
    column.setZero();
    column[j] = 1.0;
    for (int i = 0; i < static_cast<int>(steps); ++i) {
      term_ = column;
      for (int k = 0; k < terms_of_series; ++k) {
        add_held_terms(centre().machine, contact, tau / steps / (k + 1));
        column += term_;
      }
    }
  }
}

void FamilyFlight::fly(const ConstVector& x, double t, double tau, Variant& variant) {
  const Machine& machine = variant.machine;
  const auto turn = [&](double to) {
    for (Eigen::Index g = 0; g < machine.groups(); ++g) {
      variant.harmonics[static_cast<std::size_t>(g)] = std::polar(1.0, machine.frequencies[g] * to);
    }
  };
  variant.x = x;
  turn(t);
  add_steady(-1.0, variant);
  if (held_ >= 0) {
    along_records(t, tau, variant, [&](double part) { hold(held_, part, variant); });
  } else {
    if (variant.own_flow) find_steps(variant, tau, variant.steps);
    const std::vector<OscillatorStep>& steps = variant.own_flow ? variant.steps : steps_;
    along_records(t, tau, variant, [&](double part) { move_free(part, steps, variant); });
  }
  turn(t + tau);
  add_steady(1.0, variant);
}

template <class Move>
void FamilyFlight::along_records(double t, double tau, Variant& variant, const Move& move) {
  const Machine& machine = variant.machine;
  const bool forwards = tau >= 0.0;
  const double end = t + tau;
  for (std::size_t r = 0; r < cursors_.size(); ++r) {
    const auto j = static_cast<Eigen::Index>(r);
    const SampledInput::Settings& nominal = family_->records()[r].input->settings();
    cursors_[r].start(t, forwards, variant.inputs[2 * machine.groups() + j] / nominal.gain,
                      machine.delays[j] - nominal.delay);
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
    move(from == t && to == end ? tau : to - from);
    if (to == end) break;
    for (InputCursor& cursor : cursors_) {
      if (cursor.next() == to) cursor.pass();
    }
    from = to;
  }
  set_recorded(end);
}

double FamilyFlight::constant_force(Eigen::Index i, const Variant& variant) const {
  const Machine& machine = variant.machine;
  double force = 0.0;
  for (Eigen::Index j = 0; j < machine.constant_forces.cols(); ++j) {
    force += machine.constant_forces(i, j) * variant.inputs[machine.driving() + j];
  }
  return force;
}

void FamilyFlight::move_free(double part, const std::vector<OscillatorStep>& steps,
                             Variant& variant) const {
  const Machine& machine = variant.machine;
  for (Eigen::Index i = 0; i < n(); ++i) {
    double& y = variant.x[i];
    double& u = variant.x[n() + i];
    if (machine.records() == 0) {
      steps[static_cast<std::size_t>(i)].apply(constant_force(i, variant), y, u);
      continue;
    }
    PolynomialForce force{constant_force(i, variant)};
    for (Eigen::Index r = 0; r < machine.records(); ++r) {
      const InputDerivatives& of = variant.recorded[static_cast<std::size_t>(r)];
      for (std::size_t k = 2; k < of.size(); ++k) {
        force[k - 2] += machine.recorded_forces(i, r) * of[k];
      }
    }
    move_under_force(0.5 * machine.C(i, 0), machine.K(i, 0), force, part, y, u);
  }
}

void FamilyFlight::move(double tau, int held) {
  held_ = held;
  if (held < 0) {
    find_steps(centre(), tau, steps_);
  } else {
    hold_homogeneous(held, tau);
  }
}

void FamilyFlight::fly(const ConstVector& x, double t, double tau, ContactSet held) {
  end_ = t + tau;
  move(tau, contact_of(held));
  const std::size_t count = derivatives_ ? variants_.size() : 1;
  for (std::size_t j = 0; j < count; ++j) fly(x, t, tau, variants_[j]);
  difference();
}

void FamilyFlight::fly_on(double tau, ContactSet held) {
  move(tau, contact_of(held));
  const std::size_t count = derivatives_ ? variants_.size() : 1;
  for (std::size_t j = 0; j < count; ++j) fly(variants_[j].x, end_, tau, variants_[j]);
  end_ += tau;
  difference();
}

bool FamilyFlight::can_hold(ContactSet held, double duration) const {
  if (held == 0) return true;
  double steps = steps_of_holding(duration);
  for (const RecordedInput& record : family_->records()) {
    steps += std::abs(duration) / record.input->spacing();
  }
  return std::has_single_bit(held) && steps < most_held_steps;
}

ContactSet FamilyFlight::independent(ContactSet first, ContactSet closed) const {
  return first | closed;
}

void FamilyFlight::turn(double tau, ContactSet, Columns dx) {
  find_steps(centre(), tau, turn_);
  for (auto column : dx.colwise()) {
    for (Eigen::Index i = 0; i < n(); ++i) {
      turn_[static_cast<std::size_t>(i)].apply(0.0, column[i], column[n() + i]);
    }
  }
}

void FamilyFlight::carry_by_unknown(Eigen::Index k, Vector dx) const {
  const auto j = static_cast<std::size_t>(1 + 2 * k);
  for (Eigen::Index i = 0; i < n(); ++i) {
    const OscillatorStep& above = variants_[j].steps[static_cast<std::size_t>(i)];
    const OscillatorStep& below = variants_[j + 1].steps[static_cast<std::size_t>(i)];
    const double z = dx[i], v = dx[n() + i], h = 2.0 * difference_of_c;
    dx[i] = ((above.zz - below.zz) * z + (above.zv - below.zv) * v) / h;
    dx[n() + i] = ((above.vz - below.vz) * z + (above.vv - below.vv) * v) / h;
  }
}

double FamilyFlight::largest_frequency() const {
  return std::sqrt(std::max(centre().machine.K.maxCoeff(), 0.0));
}

double FamilyFlight::smallest_frequency() const {
  double least = infinity;
  for (const double k : centre().machine.K.reshaped()) {
    if (k > 0.0) least = std::min(least, k);
  }
  return least < infinity ? std::sqrt(least) : 1.0;
}

void FamilyFlight::difference() {
  x_ = centre().x;
  for (Eigen::Index k = 0; derivatives_ && k < unknowns(); ++k) {
    const auto j = static_cast<std::size_t>(1 + 2 * k);
    by_c_.col(k) = (variants_[j].x - variants_[j + 1].x) / (2.0 * difference_of_c);
  }
}

void FamilyFlight::carry(Columns dx) {
  for (auto column : dx.colwise()) {
    if (held_ >= 0) {
      term_ = column;
      column.noalias() = held_step_.lazyProduct(term_);
      continue;
    }
    for (Eigen::Index i = 0; i < n(); ++i) {
      steps_[static_cast<std::size_t>(i)].apply(0.0, column[i], column[n() + i]);
    }
  }
}

// The motion of a mode minus its steady response to the harmonics; under the force of the records.
FamilyFlight::FreePart FamilyFlight::free_part(Eigen::Index i, const Variant& variant) const {
  const Machine& machine = variant.machine;
  FreePart part{variant.x[i], variant.x[n() + i]};
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const Complex steady = machine.response(i, g) *
                           Complex(variant.inputs[2 * g], variant.inputs[2 * g + 1]) *
                           variant.harmonics[static_cast<std::size_t>(g)];
    part.y -= steady.real();
    part.u += machine.frequencies[g] * steady.imag();
  }
  part.force = constant_force(i, variant);
  for (Eigen::Index r = 0; r < machine.records(); ++r) {
    part.force += machine.recorded_forces(i, r) * variant.recorded[static_cast<std::size_t>(r)][2];
  }
  part.acceleration = part.force - machine.C(i, 0) * part.u - machine.K(i, 0) * part.y;
  return part;
}

// gap_response contains the steady response and the support's motion; the free part of x is added.
Flight::Gap FamilyFlight::gap(int contact, const Variant& variant) const {
  const Machine& machine = variant.machine;
  Gap gap;
  gap.g = variant.inputs[machine.driving() + machine.constant_forces.cols() + contact];
  gap.length = std::abs(gap.g);
  for (Eigen::Index r = 0; r < machine.records(); ++r) {
    const InputDerivatives& of = variant.recorded[static_cast<std::size_t>(r)];
    const double share = machine.shares(contact, r);
    gap.g += share * of[0];
    gap.length += std::abs(share * of[0]);
    gap.velocity += share * of[1];
    gap.acceleration += share * of[2];
  }
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const Complex z = Complex(variant.inputs[2 * g], variant.inputs[2 * g + 1]) *
                      variant.harmonics[static_cast<std::size_t>(g)];
    const double Omega = machine.frequencies[g];
    const Complex steady = machine.gap_response(contact, g) * z;
    gap.g += steady.real();
    // The rounding error of the angle Omega t is proportional to it.
    gap.rounding += std::abs(steady) * std::abs(Omega * end_);
    gap.velocity -= Omega * steady.imag();
    gap.acceleration -= Omega * Omega * steady.real();
  }
  for (Eigen::Index i = 0; i < n(); ++i) {
    const FreePart part = free_part(i, variant);
    const double w = machine.W(i, contact);
    gap.g += w * part.y;
    gap.length += std::abs(w * variant.x[i]);
    gap.velocity += w * part.u;
    gap.acceleration += w * part.acceleration;
  }
  gap.rounding += gap.length;
  return gap;
}

// The acceleration of the gap, a + w^T w lambda, is 0 while the contact is held.
Flight::Gap FamilyFlight::force(int contact, const Variant& variant) const {
  const Machine& machine = variant.machine;
  double a = 0.0, rate = 0.0, terms = 0.0;
  for (Eigen::Index g = 0; g < machine.groups(); ++g) {
    const Complex z = machine.gap_response(contact, g) *
                      Complex(variant.inputs[2 * g], variant.inputs[2 * g + 1]) *
                      variant.harmonics[static_cast<std::size_t>(g)];
    const double Omega = machine.frequencies[g];
    a -= Omega * Omega * z.real();
    rate += Omega * Omega * Omega * z.imag();
    terms += Omega * Omega * std::abs(z) * (1.0 + std::abs(Omega * end_));
  }
  const auto w = machine.W.col(contact);
  for (Eigen::Index r = 0; r < machine.records(); ++r) {
    const InputDerivatives& of = variant.recorded[static_cast<std::size_t>(r)];
    const double share = machine.shares(contact, r);
    a += share * of[2];
    rate += (share + w.dot(machine.recorded_forces.col(r))) * of[3];
    terms += std::abs(share * of[2]);
  }
  for (Eigen::Index i = 0; i < n(); ++i) {
    const FreePart part = free_part(i, variant);
    a += w[i] * part.acceleration;
    terms += 2.0 * std::abs(w[i]) *
             (std::abs(part.force) + std::abs(machine.C(i, 0) * part.u) +
              std::abs(machine.K(i, 0) * variant.x[i]));
  }
  const double lambda = -a / w.squaredNorm();
  for (Eigen::Index i = 0; i < n(); ++i) {
    const FreePart part = free_part(i, variant);
    const double acceleration = part.acceleration + w[i] * lambda;
    rate -= w[i] * (machine.C(i, 0) * acceleration + machine.K(i, 0) * part.u);
  }
  return {-a, -rate, 0.0, terms, terms};
}

void FamilyFlight::differences(int contact, bool of_force, Vector of_g, Vector of_velocity) const {
  const auto at = [&](std::size_t j) {
    return of_force ? force(contact, variants_[j]) : gap(contact, variants_[j]);
  };
  for (Eigen::Index k = 0; k < unknowns(); ++k) {
    const auto j = static_cast<std::size_t>(1 + 2 * k);
    const Gap above = at(j), below = at(j + 1);
    of_g[k] = (above.g - below.g) / (2.0 * difference_of_c);
    of_velocity[k] = (above.velocity - below.velocity) / (2.0 * difference_of_c);
  }
}

void FamilyFlight::gradients(int contact, bool of_force, Vector of_g, Vector of_velocity) const {
  const Machine& machine = centre().machine;
  of_g.setZero();
  of_velocity.setZero();
  for (Eigen::Index i = 0; i < n(); ++i) {
    const double w = machine.W(i, contact);
    of_g[i] = of_force ? w * machine.K(i, 0) : w;
    (of_force ? of_g : of_velocity)[n() + i] = of_force ? w * machine.C(i, 0) : w;
  }
}

// A contact that stays closed has restitution 0.
void FamilyFlight::strike(int contact, bool stays, Variant& variant) {
  const double gamma = gap(contact, variant).velocity;
  const auto w = variant.machine.W.col(contact);
  if (stays) {
    variant.x.tail(n()) -= (gamma / w.squaredNorm()) * w;
  } else {
    variant.x.tail(n()) -= gamma * variant.machine.jump.col(contact);
  }
}

ContactSet FamilyFlight::strike(int contact, bool stays, ContactSet) {
  struck_ = contact;
  stays_ = stays;
  const Gap before = gap(contact);
  const Machine& machine = centre().machine;
  const auto w = machine.W.col(contact);
  const auto jump = machine.jump.col(contact);
  // by_time_ = f-(x-) - f+(x+) - (d/dt jump), with the rates f- and f+ of x before and after the
  // impact. f+ includes the contact force if the contact stays closed.
  double along = 0.0;
  for (Eigen::Index i = 0; i < n(); ++i) {
    by_time_[i] = (stays ? w[i] / w.squaredNorm() : jump[i]) * before.velocity;
    by_time_[n() + i] = -machine.C(i, 0) * by_time_[i];
    along += w[i] * by_time_[n() + i];
  }
  if (stays) {
    by_time_.tail(n()) -= (along / w.squaredNorm()) * w;
  } else {
    by_time_.tail(n()) -= before.acceleration * jump;
  }
  const std::size_t count = derivatives_ ? variants_.size() : 1;
  for (std::size_t j = 0; j < count; ++j) strike(contact, stays, variants_[j]);
  difference();
  return stays ? bit(contact) : 0;
}

double FamilyFlight::restitution(int contact) const {
  const Machine& machine = centre().machine;
  return machine.W.col(contact).dot(machine.jump.col(contact)) - 1.0;
}

void FamilyFlight::along(int contact, Vector dx) const {
  const auto w = centre().machine.W.col(contact);
  dx.head(n()).setZero();
  dx.tail(n()) = w / w.squaredNorm();
}

void FamilyFlight::carry_through(Columns dx) const {
  const Machine& machine = centre().machine;
  const auto w = machine.W.col(struck_);
  for (auto column : dx.colwise()) {
    const double gamma = w.dot(column.tail(n()));
    if (stays_) {
      column.tail(n()) -= (gamma / w.squaredNorm()) * w;
    } else {
      column.tail(n()) -= gamma * machine.jump.col(struck_);
    }
  }
}

void FamilyFlight::enter(const ConstVector& q, const ConstVector& u, double, Vector x) {
  x.head(n()).noalias() = from_state_.topLeftCorner(n(), n()).lazyProduct(q);
  x.tail(n()).noalias() = from_state_.topLeftCorner(n(), n()).lazyProduct(u);
}

void FamilyFlight::state(const ConstVector& x, double, Vector q, Vector u) {
  q.noalias() = family_->V().lazyProduct(x.head(n()));
  u.noalias() = family_->V().lazyProduct(x.tail(n()));
}

double FamilyFlight::twice_energy(const Eigen::Ref<const Eigen::MatrixXd>& dx) const {
  double sum = 0.0;
  for (Eigen::Index i = 0; i < n(); ++i) {
    sum += dx.row(n() + i).squaredNorm() + stiffness_[i] * dx.row(i).squaredNorm();
  }
  return sum;
}

}  // namespace sprag
