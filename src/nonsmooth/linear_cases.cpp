#include "ricochet/nonsmooth/detail/linear_cases.hpp"

namespace ricochet {

template struct LinearInequality<1>;
template struct LinearInequality<2>;
template struct LinearInequality<3>;
template struct LinearInequality<4>;
template struct LinearInequality<Eigen::Dynamic>;

}  // namespace ricochet
