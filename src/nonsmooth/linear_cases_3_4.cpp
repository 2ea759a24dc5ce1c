#include "ricochet/nonsmooth/linear_cases.hpp"

namespace ricochet {

template struct LinearInequality<3>;
template struct LinearInequality<4>;

}  // namespace ricochet
