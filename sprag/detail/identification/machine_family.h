// The machines that the unknowns of a scene span, in coordinates y with q = V y and V^T M V = I:
//
//   y'' + C y' + K y = F(t),   g_i = w_i^T y + s_i(t) + c_i,   u+ = u- - jump_i gamma_i-,
//   jump_i = (1 + epsilon_i) w_i / (w_i^T w_i).
//
// The motion is linear in a few *inputs*: a and b of each group of harmonics, where the harmonic is
// a cos(Omega t) - b sin(Omega t) = Re (a + i b) e^(i Omega t); the gain of each recorded input; a
// factor on each constant force; and each clearance. Harmonics and records are *driving* inputs:
// paths are relative to the response to them.
//
// t is the time of the events by the nominal contact clock. With another rate and offset of the
// clock the machine's time is (t - shift) / scale (clock_scale(), clock_shift()). In t the machine
// has C / scale, K / scale^2, F / scale^2 and Omega / scale. With a record the clock is nominal.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sprag/detail/identification/recorded_response.h"
#include "sprag/detail/parameters/unknowns.h"
#include "sprag/scene.h"

namespace sprag {

/// One machine of the family, without its inputs. n coordinates, m contacts, G groups of harmonics,
/// R recorded inputs, J constant forces.
struct Machine {
  bool modal = false;               ///< C and K are diagonal
  Eigen::MatrixXd C, K;             ///< n x n, or their diagonals n x 1 if modal
  Eigen::MatrixXd W;                ///< n x m
  Eigen::MatrixXd jump;             ///< n x m
  Eigen::VectorXd frequencies;      ///< G
  Eigen::MatrixXcd response;        ///< n x G: steady y of a harmonic e^(i Omega t)
  Eigen::MatrixXcd gap_response;    ///< m x G: gaps by that y and the support's motion
  Eigen::MatrixXd constant_forces;  ///< n x J
  Eigen::VectorXd positions;        ///< x_c of each contact if it is an unknown, else NaN
  /// R responses to the recorded inputs, delayed by `delays`; null: R = 0.
  std::shared_ptr<const std::vector<RecordedResponse>> recorded;
  Eigen::VectorXd delays;           ///< R [s]
  Eigen::MatrixXd recorded_forces;  ///< n x R: forces by a(t) of each record
  Eigen::MatrixXd shares;           ///< m x R: motion of the supports by e(t) of each record

  Eigen::Index n() const { return W.rows(); }
  Eigen::Index groups() const { return frequencies.size(); }
  Eigen::Index records() const { return delays.size(); }
  /// 2 G + R.
  Eigen::Index driving() const { return 2 * groups() + records(); }
  /// 2 G + R + J + m.
  Eigen::Index inputs() const { return driving() + constant_forces.cols() + W.cols(); }
};

/// A gap and its derivatives.
struct GapMotion {
  double g = 0.0, rate = 0.0, acceleration = 0.0;
};

/// The motion of a gap at time t by record number r of gain 1: by the response to it and by the
/// support. Allocates.
GapMotion recorded_gap(const Machine& machine, int contact, Eigen::Index r, double t);

/// The response to the records at time t, with the gains of `inputs`: adds y and y'.
void add_recorded_motion(const Machine& machine, const Eigen::VectorXd& inputs, double t,
                         Eigen::Ref<Eigen::VectorXd> y, Eigen::Ref<Eigen::VectorXd> u);

/// The response to harmonics and records at time t, with the factors of `inputs`: adds y and y'.
void add_driven_motion(const Machine& machine, const Eigen::VectorXd& inputs, double t,
                       Eigen::Ref<Eigen::VectorXd> y, Eigen::Ref<Eigen::VectorXd> u);

/// Replaces forces F e^(i Omega t), n x c, by the steady motions y e^(i Omega t) that they cause.
void set_steady_response(const Machine& machine, double Omega, Eigen::Ref<Eigen::MatrixXcd> F);

class MachineFamily {
 public:
  /// Throws ModelError if M is not positive definite.
  MachineFamily(const Scene& scene, std::vector<Unknown> unknowns);

  const Scene& scene() const { return scene_; }
  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  Eigen::Index n() const { return scene_.model.coordinates(); }
  int contacts() const { return static_cast<int>(scene_.model.contacts.size()); }

  /// `values` are those of all unknowns in their order, the linear ones included. Not for several
  /// threads at once if the family has a record.
  Machine at(const Eigen::VectorXd& values) const;
  /// The same without responses to the records.
  Machine without_responses(const Eigen::VectorXd& values) const;
  Eigen::VectorXd inputs(const Eigen::VectorXd& values) const;
  /// The same in place, without responses to the records: `recorded` does not change. `machine` and
  /// `inputs` must come from this family. Does not allocate if the machine is modal.
  void at(const Eigen::VectorXd& values, Machine& machine) const;
  void inputs(const Eigen::VectorXd& values, Eigen::VectorXd& inputs) const;
  /// Rate of the contact clock over its nominal rate.
  double clock_scale(const Eigen::VectorXd& values) const;
  /// t at which the machine's time is 0 [s].
  double clock_shift(const Eigen::VectorXd& values) const;
  /// The frequencies of the groups of harmonics in t.
  void frequencies(const Eigen::VectorXd& values, Eigen::VectorXd& frequencies) const;
  /// Whether all machines of the family are modal.
  bool modal() const { return modal_; }
  /// d inputs / d value of unknown number k, which must be a linear one.
  Eigen::VectorXd inputs_rate(const Eigen::VectorXd& values, std::size_t k) const;

  Eigen::VectorXd nominal() const;

  const std::vector<HarmonicGroup>& groups() const { return groups_; }
  const std::vector<RecordedInput>& records() const { return records_; }
  /// Indices of the inputs: a of a group (b is the next one), the gain of a record, a constant
  /// force's factor, a clearance.
  Eigen::Index harmonic_input(int group) const { return Eigen::Index{2} * group; }
  Eigen::Index gain_input(int record) const { return harmonic_input(groups_count()) + record; }
  Eigen::Index constant_input(int force) const;
  Eigen::Index clearance_input(int contact) const;

  const Eigen::MatrixXd& V() const { return V_; }
  /// y for q.
  Eigen::VectorXd to_modes(const Eigen::VectorXd& q) const { return V_inverse_ * q; }

  /// The scene with these values, with t as the machine's time and with the nominal clock.
  Scene as_timed(const Eigen::VectorXd& values) const;

 private:
  // The responses to the records with this C and K.
  using Responses = std::shared_ptr<const std::vector<RecordedResponse>>;
  struct Tabulated {
    Eigen::MatrixXd C, K;
    Responses responses;
  };

  int groups_count() const { return static_cast<int>(groups_.size()); }
  // Index of the first constant force's factor: 2 G + R.
  Eigen::Index driving() const { return gain_input(static_cast<int>(records_.size())); }
  void set_delays(const Eigen::VectorXd& values, Machine& machine) const;
  void add_records();
  Responses responses_of(const Machine& machine) const;
  void set_flow(const Eigen::VectorXd& values, Machine& machine) const;
  void set_position(int contact, double position, Machine& machine) const;

  Scene scene_;
  std::vector<Unknown> unknowns_;
  std::vector<HarmonicGroup> groups_;
  std::vector<int> constants_;  // forces with a constant
  Eigen::MatrixXd V_, V_inverse_;
  bool modal_ = false;
  bool restitutions_differ_ = false;
  Eigen::MatrixXd C_, K_, W_;             // of the nominal scene, in y
  std::vector<Eigen::VectorXcd> forces_;  // of each group at amplitude 1, n entries
  Eigen::MatrixXcd motions_;              // and the supports' motions, m x G
  Eigen::MatrixXd constant_forces_;       // n x J
  std::vector<RecordedInput> records_;
  Eigen::MatrixXd recorded_forces_;   // n x R, of a(t)
  Eigen::MatrixXd recorded_motions_;  // m x R, of e(t)
  double longest_delay_ = 0.0;        // of any record in the search
  // The records' samples with gain 1 and delay 0; empty until responses are asked for.
  mutable std::vector<SampledInput> raw_;
  // The last responses that were asked for: a grid and difference quotients return to the same C
  // and K.
  mutable std::vector<Tabulated> tabulated_;
};

}  // namespace sprag
