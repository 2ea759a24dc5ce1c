#include "ricochet/nonsmooth/detail/linear_cases.hpp"

namespace ricochet {

template struct LinearInequality<Eigen::Dynamic>;

}  // namespace ricochet
