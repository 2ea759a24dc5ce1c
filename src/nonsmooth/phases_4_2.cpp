// The phases of a run in this size; see inclusions_4_2.cpp.

#include "ricochet/nonsmooth/solvers.hpp"

extern template class ricochet::detail::AnyMatrices<4, 2>;
extern template class ricochet::detail::AnyStep<4, 2>;
extern template class ricochet::detail::AnyMotion<4, 2>;

RICOCHET_HAND_OVER_OF(4, 2)
