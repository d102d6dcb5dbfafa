// Drives MuJoCo (DeepMind, 2.2.2), Euler integrator: a body on a slide joint for each coordinate,
// joint stiffness and damping from K and C, a fixed tendon w^T q with a lower limit for each
// contact, f(t) applied to the joints, in coordinates in which the supports rest.
// MuJoCo has no restitution. A limit requests the acceleration -b r' - k r of the tendon and only
// pushes: b = (1 + epsilon) / h turns r' into -epsilon r' in the one step that finds it inside the
// limit, which is Newton's law. k pushes a resting contact out of the limit; it adds to the
// rebound, so it is small.
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "studies/peers/peers.h"
#include "studies/peers/resting_supports.h"
#include "studies/work_precision/machine.h"

namespace sprag::work_precision {
namespace {

constexpr double impedance = 0.9999;  // the largest value that MuJoCo accepts
constexpr double push_out = 1e-5;     // k h^2
constexpr double far_away = 1e9;      // upper limit of a tendon [m]

[[noreturn]] void fail(const char* message) { throw std::runtime_error(message); }
void ignore(const char*) {}

/// MuJoCo's own handlers exit the process and write a log file.
class Handlers {
 public:
  Handlers() : error_(mju_user_error), warning_(mju_user_warning) {
    mju_user_error = fail;
    mju_user_warning = ignore;
  }
  ~Handlers() {
    mju_user_error = error_;
    mju_user_warning = warning_;
  }
  Handlers(const Handlers&) = delete;
  Handlers& operator=(const Handlers&) = delete;

 private:
  void (*error_)(const char*);
  void (*warning_)(const char*);
};

std::string describe(const Model& model, double h) {
  std::ostringstream xml;
  xml.precision(17);
  xml << "<mujoco><option timestep='" << h << "' integrator='Euler' tolerance='1e-14'>"
      << "<flag gravity='disable' contact='disable' equality='disable' frictionloss='disable' "
      << "actuation='disable' warmstart='disable'/></option><worldbody>";
  for (Eigen::Index i = 0; i < model.coordinates(); ++i) {
    xml << "<body><inertial pos='0 0 0' mass='" << model.M(i, i) << "' diaginertia='1 1 1'/>"
        << "<joint name='q" << i << "' type='slide' axis='1 0 0' stiffness='" << model.K(i, i)
        << "' damping='" << model.C(i, i) << "'/></body>";
  }
  xml << "</worldbody><tendon>";
  for (const Contact& contact : model.contacts) {
    xml << "<fixed limited='true' range='" << -contact.clearance << ' ' << far_away
        << "' solimplimit='" << impedance << ' ' << impedance << " 0.001 0.5 2' solreflimit='"
        << -push_out / (h * h) << ' ' << -(1.0 + contact.restitution) / h << "'>";
    for (Eigen::Index i = 0; i < model.coordinates(); ++i) {
      if (contact.w[i] != 0.0) xml << "<joint joint='q" << i << "' coef='" << contact.w[i] << "'/>";
    }
    xml << "</fixed>";
  }
  xml << "</tendon></mujoco>";
  return xml.str();
}

struct Deleter {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};

std::unique_ptr<mjModel, Deleter> compile(const std::string& xml) {
  const auto files = std::make_unique<mjVFS>();
  mj_defaultVFS(files.get());
  constexpr const char* name = "machine.xml";
  if (mj_makeEmptyFileVFS(files.get(), name, static_cast<int>(xml.size())) != 0) {
    throw std::runtime_error("no room for the model");
  }
  std::memcpy(files->filedata[mj_findFileVFS(files.get(), name)], xml.data(), xml.size());
  char error[1000] = "";
  std::unique_ptr<mjModel, Deleter> model(mj_loadXML(name, files.get(), error, sizeof error));
  mj_deleteVFS(files.get());
  if (!model) throw std::runtime_error(error);
  return model;
}

void simulate(const Task& task, double h, Outcome& outcome) {
  const RestingSupports supports(task.model);
  const Machine machine(supports.model());
  const Eigen::Index f = machine.f();
  const auto model = compile(describe(supports.model(), h));
  const std::unique_ptr<mjData, Deleter> data(mj_makeData(model.get()));
  const State start = supports.into(task.start);
  std::copy_n(start.q.data(), f, data->qpos);
  std::copy_n(start.u.data(), f, data->qvel);

  Eigen::VectorXd force(f);
  std::vector<bool> pushed(task.model.contacts.size(), false);
  std::vector<bool> pushed_before = pushed;
  const std::int64_t steps = std::llround(task.horizon / h);
  Eigen::Index next = 0;
  std::int64_t next_step = task.sample_step > 0.0 ? 0 : steps + 1;
  for (std::int64_t k = 0;; ++k) {
    const double t = static_cast<double>(k) * h;
    if (k == next_step) {
      outcome.q.col(next) = Eigen::Map<const Eigen::VectorXd>(data->qpos, f);
      outcome.u.col(next) = Eigen::Map<const Eigen::VectorXd>(data->qvel, f);
      supports.out_of(t, outcome.q.col(next), outcome.u.col(next));
      ++next;
      next_step = next < task.samples() ? std::llround(task.sample_time(next) / h) : steps + 1;
    }
    if (k == steps) return;
    machine.force(t, force);
    std::copy_n(force.data(), f, data->qfrc_applied);
    mj_step(model.get(), data.get());
    outcome.steps = k + 1;
    // After a divergence MuJoCo resets its state, with a warning.
    for (const int warning : {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC}) {
      if (data->warning[warning].number > 0) throw std::runtime_error("diverged");
    }
    if (data->nefc > 0) ++outcome.solves;
    pushed.swap(pushed_before);
    std::fill(pushed.begin(), pushed.end(), false);
    int closed = 0;
    for (int i = 0; i < model->ntendon; ++i) {
      if (data->ten_length[i] <= model->tendon_range[2 * i]) ++closed;
    }
    if (closed > 1 && data->nefc > 0 && task.model.law == ImpactLaw::poisson) {
      throw std::runtime_error("Poisson's law for several contacts at once");
    }
    for (int row = 0; row < data->nefc; ++row) {
      if (data->efc_force[row] <= 0.0) continue;
      const auto i = static_cast<std::size_t>(data->efc_id[row]);
      pushed[i] = true;
      if (!pushed_before[i]) outcome.impacts.push_back(static_cast<double>(k + 1) * h);
    }
  }
}

}  // namespace

void run_mujoco(const Task& task, double setting, Outcome& outcome) {
  const Model& model = task.model;
  if (!model.M.isDiagonal(0.0) || !model.C.isDiagonal(0.0) || !model.K.isDiagonal(0.0)) {
    outcome.failure = "diagonal machines only";
    return;
  }
  try {
    const Handlers handlers;
    simulate(task, setting, outcome);
  } catch (const std::exception& error) {
    outcome.failure = error.what();
  }
}

}  // namespace sprag::work_precision
