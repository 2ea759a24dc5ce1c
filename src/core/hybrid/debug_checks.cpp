#include "ricochet/detail/debug_checks.hpp"

namespace ricochet::detail {

bool is_debug_build() noexcept
{
#ifdef NDEBUG
    return false;
#else
    return true;
#endif
}

}  // namespace ricochet::detail
