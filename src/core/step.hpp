// The step in progress.
//
// Steps that advance keep their stages in the state of the step, where the dense output reads
// them; steps that are repeated to inner times keep theirs elsewhere, so that an evaluation inside
// the step never changes the step.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "core/held_flow.hpp"
#include "core/phase_table.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/components.hpp"
#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/detail/step_state.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/instant.hpp"
#include "ricochet/options.hpp"

namespace ricochet::detail {

/// Refuses to place an event at a state that is not finite. @throws std::domain_error
[[noreturn]] void throw_host_not_finite(std::size_t component, double found, double s,
                                        bool by_restep);

/// The step in progress; models `DenseStep`.
template <class X>
class Step {
    using Dopri5 = RungeKutta<Dopri5Tableau, X>;

public:
    /// Places the step at the start of a run from x and evaluates the flow there. Where time runs
    /// backward, offsets and rates are counted backward as well.
    Step(const SystemAt<X>& system, const StepKernel<X>& kernel, const X& x, const Options& options)
        : free_(system),
          system_(system),
          own_kernel_(&kernel),
          kernel_(&kernel),
          stepping_(system.adapter()),
          state_(x),
          kept_rate_(state_.zero),
          unused_rate_(state_.zero),
          end_slope_(state_.zero),
          inner_w_{state_.zero, state_.zero},
          inner_rate_{state_.zero, state_.zero}
    {
        state_.flow = system->flow;
        state_.start = {options.t_start, 0};
        state_.mode = options.mode;
        state_.backward = options.t_end < options.t_start;
        if (system->phases) change_stepper();
        forget_jumps();
        arrive();
    }

    [[nodiscard]] const StepState<X>& state() const noexcept { return state_; }
    /// State of the step for a quiet run, which starts from here and leaves its current step here.
    [[nodiscard]] StepState<X>& lend() noexcept { return unpin(), state_; }
    [[nodiscard]] double time(double s) const noexcept
    {
        return s == pinned_h_ ? pinned_t_ : state_.time(s);
    }
    [[nodiscard]] const Instant& start() const noexcept { return state_.start; }
    [[nodiscard]] Mode mode() const noexcept { return state_.mode; }
    [[nodiscard]] bool backward() const noexcept { return state_.backward; }

    /// The time at offset s + `remainder`.
    [[nodiscard, gnu::always_inline]] Instant instant(double s, double remainder) const noexcept
    {
        if (s == pinned_h_)
            return Instant{pinned_t_, 0}.after(state_.in_time(std::min(remainder, 0.0)));
        const Instant at = state_.start.after(state_.in_time(s));
        return remainder == 0 ? at : at.after(state_.in_time(remainder));
    }

    /// @param each  absolute tolerances of the components, instead of a common one; may be empty
    /// @param other  absolute tolerance of components that a reset adds
    void measure_with(std::vector<double> each, double other)
    {
        component_atol_ = std::move(each);
        atol_ = other;
        place_tolerances();
    }

    /// Offsets [s] from the start up to which and from which on functions may be called.
    [[nodiscard]] double latest() const noexcept
    {
        return state_.backward ? state_.start.value - system_.earliest()
                               : system_.latest() - state_.start.value;
    }
    [[nodiscard]] double earliest() const noexcept
    {
        return state_.backward ? state_.start.value - system_.latest()
                               : system_.earliest() - state_.start.value;
    }
    /// The time t, or the end of the run that lies before it.
    [[nodiscard]] double inside(double t) const noexcept
    {
        return std::min(std::max(t, system_.earliest()), system_.latest());
    }

    /// Seconds from the start to time t, positive if it lies ahead.
    [[nodiscard]] double until(double t) const noexcept
    {
        const double ahead = state_.start.until(t);
        return state_.backward ? -ahead : ahead;
    }
    /// Declares that the step of length h from here ends at exactly t, although start + h may round
    /// to a neighbour: a guard that is zero at t is then zero at the end of the step. With h = NaN
    /// no step ends at a given time.
    void pin(double h, double t) noexcept
    {
        pinned_h_ = h;
        pinned_t_ = t;
    }
    /// Whether the current step ends at a time that was given.
    [[nodiscard]] bool is_pinned() const noexcept { return state_.h == pinned_h_; }
    [[nodiscard]] double h() const noexcept { return state_.h; }
    [[nodiscard]] const X& x0() const noexcept { return state_.x0; }
    [[nodiscard]] const X& x1() const noexcept { return state_.x1; }
    [[nodiscard]] const X& rate0() const noexcept { return state_.rate0; }
    [[nodiscard]] const X& rate1() const noexcept { return state_.rate1; }
    [[nodiscard]] int order() const noexcept { return kernel_->order; }
    /// Order of the error estimate; 0: there is none.
    [[nodiscard]] int error_order() const noexcept { return kernel_->error_order; }

    /// x(t0 + s) on the dense output: the method's own where it has one, else the
    /// polynomial of `dense`.
    void interpolate(double s, X& x) const
    {
        if (kernel_->interpolates()) {
            departure(s, x);
            add_tangent(s, x);
        } else if (state_.host) {
            interpolate_on_host(s, x);
        } else {
            const DenseView<X, false> view(dense(), s);
            for_components([&](auto i) { x[i] = view[i]; });
        }
    }

    /// Computes what `interpolate` needs of the flow.
    void prepare_polynomial() const
    {
        if (!kernel_->interpolates() && !state_.host) static_cast<void>(dense());
    }

    /// Interpolates without further evaluations of the flow: on the cubic through both
    /// ends if the method has no dense output of its own.
    void peek(double s, X& x) const
    {
        if (kernel_->interpolates()) {
            departure(s, x);
            add_tangent(s, x);
        } else if (state_.host) {
            interpolate_on_host(s, x);
        } else {
            const double h = state_.h;
            const double u = s / h;
            const double value = u * u * (3 - 2 * u);
            const double slope = h * u * u * (u - 1);
            const StepState<X>& of = state_;
            for_components([&](auto i) {
                const double w = value * of.w[i] + slope * (of.rate1[i] - of.rate0[i]);
                x[i] = of.x0[i] + (s * of.rate0[i] + (w + of.remainder[i]));
            });
        }
    }

    /// As `peek` at the fraction `Part::u` of the step, for which the weights of the dense output
    /// are constants.
    template <class Part>
    [[gnu::always_inline]] void peek(X& x) const
    {
        const StepState<X>& of = state_;
        const double s = Part::u * of.h;
        if (kernel_->is_dopri5) {
            const auto weights = Dopri5::template weights<Part>(of.h);
            for_components([&](auto i) __attribute__((always_inline)) {
                const double w = Dopri5::dense(weights, of.stages.data(), of.w_rate1, i);
                x[i] = of.x0[i] + (s * of.rate0[i] + (w + of.remainder[i]));
            });
        } else {
            peek(s, x);
        }
    }

    /// The polynomial at offset s, or its derivative, one component at a time. For a large state
    /// the inner node is computed only for the components that are asked for, until they are as
    /// many as the components of the state.
    template <bool derivative>
    [[nodiscard]] PolynomialView<X, derivative> component_view(double s) const
    {
        if constexpr (!is_small<X>) {
            if (kernel_->is_dopri5) {
                if (!state_.has_middle && state_.asked_alone >= state_.x0.size()) prepare_dense();
                return {state_, s};
            }
        }
        return {dense(), s};
    }

    /// The state `x` moved by s along `rate`, one component at a time.
    [[nodiscard]] PolynomialView<X, false> line(const X& x, const X& rate, double s) const noexcept
        requires(!is_small<X>)
    {
        return {DenseParts<X>{.nodes = DenseNodes::series,
                              .h = 1,
                              .x0 = &x,
                              .remainder = &state_.zero,
                              .rate0 = &rate},
                s};
    }

    /// The step as a polynomial of the order that the method attains over many steps.
    /// Its inner nodes are computed on first use.
    [[nodiscard]] DenseParts<X> dense() const
    {
        if (kernel_->series) return dense_series();
        if (!state_.has_middle) prepare_dense();
        DenseParts<X> parts{.nodes = dense_nodes(),
                            .h = state_.h,
                            .x0 = &state_.x0,
                            .remainder = &state_.remainder,
                            .rate0 = &state_.rate0};
        const std::size_t inner = inner_nodes(parts.nodes);
        for (std::size_t k = 0; k < inner; ++k) {
            parts.w[k] = k == 0 ? &state_.middle : &inner_w_[k];
            if (!kernel_->interpolates()) parts.slope[k] = &inner_rate_[k];
        }
        parts.w[inner] = &state_.w;
        parts.slope[inner] = &end_slope_;
        return parts;
    }

    /// x(t0 + s) by the method's own step of length s from the start.
    void restep(double s, X& x) const
    {
        count_restep();
        if (state_.host) return restep_on_host(s, x);
        kernel_->depart(stepping_, state_, s, x, unused_rate_);
        keep_departure(s, x);
        add_tangent(s, x);
    }

    /// What rounding has taken from component i of the state at the end of the step, or of the one
    /// that the last `restep` has placed at offset s; zero if it was at another.
    [[nodiscard]] double lost_at(double s, std::size_t i) const noexcept
    {
        if (s == state_.h && !state_.host) {
            if constexpr (is_small<X>) {
                return two_sum(state_.x0[i],
                               s * state_.rate0[i] + (state_.w[i] + state_.remainder[i]))
                    .remainder;
            } else {
                return state_.large.remainder1[i];
            }
        }
        if (s != departed_ || departed_from_ != state_.start.value || state_.host) return 0;
        return two_sum(state_.x0[i], s * state_.rate0[i] + (departure_[i] + state_.remainder[i]))
            .remainder;
    }
    [[nodiscard]] const X& remainder() const noexcept { return state_.remainder; }
    /// Sets what rounding has taken from component i of the state at the start.
    void set_remainder(std::size_t i, double remainder) noexcept
    {
        state_.remainder[i] = remainder;
    }

    /// The most samples of the step that are computed by steps of their own. More are taken from
    /// its polynomial, whose inner nodes cost a step each. A cubic has none, but also a larger
    /// error than a step: few samples are worth the calls. Where the polynomial is not of the
    /// method's order, or may be rough, every sample is a step. @param recorded  the inner nodes
    /// are computed in any case
    [[nodiscard]] std::size_t most_sampled_alone(bool recorded) const noexcept
    {
        if (kernel_->order > 8 || may_be_rough()) return std::numeric_limits<std::size_t>::max();
        const DenseNodes nodes = dense_nodes();
        if (nodes == DenseNodes::end) return 2;
        return recorded ? 0 : inner_nodes(nodes);
    }

    struct Sampling {
        double rtol, atol;
        bool on_polynomial;  ///< samples are taken from the polynomial of the step
    };
    /// x(t0 + s) on a dense output of the method's own order, or by a step of its own.
    void sample(double s, const Sampling& by, X& x) const
    {
        if (kernel_->sample && kernel_->sample(stepping_, state_, s, by.rtol, by.atol, x)) {
            add_tangent(s, x);
        } else if (kernel_->interpolates() || by.on_polynomial) {
            interpolate(s, x);
        } else {
            restep(s, x);
        }
    }

    /// x(t0 + s) by the method's own step, and the flow there.
    void restep(double s, X& x, X& dxdt) const
    {
        count_restep();
        if (state_.host) {
            restep_on_host(s, x);
            return rate_on_host(s, dxdt);
        }
        kernel_->depart(stepping_, state_, s, x, dxdt);
        keep_departure(s, x);
        add_tangent(s, x);
        if (kernel_->end_rate) {
            detail::move(dxdt, dxdt, 1, state_.rate0);
        } else {
            flow(s, x, dxdt);
        }
    }

    /// x' = f(t0 + s, x); in a step of a host, for x on its path, the rate of the path.
    void flow(double s, const X& x, X& dxdt) const
    {
        if (state_.host) return rate_on_host(s, dxdt);
        flow_in(state_.mode, state_.flow_at(time(s)), x, dxdt);
    }

    /// x' = f(t, x) in another mode, where the flow is the system's and not a host's.
    void flow_in(Mode mode, double t, const X& x, X& dxdt) const
    {
        ++state_.flow_calls;
        state_.flow_fits &= system_->flow(system_.adapter(), mode, t, x, dxdt);
        if (state_.backward) for_components([&](auto i) { dxdt[i] = -dxdt[i]; });
    }

    /// Whether the flow at the end of the step is what it was when the step was taken: to the
    /// rounding of its departure from the flow at the start, and where it is the slope of a series
    /// to a millionth. @param rate  work space
    [[nodiscard]] bool flow_ends_alike(X& rate) const
    {
        assign(rate, state_.x1);
        flow(state_.h, state_.x1, rate);
        const double part = kernel_->series ? 1e-6 : tolerances::of_sum;
        bool alike = true;
        for_components([&](auto i) {
            const double size = std::fabs(state_.rate0[i]) + std::fabs(state_.rate1[i]);
            alike = alike && std::fabs(rate[i] - state_.rate1[i]) <= part * size;
        });
        return alike;
    }

    // --- components that stand still ---

    /// Lets `components` stand still from the start of the step on, where their rates become zero.
    /// The steps are then those of the library's kernel that calls flows by pointer. None: the flow
    /// is the system's again, and is not evaluated.
    void hold_components(std::span<const std::size_t> components)
    {
        const bool any = !components.empty();
        held_.system = free_.operator->();
        held_.adapter = free_.adapter();
        held_.components.assign(components.begin(), components.end());
        system_ = any ? SystemAt<X>(HeldFlow<X>::table, &held_, free_.span()) : free_;
        const StepKernel<X>* const before = kernel_;
        if (!any && system_->phases) {
            change_stepper();
        } else {
            state_.flow = system_->flow;
            stepping_ = system_.adapter();
            kernel_ = any ? &kernel_by_pointer(*own_kernel_, state_.x0.size()) : own_kernel_;
        }
        if (kernel_ != before && kernel_->renew) kernel_->renew(free_.adapter());
        held_.stop(state_.rate0);
    }
    [[nodiscard]] std::span<const std::size_t> held() const noexcept
    {
        return {held_.components.data(), held_.components.size()};
    }
    /// Whether a host takes the steps.
    [[nodiscard]] bool is_of_host() const noexcept { return !own_kernel_->take; }

    /// x' = f(t, x) of the system, in which nothing is held.
    void free_flow(double t, const X& x, X& dxdt) const
    {
        ++state_.flow_calls;
        state_.flow_fits &=
            free_->flow(free_.adapter(), state_.mode, state_.flow_at(inside(t)), x, dxdt);
        if (state_.backward) for_components([&](auto i) { dxdt[i] = -dxdt[i]; });
    }

    // --- time events, at which the flow may jump ---

    /// Whether the flow jumps at the end of the step that was taken, at the time event at t. From
    /// here on no stage sees the flow there, but that of the double before. False for hosts.
    bool sees_jump_at_end(double t)
    {
        const double before = beside(t, true);
        if (!kernel_->take || kernel_->reach || flow_end() == before) return false;
        if (!all_finite(state_.x1) || !(until(before) > 0)) return false;
        if (kernel_->series) {  // its rate at the end is that of the interpolant
            flow_in(state_.mode, state_.time(state_.h), state_.x1, unused_rate_);
        } else {
            assign(unused_rate_, state_.rate1);
        }
        if (!jumps_beside(before, true, state_.x1)) return false;
        flow_end() = before;
        return true;
    }

    /// The start of the step is a time event, which lies before `end`: where the flow jumps there
    /// the step sees that of the double after it.
    void start_beyond(double end)
    {
        const double after = beside(state_.start.value, false);
        if (!kernel_->take || kernel_->reach || !(until(end) > until(after))) return;
        assign(unused_rate_, state_.rate0);
        if (!jumps_beside(after, false, state_.x0)) return;
        flow_start() = after;
        assign(state_.rate0, state_.at);
    }

    /// The rate of the step's polynomial at offset s.
    void rate_of_polynomial(double s, X& dxdt) const
    {
        if (state_.host) return rate_on_host(s, dxdt);
        const DenseView<X, true> rate(dense(), s);
        for_components([&](auto i) { dxdt[i] = rate[i]; });
    }

    /// Whether the step is a polynomial whose coefficients are known: not that of a host, nor of a
    /// stepper with an interpolant of its own.
    [[nodiscard]] bool has_known_polynomial() const noexcept
    {
        return !state_.host && (kernel_->series || kernel_->is_dopri5 || !kernel_->interpolates());
    }
    /// Whether this is the cubic through both ends.
    [[nodiscard]] bool is_cubic() const noexcept
    {
        return !kernel_->series && dense_nodes() == DenseNodes::end;
    }

    /// Whether the method has an interpolant of its own.
    [[nodiscard]] bool interpolates() const noexcept
    {
        return kernel_->interpolates() && !state_.host;
    }
    /// Whether only the time moves in the step: what `peek` sees is the start.
    [[nodiscard]] bool stands() const noexcept
    {
        if (kernel_->departure || state_.host) return false;
        double moves = 0;
        for_components([&](auto i) {
            moves += std::fabs(state_.x1[i] - state_.x0[i]);
            moves += std::fabs(state_.rate0[i]) + std::fabs(state_.rate1[i]);
            if (!kernel_->is_dopri5) return;
            for (std::size_t k = 0; k < Dopri5::kept_stages; ++k) {
                moves += std::fabs(state_.stages[k][i]);
            }
        });
        return moves == 0;
    }
    [[nodiscard]] bool is_hosts() const noexcept { return state_.host; }
    /// Whether a host's path is the cubic through the states and rates at the ends.
    [[nodiscard]] bool is_hosts_cubic() const noexcept
    {
        return state_.host && state_.host->is_cubic;
    }

    /// Makes a step that a host has taken from the current state the current step.
    void show(const HostStepTable& host) noexcept
    {
        StepState<X>& of = state_;
        of.host = &host;
        aligned_ = false;
        of.start = host.start();
        of.h = host.h;
        for (std::size_t i = 0; i < of.x0.size(); ++i) {
            of.x1[i] = host.x1[i];
            of.rate0[i] = host.rate0[i];
            of.rate1[i] = host.rate1[i];
        }
    }

    [[nodiscard]] bool is_aligned() const noexcept { return aligned_; }

    /// Corrects the interpolant of a host at the start of its step. It need not begin at the start
    /// state to the last bit, and if it is evaluated at absolute times it is constant over offsets
    /// shorter than the time resolves. Either could put a guard that starts on its surface behind
    /// it. So the difference at the start is subtracted, all of it at the start and none at the
    /// end, and over the first unit in the last place of the time the path is a straight line.
    void align_start() const;

    /// Accepts a step that a host has taken.
    void accept_shown() noexcept
    {
        StepState<X>& of = state_;
        of.start = of.start.after(of.in_time(of.h));
        assign(of.x0, of.x1);
        assign(of.rate0, of.rate1);
        of.host = nullptr;
    }

    /// Sets the flow at the start to the rate that a host has computed.
    void set_rate(const double* dxdt) noexcept
    {
        for (std::size_t i = 0; i < state_.x0.size(); ++i) state_.rate0[i] = dxdt[i];
    }

    /// Takes a step of length h, without a check of its error. False if the end of the step or the
    /// flow there is not finite.
    bool attempt(double h) { return kernel_->take(stepping_, state_, h); }

    /// Takes a step of length h and returns the largest ratio of its estimated error to
    /// atol + rtol max(|x0|, |x1|); NaN if anything is not finite.
    [[nodiscard]] double attempt(double h, double rtol, double atol)
    {
        return kernel_->attempt(stepping_, state_, h, rtol, atol);
    }

    /// Whether the polynomial of the step may be less accurate than its end, and by how much: see
    /// `StepKernel::roughness`.
    [[nodiscard]] bool may_be_rough() const noexcept { return kernel_->roughness; }
    [[nodiscard]] double roughness(double rtol, double atol) const
    {
        return kernel_->roughness(stepping_, state_, rtol, atol);
    }

    /// Whether guards have power series over the step.
    [[nodiscard]] bool has_guard_series() const noexcept { return kernel_->guard_series; }
    [[nodiscard]] SeriesTerms guard_series() const
    {
        return kernel_->guard_series(stepping_, state_);
    }

    /// See `StepKernel::cross`. @param before  receives the state at the root
    [[nodiscard]] bool cross(SeriesCrossing& crossing, X& before) const
    {
        if (!kernel_->cross(stepping_, state_, crossing)) return false;
        assign(before, state_.at);
        return true;
    }

    /// Whether the length of a step is known before it is taken.
    [[nodiscard]] bool knows_reach() const noexcept { return kernel_->reach; }
    /// Length [s] of the step, if it is known in advance.
    [[nodiscard]] double reach(double h, double rtol, double atol)
    {
        return kernel_->reach(stepping_, state_, h, rtol, atol);
    }

    /// Whether the step ends at a change that its stepper has located.
    [[nodiscard]] bool locates_changes() const noexcept { return kernel_->ends_at_change; }
    [[nodiscard]] bool ends_at_change() const
    {
        return kernel_->ends_at_change && kernel_->ends_at_change(stepping_, state_);
    }

    /// Makes the end of the step the start of the next.
    void accept() noexcept
    {
        StepState<X>& of = state_;
        of.start = of.start.after(of.in_time(of.h));
        if constexpr (is_small<X>) {
            for_components([&](auto i) {
                const TwoSum sum =
                    two_sum(of.x0[i], of.h * of.rate0[i] + (of.w[i] + of.remainder[i]));
                of.x0[i] = sum.value;
                of.remainder[i] = sum.remainder;
            });
            assign(of.rate0, of.rate1);
        } else {
            std::swap(of.x0, of.x1);
            std::swap(of.remainder, of.large.remainder1);
            std::swap(of.rate0, of.rate1);
        }
    }

    /// Accepts the step and sets its end to the time `t`.
    void accept_at(double t) noexcept
    {
        accept();
        state_.start = {t, 0};
    }

    /// Moves the start of the step to offset s + `remainder`, state x and a mode, after
    /// an event. The state may have another dimension.
    void restart(double s, double remainder, const X& x, Mode mode)
    {
        state_.start = instant(s, remainder);
        begin(x, mode);
        arrive();
    }

    /// The same, to an instant.
    void restart(const Instant& at, const X& x, Mode mode)
    {
        state_.start = at;
        begin(x, mode);
        arrive();
    }

    /// Moves the start of the step to the start of another one.
    void restart(const StepStart<X>& at)
    {
        state_.start = at.t;
        begin(at.x, at.mode);
        assign(state_.remainder, at.remainder);
        assign(state_.rate0, at.rate);
        if (at.is_beyond) flow_start() = beside(at.t.value, false);
    }

    /// The last time [s] at which the flow is evaluated, before a jump at a time event that an
    /// attempt has met; infinite without one.
    [[nodiscard]] double last_of_flow() const noexcept
    {
        const double last = state_.backward ? state_.flow_from : state_.flow_to;
        const bool of_span = last == (state_.backward ? system_.earliest() : system_.latest());
        return of_span ? std::numeric_limits<double>::infinity() : last;
    }
    /// Goes on with what `last_of_flow` has told.
    void keep_before(double last) noexcept
    {
        if (std::isfinite(last)) flow_end() = last;
    }

    /// Takes note that the span of the run has changed.
    void renew_span() noexcept
    {
        const bool beyond = is_beyond();
        forget_jumps();
        if (beyond) flow_start() = beside(state_.start.value, false);
    }

    /// Advances the time alone, to t.
    void hold(double t) noexcept { state_.start = {t, 0}; }

    /// Evaluates the flow at the start again.
    void refresh() { flow(0, state_.x0, state_.rate0); }

    [[nodiscard]] StepStart<X> place() const
    {
        return {state_.start, state_.mode, state_.x0, state_.remainder, state_.rate0, is_beyond()};
    }
    /// Whether the flow at the start is that of the double after it.
    [[nodiscard]] bool is_beyond() const noexcept
    {
        // A bound that an earlier start has left behind says nothing of this one.
        const double t = state_.start.value;
        return state_.backward ? state_.flow_to < t : state_.flow_from > t;
    }

    /// Keeps the flow at the start of the step that is about to be taken: a method with a series
    /// replaces it by the slope of the series, which differs in the last digits.
    void keep_rate()
    {
        if (kernel_->series) assign(kept_rate_, state_.rate0);
    }
    [[nodiscard]] const X& kept_rate() const noexcept
    {
        return kernel_->series ? kept_rate_ : state_.rate0;
    }
    void put_back_rate()
    {
        if (kernel_->series) assign(state_.rate0, kept_rate_);
    }
    /// As `store`, with the rate that was kept.
    void store_as_kept(StepStart<X>& at) const
    {
        store(at);
        assign(at.rate, kept_rate());
    }

    /// Copies the start of the step, like `place`, into memory that is already allocated.
    void store(StepStart<X>& at) const
    {
        at.t = state_.start;
        at.mode = state_.mode;
        assign(at.x, state_.x0);
        assign(at.remainder, state_.remainder);
        assign(at.rate, state_.rate0);
        at.is_beyond = is_beyond();
    }

    /// Whether every call of the flow has given its rate as many components as the state.
    [[nodiscard]] bool flow_fits() const noexcept { return state_.flow_fits; }
    [[nodiscard]] std::uint64_t flow_calls() const noexcept { return state_.flow_calls; }
    /// Counts a repeat of the step. A host that cannot repeat its step gives a place on its path
    /// instead, which is not counted.
    void count_restep() const noexcept { resteps_ += !state_.host || state_.host->restep; }
    [[nodiscard]] std::uint64_t resteps() const noexcept { return resteps_; }

private:
    [[nodiscard]] DenseNodes dense_nodes() const noexcept
    {
        const int order = kernel_->order;
        return kernel_->interpolates() ? DenseNodes::middle_end
               : order <= 4            ? DenseNodes::end
               : order <= 6            ? DenseNodes::half_end
                                       : DenseNodes::thirds_end;
    }
    [[nodiscard]] static constexpr std::size_t inner_nodes(DenseNodes nodes) noexcept
    {
        return nodes == DenseNodes::end ? 0 : nodes == DenseNodes::thirds_end ? 2 : 1;
    }

    template <class Function>
    [[gnu::always_inline]] void for_components(const Function& function) const
    {
        for_each_component(state_.x0, function);
    }

    /// Large states are not copied: their remainders are dropped at events.
    void keep_departure(double s, const X& w) const
    {
        if (w.size() > tolerances::remembered_components) return;
        departed_ = s;
        departed_from_ = state_.start.value;
        assign(departure_, w);
    }

    /// The double beside t, `earlier` in the run or later.
    [[nodiscard]] double beside(double t, bool earlier) const noexcept
    {
        const double end = std::numeric_limits<double>::infinity();
        return std::nextafter(t, earlier == state_.backward ? end : -end);
    }
    [[nodiscard]] double& flow_start() noexcept
    {
        return state_.backward ? state_.flow_to : state_.flow_from;
    }
    [[nodiscard]] double& flow_end() noexcept
    {
        return state_.backward ? state_.flow_from : state_.flow_to;
    }
    void forget_jumps() noexcept
    {
        state_.flow_from = system_.earliest();
        state_.flow_to = system_.latest();
    }

    /// Whether the flow at x differs between a time event, where it is `unused_rate_`, and the
    /// double t beside it by more than rounding, and by more than it does from there to the next:
    /// a flow that changes fast with time does not jump. Leaves the flow there in `at`.
    [[nodiscard]] bool jumps_beside(double t, bool earlier, const X& x)
    {
        X& there = state_.at;
        assign(there, x);  // which has its dimension
        flow_in(state_.mode, t, x, there);
        const auto rounding = [&](auto i) {
            return tolerances::of_sum *
                   (std::fabs(unused_rate_[i]) + std::fabs(there[i]) + std::fabs(state_.rate0[i]));
        };
        const auto differ = [&](auto i) {
            return !(std::fabs(there[i] - unused_rate_[i]) <= rounding(i));
        };
        bool alike = true;
        for_components([&](auto i) { alike = alike && !differ(i); });
        if (alike) return false;
        X& further = end_slope_;
        assign(further, x);
        flow_in(state_.mode, beside(t, earlier), x, further);
        bool jumps = false;
        for_components([&](auto i) {
            const double slope = std::fabs(further[i] - there[i]);
            jumps = jumps || (differ(i) && !(std::fabs(there[i] - unused_rate_[i]) <= 8 * slope));
        });
        return jumps;
    }

    /// The flow at the start; a host supplies it by `set_rate`.
    void arrive()
    {
        state_.host = nullptr;
        if (kernel_->take) flow(0, state_.x0, state_.rate0);
    }

    void interpolate_on_host(double s, X& x) const;
    void restep_on_host(double s, X& x) const;
    /// Over a ten-thousandth of the step the rounding error and the curvature error of a difference
    /// quotient are of similar size.
    void rate_on_host(double s, X& dxdt) const;

    void unpin() noexcept { pinned_h_ = std::numeric_limits<double>::quiet_NaN(); }

    void begin(const X& x, Mode mode)
    {
        unpin();
        const bool changes_phase = system_->phases && mode != state_.mode;
        state_.mode = mode;
        if (changes_phase) [[unlikely]]
            change_stepper();
        if (x.size() != state_.x0.size()) resize(x);
        assign(state_.x0, x);
        assign(state_.remainder, state_.zero);
        state_.has_middle = false;
        state_.asked_alone = 0;
        forget_jumps();
        departed_ = std::numeric_limits<double>::quiet_NaN();
    }

    /// Steps are taken by the stepper of the mode from here on.
    [[gnu::cold, gnu::noinline]] void change_stepper()
    {
        const Stepper<X> stepper = system_->phases->stepper(system_->phases->adapter, state_.mode);
        const bool changes = kernel_ != stepper.kernel;
        kernel_ = stepper.kernel;
        stepping_ = stepper.adapter;
        state_.flow = stepper.flow;
        if (changes && kernel_->renew) kernel_->renew(stepping_);
    }

    void resize(const X& x)
    {
        StepState<X> state(x);
        state.flow = state_.flow;
        state.start = state_.start;
        state.mode = state_.mode;
        state.backward = state_.backward;
        state.flow_fits = state_.flow_fits;
        state.flow_calls = state_.flow_calls;
        state_ = std::move(state);
        place_tolerances();
        unused_rate_ = end_slope_ = kept_rate_ = departure_ = state_.zero;
        inner_w_.fill(state_.zero);
        inner_rate_.fill(state_.zero);
        if (kernel_->renew) kernel_->renew(stepping_);
    }

    void place_tolerances()
    {
        if (component_atol_.empty()) return;
        component_atol_.resize(state_.x0.size(), atol_);
        state_.component_atol = component_atol_.data();
    }

    [[nodiscard, gnu::noinline]] DenseParts<X> dense_series() const
    {
        return {.nodes = DenseNodes::series,
                .h = state_.h,
                .x0 = &state_.x0,
                .remainder = &state_.remainder,
                .rate0 = &state_.rate0,
                .series = kernel_->series(stepping_, state_)};
    }

    /// w(s) on the method's own interpolant.
    void departure(double s, X& w) const
    {
        if (kernel_->is_dopri5) {
            Dopri5::dense(s, state_.h, state_.stages.data(), state_.w_rate1, w);
        } else {
            kernel_->departure(stepping_, state_, s, w);
        }
    }

    [[gnu::noinline]] void prepare_dense() const
    {
        for_components([&](auto i) { end_slope_[i] = state_.rate1[i] - state_.rate0[i]; });
        const double h = state_.h;
        if (kernel_->interpolates()) {
            departure(h / 2, state_.middle);
        } else {
            const std::size_t inner = inner_nodes(dense_nodes());
            for (std::size_t k = 0; k < inner; ++k) {
                prepare_node(h * static_cast<double>(k + 1) / static_cast<double>(inner + 1),
                             k == 0 ? state_.middle : inner_w_[k], inner_rate_[k]);
            }
        }
        state_.has_middle = true;
    }

    /// An inner node, computed by a step of its own.
    void prepare_node(double s, X& w, X& slope) const
    {
        kernel_->depart(stepping_, state_, s, w, unused_rate_);
        X& at = state_.at;
        assign(at, w);
        add_tangent(s, at);
        flow(s, at, slope);
        for_components([&](auto i) { slope[i] -= state_.rate0[i]; });
    }

    /// From w to x at offset s.
    void add_tangent(double s, X& w) const noexcept
    {
        if constexpr (LongArray<X>) {
            return add_tangent_many(w.data(), state_.x0.data(), s, state_.rate0.data(),
                                    state_.remainder.data(), w.size());
        }
        for_components([&](auto i) {
            w[i] = state_.x0[i] + (s * state_.rate0[i] + (w[i] + state_.remainder[i]));
        });
    }

    SystemAt<X> free_;    ///< the system
    SystemAt<X> system_;  ///< the same, or the flow in which components are held
    const StepKernel<X>* own_kernel_;
    const StepKernel<X>* kernel_;
    HeldFlow<X> held_;
    void* stepping_;  ///< first argument of the kernel's functions
    mutable StepState<X> state_;
    std::vector<double> component_atol_;
    double atol_ = 0;
    mutable double departed_ = std::numeric_limits<double>::quiet_NaN();  ///< [s] of `departure_`
    mutable double departed_from_ = 0;                                    ///< [s] start of its step
    mutable X departure_;  ///< from the tangent, of the last `restep`
    X kept_rate_;
    mutable X unused_rate_, end_slope_;
    mutable std::array<X, 2> inner_w_, inner_rate_;  ///< `middle` replaces the first
    mutable std::uint64_t resteps_ = 0;
    mutable X defect_{};  ///< error of a host's interpolant at the start
    mutable bool aligned_ = false;
    mutable double straight_ = 0;  ///< [s] length of the straight part at the start
    double pinned_h_ = std::numeric_limits<double>::quiet_NaN(), pinned_t_ = 0;  ///< [s] see `pin`
};

}  // namespace ricochet::detail

#include "core/step_on_host.hpp"
