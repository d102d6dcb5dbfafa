// A random machine between two stops on the frame.
#pragma once

#include <Eigen/Core>

#include "sprag/scene.h"
#include "tests/support/random.h"

namespace sprag::test {

/// Direction in which the stops act: the first of f coordinates.
inline Eigen::VectorXd across(Eigen::Index f) { return Eigen::VectorXd::Unit(f, 0); }

/// f coordinates without a force; restitution 0.7. C is Rayleigh damping, or arbitrary if
/// `coupled`.
inline Scene rattle(Random& random, Eigen::Index f, bool coupled = false) {
  Scene scene;
  Model& model = scene.model;
  model.M = random.positive_definite(f, 0.8, 1.3);
  model.K = random.positive_definite(f, 15.0, 60.0);
  model.C = coupled ? random.positive_definite(f, 0.1, 0.5) : 0.2 * model.M + 0.004 * model.K;
  for (const double side : {1.0, -1.0}) {
    Contact contact;
    contact.w = side * across(f);
    contact.clearance = random.uniform(0.04, 0.06);
    contact.restitution = 0.7;
    model.contacts.push_back(contact);
  }
  scene.truth.start = {Eigen::VectorXd::Zero(f), 0.3 * across(f)};
  scene.prior.start = {0.03 * across(f), Eigen::VectorXd::Zero(f)};
  return scene;
}

}  // namespace sprag::test
