// Gradients of a loss through a run and its events, by a sweep back through the run.
//
// The cost of a gradient does not depend on the number of parameters: a few runs, however many
// there are. Forward mode (sensitivities.hpp) takes a column for each, and has the derivatives of
// every number of the run.
//
// A run leaves behind the state at the start of every step: 8 (n + 6) bytes a step. The sweep
// computes the stages of each step again, and takes them back; between two steps it takes back the
// reset, and the time of the event, with one product of the guard and one of the reset
// (detail/history.hpp). The steps are those of the run, their lengths held fixed, so that the
// gradient is that of the numbers which the run has computed, to rounding.
//
// (R. Serban and A. C. Hindmarsh, CVODES, ASME IDETC 2005, for the adjoint between events; W. W.
// Hager, Runge-Kutta methods in optimal control and the transformed adjoint system, Numerische
// Mathematik 87, 2000, for that of the method; R. T. Q. Chen, B. Amos and M. Nickel, Learning
// neural event functions for ordinary differential equations, ICLR 2021, for losses of this kind.)
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/integrate.hpp"
#include "ricochet/sensitivity/detail/history.hpp"
#include "ricochet/sensitivity/detail/recorder.hpp"
#include "ricochet/sensitivity/detail/system_pullback.hpp"
#include "ricochet/sensitivity/directions.hpp"
#include "ricochet/sensitivity/pullback.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/sensitivity/undefined.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet {

/// Derivatives of a loss by the numbers of one event, all of which move with it.
template <class X>
struct EventSlope {
    std::size_t event = 0;      ///< index into `Run::events`
    double t = 0;               ///< by its time [per second]
    std::optional<X> before{};  ///< by the state before its reset; none: zero
    std::optional<X> after{};   ///< by the state after it
};

/// Derivatives of a loss by the numbers of a run.
template <class X>
struct LossSlopes {
    /// By the states at the sample times, as in `Run::trajectory`; empty: none. The times are
    /// fixed.
    std::vector<X> samples{};
    /// By `Run::x` at the fixed time `Run::t`.
    std::optional<X> end{};
    std::vector<EventSlope<X>> events{};
};

/// A loss as a sum of terms. Each term returns its value and writes its derivatives, into states
/// that are zero; an empty one is zero.
template <class X>
struct Loss {
    /// Of sample k at time t [s].
    std::function<double(std::size_t k, double t, const X& x, X& slope)> sample{};
    /// Of the end of the run, at time t [s].
    std::function<double(double t, const X& x, X& slope)> end{};
    /// Of event k.
    std::function<double(std::size_t k, const Event<X>& event, EventSlope<X>& slope)> event{};
};

/// A loss and its derivatives. They are NaN where they do not exist.
struct Gradient {
    double value = 0;                ///< of the loss
    std::vector<double> start;       ///< by the components of the initial state
    std::vector<double> parameters;  ///< by the parameters
    double t_start = 0;              ///< by the time of the start [per second]
};

/// A run that can be taken back. It is not changed by gradients, of which it has any number, so
/// that threads may use it together.
template <class X>
class Adjoint {
public:
    /// The run. Its samples are those of the formulas that are differentiated: of the dense output
    /// of the method (Dopri5), else of a step to their time. `solution` is empty.
    [[nodiscard]] const Run<X>& run() const noexcept { return run_; }
    [[nodiscard]] std::size_t parameters() const { return parts_->pullback().parameters(); }
    /// The first event through which there is no derivative, as in `Sensitivities`: a gradient is
    /// NaN if the loss has a nonzero derivative there or later.
    [[nodiscard]] const std::optional<UndefinedAt>& undefined_at() const noexcept
    {
        return recording_.undefined_at;
    }
    /// Bytes that the states of the run occupy.
    [[nodiscard]] std::size_t bytes() const noexcept { return recording_.history.bytes(); }

    /// The derivatives of a loss whose derivatives by the numbers of the run are these.
    /// @throws std::invalid_argument for slopes of samples, events or components that the run does
    /// not have
    [[nodiscard]] Gradient gradient(const LossSlopes<X>& slopes) const
    {
        detail::LossWeights weights = weights_of(slopes);
        if (reaches_undefined(weights)) return undefined();
        const std::vector<double> end = flat(run_.x);
        detail::FlatGradient flat = detail::sweep_back(recording_.history, parts_->pullback(),
                                                       std::move(weights), end, run_.t);
        return {0, std::move(flat.start), std::move(flat.parameters), flat.t_start};
    }

    /// The value and the derivatives of a loss.
    [[nodiscard]] Gradient gradient(const Loss<X>& loss) const
    {
        LossSlopes<X> slopes;
        double value = 0;
        if (loss.sample) {
            for (std::size_t k = 0; k < run_.trajectory.t.size(); ++k) {
                const X& x = run_.trajectory.x[k];
                slopes.samples.push_back(detail::zeros_shaped_like(x));
                value += loss.sample(k, run_.trajectory.t[k], x, slopes.samples.back());
            }
        }
        if (loss.end) {
            slopes.end = detail::zeros_shaped_like(run_.x);
            value += loss.end(run_.t, run_.x, *slopes.end);
        }
        if (loss.event) {
            for (std::size_t k = 0; k < run_.events.size(); ++k) {
                const Event<X>& event = run_.events[k];
                EventSlope<X> slope{k, 0, detail::zeros_shaped_like(event.before),
                                    detail::zeros_shaped_like(event.after)};
                value += loss.event(k, event, slope);
                slope.event = k;
                slopes.events.push_back(std::move(slope));
            }
        }
        Gradient gradient = this->gradient(slopes);
        gradient.value = value;
        return gradient;
    }

    /// @param parts  the system and the products of its functions
    Adjoint(std::shared_ptr<const detail::AdjointParts> parts, Run<X> run,
            detail::RunRecording recording)
        : parts_(std::move(parts)), run_(std::move(run)), recording_(std::move(recording))
    {
    }

private:
    static constexpr double nan = std::numeric_limits<double>::quiet_NaN();

    [[nodiscard]] static std::vector<double> flat(const X& x)
    {
        std::vector<double> out(static_cast<std::size_t>(x.size()));
        detail::put_numbers(x, out);
        return out;
    }
    [[nodiscard]] static std::vector<double> flat(const std::optional<X>& x, const X& like)
    {
        if (!x) return std::vector<double>(static_cast<std::size_t>(like.size()), 0.0);
        if (x->size() != like.size()) {
            detail::throw_slope_of_wrong_size(static_cast<std::size_t>(like.size()),
                                              static_cast<std::size_t>(x->size()));
        }
        return flat(*x);
    }

    [[nodiscard]] detail::LossWeights weights_of(const LossSlopes<X>& slopes) const
    {
        detail::LossWeights weights;
        weights.end_mode = run_.mode;
        if (!slopes.samples.empty() && slopes.samples.size() != run_.trajectory.x.size()) {
            detail::throw_wrong_slopes("samples", run_.trajectory.x.size(), slopes.samples.size());
        }
        weights.end = flat(slopes.end, run_.x);
        for (std::size_t k = 0; k < slopes.samples.size(); ++k) {
            const detail::Place& place = recording_.samples[k];
            std::vector<double> x = flat(std::optional<X>(slopes.samples[k]), run_.trajectory.x[k]);
            if (place.piece < recording_.history.size()) {
                weights.places.push_back({.place = place, .x = std::move(x)});
                continue;
            }
            for (std::size_t i = 0; i < x.size(); ++i) weights.end[i] += x[i];
        }
        for (const EventSlope<X>& slope : slopes.events) add_event(slope, weights);
        std::ranges::stable_sort(weights.places, {},
                                 [](const auto& weight) { return weight.place.piece; });
        return weights;
    }

    void add_event(const EventSlope<X>& slope, detail::LossWeights& weights) const
    {
        if (slope.event >= run_.events.size()) {
            detail::throw_wrong_slopes("events", run_.events.size(), slope.event + 1);
        }
        const Event<X>& event = run_.events[slope.event];
        const detail::EventPlace& place = recording_.events[slope.event];
        std::vector<double> before = flat(slope.before, event.before);
        std::vector<double> after = flat(slope.after, event.after);
        if (!place.inside) {
            weights.events.push_back(
                {place.first, place.end, slope.t, std::move(before), std::move(after)});
            return;
        }
        for (std::size_t i = 0; i < before.size(); ++i) before[i] += after[i];
        weights.places.push_back(
            {.place = place.at, .x = std::move(before), .guard = event.guard, .t = slope.t});
    }

    /// Whether the loss depends on something behind the event without derivatives.
    [[nodiscard]] bool reaches_undefined(const detail::LossWeights& weights) const
    {
        if (!recording_.undefined_at) return false;
        const std::size_t from = recording_.undefined_piece;
        const auto counts = [](const std::vector<double>& w) {
            return std::ranges::any_of(w, [](double each) { return each != 0; });
        };
        if (counts(weights.end)) return true;
        for (const auto& place : weights.places) {
            if (place.place.piece >= from && (counts(place.x) || place.t != 0)) return true;
        }
        for (const auto& event : weights.events) {
            const bool own = event.first >= from && (event.t != 0 || counts(event.before));
            if (own || (event.end > from && counts(event.after))) return true;
            if (event.end == from && event.first == from && counts(event.after)) return true;
        }
        return false;
    }
    [[nodiscard]] Gradient undefined() const
    {
        return {0, std::vector<double>(recording_.components, nan),
                std::vector<double>(parameters(), nan), nan};
    }

    std::shared_ptr<const detail::AdjointParts> parts_;
    Run<X> run_;
    detail::RunRecording recording_;
};

/// Integrates `system` as `integrate` does, so that it can be taken back.
///
/// The derivatives of its functions are, one by one: the members `flow_vjp`, `guard_vjp` and
/// `reset_vjp`, which add products with given weights (detail/system_pullback.hpp), and then also
/// know the parameters, `parameter_count` of them; else those of recorded numbers, where the
/// function is a template over its scalar (guard.hpp); else differences. Networks:
/// `NetworkGradient`.
///
/// @param stepping  of an explicit method of the library; with error control the steps are those
///                  of the run, held fixed
/// @throws std::invalid_argument as `integrate`
template <class System, class X = typename System::State, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] Adjoint<X> adjoint(const System& system, const X& x0, const Options& options,
                                 const Stepping& stepping = {}, const Detector& detector = {},
                                 const Locator& locator = {})
{
    using Own = detail::ItsOwn<System>;
    auto parts = std::make_shared<detail::PartsOfAdjoint<System, X, Own>>(
        system, std::vector<Parameter<System>>{}, Differences{}, x0);
    return detail::recorded<X>(std::move(parts), x0, options, stepping, detector, locator);
}

/// The same by parameters that are given one by one, of which derivatives are differences. Where
/// there are many of them, use a `Family`.
template <class System, class X = typename System::State, class Stepping = ErrorControlled<Dopri5>,
          class Detector = Extremum, class Locator = Newton>
requires Flowing<System, X> && StateVector<X>
[[nodiscard]] Adjoint<X> adjoint(const System& system, const std::vector<Parameter<System>>& by,
                                 const X& x0, const Options& options, const Stepping& stepping = {},
                                 const Detector& detector = {}, const Locator& locator = {},
                                 const Differences& differences = {})
{
    using Own = detail::ItsOwn<System>;
    auto parts =
        std::make_shared<detail::PartsOfAdjoint<System, X, Own>>(system, by, differences, x0);
    return detail::recorded<X>(std::move(parts), x0, options, stepping, detector, locator);
}

/// The same for a system that is a template over the scalar of its parameters: derivatives by all
/// of them are those of recorded numbers.
template <class Make, class X = typename Family<Make>::System::State,
          class Stepping = ErrorControlled<Dopri5>, class Detector = Extremum,
          class Locator = Newton>
[[nodiscard]] Adjoint<X> adjoint(const Family<Make>& family, const X& x0, const Options& options,
                                 const Stepping& stepping = {}, const Detector& detector = {},
                                 const Locator& locator = {})
{
    using System = typename Family<Make>::System;
    auto parts = std::make_shared<detail::PartsOfAdjoint<System, X, detail::MadeBy<Make>>>(
        family, Differences{}, x0);
    return detail::recorded<X>(std::move(parts), x0, options, stepping, detector, locator);
}

}  // namespace ricochet
