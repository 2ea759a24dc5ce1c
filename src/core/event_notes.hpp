// All crossings in a step of guards that are only recorded.
#pragma once

#include <algorithm>

#include "core/event_search.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline void EventSearch<X, single>::note_crossings(const CurrentStep& step, Guards& guards,
                                                   std::size_t i, const GuardSample& end,
                                                   std::uint64_t& calls)
{
    GuardRecord& record = guards[i];
    const auto guard = guards.view(i, step.mode(), calls);
    Probe probe(guard, step, space_, record.info.boolean ? Path::restep : Path::dense);
    int stalled = 0;
    Creep creep(step.h());
    for (int round = 0; round < most_rounds; ++round) {
        Watch watch = guards.watch(i, step, end);
        Finding finding = next_finding(probe, watch, guards, i);
        if (finding.touch) continue;
        if (!finding.hit) return;
        const Location where = locate_first(probe, watch, guards, finding).value();
        const Side side = opposite(finding.side);
        bool counted = true;
        if (guard.system()->enabled_at) {
            counted = guard.system().enabled_at(i, step.mode(), step.time(where.root),
                                                probe.state_at(where));
            if (!counted) ++disabled;
        }
        if (counted) {
            notes_.push_back(
                {.guard = i, .kind = kind_of(where), .side = finding.side, .where = where});
        }
        const bool stays = record.examined.from > 0 && !(where.root > record.examined.from);
        const bool creeps = creep.is_too_long(record.examined.from, where.root);
        pass(guards, i, side, where, probe);
        if (stays && ++stalled > 8) {  // noise around a flat root
            record.examined.next = side_of(end.value);
            return;
        }
        if (creeps) {
            const double behind = creep.behind(where.root);
            if (!(behind < end.s)) {
                record.examined.next = side_of(end.value);
                return;
            }
            pass_behind(guards, i, side, behind, probe);
        }
    }
}

template <class X, bool single>
inline void EventSearch<X, single>::pass(const CurrentStep& step, Guards& guards, std::size_t i,
                                         std::uint64_t& calls)
{
    const auto guard = guards.view(i, step.mode(), calls);
    Probe probe(guard, step, space_);
    const auto hit =
        std::find_if(hits_.begin(), hits_.end(), [i](const Hit& each) { return each.guard == i; });
    if (hit == hits_.end()) return;
    const Side side = opposite(hit->side);
    const double from = guards[i].examined.from;
    pass(guards, i, side, hit->where, probe);
    if (!creep_) creep_.emplace(step.h());
    if (!creep_->is_too_long(from, hit->where.root)) return;
    const double behind = creep_->behind(hit->where.root);
    if (behind < step.h()) {
        pass_behind(guards, i, side, behind, probe);
    } else {
        const Side end = side_of(guards.end(i, step.h()).value);
        guards.go_on_from(i, end, away(end, step.h()));
    }
}

}  // namespace ricochet::detail
