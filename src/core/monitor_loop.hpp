// The events in the steps of a host.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

#include "core/engine.hpp"
#include "core/tolerances.hpp"
#include "ricochet/detail/monitor_core.hpp"

namespace ricochet::detail {

/// @throws std::logic_error naming the call of the host and the call that was expected.
[[noreturn]] void throw_out_of_turn(std::string_view call, std::string_view expected);
/// @throws std::logic_error because a step does not begin where the last one ended.
[[noreturn]] void throw_gap(double expected, double found);
/// @throws std::logic_error because a step does not start at the state at the end of the last.
[[noreturn]] void throw_state_moved(std::size_t component, double expected, double found);
/// @throws std::logic_error because a component that a rest holds moves in a step.
[[noreturn]] void throw_held_moved(std::size_t component, double expected, double found);
/// @throws std::logic_error because the step goes beyond a time event.
[[noreturn]] void throw_beyond_time_event(double event, double end);
[[noreturn]] void throw_hold_not_ahead(double now, double found);
/// @throws std::logic_error because guards have to be examined before that time.
[[noreturn]] void throw_not_quiet(double until, double found);
/// @throws std::invalid_argument for a length, time or scale that is not a positive or finite
/// number.
[[noreturn]] void throw_no_length(std::string_view what, double found);

/// @throws std::invalid_argument because the system has no events.
[[noreturn]] void throw_without_events();

/// @throws std::out_of_range naming the guard asked for and the number of guards.
[[noreturn]] void throw_no_such_guard(std::size_t found, std::size_t guards);

/// The kernel of a motion that a host computes; it takes no steps itself.
template <class X>
inline constexpr StepKernel<X> host_kernel{};

template <class X, bool single>
class MonitorLoop : public AnyMonitor<X> {
    using Engine = EventEngine<X, single>;
    using Pending = typename Engine::Pending;
    static constexpr std::string_view who = "EventMonitor";

public:
    /// Keeps a reference to `setup`.
    MonitorLoop(const RunBindings<X>& setup, const X& like, const Options& options,
                bool cuts_at_all)
        : guarded_(setup.system->guarded),
          timed_(setup.system->timed()),
          defers_(defers(setup.detector, *setup.system)),
          backward_(options.t_end < options.t_start),
          engine_(setup, like, options, {.who = who, .cuts_at_all = cuts_at_all}),
          components_(static_cast<std::size_t>(like.size()))
    {
        if (!guarded_ && !timed_) {
            throw_without_events();
        }
        if (guarded_) engine_.refuse_bad_guards();
        if (setup.detector.check) {
            setup.detector.check(setup.detecting, setup.adapter, like, 0, Engine::infinity);
        }
        cut_.before = cut_.after = like;
        cut_.fired.reserve(std::max<std::size_t>(engine_.guards().size(), 1));
    }

    Verdict start(const Instant& t, const X& x, const double* dxdt, Mode mode,
                  double scale) override
    {
        require_finite(t, x);
        require_length("the scale of `start`", scale);
        engine_.options().t_start = t.value;
        engine_.options().mode = mode;
        engine_.refuse_bad_modes();
        started_ = false;
        engine_.forget_run();
        now().restart(t, x, mode);
        place_rate(dxdt);
        h_next() = scale;
        if (timed_) engine_.find_time_event(Engine::After::start);
        if (guarded_) engine_.arm_at_start(!options().continues);
        started_ = true;
        return or_start_anew([&] { return go_on(); });
    }

    Verdict examine(const HostStepTable& step) override
    {
        require_turn("examine");
        require_next(step);
        engine_.ends_at().time_event = timed_ && ends_at_time_event(step);
        return or_start_anew([&] { return check_at(step); });
    }

    Verdict resume(const double* dxdt, double scale) override
    {
        if (engine_.pending() == Pending::nothing || ended()) {
            throw_out_of_turn("resume", "it after a verdict `cut` alone");
        }
        require_length("the scale of `resume`", scale);
        return or_start_anew([&] {
            place_rate(dxdt);
            h_next() = scale;
            return go_on();
        });
    }

    Verdict resume(const X& after, Mode mode, const double* dxdt, double scale) override
    {
        if (engine_.pending() == Pending::nothing || ended()) {
            throw_out_of_turn("resume", "it after a verdict `cut` alone");
        }
        require_finite(now().start(), after);
        require_length("the scale of `resume`", scale);
        const std::size_t modes = engine_.modes();
        if (modes > 0 && mode >= modes) throw_unknown_mode(who, mode, modes);
        now().restart(now().start(), after, mode);
        return resume(dxdt, scale);
    }

    Verdict hold(double t) override
    {
        if (!engine_.holds().rests() || ended())
            throw_out_of_turn("hold", "it after a verdict `rests` alone");
        if (!lies_before(now().start().value, t) || !std::isfinite(t)) {
            throw_hold_not_ahead(now().start().value, t);
        }
        const bool due = timed_ && !lies_before(t, time_event());
        if (due && t != time_event()) throw_beyond_time_event(time_event(), t);
        return or_start_anew([&] { return hold_until(t, due); });
    }

    [[nodiscard]] const Cut<X>& cut() const noexcept override { return cut_; }
    [[nodiscard]] Instant t() const noexcept override { return now().start(); }
    [[nodiscard]] const X& x() const noexcept override { return now().x0(); }
    [[nodiscard]] Mode mode() const noexcept override { return now().mode(); }
    [[nodiscard]] double must_stop_at() const noexcept override { return time_event(); }
    [[nodiscard]] std::span<const std::size_t> held() const noexcept override
    {
        return now().held();
    }
    [[nodiscard]] double quiet_until() const noexcept override
    {
        if (!guarded_) return backward_ ? -Engine::infinity : Engine::infinity;
        const bool planned = defers_ && started_ && !ended() && !engine_.holds().rests() &&
                             !engine_.newly_armed() && engine_.pending() == Pending::nothing;
        return planned ? clock(planner().limit()) : now().start().value;
    }

    void skip_to(const Instant& t, const X& x, const double* dxdt) override
    {
        require_turn("skip_to");
        if (clock(t.value) < clock(now().start().value)) throw_gap(now().start().value, t.value);
        if (!(clock(t.value) <= clock(quiet_until()))) throw_not_quiet(quiet_until(), t.value);
        if (timed_ && !lies_before(t.value, time_event())) {
            throw_beyond_time_event(time_event(), t.value);
        }
        require_finite(t, x);
        if (quiet_until() == now().start().value && !same_state(x, now().x0())) {
            throw_not_quiet(quiet_until(), t.value);
        }
        now().restart(t, x, now().mode());
        place_rate(dxdt);
        ++result().statistics.steps;
        engine_.count_deferred(1);
    }

    [[nodiscard]] Side side(std::size_t guard) const override
    {
        if (guard >= engine_.guards().size()) throw_no_such_guard(guard, engine_.guards().size());
        return engine_.guards()[guard].side;
    }
    [[nodiscard]] const Run<X>& run() noexcept override
    {
        engine_.bring_up_to_date();
        return result();
    }
    void clear_events() noexcept override { result().events.clear(); }

    [[nodiscard]] Snapshot save() override
    {
        require_turn("save");
        Snapshot snapshot;
        snapshot.run = properties();
        visit_state(SnapshotWriter(snapshot));
        return snapshot;
    }

    void restore(const Snapshot& snapshot) override
    {
        require_same_run(snapshot.run, properties());
        Snapshot old;
        const bool had_started = started_;
        visit_state(SnapshotWriter(old));
        try {
            SnapshotReader reader(snapshot);
            visit_state(reader);
            reader.finish();
            refuse_bad_place();
        } catch (const std::invalid_argument&) {
            visit_state(SnapshotReader(old));
            started_ = had_started;
            throw;
        }
        engine_.go_on_from(place_);
        engine_.forget_cause();
        started_ = true;
    }

private:
    [[nodiscard]] Step<X>& now() noexcept { return engine_.step(); }
    [[nodiscard]] const Step<X>& now() const noexcept { return engine_.step(); }
    [[nodiscard]] Run<X>& result() noexcept { return engine_.run(); }
    [[nodiscard]] const Options& options() const noexcept { return engine_.options(); }
    [[nodiscard]] const SystemAt<X>& system() const noexcept { return engine_.system(); }
    [[nodiscard]] Planner<X, single>& planner() noexcept { return engine_.planner(); }
    [[nodiscard]] const Planner<X, single>& planner() const noexcept { return engine_.planner(); }
    [[nodiscard]] double& h_next() noexcept { return engine_.h_next(); }
    [[nodiscard]] double h_next() const noexcept { return engine_.h_next(); }
    [[nodiscard]] double time_event() const noexcept { return engine_.time_event(); }
    [[nodiscard]] bool ended() const noexcept { return engine_.ended(); }

    // --- calls out of turn ---

    void require_turn(std::string_view call) const
    {
        if (!started_) throw_out_of_turn(call, "`start` before it");
        if (engine_.pending() != Pending::nothing) throw_out_of_turn(call, "`resume` after a cut");
        if (ended()) throw_out_of_turn(call, "`start` after the end of a run");
        if (engine_.holds().rests() && call == "examine")
            throw_out_of_turn(call, "`hold` where the motion rests");
    }

    static void require_length(std::string_view what, double length)
    {
        if (!(length > 0) || !std::isfinite(length)) throw_no_length(what, length);
    }

    static void require_finite(const Instant& t, const X& x)
    {
        if (!std::isfinite(t.value) || !std::isfinite(t.remainder)) {
            throw_no_length("the time", t.value);
        }
        if (x.size() == 0) throw_start_empty(who);
        for_each_component(x, [&](auto i) {
            if (!std::isfinite(x[i])) {
                throw_start_not_finite(who, static_cast<std::size_t>(i), x[i]);
            }
        });
    }

    /// A step begins where the last one ended, up to the rounding of a host's sum of times.
    void require_next(const HostStepTable& step) const
    {
        require_length("the length of a step", step.h);
        const double gap = std::fabs(now().until(step.t));
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(now().start().value);
        if (!(gap <= 4 * ulp + 1e-9 * step.h)) throw_gap(now().start().value, step.t);
        const X& x = now().x0();
        for (std::size_t i = 0; i < x.size(); ++i) {
            if (!(x[i] == step.x0[i])) throw_state_moved(i, x[i], step.x0[i]);
        }
        for (const std::size_t i : now().held()) {
            if (!(x[i] == step.x1[i])) throw_held_moved(i, x[i], step.x1[i]);
        }
    }

    [[nodiscard]] bool ends_at_time_event(const HostStepTable& step) const
    {
        const Instant start = step.start();
        const double end = start.after(backward_ ? -step.h : step.h).value;
        const double ahead = backward_ ? -start.until(time_event()) : start.until(time_event());
        const double rounding = tolerances::of_state * std::fabs(end) + 1e-12 * step.h;
        if (ahead < step.h - rounding) throw_beyond_time_event(time_event(), end);
        return ahead <= step.h + rounding;
    }

    [[nodiscard]] bool lies_before(double t, double end) const noexcept
    {
        return backward_ ? t > end : t < end;
    }

    // --- checks ---

    /// An exception from a function of the system, or from a host's interpolant, leaves guards half
    /// examined or half armed: afterwards only `start` and `restore` are accepted.
    template <class Function>
    Verdict or_start_anew(const Function& function)
    {
        try {
            return function();
        } catch (...) {
            started_ = false;
            engine_.holds().forget();
            engine_.drop_pending();
            now().restart(now().start(), now().x0(), now().mode());
            throw;
        }
    }

    [[nodiscard]] Verdict check_at(const HostStepTable& step)
    {
        show(step);
        if (!engine_.holds().empty()) return check_held(step);
        return check_shown(step);
    }

    void show(const HostStepTable& step)
    {
        now().show(step);
        if (std::exchange(departs_, false)) now().align_start();
        h_next() = step.h;
        engine_.begin_instant();
    }

    /// Examines a step in which components are held, no farther than to where they are released.
    [[nodiscard]] Verdict check_held(const HostStepTable& step)
    {
        const auto release = engine_.holds().first_release(step.h, [this, &step](double s, X& x) {
            if (s == step.h) return assign(x, now().x1());
            s == 0 ? assign(x, now().x0()) : now().interpolate(s, x);
        });
        const bool released =
            release.hold != no_guard && (release.at < step.h || !engine_.ends_at().time_event);
        if (!released) {
            const std::size_t left = engine_.holds().guard_left_at(now().time(step.h), now().x1());
            if (left != no_guard) {
                engine_.end(Outcome::zeno, left);
                now().restart(now().start(), now().x0(), now().mode());
                return Verdict::ended;
            }
            return check_shown(step);
        }
        X end = now().x0(), rate = end;
        HostStepTable part = step;
        if (release.at < step.h) {
            now().restep(release.at, end);
            now().flow(release.at, end, rate);
            part.h = release.at;
            part.x1 = end.data();
            part.rate1 = rate.data();
            part.is_cubic = false;
            engine_.ends_at().time_event = false;
            departs_ = now().is_aligned();
            show(part);
        }
        const Verdict verdict = check_shown(part);
        if (verdict != Verdict::stands) return verdict;
        cut_.s = part.h;
        engine_.release_here(release.hold);
        return show_set();
    }

    [[nodiscard]] Verdict check_shown(const HostStepTable& step)
    {
        if (holds_set()) {
            cut_.s = engine_.set_offset();
            engine_.apply_found();
            return show_set();
        }
        if (ended()) {
            now().restart(now().start(), now().x0(), now().mode());
            return Verdict::ended;
        }
        if (engine_.ends_at().time_event) engine_.keep_flow_at_start();
        now().accept_shown();
        ++result().statistics.steps;
        engine_.last_h() = step.h;
        if (!engine_.ends_at().time_event) return Verdict::stands;
        cut_.s = step.h;
        now().hold(time_event());
        engine_.apply_at_end(step.h);
        return show_set();
    }

    /// Whether a set of events cuts the step short. False, too, if the run has ended.
    [[nodiscard]] bool holds_set()
    {
        // Bounds are those of the flow, and not of what a rest leaves of it.
        const bool plans = defers_ && engine_.holds().empty() && !planner().steps_aside();
        if (plans) return holds_set_by_plan();
        if (defers_) engine_.watch_all();
        bool cleared = false;
        return engine_.deserves_search(cleared) && finds(cleared);
    }

    [[nodiscard]] bool finds(bool cleared)
    {
        std::size_t broken = engine_.guards().first_not_finite();
        if (broken == no_guard)
            broken = engine_.guards().first_without_rate();  // the host no longer has it
        if (broken == no_guard) return engine_.find(cleared);
        engine_.end_not_finite("", broken);
        return false;
    }

    /// Plans with intervals of a single step, since a host does not return to earlier steps.
    [[nodiscard]] bool holds_set_by_plan()
    {
        if (engine_.newly_armed()) engine_.begin_plan();
        const double end = clock(now().time(now().h()));
        bool found = false;
        if (planner().covers(end)) {
            engine_.count_deferred(1);
            if (engine_.sample_sleeper()) return false;
        } else {
            now().store(planner().steps().add().start);
            planner().overrun(end);
            const std::size_t doubt = engine_.close_interval();
            planner().steps().clear();
            if (doubt == Planner<X, single>::none) {
                engine_.count_deferred(1);
            } else if (!planner().wrong()) {
                found = engine_.doubts_remain() && finds(false);
                if (!found && !ended() && engine_.settle_verified()) return false;
            }
        }
        return !engine_.has_wrong_bound() && found;
    }

    [[nodiscard]] double clock(double t) const noexcept { return backward_ ? -t : t; }

    // --- rests ---

    [[nodiscard]] Verdict hold_until(double t, bool due)
    {
        cut_.s = 0;
        const double length = now().until(t);
        const auto kept = [this](double, X& x) { assign(x, now().x0()); };
        const auto release = engine_.holds().first_release(length, kept);
        if (release.hold != no_guard && (release.at < length || !due)) {
            now().hold(release.at < length ? now().time(release.at) : t);
            engine_.begin_instant();
            engine_.release_here(release.hold);
            return show_set();
        }
        const std::size_t left = engine_.holds().guard_left_at(t, now().x0());
        if (left != no_guard) {
            engine_.end(Outcome::zeno, left);
            return Verdict::ended;
        }
        now().hold(t);
        if (!due) return Verdict::rests;
        engine_.begin_instant();
        now().refresh();
        engine_.apply_time_event();
        return show_set();
    }

    // --- sets ---

    void place_rate(const double* dxdt)
    {
        if (dxdt) return now().set_rate(dxdt);
        now().refresh();
        if (!now().flow_fits()) throw_flow_does_not_fit(who, now().x0().size());
    }

    /// Arms the guards; a set that follows at the same instant is returned as another cut.
    Verdict go_on()
    {
        departs_ = true;
        assign(cut_.before, now().x0());
        cut_.mode_before = now().mode();
        if (!engine_.settle()) {
            if (ended()) return Verdict::ended;
            if (engine_.holds().rests()) return Verdict::rests;
            const bool plans = defers_ && engine_.holds().empty() && !planner().steps_aside();
            if (plans) engine_.begin_plan();
            return Verdict::stands;
        }
        cut_.s = 0;
        return show_set();
    }

    Verdict show_set()
    {
        if (engine_.pending() == Pending::nothing) return Verdict::ended;
        cut_.t = now().start();
        const bool released = engine_.pending() == Pending::arm_released;
        cut_.accumulation = engine_.pending() != Pending::settle && !released;
        if (released) {
            assign(cut_.before, now().x0());
            cut_.mode_before = now().mode();
        } else if (!cut_.accumulation) {
            assign(cut_.before, engine_.before());
            cut_.mode_before = engine_.mode_before();
        }
        assign(cut_.after, now().x0());
        cut_.mode_after = now().mode();
        cut_.on_time = !cut_.accumulation && !released && engine_.is_on_time();
        // The rates of a motion that goes free are not those of the state that was kept.
        cut_.state_changed = released || !same_state(cut_.before, cut_.after);
        cut_.fired.assign(engine_.fired().begin(), engine_.fired().end());
        std::sort(cut_.fired.begin(), cut_.fired.end());
        return Verdict::cut;
    }

    // --- saving ---

    [[nodiscard]] std::vector<RunProperty> properties() const
    {
        return {{"monitor of", system()->name(system().adapter())},
                {"detector", plain_type_name(engine_.finders().detector.type)},
                {"locator", plain_type_name(engine_.finders().locator.type)},
                {"guards", std::to_string(engine_.guards().size())},
                {"components", std::to_string(components_)},
                {"direction", backward_ ? "backward" : "forward"}};
    }

    void refuse_bad_place() const
    {
        const auto require = [](bool fulfilled, std::string_view what) {
            if (!fulfilled) throw_snapshot_is_no_state(what);
        };
        require(place_.x.size() > 0 && place_.remainder.size() == place_.x.size() &&
                    place_.rate.size() == place_.x.size(),
                "the number of components");
        require(std::isfinite(place_.t.value) && std::isfinite(place_.t.remainder), "the time");
        require(all_finite(place_.x) && all_finite(place_.remainder), "the state");
        require(!timed_ || lies_before(place_.t.value, time_event()), "the next time event");
        require(h_next() > 0 && std::isfinite(h_next()), "the scale");
        const std::size_t modes = engine_.modes();
        require(modes == 0 || place_.mode < modes, "the mode");
        require(engine_.holds().fit(place_.x.size()), "what a rest holds");
    }

    template <class Visitor>
    void visit_state(Visitor&& visit)
    {
        if constexpr (std::remove_cvref_t<Visitor>::saves) place_ = now().place();
        visit(place_.t.value);
        visit(place_.t.remainder);
        visit(place_.mode);
        for (X* x : {&place_.x, &place_.remainder, &place_.rate}) visit.state(*x);
        visit(h_next());
        engine_.visit_time_event(visit);
        engine_.holds().visit(visit);
        visit(departs_);
        engine_.visit_ended(visit);
        visit(result().outcome);
        engine_.visit_guards(visit);
        engine_.visit_planner(visit);
    }

    bool guarded_, timed_;
    std::conditional_t<single, Never, bool> defers_;  ///< only the loop of any number plans
    bool backward_;
    Engine engine_;
    std::size_t components_;  ///< number of components of the state that it was made for
    Cut<X> cut_;
    bool started_ = false;
    bool departs_ = false;  ///< guards have been armed at the start of the next step
    StepStart<X> place_;
};

}  // namespace ricochet::detail
