// The phases of a run with five reactions; see exact_inclusions.cpp.

#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_INCLUSIONS_OF(6, 5, extern)

extern template class ricochet::detail::AnyMatrices<6, 5>;
extern template class ricochet::detail::AnyStep<6, 5>;
extern template class ricochet::detail::AnyMotion<6, 5>;

RICOCHET_HAND_OVER_OF(6, 5)
