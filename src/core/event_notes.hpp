// All crossings in a step of guards that are only recorded.
#pragma once

#include "core/event_search.hpp"

namespace ricochet::detail {

template <class X, bool single>
inline void EventSearch<X, single>::note_crossings(const CurrentStep& step, Bank& bank,
                                                   std::size_t i, const GuardSample& end,
                                                   std::uint64_t& calls)
{
    GuardRecord& record = bank[i];
    const auto guard = bank.view(i, step.mode(), calls);
    Probe probe(guard, step, space_, record.info.boolean ? Path::restep : Path::dense);
    int stalled = 0;
    int creeping = 0;
    double reach = 0x1p-30 * std::fabs(step.h());
    for (int round = 0; round < most_rounds; ++round) {
        Watch watch = bank.watch(i, step, end);
        const Finding finding = next_finding(probe, watch, bank, i);
        if (finding.touch) continue;
        if (!finding.hit) return;
        probe.watch(finding.side);
        const Location where = find(probe, finding, bank, i);
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
        const bool stays = record.from > 0 && !(where.root > record.from);
        const bool creeps = record.from > 0 && where.root - record.from <= reach;
        creeping = creeps ? creeping + 1 : 0;
        pass(bank, i, side, where, probe);
        if (stays && ++stalled > 8) {  // noise around a flat root
            record.next = side_of(end.value);
            return;
        }
        // The guard is zero by rounding at many neighbouring offsets, and its rates
        // contradict that, as with a flow that jumps there: the search continues behind it.
        if (creeping > 8) {
            const double behind = where.root + reach;
            reach *= 2;
            if (!(behind < end.s)) {
                record.next = side_of(end.value);
                return;
            }
            const Side there = side_of(probe.value(behind).value);
            pass(bank, i, there == Side::plateau ? side : there,
                 {.lo = behind,
                  .hi = behind,
                  .root = behind,
                  .slope = std::numeric_limits<double>::quiet_NaN()},
                 probe);
            creeping = 0;
        }
    }
}

}  // namespace ricochet::detail
