// Events that the power series of a guard finds in a step.
#pragma once

#include "core/event_search.hpp"

namespace ricochet::detail {

template <class X, bool single>
Finding EventSearch<X, single>::next_on_series(Probe& probe, Watch& watch, const Guards& guards,
                                               std::size_t i)
{
    const Crossing crossing = guards[i].info.crossing;
    const GuardSample end = watch.end;
    GuardSeries guard{
        .terms = guards.series(),
        .which = i,
        .h = probe.step().h(),
        .sign = sign_of(watch.side),
        .from_surface = watch.start.s > 0 || std::fabs(watch.start.value) <= watch.touch,
        .touch = guards[i].info.touch};
    const double ahead = guard.from_surface ? watch.start.rate : watch.start.value;
    if (!(guard.sign * ahead > 0)) return finders_->examine(probe, watch);
    constexpr int most_doubts = 8;  // with more, the series determines nothing about the rest
    for (int doubts = 0; doubts <= most_doubts;) {
        const SeriesInterval found = first_leaving(guard, watch.start, end);
        if (found.kind == SeriesInterval::Kind::clear) {
            if (!(guard.sign * end.value > 0)) break;
            watch.side_after = watch.side;
            return Finding::clear(Evidence::proved);
        }
        const GuardSample lo =
            found.lo > watch.start.s ? probe.value_and_rate(found.lo) : watch.start;
        GuardSample hi = found.hi < end.s ? probe.value_and_rate(found.hi) : end;
        guard.from_surface = guard.from_surface && lo.s == watch.start.s;
        const auto turn = guard.touch == 0 ? turn_between(probe, lo, hi) : std::nullopt;
        const bool passes = turn && guard.sign * turn->value > 0 && guard.sign * lo.value > 0;
        const bool dips = turn && guard.sign * turn->value < 0 && guard.sign * lo.value > 0;
        if (dips) hi = *turn;
        const bool agrees =
            (guard.from_surface || guard.sign * lo.value > 0) && guard.sign * hi.value < 0;
        watch.start = lo;
        watch.end = hi;
        if (dips || (found.kind == SeriesInterval::Kind::crossing && agrees)) {
            if (counts(watch.side, crossing)) return Finding::leaving(watch.side, lo, hi);
            watch.side = opposite(watch.side);
        } else if (!passes) {
            ++doubts;
            judge_by_its_own_size(watch, guards, i);
            const Finding finding = finders_->examine(probe, watch);
            if (finding.hit || finding.touch) return finding;
            watch.side = watch.side_after;
        }
        watch.side_after = watch.side;
        if (!(hi.s < end.s)) return Finding::clear(evidence_);
        watch.start = hi;
        watch.end = end;
        guard.sign = sign_of(watch.side);
        guard.from_surface = false;
        if (!(guard.sign * hi.value > 0)) return finders_->examine(probe, watch);
    }
    return finders_->examine(probe, watch);
}

template <class X, bool single>
std::optional<GuardSample> EventSearch<X, single>::turn_between(Probe& probe, const GuardSample& lo,
                                                                const GuardSample& hi)
{
    if (!(lo.value * hi.value > 0 && lo.value * lo.rate < 0 && hi.value * hi.rate > 0)) return {};
    GuardSample a = lo, b = hi, turn = lo;
    // On a parabola the secant of the rates is exact after one iteration.
    for (int k = 0; k < 4; ++k) {
        const double s = a.s - a.rate * ((b.s - a.s) / (b.rate - a.rate));
        if (!(s > a.s && s < b.s)) break;
        turn = probe.value_and_rate(s);
        if (turn.value * lo.value < 0) break;  // beyond the surface, wherever exactly it turns
        ((turn.rate > 0) == (a.rate > 0) ? a : b) = turn;
    }
    if (turn.s == lo.s || !(std::fabs(turn.value) > probe.rounding(turn.s))) return {};
    return turn;
}

template <class X, bool single>
bool EventSearch<X, single>::find_by_series(const CurrentStep& step, Guards& guards, std::size_t i,
                                            std::uint64_t& calls)
{
    const GuardRecord& record = guards[i];
    if (!resolution_.is_finest() || !finders_->locator.yields_to_series) return false;
    if (record.examined.from > 0 || !counts(record.side, record.info.crossing)) return false;
    if (record.info.touch > 0) return false;
    SeriesCrossing crossing{.which = i,
                            .side = record.side,
                            .end = guards.end(i, step.h()).value,
                            .from_surface = guards.starts_on_surface(i)};
    if (!has_left(crossing.side, crossing.end)) return false;
    const bool found = step.cross(crossing, space_.x);
    calls += crossing.calls;
    if (!found) return false;
    keep_only(i, record.side,
              {.lo = crossing.lo,
               .hi = crossing.hi,
               .root = crossing.root,
               .root_remainder = crossing.root_remainder,
               .slope = crossing.slope,
               .error = crossing.error},
              space_.x);
    return true;
}

}  // namespace ricochet::detail
