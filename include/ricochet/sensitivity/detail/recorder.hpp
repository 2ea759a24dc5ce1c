// Internal: the declarations of this header may change without notice.
//
// Records a run for a sweep in reverse, and finds the first event without derivatives.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/sensitivity/detail/history.hpp"
#include "ricochet/sensitivity/detail/saltation.hpp"
#include "ricochet/sensitivity/detail/system_pullback.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"
#include "ricochet/sensitivity/undefined.hpp"
#include "ricochet/simulation.hpp"

namespace ricochet {

template <class X>
class Adjoint;

}  // namespace ricochet

namespace ricochet::detail {

/// Where an event is among the pieces of a run: inside a step, or between two.
struct EventPlace {
    bool inside = false;
    Place at{};             ///< inside a step
    std::size_t first = 0;  ///< the piece of its reset
    std::size_t end = 0;    ///< the piece after its resets
};

/// What a run leaves behind.
struct RunRecording {
    History history;
    std::vector<Place> samples;
    std::vector<EventPlace> events;
    std::optional<UndefinedAt> undefined_at;
    std::size_t undefined_piece = 0;  ///< the first that has no derivatives
    std::size_t components = 0;       ///< of the start
};

/// The system of an adjoint, whose type is known where it was made.
class AdjointParts {
public:
    AdjointParts() = default;
    AdjointParts(const AdjointParts&) = delete;
    AdjointParts& operator=(const AdjointParts&) = delete;
    virtual ~AdjointParts() = default;
    [[nodiscard]] virtual const Pullback& pullback() const = 0;
};

template <class System, class X, class Source>
class PartsOfAdjoint final : public AdjointParts {
public:
    PartsOfAdjoint(const System& system, const std::vector<Parameter<System>>& by,
                   const Differences& differences, const X& x0)
        : system_(system), pullback_(system_, Source{&system_}, by, differences, size_of(x0))
    {
    }
    template <class Make>
    PartsOfAdjoint(const Family<Make>& family, const Differences& differences, const X& x0)
        : family_(std::make_shared<const Family<Make>>(family)),
          system_(family.system()),
          pullback_(system_, Source{static_cast<const Family<Make>*>(family_.get())},
                    std::vector<Parameter<System>>{}, differences, size_of(x0))
    {
    }
    [[nodiscard]] const Pullback& pullback() const override { return pullback_; }
    [[nodiscard]] const System& system() const noexcept { return system_; }

private:
    [[nodiscard]] static std::size_t size_of(const X& x) noexcept
    {
        return static_cast<std::size_t>(x.size());
    }

    std::shared_ptr<const void> family_;
    System system_;
    SystemPullback<System, X, Source> pullback_;
};

/// Decides at which events derivatives exist, by the rules of forward mode (saltation.hpp), for
/// derivatives in every direction.
template <class System, class X>
class DerivativesExist {
public:
    DerivativesExist(const System& system, const Options& options, std::size_t components)
        : system_(system), options_(options), last_{options.t_start, {}, false, options.t_start}
    {
        take_components(components);
    }

    /// @param fired   the guards of a set, and whether a time event belongs to it
    /// @param first   an event of the set
    [[nodiscard]] Undefined pass(const FiredGuards& fired, const Event<X>& first)
    {
        if (!last_.any || !saltation_->at_one_time(last_.t, first.t)) start_instant(first);
        const bool again = last_.any && first.mode_before == first.mode_after &&
                           first.before == first.after && saltation_->holds(fired, motion_);
        if (again) return Undefined::no;
        return saltation_->pass_set(fired, first.after, motion_, last_);
    }
    /// Whether the events of an instant have put a guard beside its surface for some neighbours.
    [[nodiscard]] Undefined end_instant(const Event<X>& last)
    {
        if (!last_.any || !saltation_->at_one_time(last_.t, last.t)) return Undefined::no;
        if (last.mode_after != motion_.mode) return Undefined::simultaneous;
        motion_.x = last.after;
        return saltation_->leaves_surface(before_, motion_, last_) ? Undefined::simultaneous
                                                                   : Undefined::no;
    }
    void rested(double t)
    {
        last_.any = false;
        last_.flight_start = t;
    }
    [[nodiscard]] std::vector<bool> held([[maybe_unused]] std::size_t which,
                                         [[maybe_unused]] const Event<X>& event) const
    {
        if constexpr (Resting<System, X>) {
            const Motion<X> motion{event.mode_before, event.t, event.before, {}};
            return saltation_->held_by_rest(which, motion, event.after);
        } else {
            return {};
        }
    }

private:
    void start_instant(const Event<X>& event)
    {
        const auto components = static_cast<std::size_t>(event.before.size());
        if (components != saltation_->columns()) take_components(components);
        const auto n = static_cast<Eigen::Index>(components);
        motion_ = {event.mode_before, event.t, event.before, Eigen::MatrixXd::Identity(n, n)};
        before_ = motion_;
        last_.any = false;
        last_.dt = Eigen::VectorXd::Zero(n);
    }

    /// Columns in every direction.
    void take_components(std::size_t n)
    {
        saltation_.emplace(Linearization<System, X>(system_, {}, {}, n), n, options_);
    }

    const System& system_;
    const Options& options_;
    std::optional<Saltation<System, X>> saltation_;
    LastEvent last_;
    Motion<X> motion_{}, before_{};
};

/// Records the steps of a simulation.
template <class System, class X>
class Recorder {
public:
    Recorder(const System& system, const Pullback& pullback, const TableauView& tableau,
             const X& x0, const Options& options)
        : system_(system),
          pullback_(pullback),
          options_(options),
          exist_(system, options, static_cast<std::size_t>(x0.size())),
          recording_{.history = History(tableau),
                     .samples = {},
                     .events = {},
                     .undefined_at = {},
                     .undefined_piece = 0,
                     .components = static_cast<std::size_t>(x0.size())}
    {
    }

    template <class Simulation>
    [[nodiscard]] RunRecording take(Simulation& simulation, const X& x0)
    {
        Start start{simulation.t(), x0, options_.mode};
        for (bool goes_on = true; goes_on;) {
            goes_on = simulation.step();
            const Run<X>& run = simulation.run();
            if (!started_) add_events_at_start(run, start);
            started_ = true;
            const double t = simulation.t();
            if (t != start.t) add_step(run, start, t, simulation.x());
            start = {t, simulation.x(), simulation.mode()};
        }
        finish();
        return std::move(recording_);
    }

    /// The samples that the run has reached, with their states.
    void sample(const std::vector<double>& times, Run<X>& run, RunRecording& recording) const
    {
        const double sign = options_.t_end < options_.t_start ? -1 : 1;
        std::size_t piece = 0;
        const History& history = recording.history;
        for (const double t : times) {
            if (sign * (t - run.t) > 0) return;
            // A sample at an event is that of the step behind it; one at the end of the run, of
            // the last step.
            for (std::size_t i = piece; i < history.size(); ++i) {
                if (history[i].kind != Piece::Kind::step) continue;
                if (sign * (history[i].t - t) > 0) break;
                piece = i;
            }
            const bool at_end = t == run.t && (history.size() == 0 || ends_with_jump(history));
            const Place place =
                at_end ? Place{history.size(), 0} : Place{piece, t - history[piece].t};
            recording.samples.push_back(place);
            run.trajectory.t.push_back(t);
            run.trajectory.x.push_back(at_end ? run.x : state_at(history, place));
        }
    }

private:
    struct Start {
        double t;
        X x;
        Mode mode;
    };

    [[nodiscard]] static bool ends_with_jump(const History& history) noexcept
    {
        return history[history.size() - 1].kind != Piece::Kind::step;
    }
    [[nodiscard]] X state_at(const History& history, const Place& place) const
    {
        std::vector<double> numbers(history[place.piece].size);
        history.evaluate(pullback_, place, numbers);
        return state_of_numbers<X>(numbers);
    }

    [[nodiscard]] History& history() noexcept { return recording_.history; }

    /// A set: the events of one time that led from one state.
    [[nodiscard]] static std::size_t end_of_set(const std::vector<Event<X>>& events, std::size_t i)
    {
        std::size_t end = i + 1;
        while (end < events.size() && events[end].t == events[i].t &&
               events[end].mode_before == events[i].mode_before &&
               events[end].kind != EventKind::accumulation &&
               events[i].kind != EventKind::accumulation &&
               events[end].before == events[i].before) {
            ++end;
        }
        return end;
    }

    void add_events_at_start(const Run<X>& run, Start& start)
    {
        const std::vector<Event<X>>& events = run.events;
        while (seen_ < events.size() && events[seen_].t == start.t) {
            const std::size_t end = end_of_set(events, seen_);
            add_set(events, end, false);
            start.x = events[end - 1].after;
            start.mode = events[end - 1].mode_after;
        }
    }

    void add_step(const Run<X>& run, const Start& start, double t, const X& reached)
    {
        history().add({.kind = Piece::Kind::step,
                       .end = t == options_.t_end ? Piece::End::time : Piece::End::length,
                       .mode = start.mode,
                       .t = start.t,
                       .h = t - start.t},
                      numbers_of(start.x));
        const std::vector<Event<X>>& events = run.events;
        const std::size_t step = history().size() - 1;
        bool any = false;
        const std::size_t first = seen_;
        for (std::size_t i = seen_; i < events.size() && !any; ++i) any = ends_step(events[i], t);
        std::vector<double> end;
        if (history().holds()) {
            const X& x = any ? events[first].before : reached;
            end.assign(x.data(), x.data() + x.size());
            history().review_held(end);
        }
        bool acting = false;
        while (seen_ < events.size()) {
            const Event<X>& event = events[seen_];
            if (!ends_step(event, t)) {
                add_recorded(event, step, event.t - start.t);
                ++seen_;
                continue;
            }
            add_set(events, end_of_set(events, seen_), !acting);
            acting = true;
        }
        if (acting && !recording_.undefined_at) {
            end_instant(events, exist_.end_instant(events.back()));
        }
    }

    /// Whether an event ends the step that ends at t, rather than being recorded inside it.
    [[nodiscard]] bool ends_step(const Event<X>& event, double t) const
    {
        if (event.kind == EventKind::time || event.kind == EventKind::accumulation) return true;
        if (event.guard == no_guard || event.t != t) return event.guard == no_guard;
        const GuardInfo info = guard_info_of<X>(system_, event.guard);
        return event.kind != EventKind::touch &&
               (info.resets || info.stop_after > 0 || options_.stop_at_event);
    }

    void add_recorded(const Event<X>& event, std::size_t step, double s)
    {
        recording_.events.push_back({.inside = true, .at = {step, s}});
        const bool resets = [&] {
            if constexpr (Guarded<System, X>) {
                return event.guard != no_guard && guard_info_of<X>(system_, event.guard).resets;
            }
            return false;
        }();
        if (event.kind == EventKind::touch && resets) {
            mark(recording_.events.size() - 1, Undefined::grazing, step + 1);
        }
    }

    void mark(std::size_t event, Undefined reason, std::size_t piece)
    {
        if (reason == Undefined::no || recording_.undefined_at) return;
        recording_.undefined_at = UndefinedAt{event, reason};
        recording_.undefined_piece = piece;
    }
    void end_instant(const std::vector<Event<X>>& events, Undefined reason)
    {
        mark(events.size() - 1, reason, history().size());
    }

    /// Adds the pieces of a set of events. @param first  whether they end the step
    void add_set(const std::vector<Event<X>>& events, std::size_t end, bool first)
    {
        const std::size_t begin = seen_;
        seen_ = end;
        const std::size_t piece = history().size();
        const Event<X>& event = events[begin];
        if (event.kind == EventKind::accumulation) {
            add_rest(event);
        } else {
            add_jumps(events, begin, end, first);
        }
        if (event.mode_after != event.mode_before || event.kind == EventKind::mode) {
            history().release();
        }
        for (std::size_t i = begin; i < end; ++i) {
            recording_.events.push_back(
                {.inside = false, .at = {}, .first = piece, .end = history().size()});
        }
    }

    void add_rest(const Event<X>& event)
    {
        history().add({.kind = Piece::Kind::rest,
                       .mode = event.mode_before,
                       .guard = event.guard,
                       .t = event.t},
                      numbers_of(event.before));
        if constexpr (Guarded<System, X>) {
            if (event.mode_before == event.mode_after) {
                history().hold(exist_.held(event.guard, event));
            }
        }
        exist_.rested(event.t);
    }

    void add_jumps(const std::vector<Event<X>>& events, std::size_t begin, std::size_t end,
                   bool first)
    {
        std::vector<std::size_t> guards;
        bool on_time = false;
        for (std::size_t i = begin; i < end; ++i) {
            if (events[i].kind == EventKind::time) on_time = true;
            if (events[i].guard != no_guard && changes_sign(events[i].kind)) {
                guards.push_back(events[i].guard);
            }
        }
        std::ranges::sort(guards);
        const Event<X>& event = events[begin];
        if (!recording_.undefined_at) {
            mark(begin, exist_.pass(FiredGuards(guards, on_time), event), history().size());
        }
        if (on_time) guards.push_back(no_guard);
        X x = event.before;
        Mode mode = event.mode_before;
        bool ends = first;
        for (const std::size_t which : guards) {
            const bool turned =
                which != no_guard && which != guards.front() && !still_fires(which, event, x, mode);
            if (!turned) add_jump(which, event, x, mode, ends);
        }
    }

    /// Whether a guard of a set still fires after the resets before it, which may have disabled it
    /// or turned it back.
    [[nodiscard]] bool still_fires(std::size_t which, const Event<X>& event, const X& x,
                                   Mode mode) const
    {
        if (!call_enabled_in(system_, which, mode)) return false;
        const double before = slope_of(which, event.mode_before, event.t, event.before).rate;
        return before * slope_of(which, mode, event.t, x).rate > 0;
    }

    /// Adds a reset and what determines its time, and applies it to the state.
    void add_jump(std::size_t which, const Event<X>& event, X& x, Mode& mode, bool& ends)
    {
        const auto end = which == no_guard ? Piece::End::time : Piece::End::guard;
        if (ends) {
            history().set_end(end, which);
        } else if (which == no_guard || crosses_later(which, event, x, mode)) {
            // Neighbouring motions meet it in a step that has no length here.
            history().add(
                {.kind = Piece::Kind::step, .end = end, .mode = mode, .guard = which, .t = event.t},
                numbers_of(x));
        }
        ends = false;
        bool resets = TimeResetting<System, X>;
        if constexpr (Guarded<System, X>) {
            if (which != no_guard) resets = guard_info_of<X>(system_, which).resets;
        }
        if (!resets) return;
        history().add({.kind = Piece::Kind::reset, .mode = mode, .guard = which, .t = event.t},
                      numbers_of(x));
        if (which == no_guard) {
            mode = TimeReset::apply(system_, mode, event.t, x);
        } else if constexpr (Resetting<System, X>) {
            mode = ResetOf{which}.apply(system_, mode, event.t, x);
        }
    }

    /// Whether a guard of a set is on its surface, where it has an event of its own; one that a
    /// reset has put beyond it fires with that reset.
    [[nodiscard]] bool crosses_later(std::size_t which, const Event<X>& event, const X& x,
                                     Mode mode) const
    {
        const Slope slope = slope_of(which, mode, event.t, x);
        const double window = std::max(options_.event_tolerance, options_.event_window) +
                              (options_.event_rtol + 0x1p-48) * std::fabs(event.t);
        if constexpr (GuardAlone<System, X>) {
            return std::fabs(call_guard(system_, which, mode, event.t, x)) <=
                   slope.blur + std::fabs(slope.rate) * window;
        } else {
            return true;
        }
    }

    /// The rate of a guard along the flow, and its uncertainty by that of the state.
    struct Slope {
        double rate, blur;
    };
    [[nodiscard]] Slope slope_of(std::size_t which, Mode mode, double t, const X& x) const
    {
        const std::span<const double> at = numbers_of(x);
        std::vector<double> g_x(at.size(), 0.0), p(pullback_.parameters(), 0.0), flow(at.size());
        double g_t = 0;
        pullback_.guard_back(which, mode, t, at, 1, {g_x, g_t, p});
        pullback_.flow(mode, t, at, flow);
        Slope slope{g_t, 0};
        for (std::size_t i = 0; i < at.size(); ++i) {
            slope.rate += g_x[i] * flow[i];
            const double atol =
                i < options_.component_atol.size() ? options_.component_atol[i] : options_.atol;
            slope.blur += std::fabs(g_x[i]) * (atol + options_.rtol * std::fabs(at[i]));
        }
        return slope;
    }

    /// The state at the end of a run is one at a fixed time.
    void finish()
    {
        History& pieces = history();
        if (pieces.size() == 0) return;
        const Piece& last = pieces[pieces.size() - 1];
        if (last.kind == Piece::Kind::step && last.end == Piece::End::length) {
            pieces.set_end(Piece::End::time, no_guard);
        }
    }

    const System& system_;
    const Pullback& pullback_;
    const Options& options_;
    DerivativesExist<System, X> exist_;
    RunRecording recording_;
    std::size_t seen_ = 0;
    bool started_ = false;
};

/// The tableau of a stepping's method.
template <class X, class Stepping>
[[nodiscard]] TableauView tableau_of(const Stepping& stepping)
{
    using Method = typename Stepping::method;
    if constexpr (std::is_same_v<Method, MethodByName>) {
        constexpr auto all = NamedMethods::each([]<class Each>() {
            return &tableau_view<typename Each::template Stepper<X>::Coefficients>;
        });
        return all[static_cast<std::size_t>(stepping.value.name)]();
    } else {
        static_assert(NameOf<Method>::known,
                      "ricochet: found a method without a tableau; expected an explicit "
                      "Runge-Kutta method of the library, such as Dopri5, for an adjoint");
        return tableau_view<typename Method::template Stepper<X>::Coefficients>();
    }
}

/// A run of a system, recorded.
template <class X, class System, class Source, class Stepping, class Detector, class Locator>
[[nodiscard]] Adjoint<X> recorded(std::shared_ptr<PartsOfAdjoint<System, X, Source>> parts,
                                  const X& x0, const Options& options, const Stepping& stepping,
                                  const Detector& detector, const Locator& locator)
{
    static_assert(has_flow_alone<System>());
    static_assert(!DecidesAfterSets<System, X>,
                  "ricochet: found a system that slides along surfaces (Filippov); expected one "
                  "without, or forward mode: sensitivities(...)");
    Options one = options;
    one.sample_times.clear();
    one.record_events = true;
    one.event_states = true;
    one.record_steps = false;
    Simulation<System, X, Stepping, Detector, Locator> simulation(parts->system(), x0, one,
                                                                  stepping, detector, locator);
    Recorder<System, X> recorder(parts->system(), parts->pullback(), tableau_of<X>(stepping), x0,
                                 one);
    RunRecording recording = recorder.take(simulation, x0);
    Run<X> run = simulation.finish();
    recorder.sample(options.sample_times, run, recording);
    return Adjoint<X>(std::move(parts), std::move(run), std::move(recording));
}

}  // namespace ricochet::detail
