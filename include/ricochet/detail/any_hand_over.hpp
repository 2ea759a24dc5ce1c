// Internal: the declarations of this header may change without notice.
//
// The loop of a hand-over for N components and M reactions, for systems of any type.
#pragma once

#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/branch_modes.hpp"
#include "ricochet/detail/event_loop.hpp"
#include "ricochet/detail/hand_over_run.hpp"
#include "ricochet/detail/hand_over_watches.hpp"
#include "ricochet/detail/held_reactions.hpp"
#include "ricochet/detail/law.hpp"
#include "ricochet/detail/refusals.hpp"

namespace ricochet::detail {

struct NoneHeld {};

/// `HandOver` for systems of any type.
template <int N, int M>
class RICOCHET_ALIGNED AnyHandOver {
    static constexpr bool can_branch = has_modes<N, M>;

public:
    using Vector = Eigen::Matrix<double, N, 1>;
    using Reaction = Eigen::Matrix<double, M, 1>;
    using State = StateWithReaction<N, M>;

    AnyHandOver(const AnyInclusion<N, M>& inclusion, const Vector& w0,
                const HandOverOptions& options, const EventStepping<N, M>& stepping);
    AnyHandOver(const AnyInclusion<N, M>& inclusion, const State& start,
                const HandOverOptions& options, const EventStepping<N, M>& stepping);
    AnyHandOver(const AnyHandOver&) = delete;
    AnyHandOver& operator=(const AnyHandOver&) = delete;

    [[nodiscard]] AnyHandOverRun<N, M> take();

private:
    using Modes = std::conditional_t<can_branch, AnyModes<N, M>, NoModes>;
    using Held = std::conditional_t<can_branch, HeldReactions<N, M>, NoneHeld>;

    [[nodiscard]] static bool branches(const InclusionTraits& traits) noexcept
    {
        return can_branch && traits.box && traits.of_reactions();
    }

    [[nodiscard]] static HandOverOptions at_time(HandOverOptions options, double t)
    {
        options.t_start = t;
        return options;
    }

    void begin()
    {
        if constexpr (can_branch) {
            if (branching_) {
                State& start = run_.state;
                modes_.check_bounds(start.t, start.w);
                if (!keeps_reaction_) {
                    const auto at = modes_.zero_branches(start.t, start.w);
                    const std::size_t which = modes_.undetermined(at, start.t, start.w);
                    if (which != no_reaction) {
                        run_.failure.set = static_cast<int>(which);
                        return end_with(Outcome::several);
                    }
                }
                const Mode mode = keeps_reaction_
                                      ? modes_.mode_after(start, 10 * resolution(start.w))
                                      : modes_.mode_at(start.t, start.w);
                if (mode < Modes::branch_modes) return go_by_events(mode, PhaseCause::start);
                return go_by_steps(cause_of(mode));
            }
        }
        go_by_steps(PhaseCause::no_modes);
    }

    [[nodiscard]] static PhaseCause cause_of(Mode mode) noexcept requires can_branch
    {
        return mode == Modes::several ? PhaseCause::several : PhaseCause::no_flow;
    }

    void end_with(Outcome outcome)
    {
        run_.outcome = outcome;
        ended_ = true;
    }

    [[nodiscard]] std::uint64_t steps_taken() const noexcept
    {
        return run_.statistics.event_driven.steps + motion_.statistics().attempted;
    }

    /// Whether the run hardly advances, or a limited one cannot reach its end. A step whose guards
    /// are divided to the end costs as much as hundreds, so 64 evaluations of a guard count as a
    /// step, too.
    [[nodiscard]] bool stands_still(double t, const Statistics& phase) noexcept
    {
        const std::uint64_t steps = steps_taken() + phase.steps;
        if (stall_(t, steps)) return true;
        if (options_.max_steps >= HandOverOptions{}.max_steps) return false;
        const std::uint64_t calls = run_.statistics.event_driven.guard_calls + phase.guard_calls;
        const std::uint64_t effort = steps + calls / 64;
        return pace_(t, effort, run_.events.size() + phase.events);
    }

    // --- event-driven ---

    void go_by_events(Mode mode, PhaseCause cause)
    {
        run_.mode = mode;
        set_valued_ = false;
        keeps_reaction_ = false;  // it is that of the start, which the events leave
        if (cause == PhaseCause::released) ++run_.statistics.to_events;
        run_.phases.push_back({.from = run_.state.t, .set_valued = false, .cause = cause});
    }

    void follow_events() requires can_branch
    {
        if (steps_taken() >= options_.max_steps) return end_with(Outcome::step_limit);
        if (stands_still(run_.state.t, {})) return end_with(Outcome::stalled);
        typename Modes::State x;
        Eigen::Map<Vector>(x.data()) = run_.state.w;
        std::unique_ptr<EventLoop<N>> simulation;
        try {
            simulation = stepping_.make(modes_, x, event_options());
        } catch (const StartRefused&) {
            return go_by_steps(PhaseCause::stuck);  // next to a surface by more than rounding
        }
        ChatterWatch watch(run_.state.t, options_.set_valued.step / 100);
        FlutterWatch unresolved;
        bool chatters = false;
        bool flutters = false;
        bool released = false;
        bool stalled = false;
        Place before;
        held_.forget();
        while (!chatters && !flutters && !released && !stalled) {
            note_place(*simulation, before);
            const bool going = simulation->step();
            if (Modes::holds(before.mode) && !follows_held(before, *simulation)) {
                go_back(simulation->finish(), before);
                if (held_.starts_beyond()) go_by_steps(PhaseCause::contradiction);
                return;
            }
            if (contradicts(simulation->mode(), simulation->t(), simulation->x())) {
                go_back(simulation->finish(), before);
                return go_by_steps(PhaseCause::contradiction);
            }
            if (!going || simulation->mode() >= Modes::branch_modes) break;
            released = options_.until_released &&
                       is_released(Modes::branches_of(simulation->mode()), simulation->t(),
                                   Modes::vector(simulation->x()));
            stalled = stands_still(simulation->t(), simulation->run().statistics);
            chatters = watch(simulation->t(), simulation->run().statistics.events);
            const auto& events = simulation->run().events;
            if (!events.empty()) {
                flutters = unresolved(events.size(), events.back().t, resolution(simulation->x()),
                                      [&] { return speed_after(events.back()); });
            }
            if (!chatters && !flutters && !released && may_lengthen(simulation->mode())) {
                note_place(*simulation, before);
                return go_back(simulation->finish(), before);
            }
        }
        finish_events(simulation->finish(), chatters, flutters);
        if (released && !set_valued_) end_with(Outcome::released);
        if (stalled) end_with(Outcome::stalled);
    }

    /// Start of an event-driven step, and the number of records until then.
    struct Place {
        double t = 0;
        Vector w;
        Mode mode = 0;
        std::size_t events = 0;
        std::size_t samples = 0;
    };

    template <class Loop>
    static void note_place(const Loop& simulation, Place& place)
    {
        place.t = simulation.t();
        place.w = Modes::vector(simulation.x());
        place.mode = simulation.mode();
        place.events = simulation.run().events.size();
        place.samples = simulation.run().trajectory.t.size();
    }

    /// Whether a step was short enough for the held reactions. If it was not, later steps are
    /// limited to a length that is.
    template <class Loop>
    [[nodiscard]] bool follows_held(const Place& before, const Loop& simulation)
    {
        const typename Modes::Vector now = Modes::vector(simulation.x());
        const double fraction =
            held_.fraction(modes_, {.mode = before.mode,
                                    .t0 = before.t,
                                    .t1 = simulation.t(),
                                    .w0 = before.w,
                                    .w1 = now,
                                    .event_tolerance = options_.event_tolerance});
        if (held_.starts_beyond()) return false;
        if (fraction == 1) return true;
        const double shorter = fraction * (simulation.t() - before.t);
        // Below that length the motion has no smoothness that steps could follow.
        if (shorter <= 1e-9 * (options_.t_end - options_.t_start)) return true;
        longest_step_ = shorter;
        easy_steps_ = 0;
        return false;
    }

    /// Speed |y'| of the y whose zero was the event; infinite if the event was of another kind.
    template <class X>
    [[nodiscard]] double speed_after(const Event<X>& event) const
    {
        if (event.guard % 4 >= 2 || event.mode_after >= Modes::branch_modes) {
            return std::numeric_limits<double>::infinity();
        }
        X rate;
        modes_.flow(event.mode_after, event.t, event.after, rate);
        const auto i = static_cast<Eigen::Index>(event.guard / 4);
        return std::abs(modes_.rate_of(i, Modes::vector(rate)));
    }

    /// Size of y that the tolerances of a step resolve.
    template <class X>
    [[nodiscard]] double resolution(const X& x) const
    {
        return options_.atol + options_.rtol * largest_component(x);
    }

    /// Whether a y is on the wrong side of its reaction, which is at a bound, by more than the
    /// error of a step.
    template <class X>
    [[nodiscard]] bool contradicts(Mode mode, double t, const X& x) const
    {
        if (mode >= Modes::branch_modes) return false;
        const Vector w = Modes::vector(x);
        const Reaction y = modes_.observed(t, w);
        Mode rest = mode;
        for (Eigen::Index i = 0; i < y.size(); ++i, rest /= 3) {
            if (rest % 3 == 0 ? !(y[i] < 0) : rest % 3 == 1 || !(y[i] > 0)) continue;
            if (std::abs(y[i]) > 10 * resolution(x)) return true;
        }
        return false;
    }

    /// Whether enough consecutive steps were shorter than necessary for longer ones to be tried.
    /// The limit is that of the held reactions, and ends with them.
    [[nodiscard]] bool may_lengthen(Mode mode) noexcept requires can_branch
    {
        if (std::isinf(longest_step_)) return false;
        if (!Modes::holds(mode)) {
            longest_step_ = std::numeric_limits<double>::infinity();
            easy_steps_ = 0;
            return true;
        }
        easy_steps_ = held_.is_easy() ? easy_steps_ + 1 : 0;
        if (easy_steps_ < 8) return false;
        easy_steps_ = 0;
        longest_step_ *= 2;
        if (longest_step_ > options_.t_end - run_.state.t) {
            longest_step_ = std::numeric_limits<double>::infinity();
        }
        return true;
    }

    /// Returns to `before` to take steps of another length; later records are dropped.
    template <class X>
    void go_back(Run<X>&& done, const Place& before)
    {
        done.statistics.events -= done.events.size() - before.events;
        done.events.resize(before.events);
        done.trajectory.t.resize(before.samples);
        done.trajectory.x.resize(before.samples);
        collect(done);
        run_.state.t = before.t;
        run_.state.w = before.w;
        run_.mode = before.mode;
    }

    [[nodiscard]] Options event_options() const
    {
        Options options =
            detail::event_options(options_, run_.state.t, run_.trajectory.t.size(), steps_taken());
        options.mode = run_.mode;
        if (!stepping_.error_controlled) {
            options.step = std::min(options_.set_valued.step, longest_step_);
        } else if (longest_step_ < options_.h_max) {
            options.step = options.h_max = longest_step_;
        }
        return options;
    }

    template <class X>
    void finish_events(Run<X>&& done, bool chatters, bool flutters)
    {
        const std::size_t fluttering = flutters ? done.events.back().guard : no_guard;
        collect(done);
        Vector& w = run_.state.w;
        run_.state.t = done.t;
        w = Modes::vector(done.x);
        if (done.mode == Modes::empty) return end_with_empty_set();
        if (done.mode >= Modes::branch_modes) {
            return go_by_steps(cause_of(done.mode));
        }
        if (chatters) return go_by_steps(PhaseCause::chattering);
        const auto accumulate = [&](std::size_t guard) {
            auto branches = Modes::branches_of(done.mode);
            branches[static_cast<Eigen::Index>(guard / 4)] = Branch::inside;
            modes_.hold(branches, done.t, w);
        };
        if (flutters) {
            accumulate(fluttering);
            return go_by_steps(PhaseCause::accumulation);
        }
        if (const auto cause = cause_after(done.outcome)) {
            if (*cause == PhaseCause::accumulation && done.guard != no_guard) {
                accumulate(done.guard);
            }
            return go_by_steps(*cause);
        }
        run_.mode = done.mode;
        if (w.allFinite()) run_.state.reaction = modes_.reaction(done.mode, done.t, w);
        end_with(done.outcome);
    }

    /// What an event-driven phase recorded.
    template <class X>
    void collect(const Run<X>& done)
    {
        if (run_.events.empty()) run_.events.reserve(done.events.size());
        std::uint64_t idle = 0;
        for (const Event<X>& event : done.events) {
            // Where a load hardly passes the bound, rounding leaves y on zero and its guard fires
            // again and again, while the reaction stays at its bound.
            if (event.mode_after == event.mode_before) {
                ++idle;
            } else if (event.mode_after != Modes::empty) {
                run_.events.push_back(converted(event));
                if (keeps_to_branches_) record_other_slips(done, event);
            }
        }
        for (std::size_t i = 0; i < done.trajectory.t.size(); ++i) {
            run_.trajectory.t.push_back(done.trajectory.t[i]);
            run_.trajectory.x.push_back(Modes::vector(done.trajectory.x[i]));
        }
        add(run_.statistics.event_driven, done.statistics);
        run_.statistics.event_driven.events -= idle;
    }

    /// Reactions that slip at an event of another one, in whose set they have none of their own.
    template <class X>
    void record_other_slips(const Run<X>& done, const Event<X>& event) requires can_branch
    {
        if (event.mode_after >= Modes::branch_modes) return;
        const auto is_of = [&](const Event<X>& other, std::size_t i) {
            return other.t == event.t && other.guard / 4 == i &&
                   other.mode_before == event.mode_before && other.mode_after == event.mode_after;
        };
        for (std::size_t i = 0; i < static_cast<std::size_t>(modes_.count()); ++i) {
            if (Modes::branch(i, event.mode_before) != Branch::inside) continue;
            if (Modes::branch(i, event.mode_after) == Branch::inside) continue;
            const auto has_own = [&](const Event<X>& other) { return is_of(other, i); };
            if (std::any_of(done.events.begin(), done.events.end(), has_own)) continue;
            Event<Vector> slip = converted(event);
            slip.guard = slip.reaction = i;
            slip.kind = EventKind::slip;
            run_.events.push_back(std::move(slip));
        }
    }

    void end_with_empty_set() requires can_branch
    {
        run_.failure.set = modes_.faulty(run_.state.t, run_.state.w);
        end_with(Outcome::not_converged);
    }

    template <class X>
    [[nodiscard]] static Event<Vector> converted(const Event<X>& from)
    {
        Event<Vector> event;
        event.t = from.t;
        event.guard = event.reaction = from.guard / 4;
        event.mode_before = from.mode_before;
        event.mode_after = from.mode_after;
        event.before = Modes::vector(from.before);
        event.after = Modes::vector(from.after);
        event.bracket = from.bracket;
        event.slope = from.slope;
        event.error = from.error;
        const bool held = from.guard % 4 >= 2;
        const bool holds = from.mode_after >= Modes::branch_modes ||
                           Modes::branch(event.guard, from.mode_after) == Branch::inside;
        event.kind = kind_of(held, holds);
        return event;
    }

    [[nodiscard]] static EventKind kind_of(bool held, bool holds) noexcept
    {
        return held ? EventKind::slip : holds ? EventKind::stick : EventKind::mode;
    }

    // --- set-valued ---

    void go_by_steps(PhaseCause cause)
    {
        if (branching_) {
            // A phase that is re-entered immediately is kept longer each time.
            const double lasted = run_.phases.empty() ? std::numeric_limits<double>::infinity()
                                                      : run_.state.t - run_.phases.back().from;
            const bool at_once = lasted < 10 * options_.set_valued.step;
            patience_ = at_once ? std::min(2 * patience_, most_patience) : 1;
            if constexpr (can_branch) run_.mode = Modes::several;
            chatters_ = cause == PhaseCause::chattering;
            motion_.locate_switches(!chatters_);
            if (chatters_) {
                patience_ = chatter_patience_;
                chatter_patience_ = std::min(2 * chatter_patience_, most_patience);
            }
        }
        if (options_.events_only || keeps_to_branches_) return end_with(Outcome::not_handed_over);
        set_valued_ = true;
        ++run_.statistics.to_set_valued;
        run_.phases.push_back({.from = run_.state.t, .set_valued = true, .cause = cause});
        if (std::exchange(keeps_reaction_, false)) return;
        try {
            motion_.restart(run_.state.t, run_.state.w);
        } catch (const InclusionRefused&) {
            end_with(run_.state.w.allFinite() ? Outcome::not_converged : Outcome::non_finite);
        }
    }

    void follow_inclusion()
    {
        const double from = motion_.state().t;
        emit_samples(true);
        if (motion_.outcome() == Outcome::running && steps_taken() >= options_.max_steps) {
            end_with(Outcome::step_limit);
        }
        auto branches = motion_.branches();
        for (std::uint64_t steps = 1; !ended_; ++steps) {
            const std::uint64_t switches = motion_.statistics().switches;
            const Outcome outcome = motion_.advance();
            const bool switched = motion_.statistics().switches != switches;
            emit_samples(false);
            if (switched) record_switch();
            if (outcome != Outcome::not_converged && breaks_law()) {
                end_with(Outcome::law_violated);
            } else if (outcome != Outcome::running) {
                if (outcome == Outcome::not_converged) run_.failure = motion_.failure();
                end_with(outcome);
            } else if (options_.cancelled && options_.cancelled->load(std::memory_order_relaxed)) {
                end_with(Outcome::cancelled);
            } else if (steps_taken() >= options_.max_steps) {
                end_with(Outcome::step_limit);
            } else if (stands_still(motion_.state().t, {})) {
                end_with(Outcome::stalled);
            }
            // Switches that are not located restart the count: `patience_` steps must have none.
            if (chatters_ && motion_.branches() != branches) {
                branches = motion_.branches();
                steps = 0;
                continue;
            }
            if constexpr (can_branch) {
                if (!branching_) continue;
                if (!ended_ && options_.until_released &&
                    is_released(motion_.branches(), motion_.state().t, motion_.state().w)) {
                    run_.mode = Modes::mode_of(motion_.branches());
                    end_with(Outcome::released);
                }
                if (!ended_ && steps >= patience_ && is_plain(switched) && release()) break;
            }
        }
        run_.statistics.set_valued_time += motion_.state().t - from;
        if (set_valued_) run_.state = motion_.state();
    }

    /// Whether the reaction violates its law by far more than the 1e-12 that solvers leave.
    [[nodiscard]] bool breaks_law() const
    {
        const State& now = motion_.state();
        return law_violation(motion_.matrices(), now.t, now.w, now.reaction,
                             options_.set_valued.step) > 1e-6;
    }

    /// Whether the branches are those of a mode that flows, and no y is so close to zero that its
    /// sign is due to rounding.
    [[nodiscard]] bool is_plain(bool switched) requires can_branch
    {
        auto branches = motion_.branches();
        if (!modes_.flows(Modes::mode_of(branches))) return false;
        // The branch of a y that has just left zero tells its direction, so its size is not tested.
        if (switched) {
            branches[static_cast<Eigen::Index>(motion_.last_switch().reaction)] = Branch::inside;
        }
        return are_clear(branches, motion_.state().t, motion_.state().w);
    }

    /// Whether every y of a reaction at a bound is farther from zero than its error.
    template <class Branches>
    [[nodiscard]] bool are_clear(const Branches& branches, double t,
                                 const Vector& w) const requires can_branch
    {
        const Reaction y = modes_.observed(t, w);
        const double size = w.template lpNorm<Eigen::Infinity>();
        const double least = 1e3 * (options_.atol + options_.rtol * size);
        for (Eigen::Index i = 0; i < modes_.count(); ++i) {
            if (branches[i] != Branch::inside && std::abs(y[i]) < least) return false;
        }
        return true;
    }

    template <class Branches>
    [[nodiscard]] bool is_released(const Branches& branches, double t,
                                   const Vector& w) const requires can_branch
    {
        return !(branches.array() == Branch::inside).any() && are_clear(branches, t, w);
    }

    /// Hands back to events, unless reactions and rates do not determine the motion.
    [[nodiscard]] bool release() requires can_branch
    {
        auto branches = motion_.branches();
        double t = motion_.state().t;
        Vector w = motion_.state().w;
        const Reaction y = modes_.observed(t, w);
        // A y that has just left zero still has the value zero; its branch gives its sign.
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            const bool wrong = branches[i] == Branch::lower ? y[i] < 0 : y[i] > 0;
            if (wrong) branches[i] = Branch::inside;
        }
        modes_.hold(branches, t, w);
        Mode mode = Modes::several;
        try {
            mode = modes_.mode_at(t, w);
        } catch (const InclusionRefused&) {
        }
        if (mode >= Modes::branch_modes) return false;
        run_.state = motion_.state();
        run_.state.w = w;
        go_by_events(mode, PhaseCause::released);
        return true;
    }

    void record_switch()
    {
        const State& now = motion_.state();
        const auto& change = motion_.last_switch();
        Event<Vector> event;
        event.t = now.t;
        event.kind = kind_of(change.before == Branch::inside, change.after == Branch::inside);
        event.guard = event.reaction = change.reaction;
        event.before = event.after = now.w;
        event.bracket = {now.t, now.t};
        event.slope = std::numeric_limits<double>::quiet_NaN();
        if constexpr (can_branch) {
            if (branching_) {
                event.mode_after = Modes::mode_of(motion_.branches());
                auto before = motion_.branches();
                before[static_cast<Eigen::Index>(change.reaction)] = change.before;
                event.mode_before = Modes::mode_of(before);
            }
        }
        run_.events.push_back(std::move(event));
    }

    // --- samples ---

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
            run_.trajectory.x.push_back(inside ? sample_.w : now.w);
        }
    }

    HandOverOptions options_;
    EventStepping<N, M> stepping_;
    bool branching_;
    bool keeps_to_branches_;  ///< set-valued steps know of no static bounds
    Modes modes_;
    AnyMotion<N, M> motion_;
    State sample_;
    AnyHandOverRun<N, M> run_;
    PaceWatch pace_{options_.t_start, options_.t_end, options_.max_steps};
    StallWatch stall_{options_.t_start, options_.t_end, options_.stall_steps};
    static constexpr std::uint64_t most_patience = std::uint64_t{1} << 20;
    [[no_unique_address]] Held held_;
    double longest_step_ = std::numeric_limits<double>::infinity();  // of the event-driven kind
    int easy_steps_ = 0;
    std::uint64_t patience_ = 1;
    std::uint64_t chatter_patience_ = 10;  // found by trial; 1 hands back during the chattering
    bool chatters_ = false;
    bool set_valued_ = false;
    bool keeps_reaction_ = false;
    bool ended_ = false;
};

template <int N, int M>
AnyHandOver<N, M>::AnyHandOver(const AnyInclusion<N, M>& inclusion, const Vector& w0,
                               const HandOverOptions& options, const EventStepping<N, M>& stepping)
    : options_(completed(options, branches(inclusion.traits()))),
      stepping_(stepping),
      branching_(branches(inclusion.traits())),
      keeps_to_branches_(inclusion.traits().gives_static_bound),
      modes_(inclusion),
      motion_(inclusion, w0, options_.set_valued),
      sample_(motion_.state())
{
    run_.state = motion_.state();
}

template <int N, int M>
AnyHandOver<N, M>::AnyHandOver(const AnyInclusion<N, M>& inclusion, const State& start,
                               const HandOverOptions& options, const EventStepping<N, M>& stepping)
    : AnyHandOver(inclusion, start.w, at_time(options, start.t), stepping)
{
    motion_.restart(start);
    run_.state = start;
    keeps_reaction_ = true;
}

template <int N, int M>
AnyHandOverRun<N, M> AnyHandOver<N, M>::take()
{
    begin();
    while (!ended_) {
        if constexpr (can_branch) {
            if (!set_valued_) {
                follow_events();
                continue;
            }
        }
        follow_inclusion();
    }
    run_.statistics.set_valued = motion_.statistics();
    return std::move(run_);
}

template <int N, int M>
std::shared_ptr<AnyHandOver<N, M>> make_hand_over(const AnyInclusion<N, M>& inclusion,
                                                  const Eigen::Matrix<double, N, 1>& w0,
                                                  const HandOverOptions& options,
                                                  const EventStepping<N, M>& stepping)
{
    return std::make_shared<AnyHandOver<N, M>>(inclusion, w0, options, stepping);
}

template <int N, int M>
std::shared_ptr<AnyHandOver<N, M>> make_hand_over(const AnyInclusion<N, M>& inclusion,
                                                  const StateWithReaction<N, M>& start,
                                                  const HandOverOptions& options,
                                                  const EventStepping<N, M>& stepping)
{
    return std::make_shared<AnyHandOver<N, M>>(inclusion, start, options, stepping);
}

template <int N, int M>
AnyHandOverRun<N, M> take_run(AnyHandOver<N, M>& hand_over)
{
    return hand_over.take();
}

}  // namespace ricochet::detail
