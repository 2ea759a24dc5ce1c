// Internal: the declarations of this header may change without notice.
//
// Quiet steps of several runs by Taylor's method, computed together, each of its own length.
//
// The operations are those of `TaylorKernel` in its quiet runs, one by one, so that
// every run has the bits that it has alone. A lane takes a step here only where the kernel would
// take it without a second check of its guard; before any other step it is handed back to its own
// loop, which has the series of that step already.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "ricochet/detail/guard_view.hpp"
#include "ricochet/detail/quiet_run.hpp"
#include "ricochet/detail/step_state.hpp"
#include "ricochet/taylor/detail/lane_pack.hpp"
#include "ricochet/taylor/detail/taylor_adapter.hpp"
#include "ricochet/taylor/detail/taylor_series.hpp"
#include "ricochet/taylor/detail/taylor_step.hpp"

namespace ricochet::detail {

/// As `find_reach` of one run.
template <class Pack, std::size_t n>
[[nodiscard, gnu::always_inline]] inline SeriesReach<Pack, typename Pack::Mask> find_reach(
    const std::array<Pack, n>& x0, const Pack* c, int order, const Tolerances& allowed)
{
    constexpr double infinity = std::numeric_limits<double>::infinity();
    constexpr double least = std::numeric_limits<double>::min();
    constexpr double most = std::numeric_limits<double>::max();
    const double by_last = -1.0 / order, by_before = -1.0 / (order - 1);
    std::array<Pack, n> size;
    const auto clamped = [](const Pack& a) __attribute__((always_inline))
    {
        return select(a < least, least, select(most < a, most, a));
    };
    Pack apart(infinity);
    const auto longest = [&]() __attribute__((always_inline))
    {
        Pack last(0.0), before(0.0);
        const Pack* const cp = c + static_cast<std::size_t>(order) * n;
        for (std::size_t i = 0; i < n; ++i) {
            const Pack scale = 1.0 / (allowed.absolute(i) + allowed.rtol * size[i]);
            last = larger_of(last, size_of(cp[i]) * scale);
            before = larger_of(before, size_of(*(cp + i - n)) * scale);
        }
        const auto is_series = (last > least) | (before > least);
        const Pack of_last = rough_log2(clamped(last)) * by_last;
        const Pack of_before = rough_log2(clamped(before)) * by_before;
        apart = select(is_series, size_of(of_last - of_before), infinity);
        return select(is_series, rough_exp2(smaller_of(of_last, of_before)), infinity);
    };
    for (std::size_t i = 0; i < n; ++i) size[i] = size_of(x0[i]);
    Pack h = longest();
    auto going = h < infinity;
    for (int again = 0; again < 3; ++again) {
        auto larger = Pack(0.0) < 0.0;
        const Pack ahead = smaller_of(h, 1e100);
        for (std::size_t i = 0; i < n; ++i) {
            const Pack end = size_of(x0[i] + ahead * c[n + i]);
            larger = larger | (end > 16.0 * size[i]);
            size[i] = larger_of(size[i], end);
        }
        going = going & larger;
        if (!going.any()) break;
        const Pack apart_before = apart;
        h = select(going, longest(), h);
        apart = select(going, apart, apart_before);
        going = going & (h < infinity);
    }
    return {h, apart <= most_apart};
}

/// As `last_terms`, for one guard.
template <class Pack>
[[nodiscard, gnu::always_inline]] inline Pack last_terms(const Pack* g, int order,
                                                         const Pack& h) noexcept
{
    const Pack h2 = h * h;
    const Pack h4 = h2 * h2;
    Pack power = h4 / h;
    for (int k = 8; k <= order; k += 4) power *= h4;
    return power * (size_of(g[order]) * h + size_of(g[order - 1]));
}

/// As `series_clears`, above 0, for one guard.
template <class Pack, class Mask = typename Pack::Mask>
[[nodiscard, gnu::always_inline]] inline Mask series_clears(const Pack* g, int order,
                                                            const Pack& sign, const Pack& h,
                                                            const Mask& from_surface) noexcept
{
    const Pack h2 = h * h;
    const Pack h4 = h2 * h2;
    Pack tail = size_of(g[order]);
    for (int k = order - 4; k >= 4; k -= 4) {
        tail = tail * h4 + ((size_of(g[k]) + h * size_of(g[k + 1])) +
                            h2 * (size_of(g[k + 2]) + h * size_of(g[k + 3])));
    }
    tail *= h4;
    const Pack q0 = sign * g[0];
    const Pack q1 = sign * g[1] * h;
    const Pack q2 = sign * g[2] * h2;
    const Pack q3 = sign * g[3] * (h * h2);
    const Pack size = ((size_of(q0) + size_of(q1)) + (size_of(q2) + size_of(q3))) + tail;
    const Pack less = (tail + 4.0 * last_terms(g, order, h)) + 0x1p-47 * size;
    const Pack b1 = q0 + (1.0 / 3) * q1;
    const Pack b2 = q0 + (1.0 / 3) * (2.0 * q1 + q2);
    const Pack b3 = q0 + (q1 + (q2 + q3));
    const Mask ends = b3 - less > 0.0;
    const Mask stays = (q0 - less > 0.0) & ((b1 - less > 0.0) & (b2 - less > 0.0));
    // The root at the start is divided out.
    const Pack middle = q1 + 0.5 * q2;
    const Mask rises = (q1 - less > 0.0) & ((middle - less > 0.0) & (q1 + (q2 + q3) - less > 0.0));
    const Mask departs = rises & ~(size_of(q0) > 0x1p-44 * size);
    return ends & ((from_surface & departs) | (stays & ~from_surface));
}

/// Whether quiet steps of such runs can be taken together: the compiler unrolls the series of the
/// flow, which has no modes, is no polynomial, and has at most one guard with a series.
template <class System, class X>
[[nodiscard]] constexpr bool fits_lanes() noexcept
{
    constexpr std::size_t n = fixed_size<X>();
    if constexpr (tape_count<System, n>() != 1) {
        return false;
    } else {
        constexpr const auto& tape = taylor_tape<System, n, 0>;
        constexpr bool one = !Guarded<System, X> || (fixed_guard_count<System, X>() == 1 &&
                                                     guards_with_series<System, n>() == 1);
        return one && is_unrolled<tape> && polynomial_order(tape) > least_taylor_order;
    }
}

#if defined(__AVX2__)
constexpr bool lanes_are_wide = true;
#else
constexpr bool lanes_are_wide = false;
#endif
constexpr bool lanes_may_be_wide = lanes_are_wide || RICOCHET_WIDE_SERIES;

/// Whether the processor has registers of four doubles.
[[nodiscard]] inline bool has_wide_lanes() noexcept
{
#if RICOCHET_WIDE_SERIES
    return __builtin_cpu_supports("avx2");
#else
    return lanes_are_wide;
#endif
}

/// The series of several runs of a system whose operations the compiler knows.
template <class System, class X, bool wide>
class UnrolledLanes {
    using Pack = LanePack<wide>;

public:
    static constexpr std::size_t components = fixed_size<X>();
    static constexpr const auto& tape = taylor_tape<System, components, 0>;
    static constexpr bool guarded = tape.guards == 1;

    /// Takes the constants of the run in a lane.
    void set(std::size_t lane, const TaylorAdapter<System, X, components>& adapter)
    {
        const auto& constants = adapter.constants(0);
        for (std::size_t i = 0; i < constants.size(); ++i) constants_[i].set(lane, constants[i]);
    }
    [[gnu::always_inline]] void compute(const Pack& t, const Pack* x,
                                        const TaylorCoefficients<Pack>& to) const
    {
        TaylorSeries<tape, most_taylor_order, true, Pack>::compute_inline(constants_.data(), t, x,
                                                                          to);
    }

private:
    std::array<Pack, tape.ops_count> constants_;
};

/// Up to `lane_count` runs of `System` from starts like X.
/// @tparam wide  in registers of four doubles, which the processor has
/// @tparam Series  their series, with the members of `UnrolledLanes`
template <class System, class X, bool wide, class Series = UnrolledLanes<System, X, wide>>
class TaylorLanes {
    using Pack = LanePack<wide>;
    using Mask = LaneMask<wide>;
    static constexpr std::size_t n = Series::components;
    using D = TaylorAdapter<System, X, n>;
    using C = CoreState<X>;
    using State = StepState<C>;
    using Y = typename D::Room::Guarded;
    using Guard = GuardView<System, Y>;
    static constexpr bool guarded = Series::guarded;

public:
    using SystemAdapter = D;

    /// Sets the options that all runs have in common.
    /// @param order  of their series
    TaylorLanes(const Options& options, int order, const Series& series = {})
        : options_(options),
          order_(order),
          backward_(options.t_end < options.t_start),
          series_(series)
    {
    }

    [[nodiscard]] bool is_active(std::size_t lane) const noexcept { return active_[lane]; }
    [[nodiscard]] std::size_t active_count() const noexcept
    {
        std::size_t count = 0;
        for (std::size_t lane = 0; lane < lane_count; ++lane) count += active_[lane] ? 1 : 0;
        return count;
    }

    /// Takes over a run before steps that may be quiet.
    void load(std::size_t lane, D& adapter, State& state, const QuietRun& quiet)
    {
        // Lanes that were never used get the numbers of this run too; their results are ignored.
        for (std::size_t to = 0; to < lane_count; ++to) {
            if (to == lane || !used_[to]) put(to, adapter, state, quiet);
        }
        runs_[lane] = {&adapter, &state};
        used_[lane] = true;
        active_.set(lane, true);
    }

    /// Returns it before the step that it does not take here. `expanded`: the series of that step
    /// is known, as after `advance`.
    void store(std::size_t lane, QuietRun& quiet, bool expanded)
    {
        const auto& [adapter, state] = runs_[lane];
        active_.set(lane, false);
        quiet.why = QuietEnd::due;
        quiet.repeated = false;
        quiet.steps = static_cast<std::uint64_t>(steps_[lane]);
        quiet.guard_calls = guarded ? quiet.steps : 0;
        quiet.h_next = h_next_[lane];
        if (quiet.steps > 0) {
            quiet.g0 = quiet.g1 = g0_[lane];
            quiet.rate0 = std::numeric_limits<double>::quiet_NaN();  // until it is requested
            state->h = h_[lane];
            state->flow_calls += quiet.steps;
            state->has_middle = false;
            state->asked_alone = 0;
        }
        state->start = {start_[lane], start_remainder_[lane]};
        auto& step = adapter->step;
        for (std::size_t i = 0; i < n; ++i) {
            state->x0[i] = step.x[i] = x0_[i][lane];
            state->remainder[i] = remainder_[i][lane];
            state->rate0[i] = rate0_[i][lane];
        }
        step.start = state->start;
        step.mode = state->mode;
        step.backward = backward_;
        step.asked = order_;
        step.order = expanded ? order_ : 0;
        step.is_motion = false;
        step.reach = std::numeric_limits<double>::quiet_NaN();
        if (!expanded) return;
        const auto terms = static_cast<std::size_t>(order_) + 1;
        for (std::size_t k = 0; k < terms * n; ++k) step.coefficients[k] = coefficients_[k][lane];
        if constexpr (guarded) {
            for (std::size_t k = 0; k < terms; ++k) step.guards[k] = guards_[k][lane];
        }
    }

    /// Takes steps of the active runs until some of them do not take their next step here.
    /// Returns these runs, one bit each.
    [[nodiscard]] unsigned advance() requires(!wide || !RICOCHET_WIDE_SERIES)
    {
        return advance_inline();
    }
#if RICOCHET_WIDE_SERIES
    [[nodiscard, gnu::target("avx2")]] unsigned advance() requires wide
    {
        return advance_inline();
    }
#endif

private:
    void put(std::size_t lane, D& adapter, const State& state, const QuietRun& quiet)
    {
        series_.set(lane, adapter);
        for (std::size_t i = 0; i < n; ++i) {
            x0_[i].set(lane, state.x0[i]);
            remainder_[i].set(lane, state.remainder[i]);
            rate0_[i].set(lane, state.rate0[i]);
        }
        start_.set(lane, state.start.value);
        start_remainder_.set(lane, state.start.remainder);
        end_.set(lane, quiet.end);
        h_next_.set(lane, quiet.h_next);
        h_.set(lane, 0);
        sign_.set(lane, quiet.sign);
        g0_.set(lane, quiet.g0);
        departs_.set(lane, quiet.departs);
        steps_.set(lane, 0);
        constexpr std::uint64_t most = std::uint64_t{1} << 52;
        most_steps_.set(lane,
                        static_cast<double>(quiet.most_steps < most ? quiet.most_steps : most));
    }

    [[nodiscard, gnu::always_inline]] Pack in_time(const Pack& s) const noexcept
    {
        return backward_ ? -s : s;
    }

    [[nodiscard, gnu::always_inline]] unsigned advance_inline()
    {
        Mask taken;
        do {
            expand();
            taken = take_step();
        } while (!(active_ & ~taken).any());
        unsigned out = 0;
        for (unsigned lane = 0; lane < lane_count; ++lane) {
            if (active_[lane] && !taken[lane]) out |= 1U << lane;
        }
        return out;
    }

    [[gnu::always_inline]] void expand()
    {
        series_.compute(start_, x0_.data(), {order_, coefficients_.data(), guards_.data()});
        if (!backward_) return;
        for (std::size_t k = 1; k <= static_cast<std::size_t>(order_); k += 2) {
            for (std::size_t i = 0; i < n; ++i) {
                coefficients_[k * n + i] = -coefficients_[k * n + i];
            }
            if constexpr (guarded) guards_[k] = -guards_[k];
        }
    }

    /// The ends of the steps of all lanes.
    struct StepEnds {
        Pack h;                                  ///< [s] from their starts
        std::array<Pack, n> x, remainder, rate;  ///< states, as x + remainder, and their rates
        Pack g;                                  ///< the guards, if there are any
    };

    /// Whether each active lane has taken its step.
    [[nodiscard, gnu::always_inline]] Mask take_step()
    {
        const double* const each =
            options_.component_atol.empty() ? nullptr : options_.component_atol.data();
        const Pack* const c = coefficients_.data();
        const auto reach = find_reach(x0_, c, order_, {options_.rtol, options_.atol, each});
        const Pack ulp = std::numeric_limits<double>::epsilon() * size_of(start_);
        const Pack smallest =
            larger_of(options_.h_min, larger_of(4.0 * ulp, std::numeric_limits<double>::min()));
        const Pack h = smaller_of(h_next_, reach.h);
        const Pack until = in_time((end_ - start_) - start_remainder_);
        Mask fine = (active_ & (steps_ < most_steps_)) &
                    ((reach.h >= smallest) & ~(h * (1 + 1e-6) >= until));
        fine = fine & reach.agree;  // the end of another step is checked in the lane's own loop
        if (options_.cancelled && options_.cancelled->load(std::memory_order_relaxed)) {
            fine = fine & ~fine;
        }

        std::array<Pack, n> w;
        StepEnds ends;
        ends.h = h;
        evaluate_departure<true>(c, order_, h, w, ends.rate);
        Pack sum(0.0);
        for (std::size_t i = 0; i < n; ++i) {
            const Pack rate0 = c[n + i];
            two_sum(x0_[i], h * rate0 + (w[i] + remainder_[i]), ends.x[i], ends.remainder[i]);
            ends.rate[i] = rate0 + ends.rate[i];
            sum += 0.0 * (ends.x[i] + ends.rate[i]);
        }
        fine = fine & (sum == 0.0);
        ends.g = g0_;
        if constexpr (guarded) {
            sample_guards(ends.x, start_ + (start_remainder_ + in_time(h)), ends.g, fine);
            fine = fine & clears(h, ends.g);
        }
        accept(fine, ends);
        return fine;
    }

    /// As the function for doubles.
    [[gnu::always_inline]] static void two_sum(const Pack& a, const Pack& b, Pack& sum,
                                               Pack& remainder) noexcept
    {
        sum = a + b;
        const Pack b_part = sum - a;
        remainder = (a - (sum - b_part)) + (b - b_part);
    }

    /// The guards of the lanes that are `fine`, at the ends of their steps. An exception is thrown
    /// again in the lane's own loop.
    [[gnu::always_inline]] void sample_guards(const std::array<Pack, n>& x1, const Pack& t,
                                              Pack& g1, Mask& fine)
    {
        for (std::size_t lane = 0; lane < lane_count; ++lane) {
            if (!fine[lane]) continue;
            const auto& [adapter, state] = runs_[lane];
            Y x;
            if constexpr (requires { x.resize(n); }) x.resize(n);
            for (std::size_t i = 0; i < n; ++i) x[own(i, x)] = x1[i][lane];
            std::uint64_t calls = 0;
            try {
                const Guard guard(adapter->system(), calls,
                                  {.mode = state->mode, .backward = backward_});
                g1.set(lane, guard.value(t[lane], x));
            } catch (...) {
                fine.set(lane, false);
            }
        }
    }

    /// As `TaylorKernel::is_clear`, without its second check.
    [[nodiscard, gnu::always_inline]] Mask clears(const Pack& h, const Pack& g1) const
    {
        const Pack* const g = guards_.data();
        const Pack last = last_terms(g, order_, h);
        const Mask converges = last <= 0x1p-20 * larger_of(size_of(g0_), size_of(g1));
        const Pack q0 = sign_ * g0_;
        const Mask armed = (sign_ * g1 > 0.0) & ~(~departs_ & (q0 < 0.0));
        const Mask from_surface = departs_ | (q0 <= 0.0);
        return (armed & converges) & series_clears(g, order_, sign_, h, from_surface);
    }

    [[gnu::always_inline]] void accept(const Mask& fine, const StepEnds& ends)
    {
        Pack start, start_remainder;
        two_sum(start_, start_remainder_ + in_time(ends.h), start, start_remainder);
        start_ = select(fine, start, start_);
        start_remainder_ = select(fine, start_remainder, start_remainder_);
        for (std::size_t i = 0; i < n; ++i) {
            x0_[i] = select(fine, ends.x[i], x0_[i]);
            remainder_[i] = select(fine, ends.remainder[i], remainder_[i]);
            rate0_[i] = select(fine, ends.rate[i], rate0_[i]);
        }
        h_ = select(fine, ends.h, h_);
        h_next_ = select(fine, smaller_of(10.0 * ends.h, options_.h_max), h_next_);
        g0_ = select(fine, ends.g, g0_);
        departs_ = departs_ & ~fine;
        steps_ = select(fine, steps_ + 1.0, steps_);
    }

    struct LaneRun {
        D* adapter = nullptr;
        State* state = nullptr;
    };

    const Options& options_;
    int order_;
    bool backward_;
    std::array<LaneRun, lane_count> runs_{};
    std::array<bool, lane_count> used_{};
    Mask active_{};
    Mask departs_{};  ///< the guard starts on its surface
    Series series_;
    std::array<Pack, n> x0_, remainder_, rate0_;
    Pack start_, start_remainder_, end_, h_, h_next_, sign_, g0_;
    Pack steps_, most_steps_;  ///< whole numbers
    std::array<Pack, (most_taylor_order + 1) * n> coefficients_;
    std::array<Pack, guarded ? most_taylor_order + 1 : 1> guards_;
};

}  // namespace ricochet::detail
