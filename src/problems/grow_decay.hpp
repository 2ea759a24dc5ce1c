// Growth and decay between two levels.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

/// A quantity that doubles, halves, doubles, ...
///
/// State (y); modes grow and decay.
///
///     flow    grow: y' = y,  decay: y' = -y / 2
///     guard   grow: 2 - y, falling, to decay;  decay: y - 1, falling, to grow
///     reset   changes only the mode
///
/// Known solution: from y = 1 in mode grow, on the surface of the guard that this mode does not
/// examine, the modes last log 2 and 2 log 2, so that the switches are at log 2 times 1, 3, 4, 6,
/// 7, 9, ... Functions are generic in the state and its scalar.
class GrowDecay {
public:
    using State = std::array<double, 1>;

    enum : Mode { grow, decay };
    enum : std::size_t { full, empty };  // the guards

    static constexpr std::string_view name = "grow-decay";
    static constexpr State start{1};
    static constexpr std::size_t guard_count = 2;
    static constexpr std::size_t mode_count = 2;

    [[nodiscard]] static constexpr std::string_view mode_name(Mode mode) noexcept
    {
        return mode == grow ? "grow" : "decay";
    }

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t which) noexcept
    {
        return {.name = which == full ? "full" : "empty"};
    }

    [[nodiscard]] static constexpr bool enabled(std::size_t which, Mode mode) noexcept
    {
        return mode == (which == full ? grow : decay);
    }

    template <class X>
    constexpr void flow(Mode mode, const ScalarOf<X>& /*t*/, const X& x, X& dxdt) const noexcept
    {
        dxdt[0] = mode == grow ? x[0] : -x[0] / 2;
    }

    template <class X>
    [[nodiscard]] constexpr ScalarOf<X> guard(std::size_t which, const ScalarOf<X>& /*t*/,
                                              const X& x) const noexcept
    {
        return which == full ? 2 - x[0] : x[0] - 1;
    }

    template <class X>
    [[nodiscard]] Mode reset(std::size_t which, Mode /*mode*/, double /*t*/,
                             X& /*x*/) const noexcept
    {
        return which == full ? decay : grow;
    }

    /// Time [s] of switch n = 0, 1, 2, ... from `start`; the even ones begin a decay.
    [[nodiscard]] static constexpr double switch_time(int n) noexcept
    {
        constexpr long double log_two = 0.693147180559945309417232121458L;
        const int cycles = n / 2;
        return static_cast<double>((3 * cycles + (n % 2 == 0 ? 1 : 3)) * log_two);
    }
};

}  // namespace ricochet
