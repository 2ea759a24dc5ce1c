// The matrices and steps of systems that tests look into in their own size, which the library has
// not. Apart from the solvers of five reactions, since both together take 1.6 GB.

#include "ricochet/nonsmooth/solvers.hpp"

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
