// Solvers and matrices of sizes that the library has not, for the tests that run or look into them.
// Apart from those of five reactions, since together they take 1.6 GB.

#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_STEPS_OF(2, 2, )
RICOCHET_HAND_OVER_OF(2, 2)

namespace ricochet {

template class detail::AnyMatrices<6, 4>;
template double law_violation<6, 4>(const detail::AnyMatrices<6, 4>&, double,
                                    const Eigen::Matrix<double, 6, 1>&,
                                    const Eigen::Matrix<double, 4, 1>&, double);

}  // namespace ricochet
