#include "ricochet/systems/thermostat.hpp"

#include <cmath>

#include "base/require.hpp"

namespace ricochet {

Thermostat::Thermostat(const Parameters& parameters) : p_(parameters)
{
    constexpr std::string_view self = "Thermostat";
    detail::require_positive(self, "rate", p_.rate);
    detail::require_finite(self, "ambient", p_.ambient);
    detail::require_above(self, "low", p_.low, "ambient", p_.ambient);
    detail::require_above(self, "high", p_.high, "low", p_.low);
    detail::require_above(self, "heated", p_.heated, "high", p_.high);
}

double Thermostat::switch_time(int n, double temperature) const noexcept
{
    // In long double, so that the sum is a reference for runs in double.
    const auto cooling = [&](long double from) {
        return std::log((from - p_.ambient) / (static_cast<long double>(p_.low) - p_.ambient));
    };
    const long double warming = std::log((static_cast<long double>(p_.heated) - p_.low) /
                                         (static_cast<long double>(p_.heated) - p_.high));
    const int times_on = (n + 1) / 2;
    const int times_off = n / 2;
    return static_cast<double>(
        (cooling(temperature) + times_on * warming + times_off * cooling(p_.high)) / p_.rate);
}

}  // namespace ricochet
