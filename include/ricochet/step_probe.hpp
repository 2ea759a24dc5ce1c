// One guard along one step: the view that detectors and locators have of a step.
//
// Detectors and locators are compiled once, over `GuardPath`; `StepProbe` is the path of a guard of
// any system along a step of any method.
//
// A state inside a step can be obtained in two forms. Repeating the step from its start with
// another length is as accurate as the method, and is used for events that change the
// motion. The step's polynomial is nearly as accurate and can be evaluated one component at
// a time, and is used for events that are only recorded.
//
// Times inside a step are offsets s in [0, h] from its start, because an offset
// resolves more than an absolute time: at t = 20 s neighbouring doubles are 4e-15 s
// apart, at s = 0.01 s they are 2e-18 s apart. In a run backward in time offsets are
// positive too, and rates are with respect to them. A host's own integrator can offer
// its steps in this form and use the detectors and locators without our loop.
#pragma once

#include <cmath>
#include <concepts>
#include <limits>
#include <utility>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/finding.hpp"
#include "ricochet/instant.hpp"

namespace ricochet {

/// A step from `start()` to `start()` + h of a one-step method. `restep` is the
/// method's own map from the start of the step, `interpolate` its dense output.
template <class S, class X>
concept MethodStep = requires(const S& step, double s, X& x, X& dxdt, const X& at)
{
    {
        step.time(s)
        } -> std::convertible_to<double>;  // t at offset s
    {
        step.h()
        } -> std::convertible_to<double>;
    {
        step.x0()
        } -> std::convertible_to<const X&>;
    {
        step.x1()
        } -> std::convertible_to<const X&>;
    {
        step.rate0()
        } -> std::convertible_to<const X&>;
    {
        step.rate1()
        } -> std::convertible_to<const X&>;
    {
        step.order()
        } -> std::convertible_to<int>;
    step.interpolate(s, x);
    step.restep(s, x);
    step.restep(s, x, dxdt);  // the state, and the flow there
    step.flow(s, at, dxdt);   // dx/ds at offset s and state `at`
};

/// A step whose dense output is a polynomial that can be evaluated one component at a time.
template <class S, class X>
concept DenseStep = MethodStep<S, X> && requires(const S& step)
{
    {
        step.dense()
        } -> std::convertible_to<detail::DenseParts<X>>;
};

namespace detail {

/// Place at which the guard left its side, as offsets [s] from the start of the step.
struct Location {
    double lo = 0;                                            ///< still on the armed side
    double hi = 0;                                            ///< across the surface or on it
    double root = 0;                                          ///< best estimate of the root
    double root_remainder = 0;                                ///< rounding error of the root
    double slope = std::numeric_limits<double>::quiet_NaN();  ///< rate of the guard there
    double error = 0;   ///< [s] width of the bracket, or more where rounding in g is coarser
    bool jump = false;  ///< a change of sign without a zero: a pole, or a jump of the guard
};

/// Source of the states inside a step.
enum class Path {
    restep,  ///< the method's own map from the start of the step
    dense,   ///< the step's polynomial
};

}  // namespace detail

/// Narrowest useful bracket at offset s of a step of length h: neighbouring
/// doubles, or a millionth of their spacing at the end of the step.
[[nodiscard]] inline double finest_bracket(double s, double h) noexcept
{
    return std::numeric_limits<double>::epsilon() *
           detail::greatest_of(std::fabs(s), 0x1p-20 * std::fabs(h));
}

/// Largest fraction of a step over which the flow may be extrapolated: its square is 9e-16.
inline constexpr double straight_part = 3e-8;

/// Work space for the states of a probe, so that probing allocates nothing.
template <class X>
struct ProbeSpace {
    explicit ProbeSpace(const X& like) : x(like), dxdt(like), root(like) {}
    X x, dxdt, root;
};

/// Properties of a guard on a step that are known before it is evaluated.
struct PathProperties {
    double h = 0;  ///< [s] length of the step
    Crossing crossing = Crossing::falling;
    bool is_rated = true;        ///< the system gives the guard's rate; else it is a difference
    bool is_polynomial = false;  ///< the step has a polynomial, which continues beyond its end
    bool is_free = false;        ///< and the polynomial costs no evaluation of the flow
    double latest = std::numeric_limits<double>::infinity();  ///< [s] offset of the end of the run
};

/// A guard on a step as a function of the offset s in [0, h]: the only access to a motion that a
/// detector or a locator has. Evaluations may cost a step of the method.
class GuardPath {
public:
    GuardPath(const GuardPath&) = delete;
    GuardPath& operator=(const GuardPath&) = delete;

    [[nodiscard]] double h() const noexcept { return properties_.h; }
    [[nodiscard]] Crossing crossing() const noexcept { return properties_.crossing; }
    [[nodiscard]] bool is_rated() const noexcept { return properties_.is_rated; }
    [[nodiscard]] bool is_polynomial() const noexcept { return properties_.is_polynomial; }
    /// Offset [s] beyond which the guard must not be evaluated, since the run ends there.
    [[nodiscard]] double latest() const noexcept { return properties_.latest; }
    /// Whether a root is found more cheaply on the step's polynomial first: the polynomial is free,
    /// and the guard on it is not known to be the cubic through its ends.
    [[nodiscard]] bool foretells() const noexcept
    {
        return properties_.is_free && !is_cubic_ && path_ == detail::Path::restep;
    }
    /// Declares that the guard hardly differs from the cubic through its values and rates at the
    /// ends of the step.
    void take_as_cubic() noexcept { is_cubic_ = true; }

    /// Whether samples are taken from the step's polynomial.
    [[nodiscard]] bool on_polynomial() const noexcept { return path_ == detail::Path::dense; }

    /// The side from which a departure is searched for.
    [[nodiscard]] Side side() const noexcept { return side_; }

    /// Searches for a departure from `side` from now on.
    void watch(Side side) noexcept
    {
        side_ = side;
        settled_ = false;
    }

    /// Whether the guard of a sample has left the watched side.
    [[nodiscard]] bool has_left(const GuardSample& sample) const noexcept
    {
        return detail::has_left(side_, sample.value);
    }

    /// Narrowest useful bracket near offset s.
    [[nodiscard]] double finest(double s) const noexcept { return finest_bracket(s, h()); }

    /// The time [s] at offset s.
    [[nodiscard]] virtual double time(double s) const = 0;
    /// The guard at the start of the step.
    [[nodiscard]] virtual double start_value() = 0;
    /// The guard at offset s.
    [[nodiscard]] GuardSample value(double s) { return {.s = s, .value = value_at(s)}; }
    /// The guard and its rate at offset s.
    [[nodiscard]] GuardSample value_and_rate(double s) { return sample(s, point_at(s)); }
    /// The guard at offset s on the step's polynomial, whatever the path.
    [[nodiscard]] GuardSample dense_value(double s) { return {.s = s, .value = dense_value_at(s)}; }
    /// The guard and its rate at offset s on the step's polynomial, whatever the path.
    [[nodiscard]] GuardSample dense_value_and_rate(double s)
    {
        return sample(s, dense_point_at(s));
    }
    /// The guard at offset s: on the straight line along the flow through `from`, which must be the
    /// last sample that `value_and_rate` took, or on the polynomial.
    [[nodiscard]] GuardSample along_the_flow(const GuardSample& from, double s)
    {
        return {.s = s, .value = value_along_the_flow(from.s, s), .rate = from.rate};
    }
    /// Tells the path that the root lies `correction` [s] after the last sample that
    /// `value_and_rate` took, and that the motion is straight until there.
    virtual void settle(double correction) = 0;
    /// The rate of the guard at a sample for which it is not known yet.
    virtual void complete(GuardSample& sample) = 0;
    /// Change of the guard at offset s for 8 units in the last place of the time and of each
    /// component of the state, from its slopes.
    [[nodiscard]] virtual double rounding(double s) = 0;
    /// Change of the guard at offset s for 64 units in the last place of the time and of each
    /// component of the state, from values, so that it holds at a kink, too.
    [[nodiscard]] virtual double blur(double s) = 0;
    /// Degree of the guard in the offset on the step's polynomial; 0: not known.
    [[nodiscard]] virtual int degree() const = 0;

protected:
    /// Two numbers, which fit into registers when returned.
    struct Point {
        double value;
        double rate;
    };

    GuardPath(const PathProperties& properties, detail::Path path) noexcept
        : properties_(properties), path_(path)
    {
    }
    ~GuardPath() = default;

    [[nodiscard]] virtual double value_at(double s) = 0;
    [[nodiscard]] virtual Point point_at(double s) = 0;
    [[nodiscard]] virtual double dense_value_at(double s) = 0;
    [[nodiscard]] virtual Point dense_point_at(double s) = 0;
    [[nodiscard]] virtual double value_along_the_flow(double from, double s) = 0;

    PathProperties properties_;
    detail::Path path_;
    Side side_ = Side::plateau;
    bool settled_ = false;
    bool is_cubic_ = false;

private:
    [[nodiscard]] static GuardSample sample(double s, const Point& at) noexcept
    {
        return {.s = s, .value = at.value, .rate = at.rate};
    }
};

/// The path of one guard along one step of a method.
template <class Guard, class Step>
class StepProbe final : public GuardPath {
public:
    using State = typename Guard::State;

    /// Keeps references to all three.
    StepProbe(const Guard& guard, const Step& step, ProbeSpace<State>& space,
              detail::Path path = detail::Path::restep) noexcept
        : GuardPath({.h = step.h(),
                     .crossing = guard.crossing(),
                     .is_rated = is_rated(guard),
                     .is_polynomial = has_polynomial(step),
                     .is_free = interpolates(step),
                     .latest = latest_of(step)},
                    path),
          guard_(&guard),
          step_(&step),
          space_(&space)
    {
    }

    [[nodiscard]] const Guard& guard() const noexcept { return *guard_; }
    [[nodiscard]] const Step& step() const noexcept { return *step_; }

    [[nodiscard]] double time(double s) const override { return step_->time(s); }

    [[nodiscard]] double start_value() override
    {
        return guard_->value(step_->time(0), step_->x0());
    }

    void settle(double correction) override
    {
        if (path_ == detail::Path::dense) return;
        detail::move(space_->root, space_->x, correction, space_->dxdt);
        settled_ = true;
    }

    /// The state at the root that a locator found last.
    [[nodiscard]] const State& state_at(const detail::Location& where)
    {
        if (settled_) return space_->root;
        if (!(placed_ == where.root)) place(where.root);
        return space_->x;
    }

    /// Whether the root that a locator found last lies on the line along the flow in the work
    /// space.
    [[nodiscard]] bool is_settled() const noexcept { return settled_; }

    /// Offset [s] of the state in the work space, after `is_settled` of the sample from which the
    /// line starts.
    [[nodiscard]] double placed() const noexcept { return placed_; }

    void complete(GuardSample& sample) override
    {
        if (sample.rate == sample.rate) return;
        if (sample.s == 0) {
            sample.rate = guard_->rate(step_->time(0), step_->x0(), step_->rate0(), step_->h());
        } else if (sample.s == step_->h()) {
            sample.rate =
                guard_->rate(step_->time(sample.s), step_->x1(), step_->rate1(), step_->h());
        } else {
            sample.rate = value_and_rate(sample.s).rate;
        }
    }

    [[nodiscard]] double rounding(double s) override
    {
        constexpr double nudge = 1e-8;
        return 8 * std::numeric_limits<double>::epsilon() / nudge * nudged(s, nudge);
    }

    [[nodiscard]] double blur(double s) override
    {
        return nudged(s, 64 * std::numeric_limits<double>::epsilon());
    }

    /// Makes the bracket from detection, which used the polynomial, consistent with the step's own
    /// map. If the map disagrees with the polynomial about the near end, the bracket starts where
    /// the interval does; if it disagrees about the far end, which can happen near tangency, the
    /// polynomial is used from here on. False: the interval starts at an event on the map, which
    /// the polynomial meets later, and the departure is that event once more.
    /// @param armed  side on which the guard is at the start of the interval
    [[nodiscard]] bool agree_on(GuardSample& lo, const GuardSample& hi, const GuardSample& start,
                                Side armed)
    {
        if (path_ == detail::Path::dense) return true;
        const auto lags = [&] {
            return start.s > 0 && detail::has_left(armed, dense_value(start.s).value);
        };
        if (hi.s != step_->h() && !has_left(value(hi.s))) {
            if (lo.s == start.s && lags()) return false;
            path_ = detail::Path::dense;
        } else if (lo.s != start.s && has_left(value(lo.s))) {
            if (side_ == armed) {
                lo = start;
            } else {
                if (lags()) return false;
                path_ = detail::Path::dense;
            }
        }
        return true;
    }

    [[nodiscard]] int degree() const override
    {
        if constexpr (DenseStep<Step, State>) {
            if (has_polynomial(*step_)) {
                return guard_->degree() * step_->dense().degree();
            }
        }
        return 0;
    }

private:
    [[nodiscard]] double value_at(double s) override
    {
        if constexpr (may_see) {
            if (path_ == detail::Path::dense && sees())
                return guard_->value(step_->time(s), view(s));
        }
        place(s);
        return guard_->value(step_->time(s), space_->x);
    }

    [[nodiscard]] double dense_value_at(double s) override
    {
        const double t = step_->time(s);
        if constexpr (may_see) {
            if (sees()) return guard_->value(t, view(s));
        }
        step_->interpolate(s, space_->x);
        placed_ = path_ == detail::Path::dense ? s : std::numeric_limits<double>::quiet_NaN();
        return guard_->value(t, space_->x);
    }

    [[nodiscard]] Point dense_point_at(double s) override
    {
        const double t = step_->time(s);
        if constexpr (may_see) {
            if (sees()) return point_of_view(s, t);
        }
        step_->interpolate(s, space_->x);
        // The rate of the polynomial itself: a flow that jumps does not agree with it.
        if constexpr (requires { step_->rate_of_polynomial(s, space_->dxdt); }) {
            step_->rate_of_polynomial(s, space_->dxdt);
        } else if constexpr (DenseStep<Step, State>) {
            const detail::DenseView<State, true> rate(step_->dense(), s);
            detail::for_each_component(space_->x, [&](auto i) { space_->dxdt[i] = rate[i]; });
        } else {
            step_->flow(s, space_->x, space_->dxdt);
        }
        placed_ = path_ == detail::Path::dense ? s : std::numeric_limits<double>::quiet_NaN();
        return {guard_->value(t, space_->x), guard_->rate(t, space_->x, space_->dxdt, step_->h())};
    }

    [[nodiscard]] Point point_at(double s) override
    {
        if constexpr (may_see) {
            if (path_ == detail::Path::dense && sees()) return dense_point_at(s);
        }
        if (path_ == detail::Path::dense) {
            place(s);
            step_->flow(s, space_->x, space_->dxdt);
        } else {
            step_->restep(s, space_->x, space_->dxdt);
            placed_ = s;
        }
        return point_of_space(s);
    }

    /// The guard and its rate at the state and the flow in the work space.
    [[nodiscard]] Point point_of_space(double s)
    {
        const double t = step_->time(s);
        if constexpr (requires { guard_->point(t, space_->x, space_->dxdt, 1.0); }) {
            const auto at = guard_->point(t, space_->x, space_->dxdt, step_->h());
            return {at.value, at.rate};
        } else {
            return {guard_->value(t, space_->x),
                    guard_->rate(t, space_->x, space_->dxdt, step_->h())};
        }
    }

    [[nodiscard]] double value_along_the_flow(double from, double s) override
    {
        if (path_ == detail::Path::dense) return value_at(s);
        if constexpr (may_see && requires { step_->line(space_->x, space_->dxdt, s); }) {
            // Of a large state only the components that the guard reads are moved.
            if (sees() && space_->x.size() > 64) {
                return guard_->value(step_->time(s),
                                     step_->line(space_->x, space_->dxdt, s - from));
            }
        }
        detail::move(space_->root, space_->x, s - from, space_->dxdt);
        return guard_->value(step_->time(s), space_->root);
    }

    template <bool derivative>
    [[nodiscard]] static auto component_view(const Step& step, double s)
    {
        if constexpr (requires { step.template component_view<derivative>(s); }) {
            return step.template component_view<derivative>(s);
        } else if constexpr (DenseStep<Step, State>) {
            return detail::DenseView<State, derivative>(step.dense(), s);
        } else {
            return detail::DenseView<State, derivative>({}, s);  // never evaluated
        }
    }
    using View = decltype(component_view<false>(std::declval<const Step&>(), 0.0));
    using RateView = decltype(component_view<true>(std::declval<const Step&>(), 0.0));
    static constexpr bool may_see = DenseStep<Step, State> && Guard::template sees<View>;

    /// Whether the guard can be evaluated on the polynomial one component at a time.
    [[nodiscard]] bool sees() const noexcept
    {
        if constexpr (requires { guard_->sees_views(); }) {
            return guard_->sees_views();
        } else {
            return may_see;
        }
    }
    [[nodiscard]] bool sees_rate() const noexcept
    {
        if constexpr (requires { guard_->sees_rate_views(); }) {
            return guard_->sees_rate_views();
        } else {
            return Guard::template sees_rate<View, RateView>;
        }
    }

    [[nodiscard]] Point point_of_view(double s, double t)
    {
        const double value = guard_->value(t, view(s));
        if constexpr (Guard::template sees_rate<View, RateView>) {
            if (sees_rate()) {
                return {value,
                        guard_->rate(t, view(s), component_view<true>(*step_, s), step_->h())};
            }
        }
        const double delta = 1e-5 * step_->h();
        if (s - delta >= earliest_of(*step_) && s + delta <= latest()) {
            return {value, (dense_value_at(s + delta) - dense_value_at(s - delta)) / (2 * delta)};
        }
        const double inward = s + delta > latest() ? -delta : delta;
        const double near = dense_value_at(s + inward) - value;
        return {value, (4 * near - (dense_value_at(s + 2 * inward) - value)) / (2 * inward)};
    }

    [[nodiscard]] static double latest_of(const Step& step) noexcept
    {
        if constexpr (requires { step.latest(); }) return step.latest();
        return std::numeric_limits<double>::infinity();
    }
    [[nodiscard]] static double earliest_of(const Step& step) noexcept
    {
        if constexpr (requires { step.earliest(); }) return step.earliest();
        return -std::numeric_limits<double>::infinity();
    }

    [[nodiscard]] static bool is_rated(const Guard& guard) noexcept
    {
        if constexpr (requires {
                          {
                              guard.is_rated()
                              } -> std::same_as<bool>;
                      }) {
            return guard.is_rated();
        } else if constexpr (requires { Guard::is_rated; }) {
            return Guard::is_rated;
        } else {
            return true;
        }
    }

    /// Whether the step is a polynomial; a host's step need not be one.
    [[nodiscard]] static bool has_polynomial(const Step& step) noexcept
    {
        if constexpr (requires { step.is_hosts(); }) return !step.is_hosts();
        return DenseStep<Step, State>;
    }

    [[nodiscard]] static bool interpolates(const Step& step) noexcept
    {
        if constexpr (requires { step.interpolates(); }) return step.interpolates();
        return false;
    }

    [[nodiscard]] View view(double s) const { return component_view<false>(*step_, s); }

    /// A time t (1 +- nudge) inside the run.
    [[nodiscard]] double beside(double t, double nudge) const noexcept
    {
        const double later = t * (1 + nudge);
        if constexpr (requires { step_->inside(t); }) {
            if (step_->inside(later) != later) return step_->inside(t * (1 - nudge));
        }
        return later;
    }

    /// Total change of the guard at offset s under relative changes of the time and
    /// of each component of the state in turn.
    [[nodiscard]] double nudged(double s, double nudge)
    {
        const double t = step_->time(s);
        if (!(placed_ == s)) place(s);
        State& x = space_->x;
        const double g = guard_->value(t, x);
        double changes = std::fabs(guard_->value(beside(t, nudge), x) - g);
        detail::for_each_component(x, [&](auto i) {
            const double kept = x[i];
            if (kept == 0) return;
            x[i] = kept * (1 + nudge);
            changes += std::fabs(guard_->value(t, x) - g);
            x[i] = kept;
        });
        return changes;
    }

    /// Computes the state at offset s into the work space.
    void place(double s)
    {
        if (path_ == detail::Path::dense) {
            step_->interpolate(s, space_->x);
        } else {
            step_->restep(s, space_->x);
        }
        placed_ = s;
    }

    const Guard* guard_;
    const Step* step_;
    ProbeSpace<State>* space_;
    double placed_ = std::numeric_limits<double>::quiet_NaN();
};

/// Runs a detector on a whole step of a host's own integrator, with the guard armed on
/// `watch.side` and sampled at the start. Fills in its sample at the end.
template <class Detector, class Guard, class Step>
[[nodiscard]] detail::Finding examine_step(const Detector& detector, const Guard& guard,
                                           const Step& step, detail::Watch& watch)
{
    const double h = step.h();
    watch.end = {.s = h, .value = guard.value(step.time(h), step.x1())};
    if (Detector::uses_rates) {
        watch.end.rate = guard.rate(step.time(h), step.x1(), step.rate1(), h);
    }
    ProbeSpace<typename Guard::State> space(step.x0());
    StepProbe<Guard, Step> probe(guard, step, space);
    return detector.examine(probe, watch);
}

}  // namespace ricochet
