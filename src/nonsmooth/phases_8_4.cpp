// The phases of a run in this size; see inclusions_8_4.cpp.

#include "ricochet/nonsmooth/solvers.hpp"

extern template class ricochet::detail::AnyMatrices<8, 4>;
extern template class ricochet::detail::AnyStep<8, 4>;
extern template class ricochet::detail::AnyMotion<8, 4>;

RICOCHET_HAND_OVER_OF(8, 4)
