// A block on a spring whose far end is moved, with rate-and-state friction: stick-slip.
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "ricochet/faults/variational_step.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/run.hpp"

namespace ricochet {

/// Position of the driven end of the spring: continuous, with piecewise constant velocity.
class SliderLoad {
public:
    /// A piece of constant velocity.
    struct Piece {
        double t = 0;         ///< [s] start of the piece
        double velocity = 0;  ///< [m/s]
    };

    /// Starts from `start` [m] at the time of the first piece.
    /// @throws std::invalid_argument unless there is a piece, and their times rise.
    SliderLoad(double start, std::vector<Piece> pieces);
    SliderLoad(double start, double velocity) : SliderLoad(start, {{0, velocity}}) {}

    /// x_p(t) [m]; the first piece holds before its time, too.
    [[nodiscard]] double operator()(double t) const noexcept
    {
        std::size_t i = pieces_.size() - 1;
        while (i > 0 && t < pieces_[i].t) --i;
        return position_[i] + pieces_[i].velocity * (t - pieces_[i].t);
    }

    /// The first corner after t; infinite if there is none.
    [[nodiscard]] double next_corner(double t) const noexcept;

private:
    std::vector<Piece> pieces_;
    std::vector<double> position_;
};

/// A block on a spring with rate-and-state friction, whose far end is pulled.
struct SpringSlider {
    RateStateParameters friction{};
    StateEvolution evolution = StateEvolution::ageing;
    SpringBlock block{};
    SliderLoad load{0, 1e-4};
};

/// Kinds of events of the slip rate.
enum class SliderEventKind {
    onset,     ///< the slip rate rises through the threshold
    arrest,    ///< the slip rate falls through the threshold
    reversal,  ///< the slip rate passes through zero
};
/// Name of the enumerator, e.g. "onset".
[[nodiscard]] std::string_view name(SliderEventKind kind) noexcept;

/// An event of the slip rate and the state at it.
struct SliderEvent {
    SliderEventKind kind = SliderEventKind::onset;
    SliderState at{};
};

/// Options of runs of the slider.
struct SliderOptions {
    double t_end = 2;          ///< [s], after the start
    int order = 4;             ///< 1, 2 or 4
    double step = 0;           ///< [s]; 0: by error control
    double rtol = 1e-8;        ///< relative to the slip rate, to |x| + D_RS for x, and to 1 for xi
    double first_step = 1e-5;  ///< [s] under error control
    double threshold = 0;      ///< [m/s] of onset and arrest; 0: not searched for
    std::size_t samples = 0;   ///< number of samples, evenly spaced, both ends included; 0: none
    std::size_t max_steps = 10'000'000;
    /// Set from another thread or a signal handler, it ends the run after the step in progress.
    const std::atomic<bool>* cancelled = nullptr;
};

/// Result of a run of the slider.
struct SliderRun {
    Outcome outcome = Outcome::reached_end;
    SliderState state{};
    std::vector<SliderEvent> events{};
    std::vector<SliderState> samples{};
    std::size_t steps = 0, rejected = 0;
    std::size_t iterations = 0, stages = 0;
    int most_iterations = 0;
    std::size_t unsolved = 0, not_convex = 0;  ///< stages of accepted steps
    double residual = 0;                       ///< largest residual of a stage
};

/// Runs a slider by variational steps, with the asinh form of the direct effect. Steps end at the
/// corners of the load. Events do not change the state; they are located to adjacent doubles, by
/// repeating the step. Two crossings within a step are found if the cubic through slip rates and
/// accelerations shows them.
///
/// @throws std::invalid_argument for parameters or options outside their range, and a start that is
/// not finite.
[[nodiscard]] SliderRun run_slider(const SpringSlider& slider, const SliderState& start,
                                   const SliderOptions& options = {});

/// Friction coefficient at a state of a slider.
[[nodiscard]] double slider_friction(const SpringSlider& slider, const SliderState& state);

/// A slider of the stability study: unit mass, N = 9.81 N, loaded at constant velocity.
struct SliderCase {
    SpringSlider slider;
    double stiffness_ratio = 0;  ///< k / k_crit at the velocity of the load
};

/// 77 sliders, 35 of them softer than critical: k / k_crit log-uniform in [0.2, 0.95] or
/// [1.05, 5], the velocity of the load in [0.5, 2] V*. They start at V*, xi = 0, with the
/// spring drawn to N f*. (The source does not give the ranges that it
/// drew from; these are ours.)
[[nodiscard]] std::vector<SliderCase> slider_cases(std::uint64_t seed);
[[nodiscard]] SliderState slider_case_start() noexcept;

// The spring-slider with rate-and-state friction as a hybrid system, for the event loop.

/// A block on a spring with the ageing law, in the logarithm of its slip rate, V > 0.
///
/// State (x / D_RS, log(V / V*), xi), one guard, corners of the load as time events.
///
///     flow    x' = V,  m V' = k (x_p(t) - x) - N f(V, xi),  xi' = (V* e^-xi - V) / D_RS
///     guard   log(V / threshold), either direction: onset rising, arrest falling; no reset
///
/// Explicit steps are bounded by m V / (N a), which in stick-slip falls below a microsecond; the
/// steps of `run_slider` are limited by accuracy alone. Functions are generic in the state type.
class RateStateSlider {
public:
    using State = std::array<double, 3>;
    static constexpr bool resets = false;

    /// @throws std::invalid_argument if a parameter is outside its range, or the threshold
    /// [m/s] is not positive.
    RateStateSlider(const SpringSlider& slider, double threshold);

    static constexpr std::string_view name = "rate-state-slider";
    /// Start state of the event-driven run that corresponds to `at`.
    [[nodiscard]] State start(const SliderState& at) const;

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "threshold", .crossing = Crossing::either, .degree = 1};
    }

    template <class X>
    void flow(double t, const X& x, X& dxdt) const
    {
        const RateStateParameters& p = slider_.friction;
        const double v = p.v_star * std::exp(x[1]);
        const double friction = p.f_star + p.a * x[1] + p.b * x[2];
        const double pull = slider_.block.stiffness * (slider_.load(t) - p.d_rs * x[0]);
        dxdt[0] = v / p.d_rs;
        dxdt[1] = (pull - slider_.block.normal_force * friction) / (slider_.block.mass * v);
        dxdt[2] = (p.v_star * std::exp(-x[2]) - v) / p.d_rs;
    }

    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const noexcept
    {
        return x[1] - level_;
    }
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& /*x*/, const D& dxdt) const noexcept
    {
        return dxdt[1];
    }

    [[nodiscard]] double next_time_event(double t) const noexcept
    {
        return slider_.load.next_corner(t);
    }

private:
    SpringSlider slider_;
    double level_;  ///< log(threshold / V*)
};

}  // namespace ricochet
