// Internal: the declarations of this header may change without notice.
//
// A system and its derivatives: the derivatives that it declares, else dual numbers where its
// functions take any scalar (guard.hpp), else differences.
//
//     flow_derivative([mode,] t, x, s, ds)              ds = (df/dx) s
//     guard_derivative([which,] [mode,] t, x, s)        (dg/dx) s
//     reset_derivative([which,] [mode,] t, x, dt, s)    s becomes (dR/dx) s + (dR/dt) dt, with
//                                                       x the state before the reset
//
// Each is optional, const, and takes the same leading arguments as the function that it
// differentiates: `which` in a system that counts its guards, the fired set where the
// reset takes one, the mode where the system has modes.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/declarations.hpp"
#include "ricochet/detail/dual_derivatives.hpp"
#include "ricochet/detail/scratch.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/sensitivity/differences.hpp"
#include "ricochet/sensitivity/directions.hpp"
#include "ricochet/system.hpp"

namespace ricochet::detail {

/// The components of a state, which lie one after another.
template <class X>
[[nodiscard]] auto numbers_of(X& x)
{
    return std::span(x.data(), static_cast<std::size_t>(x.size()));
}

/// A state of n components, uninitialised or zero.
template <class X>
[[nodiscard]] X state_of_size(std::size_t n)
{
    if constexpr (fixed_size<X>() > 0) {
        return X{};
    } else {
        return X(static_cast<decltype(std::declval<const X&>().size())>(n));
    }
}

// --- exact members ---

template <class System, class X>
[[nodiscard]] bool exact_flow(const System& system, const Along<X>& at, X& ds)
{
    if constexpr (requires { system.flow_derivative(at.mode, at.t, at.x, at.s, ds); }) {
        system.flow_derivative(at.mode, at.t, at.x, at.s, ds);
        return true;
    } else if constexpr (requires { system.flow_derivative(at.t, at.x, at.s, ds); }) {
        system.flow_derivative(at.t, at.x, at.s, ds);
        return true;
    } else if constexpr (flow_takes_duals<System, X>) {
        flow_by_duals(system, at, ds);
        return true;
    } else {
        return false;
    }
}

template <class System, class X>
[[nodiscard]] double exact_guard(const System& system, [[maybe_unused]] std::size_t which,
                                 const Along<X>& at)
{
    if constexpr (requires { system.guard_derivative(which, at.mode, at.t, at.x, at.s); }) {
        return system.guard_derivative(which, at.mode, at.t, at.x, at.s);
    } else if constexpr (CountsGuards<System>) {
        return system.guard_derivative(which, at.t, at.x, at.s);
    } else if constexpr (requires { system.guard_derivative(at.mode, at.t, at.x, at.s); }) {
        return system.guard_derivative(at.mode, at.t, at.x, at.s);
    } else {
        return system.guard_derivative(at.t, at.x, at.s);
    }
}

/// Whether the derivatives that take a mode and the number of a guard take the number first.
template <class System, class X>
[[nodiscard]] constexpr bool derivatives_in_order() noexcept
{
    using Which = Only<std::size_t>;
    constexpr bool guard =
        requires(const System& of, Which which, Only<Mode> mode, double t, const X& x)
    {
        of.guard_derivative(mode, which, t, x, x);
    }
    &&!requires(const System& of, Which which, Only<Mode> mode, double t, const X& x)
    {
        of.guard_derivative(which, mode, t, x, x);
    };
    constexpr bool reset =
        requires(const System& of, Which which, Only<Mode> mode, double t, const X& x, X& s)
    {
        of.reset_derivative(mode, which, t, x, t, s);
    }
    &&!requires(const System& of, Which which, Only<Mode> mode, double t, const X& x, X& s)
    {
        of.reset_derivative(which, mode, t, x, t, s);
    };
    return !guard && !reset;
}

template <class System, class X, class... Which>
[[nodiscard]] bool exact_reset(const System& system, const BeforeReset<X>& at, X& s,
                               const Which&... which)
{
    if constexpr (requires { system.reset_derivative(which..., at.mode, at.t, at.x, at.dt, s); }) {
        system.reset_derivative(which..., at.mode, at.t, at.x, at.dt, s);
        return true;
    } else if constexpr (requires { system.reset_derivative(which..., at.t, at.x, at.dt, s); }) {
        system.reset_derivative(which..., at.t, at.x, at.dt, s);
        return true;
    } else if constexpr (reset_takes_duals<System, X, Which...>) {
        reset_by_duals(system, at, s, which...);
        return true;
    } else {
        return false;
    }
}

/// A system in which the resets of some guards, those for which `settles(which)` holds, put the
/// state where it is but for rounding and drift. They are not differentiated.
template <class System>
concept ResetsSettle = requires
{
    {
        System::settles(std::size_t{})
        } -> std::same_as<bool>;
};

/// Whether the reset of a guard is one of those.
template <class System>
[[nodiscard]] constexpr bool reset_settles([[maybe_unused]] std::size_t which) noexcept
{
    if constexpr (ResetsSettle<System>) {
        return System::settles(which);
    } else {
        return false;
    }
}

// --- the kinds of reset, with a common interface ---

/// The reset of one guard, as the run applies it to a set of one.
struct ResetOf {
    std::size_t which;

    [[nodiscard]] FiredGuards all() const noexcept { return FiredGuards(std::span(&which, 1)); }

    template <class System>
    [[nodiscard]] constexpr bool settles() const noexcept
    {
        return reset_settles<System>(which);
    }

    template <class System, class X>
    [[nodiscard]] Mode apply(const System& system, Mode mode, double t, X& x) const
    {
        if constexpr (ResetsTogether<System, X>) {
            return call_reset_set(system, FiredGuards(std::span(&which, 1)), mode, t, x);
        } else {
            return call_reset(system, which, mode, t, x);
        }
    }
    template <class System, class X>
    [[nodiscard]] bool derive(const System& system, const BeforeReset<X>& at, X& s) const
    {
        if (settles<System>()) return true;
        if constexpr (ResetsTogether<System, X>) {
            return exact_reset(system, at, s, FiredGuards(std::span(&which, 1)));
        } else if constexpr (CountsGuards<System>) {
            return exact_reset(system, at, s, which);
        } else {
            return exact_reset(system, at, s);
        }
    }
};

/// Two resets of one set that write different values to the same number; a time event counts
/// as the guard before `no_guard`.
struct Conflict {
    std::size_t first = no_guard;
    std::size_t second = no_guard;
    [[nodiscard]] bool any() const noexcept { return first != no_guard; }
};

/// The resets of a fired set together, as a run applies them: by the system's own reset for
/// sets, or else each reads the state before and writes the components that it changes.
struct ResetSet {
    FiredGuards fired;

    [[nodiscard]] FiredGuards all() const noexcept { return fired; }

    template <class System>
    [[nodiscard]] bool settles() const noexcept
    {
        return !fired.time_event() && std::ranges::all_of(fired, &reset_settles<System>);
    }

    template <class System, class X>
    [[nodiscard]] Mode apply(const System& system, Mode mode, double t, X& x) const
    {
        Conflict conflict;
        return apply(system, mode, t, x, conflict);
    }

    template <class System, class X>
    [[nodiscard]] Mode apply(const System& system, Mode mode, double t, X& x,
                             Conflict& conflict) const
    {
        if constexpr (ResetsTogether<System, X>) {
            return call_reset_set(system, fired, mode, t, x);
        } else {
            Merging<X> merging(mode, x);
            if constexpr (ResetsAlone<System, X>) {
                for (const std::size_t which : fired) {
                    if (!guard_info_of<X>(system, which).resets) continue;
                    X after = x;
                    const Mode next = call_reset(system, which, mode, t, after);
                    merging.add(which, next, after);
                }
            }
            if (fired.time_event()) {
                X after = x;
                const Mode next = call_time_reset(system, mode, t, after);
                merging.add(time_event_reset, next, after);
            }
            conflict = merging.conflict;
            x = merging.after;
            return merging.mode_after;
        }
    }

    template <class System, class X>
    [[nodiscard]] bool derive(const System& system, const BeforeReset<X>& at, X& s) const
    {
        if (settles<System>()) return true;
        if constexpr (ResetsTogether<System, X>) {
            return exact_reset(system, at, s, fired);
        } else {
            if (fired.size() != 1 || fired.time_event()) return false;
            return ResetOf{fired[0]}.derive(system, at, s);
        }
    }

private:
    template <class X>
    struct Merging {
        Merging(Mode mode, const X& x)
            : mode_before(mode),
              mode_after(mode),
              before(x),
              after(x),
              writers(static_cast<std::size_t>(x.size()), no_guard)
        {
        }

        void add(std::size_t writer, Mode next, const X& made)
        {
            if (next != mode_before) {
                claim(mode_writer, writer, next == mode_after);
                mode_after = next;
            }
            if (made.size() != before.size() || after.size() != before.size()) {
                if (any) conflict = {last, writer};
                after = made;
            } else {
                for_each_component(before, [&](auto i) {
                    if (made[i] == before[i]) return;
                    claim(writers[static_cast<std::size_t>(i)], writer, made[i] == after[i]);
                    after[i] = made[i];
                });
            }
            any = true;
            last = writer;
        }

        void claim(std::size_t& owner, std::size_t writer, bool same)
        {
            if (owner != no_guard && !same) conflict = {owner, writer};
            owner = writer;
        }

        Mode mode_before, mode_after;
        X before, after;
        std::vector<std::size_t> writers;
        std::size_t mode_writer = no_guard;
        bool any = false;
        std::size_t last = no_guard;
        Conflict conflict{};
    };
};

/// The state at the limit of accumulating events of a guard.
struct RestOf {
    std::size_t which;

    template <class System, class X>
    [[nodiscard]] Mode apply(const System& system, Mode mode, double t, X& x) const
    {
        return call_rest(system, which, mode, t, x);
    }
    template <class System, class X>
    [[nodiscard]] static bool derive(const System&, const BeforeReset<X>&, X&)
    {
        return false;
    }
};

struct TimeReset {
    template <class System, class X>
    [[nodiscard]] static Mode apply(const System& system, Mode mode, double t, X& x)
    {
        return call_time_reset(system, mode, t, x);
    }
    template <class System, class X>
    [[nodiscard]] static bool derive([[maybe_unused]] const System& system,
                                     [[maybe_unused]] const BeforeReset<X>& at,
                                     [[maybe_unused]] X& s)
    {
        if constexpr (!TimeResetting<System, X>) return true;
        if constexpr (TimeResetting<System, X> && time_reset_takes_duals<System, X>) {
            time_reset_by_duals(system, at, s);
            return true;
        }
        return false;
    }
};

/// The guards that fired, and whether a time event did.
[[nodiscard]] inline FiredGuards fired_in(const ResetOf& reset) noexcept
{
    return reset.all();
}
[[nodiscard]] inline FiredGuards fired_in(const ResetSet& reset) noexcept
{
    return reset.all();
}
[[nodiscard]] inline FiredGuards fired_in(const TimeReset&) noexcept
{
    return FiredGuards({}, true);
}

/// Applies a reset, and lets a system decide its mode that does so after sets. Derivatives are
/// those of the reset alone: between neighbouring points the decision may differ, and it moves the
/// state by rounding.
template <class Reset, class System, class X>
[[nodiscard]] Mode apply_set(const Reset& reset, const System& system, Mode mode, double t, X& x)
{
    if constexpr (DecidesAfterSets<System, X> && !std::is_same_v<Reset, RestOf>) {
        const X before = x;
        (void)reset.apply(system, mode, t, x);
        return system.after_set(fired_in(reset), mode, t, before, x);
    } else {
        return reset.apply(system, mode, t, x);
    }
}

/// Flow, guards and resets of a system, and their derivatives along directions (f_x s)
/// and by its parameters (f_p), the latter by differences unless the parameter has them. The fields
/// on both sides of a surface are assumed to be smooth across it, since differences evaluate them
/// beyond it.
template <class System, class X>
class Linearization {
public:
    /// @throws std::invalid_argument for parameters or differences that are not meaningful, and
    /// any exception of `Parameter::with`.
    Linearization(const System& system, const std::vector<Parameter<System>>& parameters,
                  const Differences& differences, std::size_t components)
        : system_(system), differences_(differences)
    {
        validate(differences, components);
        parameters_.reserve(parameters.size());
        for (std::size_t j = 0; j < parameters.size(); ++j) {
            const Parameter<System>& p = parameters[j];
            validate_parameter(j, static_cast<bool>(p.with), p.nominal, p.scale, p.start,
                               components);
            parameters_.push_back(neighbours_of(p, differences.step));
            exact_.push_back(p.exact);
        }
    }

    [[nodiscard]] const System& system() const noexcept { return system_; }
    [[nodiscard]] std::size_t parameters() const noexcept { return parameters_.size(); }

    // --- flow ---

    [[nodiscard]] X flow(Mode mode, double t, const X& x) const
    {
        X f = x;
        call_flow(system_, mode, t, x, f);
        return f;
    }

    /// ds = (df/dx) s.
    void flow_along(Mode mode, double t, const X& x, const X& s, X& ds) const
    {
        if (exact_flow(system_, {mode, t, x, s, 0}, ds)) return;
        const double h = step_along(differences_, x, s);
        if (!std::isfinite(h)) {
            for_each_component(ds, [&](auto i) { ds[i] = 0; });
            return;
        }
        Scratch<X, 1> room(x);
        const auto flow_at = [&](std::size_t k, X& f) {
            move(room[0], x, central_stencil.offset[k] * h, s);
            call_flow(system_, mode, t, room[0], f);
        };
        differentiate_into(ds, central_stencil, h, flow_at);
    }

    /// df = df/dp of parameter j.
    void flow_by(std::size_t j, Mode mode, double t, const X& x, X& df) const
    {
        if (exact_[j].flow) return exact_[j].flow(mode, t, numbers_of(x), numbers_of(df));
        const Neighbours<System>& around = parameters_[j];
        const auto flow_at = [&](std::size_t k, X& f) {
            call_flow(around.systems[k], mode, t, x, f);
        };
        differentiate_into(df, around.stencil, around.h, flow_at);
    }

    /// The flow at a state of any scalar, for systems whose flow is a template over its scalar.
    template <class S, class Xs>
    void flow_of(Mode mode, const S& t, const Xs& x, Xs& f) const
    {
        flow_of_scalar(system_, mode, t, x, f);
    }
    /// As `flow_along`.
    template <class S, class Xs>
    void flow_along_of(Mode mode, const S& t, const Xs& x, const Xs& s, Xs& ds) const
    {
        flow_along_by_duals(system_, mode, t, dual_state<S>(x, s), ds);
    }
    /// As `flow_by`.
    template <class S, class Xs>
    void flow_by_of(std::size_t j, Mode mode, const S& t, const Xs& x, Xs& df) const
    {
        if (exact_[j].flow_series) {
            return exact_[j].flow_series(mode, t, x.data(), x.size(), df.data());
        }
        const Neighbours<System>& around = parameters_[j];
        Xs first = x, value = x;
        flow_of_scalar(around.systems[0], mode, t, x, first);
        for (S& sum : df) sum = S(0.0);
        for (std::size_t k = 1; k < around.stencil.points; ++k) {
            flow_of_scalar(around.systems[k], mode, t, x, value);
            for (std::size_t i = 0; i < x.size(); ++i) {
                df[i] += around.stencil.weight[k] / around.h * (value[i] - first[i]);
            }
        }
    }

    // --- guards ---

    [[nodiscard]] double guard(std::size_t which, Mode mode, double t, const X& x) const
    {
        return guard_of(system_, which, mode, t, x);
    }

    /// (dg/dx) s.
    [[nodiscard]] double guard_along(std::size_t which, Mode mode, double t, const X& x,
                                     const X& s) const
    {
        if constexpr (has_exact_guard) {
            return exact_guard(system_, which, Along{mode, t, x, s, 0});
        } else if constexpr (RateByDuals<System, X>) {
            return rate_by_duals(system_, which, Along{mode, t, x, s, 0});
        } else {
            const double h = step_along(differences_, x, s);
            if (!std::isfinite(h)) return 0;
            return differentiate(central_stencil, h, [&](std::size_t k) {
                return guard(which, mode, t, moved_along(x, central_stencil.offset[k] * h, s));
            });
        }
    }

    /// dg/dp of parameter j.
    [[nodiscard]] double guard_by(std::size_t j, std::size_t which, Mode mode, double t,
                                  const X& x) const
    {
        if (exact_[j].guard) return exact_[j].guard(which, mode, t, numbers_of(x));
        return by_parameter(
            j, [&](const System& system) { return guard_of(system, which, mode, t, x); });
    }

    /// dg/dt + (dg/dx) f along x' = f.
    [[nodiscard]] double guard_rate(std::size_t which, Mode mode, double t, const X& x,
                                    const X& f) const
    {
        if constexpr (RateAlone<System, X>) {
            return call_rate(system_, which, Along{mode, t, x, f});
        } else if constexpr (RatesTogether<System, X>) {
            std::vector<double> rates(guard_count_of<X>(system_));
            call_rates(system_, Along{mode, t, x, f}, std::span<double>(rates));
            return rates[which];
        } else {
            const double h = step_in_time(x, f, 1);
            return differentiate(central_stencil, h, [&](std::size_t k) {
                const double later = central_stencil.offset[k] * h;
                return guard(which, mode, t + later, moved_along(x, later, f));
            });
        }
    }

    // --- resets ---

    /// (dR/dx) s + (dR/dt) dt at the state before the reset.
    template <class Reset>
    [[nodiscard]] X reset_along(const Reset& reset, const BeforeReset<X>& at, const X& s) const
    {
        X after = s;
        if (reset.derive(system_, at, after)) return after;
        const auto& [mode, t, dt, x] = at;
        const double h = step_in_time(x, s, dt);
        if (!std::isfinite(h)) return zeros_shaped_like(reset_of(system_, reset, mode, t, x));
        return differentiate(central_stencil, h, [&](std::size_t k) {
            const double factor = central_stencil.offset[k] * h;
            return reset_of(system_, reset, at.mode, at.t + factor * at.dt,
                            moved_along(at.x, factor, s));
        });
    }

    /// dR/dp of parameter j.
    template <class Reset>
    [[nodiscard]] X reset_by(std::size_t j, const Reset& reset, Mode mode, double t,
                             const X& x) const
    {
        if constexpr (requires { reset.all(); }) {
            X by = x;
            if (reset.template settles<System>()) return zeros_shaped_like(by);
            if (exact_[j].reset && resets(reset.all()) &&
                exact_[j].reset(reset.all(), mode, t, numbers_of(x), numbers_of(by))) {
                return by;
            }
        }
        return by_parameter(
            j, [&](const System& system) { return reset_of(system, reset, mode, t, x); });
    }

    /// Derivative by parameter j of the value of `function` for a system.
    template <class Function>
    [[nodiscard]] auto by_parameter(std::size_t j, const Function& function) const
    {
        const Neighbours<System>& around = parameters_[j];
        return differentiate(around.stencil, around.h,
                             [&](std::size_t k) { return function(around.systems[k]); });
    }

    /// The systems around parameter j.
    [[nodiscard]] const Neighbours<System>& around(std::size_t j) const noexcept
    {
        return parameters_[j];
    }

private:
    static constexpr bool has_exact_guard = [] {
        if constexpr (CountsGuards<System>) {
            return requires(const System& system, std::size_t which, Mode mode, double t,
                            const X& x)
            {
                system.guard_derivative(which, mode, t, x, x);
            }
            || requires(const System& system, std::size_t which, double t, const X& x)
            {
                system.guard_derivative(which, t, x, x);
            };
        } else {
            return requires(const System& system, Mode mode, double t, const X& x)
            {
                system.guard_derivative(mode, t, x, x);
            }
            || requires(const System& system, double t, const X& x)
            {
                system.guard_derivative(t, x, x);
            };
        }
    }();

    [[nodiscard]] static double guard_of(const System& system, std::size_t which, Mode mode,
                                         double t, const X& x)
    {
        if constexpr (GuardAlone<System, X>) {
            return call_guard(system, which, mode, t, x);
        } else {
            std::vector<double> g(guard_count_of<X>(system));
            call_guards(system, mode, t, x, std::span<double>(g));
            return g[which];
        }
    }

    /// Whether all that fired have resets.
    [[nodiscard]] bool resets(const FiredGuards& fired) const
    {
        return std::ranges::all_of(
            fired, [this](std::size_t which) { return guard_info_of<X>(system_, which).resets; });
    }

    /// The state after a reset; NaN if the resets of a set contradict each other.
    template <class Reset>
    [[nodiscard]] static X reset_of(const System& system, const Reset& reset, Mode mode, double t,
                                    X x)
    {
        if constexpr (requires(Conflict & conflict) {
                          reset.apply(system, mode, t, x, conflict);
                      }) {
            Conflict conflict;
            (void)reset.apply(system, mode, t, x, conflict);
            if (conflict.any()) {
                for_each_component(
                    x, [&](auto i) { x[i] = std::numeric_limits<double>::quiet_NaN(); });
            }
        } else {
            (void)reset.apply(system, mode, t, x);
        }
        return x;
    }

    /// As `step_along`, for a direction that also has a part in time.
    [[nodiscard]] double step_in_time(const X& x, const X& s, double dt) const
    {
        const double in_time = differences_.step * differences_.time_scale / std::fabs(dt);
        return std::min(step_along(differences_, x, s), in_time);
    }

    System system_;
    Differences differences_;
    std::vector<Neighbours<System>> parameters_;
    std::vector<ParameterDerivatives> exact_;
};

}  // namespace ricochet::detail
