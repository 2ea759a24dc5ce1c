// Closing of an interval of steps that were taken without a check.
#pragma once

#include "core/planner.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline std::size_t Planner<X, single>::close_one(std::size_t i, const Step<X>& step, Guards& guards,
                                                 Statistics& counts, double h_next)
{
    LastCheck& known = checks_[i];
    if (never_sleeps(guards[i]) || known.unclear) return steps_.size() - 1;
    Check from = last_check(i);
    Check end;
    const auto bounded = bound_at(i, steps_.size(), step, guards, counts);
    if (bounded) end = *bounded;
    if (bounded && closes(guards, i, from, end) &&
        detector_->sure(self_, end.bound, tolerance_of(guards, i, end.value, end.value)) >=
            h_next) {
        if (detector_->checks_bounds && ++lower_bounds_used_ % 8 == 0) {
            (void)check_at(i, steps_.size(), step, guards, counts);
        }
        plan_after(i, known, end, step.mode(), guards);
        return none;
    }
    end = check_at(i, steps_.size(), step, guards, counts);
    const bool may_tie = ties(step, from.value, end.value);
    std::size_t failed = narrow({i, step, guards, counts}, from, known.first, steps_.size(), end);
    if (may_tie && failed == none) {
        failed = steps_.size() - 1;
        failing_value_ = end.value;
    }
    const bool moved = from.time != known.time || failed == none;
    const double rate = known.rate;
    if (failed != none) remember(known, place(failed + 1, step).time, failing_value_);
    if (moved) plan_after(i, known, failed == none ? end : from, step.mode(), guards);
    if (!moved) known.rate = rate;
    return failed;
}

template <class X, bool single>
inline std::size_t Planner<X, single>::narrow(const Closing& on, Check& from, std::size_t lo,
                                              std::size_t hi, const Check& end)
{
    const auto& [i, step, guards, counts] = on;
    if (closes(guards, i, from, end)) {
        check_change(i, from, end, guards);
        from = end;
        return none;
    }
    if (hi - lo == 1) {
        failing_value_ = end.value;
        if (from.exact && from.time == place(lo, step).time) return lo;
        const auto bounded = bound_at(i, lo, step, guards, counts);
        if (bounded && closes(guards, i, *bounded, end)) {
            from = end;
            return none;
        }
        const Check start = check_at(i, lo, step, guards, counts);
        check_covered(i, from, start, guards);
        from = start;
        if (!closes(guards, i, start, end)) return lo;
        check_change(i, start, end, guards);
        from = end;
        return none;
    }
    const std::size_t middle = lo + (hi - lo) / 2;
    const Check half = check_at(i, middle, step, guards, counts);
    const std::size_t failed = narrow(on, from, lo, middle, half);
    return failed != none ? failed : narrow(on, from, middle, hi, end);
}

template <class X, bool single>
inline std::size_t Planner<X, single>::enclose_one(std::size_t i, bool in_doubt,
                                                   const Step<X>& step, Guards& guards,
                                                   Statistics& counts)
{
    LastCheck& known = checks_[i];
    const std::size_t last = steps_.size();
    std::size_t lo = known.first;
    std::size_t hi = last;
    if (in_doubt || never_sleeps(guards[i]) || guards[i].info.boolean) return lo;
    const double sign = sign_of(guards[i].side);
    const auto time_of = [&](std::size_t k) { return place(k, step).time; };
    double from = time_of(lo);
    while (lo < last) {
        const double length = time_of(hi) - from;
        // A single step that is expected not to be proved is divided.
        if (hi - lo == 1 && known.interval < 0.5 * length && known.interval > 0) break;
        ++counts.bound_calls;
        const Enclosure range =
            enclosures_.of_steps({i, step.mode(), backward_}, sign, step, steps_, lo, hi);
        if (is_clear(guards, i, range, hi == last && step.is_pinned())) {
            known.interval = length * intervals::after_clear(range);
            lo = hi;
            from += length;
            hi = last;
        } else {
            const double part = intervals::instead_of(range);
            known.interval = length * part;
            if (hi - lo == 1) break;
            const auto fewer = static_cast<std::size_t>(part * static_cast<double>(hi - lo));
            hi = lo + std::max(fewer, std::size_t{1});
            continue;
        }
        // The rest of the interval is enclosed as far as the last range lets expect.
        while (hi - lo > 1 && time_of(hi) - from > 1.5 * known.interval)
            hi = lo + (hi - lo + 1) / 2;
    }
    if (lo > known.first) defer_enclosed(i, time_of(lo), known.interval);
    return lo < last ? lo : none;
}

template <class X, bool single>
inline void Planner<X, single>::close_inside(const Step<X>& step, Guards& guards,
                                             EventSearch<X, single>& search, Statistics& counts)
{
    std::size_t kept = 0;
    for (std::size_t k = 0; k < judged_.size(); ++k) {
        const std::size_t i = judged_[k];
        judged_[kept] = i;
        guards.note_dip(i, false);
        ++kept;
        if (never_sleeps(guards[i]) || !search.cover().covers(guards[i])) continue;
        if (encloses()) {
            if (guards.starts_at_event(i, step)) continue;
            const double end = clock(step.time(step.h()));
            const double interval = checks_[i].interval;
            const Covered covered = search.cover_by_tubes(step, guards, i, interval, counts);
            if (covered.proved) {
                checks_[i].verify = false;
                defer_enclosed(i, end, search.cover().next_interval());
                schedule(i);
                --kept;
            } else {
                checks_[i].interval = search.cover().next_interval();
                guards.note_dip(i, covered.leaves);
            }
            continue;
        }
        const Check start = check_of(step.time(0), step.x0());
        Check end = check_of(step.time(step.h()), step.x1());
        const double value = value_at(i, start, step.mode(), guards, counts);
        end.value = value_at(i, end, step.mode(), guards, counts);
        if (!(sign_of(guards[i].side) * end.value > 0)) continue;
        if (ties(step, value, end.value)) continue;
        if (guards.starts_at_event(i, step)) continue;  // its bounds leave the first part open
        const Covered covered = search.cover(step, guards, i, value, end.value, counts.guard_calls);
        if (covered.proved) {
            checks_[i].verify = false;
            defer_from(i, end, step.mode(), guards);
            --kept;
        } else {
            remember(checks_[i], end.time, end.value);
            guards.note_dip(i, covered.leaves);
        }
    }
    judged_.shrink(kept);
    find_limit();
}

}  // namespace ricochet::detail
