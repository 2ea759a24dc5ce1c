// Internal: the declarations of this header may change without notice.
//
// The result of a hand-over of n components and m reactions, from that of its solvers.
#pragma once

#include <utility>

#include "ricochet/detail/hand_over_run.hpp"
#include "ricochet/detail/padded_motion.hpp"

namespace ricochet::detail {

/// The mode of m reactions for one of M, whose further reactions are at their lower bounds. The
/// modes that are none of branches follow them.
template <int m, int M>
[[nodiscard]] constexpr Mode resized_mode(Mode mode) noexcept
{
    if constexpr (m > most_cases || M > most_cases) return mode;
    constexpr auto modes = [](int reactions) {
        Mode count = 1;
        while (reactions-- > 0) count *= 3;
        return count;
    };
    return mode < modes(M) ? mode : mode - modes(M) + modes(m);
}

template <int n, int m, int N, int M>
[[nodiscard]] AnyHandOverRun<n, m> resized_run(AnyHandOverRun<N, M>&& run)
{
    if constexpr (n == N && m == M) {
        return std::move(run);
    } else {
        AnyHandOverRun<n, m> out;
        out.outcome = run.outcome;
        out.state = resized<n, m>(run.state);
        out.mode = resized_mode<m, M>(run.mode);
        out.events.reserve(run.events.size());
        for (const auto& from : run.events) {
            auto& event = out.events.emplace_back();
            event.t = from.t;
            event.kind = from.kind;
            event.guard = from.guard;
            event.mode_before = resized_mode<m, M>(from.mode_before);
            event.mode_after = resized_mode<m, M>(from.mode_after);
            event.before = resized<n>(from.before);
            event.after = resized<n>(from.after);
            event.bracket = from.bracket;
            event.slope = from.slope;
            event.error = from.error;
            event.late = from.late;
            event.reaction = from.reaction;
        }
        out.phases = std::move(run.phases);
        out.trajectory.t = std::move(run.trajectory.t);
        out.trajectory.x.reserve(run.trajectory.x.size());
        for (const auto& w : run.trajectory.x) out.trajectory.x.push_back(resized<n>(w));
        out.statistics = run.statistics;
        out.failure = run.failure;
        return out;
    }
}

}  // namespace ricochet::detail
