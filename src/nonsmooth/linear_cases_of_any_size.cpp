#include "ricochet/nonsmooth/linear_cases.hpp"

namespace ricochet {

template struct LinearInequality<Eigen::Dynamic>;

}  // namespace ricochet
