// Flight and impact of one model by its exact flows (flow.h), for any damping and any set of closed
// contacts. x = (z, z') are the modes of free flight. While contacts are closed, the machine moves
// on the flow of that locked set. An impact while others are closed follows the impact law
// (active_impact.h).
#pragma once

#include <memory>
#include <vector>

#include "sprag/detail/filter/flight.h"
#include "sprag/detail/mechanics/event_search.h"
#include "sprag/detail/mechanics/flows.h"
#include "sprag/detail/replica/active_impact.h"

namespace sprag {

class ModelFlight final : public Flight {
 public:
  explicit ModelFlight(std::shared_ptr<Flows> flows);

  Flows& flows() const { return *flows_; }

  Eigen::Index n() const override { return f_; }
  Eigen::Index unknowns() const override { return 0; }
  int contacts() const override { return flows_->dynamics().contacts(); }
  void set(const ConstVector& c, bool derivatives) override;
  bool can_hold(ContactSet held) const override;
  ContactSet independent(ContactSet first, ContactSet closed) const override;
  void fly(const ConstVector& x, double t, double tau, ContactSet held) override;
  void fly_on(double tau, ContactSet held) override;
  void carry(Columns dx) override;
  void carry_by_unknown(Eigen::Index k, Vector dx) override;
  bool changes_flow(Eigen::Index k) const override;
  void turn(double tau, ContactSet held, Columns dx) override;
  double largest_frequency() const override { return fastest_; }
  double smallest_frequency() const override { return slowest_; }
  Gap gap(int contact) const override;
  double open_for() override;
  Gap force(int contact) const override;
  void gradients(int contact, bool of_force, Vector of_g, Vector of_velocity) const override;
  void acceleration_gradient(int contact, Vector of) const override;
  void differences(int contact, bool of_force, Vector of_g, Vector of_velocity) const override;
  ContactSet strike(int contact, bool stays, ContactSet held, double sigma = 0.0) override;
  void carry_through(Columns dx) const override;
  bool strike_together(ContactSet closing, ContactSet staying, ContactSet kept, ContactSet leaving,
                       Vector x, Columns dx, Vector unknown) override;
  const Eigen::VectorXd& by_time() const override { return by_time_; }
  void along(int contact, Vector dx) const override;
  double restitution(int contact) const override;
  double restitution(int contact, double gamma) const override;
  void enter(const ConstVector& q, const ConstVector& u, double t, Vector x) override;
  void state(const ConstVector& x, double t, Vector q, Vector u) override;
  const Eigen::MatrixXd& to_state() const override { return to_state_; }
  const Eigen::MatrixXd& from_state() const override { return from_state_; }
  double twice_energy(const Eigen::Ref<const Eigen::MatrixXd>& dx) const override;

 private:
  struct Jump {
    double change = 0.0;  // of gamma over -gamma-
    ContactSet staying = 0;
  };

  const Flow& free() const { return (*flows_)[0]; }
  const Model& model() const { return flows_->dynamics().model(); }
  const Contact& contact(int i) const { return model().contacts[static_cast<std::size_t>(i)]; }
  void set_motion(const ConstVector& x, double t);
  void move(double tau, ContactSet held);
  void carry(const Flow& flow, const OscillatorKernels& kernels, Columns dx);
  void carry_held(const Flow& flow, const OscillatorKernels& kernels, Columns dx);
  void find_rates(Vector of) const;
  Jump jump_of(int contact, double epsilon, bool ends_chatter, ContactSet others,
               Vector direction) const;

  std::shared_ptr<Flows> flows_;
  Eigen::Index f_, first_;  // coordinates; index of the first mode of a flow
  double fastest_ = 0.0, slowest_ = 1.0;
  Eigen::MatrixXd to_state_, from_state_;  // 2f x 2f
  Eigen::MatrixXd kicks_;                  // 2f x m: dx by M^-1 w_i
  Eigen::MatrixXd energy_;                 // to_state^T diag(K, M) to_state
  Motion motion_, closed_;                 // on the free flow; on the flow of held_
  ContactSet held_ = 0;
  double tau_ = 0.0;  // of the last flight
  EventSearch search_;
  std::vector<Watch> gaps_to_watch_;
  bool kernels_known_ = false;
  OscillatorKernels kernels_, turn_;
  // Derivative of the impact of strike() by gamma-: x += -change_ d gamma direction_.
  Eigen::VectorXd direction_, by_velocity_, by_time_;
  double change_ = 0.0;
  Eigen::VectorXd restitution_;  // m entries
  ActiveImpact impact_;          // of strike_together()
  std::vector<Closing> closings_;
  Eigen::VectorXd u_before_, difference_;
  Eigen::VectorXd no_gaps_;  // empty
  Eigen::VectorXd gaps_;
  mutable Eigen::VectorXd q_, u_, rates_;       // scratch
  Eigen::MatrixXd Q_, U_, Z_, V_, deflection_;  // scratch of carry()
};

}  // namespace sprag
