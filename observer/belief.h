// What a filter knows of the state x = (q, u) at an instant: mean and a square root S of the
// covariance, P = S S^T. And what a report says that is to be made of it.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "mechanics/contact_event.h"

namespace sprag {

struct Belief {
  Eigen::VectorXd q, u;      ///< mean, f entries each
  Eigen::MatrixXd S_q, S_u;  ///< f rows each; the first `columns` columns are S
  Eigen::Index columns = 0;
};

/// Largest terms of gaps [m] and of their velocities [m/s]: their roundings are in proportion.
struct Terms {
  double length = 0.0, speed = 0.0;
};

/// An event of one contact at a time that is not quite known.
struct Report {
  enum class Kind : std::int8_t {
    none,     ///< no event, or several at one instant
    pulse,    ///< an impact
    burst,    ///< an impact so soon after the last that their times cannot be told apart
    stays,    ///< an impact after which the contact stays closed
    releases  ///< of a contact that was locked
  };
  Kind kind = Kind::none;
  int contact = 0;
  ContactSet held = 0;  ///< closed before and after
};

}  // namespace sprag
