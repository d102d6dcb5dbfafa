// SUNDIALS CVODE (Hindmarsh et al., "SUNDIALS: Suite of nonlinear and differential/algebraic
// equation solvers", ACM Trans. Math. Softw. 31, 2005): Adams-Moulton with fixed-point iteration,
// or BDF with Newton's method and a dense Jacobian by differences. CVODE's own root finding ends a
// step at the first event. ContactPhases (event_loop.h) computes the state after the event, and
// CVODE restarts.
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <memory>
#include <vector>

#include "studies/peers/peers.h"
#include "studies/work_precision/methods/event_loop.h"

namespace sprag::work_precision {
namespace {

void check(int flag, const char* what) {
  if (flag >= 0) return;
  throw std::runtime_error(std::string(what) + " failed with " + std::to_string(flag));
}

template <typename T>
T* check(T* created, const char* what) {
  if (created == nullptr) throw std::runtime_error(std::string(what) + " failed");
  return created;
}

struct Free {
  void operator()(SUNContext context) const { SUNContext_Free(&context); }
  void operator()(N_Vector v) const { N_VDestroy(v); }
  void operator()(SUNMatrix A) const { SUNMatDestroy(A); }
  void operator()(SUNLinearSolver solver) const { SUNLinSolFree(solver); }
  void operator()(SUNNonlinearSolver solver) const { SUNNonlinSolFree(solver); }
};

template <typename T>
using Owner = std::unique_ptr<std::remove_pointer_t<T>, Free>;

struct FreeIntegrator {
  void operator()(void* memory) const { CVodeFree(&memory); }
};

SUNContext create_context() {
  SUNContext context = nullptr;
#if SUNDIALS_VERSION_MAJOR >= 7
  check(SUNContext_Create(SUN_COMM_NULL, &context), "SUNContext_Create");
  // Failures are reported in the outcome.
  check(SUNContext_ClearErrHandlers(context), "SUNContext_ClearErrHandlers");
#else
  check(SUNContext_Create(nullptr, &context), "SUNContext_Create");
#endif
  return context;
}

sunindextype state_size(const ContactPhases& phases) {
  return static_cast<sunindextype>(2 * phases.f());
}

class Cvode {
 public:
  /// method: CV_ADAMS or CV_BDF
  Cvode(int method, ContactPhases& phases, double tolerance)
      : phases_(&phases),
        context_(create_context()),
        x_(check(N_VNew_Serial(state_size(phases), context_.get()), "N_VNew_Serial")),
        scratch_(check(N_VNew_Serial(state_size(phases), context_.get()), "N_VNew_Serial")),
        memory_(check(CVodeCreate(method, context_.get()), "CVodeCreate")),
        found_(static_cast<std::size_t>(phases.m())) {
    void* cvode = memory_.get();
    N_VConst(0.0, x_.get());
    check(CVodeInit(cvode, derivative, 0.0, x_.get()), "CVodeInit");
#if SUNDIALS_VERSION_MAJOR < 7
    // Failures are reported in the outcome.
    check(CVodeSetErrFile(cvode, nullptr), "CVodeSetErrFile");
#endif
    check(CVodeSetUserData(cvode, &phases), "CVodeSetUserData");
    check(CVodeSStolerances(cvode, tolerance, tolerance), "CVodeSStolerances");
    check(CVodeRootInit(cvode, phases.m(), signals), "CVodeRootInit");
    std::vector<int> falling(static_cast<std::size_t>(phases.m()), -1);
    if (phases.m() > 0)
      check(CVodeSetRootDirection(cvode, falling.data()), "CVodeSetRootDirection");
    if (method == CV_ADAMS) {
      fixed_point_.reset(
          check(SUNNonlinSol_FixedPoint(x_.get(), 0, context_.get()), "SUNNonlinSol_FixedPoint"));
      check(CVodeSetNonlinearSolver(cvode, fixed_point_.get()), "CVodeSetNonlinearSolver");
    } else {
      const sunindextype size = state_size(phases);
      jacobian_.reset(check(SUNDenseMatrix(size, size, context_.get()), "SUNDenseMatrix"));
      linear_.reset(
          check(SUNLinSol_Dense(x_.get(), jacobian_.get(), context_.get()), "SUNLinSol_Dense"));
      check(CVodeSetLinearSolver(cvode, linear_.get(), jacobian_.get()), "CVodeSetLinearSolver");
    }
  }

  void restart(double t, std::span<const double> x) {
    std::copy(x.begin(), x.end(), NV_DATA_S(x_.get()));
    check(CVodeReInit(memory_.get(), t, x_.get()), "CVodeReInit");
    reached_ = t;
    rooted_ = false;
  }

  double step() {
    // The end given only sets the direction of time and bounds the first step.
    const int flag = CVode(memory_.get(), reached_ + 1.0, x_.get(), &reached_, CV_ONE_STEP);
    check(flag, "CVode");
    rooted_ = flag == CV_ROOT_RETURN;
    return reached_;
  }

  void interpolate(double t, double* x) {
    const N_Vector from = t == reached_ ? x_.get() : scratch_.get();
    if (t != reached_) check(CVodeGetDky(memory_.get(), t, 0, from), "CVodeGetDky");
    std::copy_n(NV_DATA_S(from), NV_LENGTH_S(from), x);
  }

  ContactSet fired() {
    if (!rooted_) return 0;
    check(CVodeGetRootInfo(memory_.get(), found_.data()), "CVodeGetRootInfo");
    ContactSet fired = 0;
    for (int i = 0; i < phases_->m(); ++i) {
      if (found_[static_cast<std::size_t>(i)] != 0) fired |= bit(i);
    }
    return fired;
  }

 private:
  static int derivative(double t, N_Vector x, N_Vector rate, void* phases) {
    static_cast<ContactPhases*>(phases)->derivative(t, NV_DATA_S(x), NV_DATA_S(rate));
    return 0;
  }

  static int signals(double t, N_Vector x, double* values, void* data) {
    auto* phases = static_cast<ContactPhases*>(data);
    for (int i = 0; i < phases->m(); ++i) values[i] = phases->signal(i, t, NV_DATA_S(x));
    return 0;
  }

  ContactPhases* phases_;
  Owner<SUNContext> context_;
  Owner<N_Vector> x_, scratch_;
  Owner<SUNMatrix> jacobian_;
  Owner<SUNLinearSolver> linear_;
  Owner<SUNNonlinearSolver> fixed_point_;
  std::unique_ptr<void, FreeIntegrator> memory_;
  std::vector<int> found_;
  double reached_ = 0.0;
  bool rooted_ = false;
};

void run(int method, const Task& task, double tolerance, Outcome& outcome) {
  try {
    ContactPhases phases(task, outcome, tolerance);
    Cvode integrator(method, phases, tolerance);
    run_events(task, phases, integrator, outcome);
  } catch (const std::exception& error) {
    outcome.failure = error.what();
  }
}

}  // namespace

void run_cvode_adams(const Task& task, double tolerance, Outcome& outcome) {
  run(CV_ADAMS, task, tolerance, outcome);
}

void run_cvode_bdf(const Task& task, double tolerance, Outcome& outcome) {
  run(CV_BDF, task, tolerance, outcome);
}

}  // namespace sprag::work_precision
