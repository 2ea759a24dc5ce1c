// Internal: the declarations of this header may change without notice.
//
// Runs of an inclusion without a flow beside it: in branches by the loop of the library, or by
// set-valued steps alone.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/nonsmooth/branch_modes.hpp"
#include "ricochet/nonsmooth/detail/law.hpp"
#include "ricochet/nonsmooth/detail/least_reaction.hpp"
#include "ricochet/nonsmooth/detail/padded_motion.hpp"
#include "ricochet/nonsmooth/detail/phased_run.hpp"
#include "ricochet/nonsmooth/detail/stall_watch.hpp"
#include "ricochet/nonsmooth/hand_over_run.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet::detail {

[[nodiscard]] inline HandOverOptions at_time(HandOverOptions options, double t)
{
    options.t_start = t;
    return options;
}

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

/// Stands for the flow beside an inclusion of n components, which is never followed.
template <int n>
struct NoOwnFlow {
    using State = std::array<double, static_cast<std::size_t>(n)>;
    static void flow(double, const State&, State& dxdt) { dxdt.fill(0); }
};

/// An inclusion in its branches and, where these do not determine the motion, by set-valued steps,
/// in solvers of N components and M reactions.
template <class System, class Stepping, int N, int M>
class RunInBranches {
    static constexpr int n = state_size<System>, m = reaction_size<System>;
    static constexpr bool controlled =
        std::is_same_v<Stepping, ErrorControlled<typename Stepping::method>>;
    using Beside = NoOwnFlow<n>;
    using X = typename Beside::State;
    using C = CoreState<X>;
    using Vector = StateOf<System>;

public:
    RunInBranches(const System& system, const Vector& w0, const HandOverOptions& options)
        : parts_(beside_, X{}, Stepping{}, Extremum{}, Newton{}),
          run_(start(system, w0, options, {}))
    {
    }
    RunInBranches(const System& system, const SetValuedState<System>& from,
                  const HandOverOptions& options)
        : parts_(beside_, X{}, Stepping{}, Extremum{}, Newton{}),
          run_(start(system, from.w, at_time(options, from.t),
                     {from.reaction.data(), from.reaction.data() + from.reaction.size()}))
    {
    }

    [[nodiscard]] Run<Vector> take()
    {
        Run<C> done = run_->loop().take();
        EndInBranches end = run_->end_in_branches();
        for (std::size_t k = 0; k < done.events.size(); ++k) {
            Event<C>& event = done.events[k];
            event.guard = event.reaction;
            event.mode_before = resized_mode<m, M>(end.changes[k].before);
            event.mode_after = resized_mode<m, M>(end.changes[k].after);
        }
        Run<Vector> out = as_callers<Vector>(std::move(done), Vector{});
        out.mode = resized_mode<m, M>(end.mode);
        out.reaction = std::move(end.reaction);
        return out;
    }

private:
    [[nodiscard]] Owner<PhasedRun<C>> start(const System& system, const Vector& w0,
                                            const HandOverOptions& options,
                                            std::vector<double>&& reaction)
    {
        PhasedSetup<C> setup;
        setup.user = parts_.setup();
        setup.method = parts_.method_name();
        const HandOverOptions given = completed(options, true);
        setup.alone = AloneOptions{.step = given.set_valued.step,
                                   .events_only = given.events_only,
                                   .until_released = given.until_released,
                                   .stall_steps = given.stall_steps,
                                   .reaction = std::move(reaction)};
        setup.inclusions.push_back(
            make_branch_phases<N, M>(inclusion_of<N, M>(system), branch_options(given)));
        X x;
        Eigen::Map<Vector>(x.data()) = w0;
        Options of = loop_options(given);
        if (!controlled) of.step = given.set_valued.step;
        return make_phased_run<C>(std::move(setup), core_state(x), of);
    }
    Beside beside_;
    RunComponents<Beside, X, Stepping, Extremum, Newton> parts_;
    Owner<PhasedRun<C>> run_;
};

/// An inclusion without branches, in solvers of N components and M reactions.
template <class System, int N, int M>
class RunBySteps {
    static constexpr int n = state_size<System>, m = reaction_size<System>;
    using Motion = AnyMotion<N, M>;
    using State = typename Motion::State;

public:
    RunBySteps(const System& system, const StateOf<System>& w0, const HandOverOptions& options)
        : options_(completed(options, false)),
          motion_(inclusion_of<N, M>(system), resized<N>(w0), options_.set_valued),
          sample_(motion_.state())
    {
    }
    RunBySteps(const System& system, const SetValuedState<System>& from,
               const HandOverOptions& options)
        : RunBySteps(system, from.w, at_time(options, from.t))
    {
        motion_.restart(resized<N, M>(from));
    }

    [[nodiscard]] Run<StateOf<System>> take()
    {
        const PhaseCause cause = PhaseCause::no_modes;
        run_.phases.push_back({.from = motion_.state().t, .set_valued = true, .cause = cause});
        run_.outcome = options_.events_only ? Outcome::not_handed_over : Outcome::running;
        if (run_.outcome == Outcome::running) emit_samples(true);
        while (run_.outcome == Outcome::running) advance();
        const auto end = resized<n, m>(motion_.state());
        run_.t = end.t;
        run_.x = end.w;
        run_.reaction = numbers_of(end.reaction);
        run_.set_valued = motion_.statistics();
        run_.statistics.steps = run_.set_valued.accepted;
        run_.statistics.events = run_.events.size();
        return std::move(run_);
    }

private:
    void advance()
    {
        const SetValuedStatistics& done = motion_.statistics();
        const bool goes_on = motion_.outcome() == Outcome::running;
        if (goes_on && done.attempted >= options_.max_steps) return end_with(Outcome::step_limit);
        const std::uint64_t switches = done.switches;
        const Outcome outcome = motion_.advance();
        emit_samples(false);
        if (done.switches != switches) record_switch();
        const State& now = motion_.state();
        const bool solved = outcome != Outcome::not_converged;
        if (!solved) run_.failure = motion_.failure();
        const double h = options_.set_valued.step;
        if (solved && law_violation(motion_.matrices(), now.t, now.w, now.reaction, h) > 1e-6) {
            return end_with(Outcome::law_violated);
        }
        end_with(outcome);
        if (outcome != Outcome::running) return;
        if (options_.cancelled && options_.cancelled->load(std::memory_order_relaxed)) {
            end_with(Outcome::cancelled);
        } else if (stall_(now.t, done.attempted)) {
            end_with(Outcome::stalled);
        }
    }
    void end_with(Outcome outcome) { run_.outcome = outcome; }
    template <class V>
    [[nodiscard]] static std::vector<double> numbers_of(const V& v)
    {
        return {v.data(), v.data() + v.size()};
    }

    void record_switch()
    {
        const State& now = motion_.state();
        const auto& change = motion_.last_switch();
        auto& event = run_.events.emplace_back();
        event.t = now.t;
        event.kind = change.before == Branch::inside  ? EventKind::slip
                     : change.after == Branch::inside ? EventKind::stick
                                                      : EventKind::mode;
        event.guard = event.reaction = change.reaction;
        event.before = event.after = resized<n>(now.w);
        event.bracket = {now.t, now.t};
        event.slope = std::numeric_limits<double>::quiet_NaN();
    }

    /// Emits the samples up to now; one inside the last step is computed by a shorter step.
    void emit_samples(bool at_start)
    {
        const State& now = motion_.state();
        while (run_.trajectory.t.size() < options_.sample_times.size()) {
            const double t = options_.sample_times[run_.trajectory.t.size()];
            if (t > now.t) return;
            const State& before = motion_.before();
            const bool inside = !at_start && t > before.t && t < now.t &&
                                motion_.stepper().take(before, t - before.t, sample_).converged;
            run_.trajectory.t.push_back(t);
            if (!inside) sample_ = now;
            least_.choose(motion_.matrices(), sample_);
            const auto shown = resized<n, m>(sample_);
            run_.trajectory.x.push_back(shown.w);
            run_.reactions.push_back(numbers_of(shown.reaction));
        }
    }

    HandOverOptions options_;
    Motion motion_;
    State sample_;
    LeastOfState<M> least_;
    Run<StateOf<System>> run_;
    StallWatch stall_{options_.t_start, options_.t_end, options_.stall_steps};
};

template <class System, class Stepping,
          int N = solver_components<state_size<System>, reaction_size<System>>,
          int M = solver_reactions<state_size<System>, reaction_size<System>>>
using RunOfInclusion =
    std::conditional_t<Branching<System> || HasStaticBound<System>,
                       RunInBranches<System, Stepping, N, M>, RunBySteps<System, N, M>>;

}  // namespace ricochet::detail
