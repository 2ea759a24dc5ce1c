#include "ricochet/nonsmooth/linear_cases.hpp"

namespace ricochet {

template struct LinearInequality<1>;
template struct LinearInequality<2>;

}  // namespace ricochet
