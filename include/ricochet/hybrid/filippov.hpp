// Sliding motion in the sense of Filippov: smooth fields that meet at one or two
// switching surfaces, as a hybrid system.
//
// A user gives the surfaces and a field for each region between them:
//
//     struct Relay {
//         static constexpr std::size_t surface_count = 1;              // or 2
//         double surface(std::size_t which, double t, const X& x) const;    // h
//         double surface_rate(std::size_t which, double t, const X& x, const X& dxdt) const;
//         void field(std::size_t region, double t, const X& x, X& dxdt) const;
//     };
//
// Bit i of a region is set where h_i > 0. A field must be smooth up to its surfaces
// and a little beyond, since steps are cut at a surface after they have met it.
// `surface_rate`, dh/dt along x' = dxdt, is optional but advised: without it the rate
// is a difference over a displacement of 6e-6 of the largest component of the state,
// or of 1 where that is larger. `State` and the functions of time events are passed
// on if they are there.
//
// Where both fields lead to a surface the motion slides along it, with the convex
// combination that keeps h still (Filippov, Differential Equations with Discontinuous
// Righthand Sides, 1988, section 4):
//
//     x' = (1 - a) f_below + a f_above,   a = r_below / (r_below - r_above)
//
// where r is the rate of h along a field. On the intersection of two surfaces that
// condition leaves a choice, and the weights are bilinear in one share per surface
// (Alexander and Seidman, Houston J. Math. 24, 1998; Dieci and Lopez, J. Comput. Appl.
// Math. 254, 2013):
//
//     x' = (1-a)(1-b) f_0 + a (1-b) f_1 + (1-a) b f_2 + a b f_3
//
// Sliding ends where a share leaves [0, 1]. The rules of the decision are documented at
// `Filippov::reset`.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <string_view>
#include <utility>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/declarations.hpp"
#include "ricochet/detail/filippov_decision.hpp"
#include "ricochet/detail/filippov_motion.hpp"
#include "ricochet/detail/filippov_rates.hpp"
#include "ricochet/detail/scratch.hpp"
#include "ricochet/hybrid/guard.hpp"
#include "ricochet/hybrid/system.hpp"

namespace ricochet {

namespace detail {

template <class Fields>
struct FilippovState {
};

template <class Fields>
requires requires
{
    typename Fields::State;
}
struct FilippovState<Fields> {
    using State = typename Fields::State;
};

}  // namespace detail

/// The hybrid system of fields that meet at switching surfaces. For runs forward in
/// time: sliding motions merge, so that they cannot be run backward.
///
/// A mode says for each surface whether the motion is below, above or sliding; digit i
/// of its number to base 3 is the `Place` at surface i. Start a run in `start_mode`.
///
/// There are four guards per surface, numbered 4 surface + kind. All fall:
///
///     0  -h             while below
///     1  h              while above
///     2  exit below     while sliding: zero where the motion may leave to h < 0
///     3  exit above     while sliding: zero where it may leave to h > 0
///
/// The first two are unilateral, so that no motion continues unseen beyond a surface: a
/// start on the wrong side is refused, and a run that a reset leaves there ends with
/// `Outcome::outside_mode`. That may happen where rounding hides a surface, as at the end
/// of twisting in skew coordinates. Sliding has no such bound: with surfaces whose rates
/// differ in size by 1e3, rounding may lead sliding on both off its surfaces unseen.
///
/// Along one surface the exits are r_below and -r_above: as smooth as the fields, with neither
/// quotient nor pole, and zero exactly where the share a is 0 or 1. On two surfaces they are the
/// shares themselves, a and 1 - a, unless the combination ceases to exist before: then all four
/// fall together.
template <class Fields>
class Filippov : public detail::FilippovState<Fields> {
    using Rules = detail::FilippovDecision<Fields>;
    using Places = detail::Places;
    using Surfaces = detail::Surfaces;

public:
    static constexpr bool unchecked_names = true;  // time events only where the fields have them
    static constexpr bool forward_only = true;     ///< runs backward in time are refused
    /// A reset at surfaces removes rounding and drift, which depend on neither the state nor the
    /// parameters: its derivative is the identity.
    static constexpr bool resets_settle = true;
    static constexpr std::size_t surface_count = Fields::surface_count;
    static constexpr std::size_t guards_per_surface = 4;
    static constexpr std::size_t guard_count = guards_per_surface * surface_count;
    static constexpr std::size_t mode_count = surface_count == 1 ? 3 : 9;

    /// @throws std::invalid_argument if the restoring rate is negative or not finite.
    explicit Filippov(Fields fields = {}, const FilippovOptions& options = {})
        : rules_(std::move(fields), options)
    {
    }

    [[nodiscard]] const Fields& fields() const noexcept { return rules_.fields(); }

    // --- modes and guards by name ---

    /// Mode of a motion at `place` with respect to the surface.
    [[nodiscard]] static constexpr Mode mode_of(Place place) noexcept requires(surface_count == 1)
    {
        return static_cast<Mode>(place);
    }

    /// Mode of a motion at `first` and `second` with respect to the two surfaces.
    [[nodiscard]] static constexpr Mode mode_of(Place first, Place second) noexcept
        requires(surface_count == 2)
    {
        return number({first, second});
    }

    /// Place of a motion in `mode` with respect to surface `which`.
    [[nodiscard]] static constexpr Place place(std::size_t which, Mode mode) noexcept
    {
        return static_cast<Place>(which == 0 ? mode % 3 : mode / 3 % 3);
    }

    /// Name of a mode, for example "sliding, above": on surface 0, beside surface 1.
    [[nodiscard]] static std::string_view mode_name(Mode mode) noexcept
    {
        return detail::filippov_mode_name(surface_count, mode);
    }

    [[nodiscard]] static GuardInfo guard_info(std::size_t which) noexcept
    {
        GuardInfo info;
        info.name = detail::filippov_guard_name(which);
        info.unilateral = !is_exit(which);
        return info;
    }

    [[nodiscard]] static constexpr bool enabled(std::size_t which, Mode mode) noexcept
    {
        const Place at = place(surface_of(which), mode);
        switch (kind_of(which)) {
            case leaves_below: return at == Place::below;
            case leaves_above: return at == Place::above;
            default: return at == Place::sliding;
        }
    }

    // --- the functions of a hybrid system ---

    template <StateVector X>
    void flow(Mode mode, double t, const X& x, X& dxdt) const
    {
        rules_.flow(places(mode), t, x, dxdt);
    }

    template <StateVector X>
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const X& x) const
    {
        if (kind_of(which) == leaves_below) return -rules_.surface(surface_of(which), t, x);
        if (kind_of(which) == leaves_above) return rules_.surface(surface_of(which), t, x);
        return exits(places(mode), t, x)[exit_of(which)];
    }

    template <StateVector X>
    void guards(Mode mode, double t, const X& x, std::span<double> g) const
    {
        const detail::Exits exit = exits(places(mode), t, x);
        for (std::size_t surface = 0; surface < surface_count; ++surface) {
            const std::size_t first = guards_per_surface * surface;
            g[first + leaves_above] = rules_.surface(surface, t, x);
            g[first + leaves_below] = -g[first + leaves_above];
            g[first + exits_below] = exit[2 * surface];
            g[first + exits_above] = exit[2 * surface + 1];
        }
    }

    /// The rate of a surface, set to zero if its sign is only rounding: then the
    /// side to which a motion tangent to its surface bends is found from its curvature.
    /// Rates of exits are differences.
    template <StateVector X>
    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const X& x,
                                    const X& dxdt) const
    {
        const Places at = places(mode);
        if (is_exit(which)) return exit_rates(at, t, x, dxdt)[exit_of(which)];
        const double rate = surface_rate(surface_of(which), at, t, x, dxdt);
        return kind_of(which) == leaves_above ? rate : -rate;
    }

    template <StateVector X>
    void guard_rates(Mode mode, double t, const X& x, const X& dxdt, std::span<double> rates) const
    {
        const Places at = places(mode);
        const detail::Exits exit = exit_rates(at, t, x, dxdt);
        for (std::size_t surface = 0; surface < surface_count; ++surface) {
            const std::size_t first = guards_per_surface * surface;
            const bool slides = at[surface] == Place::sliding;
            const double rate = slides ? 0 : surface_rate(surface, at, t, x, dxdt);
            rates[first + leaves_above] = rate;
            rates[first + leaves_below] = -rate;
            rates[first + exits_below] = exit[2 * surface];
            rates[first + exits_above] = exit[2 * surface + 1];
        }
    }

    /// Mode after a motion has met surfaces, or may leave the surfaces on which it
    /// slides; x is moved onto the surfaces on which it is to slide or has slid, by the
    /// rounding and drift that separates it from them, along the jumps of the field. The
    /// decision is made exactly on the surfaces.
    ///
    /// On one surface: a field that leads away from it on its own side is an exit. If there is
    /// none, the surface attracts and the motion slides. If there is one, it is taken. If there are
    /// two, the surface is repulsive and the solution not unique: the exit with the larger rate is
    /// taken, or the upper one if the rates are equal. A rate that is zero, up to 2e-13 of the
    /// larger, takes the sign that it will have next along its field; an exit that has fired
    /// counts.
    ///
    /// A surface that the state is on or beyond counts as met, whichever guard has fired.
    ///
    /// On two surfaces: as steep but continuous switching would decide, see
    /// `detail::follow_shares`, with the rates of each surface in units of the largest. The
    /// decision starts from the weights with which the motion arrives; after an exit, from those
    /// a moment later; at a start or time event, from (1/2, 1/2).
    ///
    /// `meeting` returns the result in advance.
    template <StateVector X>
    [[nodiscard]] Mode reset(const FiredGuards& fired, Mode mode, double t, X& x) const
    {
        Places from = places(mode);
        bool exits_only = !fired.time_event();
        if (fired.time_event()) from = after_time_event(from, t, x);
        Surfaces on = Rules::sliding_in(from) | rules_.reached_in(from, t, x);
        typename Rules::FiredExits exits = 0;
        for (const std::size_t which : fired) {
            on |= Rules::bit(surface_of(which));
            if (is_exit(which)) exits |= 1u << exit_of(which);
            exits_only = exits_only && is_exit(which);
        }
        if (!exits_only) exits = 0;
        if (on != Rules::both) {
            const Places next = rules_.meet(on, from, t, x, [&](const X& there) {
                return rules_.decide_on_one(from, on, exits, t, there);
            });
            if (surface_count == 1 || !rules_.meets_other(on, next, t, x)) return number(next);
            exits = 0;
        }
        return number(rules_.meet(Rules::both, from, t, x, [&](const X& there) {
            if (exits) return rules_.decide_after_exit(t, there);
            const detail::Shares shares =
                fired.time_event() ? detail::Shares{} : rules_.shares_in(from, t, there);
            return rules_.decide_on_both(shares, t, there);
        }));
    }

    /// An accumulation of crossings of two surfaces leads onto their intersection. There is no
    /// other accumulation that Filippov's rule could continue: an accumulation of crossings of one
    /// surface is sliding of second order, which needs the rate of h as a second surface.
    /// With one surface there is no `rest`, and such a run ends. With two, `rest` sets the state
    /// to NaN, which ends the run.
    template <StateVector X>
    requires(surface_count == 2) [[nodiscard]] Mode
        rest(std::size_t which, Mode mode, double t, X& x) const
    {
        const std::size_t other = 1 - surface_of(which);
        const Places from = places(mode);
        if (from[other] != Place::sliding && !rules_.is_near(other, t, x)) {
            detail::for_each_component(
                x, [&](auto i) { x[i] = std::numeric_limits<double>::quiet_NaN(); });
            return mode;
        }
        rules_.settle(Rules::both, from, Rules::held_on(Rules::both, from), t, x);
        return number(rules_.decide_on_both({}, t, x));
    }

    // --- time events of the fields ---

    [[nodiscard]] double next_time_event(double t) const requires detail::TimedByFunction<Fields>
    {
        return fields().next_time_event(t);
    }
    /// The list or the clock of the fields.
    [[nodiscard]] const Times& time_events() const requires detail::ListsTimes<Fields>
    {
        return detail::times_of(fields());
    }
    template <StateVector X>
    [[nodiscard]] double next_time_event(double t,
                                         const X& x) const requires detail::PlainTimer<Fields, X>
    {
        return fields().next_time_event(t, x);
    }

    /// Applies the jump of the fields' own `time_reset`, if any. Fields may also have changed:
    /// the sliding surfaces are decided again.
    template <StateVector X>
    [[nodiscard]] Mode time_reset(Mode mode, double t,
                                  X& x) const requires Timed<Fields> || TimedByState<Fields, X>
    {
        const Places from = after_time_event(places(mode), t, x);
        return number(rules_.decide(from, Rules::sliding_in(from), t, x));
    }

    // --- queries ---

    /// The mode in which a run from (t, x) starts. A surface counts as met where
    /// |h| <= tolerance, in the unit of h; then the rule of `reset` applies.
    template <StateVector X = detail::DeclaredState<Fields>>
    [[nodiscard]] Mode start_mode(double t, const X& x, double tolerance = 0) const
    {
        Places at{};
        Surfaces on = 0;
        for (std::size_t i = 0; i < surface_count; ++i) {
            const double h = rules_.surface(i, t, x);
            if (std::fabs(h) <= tolerance) on |= Rules::bit(i);
            at[i] = h > 0 ? Place::above : Place::below;
        }
        return number(rules_.decide(at, on, t, x));
    }

    /// Type of the meeting of the fields on either side of surface `which` at a point (t, x) of
    /// it. The other surface is where `mode` says; if the motion slides there, sliding motions
    /// replace the fields.
    template <StateVector X = detail::DeclaredState<Fields>>
    [[nodiscard]] Meeting meeting(std::size_t which, Mode mode, double t, const X& x) const
    {
        return rules_.meeting(which, places(mode), t, x);
    }

    /// Weight a in [0, 1] of the field above in the motion, for each surface: 0 below,
    /// 1 above. While sliding it is the average of the switching, such as the force of sticking
    /// friction as a fraction of its bounds.
    template <StateVector X = detail::DeclaredState<Fields>>
    [[nodiscard]] std::array<double, surface_count> shares(Mode mode, double t, const X& x) const
    {
        const detail::Shares shares = rules_.shares_in(places(mode), t, x);
        if constexpr (surface_count == 1) {
            return {shares.first};
        } else {
            return {shares.first, shares.second};
        }
    }

private:
    enum Kind : std::size_t { leaves_below, leaves_above, exits_below, exits_above };

    [[nodiscard]] static constexpr std::size_t surface_of(std::size_t which) noexcept
    {
        return which / guards_per_surface;
    }
    [[nodiscard]] static constexpr Kind kind_of(std::size_t which) noexcept
    {
        return static_cast<Kind>(which % guards_per_surface);
    }
    [[nodiscard]] static constexpr bool is_exit(std::size_t which) noexcept
    {
        return kind_of(which) >= exits_below;
    }
    /// Index of an exit guard in `detail::Exits`.
    [[nodiscard]] static constexpr std::size_t exit_of(std::size_t which) noexcept
    {
        return 2 * surface_of(which) + (kind_of(which) - exits_below);
    }

    [[nodiscard]] static constexpr Places places(Mode mode) noexcept
    {
        return {place(0, mode), surface_count == 2 ? place(1, mode) : Place::below};
    }
    [[nodiscard]] static constexpr Mode number(const Places& at) noexcept
    {
        return static_cast<Mode>(at[0]) + 3 * static_cast<Mode>(at[1]);
    }

    template <class X>
    [[nodiscard]] detail::Exits exits(const Places& at, double t, const X& x) const
    {
        const Surfaces on = Rules::sliding_in(at);
        return Rules::exits(on ? rules_.around(on, at, t, x).rates : detail::RegionRates{}, on, at);
    }

    template <class X>
    [[nodiscard]] detail::Exits exit_rates(const Places& at, double t, const X& x,
                                           const X& dxdt) const
    {
        const Surfaces on = Rules::sliding_in(at);
        if (on == 0) return {};
        const auto near = rules_.around(on, at, t, x);
        const double size =
            on == Rules::both ? 1 : detail::largest_component(near.rates[Rules::only(on)]);
        if (size == 0) return {};
        const detail::TimeScales times(t, detail::largest_component(x), near.speed);
        detail::Scratch<X, 1> moved(x);
        const auto later = [&](double s) {
            detail::move(moved[0], x, s, dxdt);
            return exits(at, t + s, moved[0]);
        };
        return detail::fitted_rates(later, Rules::exits(near.rates, on, at), size, times);
    }

    template <class X>
    [[nodiscard]] double surface_rate(std::size_t which, const Places& at, double t, const X& x,
                                      const X& dxdt) const
    {
        const double rate = rules_.surface_rate(which, t, x, dxdt);
        // Only a rate that is small by any measure has to be compared with others.
        if (std::fabs(rate) > 1e-6 * detail::largest_component(dxdt)) return rate;
        const auto near = rules_.around(Rules::bit(which) | Rules::sliding_in(at), at, t, x);
        const double size = detail::largest_component(near.rates[which]);
        return std::fabs(rate) <= Rules::template negligible<X> * size ? 0 : rate;
    }

    /// Places of the motion after the fields' own time reset: off the surfaces on which it
    /// slid, if that has moved it.
    template <class X>
    [[nodiscard]] Places after_time_event(Places at, double t, X& x) const
    {
        if constexpr (requires { fields().time_reset(t, x); }) {
            std::array<double, 2> before{};
            for (std::size_t i = 0; i < surface_count; ++i) before[i] = rules_.surface(i, t, x);
            fields().time_reset(t, x);
            for (std::size_t i = 0; i < surface_count; ++i) {
                const double h = rules_.surface(i, t, x);
                if (h != before[i]) at[i] = h > 0 ? Place::above : Place::below;
            }
        }
        return at;
    }

    Rules rules_;
};

}  // namespace ricochet
