#include "problems/super_twisting.hpp"

#include "base/require.hpp"

namespace ricochet {

SuperTwisting::SuperTwisting(const Parameters& parameters) : p_(parameters)
{
    detail::require_positive("SuperTwisting", "gain_1", p_.gain_1);
    detail::require_positive("SuperTwisting", "gain_2", p_.gain_2);
    detail::require_not_negative("SuperTwisting", "amplitude", p_.amplitude);
    detail::require_not_negative("SuperTwisting", "frequency", p_.frequency);
}

}  // namespace ricochet
