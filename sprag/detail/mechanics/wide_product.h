// Products of dense matrices inside the real-time loop: without memory of their own, in the widest
// registers that the processor has. Each entry is summed in the order of the inner index, so that
// it is the same number on every processor.
#pragma once

#include <Eigen/Core>

namespace sprag {

/// C = A B. Sizes fit, C is another object than A and B. Does not allocate.
void multiply(const Eigen::Ref<const Eigen::MatrixXd>& A,
              const Eigen::Ref<const Eigen::MatrixXd>& B, Eigen::Ref<Eigen::MatrixXd> C);

/// C += A B, the product summed first.
void multiply_and_add(const Eigen::Ref<const Eigen::MatrixXd>& A,
                      const Eigen::Ref<const Eigen::MatrixXd>& B, Eigen::Ref<Eigen::MatrixXd> C);

}  // namespace sprag
