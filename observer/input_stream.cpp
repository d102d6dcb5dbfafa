#include "observer/input_stream.h"

#include <cmath>
#include <limits>
#include <ostream>

#include "sprag/detail/mechanics/linear_algebra.h"
#include "sprag/detail/mechanics/scalars.h"

namespace sprag {
namespace {

constexpr double no_sample = -1.0;  // horizon of an input without samples
constexpr std::size_t most_lost = 100;

void widen_all(double by, const Eigen::VectorXd& push, Eigen::VectorXd& sigma) {
  for (Eigen::Index i = 0; i < sigma.size(); ++i) sigma[i] = std::hypot(sigma[i], by * push[i]);
}

}  // namespace

StreamedScene::StreamedScene(const Scene& of)
    : scene(of.stream_duration > 0.0 ? with_stream(of, input) : of) {}

InputStream::InputStream(const StreamedScene& of, Flows& flows, TimeLine& time_line)
    : of_(of), flows_(flows), time_line_(time_line), history_(*of_.input) {
  const Model& model = of_.scene.model;
  Eigen::VectorXd acceleration = Eigen::VectorXd::Zero(model.coordinates());
  for (const Force& force : model.forces) {
    if (!force.input) continue;
    acceleration +=
        solve_definite(model.M.cast<Extended>(), force.direction.cast<Extended>()).cast<double>();
  }
  push_ = acceleration.cwiseAbs();
  push_gaps_.resize(static_cast<Eigen::Index>(model.contacts.size()));
  for (std::size_t i = 0; i < model.contacts.size(); ++i) {
    push_gaps_[static_cast<Eigen::Index>(i)] = std::abs(model.contacts[i].w.dot(acceleration));
  }
  push_outputs_.resize(static_cast<Eigen::Index>(model.outputs.size()));
  for (std::size_t i = 0; i < model.outputs.size(); ++i) {
    push_outputs_[static_cast<Eigen::Index>(i)] =
        std::abs(model.outputs[i].direction.dot(acceleration));
    velocities_.push_back(model.outputs[i].velocity);
  }
  lost_.reserve(most_lost);
  time_line_.receive_input(no_sample, no_sample);
}

void InputStream::restart() {
  late_ = false;
  history_.restart();
  flows_.follow_input();
  time_line_.receive_input(no_sample, no_sample);
}

void InputStream::take(const InputMessage& message) {
  const bool first = !history_.started();
  const InputHistory::Taken taken = history_.take(message);
  if (!taken.any) return;
  flows_.follow_input();
  if (first) {
    late_ = history_.input().knots().front() >
            tick_instant(std::max<std::int64_t>(time_line_.first_tick(), 0), time_line_.h()).hi;
    time_line_.receive_input(no_sample, late_ ? no_sample : newest());
    return;
  }
  if (late_) return;
  time_line_.receive_input(taken.from, newest());
  if (taken.gap_to > taken.gap_from && lost_.size() < most_lost) {
    lost_.push_back({taken.gap_from, taken.gap_to});
  }
}

bool InputStream::restarts_after(const ContactMessage& message) {
  if (!late_ || !(message.horizon >= history_.input().knots().front())) return false;
  late_ = false;
  time_line_.restart_after(message);
  time_line_.receive_input(no_sample, newest());
  return true;
}

void InputStream::print(std::ostream& out) const {
  const InputCounts& counts = this->counts();
  if (!started()) out << "no sample on SPRAG_INPUT: nothing settles without the excitation\n";
  if (counts.refused > 0) {
    out << counts.refused << " input messages refused: their interval is not that of the record, "
        << "or their t0 changed within a session\n";
  }
  if (counts.gaps > 0) {
    out << counts.filled << " samples of the input were lost in " << counts.gaps
        << " gaps and interpolated, the first from t = " << lost_.front().from << " to "
        << lost_.front().to << "; the estimates there are worse\n";
  }
  if (counts.no_room > 0) {
    out << "the input has no room after t = " << newest()
        << ": set excitation.stream_duration; the estimate holds its last value\n";
  }
}

void InputStream::widen(EstimateSample& sample) const {
  Confidence& confidence = sample.confidence;
  if (!started()) {
    constexpr double unknown = std::numeric_limits<double>::infinity();
    for (Eigen::VectorXd* sigma : {&confidence.sigma_q, &confidence.sigma_u, &confidence.sigma_g,
                                   &confidence.sigma_outputs}) {
      sigma->setConstant(unknown);
    }
    return;
  }
  const double age = sample.t - newest();
  if (!(age > 0.0)) return;
  // The held value and the present one differ by sqrt(2) of the rms if they are independent.
  const double error = std::sqrt(2.0) * history_.input().appended_rms();
  const double of_velocity = error * age, of_position = 0.5 * error * square(age);
  widen_all(of_position, push_, confidence.sigma_q);
  widen_all(of_velocity, push_, confidence.sigma_u);
  widen_all(of_position, push_gaps_, confidence.sigma_g);
  for (Eigen::Index i = 0; i < confidence.sigma_outputs.size(); ++i) {
    const double by = velocities_[static_cast<std::size_t>(i)] ? of_velocity : of_position;
    confidence.sigma_outputs[i] = std::hypot(confidence.sigma_outputs[i], by * push_outputs_[i]);
  }
}

}  // namespace sprag
