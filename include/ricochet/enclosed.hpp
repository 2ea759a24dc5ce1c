// Detector that proves guards clear along intervals of the motion, by enclosures.
//
// A guard that is a template over its scalar can be evaluated on a tube around the motion
// (enclosure.hpp, detail/motion_tube.hpp): where the range of the result excludes 0, no point of
// the interval has a root, and "no event" is proved, for several steps by one evaluation that costs
// about as much as three calls of the guard. It is what `Bernstein` is for polynomials, for every
// formula, and for networks (nn/guard_network.hpp).
//
//     take steps while the interval is expected to be clear
//     proved:  they stand; the next interval is as long as the last range lets expect
//     else:    shorten the interval; the first single step that is not proved is divided on
//              its polynomial, and what stays open is left to `Exact`
//
// What is proved is proved for the polynomials of the steps, and for the guard as it is computed:
// see enclosure.hpp for rounding. Steps without a polynomial that is known, such as those of a
// host, are examined by `Exact`.
#pragma once

#include <array>
#include <cstddef>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/motion_tube.hpp"
#include "ricochet/detail/scalar_probe.hpp"
#include "ricochet/enclosure.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/planned.hpp"

namespace ricochet {

/// A system that encloses its guards itself: `guard_along(which, mode, t, x)`, with t an
/// `Enclosure` and x a view of components of that type.
template <class System>
concept EnclosesGuards = requires(const System& s, std::size_t which, Mode mode, const Enclosure& t,
                                  const detail::ViewProbe<Enclosure>& x)
{
    {
        s.guard_along(which, mode, t, x)
        } -> std::same_as<Enclosure>;
};

/// A system whose guards are templates over their scalar, in states X.
template <class System, class X>
concept EnclosableGuards = EnclosesGuards<System> || detail::GuardOfScalarViews<System> ||
                           detail::GuardOfScalarArrays < System,
        detail::fixed_size<X>()
> ;

namespace detail {

/// The guard on a tube; unknown where a comparison in it is not decided.
template <class X, class System, class C>
[[nodiscard]] Enclosure guard_on_tube(const System& system, const GuardInMode& of,
                                      const MotionTube<C>& tube)
{
    is_undecided = false;
    const Enclosure time = tube.time();
    const auto range = [&] {
        if constexpr (EnclosesGuards<System>) {
            return system.guard_along(of.which, of.mode, time, TubeView<C>(tube));
        } else if constexpr (GuardOfScalarViews<System>) {
            return guard_of_scalar(system, of.which, of.mode, time, TubeView<C>(tube));
        } else {
            const auto state = tube.template components<fixed_size<X>()>();
            return guard_of_scalar(system, of.which, of.mode, time, state);
        }
    }();
    return is_undecided ? Enclosure::unknown() : range;
}

}  // namespace detail

/// How `Enclosed` takes steps.
struct EnclosedOptions {
    /// Largest number of steps in an interval; the starts of as many steps are kept. At least 1.
    std::size_t longest_interval = 256;
};

/// Detector that proves guards clear along intervals, and leaves the rest to `Exact`: all of it
/// where the guards are no templates, so that `EnclosableGuards` does not hold for system and
/// state. The evidence of a step is `proved` where the whole of it is, and else that of `Exact`.
/// Enclosures are counted as `Statistics::bound_calls`.
template <class Exact = Extremum>
class Enclosed : public detail::PutsOff<Exact> {
public:
    static constexpr bool needs_bounds = false;
    static constexpr Evidence deferred = Evidence::proved;  ///< evidence for a step without a check

    Enclosed() : Enclosed(EnclosedOptions{}) {}
    /// @throws std::invalid_argument if `longest_interval` is 0.
    explicit Enclosed(const EnclosedOptions& options, const Exact& exact = {})
        : detail::PutsOff<Exact>(exact), longest_(options.longest_interval)
    {
        if (longest_ == 0) detail::throw_no_steps_in_interval();
    }

    [[nodiscard]] std::size_t longest() const noexcept { return longest_; }

    /// Whether the guards of a system can be enclosed; those of others are left to `Exact`.
    template <class System, class X>
    [[nodiscard]] static constexpr bool suits() noexcept
    {
        return EnclosableGuards<System, X>;
    }

    /// The guard on a tube around the motion.
    template <class X, class System, class C>
    [[nodiscard]] static Enclosure along(const System& system, const GuardInMode& of,
                                         const detail::MotionTube<C>& tube)
    {
        return detail::guard_on_tube<X>(system, of, tube);
    }

    // The intervals are not closed by values of the guard.
    [[nodiscard]] static constexpr bool checks_bounds() noexcept { return false; }
    [[nodiscard]] static constexpr double margin() noexcept { return 0; }
    [[nodiscard]] static double sure(const GuardBound&, double) noexcept { return 0; }
    [[nodiscard]] static double hoped(const GuardBound&, double, double) noexcept { return 0; }
    [[nodiscard]] static bool closes(const GuardBound&, const GuardBound&, double, double) noexcept
    {
        return false;
    }

private:
    std::size_t longest_;
};

}  // namespace ricochet
