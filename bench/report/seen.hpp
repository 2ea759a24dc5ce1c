// A uniform interface for other libraries to ricochet's systems, which may declare their functions
// in several forms.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

#include "ricochet/guard.hpp"

namespace ricochet::report {

/// A system and its current mode. `X` is the state type of the peer: an array, a vector, or a
/// pointer to its memory.
template <class System>
class Seen {
    using State = typename System::State;

public:
    explicit Seen(const System& system) : system_(system) {}

    static constexpr bool has_modes = requires { System::mode_count; };
    static constexpr bool has_guards = requires { &System::template guard<double, State>; }
    || requires { &System::template guard<State>; };
    static constexpr bool acts = requires { &System::template reset<State>; };

    template <class X>
    void flow(double t, const X& x, X& dxdt)
    {
        ++flow_calls;
        if constexpr (has_modes) {
            system_.flow(mode, t, x, dxdt);
        } else {
            system_.flow(t, x, dxdt);
        }
    }

    [[nodiscard]] std::size_t guards() const
    {
        if constexpr (!has_guards) {
            return 0;
        } else if constexpr (requires {
                                 {
                                     system_.guard_count()
                                     } -> std::convertible_to<std::size_t>;
                             }) {
            return system_.guard_count();
        } else if constexpr (requires {
                                 {
                                     System::guard_count
                                     } -> std::convertible_to<std::size_t>;
                             }) {
            return System::guard_count;
        } else {
            return 1;
        }
    }

    template <class X>
    [[nodiscard]] double guard(std::size_t which, double t, const X& x)
    {
        ++guard_calls;
        if constexpr (has_modes) {
            return system_.guard(which, mode, t, x);
        } else if constexpr (requires { system_.guard(which, t, x); }) {
            return system_.guard(which, t, x);
        } else if constexpr (has_guards) {
            return system_.guard(t, x);
        } else {
            return 1;
        }
    }

    [[nodiscard]] static constexpr Crossing crossing()
    {
        if constexpr (requires { System::crossing; }) {
            return System::crossing;
        } else {
            return Crossing::falling;
        }
    }
    /// -1, 0 or 1, as SUNDIALS and SciPy count it.
    [[nodiscard]] static constexpr int direction()
    {
        return crossing() == Crossing::falling ? -1 : crossing() == Crossing::rising ? 1 : 0;
    }
    /// Whether a guard with the value `before` that now has the value `after` has made the
    /// crossing.
    [[nodiscard]] static constexpr bool crossed(double before, double after)
    {
        const bool falls = before > 0 && after <= 0;
        const bool rises = before < 0 && after >= 0;
        return (falls && crossing() != Crossing::rising) ||
               (rises && crossing() != Crossing::falling);
    }

    template <class X>
    void reset(std::size_t which, double t, X& x)
    {
        if constexpr (has_modes) {
            mode = system_.reset(which, mode, t, x);
        } else if constexpr (requires { system_.reset(which, t, x); }) {
            system_.reset(which, t, x);
        } else if constexpr (acts) {
            system_.reset(t, x);
        }
    }

    Mode mode = 0;
    std::uint64_t flow_calls = 0;
    std::uint64_t guard_calls = 0;

private:
    const System& system_;
};

}  // namespace ricochet::report
