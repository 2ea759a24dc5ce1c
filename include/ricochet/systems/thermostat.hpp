// A thermostat: two modes that take turns.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

struct SystemDescriptor;

/// The temperature of a room with a heater that is switched on and off.
///
/// State (x), a temperature [degrees]; modes off and on.
///
///     flow    off: x' = -rate (x - ambient),  on: x' = -rate (x - heated)
///     guard   off: x - low, falling, to on;  on: high - x, falling, to off
///     reset   changes only the mode
///
/// (R. Alur et al., The algorithmic analysis of hybrid systems, Theoretical Computer
/// Science 138, 1995, where the ambient temperature is zero.)
///
/// Known solution: exponentials, so that the heater is off for
/// log((high - ambient) / (low - ambient)) / rate and on for
/// log((heated - low) / (heated - high)) / rate, in turn; see `switch_time`. Functions
/// are generic in the state and its scalar.
class Thermostat {
public:
    using State = std::array<double, 1>;

    enum : Mode { off, on };
    enum : std::size_t { too_cold, too_warm };  // the guards

    struct Parameters {
        double rate = 0.1;   ///< [1/s], positive
        double ambient = 0;  ///< [degrees], limit with the heater off; below low
        double heated = 30;  ///< [degrees], limit with the heater on; above high
        double low = 18;     ///< [degrees] at which the heater is switched on
        double high = 22;    ///< [degrees] at which it is switched off; above low
    };

    constexpr Thermostat() = default;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit Thermostat(const Parameters& parameters);

    static constexpr std::string_view name = "thermostat";
    /// Names, units, ranges and what is known; see descriptor.hpp.
    [[nodiscard]] static const SystemDescriptor& descriptor();
    static constexpr State start{20};
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;

    [[nodiscard]] static constexpr std::string_view mode_name(Mode mode) noexcept
    {
        return mode == off ? "off" : "on";
    }

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t which) noexcept
    {
        return {.name = which == too_cold ? "too-cold" : "too-warm"};
    }

    [[nodiscard]] static constexpr bool enabled(std::size_t which, Mode mode) noexcept
    {
        return mode == (which == too_cold ? off : on);
    }

    template <class X>
    constexpr void flow(Mode mode, const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = -p_.rate * (x[0] - (mode == off ? p_.ambient : p_.heated));
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(std::size_t which, const ScalarOf<X>& /*t*/,
                                              const X& x) const noexcept
    {
        return which == too_cold ? x[0] - p_.low : p_.high - x[0];
    }

    template <class X>
    [[nodiscard]] constexpr Mode reset(std::size_t which, Mode /*mode*/, const ScalarOf<X>& /*t*/,
                                       X& /*x*/) const noexcept
    {
        return which == too_cold ? on : off;
    }

    /// Time [s] of switch n = 0, 1, 2, ... after a start at `temperature` [degrees] in
    /// (low, heated) with the heater off; the even ones switch it on.
    [[nodiscard]] double switch_time(int n, double temperature = start[0]) const noexcept;

private:
    Parameters p_{};
};

}  // namespace ricochet
