// Internal: what it declares may change without notice.
//
// One step of an explicit one-step method, taken as a departure from the tangent.
//
// With f0 = f(t0, x0), the method integrates
//
//     w' = f(t0 + s, x0 + s f0 + w) - f0,    w(0) = 0,    x(t0 + s) = x0 + s f0 + w(s)
//
// which is the same Runge-Kutta step, since the rows of a tableau sum to its nodes,
// but w is of second order in the step: the tableau's coefficients, which are
// rounded and reach 11.6 in Dormand and Prince's, multiply only what departs from
// the tangent. The state is carried as x0 + remainder, so that the rounding of the
// final addition is not lost but joins the next increment, and errors of rounding
// do not grow with the number of steps.
//
// Two steppers are kept: one advances, and its stages make the dense output; the
// other repeats the step to inner times, so that asking never disturbs what is
// being asked about.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "ricochet/detail/components.hpp"
#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/detail/instant.hpp"
#include "ricochet/hybrid/system.hpp"
#include "ricochet/integrate/methods.hpp"

namespace ricochet::detail {

/// A vector like `x`, of zeros.
template <class X>
[[nodiscard]] X zeros_like(X x)
{
    for_each_component(x, [&](auto i) { x[i] = 0; });
    return x;
}

/// Where a step starts, to the last bit.
template <class X>
struct StepStart {
    Instant t;
    Mode mode = 0;
    X x{};
    X remainder{};  ///< what rounding left out of x
    X rate{};       ///< dx/ds there
};

/// The step in progress. Fulfils `DenseStep`.
template <class Method, class System, StateVector X>
class ExplicitStep {
public:
    using Stepper = typename Method::template Stepper<X>;

    static_assert(!Multistep<Stepper>,
                  "ricochet: a multistep method keeps a memory that an event makes stale; "
                  "use a one-step method");

    /// Places the step at (t, x) in `mode` and evaluates the flow there. `backward`:
    /// time runs backward, and offsets and rates with it.
    ExplicitStep(const System& system, double t, const X& x, Mode mode = 0, bool backward = false,
                 const Method& method = {})
        : system_(&system),
          start_{t, 0},
          mode_(mode),
          backward_(backward),
          x0_(x),
          remainder_(zeros_like(x)),
          zero_(remainder_),
          rate0_(remainder_),
          w_(remainder_),
          w_rate1_(remainder_),
          x1_(x),
          rate1_(remainder_),
          advancing_(stepper_of(method)),
          probing_(stepper_of(method)),
          error_(remainder_),
          at_(remainder_),
          unused_rate_(remainder_)
    {
        inner_w_.fill(zero_);
        inner_rate_.fill(zero_);
        flow(0, x0_, rate0_);
    }

    [[nodiscard]] double time(double s) const noexcept { return start_.plus(in_time(s)); }
    [[nodiscard]] const Instant& start() const noexcept { return start_; }
    [[nodiscard]] Mode mode() const noexcept { return mode_; }
    [[nodiscard]] bool backward() const noexcept { return backward_; }

    /// The time at offset s + `remainder`.
    [[nodiscard]] Instant instant(double s, double remainder) const noexcept
    {
        const Instant at = start_.after(in_time(s));
        return remainder == 0 ? at : at.after(in_time(remainder));
    }

    /// Seconds from the start to time t, positive if it lies ahead.
    [[nodiscard]] double until(double t) const noexcept
    {
        const double ahead = start_.until(t);
        return backward_ ? -ahead : ahead;
    }
    [[nodiscard]] double h() const noexcept { return h_; }
    [[nodiscard]] const X& x0() const noexcept { return x0_; }
    [[nodiscard]] const X& x1() const noexcept { return x1_; }
    [[nodiscard]] const X& rate0() const noexcept { return rate0_; }
    [[nodiscard]] const X& rate1() const noexcept { return rate1_; }
    [[nodiscard]] constexpr int order() const noexcept
    {
        if constexpr (by_name) {
            return advancing_.order();
        } else {
            return order_of<Stepper>();
        }
    }
    /// Of the error estimate; 0: there is none.
    [[nodiscard]] constexpr int error_order() const noexcept
    {
        if constexpr (by_name) {
            return advancing_.error_order();
        } else if constexpr (has_error_estimate<Stepper>) {
            return static_cast<int>(Stepper::error_order_value);
        } else {
            return 0;
        }
    }

    /// x(t0 + s) on the dense output: the method's own where it has one, else the
    /// polynomial of `dense`.
    [[gnu::noinline]] void interpolate(double s, X& x) const
    {
        if (interpolates()) {
            departure(s, x);
            add_tangent(s, x);
        } else if constexpr (!always_interpolates) {
            const DenseView<X, false> view(dense(), s);
            for_components([&](auto i) { x[i] = view[i]; });
        }
    }

    /// As `interpolate`, without further evaluations of the flow: on the cubic through both
    /// ends where the method has no dense output of its own.
    [[gnu::noinline]] void peek(double s, X& x) const
    {
        if (interpolates()) {
            departure(s, x);
            add_tangent(s, x);
        } else if constexpr (!always_interpolates) {
            const double u = s / h_;
            const double value = u * u * (3 - 2 * u);
            const double slope = h_ * u * u * (u - 1);
            for_components([&](auto i) {
                const double w = value * w_[i] + slope * (rate1_[i] - rate0_[i]);
                x[i] = x0_[i] + (s * rate0_[i] + (w + remainder_[i]));
            });
        }
    }

    /// As `peek` at the part `Part::u` of the step, of which the dense output has its weights
    /// from the compiler.
    template <class Part>
    [[gnu::always_inline]] void peek(X& x) const
    {
        const double s = Part::u * h_;
        if constexpr (requires { advancing_.template weights<Part>(h_); }) {
            const auto weights = advancing_.template weights<Part>(h_);
            for_components([&](auto i) __attribute__((always_inline)) {
                const double w = advancing_.dense(weights, w_rate1_, i);
                x[i] = x0_[i] + (s * rate0_[i] + (w + remainder_[i]));
            });
        } else {
            peek(s, x);
        }
    }

    /// x(t0 + s) of the polynomial of `dense`, or its derivative, a component at a time. Of a
    /// large state the inner node is computed for the components that are asked for alone,
    /// until they are as many as the state has.
    template <bool derivative>
    class ComponentView {
    public:
        ComponentView(const ExplicitStep& step, double s) noexcept
            : step_(&step),
              s_(s),
              weights_(dense_weights(DenseNodes::middle_end, s / step.h_, derivative)),
              middle_(step.advancing_.template weights<Middle>(step.h_))
        {
            const double unit = derivative ? 1 / step.h_ : 1;
            for (std::size_t k = 0; k < 2; ++k) weights_.value[k] *= unit;
            weights_.slope[1] *= unit * step.h_;
        }

        template <class Index>
        [[nodiscard]] double operator[](Index index) const noexcept
        {
            const auto i = static_cast<decltype(step_->x0_.size())>(index);
            const double rate0 = step_->rate0_[i];
            double bent = 0;
            bent += weights_.value[0] * middle(i);
            bent += weights_.value[1] * step_->w_[i];
            bent += weights_.slope[1] * (step_->rate1_[i] - rate0);
            if constexpr (derivative) {
                return rate0 + bent;
            } else {
                return step_->x0_[i] + (s_ * rate0 + (bent + step_->remainder_[i]));
            }
        }

        [[nodiscard]] auto size() const noexcept { return step_->x0_.size(); }

    private:
        struct Middle {
            static constexpr double u = 0.5;
        };

        template <class Index>
        [[nodiscard]] double middle(Index i) const noexcept
        {
            if (step_->dense_ready_) return step_->inner_w_[0][i];
            ++step_->asked_alone_;
            return step_->advancing_.dense(middle_, step_->w_rate1_, i);
        }

        const ExplicitStep* step_;
        double s_;
        DenseWeights weights_;
        std::array<double, Stepper::dense_weights_count> middle_;
    };

    /// The polynomial at offset s, or its derivative, a component at a time.
    template <bool derivative>
    [[nodiscard]] auto component_view(double s) const
    {
        if constexpr (components_alone) {
            if (!dense_ready_ && asked_alone_ >= static_cast<std::size_t>(x0_.size())) {
                prepare_dense();
            }
            return ComponentView<derivative>(*this, s);
        } else {
            return DenseView<X, derivative>(dense(), s);
        }
    }

    /// The step as a polynomial of the order that the method reaches over many steps.
    /// Its inner nodes are computed when it is first asked for.
    [[nodiscard]] DenseParts<X> dense() const
    {
        if (!dense_ready_) prepare_dense();
        DenseParts<X> parts{.nodes = dense_nodes(),
                            .h = h_,
                            .x0 = &x0_,
                            .remainder = &remainder_,
                            .rate0 = &rate0_};
        const std::size_t inner = inner_nodes(parts.nodes);
        for (std::size_t k = 0; k < inner; ++k) {
            parts.w[k] = &inner_w_[k];
            if (!interpolates()) parts.slope[k] = &inner_rate_[k];
        }
        parts.w[inner] = &w_;
        parts.slope[inner] = &w_slope1_;
        return parts;
    }

    /// x(t0 + s) by the method's own step of length s from the start.
    [[gnu::noinline]] void restep(double s, X& x) const
    {
        ++resteps_;
        advance<false>(probing_, s, x, unused_rate_, error_);
        add_tangent(s, x);
    }

    /// x(t0 + s) as precisely as is cheap: dense output of the method's own order,
    /// or a step of its own.
    void sample(double s, X& x) const
    {
        if (interpolates()) {
            interpolate(s, x);
        } else {
            restep(s, x);
        }
    }

    /// x(t0 + s) by the method's own step, and the flow there.
    [[gnu::noinline]] void restep(double s, X& x, X& dxdt) const
    {
        ++resteps_;
        advance<false>(probing_, s, x, dxdt, error_);
        add_tangent(s, x);
        if (has_end_rate()) {
            for_components([&](auto i) { dxdt[i] += rate0_[i]; });
        } else {
            flow(s, x, dxdt);
        }
    }

    /// x' = f(t0 + s, x).
    void flow(double s, const X& x, X& dxdt) const
    {
        ++flow_calls_;
        flow_fits_ &= call_flow(*system_, mode_, time(s), x, dxdt);
        if (backward_) for_components([&](auto i) { dxdt[i] = -dxdt[i]; });
    }

    /// Takes a step of length h, without a look at its error.
    void attempt(double h)
    {
        h_ = h;
        advance<false>(advancing_, h, w_, w_rate1_, error_);
        finish_attempt();
    }

    /// Takes a step of length h and returns its largest estimated error over
    /// atol + rtol max(|x0|, |x1|); NaN if anything is not finite.
    [[nodiscard]] double attempt(double h, double rtol, double atol)
    {
        static_assert(has_error_estimate<Stepper>,
                      "ricochet: error control needs a method with an error estimate, such as Dopri5");
        h_ = h;
        advance<true>(advancing_, h, w_, w_rate1_, error_);
        finish_attempt();

        double worst = 0;
        for_components([&](auto i) {
            const double size = std::max(std::fabs(x0_[i]), std::fabs(x1_[i]));
            const double error = std::fabs(error_[i]);
            const double ratio = error == 0 ? 0 : error / (atol + rtol * size);
            worst = worst >= ratio ? worst : ratio;  // NaN stays
        });
        return end_is_finite() ? worst : std::numeric_limits<double>::quiet_NaN();
    }

    /// Whether the end of the step and the flow there are finite.
    [[nodiscard]] bool end_is_finite() const noexcept
    {
        return all_finite(x1_) && all_finite(rate1_);
    }

    /// The end of the step becomes the start of the next.
    void accept() noexcept
    {
        start_ = start_.after(in_time(h_));
        for_components([&](auto i) {
            const TwoSum sum = two_sum(x0_[i], h_ * rate0_[i] + (w_[i] + remainder_[i]));
            x0_[i] = sum.value;
            remainder_[i] = sum.remainder;
        });
        assign(rate0_, rate1_);
    }

    /// As `accept`, where the end is the time `t` by decree.
    void accept_at(double t) noexcept
    {
        accept();
        start_ = {t, 0};
    }

    /// Moves the start of the step to offset s + `remainder`, state x and a mode, after
    /// an event. The state may have another dimension.
    void restart(double s, double remainder, const X& x, Mode mode)
    {
        start_ = instant(s, remainder);
        begin(x, mode);
        flow(0, x0_, rate0_);
    }

    /// Moves the start of the step to where another one started.
    void restart(const StepStart<X>& at)
    {
        start_ = at.t;
        begin(at.x, at.mode);
        assign(remainder_, at.remainder);
        assign(rate0_, at.rate);
    }

    /// Only time goes on, to t.
    void hold(double t) noexcept { start_ = {t, 0}; }

    /// Evaluates the flow at the start anew.
    void refresh() { flow(0, x0_, rate0_); }

    [[nodiscard]] StepStart<X> place() const { return {start_, mode_, x0_, remainder_, rate0_}; }

    /// As `place`, into what is there already.
    void store(StepStart<X>& at) const
    {
        at.t = start_;
        at.mode = mode_;
        assign(at.x, x0_);
        assign(at.remainder, remainder_);
        assign(at.rate, rate0_);
    }

    /// Whether the flow has given its rate the dimension of the state, always.
    [[nodiscard]] bool flow_fits() const noexcept { return flow_fits_; }
    [[nodiscard]] std::uint64_t flow_calls() const noexcept { return flow_calls_; }
    [[nodiscard]] std::uint64_t resteps() const noexcept { return resteps_; }

private:
    /// What is a constant of the other methods is known of one by name at run time only.
    static constexpr bool by_name = std::is_same_v<Method, MethodByName>;
    static constexpr bool can_interpolate = by_name || has_interpolant<Stepper, X>;
    static constexpr bool always_interpolates = can_interpolate && !by_name;

    [[nodiscard]] static Stepper stepper_of([[maybe_unused]] const Method& method)
    {
        if constexpr (by_name) {
            return Stepper(method.name);
        } else {
            return Stepper();
        }
    }

    /// Whether the method has a dense output of its own.
    [[nodiscard]] constexpr bool interpolates() const noexcept
    {
        if constexpr (by_name) {
            return advancing_.interpolates();
        } else {
            return can_interpolate;
        }
    }

    /// Whether a step gives the rate at its end, too (first same as last).
    [[nodiscard]] constexpr bool has_end_rate() const noexcept
    {
        if constexpr (by_name) {
            return advancing_.is_fsal();
        } else {
            return is_fsal<Stepper>;
        }
    }

    [[nodiscard]] static constexpr DenseNodes nodes_of(bool interpolates, int order) noexcept
    {
        return interpolates ? DenseNodes::middle_end
               : order <= 4 ? DenseNodes::end
               : order <= 6 ? DenseNodes::half_end
                            : DenseNodes::thirds_end;
    }
    [[nodiscard]] constexpr DenseNodes dense_nodes() const noexcept
    {
        return nodes_of(interpolates(), order());
    }
    [[nodiscard]] static constexpr std::size_t inner_nodes(DenseNodes nodes) noexcept
    {
        return nodes == DenseNodes::end ? 0 : nodes == DenseNodes::thirds_end ? 2 : 1;
    }
    static constexpr std::size_t most_inner_nodes = []
    {
        if constexpr (by_name) {
            return inner_nodes(DenseNodes::thirds_end);
        } else {
            return inner_nodes(nodes_of(can_interpolate, order_of<Stepper>()));
        }
    }
    ();

    static constexpr bool components_alone = [] {
        if constexpr (requires { Stepper::dense_weights_count; }) {
            return Stepper::has_dense_output && !is_small<X>;
        }
        return false;
    }();

    static constexpr bool fits_registers = is_small<X> && std::is_trivially_copyable_v<X>;

    template <class Function>
    [[gnu::always_inline]] void for_components(const Function& function) const
    {
        for_each_component(x0_, function);
    }

    [[nodiscard]] double in_time(double s) const noexcept { return backward_ ? -s : s; }

    void begin(const X& x, Mode mode)
    {
        mode_ = mode;
        if (x.size() != x0_.size()) {
            const bool backward = backward_;
            const Instant start = start_;
            const std::uint64_t calls = flow_calls_;
            const std::uint64_t resteps = resteps_;
            const bool fits = flow_fits_;
            *this = ExplicitStep(*system_, start.value, x, mode, backward, method());
            start_ = start;
            flow_calls_ = calls;
            resteps_ = resteps;
            flow_fits_ = flow_fits_ && fits;
        }
        assign(x0_, x);
        assign(remainder_, zero_);
        forget_dense();
    }

    [[nodiscard]] Method method() const
    {
        if constexpr (by_name) {
            return {advancing_.name()};
        } else {
            return {};
        }
    }

    /// w(s) on the method's own interpolant.
    void departure([[maybe_unused]] double s, [[maybe_unused]] X& w) const
    {
        if constexpr (can_interpolate && Departing<Stepper>) {
            advancing_.dense(s, h_, w_rate1_, w);
        } else if constexpr (can_interpolate) {
            advancing_.calc_state(s, w, zero_, zero_, 0.0, w_, w_rate1_, h_);
        }
    }

    [[gnu::noinline]] void prepare_dense() const
    {
        for_components([&](auto i) { w_slope1_[i] = rate1_[i] - rate0_[i]; });
        if (interpolates()) {
            if constexpr (can_interpolate) departure(h_ / 2, inner_w_[0]);
        } else {
            const std::size_t inner = inner_nodes(dense_nodes());
            for (std::size_t k = 0; k < inner; ++k) {
                prepare_node(h_ * static_cast<double>(k + 1) / static_cast<double>(inner + 1), k);
            }
        }
        dense_ready_ = true;
    }

    /// A node inside, from a step of its own.
    void prepare_node(double s, std::size_t k) const
    {
        advance<false>(probing_, s, inner_w_[k], unused_rate_, error_);
        assign(at_, inner_w_[k]);
        add_tangent(s, at_);
        X& slope = inner_rate_[k];
        flow(s, at_, slope);
        for_components([&](auto i) { slope[i] -= rate0_[i]; });
    }

    /// What a step starts from.
    struct Origin {
        const System& system;
        const Instant& start;
        Mode mode;
        bool backward;
        const X& x;
        const X& rate;
        const X& zero;
        bool& flow_fits;
    };

    /// The departure w after a step of length s, with its rate there and the error
    /// estimate where the method has them. `at` is scratch. Returns the flow calls.
    template <bool with_error>
    static std::uint64_t depart(Stepper& stepper, const Origin& from, double s, X& at, X& w,
                                X& rate, X& error)
    {
        std::uint64_t calls = 0;
        const auto flow = [&](const X& departure, X& departure_rate, double offset) {
            for_each_component(from.x, [&](auto i) {
                at[i] = from.x[i] + (offset * from.rate[i] + departure[i]);
            });
            ++calls;
            if (from.backward) {
                from.flow_fits &=
                    call_flow(from.system, from.mode, from.start.plus(-offset), at, departure_rate);
                for_each_component(
                    from.x, [&](auto i) { departure_rate[i] = -departure_rate[i] - from.rate[i]; });
            } else {
                from.flow_fits &=
                    call_flow(from.system, from.mode, from.start.plus(offset), at, departure_rate);
                for_each_component(from.x, [&](auto i) { departure_rate[i] -= from.rate[i]; });
            }
        };
        if constexpr (Departing<Stepper>) {
            stepper.template depart<with_error>(flow, from.zero, s, w, rate, error);
        } else if constexpr (is_fsal<Stepper> && with_error) {
            stepper.do_step(flow, from.zero, from.zero, 0.0, w, rate, s, error);
        } else if constexpr (is_fsal<Stepper>) {
            stepper.do_step(flow, from.zero, from.zero, 0.0, w, rate, s);
        } else if constexpr (with_error) {
            stepper.do_step(flow, from.zero, from.zero, 0.0, w, s, error);
        } else if constexpr (requires { stepper.do_step(flow, w, w, 0.0, w, s); }) {
            stepper.do_step(flow, from.zero, from.zero, 0.0, w, s);
        } else if constexpr (requires { stepper.do_step(flow, w, 0.0, w, s); }) {
            stepper.do_step(flow, from.zero, 0.0, w, s);
        } else {
            w = from.zero;
            stepper.do_step(flow, w, 0.0, s);
        }
        return calls;
    }

    /// `depart` from the start of this step.
    template <bool with_error>
    [[gnu::flatten]] void advance(Stepper& stepper, double s, X& w, X& rate, X& error) const
    {
        if constexpr (fits_registers) {
            // On copies that nothing else refers to, the compiler keeps a small
            // state in registers from stage to stage.
            Stepper own = stepper_of(method());
            X x;
            X rate0;
            assign(x, x0_);
            assign(rate0, rate0_);
            const X zero{};
            X at{};
            X w_own{};
            X rate_own{};
            X error_own{};
            flow_calls_ += depart<with_error>(
                own, {*system_, start_, mode_, backward_, x, rate0, zero, flow_fits_}, s, at, w_own,
                rate_own, error_own);
            assign(w, w_own);
            if constexpr (is_fsal<Stepper>) assign(rate, rate_own);
            if constexpr (with_error) assign(error, error_own);
            if constexpr (can_interpolate) {
                if (&stepper == &advancing_) stepper = own;
            }
        } else {
            flow_calls_ += depart<with_error>(
                stepper, {*system_, start_, mode_, backward_, x0_, rate0_, zero_, flow_fits_}, s,
                at_, w, rate, error);
        }
    }

    /// From w to x at offset s.
    void add_tangent(double s, X& w) const noexcept
    {
        for_components([&](auto i) { w[i] = x0_[i] + (s * rate0_[i] + (w[i] + remainder_[i])); });
    }

    void forget_dense() noexcept
    {
        dense_ready_ = false;
        asked_alone_ = 0;
    }

    void finish_attempt()
    {
        forget_dense();
        assign(x1_, w_);
        add_tangent(h_, x1_);
        if (has_end_rate()) {
            for_components([&](auto i) { rate1_[i] = rate0_[i] + w_rate1_[i]; });
        } else {
            flow(h_, x1_, rate1_);
        }
    }

    const System* system_;
    Instant start_;
    Mode mode_;
    bool backward_;
    X x0_, remainder_, zero_, rate0_;
    double h_ = 0;
    X w_, w_rate1_, x1_, rate1_;
    Stepper advancing_;
    mutable Stepper probing_;
    mutable X error_, at_, unused_rate_;
    mutable X w_slope1_ = zero_;
    mutable std::array<X, most_inner_nodes> inner_w_, inner_rate_;
    mutable bool dense_ready_ = false;
    mutable std::size_t asked_alone_ = 0;  ///< components of the inner node, by views
    mutable bool flow_fits_ = true;
    mutable std::uint64_t flow_calls_ = 0;
    mutable std::uint64_t resteps_ = 0;
};

}  // namespace ricochet::detail
