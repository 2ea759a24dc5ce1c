// Solvers of sizes that the library has not, compiled once for all tests: those of five reactions,
// and the matrices and steps of systems that tests look into in their own size.

#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_INCLUSIONS_OF(6, 5, )

RICOCHET_SET_VALUED_OF(2, 2)

namespace ricochet {

template class detail::AnyMatrices<6, 4>;
template double law_violation<6, 4>(const detail::AnyMatrices<6, 4>&, double,
                                    const Eigen::Matrix<double, 6, 1>&,
                                    const Eigen::Matrix<double, 4, 1>&, double);
template double law_violation<2, 2>(const detail::AnyMatrices<2, 2>&, double,
                                    const Eigen::Matrix<double, 2, 1>&,
                                    const Eigen::Matrix<double, 2, 1>&, double);

}  // namespace ricochet
