// All guards of a system at the ends of a step.
//
// Data that every step needs for every guard lie in plain arrays, so that a hundred guards
// are screened in one loop; data that only events need lie beside them.
#pragma once

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>

#include "core/screened_guards.hpp"
#include "core/step.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/cubic_check.hpp"
#include "ricochet/detail/quiet_run.hpp"
#include "ricochet/detail/system_table.hpp"
#include "ricochet/finding.hpp"
#include "ricochet/guard.hpp"

namespace ricochet::detail {

template <class X, bool single>
class GuardTable : public ScreenedGuards<X, single> {
    using Guards = ScreenedGuards<X, single>;
    using typename Guards::Doubles;

public:
    using Guards::heed_enabled;
    using Guards::size;
    using Guards::view;

    GuardTable(const SystemAt<X>& system, const GuardRules& rules, bool backward)
        : Guards(system, rules, backward),
          keeps_rows_(size() > 1 || system->moded),
          timed_(system->timed())
    {
        if (rules.keeps_sizes()) sizes_.resize(size());
        if (keeps_armed()) armed_g_.resize(size());
    }

    /// Forgets the past of the guards, except for the numbers of their events.
    void forget() noexcept
    {
        for (GuardRecord& record : records_) {
            GuardRecord fresh;
            fresh.info = record.info;
            fresh.acting = record.acting;
            fresh.events = record.events;
            record = fresh;
        }
        for (double& rests : at_rest_) rests = 0;
        for (double& size : sizes_) size = 0;
        row_ = {};
        waiting_ = false;
        forget_screening();
        checked_ = Checked::not_at_all;
    }

    [[nodiscard]] bool checks_inside() const noexcept { return rules_.checks_inside; }
    [[nodiscard]] bool backward() const noexcept { return backward_; }

    [[nodiscard]] static SamplePoint<X> start_of(const Step<X>& step, double scale)
    {
        return {{step.mode(), step.time(0), step.x0(), step.rate0()}, scale};
    }
    /// As `start_of`, with the rate that the step had before it was taken.
    [[nodiscard]] static SamplePoint<X> arrival_of(const Step<X>& step, double scale)
    {
        return {{step.mode(), step.time(0), step.x0(), step.kept_rate()}, scale};
    }
    [[nodiscard]] static SamplePoint<X> end_of(const Step<X>& step)
    {
        return {{step.mode(), step.time(step.h()), step.x1(), step.rate1()}, step.h()};
    }

    /// Samples all guards at the start of a step.
    void sample_start(const Step<X>& step, std::uint64_t& calls, double scale)
    {
        if (rules_.defers) {
            sample_values(step.mode(), step.time(0), step.x0(), calls, g0_);
            for (std::size_t i = 0; i < size(); ++i) {
                rate0_[i] = std::numeric_limits<double>::quiet_NaN();  // until a rate is needed
                records_[i].deferred = false;
            }
        } else {
            sample(start_of(step, scale), calls, g0_, rate0_);
        }
        if (rules_.keeps_sizes()) {
            for (std::size_t i = 0; i < size(); ++i) {
                // The value next to a pole is no measure of the size of a guard.
                if (records_[i].fired && records_[i].last.jumped) continue;
                sizes_[i] = std::fmax(std::fabs(g0_[i]), sizes_[i]);
            }
        }
    }

    /// Makes all guards examined again from the next step on. `sampled`: they have just been armed,
    /// so that their values are known, and the rates of those that have left their surfaces, which
    /// are not always those of the flow.
    void wake_all(const Step<X>& step, double scale, std::uint64_t& calls, bool sampled)
    {
        if (!sampled) sample_values(step.mode(), step.time(0), step.x0(), calls, g0_);
        sample_rates(arrival_of(step, scale), calls, sampled ? rate1_ : rate0_);
        for (std::size_t i = 0; sampled && i < size(); ++i) {
            if (std::isnan(rate0_[i])) rate0_[i] = rate1_[i];
        }
        for (std::size_t i = 0; i < size(); ++i) {
            records_[i].deferred = false;
            arm(i, records_[i].side);
        }
    }

    /// Samples all guards at the end of a step.
    void sample_end(const Step<X>& step, std::uint64_t& calls)
    {
        sample(end_of(step), calls, g1_, rate1_);
        forget_screening();
    }

    /// Whether the guards, evaluated again at the end of the step, have the values that they had
    /// there before. Guards whose checks are deferred are not evaluated.
    [[nodiscard]] bool end_alike(const Step<X>& step, std::uint64_t& calls)
    {
        const double t = step.time(step.h());
        for (std::size_t i = 0; i < size(); ++i) {
            if (records_[i].deferred || !records_[i].enabled || std::isnan(g1_[i])) continue;
            if (view(i, step.mode(), calls).value(t, step.x1()) != g1_[i]) return false;
        }
        return true;
    }

    /// As `sample_end`, without rates.
    void sample_values_at_end(const Step<X>& step, std::uint64_t& calls)
    {
        sample_values(step.mode(), step.time(step.h()), step.x1(), calls, g1_);
        leave_rates_out();
        forget_screening();
    }
    /// Samples the rates at both ends of the step that were left out.
    void complete_rates(const Step<X>& step, std::uint64_t& calls)
    {
        if (!std::exchange(rates_left_out_, false)) return;
        for (std::size_t i = 0; i < size(); ++i) {
            if (std::isnan(rate0_[i])) rate0_[i] = rate_at(i, start_of(step, step.h()), calls);
            rate1_[i] = rate_at(i, end_of(step), calls);
        }
    }

    /// Whether the values and rates of the guard alone decide whether a step holds events.
    [[nodiscard]] bool is_steady() const noexcept
    {
        if (size() == 0) return true;
        return single && sign_[0] != 0 && !waiting_ && !touches_ && !selective_;
    }
    /// @param t  [s] start of the next step
    void lend(QuietRun& run, double t) const noexcept
    {
        if (size() == 0) return;
        run.departs = records_[0].departs && t == armed_at_;
        run.sign = sign_[0];
        run.g0 = g0_[0];
        run.rate0 = rate0_[0];
    }
    /// Takes the guard over from a quiet run: its samples at the start of the current step, at the
    /// end and inside.
    void take_back(const QuietRun& run, const Step<X>& step, std::uint64_t& calls)
    {
        if (size() == 0) return;
        g0_[0] = run.g0;
        rate0_[0] = run.rate0;
        g1_[0] = run.g1;
        rate1_[0] = run.rate1;
        const bool stands = run.why == QuietEnd::doubt || run.why == QuietEnd::moving;
        if (stands && !std::isfinite(run.rate1)) {
            rate1_[0] = rate_at(0, end_of(step), calls);
        }
        forget_screening();
        if (!run.checks_inside) return;
        inside_[0] = run.inside;
        checked_ = Checked::inside;
    }

    /// Starts a smooth phase at time t, whether or not guards are on their surfaces.
    void begin_phase(double t) noexcept { armed_at_ = t; }

    /// As `take_back`, for a run on power series: the guard has not been cleared.
    void take_back_on_series(const QuietRun& run, const Step<X>& step)
    {
        if (size() == 0) return;
        g0_[0] = run.g0;
        rate0_[0] = run.rate0;
        g1_[0] = run.g1;
        leave_rates_out();
        see_series(step);
        this->suspect_all();
    }

    /// The guards are power series over the current step, if all of these have converged.
    void see_series(const Step<X>& step)
    {
        this->see(step.guard_series(), step.time(0) == armed_at_);
        if (!this->series_converge(step.h())) this->see({}, false);
    }

    /// The guards are power series over each step from here on, where the step gives them and the
    /// detector `may_use_series`; not yet over the current one.
    void await_series(const Step<X>& step)
    {
        this->see({}, false);
        expects_series_ = may_use_series_ && step.has_guard_series();
    }
    void await_series(const Step<X>& step, bool may_use_series)
    {
        may_use_series_ = may_use_series;
        await_series(step);
    }
    [[nodiscard]] bool expects_series() const noexcept { return expects_series_; }

    /// Part of the step that has not been examined for guard i; `end` is the sample at its end.
    [[nodiscard]] Watch watch(std::size_t i, const Step<X>& step, const GuardSample& end) const
    {
        const GuardRecord& record = records_[i];
        return {.side = record.side,
                .start = start(i),
                .end = end,
                .touch = touch(i, step.h()),
                .scale = scale(i, step.h()),
                .departs = departs(record, step)};
    }

    [[nodiscard]] GuardSample start(std::size_t i) const noexcept
    {
        return {.s = records_[i].examined.from, .value = g0_[i], .rate = known(rate0_[i])};
    }
    [[nodiscard]] GuardSample end(std::size_t i, double h) const noexcept
    {
        return {.s = h, .value = g1_[i], .rate = known(rate1_[i])};
    }

    /// Event tolerance: |g| up to which a guard with a rate of zero counts as being on its surface,
    /// from the rounding of its values in the step. The rounding of the state is added where it
    /// matters (`StepProbe::rounding`).
    [[nodiscard]] double touch(std::size_t i, double h) const noexcept
    {
        return touch_of(i, rules_.remembers ? sizes_[i] : scale(i, h));
    }

    /// Same tolerance as `touch`, for an interval in which |g| reaches `largest`.
    [[nodiscard]] double touch_of(std::size_t i, double largest) const noexcept
    {
        constexpr double ulps = tolerances::of_location;
        return larger(records_[i].info.touch, ulps * largest);
    }

    /// Whether guard i starts the step on the surface where it has fired.
    [[nodiscard]] bool starts_at_event(std::size_t i, const Step<X>& step) const noexcept
    {
        const GuardRecord& record = records_[i];
        return departs(record, step) && std::fabs(g0_[i]) <= record.tolerance;
    }

    /// The largest |g| that the ends of a step of length h suggest.
    [[nodiscard]] double scale(std::size_t i, double h) const noexcept
    {
        const double ends = larger(std::fabs(g0_[i]), std::fabs(g1_[i]));
        if (!rules_.uses_rates) return ends;
        return larger(ends, larger(std::fabs(g0_[i] + rate0_[i] * (h / 3)),
                                   std::fabs(g1_[i] - rate1_[i] * (h / 3))));
    }

    /// As `scale`, for a guard that has just been sampled at the start of a step. A guard with
    /// bounds may have been deferred, and its other samples may belong to an earlier step: its
    /// largest value so far is used instead.
    [[nodiscard]] double armed_scale(std::size_t i, double h) const noexcept
    {
        return rules_.bounded ? sizes_[i] : scale(i, h);
    }

    void arm(std::size_t i, Side side) noexcept
    {
        assert(i < size());
        GuardRecord& record = (*this)[i];
        if (side == record.last.side && record.side == opposite(side)) record.last.returned = true;
        record.side = side;
        if constexpr (!single) {
            any_stands_ = any_stands_ || (side == Side::plateau && size() > 1);
        }
        sign_[i] = records_[i].enabled && !records_[i].deferred ? sign_of(side) : 0;
        as_screened_ = false;
    }

    /// Arms a guard that a set has left as it was, on the side on which it is by more than its
    /// event tolerance, as most of many guards are. Returns false, and does nothing, for others.
    [[nodiscard]] bool stays_armed(std::size_t i) noexcept
    {
        GuardRecord& record = records_[i];
        const double g = g0_[i];
        const bool as_before = !record.fired && !record.newly_enabled && side_of(g) == record.side;
        const bool clear = std::fabs(g) > record.tolerance && std::isfinite(g);
        const bool kept_out = record.info.unilateral && record.side == Side::below;
        if (!(as_before && clear) || kept_out) return false;
        record.estimated = false;
        record.departs = false;
        record.examined.from = 0;
        arm(i, record.side);
        if constexpr (!single) at_rest_[i] = record.tolerance == 0 && !record.deferred ? 1 : 0;
        return true;
    }

    /// Calls `visit(i)`, in ascending order, for the guards that have to be armed again with their
    /// samples at the start: all except those at rest that are still on their sides.
    template <class Visit>
    void for_each_to_arm(const Visit& visit)
    {
        as_screened_ = false;
        if constexpr (single) {
            visit(0);
        } else {
            this->for_each_that(
                [this](std::size_t i) __attribute__((always_inline)) {
                    const bool stays = at_rest_[i] * sign_[i] * g0_[i] > 0;
                    return !(stays & Guards::is_finite(g0_[i]));
                },
                visit);
        }
    }

    /// Forgets which guards have fired, and how far from their surfaces.
    void forget_fired() noexcept
    {
        for_each_not_at_rest([](GuardRecord& record) { record.fired = false; });
    }
    /// Makes the event tolerances those that have been noted for the set, or zero.
    void take_tolerances() noexcept
    {
        for_each_not_at_rest([](GuardRecord& record) {
            record.tolerance = std::exchange(record.noted.tolerance, 0);
        });
    }

    /// A guard as it is in the middle of a search, to be put back.
    struct Kept {
        std::size_t guard;
        GuardRecord record;
        double g0, rate0;
    };
    [[nodiscard]] Kept keep(std::size_t i) const { return {i, records_[i], g0_[i], rate0_[i]}; }
    void put_back(const Kept& kept)
    {
        records_[kept.guard] = kept.record;
        g0_[kept.guard] = kept.g0;
        rate0_[kept.guard] = kept.rate0;
        arm(kept.guard, kept.record.side);
    }

    /// Width [s] below which a bracket in a step of length h is dominated by the guard's
    /// rounding, for guards whose brackets are not narrowed further; else 0.
    [[nodiscard]] double unresolved(std::size_t i, double h) const noexcept
    {
        if (!rules_.coarse) return 0;
        const double size = std::fmax(sizes_[i], std::fmax(std::fabs(g0_[i]), std::fabs(g1_[i])));
        const double rate = std::fmin(std::fabs(rate0_[i]), std::fabs(rate1_[i]));
        const double width = tolerances::of_time * size / rate;
        return width <= 1e-10 * h ? width : 1e-10 * h;
    }

    /// Defers guard i, which is not examined until it is woken.
    void put_to_sleep(std::size_t i) noexcept
    {
        (*this)[i].deferred = true;
        sign_[i] = 0;
    }

    /// Wakes guard i in the current step, with its samples at both ends.
    void wake(std::size_t i, const GuardSample& start, const GuardSample& end) noexcept
    {
        records_[i].deferred = false;
        forget_screening();
        g0_[i] = start.value;
        rate0_[i] = start.rate;
        g1_[i] = end.value;
        rate1_[i] = end.rate;
        arm(i, records_[i].side);
    }

    /// Starts the search of a step. A search changes the guards of `suspects` only;
    /// all other guards are at the end of the step as they were at its start.
    void begin_search(double h) noexcept
    {
        // A guard that wakes or leaves its plateau has to be screened again.
        if (rules_.defers || waiting_) forget_screening();
        if (!screened_) screen(h);
        for (const std::size_t i : suspects_) records_[i].examined.next = records_[i].side;
    }

    /// Continues the guard from `start` inside the step, on `side`.
    void go_on_from(std::size_t i, Side side, const GuardSample& start) noexcept
    {
        assert(start.s >= records_[i].examined.from);
        arm(i, side);
        records_[i].examined.next = side;
        records_[i].examined.from = start.s;
        records_[i].examined.slope = std::numeric_limits<double>::quiet_NaN();
        g0_[i] = start.value;
        rate0_[i] = start.rate;
    }

    /// Makes the end of a clear step the start of the next.
    void pass_on() noexcept
    {
        if (rules_.remembers) {
            for (std::size_t i = 0; i < size(); ++i) {
                sizes_[i] = std::fmax(std::fabs(g1_[i]), sizes_[i]);
            }
        }
        const auto on_plateau = [this](std::size_t i) __attribute__((always_inline))
        {
            return sign_[i] == 0;
        };
        const bool plateaus = are_few() || any_of(on_plateau);
        hand_over(g1_, g0_);
        if (rules_.uses_rates) hand_over(rate1_, rate0_);
        if (!plateaus) return;
        for (std::size_t i = 0; i < size(); ++i) leave_plateau(i, g0_[i]);
    }

    /// Arms a guard on a plateau on its side at the end of the step.
    void leave_plateau(std::size_t i) noexcept { leave_plateau(i, g1_[i]); }

    /// Same as `pass_on`, after events inside the step.
    void pass_on_after_events() noexcept
    {
        for (const std::size_t i : suspects_) {
            records_[i].examined.from = 0;
            arm(i, records_[i].examined.next);
        }
        pass_on();
    }

    /// Rate [1/s] of a guard at the start of the step.
    [[nodiscard]] double complete_rate0(std::size_t i, const Step<X>& step, double scale,
                                        std::uint64_t& calls)
    {
        if (records_[i].info.boolean) return rate0_[i] = 0;
        const auto guard = view(i, step.mode(), calls);
        rate0_[i] = guard.rate(step.time(0), step.x0(), step.rate0(), scale);
        return rate0_[i];
    }

    [[nodiscard]] double g1(std::size_t i) const noexcept { return g1_[i]; }
    // --- rows of lost excursions ---

    /// Whether events of several guards, or in several modes, may accumulate together.
    [[nodiscard]] bool keeps_rows() const noexcept { return keeps_rows_; }
    /// Whether the values are known that the guards were armed with.
    [[nodiscard]] bool keeps_armed() const noexcept { return keeps_rows_ || timed_; }
    [[nodiscard]] LostRow& row() noexcept { return row_; }
    /// Keeps the values of the guards at the start of the step, after an acting instant.
    void keep_armed_values() noexcept
    {
        if (!keeps_armed()) return;
        for (std::size_t i = 0; i < size(); ++i) armed_g_[i] = g0_[i];
    }
    /// Guard i right after the last acting instant.
    [[nodiscard]] double armed_value(std::size_t i) const noexcept { return armed_g_[i]; }

    /// [s] where guards were armed last.
    [[nodiscard]] double armed_at() const noexcept { return armed_at_; }

    [[nodiscard]] double g0(std::size_t i) const noexcept { return g0_[i]; }
    [[nodiscard]] double rate0(std::size_t i) const noexcept { return rate0_[i]; }
    void set_rate0(std::size_t i, double rate) noexcept { rate0_[i] = rate; }

    /// Calls `visit` with every number that is carried from step to step.
    template <class Visit>
    void visit(Visit&& visit)
    {
        for (std::size_t i = 0; i < size(); ++i) {
            GuardRecord& record = (*this)[i];
            visit(sign_[i]);
            if (rules_.keeps_sizes()) visit(sizes_[i]);
            visit(g0_[i]);
            visit(rate0_[i]);
            visit(record.enabled);
            visit(record.side);
            visit(record.events);
            visit(record.last.t);
            visit(record.last.side);
            visit(record.last.returned);
            visit(record.tolerance);
            visit(record.departure.turned);
            visit(record.departs);
            visit(record.awaited);
            if (rules_.defers) visit(record.deferred);
            record.intervals.visit(visit);
            if (keeps_rows_) record.excursions.visit(visit);
            if (keeps_armed()) visit(armed_g_[i]);
        }
        if (keeps_rows_) row_.visit(visit);
        visit(waiting_);
        if (size() > 1) visit(any_stands_);
        visit(armed_at_);
        heed_enabled();
    }

    /// Puts guard i on a plateau; its event is to leave the plateau away from `side`.
    void await(std::size_t i, Side side) noexcept
    {
        records_[i].awaited = side;
        waiting_ = true;
    }
    /// Before all guards that may be on a plateau are armed again.
    void await_none() noexcept { waiting_ = any_stands_ = false; }
    /// Whether any guard has been armed on a plateau since then.
    [[nodiscard]] bool any_stands() const noexcept { return any_stands_; }
    [[nodiscard]] bool waiting() const noexcept { return waiting_; }

private:
    [[nodiscard]] bool departs(const GuardRecord& record, const Step<X>& step) const noexcept
    {
        return record.departs && record.examined.from == 0 && step.time(0) == armed_at_;
    }

    template <class Change>
    void for_each_not_at_rest(const Change& change) noexcept
    {
        if constexpr (single) {
            change(records_[0]);
        } else {
            this->for_each_that(
                [this](std::size_t i) __attribute__((always_inline)) { return at_rest_[i] == 0; },
                [&](std::size_t i) { change(records_[i]); });
        }
    }

    /// As std::fmax, but inlined: the larger of the two, or the one that is a number.
    [[nodiscard]] static double larger(double a, double b) noexcept
    {
        return a >= b || std::isnan(b) ? a : b;
    }

    void leave_rates_out() noexcept
    {
        rates_left_out_ = true;
        for (std::size_t i = 0; i < size(); ++i) {
            rate1_[i] = std::numeric_limits<double>::quiet_NaN();
        }
    }
    [[nodiscard]] double rate_at(std::size_t i, const SamplePoint<X>& at, std::uint64_t& calls)
    {
        return records_[i].enabled ? this->rate_of(i, at, calls) : 0;
    }

    using Guards::any_of;
    using Guards::are_few;
    using Guards::as_screened_;
    using Guards::at_rest_;
    using Guards::backward_;
    using Guards::checked_;
    using Guards::forget_screening;
    using Guards::g0_;
    using Guards::g1_;
    using Guards::inside_;
    using Guards::rate0_;
    using Guards::rate1_;
    using Guards::records_;
    using Guards::rules_;
    using Guards::sample;
    using Guards::sample_rates;
    using Guards::sample_values;
    using Guards::screen;
    using Guards::screened_;
    using Guards::selective_;
    using Guards::sign_;
    using Guards::suspects_;
    using Guards::system_;
    using Guards::touches_;
    using Guards::waiting_;
    using typename Guards::Checked;

    /// Exchanges the samples at the end of a step with those at its start.
    void hand_over(Doubles& from, Doubles& to) const noexcept
    {
        // Few numbers lie in the vectors, whose exchange takes longer than a copy.
        if (size() > few_guards && !rules_.defers) {
            from.swap(to);
        } else {
            for (std::size_t i = 0; i < size(); ++i) to[i] = from[i];
        }
    }

    void leave_plateau(std::size_t i, double g) noexcept
    {
        if (sign_[i] == 0 && records_[i].enabled && !records_[i].deferred) arm(i, side_of(g));
    }

    [[nodiscard]] double known(double rate) const noexcept
    {
        return rules_.uses_rates ? rate : std::numeric_limits<double>::quiet_NaN();
    }

    bool rates_left_out_ = false;  ///< at the end of the current step
    bool may_use_series_ = false, expects_series_ = false;
    double armed_at_ = std::numeric_limits<double>::quiet_NaN();  ///< [s]
    Doubles sizes_{};
    Doubles armed_g_{};
    LostRow row_;
    bool keeps_rows_, timed_;
    bool any_stands_ = false;
};

}  // namespace ricochet::detail
