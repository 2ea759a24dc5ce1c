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
// or of 1 where that is larger.
//
// Fields may have guards, resets, stops and time events of their own: `guard_count`, `guard`,
// `guard_rate`, `guard_info`, `reset`, `rest`, `enabled`, `next_time_event`, `time_reset` and their
// kin, in the forms of a system without modes (system.hpp), and a type `State`. They are
// watched wherever the motion is, beside its surfaces or sliding on them:
//
//     std::size_t guard_count = 1;
//     double guard(std::size_t which, double t, const X& x) const;      // a wall
//     void reset(std::size_t which, double t, X& x) const;              // rebound
//
// Among the guards of `Filippov` they come after those of the surfaces, at `own_guard(i)`.
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
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/declarations.hpp"
#include "ricochet/detail/filippov_decision.hpp"
#include "ricochet/detail/filippov_events.hpp"
#include "ricochet/detail/filippov_motion.hpp"
#include "ricochet/detail/filippov_rates.hpp"
#include "ricochet/detail/guard_count.hpp"
#include "ricochet/detail/guard_view.hpp"
#include "ricochet/detail/scratch.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/system.hpp"

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
/// Guards of the fields follow, `own_guard(i)`, with the properties that the fields declare.
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
class Filippov
    : public detail::FilippovState<Fields>,
      public detail::GuardCount<detail::guard_count_with<Fields>(4 * Fields::surface_count)> {
    using Own = detail::OwnEvents<Fields>;
    using Count = detail::GuardCount<detail::guard_count_with<Fields>(4 * Fields::surface_count)>;
    using Rules = detail::FilippovDecision<Fields>;
    using Places = detail::Places;
    using Surfaces = detail::Surfaces;

public:
    static constexpr bool unchecked_names = true;  // some members only where the fields have them
    static constexpr bool forward_only = true;     ///< runs backward in time are refused
    static constexpr std::size_t surface_count = Fields::surface_count;
    static constexpr std::size_t guards_per_surface = 4;
    /// Number of guards of the surfaces, before those of the fields.
    static constexpr std::size_t surface_guards = guards_per_surface * surface_count;
    static constexpr std::size_t mode_count = surface_count == 1 ? 3 : 9;

    /// @throws std::invalid_argument if the restoring rate is negative or not finite.
    explicit Filippov(Fields fields = {}, const FilippovOptions& options = {})
        : Count(surface_guards + detail::own_guards(fields)), rules_(std::move(fields), options)
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

    /// Number of guard i of the fields among all guards.
    [[nodiscard]] static constexpr std::size_t own_guard(std::size_t i) noexcept
    {
        return surface_guards + i;
    }

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const
    {
        if (is_own(which)) return detail::own_guard_info<Fields>(own(), which - surface_guards);
        GuardInfo info;
        info.name = detail::filippov_guard_name(which);
        info.unilateral = !is_exit(which);
        return info;
    }

    [[nodiscard]] static constexpr bool enabled(std::size_t which, Mode mode) noexcept
    {
        if (is_own(which)) return true;
        const Place at = place(surface_of(which), mode);
        switch (kind_of(which)) {
            case leaves_below: return at == Place::below;
            case leaves_above: return at == Place::above;
            default: return at == Place::sliding;
        }
    }

    /// As the fields' `enabled(which, t, x)`.
    template <StateVector X>
    requires detail::EnabledAt<detail::OwnEvents<Fields>, X>
    [[nodiscard]] bool enabled(std::size_t which, Mode, double t, const X& x) const
    {
        return !is_own(which) || detail::call_enabled_at(own(), which - surface_guards, 0, t, x);
    }

    // --- the functions of a hybrid system ---

    template <StateVector X>
    void flow(Mode mode, double t, const X& x, X& dxdt) const
    {
        static_assert(detail::check_fields<Fields, X>());
        rules_.flow(places(mode), t, x, dxdt);
    }

    template <StateVector X>
    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const X& x) const
    {
        if constexpr (has_own) {
            if (is_own(which)) return own_value(which, t, x);
        }
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
        if constexpr (has_own) detail::call_guards(own(), 0, t, x, g.subspan(surface_guards));
    }

    /// The rate of a surface, set to zero if its sign is only rounding: then the
    /// side to which a motion tangent to its surface bends is found from its curvature.
    /// Rates of exits are differences, and so are those of guards of the fields whose rate is
    /// neither given nor found by dual numbers: over the same displacement as those of the
    /// surfaces.
    template <StateVector X>
    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const X& x,
                                    const X& dxdt) const
    {
        if constexpr (has_own) {
            if (is_own(which)) return own_rate(which, t, x, dxdt);
        }
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
        if constexpr (has_own) own_rates(t, x, dxdt, rates.subspan(surface_guards));
    }

    // --- resets of the fields; those at surfaces are left to `after_set` ---

    template <StateVector X>
    requires(!detail::ResetsTogether<detail::OwnEvents<Fields>, X> &&
             !detail::DirectedReset<detail::OwnEvents<Fields>, X>) [[nodiscard]] Mode
        reset(std::size_t which, Mode mode, double t, X& x) const
    {
        if constexpr (Resetting<Own, X>) {
            if (is_own(which)) (void)detail::call_reset(own(), which - surface_guards, 0, t, x);
        }
        return mode;
    }
    template <StateVector X>
    requires detail::DirectedReset<detail::OwnEvents<Fields>, X>
    [[nodiscard]] Mode reset(std::size_t which, Crossing direction, Mode mode, double t, X& x) const
    {
        if (is_own(which))
            (void)detail::call_reset(own(), which - surface_guards, direction, 0, t, x);
        return mode;
    }
    /// Where the fields reset all guards that fired together.
    template <StateVector X>
    requires detail::ResetsTogether<detail::OwnEvents<Fields>, X>
    [[nodiscard]] Mode reset(const FiredGuards& fired, Mode mode, double t, X& x) const
    {
        std::vector<std::size_t> guards;
        for (const std::size_t which : fired) {
            if (is_own(which)) guards.push_back(which - surface_guards);
        }
        if (!guards.empty()) {
            (void)detail::call_reset_set(own(), FiredGuards(guards, fired.time_event()), 0, t, x);
        } else if (fired.time_event()) {
            (void)detail::call_time_reset(own(), 0, t, x);
        }
        return mode;
    }
    /// Whether the reset of a guard only removes rounding and drift, which depend on neither the
    /// state nor the parameters: its derivative is the identity.
    [[nodiscard]] static constexpr bool settles(std::size_t which) noexcept
    {
        return !is_own(which);
    }

    /// Mode after a set of events, decided after all resets of the fields, which led from `before`
    /// to x. x is moved onto the surfaces on which it is to slide or has slid, by the rounding and
    /// drift that separates it from them, along the jumps of the field. The decision is made
    /// exactly on the surfaces.
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
    /// Where resets have moved the state, nothing of this history counts: a surface that was met
    /// and whose h the resets have left alone, and one to which they have moved the state, within
    /// the rounding of its terms, are decided as at a start; beside the others, also those along
    /// which it slid, the sign of h decides. A fired exit counts only if the set changed nothing.
    ///
    /// `meeting` returns the result in advance.
    template <StateVector X>
    [[nodiscard]] Mode after_set(const FiredGuards& fired, Mode mode, double t, const X& before,
                                 X& x) const
    {
        if (!detail::same_state(before, x)) {
            return decide_anew(places(mode), met_by(fired), t, before, x);
        }
        if (met_by(fired) == 0) {
            if (!fired.time_event()) return mode;
            return number(rules_.decide(places(mode), Rules::sliding_in(places(mode)), t, x));
        }
        const Places from = places(mode);
        const Surfaces on = Rules::sliding_in(from) | rules_.reached_in(from, t, x) | met_by(fired);
        typename Rules::FiredExits exits = fired.time_event() ? 0 : exits_in(fired);
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
    /// other accumulation of crossings that Filippov's rule could continue: one of crossings of one
    /// surface is sliding of second order, which needs the rate of h as a second surface. Such a
    /// run ends; with two surfaces `rest` sets the state to NaN.
    ///
    /// Where events of a guard of the fields accumulate, also together with crossings of a surface,
    /// the motion rests as the fields say.
    template <StateVector X>
    requires(surface_count == 2 || Resting<detail::OwnEvents<Fields>, X>) [[nodiscard]] Mode
        rest(std::size_t which, Mode mode, double t, X& x) const
    {
        if constexpr (Resting<Own, X>) {
            if (is_own(which)) {
                const X before = x;
                (void)detail::call_rest(own(), which - surface_guards, 0, t, x);
                if (detail::same_state(before, x)) return mode;
                return decide_anew(places(mode), 0, t, before, x);
            }
        }
        if constexpr (surface_count == 2) return rest_on_both(surface_of(which), mode, t, x);
        return mode;
    }
    /// Whether `rest` continues an accumulation of events of guard `which` and another one.
    [[nodiscard]] static constexpr bool rests(std::size_t which, std::size_t other) noexcept
    {
        if (is_own(which)) return own_rests;
        return surface_count == 2 && (other == no_guard || !is_own(other));
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
    [[nodiscard]] double next_time_event(double t, const X& x) const
        requires(detail::timer_form<Fields, X> == detail::Form::plain)
    {
        return fields().next_time_event(t, x);
    }

    /// The jump of the fields' own `time_reset`. The places are decided in `after_set`, also where
    /// there is none, since the fields may have changed.
    template <StateVector X>
    [[nodiscard]] Mode time_reset(Mode mode, double t, X& x)
        const requires detail::TimeResetting<detail::OwnEvents<Fields>, X>
    {
        (void)detail::call_time_reset(own(), 0, t, x);
        return mode;
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
    static constexpr std::size_t fixed_own = detail::own_guard_count<Fields>();
    static constexpr bool has_own = fixed_own > 0;
    static constexpr bool own_rests = detail::own_guards_rest<Fields>();

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

    // --- guards of the fields ---

    [[nodiscard]] const Own& own() const noexcept { return rules_.fields(); }
    [[nodiscard]] static constexpr bool is_own(std::size_t which) noexcept
    {
        return has_own && which >= surface_guards;
    }

    template <class X>
    [[nodiscard]] double own_value(std::size_t which, double t, const X& x) const
    {
        std::uint64_t calls = 0;  // the loop counts them
        return detail::GuardView<Own, X>(own(), calls, {which - surface_guards, 0}).value(t, x);
    }
    template <class X>
    [[nodiscard]] double own_rate(std::size_t which, double t, const X& x, const X& dxdt) const
    {
        std::uint64_t calls = 0;
        const double size = detail::greatest_of(1.0, detail::largest_component(x));
        const double speed = detail::largest_component(dxdt);
        const double scale =
            0.6 * (speed > 0 ? size / speed : detail::greatest_of(1.0, std::fabs(t)));
        return detail::GuardView<Own, X>(own(), calls, {which - surface_guards, 0})
            .rate(t, x, dxdt, scale);
    }
    template <class X>
    void own_rates(double t, const X& x, const X& dxdt, std::span<double> rates) const
    {
        if constexpr (detail::RatesTogether<Own, X>) {
            detail::call_rates(own(), detail::Along<X>{0, t, x, dxdt}, rates);
        } else {
            for (std::size_t i = 0; i < rates.size(); ++i) {
                rates[i] = own_rate(own_guard(i), t, x, dxdt);
            }
        }
    }

    // --- decisions ---

    /// The surfaces whose guards have fired.
    [[nodiscard]] static Surfaces met_by(const FiredGuards& fired) noexcept
    {
        Surfaces met = 0;
        for (const std::size_t which : fired) {
            if (!is_own(which)) met |= Rules::bit(surface_of(which));
        }
        return met;
    }

    /// The exits that have fired, if no motion beside a surface has met it together with them.
    [[nodiscard]] static typename Rules::FiredExits exits_in(const FiredGuards& fired) noexcept
    {
        typename Rules::FiredExits exits = 0;
        for (const std::size_t which : fired) {
            if (is_own(which)) continue;
            if (!is_exit(which)) return 0;
            exits |= 1u << exit_of(which);
        }
        return exits;
    }

    /// The mode after resets that have moved the state from `before` to x; the surfaces in `met`
    /// had been met at `before`.
    template <class X>
    [[nodiscard]] Mode decide_anew(Places at, Surfaces met, double t, const X& before, X& x) const
    {
        met |= Rules::sliding_in(at) | rules_.reached_in(at, t, before);
        Surfaces on = 0;
        for (std::size_t i = 0; i < surface_count; ++i) {
            const double h = rules_.surface(i, t, x);
            const double rounding = rules_.rounding(i, t, before, x);
            const bool is_met = met & Rules::bit(i);
            const bool stays = before.size() == x.size() &&
                               std::fabs(h - rules_.surface(i, t, before)) <= rounding;
            const bool is_on = stays ? is_met : std::fabs(h) <= rounding;
            if (is_on) {
                on |= Rules::bit(i);
                at[i] = Place::sliding;
            } else if (!stays) {
                at[i] = h > 0 ? Place::above : Place::below;
            }
        }
        if (on == 0) return number(at);
        return number(rules_.meet(on, at, t, x,
                                  [&](const X& there) { return rules_.decide(at, on, t, there); }));
    }

    /// The rest at the limit of crossings of two surfaces.
    template <class X>
    [[nodiscard]] Mode rest_on_both(std::size_t surface, Mode mode, double t, X& x) const
    {
        const std::size_t other = 1 - surface;
        const Places from = places(mode);
        if (from[other] != Place::sliding && !rules_.is_near(other, t, x)) {
            detail::for_each_component(
                x, [&](auto i) { x[i] = std::numeric_limits<double>::quiet_NaN(); });
            return mode;
        }
        rules_.settle(Rules::both, from, Rules::held_on(Rules::both, from), t, x);
        return number(rules_.decide_on_both({}, t, x));
    }

    Rules rules_;
};

}  // namespace ricochet
