// Small random machines of every structure that the exact flow distinguishes.
#pragma once

#include <Eigen/Core>
#include <array>

#include "sprag/model.h"
#include "tests/support/random.h"

namespace sprag {

enum class Structure {
  diagonal,       ///< M, C and K
  rayleigh,       ///< C = a M + b K: diagonalizable with any contacts locked
  simultaneous,   ///< diagonalizable, C otherwise arbitrary
  coupled,        ///< C arbitrary: complex modes
  repeated,       ///< K = k M, C arbitrary: diagonalizable through C alone
  repeated_pair,  ///< coupled, K with a twofold eigenvalue
  all_equal,      ///< K = k M, C = c M
  no_stiffness,   ///< K = 0, C arbitrary
  no_stiffness_no_damping,
  strongly_damped,  ///< coupled, and all modes overdamped
};
inline constexpr std::array structures{
    Structure::diagonal,       Structure::rayleigh,     Structure::simultaneous,
    Structure::coupled,        Structure::repeated,     Structure::repeated_pair,
    Structure::all_equal,      Structure::no_stiffness, Structure::no_stiffness_no_damping,
    Structure::strongly_damped};
inline constexpr std::array structure_names{
    "diagonal",       "rayleigh",     "simultaneous",
    "coupled",        "repeated",     "repeated_pair",
    "all_equal",      "no_stiffness", "no_stiffness_no_damping",
    "strongly_damped"};

Harmonic random_harmonic(Random& random);

/// M, C and K of f coordinates; no forces, no contacts.
Model random_machine(Random& random, Structure structure, Eigen::Index f);

/// Constant and harmonic forces.
void add_forces(Random& random, Model& model, int count);

/// Contacts with random directions of length 1, some of them on moving supports. The angle between
/// directions is at least 18 degrees if the number of coordinates allows it.
void add_contacts(Random& random, Model& model, int count);

State random_state(Random& random, const Model& model);

/// A machine of 1 to 6 coordinates and 1 to 3 independent contacts with equal restitution, which
/// forces press against them; `start` is outside of all supports. With one contact the law may be
/// Newton's.
struct ImpactingMachine {
  Model model;
  State start;
};
ImpactingMachine random_impacting_machine(Random& random);

}  // namespace sprag
