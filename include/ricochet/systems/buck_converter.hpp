// A step-down converter with hysteresis.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

struct SystemDescriptor;

/// A step-down (buck) converter whose transistor is switched by the current through its inductor.
///
/// State x = (current i [A], voltage of the load v [V]).
///
///     flow    inductance i' = input - v (on), -v (off);  capacitance v' = i - v / resistance
///     guard   high - i, falling, on: off;   i - low, falling, off: on
///     reset   i⁺ = high, low: the state is on the surface
///
/// (R. W. Erickson and D. Maksimovic, Fundamentals of Power Electronics, Springer, 2001, chapters
/// 2 and 12.) The current stays positive, so that the diode conducts whenever the transistor does
/// not. Functions are generic in the state and its scalar.
class BuckConverter {
public:
    using State = std::array<double, 2>;

    enum : Mode { off, on };
    enum : std::size_t { at_high, at_low };  // the guards

    struct Parameters {
        double input = 12;          ///< [V], above the voltage of the load, resistance * high
        double inductance = 1e-3;   ///< [H], positive
        double capacitance = 1e-4;  ///< [F], positive
        double resistance = 10;     ///< [Ohm] of the load, positive
        double low = 0.4;           ///< [A] where the transistor is switched on, positive
        double high = 0.6;          ///< [A] where it is switched off, above `low`
    };

    constexpr BuckConverter() = default;

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit BuckConverter(const Parameters& parameters);

    static constexpr std::string_view name = "buck-converter";
    /// Names, units, ranges and what is known; see descriptor.hpp.
    [[nodiscard]] static const SystemDescriptor& descriptor();
    static constexpr State start{0.5, 0};
    static constexpr Mode start_mode = on;

    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;

    [[nodiscard]] static constexpr std::string_view mode_name(Mode mode) noexcept
    {
        return mode == on ? "on" : "off";
    }

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t which) noexcept
    {
        return {.name = which == at_high ? "high" : "low"};
    }

    [[nodiscard]] static constexpr bool enabled(std::size_t which, Mode mode) noexcept
    {
        return (which == at_high) == (mode == on);
    }

    template <class X>
    constexpr void flow(Mode mode, const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = ((mode == on ? p_.input : 0) - x[1]) / p_.inductance;
        dxdt[1] = (x[0] - x[1] / p_.resistance) / p_.capacitance;
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(std::size_t which, Mode /*mode*/,
                                              const ScalarOf<X>& /*t*/, const X& x) const noexcept
    {
        return which == at_high ? p_.high - x[0] : x[0] - p_.low;
    }

    template <class X>
    constexpr Mode reset(std::size_t which, Mode /*mode*/, const ScalarOf<X>& /*t*/,
                         X& x) const noexcept
    {
        x[0] = which == at_high ? p_.high : p_.low;
        return which == at_high ? off : on;
    }

private:
    Parameters p_{};
};

}  // namespace ricochet
