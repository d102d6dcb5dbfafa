// Products of dense matrices for the real-time loop: they do not allocate, and use the widest
// registers of the processor. Each entry is summed in the order of the inner index, so the result
// is the same on every processor.
#pragma once

#include <Eigen/Core>

namespace sprag {

/// C = A B with matching sizes; C must not alias A or B. Does not allocate.
void multiply(const Eigen::Ref<const Eigen::MatrixXd>& A,
              const Eigen::Ref<const Eigen::MatrixXd>& B, Eigen::Ref<Eigen::MatrixXd> C);

/// C += A B; the product is summed first. C must not alias A or B.
void multiply_and_add(const Eigen::Ref<const Eigen::MatrixXd>& A,
                      const Eigen::Ref<const Eigen::MatrixXd>& B, Eigen::Ref<Eigen::MatrixXd> C);

}  // namespace sprag
