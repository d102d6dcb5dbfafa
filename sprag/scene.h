/// \file
/// \brief A scene: the model of a machine, the prior of the observer, and the truth of the master.
///
/// How far a machine may be from its model: a ParameterUncertainty is the table [parameters] of a
/// scene, for estimators. A Tolerance is the table [tolerance], for the bound B on the error
/// energy, which is proven within these limits.
///
/// Contacts are counted from 0.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sprag/beam.h"
#include "sprag/confidence.h"
#include "sprag/contact_event.h"
#include "sprag/model.h"

namespace sprag {

/// \brief Joint normal distribution of P parameters about the values of the scene.
///
/// sigma has the unit of the parameter's value.
struct ParameterUncertainty {
  std::vector<std::string> keys;  ///< keys of scene files, in the order of the file; no key twice
  Eigen::VectorXd sigma;          ///< standard deviations, P entries, > 0
  Eigen::MatrixXd correlation;    ///< P x P, symmetric, positive semidefinite, unit diagonal
  /// \brief Whether a filter only considers the parameter (Schmidt 1966): its uncertainty is part
  /// of the covariance, and its value is never updated. P entries.
  std::vector<bool> consider;

  /// \brief Whether no parameter is uncertain.
  /// \return true if P is 0.
  bool empty() const { return keys.empty(); }
  /// \brief Number of parameters.
  /// \return P.
  Eigen::Index size() const { return sigma.size(); }

  /// \brief A square root of the covariance. It exists for a singular correlation too.
  /// \return S, P x P, with S S^T = diag(sigma) correlation diag(sigma); not triangular.
  Eigen::MatrixXd root_of_covariance() const;
};

/// \brief Largest deviations of the machine and its event reports from the scene, all >= 0.
///
/// A standard deviation is not such a limit. A normal distribution must be truncated, for example
/// at 4 sigma; B then holds while no deviation is larger.
struct Tolerance {
  /// \brief Largest value of stiffness and of damping that a scene may specify.
  static constexpr double largest_share = 0.5;
  /// \brief Largest value of restitution that a scene may specify.
  static constexpr double largest_restitution = 1.0;

  double time = 0.0;         ///< of a reported event time from the true one [s]
  double restitution = 0.0;  ///< of each restitution epsilon, absolute; may differ at each impact
  double stiffness = 0.0;    ///< the true K is (1 + k) K with |k| <= stiffness
  double damping = 0.0;      ///< the true C is (1 + c) C with |c| <= damping
  double force = 0.0;        ///< of the force on the machine, in the norm |f| = sqrt(f^T M^-1 f)
  double clearance = 0.0;    ///< of each clearance [m]

  /// \brief Whether some deviation is allowed. Otherwise the bound is that of an exact machine.
  /// \return true if one is > 0.
  bool any() const {
    return std::max({time, restitution, stiffness, damping, force, clearance}) > 0.0;
  }
  /// \brief Compares all members.
  friend bool operator==(const Tolerance&, const Tolerance&) = default;
};

/// \brief Parameters that identification may change (parameters/scene_parameters.h): [adapt] of a
/// scene.
struct Adaptation {
  std::vector<std::string> free;  ///< keys of parameters; empty: all that are identifiable
  /// \brief Largest relative error of each parameter: one value for all, or one for each of `free`.
  Eigen::VectorXd within = Eigen::VectorXd::Constant(1, 0.2);
  /// \brief Relative standard deviation of each parameter's random walk after a unit of time;
  /// entries as in `within`.
  Eigen::VectorXd walk = Eigen::VectorXd::Zero(1);

  /// \brief Whether some parameter has a random walk.
  /// \return true if one has.
  bool walks() const { return (walk.array() > 0.0).any(); }
};

/// \brief Shaken frame of a general system. The coordinates are measured against the frame.
///
/// The frame's motion e(t) acts as the force -M r e''(t), and moves supports on the ground by
/// w_i^T r e(t).
struct ShakenFrame {
  Eigen::VectorXd influence;       ///< r, f entries: q of the ground's motion by 1 with the machine
                                   ///< keeping its shape
  Harmonic motion;                 ///< harmonic part of e(t)
  std::size_t force = 0;           ///< index of -M r e''(t) in the model's forces
  std::vector<int> on_ground;      ///< contacts whose support moves by w_i^T r e(t), from 0
  SampledInputPointer input = {};  ///< sampled part of e(t) and e''(t); null: none
};

/// \brief Force of a shaken frame.
/// \param M mass matrix, f x f.
/// \param frame the frame.
/// \return -M r e''(t).
Force frame_force(const Eigen::MatrixXd& M, const ShakenFrame& frame);

/// \brief Motion of a support on the ground, seen from a shaken frame.
/// \param w direction of the contact, f entries.
/// \param frame the frame.
/// \return s(t) = w^T r e(t).
Harmonic ground_motion(const Eigen::VectorXd& w, const ShakenFrame& frame);

/// \brief Coordinates of a [system] that keeps some of its modes (system.modes).
///
/// The file gives N coordinates, and the model has f <= N: q_given = Phi q, and q = Phi^T M q_given
/// is the nearest state in the norm of the given mass matrix M. See kept_modes() in reduction.h.
struct KeptModes {
  int modes = 0;  ///< number of kept modes; the other f - modes coordinates are static vectors
  Eigen::MatrixXd Phi;        ///< N x f, Phi^T M Phi = 1
  Eigen::MatrixXd to_kept;    ///< Phi^T M, f x N
  Eigen::VectorXd stiffness;  ///< diagonal of Phi^T K Phi, f entries; 0 for a rigid motion
  Eigen::MatrixXd C, K;       ///< as given, N x N
  std::vector<Eigen::VectorXd> given_w;  ///< directions of the contacts as given, N entries each

  /// \brief Number of the given coordinates.
  /// \return N.
  Eigen::Index given() const { return Phi.rows(); }
};

/// \brief Prior of the observer: its knowledge before the first event. f coordinates.
struct Prior {
  State start;                  ///< mean of the start, padded with zeros to f entries
  Eigen::VectorXd uncertainty;  ///< energies of the start's error, by coordinate if M and K are
                                ///< diagonal, else by mode; empty: not given
  std::optional<State> sigma;   ///< standard deviations of the start, instead of uncertainty
  double drift = 0.0;           ///< energy of the model's process noise per unit of time
  double jitter = 0.0;          ///< standard deviation of event times [s]
  ConfidenceLevel confidence = ConfidenceLevel::high;  ///< before the filter is shown
  Tolerance tolerance;              ///< hard limits of deviations; all 0: the scene is exact
  Adaptation adaptation;            ///< parameters that identification may change
  ParameterUncertainty parameters;  ///< uncertain parameters; empty: not given
};

/// \brief Truth: input of the simulated machine (master) only. f coordinates.
struct Truth {
  State start;                       ///< start of the master, padded with zeros to f entries
  bool given = true;                 ///< false: the scene does not give the start
  bool release_penetration = false;  ///< master.penetration = "release"
};

/// \brief Content of a scene file. f coordinates, m contacts.
struct Scene {
  std::string name;                  ///< key `name`, or the file's stem
  Model model;                       ///< the machine
  std::optional<Beam> beam;          ///< set if the scene has a [beam]
  std::vector<double> positions;     ///< x_c of a beam's contacts [m]; empty without a beam
  std::optional<ShakenFrame> frame;  ///< set if a [system] has an [excitation]
  ContactClock clock;                ///< clock of the event times, [clock]
  /// \brief Set if a [system] has the key `modes`: the coordinates of the model are then those of
  /// KeptModes. Copies of the scene share it.
  std::shared_ptr<const KeptModes> kept = {};
  /// \brief Longest run in which an observer receives the excitation's samples while it runs,
  /// instead of reading its record [s]; 0: it reads the record.
  double stream_duration = 0.0;
  /// \brief One unit of the sensor's raw values in the unit of the excitation, by the key `unit`;
  /// 1 without a streamed excitation. Samples of a message are in the unit of the excitation.
  double stream_unit = 1.0;
  Prior prior;                       ///< knowledge of the observer
  Truth truth;                       ///< start of the master
  std::vector<std::string> remarks;  ///< remarks of the reader for people, one line each
};

/// \brief The scene with a streamed input in place of the record of its excitation.
/// \param scene a scene with stream_duration > 0.
/// \param input receives the streamed input, which has no sample yet.
/// \return the scene; its stream_duration is 0.
Scene with_stream(const Scene& scene, std::shared_ptr<SampledInput>& input);

}  // namespace sprag
