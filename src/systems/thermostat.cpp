#include "ricochet/systems/thermostat.hpp"

#include <cmath>
#include <span>
#include <vector>

#include "base/require.hpp"
#include "ricochet/systems/descriptor.hpp"

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

// Long: one list of what the system consists of.
const SystemDescriptor& Thermostat::descriptor()
{
    using Numbers = std::span<const double>;
    static const SystemDescriptor all{
        .name = name,
        .type = "Thermostat",
        .description = "A heater is switched on and off by the temperature of its room.",
        .source =
            "R. Alur et al., The algorithmic analysis of hybrid systems, Theoretical "
            "Computer Science 138, 1995",
        .equations = {"heater off: x' = rate (ambient - x), on at x = low",
                      "heater on: x' = rate (heated - x), off at x = high"},
        .parameters = {{.name = "rate",
                        .initial = Parameters{}.rate,
                        .unit = "1/s",
                        .range = {.lower = 0},
                        .meaning = "at which the room follows"},
                       {.name = "ambient",
                        .initial = Parameters{}.ambient,
                        .unit = "°",
                        .range = {},
                        .meaning = "temperature that the room cools to, below low"},
                       {.name = "heated",
                        .initial = Parameters{}.heated,
                        .unit = "°",
                        .range = {},
                        .meaning = "temperature that it warms to, above high"},
                       {.name = "low",
                        .initial = Parameters{}.low,
                        .unit = "°",
                        .range = {},
                        .meaning = "temperature where the heater is switched on"},
                       {.name = "high",
                        .initial = Parameters{}.high,
                        .unit = "°",
                        .range = {},
                        .meaning = "temperature where it is switched off"}},
        .state = {{.name = "x",
                   .unit = "°",
                   .meaning = "temperature",
                   .title = "temperature",
                   .start = start[0],
                   .start_meaning = "at the start, heater off"}},
        .events = {"heater on", "heater off"},
        .t_end = 20,
        .comparison_step = 0.1,
        .known = {{.name = "switch_time",
                   .meaning = "Time [s] of switch n = 0, 1, 2, ...; the even ones switch the "
                              "heater on.",
                   .arguments = {{.name = "n", .whole = true},
                                 {.name = "temperature", .initial = start[0]}},
                   .values =
                       [](Numbers p, Numbers a) {
                           return std::vector{with_parameters<Thermostat>(p).switch_time(
                               static_cast<int>(a[0]), a[1])};
                       }}},
        .event_times = [](Numbers p, Numbers x0, double t_end) {
            const auto thermostat = with_parameters<Thermostat>(p);
            std::vector<double> times;
            for (int n = 0; thermostat.switch_time(n, x0[0]) <= t_end; ++n) {
                times.push_back(thermostat.switch_time(n, x0[0]));
            }
            return times;
        }};
    return all;
}

}  // namespace ricochet
