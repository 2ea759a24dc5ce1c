// Internal: the declarations of this header may change without notice.
//
// A step in progress as plain data, and the table of functions that take it.
//
// The loop is compiled in the library for a few types of state; it accesses a method and a
// flow through a `StepKernel`, made where the system is known, so that the flow is inlined into the
// whole step and a small state stays in registers from stage to stage.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <type_traits>
#include <vector>

#include "ricochet/detail/arithmetic.hpp"
#include "ricochet/detail/components.hpp"
#include "ricochet/detail/dense_polynomial.hpp"
#include "ricochet/detail/host_step.hpp"
#include "ricochet/detail/runge_kutta.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/instant.hpp"

namespace ricochet::detail {

/// Type of the loop's states where those of the caller are X.
template <class X>
using CoreState = std::conditional_t<(fixed_size<X>() >= 1 && fixed_size<X>() <= 4), SmallState,
                                     std::vector<double>>;

/// Start of a step, to the last bit.
template <class X>
struct StepStart {
    Instant t;
    Mode mode = 0;
    X x{};
    X remainder{};           ///< rounding error of x, not contained in it
    X rate{};                ///< dx/ds there
    bool is_beyond = false;  ///< the rate is that of the double after t
};

/// A vector like `x`, of zeros.
template <class X>
[[nodiscard]] X zeros_like(X x)
{
    for_each_component(x, [&](auto i) { x[i] = 0; });
    return x;
}

/// One step from x0 at `start`, as a departure from the tangent: x(s) = x0 + s rate0 + w(s).
template <class X>
struct StepState {
    explicit StepState(const X& x)
        : x0(x),
          remainder(zeros_like(x)),
          zero(remainder),
          rate0(remainder),
          w(remainder),
          w_rate1(remainder),
          x1(x),
          rate1(remainder),
          error(remainder),
          at(remainder),
          middle(remainder)
    {
        if constexpr (!is_small<X>) large.remainder1 = remainder;
    }

    /// Flow of the system, for kernels that do not have it inlined; see `SystemTable::flow`.
    bool (*flow)(void* adapter, Mode mode, double t, const X& x, X& dxdt) = nullptr;

    Instant start;
    Mode mode = 0;
    bool backward = false;  ///< time runs backward, and offsets and rates with it
    bool flow_fits = true;  ///< the flow has always given its rate the dimension of the state
    std::uint64_t flow_calls = 0;
    double h = 0;
    /// Times between which the flow is evaluated: where it jumps at a time event at an end of the
    /// step, the double beside that end belongs to the step.
    double flow_from = -std::numeric_limits<double>::infinity();
    double flow_to = std::numeric_limits<double>::infinity();

    X x0, remainder, zero, rate0;
    X w, w_rate1;  ///< at the end; the rate only where the method computes it
    X x1, rate1;
    X error, at;
    const double* component_atol = nullptr;  ///< one for each component, in place of one for all

    /// Stages of the current step, and of the last step that was repeated to an inner time.
    std::array<X, most_kept_stages> stages{};
    struct None {};
    struct Large {
        X remainder1;  ///< of x1; small states leave it to the acceptance of the step
        std::array<X, most_kept_stages> probed{};
    };
    [[no_unique_address]] std::conditional_t<is_small<X>, None, Large> large{};

    X middle;  ///< w at the middle, where `has_middle`
    mutable bool has_middle = false;
    mutable std::size_t asked_alone = 0;  ///< components of the middle computed one by one, by
                                          ///< views

    const HostStepTable* host = nullptr;  ///< the current step, where a host program has taken it

    [[nodiscard]] double in_time(double s) const noexcept { return backward ? -s : s; }
    [[nodiscard]] double time(double s) const noexcept { return start.plus(in_time(s)); }
    /// The time at which the flow is evaluated for offset s.
    [[nodiscard]] double flow_time(double s) const noexcept { return flow_at(time(s)); }
    [[nodiscard]] double flow_at(double t) const noexcept
    {
        return least_of(greatest_of(t, flow_from), flow_to);
    }
};

/// The smallest tolerance of a component's error, in place of 0: its reciprocal is a number.
inline constexpr double least_tolerance = 4 * std::numeric_limits<double>::min();

/// The first crossing of a guard in a step, where its series determines it.
struct SeriesCrossing {
    std::size_t which = 0;
    Side side = Side::plateau;  ///< side that the guard leaves
    double end = 0;             ///< its value at the end of the step
    bool from_surface = false;  ///< it starts there
    std::uint64_t calls = 0;    ///< of the guard

    // --- offsets [s] in the step, as in `Location` ---
    double lo = 0, hi = 0, root = 0, root_remainder = 0;
    double slope = 0, error = 0;
};

/// A method for one system. Without functions the steps are those of a host program.
template <class X>
struct StepKernel {
    int order = 0;
    int error_order = 0;     ///< of the error estimate; 0: there is none
    bool end_rate = false;   ///< a step gives the rate at its end, too (first same as last)
    bool is_dopri5 = false;  ///< the stages are those of Dormand and Prince, with their interpolant

    /// Takes a step of length h: `w`, `x1`, `rate1`, and `stages` where they have an interpolant.
    /// False: the end or the flow there is not finite.
    bool (*take)(void* adapter, StepState<X>& step, double h) = nullptr;
    /// Takes a step like `take`. Returns its largest estimated error over atol + rtol max(|x0|,
    /// |x1|); NaN if anything is not finite. Null without an estimate.
    double (*attempt)(void* adapter, StepState<X>& step, double h, double rtol,
                      double atol) = nullptr;
    /// The departure after a step of length s, with its rate where the method computes it; the
    /// current step is unchanged.
    void (*depart)(void* adapter, StepState<X>& step, double s, X& w, X& rate) = nullptr;
    /// How far a step from here may go, of which a length h is asked for: up to a change that the
    /// stepper locates, or as far as the tolerance is met for certain. Null where that is known
    /// only afterwards.
    double (*reach)(void* adapter, StepState<X>& step, double h, double rtol,
                    double atol) = nullptr;
    /// Whether the current step ends at a change that the stepper has located by itself. Null where
    /// it locates none.
    bool (*ends_at_change)(void* adapter, const StepState<X>& step) = nullptr;
    /// w(s) on an interpolant of the method's own, or null.
    void (*departure)(void* adapter, const StepState<X>& step, double s, X& w) = nullptr;
    /// w(s) for a sample, on an interpolant of the order of the method that takes further work
    /// once a step. False where that is not within the tolerance, and the sample needs a step of
    /// its own. Null: the method has none.
    bool (*sample)(void* adapter, StepState<X>& step, double s, double rtol, double atol,
                   X& w) = nullptr;
    /// The current step where it is a power series, or null.
    SeriesTerms (*series)(void* adapter, const StepState<X>& step) = nullptr;
    /// Largest error of the current step's polynomial inside the step, over atol + rtol max(|x0|,
    /// |x1|). Null where the step's own error limits it.
    double (*roughness)(void* adapter, StepState<X>& step, double rtol, double atol) = nullptr;
    /// All guards as power series on it, or null.
    SeriesTerms (*guard_series)(void* adapter, const StepState<X>& step) = nullptr;
    /// Locates a crossing by a guard's series, and leaves the state there in `at`; false where that
    /// is not certain. Null where guards have no series.
    bool (*cross)(void* adapter, StepState<X>& step, SeriesCrossing& crossing) = nullptr;
    /// Called when the state has another dimension. Null where nothing is kept.
    void (*renew)(void* adapter) = nullptr;

    [[nodiscard]] bool interpolates() const noexcept { return is_dopri5 || departure; }
};

/// The polynomial of a step at offset s, or its derivative, one component at a time. Where the
/// middle of the step is not known yet it is computed only for the components requested.
template <class X, bool derivative>
class LargeStepView {
    using Dopri5 = RungeKutta<Dopri5Tableau, X>;

public:
    LargeStepView(const DenseParts<X>& parts, double s) noexcept { all_.emplace(parts, s); }

    /// View of a step by Dormand and Prince's method.
    LargeStepView(const StepState<X>& step, double s) noexcept
        : step_(&step), s_(s), weights_(quartic_weights(s / step.h, derivative))
    {
        const double unit = derivative ? 1 / step.h : 1;
        for (std::size_t k = 0; k < 2; ++k) weights_.value[k] *= unit;
        weights_.slope[1] *= unit * step.h;
    }

    template <class Index>
    [[nodiscard]] double operator[](Index index) const noexcept
    {
        if (!step_) return (*all_)[index];
        const auto i = static_cast<std::size_t>(index);
        const double rate0 = step_->rate0[i];
        double bent = 0;
        bent += weights_.value[0] * middle(i);
        bent += weights_.value[1] * step_->w[i];
        bent += weights_.slope[1] * (step_->rate1[i] - rate0);
        if constexpr (derivative) {
            return rate0 + bent;
        } else {
            return step_->x0[i] + (s_ * rate0 + (bent + step_->remainder[i]));
        }
    }

    [[nodiscard]] std::size_t size() const noexcept
    {
        return step_ ? step_->x0.size() : all_->size();
    }

private:
    struct Middle {
        static constexpr double u = 0.5;
    };

    [[nodiscard]] double middle(std::size_t i) const noexcept
    {
        if (step_->has_middle) return step_->middle[i];
        ++step_->asked_alone;
        return Dopri5::dense(Dopri5::template weights<Middle>(step_->h), step_->stages.data(),
                             step_->w_rate1, i);
    }

    std::optional<DenseView<X, derivative>> all_;
    const StepState<X>* step_ = nullptr;
    double s_ = 0;
    DenseWeights weights_;
};

template <class X, bool derivative>
using PolynomialView =
    std::conditional_t<is_small<X>, DenseView<X, derivative>, LargeStepView<X, derivative>>;

}  // namespace ricochet::detail
