// One guard along one step: how detectors and locators look inside.
//
// There are two ways to a state inside a step. Repeating the step from its start with
// another length is as accurate as the method, and is used where the motion changes
// course. The step's polynomial is nearly as accurate and can be had one component at
// a time, and is used for events that are only recorded.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "ricochet/detect/finding.hpp"
#include "ricochet/hybrid/components.hpp"
#include "ricochet/hybrid/instant.hpp"
#include "ricochet/hybrid/step.hpp"

namespace ricochet {

/// Where the guard left its side, as offsets [s] from the start of the step.
struct Location {
    double lo = 0;                                            ///< still on the armed side
    double hi = 0;                                            ///< across the surface or on it
    double root = 0;                                          ///< the best guess between them
    double root_remainder = 0;                                ///< what rounding left out of it
    double slope = std::numeric_limits<double>::quiet_NaN();  ///< rate of the guard there
    double error = 0;  ///< [s] width of the bracket, or more where rounding in g is coarser
};

/// The narrowest bracket worth having at offset s of a step of length h: neighbouring
/// doubles, or a millionth of their spacing at the end of the step.
[[nodiscard]] inline double finest_bracket(double s, double h) noexcept
{
    return std::numeric_limits<double>::epsilon() * std::max(std::fabs(s), 0x1p-20 * std::fabs(h));
}

/// States that a probe works with, so that probing allocates nothing.
template <class X>
struct ProbeSpace {
    explicit ProbeSpace(const X& like) : x(like), dxdt(like), root(like) {}
    X x, dxdt, root;
};

enum class Path {
    restep,  ///< the method's own map from the start of the step
    dense,   ///< the step's polynomial
};

template <class Guard, class Step>
class StepProbe {
public:
    using State = typename Guard::State;

    /// Keeps references to all three.
    StepProbe(const Guard& guard, const Step& step, ProbeSpace<State>& space,
              Path path = Path::restep) noexcept
        : guard_(&guard), step_(&step), space_(&space), path_(path)
    {
    }

    [[nodiscard]] const Guard& guard() const noexcept { return *guard_; }
    [[nodiscard]] const Step& step() const noexcept { return *step_; }
    [[nodiscard]] Side side() const noexcept { return side_; }

    /// The guard's leaving of `side` is what is looked for from here on.
    void watch(Side side) noexcept
    {
        side_ = side;
        settled_ = false;
    }

    [[nodiscard]] bool has_left(const GuardSample& sample) const noexcept
    {
        return ricochet::has_left(side_, sample.value);
    }

    /// The guard at offset s.
    [[nodiscard]] GuardSample value(double s)
    {
        if constexpr (by_component) {
            if (path_ == Path::dense) {
                return {.s = s, .value = guard_->value(step_->time(s), view(s))};
            }
        }
        place(s);
        return {.s = s, .value = guard_->value(step_->time(s), space_->x)};
    }

    /// The guard at offset s on the step's polynomial, whatever the path.
    [[nodiscard]] GuardSample dense_value(double s)
    {
        const double t = step_->time(s);
        if constexpr (by_component) {
            return {.s = s, .value = guard_->value(t, view(s))};
        } else {
            step_->interpolate(s, space_->x);
            placed_ = path_ == Path::dense ? s : std::numeric_limits<double>::quiet_NaN();
            return {.s = s, .value = guard_->value(t, space_->x)};
        }
    }

    /// The guard and its rate at offset s.
    [[nodiscard]] GuardSample value_and_rate(double s)
    {
        if constexpr (by_component) {
            if (path_ == Path::dense) return dense_value_and_rate(s);
        }
        if (path_ == Path::dense) {
            place(s);
            step_->flow(s, space_->x, space_->dxdt);
        } else {
            step_->restep(s, space_->x, space_->dxdt);
            placed_ = s;
        }
        const double t = step_->time(s);
        return {.s = s,
                .value = guard_->value(t, space_->x),
                .rate = guard_->rate(t, space_->x, space_->dxdt, step_->h())};
    }

    /// The guard at offset s, on the straight line through `sample`, the last that
    /// `value_and_rate` took, or on the polynomial.
    [[nodiscard]] GuardSample along_the_flow(const GuardSample& sample, double s)
    {
        if (path_ == Path::dense) {
            GuardSample at = value(s);
            at.rate = sample.rate;
            return at;
        }
        detail::move(space_->root, space_->x, s - sample.s, space_->dxdt);
        return {.s = s, .value = guard_->value(step_->time(s), space_->root), .rate = sample.rate};
    }

    /// The root lies `correction` after `sample`, the last that `value_and_rate` took,
    /// and the motion is straight until there.
    void settle(double correction)
    {
        if (path_ == Path::dense) return;
        detail::move(space_->root, space_->x, correction, space_->dxdt);
        settled_ = true;
    }

    /// The state at the root that a locator found last.
    [[nodiscard]] const State& state_at(const Location& where)
    {
        if (settled_) return space_->root;
        if (!(placed_ == where.root)) place(where.root);
        return space_->x;
    }

    /// The rate of the guard at a sample where it is not known yet.
    void complete(GuardSample& sample)
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

    /// Detection looked at the polynomial. Where the step's own map disagrees with it
    /// about the far end of the bracket, as it can near tangency, the polynomial is
    /// used from here on.
    void agree_on(const GuardSample& hi)
    {
        if (path_ == Path::dense || hi.s == step_->h()) return;
        if (!has_left(value(hi.s))) path_ = Path::dense;
    }

    /// Narrowest useful bracket near offset s.
    [[nodiscard]] double finest(double s) const noexcept { return finest_bracket(s, step_->h()); }

private:
    using View = DenseView<State, false>;
    using RateView = DenseView<State, true>;
    static constexpr bool by_component = DenseStep<Step, State> && Guard::template sees<View>;

    [[nodiscard]] View view(double s) const { return View(step_->dense(), s); }

    [[nodiscard]] GuardSample dense_value_and_rate(double s)
    {
        const double t = step_->time(s);
        GuardSample sample{.s = s, .value = guard_->value(t, view(s))};
        if constexpr (Guard::template sees_rate<View, RateView>) {
            sample.rate = guard_->rate(t, view(s), RateView(step_->dense(), s), step_->h());
        } else {
            const double delta = 1e-5 * step_->h();
            sample.rate = (value(s + delta).value - value(s - delta).value) / (2 * delta);
        }
        return sample;
    }

    /// Brings the state at offset s into the workspace.
    void place(double s)
    {
        if (path_ == Path::dense) {
            step_->interpolate(s, space_->x);
        } else {
            step_->restep(s, space_->x);
        }
        placed_ = s;
    }

    const Guard* guard_;
    const Step* step_;
    ProbeSpace<State>* space_;
    Path path_;
    Side side_ = Side::plateau;
    double placed_ = std::numeric_limits<double>::quiet_NaN();
    bool settled_ = false;
};

/// A detector's look at a whole step of a host's own integrator: the guard armed on
/// `watch.side` and sampled at the start; its sample at the end is filled in.
template <class Detector, class Guard, class Step>
[[nodiscard]] Finding look_at(const Detector& detector, const Guard& guard, const Step& step,
                              Watch& watch)
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
