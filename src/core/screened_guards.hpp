// Screening: decides which guards of a system need a search in a step, from their values at its
// ends and inside.
//
// Data that every step needs for every guard lie in plain arrays, so that a hundred guards
// are screened in one loop.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "base/wide.hpp"
#include "core/sampled_guards.hpp"
#include "core/step.hpp"
#include "core/tolerances.hpp"
#include "ricochet/bernstein.hpp"
#include "ricochet/detail/cubic_check.hpp"
#include "ricochet/detail/series_guard.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::detail {

template <class X, bool single>
class ScreenedGuards : public SampledGuards<X, single> {
    using Guards = SampledGuards<X, single>;

protected:
    using typename Guards::Doubles;

    ScreenedGuards(const SystemAt<X>& system, const GuardRules& rules, bool backward)
        : Guards(system, rules, backward), suspects_(size()), marks_(size())
    {
        if (size() == 0) return;
        if (rules.checks_inside) {
            for (auto* numbers : {&inside_, &further_, &worst_}) numbers->resize(size());
        }
        for (auto* numbers : {&sign_, &g0_, &rate0_, &g1_, &rate1_}) numbers->resize(size());
        for (const GuardRecord& record : records_) {
            touches_ = touches_ || record.info.touch > 0;
            const int degree = record.info.degree;
            signs_ = signs_ || record.info.boolean;
            of_time_ = of_time_ && degree >= 1 && degree <= 3 && !record.info.boolean;
            linear_ = linear_ && record.info.degree == 1 && !record.info.boolean;
        }
        linear_ = linear_ && !touches_ && rules.screening == Screening::extremum;
    }

public:
    using Guards::size;

    /// Sets the power series of the guards over the current step, or none.
    /// `starts`: whether a smooth phase starts with the step.
    void see(const SeriesTerms& series, bool starts) noexcept
    {
        series_ = series;
        starts_phase_ = starts;
        forget_screening();
    }
    /// Whether every series has converged at h, the length of the step.
    [[nodiscard]] bool series_converge(double h) const noexcept
    {
        for (std::size_t i = 0; i < size(); ++i) {
            if (has_series(i) && !series_converges(series_, i, h, g0_[i], g1_[i])) return false;
        }
        return true;
    }
    [[nodiscard]] bool on_series() const noexcept { return series_.coefficients; }
    [[nodiscard]] bool has_series(std::size_t i) const noexcept
    {
        return series_.coefficients && !records_[i].info.boolean;
    }
    [[nodiscard]] const SeriesTerms& series() const noexcept { return series_; }

    /// Whether guard i, which has a power series, starts on its surface.
    [[nodiscard]] bool starts_on_surface(std::size_t i) const noexcept
    {
        const bool departs = records_[i].departs && starts_phase_;
        return departs || sign_[i] * g0_[i] <= records_[i].info.touch;
    }

    /// Evaluates all guards inside a step, at its state `x` there.
    void sample_inside(const Step<X>& step, const X& x, std::uint64_t& calls)
    {
        sample_values(step.mode(), step.time(CubicCheck::inside * step.h()), x, calls, inside_);
        checked_ = Checked::inside;
        marked_ = false;
    }

    /// Guard i at the part u of the step, if it has been evaluated there; else at 0.
    [[nodiscard]] GuardSample known_at(double u, std::size_t i, double h) const noexcept
    {
        if (u == CubicCheck::inside && checked()) return {.s = u * h, .value = inside_[i]};
        const bool all = checked_ == Checked::further && are_few();
        if (u == CubicCheck::further && all) return {.s = u * h, .value = further_[i]};
        return {};
    }

    /// Evaluates all guards a second time, at the part `CubicCheck::further` of the step where the
    /// state is `x`.
    void sample_further(const Step<X>& step, const X& x, std::uint64_t& calls)
    {
        const double s = CubicCheck::further * step.h();
        sample_values(step.mode(), step.time(s), x, calls, further_);
        checked_ = Checked::further;
    }

    /// Evaluates only the guards in doubt a second time, if they are few, on the step's polynomial.
    /// The others count as being on their cubics there.
    [[nodiscard]] bool sample_doubtful_further(const Step<X>& step, std::uint64_t& calls)
    {
        if (are_few() || !marked_ || marks_.size() > size() / 4 || !system_->guard_on) return false;
        if (!step.interpolates()) return false;
        const double s = CubicCheck::further * step.h();
        for (std::size_t i = 0; i < size(); ++i) {
            further_[i] = cubic(i, step.h()).at(CubicCheck::further);
        }
        const auto x = step.template component_view<false>(s);
        for (const std::size_t i : marks_) {
            further_[i] = this->view(i, step.mode(), calls).value(step.time(s), x);
        }
        checked_ = Checked::further;
        return true;
    }

    /// Evaluates all guards once more, at the part `u` of the step, one of `CubicCheck::places`.
    void sample_place(const Step<X>& step, double u, const X& x, std::uint64_t& calls)
    {
        sample_values(step.mode(), step.time(u * step.h()), x, calls, further_);
        const double h = step.h();
        const bool first = checked_ != Checked::everywhere;
        for (std::size_t i = 0; i < size(); ++i) {
            const double e = deviation(cubic(i, h), i, h, u, further_[i]);
            worst_[i] = !first && !(worst_[i] <= e) ? worst_[i] : e;  // NaN stays
        }
        checked_ = Checked::everywhere;
    }

    [[nodiscard]] bool checked_everywhere() const noexcept
    {
        return checked_ == Checked::everywhere;
    }

    /// Whether all guards are the cubics through their ends, since they are of degree 1 on a path
    /// that is a cubic, and have control points on their sides by more than rounding: then an
    /// evaluation inside the step would add nothing.
    [[nodiscard]] bool clear_as_cubics(double h) const noexcept
    {
        if (!linear_ || waiting_) return false;
        constexpr double rounding =
            tolerances::by_rounding;  // of rates that are differences, with a reserve
        return !any_of([ this, h ](std::size_t i) __attribute__((always_inline)) {
            const CubicCheck look = cubic(i, h);
            const bool known = is_finite(look.b1 + look.b2);
            const bool clear = look.lowest(sign_[i]) > rounding * look.size();
            const bool armed = sign_[i] != 0;
            return !(clear & known) & armed;
        });
    }

    /// Whether only the sign of any guard has a meaning.
    [[nodiscard]] bool has_signs() const noexcept { return signs_; }

    /// Whether all guards are the cubics through their ends in a step in which only the time moves.
    [[nodiscard]] bool are_cubics_of_time() const noexcept { return of_time_; }

    /// Whether any guard needs a second evaluation inside the step, or a search.
    [[nodiscard]] bool doubtful(double h) noexcept
    {
        if (single && ends_beyond(0)) return true;
        if (checked() && !waiting_ && !touches_) {
            if (are_few()) {
                return with_screen([&](auto screen) __attribute__((always_inline)) {
                    const auto doubt = in_doubt(screen, h);
                    for (std::size_t i = 0; i < size(); ++i) {
                        if (sign_[i] != 0 && doubt(i)) return true;
                    }
                    return false;
                });
            }
            mark(h);
            return !marks_.empty();
        }
        return suspicious(h);
    }

    /// Whether a second evaluation inside the step can change the decision on a guard: it cannot
    /// if the first agreed with the cubic to nine digits, which is no coincidence.
    [[nodiscard]] bool needs_second_check(double h) const noexcept
    {
        const auto needs = [ this, h ](std::size_t i) __attribute__((always_inline))
        {
            const CubicCheck look = cubic(i, h);
            const double e = deviation(look, i, h, CubicCheck::inside, inside_[i]);
            return sign_[i] != 0 && !(e <= tolerances::of_exact_cubic * look.size());
        };
        if (!are_few() && marked_) {
            for (const std::size_t i : marks_) {
                if (needs(i)) return true;
            }
            return false;
        }
        for (std::size_t i = 0; i < size(); ++i) {
            if (needs(i)) return true;
        }
        return false;
    }

    /// Whether any guard needs a search.
    [[nodiscard]] bool suspicious(double h) noexcept
    {
        if (waiting_ && leaves_plateau()) return true;
        if (single && !series_.coefficients && ends_beyond(0)) {
            suspect_all();
            return true;
        }
        screen(h);
        return !suspects_.empty();
    }

    /// Whether guard i ends the step on its surface or beyond, where every screening of the library
    /// suspects it.
    [[nodiscard, gnu::always_inline]] bool ends_beyond(std::size_t i) const noexcept
    {
        return sign_[i] * g1_[i] <= 0 && sign_[i] != 0 && rules_.screening != Screening::own;
    }

    /// Guards that need a search, in ascending order, as `begin_search` found them.
    [[nodiscard]] std::span<const std::size_t> suspects() const noexcept
    {
        return suspects_.span();
    }

    /// Whether guard i may leave its side inside the step without a trace at the ends.
    [[nodiscard]] bool hides(std::size_t i, double h) const noexcept
    {
        const CubicCheck look = cubic(i, h);
        return !(look.lowest(sign_[i]) > CubicCheck::most * deviation(look, i, h));
    }

    /// Whether guard i agrees in the step with the cubic through its ends, as far as it has
    /// been evaluated. @param e  its `departure`
    [[nodiscard, gnu::always_inline]] bool is_plain(std::size_t i, double h,
                                                    double e) const noexcept
    {
        if (has_series(i)) return false;
        return !checked() || e <= tolerances::of_plain_cubic * cubic(i, h).size();
    }

    /// Largest deviation found of guard i in the step from the cubic through its ends; infinite if
    /// none has been sought.
    [[nodiscard, gnu::always_inline]] double departure(std::size_t i, double h) const noexcept
    {
        return checked() ? deviation(cubic(i, h), i, h) : std::numeric_limits<double>::infinity();
    }
    /// Whether such a deviation moves a root of guard i by less than `straight_part` of the step.
    [[nodiscard, gnu::always_inline]] bool is_cubic(std::size_t i, double e) const noexcept
    {
        return e <= tolerances::of_cubic_root * std::fabs(g1_[i] - g0_[i]);
    }

    /// Whether the guards have been evaluated inside the step.
    [[nodiscard]] bool checked() const noexcept { return checked_ != Checked::not_at_all; }

    /// Takes note of whether the bounds of guard i show an event inside the step.
    void note_dip(std::size_t i, bool dips) noexcept
    {
        records_[i].examined.dips = dips;
        dips_ = dips_ || dips;
        forget_screening();
    }
    void forget_dips() noexcept { dips_ = false; }

    /// Whether one of the `suspects` remains suspect after the findings of the search so far.
    [[nodiscard]] bool still_suspicious(std::size_t i, double h) const noexcept
    {
        return as_screened_ || suspicious(i, h);
    }

    [[nodiscard]] bool suspicious(std::size_t i, double h) const noexcept
    {
        if (sign_[i] == 0) return false;
        if (!single && records_[i].examined.dips) return true;
        if (has_series(i)) return !is_clear_of_series(i, h);
        if (ends_beyond(i)) return true;
        const double tolerance =
            sign_[i] * records_[i].info.touch;  // worth a check if it is reached
        const bool suspected = with_screen([&](auto screen) __attribute__((always_inline)) {
            return screen.suspects(sign_[i], {.value = g0_[i] - tolerance, .rate = rate0_[i]},
                                   {.s = h, .value = g1_[i] - tolerance, .rate = rate1_[i]});
        });
        return suspected || !is_finite(g1_[i]) || (checked() && hides(i, h));
    }

    /// The first guard that is not finite at the end of the step, or `no_guard`.
    [[nodiscard]] std::size_t first_not_finite() const noexcept
    {
        if (!any_of([this](std::size_t i)
                        __attribute__((always_inline)) { return !is_finite(g1_[i]); })) {
            return no_guard;
        }
        for (std::size_t i = 0; i < size(); ++i) {
            const bool idle = !records_[i].enabled || records_[i].deferred;
            if (!idle && !std::isfinite(g1_[i])) return i;
        }
        return no_guard;
    }

    /// The first guard whose rate at an end of the step is asked for and not finite, or `no_guard`.
    [[nodiscard]] std::size_t first_without_rate() const noexcept
    {
        if (!rules_.uses_rates) return no_guard;
        for (std::size_t i = 0; i < size(); ++i) {
            const GuardRecord& record = records_[i];
            if (!record.enabled || record.deferred || record.info.boolean) continue;
            if (!std::isfinite(rate0_[i]) || !std::isfinite(rate1_[i])) return i;
        }
        return no_guard;
    }

    /// Whether guard i, on a plateau, has its event in the step, or is NaN at the end of the step.
    [[nodiscard]] bool leaves_plateau(std::size_t i) const noexcept
    {
        const GuardRecord& record = records_[i];
        if (record.side != Side::plateau || !record.enabled || record.deferred) return false;
        if (!std::isfinite(g1_[i])) return true;
        return record.awaited != Side::plateau && side_of(g1_[i]) == opposite(record.awaited) &&
               counts(record.awaited, record.info.crossing);
    }

protected:
    using Guards::at_rest_;
    using Guards::records_;
    using Guards::rules_;
    using Guards::sample_values;
    using Guards::system_;

    /// Places in the current step at which the guards have been evaluated.
    enum class Checked : std::uint8_t { not_at_all, inside, further, everywhere };

    [[gnu::noinline]] bool leaves_plateau() const noexcept
    {
        for (std::size_t i = 0; i < size(); ++i) {
            if (leaves_plateau(i)) return true;
        }
        return false;
    }

    class OwnScreen {
    public:
        explicit OwnScreen(Suspects* function) noexcept : function_(function) {}

        [[nodiscard, gnu::always_inline]] bool suspects(double sign, const GuardSample& start,
                                                        const GuardSample& end) const
        {
            return ask(function_, sign, {start.value, start.rate}, {end.value, end.rate}, end.s);
        }

    private:
        /// Takes numbers, which are in registers: samples in memory, for a function that is not
        /// inlined, would burden the callers for the sake of detectors that are rarely used.
        [[nodiscard, gnu::noinline]] static bool ask(Suspects* function, double sign,
                                                     GuardPoint start, GuardPoint end, double h)
        {
            return function(sign, {.s = 0, .value = start.value, .rate = start.rate},
                            {.s = h, .value = end.value, .rate = end.rate});
        }

        Suspects* function_;
    };

    /// Calls `use` with the detector's own screening function, inlined.
    template <class Use>
    [[gnu::always_inline]] auto with_screen(const Use& use) const
    {
        switch (rules_.screening) {
            case Screening::ends: return use(Ends{});
            case Screening::extremum: return use(Extremum{});
            case Screening::every: return use(Bernstein{});
            case Screening::own: break;
        }
        return use(OwnScreen{rules_.suspects});
    }

    /// Number of guards that are screened together: if one of them is suspected, each of them is
    /// examined.
    static constexpr std::size_t block = 16;
    [[nodiscard]] bool are_few() const noexcept { return size() < block; }

    /// Whether `condition`, which has no branches, holds for a guard.
    template <class Condition>
    [[nodiscard, gnu::always_inline]] bool any_of(const Condition& condition) const noexcept
    {
        double any = 0;  // a double, so that the loop is vectorised
        for (std::size_t i = 0; i < size(); ++i) any = condition(i) ? 1.0 : any;
        return any != 0;
    }

    /// Calls `visit(i)` for the guards for which `condition`, which has no branches, holds, in
    /// ascending order.
    template <class Condition, class Visit>
    [[gnu::always_inline]] void for_each_that(const Condition& condition, const Visit& visit) const
    {
        std::size_t first = 0;
        for (; first + block <= size(); first += block) {
            std::array<double, block> holds;  // doubles, so that the loop is vectorised
            double any = 0;
            for (std::size_t k = 0; k < block; ++k) {
                holds[k] = condition(first + k) ? 1.0 : 0.0;
                any = holds[k] != 0 ? 1.0 : any;
            }
            if (any == 0) continue;
            for (std::size_t k = 0; k < block; ++k) {
                if (holds[k] != 0) visit(first + k);
            }
        }
        for (; first < size(); ++first) {
            if (condition(first)) visit(first);
        }
    }

    [[nodiscard, gnu::always_inline]] CubicCheck cubic(std::size_t i, double h) const noexcept
    {
        return {g0_[i], rate0_[i], g1_[i], rate1_[i], h};
    }

    /// Whether guard i needs a search by its values at the ends of the step.
    template <class Screen>
    [[nodiscard, gnu::always_inline]] auto shows(const Screen& screen, double h) const noexcept
    {
        return [ this, screen, h ](std::size_t i) __attribute__((always_inline))
        {
            const bool suspected = screen.suspects(sign_[i], {.value = g0_[i], .rate = rate0_[i]},
                                                   {.s = h, .value = g1_[i], .rate = rate1_[i]});
            const bool armed = sign_[i] != 0;
            return suspected & armed;
        };
    }

    /// Whether guard i may leave its side if deviations are `factor` times as large as at
    /// the part `u`, where the guards are `values`.
    [[nodiscard, gnu::always_inline]] auto strays(double h, double u, double factor,
                                                  const Doubles& values) const noexcept
    {
        return [ this, h, u, factor, &values ](std::size_t i) __attribute__((always_inline))
        {
            const CubicCheck look = cubic(i, h);
            const bool clear = look.lowest(sign_[i]) > factor * look.deviation(u, values[i]);
            const bool armed = sign_[i] != 0;
            return !clear & armed;
        };
    }

    /// Whether guard i needs a second evaluation inside the step, or a search.
    template <class Screen>
    [[nodiscard, gnu::always_inline]] auto in_doubt(const Screen& screen, double h) const noexcept
    {
        return [
            shows = shows(screen, h),
            strays = strays(h, CubicCheck::inside, CubicCheck::doubt, inside_)
        ](std::size_t i) __attribute__((always_inline))
        {
            const bool shown = shows(i);
            const bool strayed = strays(i);
            return shown | strayed;
        };
    }

    /// Forgets the screening, after a change of the step or of its guards.
    void forget_screening() noexcept { screened_ = marked_ = false; }

    /// Finds the guards in doubt.
    RICOCHET_WIDE void mark(double h) noexcept
    {
        marks_.clear();
        marked_ = true;
        with_screen([&](auto screen) __attribute__((always_inline)) {
            for_each_that(in_doubt(screen, h), [this](std::size_t i) { marks_.push_back(i); });
        });
    }

    /// Marks every guard for a search, if that is known to be needed.
    void suspect_all() noexcept
    {
        suspects_.clear();
        for (std::size_t i = 0; i < size(); ++i) suspects_.push_back(i);
        screened_ = as_screened_ = true;
    }

    /// Finds the guards that need a search.
    [[gnu::noinline]] void screen(double h) noexcept
    {
        suspects_.clear();
        screened_ = as_screened_ = true;
        if (are_few() || touches_ || dips_ || series_.coefficients) {
            for (std::size_t i = 0; i < size(); ++i) add_if_suspicious(i, h);
            return;
        }
        if (checked()) {
            // A guard that needs a search is in doubt already, or deviates elsewhere.
            if (!marked_) mark(h);
            if (checked_ == Checked::inside)
                return screen_marked(h, [](std::size_t) { return false; });
            if (checked_ == Checked::further) {
                return screen_marked(h, strays(h, CubicCheck::further, CubicCheck::most, further_));
            }
            return screen_marked(
                h, [ this, h ](std::size_t i) __attribute__((always_inline)) {
                    const bool clear = cubic(i, h).lowest(sign_[i]) > CubicCheck::most * worst_[i];
                    const bool armed = sign_[i] != 0;
                    return !clear & armed;
                });
        }
        marks_.clear();
        with_screen([&](auto screen) __attribute__((always_inline)) {
            const auto condition =
                [ this, shows = shows(screen, h) ](std::size_t i) __attribute__((always_inline))
            {
                const bool shown = shows(i);
                const bool armed = sign_[i] != 0;
                const bool lost = !is_finite(g1_[i]);
                return shown | (lost & armed);
            };
            if (any_of(condition)) screen_marked(h, condition);
        });
    }

    /// Visits each guard that is marked, or for which `condition` holds.
    template <class Condition>
    [[gnu::always_inline]] void screen_marked(double h, const Condition& condition) noexcept
    {
        const std::size_t* mark = marks_.begin();
        const std::size_t* const end = marks_.end();
        for_each_that(condition, [&](std::size_t i) {
            for (; mark != end && *mark <= i; ++mark) {
                if (*mark < i) add_if_suspicious(*mark, h);
            }
            add_if_suspicious(i, h);
        });
        for (; mark != end; ++mark) add_if_suspicious(*mark, h);
    }

    void add_if_suspicious(std::size_t i, double h) noexcept
    {
        if (suspicious(i, h)) suspects_.push_back(i);
    }

    [[nodiscard]] static constexpr bool is_finite(double g) noexcept
    {
        return std::fabs(g) <= std::numeric_limits<double>::max();
    }

    /// Largest deviation found of guard i from the cubic through its ends.
    [[nodiscard]] double deviation(const CubicCheck& look, std::size_t i, double h) const noexcept
    {
        const double e = deviation(look, i, h, CubicCheck::inside, inside_[i]);
        if (checked_ == Checked::inside) return e;
        const double other = checked_everywhere()
                                 ? worst_[i]
                                 : deviation(look, i, h, CubicCheck::further, further_[i]);
        return other <= e ? e : other;  // NaN stays
    }

    /// Deviation of guard i from its cubic `look` at the part `u`, where it is `value`.
    [[nodiscard]] double deviation(const CubicCheck& look, std::size_t i, double h, double u,
                                   double value) const noexcept
    {
        const double e = look.deviation(u, value);
        return is_finite(e) ? e : deviation_of_large(i, h, u, value);
    }
    [[nodiscard, gnu::noinline]] double deviation_of_large(std::size_t i, double h, double u,
                                                           double value) const noexcept
    {
        constexpr double unit = CubicCheck::large_unit;
        const CubicCheck look(g0_[i] / unit, rate0_[i] / unit, g1_[i] / unit, rate1_[i] / unit, h);
        return unit * look.deviation(u, value / unit);
    }

    /// Whether the series of guard i proves that the guard stays on the side that it ends on.
    [[nodiscard, gnu::noinline]] bool is_clear_of_series(std::size_t i, double h) const noexcept
    {
        const double touch = records_[i].info.touch;
        const bool departs = records_[i].departs && starts_phase_;
        if (records_[i].examined.from > 0 || !(sign_[i] * g1_[i] > touch)) return false;
        if (!departs && sign_[i] * g0_[i] < 0) return false;
        const GuardSeries guard{.terms = series_,
                                .which = i,
                                .h = h,
                                .sign = sign_[i],
                                .from_surface = starts_on_surface(i),
                                .touch = touch};
        return series_clears(guard) || series_clears_closely(guard);
    }

    SeriesTerms series_;
    bool starts_phase_ = false;
    bool waiting_ = false;      ///< whether any guard may be on a plateau
    bool touches_ = false;      ///< whether any guard declares a tolerance for touches
    bool signs_ = false;        ///< whether only the sign of any guard has a meaning
    bool of_time_ = true;       ///< whether all guards are of degree 3 or less
    bool linear_ = true;        ///< whether all guards are of degree 1, and are screened as such
    bool dips_ = false;         ///< whether the bounds of any guard show an event in the step
    bool screened_ = false;     ///< whether `suspects_` belongs to the current step
    bool as_screened_ = false;  ///< and no guard has changed since then
    // A value does not lie beside its rate: both are written one by one, see `HostStepTable`.
    Doubles sign_{}, g0_{}, g1_{}, rate0_{}, rate1_{};
    Checked checked_ = Checked::not_at_all;
    bool marked_ = false;  ///< whether `marks_` belongs to the current step
    Doubles inside_{}, further_{};
    Doubles worst_{};  ///< deviations at further evaluations
    GuardList<std::size_t, single> suspects_;
    GuardList<std::size_t, single> marks_;  ///< guards in doubt
};

}  // namespace ricochet::detail
