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
class MonitorLoop : public AnyMonitor<X>, private EventEngine<X, single> {
    using Engine = EventEngine<X, single>;
    using typename Engine::Pending;
    static constexpr std::string_view who = "EventMonitor";

public:
    /// Keeps a reference to `setup`.
    MonitorLoop(const RunBindings<X>& setup, const X& like, const Options& options,
                bool cuts_at_all)
        : Engine(setup, like, options), components_(static_cast<std::size_t>(like.size()))
    {
        this->who_ = who;
        this->cuts_at_all_ = cuts_at_all;
        if (!guarded_ && !timed_) {
            throw_without_events();
        }
        if (guarded_) this->refuse_bad_guards();
        if (setup.detector.check) {
            setup.detector.check(setup.detecting, setup.adapter, like, 0, Engine::infinity);
        }
        cut_.before = cut_.after = like;
        cut_.fired.reserve(std::max<std::size_t>(guards_.size(), 1));
    }

    Verdict start(const Instant& t, const X& x, const double* dxdt, Mode mode,
                  double scale) override
    {
        require_finite(t, x);
        require_length("the scale of `start`", scale);
        options_.t_start = t.value;
        options_.mode = mode;
        this->refuse_bad_modes();
        started_ = ended_ = this->stops_ = false;
        this->forget_holds();
        run_.outcome = Outcome::reached_end;
        this->forget_cause();
        this->pending_ = Pending::nothing;
        this->sets_.begin_instant();
        search_.fired().clear();
        if (defers_) planner_->forget_wrong();
        step_.restart(t, x, mode);
        place_rate(dxdt);
        h_next_ = scale;
        time_events_.forget();
        if (timed_) this->find_time_event(Engine::After::start);
        guards_.forget();
        if (guarded_) this->arm_at_start(!options_.continues);
        started_ = true;
        return or_start_anew([&] { return go_on(); });
    }

    Verdict examine(const HostStepTable& step) override
    {
        require_turn("examine");
        require_next(step);
        time_event_due_ = timed_ && ends_at_time_event(step);
        return or_start_anew([&] { return check_at(step); });
    }

    Verdict resume(const double* dxdt, double scale) override
    {
        if (this->pending_ == Pending::nothing || ended_) {
            throw_out_of_turn("resume", "it after a verdict `cut` alone");
        }
        require_length("the scale of `resume`", scale);
        return or_start_anew([&] {
            place_rate(dxdt);
            h_next_ = scale;
            return go_on();
        });
    }

    Verdict resume(const X& after, Mode mode, const double* dxdt, double scale) override
    {
        if (this->pending_ == Pending::nothing || ended_) {
            throw_out_of_turn("resume", "it after a verdict `cut` alone");
        }
        require_finite(step_.start(), after);
        require_length("the scale of `resume`", scale);
        const std::size_t modes = this->modes();
        if (modes > 0 && mode >= modes) throw_unknown_mode(who, mode, modes);
        step_.restart(step_.start(), after, mode);
        return resume(dxdt, scale);
    }

    Verdict hold(double t) override
    {
        if (!holds_.rests() || ended_)
            throw_out_of_turn("hold", "it after a verdict `rests` alone");
        if (!lies_before(step_.start().value, t) || !std::isfinite(t)) {
            throw_hold_not_ahead(step_.start().value, t);
        }
        const bool due = timed_ && !lies_before(t, time_event());
        if (due && t != time_event()) throw_beyond_time_event(time_event(), t);
        return or_start_anew([&] { return hold_until(t, due); });
    }

    [[nodiscard]] const Cut<X>& cut() const noexcept override { return cut_; }
    [[nodiscard]] Instant t() const noexcept override { return step_.start(); }
    [[nodiscard]] const X& x() const noexcept override { return step_.x0(); }
    [[nodiscard]] Mode mode() const noexcept override { return step_.mode(); }
    [[nodiscard]] double must_stop_at() const noexcept override { return time_event(); }
    [[nodiscard]] std::span<const std::size_t> held() const noexcept override
    {
        return step_.held();
    }
    [[nodiscard]] double quiet_until() const noexcept override
    {
        if (!guarded_) return backward_ ? -Engine::infinity : Engine::infinity;
        const bool planned = defers_ && started_ && !ended_ && !holds_.rests() && !newly_armed_ &&
                             this->pending_ == Pending::nothing;
        return planned ? clock(planner_->limit()) : step_.start().value;
    }

    void skip_to(const Instant& t, const X& x, const double* dxdt) override
    {
        require_turn("skip_to");
        if (clock(t.value) < clock(step_.start().value)) throw_gap(step_.start().value, t.value);
        if (!(clock(t.value) <= clock(quiet_until()))) throw_not_quiet(quiet_until(), t.value);
        if (timed_ && !lies_before(t.value, time_event())) {
            throw_beyond_time_event(time_event(), t.value);
        }
        require_finite(t, x);
        if (quiet_until() == step_.start().value && !same_state(x, step_.x0())) {
            throw_not_quiet(quiet_until(), t.value);
        }
        step_.restart(t, x, step_.mode());
        place_rate(dxdt);
        ++run_.statistics.steps;
        this->count_deferred(1);
    }

    [[nodiscard]] Side side(std::size_t guard) const override
    {
        if (guard >= guards_.size()) throw_no_such_guard(guard, guards_.size());
        return guards_[guard].side;
    }
    [[nodiscard]] const Run<X>& run() noexcept override
    {
        this->collect_counts();
        this->list_armed_beyond();
        return run_;
    }
    void clear_events() noexcept override { run_.events.clear(); }

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
        holds_.resume();
        this->heed_holds();
        step_.restart(place_);
        this->watching_ = false;
        time_events_.forget_here();
        this->forget_cause();
        this->pending_ = Pending::nothing;
        started_ = true;
        if (guarded_) search_.begin(step_.x0());
        if (defers_) planner_->restore(guards_);
    }

private:
    using Engine::backward_;
    using Engine::defers_;
    using Engine::ended_;
    using Engine::finders_;
    using Engine::guarded_;
    using Engine::guards_;
    using Engine::h_next_;
    using Engine::holds_;
    using Engine::newly_armed_;
    using Engine::options_;
    using Engine::planner_;
    using Engine::run_;
    using Engine::search_;
    using Engine::step_;
    using Engine::system_;
    using Engine::time_event;
    using Engine::time_event_due_;
    using Engine::time_events_;
    using Engine::timed_;

    // --- calls out of turn ---

    void require_turn(std::string_view call) const
    {
        if (!started_) throw_out_of_turn(call, "`start` before it");
        if (this->pending_ != Pending::nothing) throw_out_of_turn(call, "`resume` after a cut");
        if (ended_) throw_out_of_turn(call, "`start` after the end of a run");
        if (holds_.rests() && call == "examine")
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
        const double gap = std::fabs(step_.until(step.t));
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(step_.start().value);
        if (!(gap <= 4 * ulp + 1e-9 * step.h)) throw_gap(step_.start().value, step.t);
        const X& x = step_.x0();
        for (std::size_t i = 0; i < x.size(); ++i) {
            if (!(x[i] == step.x0[i])) throw_state_moved(i, x[i], step.x0[i]);
        }
        for (const std::size_t i : step_.held()) {
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
            this->forget_holds();
            this->pending_ = Pending::nothing;
            step_.restart(step_.start(), step_.x0(), step_.mode());
            throw;
        }
    }

    [[nodiscard]] Verdict check_at(const HostStepTable& step)
    {
        show(step);
        if (!holds_.empty()) return check_held(step);
        return check_shown(step);
    }

    void show(const HostStepTable& step)
    {
        step_.show(step);
        if (std::exchange(departs_, false)) step_.align_start();
        h_next_ = step.h;
        this->sets_.begin_instant();
    }

    /// Examines a step in which components are held, no farther than to where they are released.
    [[nodiscard]] Verdict check_held(const HostStepTable& step)
    {
        const auto release = holds_.first_release(step.h, [this, &step](double s, X& x) {
            if (s == step.h) return assign(x, step_.x1());
            s == 0 ? assign(x, step_.x0()) : step_.interpolate(s, x);
        });
        const bool released = release.hold != no_guard && (release.at < step.h || !time_event_due_);
        if (!released) {
            const std::size_t left = holds_.guard_left_at(step_.time(step.h), step_.x1());
            if (left != no_guard) {
                this->end(Outcome::zeno, left);
                step_.restart(step_.start(), step_.x0(), step_.mode());
                return Verdict::ended;
            }
            return check_shown(step);
        }
        X end = step_.x0(), rate = end;
        HostStepTable part = step;
        if (release.at < step.h) {
            step_.restep(release.at, end);
            step_.flow(release.at, end, rate);
            part.h = release.at;
            part.x1 = end.data();
            part.rate1 = rate.data();
            part.is_cubic = false;
            time_event_due_ = false;
            departs_ = step_.is_aligned();
            show(part);
        }
        const Verdict verdict = check_shown(part);
        if (verdict != Verdict::stands) return verdict;
        cut_.s = part.h;
        this->release_here(release.hold);
        return show_set();
    }

    [[nodiscard]] Verdict check_shown(const HostStepTable& step)
    {
        if (holds_set()) {
            cut_.s = search_.at();
            this->cut_short();
            return show_set();
        }
        if (ended_) {
            step_.restart(step_.start(), step_.x0(), step_.mode());
            return Verdict::ended;
        }
        if (time_event_due_) assign(this->left_start_, step_.rate0());
        step_.accept_shown();
        ++run_.statistics.steps;
        this->last_h_ = step.h;
        if (!time_event_due_) return Verdict::stands;
        cut_.s = step.h;
        step_.hold(time_event());
        this->apply_time_event(step.h);
        return show_set();
    }

    /// Whether a set of events cuts the step short. False, too, if the run has ended.
    [[nodiscard]] bool holds_set()
    {
        // Bounds are those of the flow, and not of what a rest leaves of it.
        const bool plans = defers_ && holds_.empty() && !planner_->steps_aside();
        if (plans) return holds_set_by_plan();
        if (defers_) this->watch_all();
        bool cleared = false;
        return this->deserves_search(cleared) && finds(cleared);
    }

    [[nodiscard]] bool finds(bool cleared)
    {
        std::size_t broken = guards_.first_not_finite();
        if (broken == no_guard) broken = guards_.first_without_rate();  // the host no longer has it
        if (broken == no_guard) return this->find(cleared);
        this->end_not_finite("", broken);
        return false;
    }

    /// Plans with intervals of a single step, since a host does not return to earlier steps.
    [[nodiscard]] bool holds_set_by_plan()
    {
        if (newly_armed_) this->begin_plan();
        const double end = clock(step_.time(step_.h()));
        bool found = false;
        if (planner_->covers(end)) {
            planner_->sample_sleeper(step_, guards_, run_.statistics);
            this->count_deferred(1);
        } else {
            step_.store(planner_->steps().add().start);
            planner_->overrun(end);
            const std::size_t doubt = planner_->close(step_, guards_, run_.statistics, h_next_);
            planner_->steps().clear();
            if (doubt == Planner<X, single>::none) {
                this->count_deferred(1);
            } else if (!planner_->wrong()) {
                found = this->judges_suspicious() && finds(false);
                if (!found && !ended_) planner_->settle(step_, guards_, run_.statistics);
            }
        }
        if (planner_->wrong()) this->name_wrong_bound();
        return found && !ended_;
    }

    [[nodiscard]] double clock(double t) const noexcept { return backward_ ? -t : t; }

    // --- rests ---

    [[nodiscard]] Verdict hold_until(double t, bool due)
    {
        cut_.s = 0;
        const double length = step_.until(t);
        const auto kept = [this](double, X& x) { assign(x, step_.x0()); };
        const auto release = holds_.first_release(length, kept);
        if (release.hold != no_guard && (release.at < length || !due)) {
            step_.hold(release.at < length ? step_.time(release.at) : t);
            this->sets_.begin_instant();
            this->release_here(release.hold);
            return show_set();
        }
        const std::size_t left = holds_.guard_left_at(t, step_.x0());
        if (left != no_guard) {
            this->end(Outcome::zeno, left);
            return Verdict::ended;
        }
        step_.hold(t);
        if (!due) return Verdict::rests;
        this->sets_.begin_instant();
        step_.refresh();
        this->apply_time_event();
        return show_set();
    }

    // --- sets ---

    void place_rate(const double* dxdt)
    {
        if (dxdt) return step_.set_rate(dxdt);
        step_.refresh();
        if (!step_.flow_fits()) throw_flow_does_not_fit(who, step_.x0().size());
    }

    /// Arms the guards; a set that follows at the same instant is returned as another cut.
    Verdict go_on()
    {
        departs_ = true;
        assign(cut_.before, step_.x0());
        cut_.mode_before = step_.mode();
        if (!this->settle()) {
            if (ended_) return Verdict::ended;
            if (holds_.rests()) return Verdict::rests;
            const bool plans = defers_ && holds_.empty() && !planner_->steps_aside();
            if (plans) this->begin_plan();
            return Verdict::stands;
        }
        cut_.s = 0;
        return show_set();
    }

    Verdict show_set()
    {
        if (this->pending_ == Pending::nothing) return Verdict::ended;
        cut_.t = step_.start();
        const bool released = this->pending_ == Pending::arm_released;
        cut_.accumulation = this->pending_ != Pending::settle && !released;
        if (released) {
            assign(cut_.before, step_.x0());
            cut_.mode_before = step_.mode();
        } else if (!cut_.accumulation) {
            assign(cut_.before, search_.before());
            cut_.mode_before = this->mode_before_;
        }
        assign(cut_.after, step_.x0());
        cut_.mode_after = step_.mode();
        cut_.on_time = !cut_.accumulation && !released && this->on_time_;
        // The rates of a motion that goes free are not those of the state that was kept.
        cut_.state_changed = released || !same_state(cut_.before, cut_.after);
        cut_.fired.assign(search_.fired().begin(), search_.fired().end());
        std::sort(cut_.fired.begin(), cut_.fired.end());
        return Verdict::cut;
    }

    // --- saving ---

    [[nodiscard]] std::vector<RunProperty> properties() const
    {
        return {{"monitor of", system_->name(system_.adapter())},
                {"detector", plain_type_name(finders_.detector.type)},
                {"locator", plain_type_name(finders_.locator.type)},
                {"guards", std::to_string(guards_.size())},
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
        require(h_next_ > 0 && std::isfinite(h_next_), "the scale");
        const std::size_t modes = this->modes();
        require(modes == 0 || place_.mode < modes, "the mode");
        require(holds_.fit(place_.x.size()), "what a rest holds");
    }

    template <class Visitor>
    void visit_state(Visitor&& visit)
    {
        if constexpr (std::remove_cvref_t<Visitor>::saves) place_ = step_.place();
        visit(place_.t.value);
        visit(place_.t.remainder);
        visit(place_.mode);
        for (X* x : {&place_.x, &place_.remainder, &place_.rate}) visit.state(*x);
        visit(h_next_);
        time_events_.visit(visit);
        holds_.visit(visit);
        visit(departs_);
        visit(ended_);
        visit(run_.outcome);
        this->visit_guards(visit);
        if (defers_) {
            visit(this->last_h_);
            visit(newly_armed_);
            planner_->visit(visit);
        }
    }

    std::size_t components_;  ///< number of components of the state that it was made for
    Cut<X> cut_;
    bool started_ = false;
    bool departs_ = false;  ///< guards have been armed at the start of the next step
    StepStart<X> place_;
};

}  // namespace ricochet::detail
