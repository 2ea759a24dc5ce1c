// A run in progress: smooth steps, events, resets, until the end or a reason to stop.
//
//     step from (t, x)              the method, as a departure from the tangent
//     guards at its end             screened, all at once
//     search                        the first set of events in the step
//     resets                        x⁻ becomes x⁺, the mode may change
//     arming                        every guard anew; guards that a reset carried across fire
//
// Steps are half-open, (t, t + h]. Between the first step and the last nothing is allocated for
// states of fixed size, unless something is recorded.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/event_search.hpp"
#include "core/guard_bank.hpp"
#include "core/initial_step.hpp"
#include "core/merged_resets.hpp"
#include "core/metering.hpp"
#include "core/planner.hpp"
#include "core/step.hpp"
#include "ricochet/detail/core.hpp"
#include "ricochet/detail/refusals.hpp"
#include "ricochet/detail/step_control.hpp"
#include "ricochet/integrate/options.hpp"
#include "ricochet/integrate/run.hpp"
#include "ricochet/integrate/snapshot.hpp"

namespace ricochet::detail {

/// What a `Core` needs of a loop, whatever it has been compiled for.
template <class X>
class AnyLoop {
public:
    AnyLoop() = default;
    AnyLoop(const AnyLoop&) = delete;
    AnyLoop& operator=(const AnyLoop&) = delete;
    virtual ~AnyLoop() = default;

    [[nodiscard]] virtual double t() const noexcept = 0;
    [[nodiscard]] virtual const X& x() const noexcept = 0;
    [[nodiscard]] virtual Mode mode() const noexcept = 0;
    [[nodiscard]] virtual bool ended() const noexcept = 0;
    [[nodiscard]] virtual const Run<X>& run() const noexcept = 0;
    [[nodiscard]] virtual MeterReading meter() const = 0;
    virtual bool step() = 0;
    virtual bool advance() = 0;
    virtual void show_all() noexcept = 0;
    virtual void advance_once(bool look_ahead) = 0;
    [[nodiscard]] virtual Run<X> take() = 0;
    [[nodiscard]] virtual Run<X> finish() = 0;
    [[nodiscard]] virtual Snapshot save() = 0;
    virtual void restore(const Snapshot& snapshot) = 0;
};

template <class X, bool single>
class Loop : public AnyLoop<X> {
    static constexpr double infinity = std::numeric_limits<double>::infinity();

public:
    /// Keeps a reference to `setup`.
    Loop(const RunSetup<X>& setup, const X& x0, const Options& options)
        : setup_(setup),
          system_(*setup.system, setup.door),
          finders_{setup.detector, setup.detecting, setup.locator, setup.locating},
          error_controlled_(setup.error_controlled),
          guarded_(system_->guarded),
          resets_any_(system_->resets()),
          timed_(system_->timed()),
          puts_off_(setup.detector.puts_off),
          predicts_(setup.detector.clears != nullptr),
          options_(checked(options, x0)),
          meter_(puts_off_ ? nullptr : setup.detector.metering),
          resolution_(options),
          backward_(options.t_end < options.t_start),
          components_(static_cast<std::size_t>(x0.size())),
          step_(system_, *setup.kernel, options.t_start, x0, options.mode, backward_),
          bank_(system_, BankRules::of(setup.detector, system_), backward_),
          search_(x0, bank_.size(), finders_, resolution_),
          resets_(x0)
    {
        if (puts_off_) planner_.emplace(system_, finders_, x0, backward_, bank_.size());
        h_next_ = options_.step > 0 ? options_.step : std::fabs(options_.t_end - options_.t_start);
        if (error_controlled_) {
            if (step_.error_order() == 0) throw_no_error_estimate();
            if (options_.step == 0) h_next_ = initial_step(step_, options_);
            h_next_ = std::min(h_next_, options_.h_max);
        }
        first_step_ = h_next_;
        flight_start_ = options_.t_start;
        refuse_bad_modes();
        if (!step_.flow_fits()) throw_flow_does_not_fit(components_);
        if (guarded_) refuse_bad_guards();
        if (system_->forward_only && backward_) throw_forward_only();
        if (timed_) {
            if (backward_ && !system_->previous_time_event) throw_no_previous_time_event();
            find_time_event(true);
        }
        if (setup.detector.check) {
            const double smallest = error_controlled_ ? options_.h_min : options_.step;
            const double largest = error_controlled_ ? options_.h_max : options_.step;
            setup.detector.check(setup.detecting, setup.door, x0, smallest, largest);
        }
        if (guarded_) arm_at_start();
    }
    [[nodiscard]] double t() const noexcept override  ///< [s]
    {
        return showing_sample_ ? run_.trajectory.t[shown_samples_ - 1] : step_.start().value;
    }
    [[nodiscard]] const X& x() const noexcept override
    {
        return showing_sample_ ? run_.trajectory.x[shown_samples_ - 1] : step_.x0();
    }
    [[nodiscard]] Mode mode() const noexcept override
    {
        return showing_sample_ ? sample_mode_ : step_.mode();
    }
    [[nodiscard]] bool ended() const noexcept override { return ended_; }
    /// What has been computed so far; its time and state are brought up to date by
    /// `finish`.
    [[nodiscard]] const Run<X>& run() const noexcept override { return run_; }

    /// Of a `Metered` detector: what asking its network has cost and saved so far.
    [[nodiscard]] MeterReading meter() const override
    {
        return puts_off_ ? planner_->meter().reading() : meter_.reading();
    }

    /// Takes one step, with whatever events it holds. False: the run has ended. A detector
    /// that puts off checks does not look ahead here, since every step is final.
    bool step() override
    {
        show_all();
        if (!ended_) advance_one({.look_ahead = false});
        return !ended_;
    }

    /// Goes on to the next sample time, or to the end of the next step that holds events;
    /// `t`, `x` and `mode` are those there, after the events. False: the run has ended, and
    /// nothing has happened in it that was not shown.
    bool advance() override;

    /// One step that may end in the middle of a stretch of tentative steps if it looks ahead.
    void advance_once(bool look_ahead) override { advance_one({.look_ahead = look_ahead}); }

    /// `advance` shows only what happens from here on.
    void show_all() noexcept override
    {
        shown_samples_ = run_.trajectory.t.size();
        shown_events_ = run_.statistics.events;
        showing_sample_ = false;
    }

    /// Goes on to the end and hands over all that was computed.
    [[nodiscard]] Run<X> take() override;

    /// Hands over what has been computed so far; before the end its outcome is `cancelled`. The
    /// simulation is over.
    [[nodiscard]] Run<X> finish() override;

    /// All that the future depends on. A simulation of the same system with the same
    /// options, stepping, detector and locator that restores it goes on with the same
    /// bits; only its end, its sample times and what it records may be others. What was
    /// recorded is not part of it.
    [[nodiscard]] Snapshot save() override;

    /// @throws std::invalid_argument naming what does not agree if the snapshot is of another
    /// run, or no state of one; then nothing has changed.
    void restore(const Snapshot& snapshot) override;

private:
    // --- set-up ---

    const Options& checked(const Options& options, const X& x0) const;

    [[nodiscard]] std::vector<RunProperty> properties() const;

    /// Of a snapshot that has been read.
    void refuse_bad_place() const;

    void refuse_bad_modes() const
    {
        const std::size_t modes = system_.modes();
        if (modes > 0 && options_.mode >= modes) throw_unknown_mode(options_.mode, modes);
    }

    void refuse_bad_guards();

    void arm_at_start();

    /// What rounding of the time and of the state, 8 units in the last place of each
    /// component, may make of guard i at the start of the step.
    [[nodiscard]] double rounding_of(std::size_t i);

    // --- steps ---

    [[nodiscard]] std::uint64_t& calls() noexcept { return run_.statistics.guard_calls; }

    void end(Outcome outcome, std::size_t guard = no_guard) noexcept
    {
        run_.outcome = outcome;
        run_.guard = guard;
        ended_ = true;
    }

    /// What a detector that puts off checks may do.
    struct Advance {
        bool look_ahead = true;       ///< take steps that are closed only later
        bool to_next_sample = false;  ///< but none beyond one with a sample time
    };

    /// One step, with whatever events it holds.
    void advance_one(const Advance& how);

    // --- steps in a row in which nothing happens ---

    [[nodiscard]] bool may_run_quietly() const noexcept
    {
        return setup_.quiet && !resting_ && run_.statistics.steps < next_review_ &&
               !options_.record_steps && next_sample_ >= options_.sample_times.size() &&
               bank_.is_steady();
    }

    /// Goes on until a step deserves a look, and deals with it. False: there is none.
    bool run_quietly();

    /// Whether the run may go on after as many steps; decides when it is asked next.
    [[gnu::noinline]] bool may_take_more_steps();

    /// Whether time has hardly advanced since the last review.
    [[nodiscard]] bool stands_still() const noexcept
    {
        const double span = std::fabs(options_.t_end - options_.t_start);
        return std::fabs(step_.until(reviewed_)) < 1e-9 * span;
    }

    /// A failure of a step, or what lies behind it.
    void end_step(Outcome outcome) noexcept
    {
        end(step_.flow_fits() ? outcome : Outcome::wrong_dimension);
    }

    void reach_end();

    /// The step stands, with a time event at its end if one is due.
    void pass()
    {
        if (timed_ && time_event_due_) return happen_on_time();
        accept();
    }

    void accept();

    // --- steps whose checks may be deferred ---

    [[nodiscard]] bool is_tentative() const noexcept { return puts_off_ && planner_->in_stretch(); }

    /// One step with a look at its end, where planning does not pay.
    void advance_with_check(double remaining);

    void advance_by_plan(double remaining, const Advance& how);

    void remember_step(double proposed, std::uint64_t rejected);

    /// Whether the next step, too, may be taken before the stretch is closed.
    [[nodiscard]] bool may_go_on(double ends, const Advance& how);

    /// The step in hand is the last of its stretch: closes it, or goes back to the first step
    /// that could not be closed.
    void close_stretch();

    /// The exact detector looks at the step in hand, for the guards in doubt.
    void judge();

    void name_wrong_bound()
    {
        run_.wrong_bound = planner_->wrong();
        end(Outcome::wrong_bound, run_.wrong_bound->guard);
    }

    void count_put_off(std::size_t steps) noexcept
    {
        run_.statistics.checks_put_off += steps;
        add_evidence(finders_.detector.put_off, steps);
    }

    void add_evidence(Evidence evidence, std::uint64_t steps) noexcept;

    /// Takes back the whole stretch, without having looked, and goes on carefully.
    void take_back()
    {
        careful_steps_ = planner_->steps().size() + 1;
        planner_->abandon();
        take_back_to(0);
    }

    /// Goes back to the start of tentative step k.
    void take_back_to(std::size_t k);

    [[nodiscard]] bool holds_sample() const noexcept
    {
        const auto& times = options_.sample_times;
        return next_sample_ < times.size() &&
               lies_before(times[next_sample_], step_.time(step_.h()));
    }

    /// Takes a step no longer than `remaining` [s] or the time to the next time event.
    /// False: the run has ended.
    [[nodiscard]] bool take_step(double remaining);

    /// Shorter only where the setup ends within the step, at the surface of a guard.
    [[nodiscard]] bool take_fixed_step(double h, bool failed = false);

    /// `proposed`: what the step would have been if nothing had cut it short.
    [[nodiscard]] bool take_controlled_step(double h, double proposed)
    {
        const double error = step_.attempt(h, options_.rtol, options_.atol);
        return retry(h, proposed, rule_.largest, error);
    }

    /// Repeats an attempt of `error`, shorter, until one is accepted; the next step is at most
    /// `largest` times as long.
    [[nodiscard]] bool retry(double h, double proposed, double largest, double error);

    /// A guard that acts or records, and when it reaches its surface at its present rate.
    struct Approach {
        std::size_t guard = no_guard;
        double ahead = infinity;  ///< [s]
    };

    /// The first guard to reach its surface in the direction that counts.
    [[nodiscard]] Approach time_to_surface();

    [[nodiscard]] double approach_rate(std::size_t i);

    /// The next length to try after one of h that left the domain of the flow or a guard: nine
    /// tenths of the way to a surface that lies within it, else a tenth.
    [[nodiscard]] double shorten_to_surface(double h)
    {
        const double ahead = time_to_surface().ahead;
        return ahead <= h ? 0.9 * ahead : 0.1 * h;
    }

    /// The flow ends here, as it cannot be evaluated a step of h further on, and a guard reaches
    /// its surface no later: its event happens at the start of the step.
    [[nodiscard]] bool happen_where_flow_ends(double h);

    [[nodiscard]] double smallest_step() const noexcept
    {
        const double ulp = std::numeric_limits<double>::epsilon() * std::fabs(step_.start().value);
        return std::max(options_.h_min, std::max(4 * ulp, std::numeric_limits<double>::min()));
    }

    /// A mode-less system at rest stays as it is, until a time event or the end.
    void hold(double remaining);

    // --- time events ---

    /// One that is not ahead would be lost, with all that follow it.
    void find_time_event(bool at_start = false);

    /// The step has ended at a time event.
    void happen_on_time()
    {
        accept();
        apply_time_event();
    }

    void apply_time_event();

    // --- events ---

    /// Looks for events in the step; true if they have cut it short, or the run has
    /// ended.
    [[nodiscard]] bool handle_events();

    /// Whether any guard deserves a search. Detectors that ask for it see the guards inside
    /// the step, too; a second time where the first leaves doubts.
    [[nodiscard]] bool any_suspicious()
    {
        if (!bank_.looks() || !options_.look_inside) return bank_.suspicious(step_.h());
        look_inside();
        return deserves_search(error_controlled_ && hardly_moves());
    }

    /// The same after a look inside, if there is one; `moves` hardly: at several places more.
    [[nodiscard]] bool deserves_search(bool hardly_moves);

    void look_inside();

    /// Whether the state hardly changes in the step, which error control then does not limit.
    [[nodiscard]] bool hardly_moves() const noexcept;

    /// Whether the network predicts that the step is free of events.
    [[nodiscard]] bool ask_network();

    /// The step may hold events: finds out, and deals with them.
    [[gnu::noinline]] bool search(bool cleared);

    /// A guard is no number at the end of the step: takes it again, shorter, until all are.
    /// False: there is no such step, and the run has ended.
    [[nodiscard]] bool return_to_domain();

    /// A length at whose end a guard may be a number again: `beyond` a surface that lies within
    /// the step by a little, where it can be seen to be crossed, else before it.
    [[nodiscard]] double shorten_into_domain(bool beyond);

    void count_refined() noexcept
    {
        run_.statistics.refined_steps += search_.refined();
        run_.statistics.unresolved_steps += search_.unresolved();
    }

    [[gnu::noinline]] void end_plateaus()
    {
        for (std::size_t i = 0; i < bank_.size(); ++i) {
            if (bank_.leaves_plateau(i)) search_.end_plateau(step_, bank_, i, calls());
        }
    }

    /// Whether guard i counts at the start of the step; it is about to fire there.
    [[nodiscard]] bool counts_here(std::size_t i);

    /// Members whose crossing is no event go on without one: those that `enabled`
    /// rules out, and repeats of an event inside its own window.
    void dismiss_members();

    /// The guard has just had its event in the same direction. If it has not turned back
    /// since, this is the same crossing, seen again because the reset moved the state by a
    /// rounding; else it is a new event, and events accumulate.
    [[nodiscard]] bool repeats(std::size_t i, double t) const noexcept
    {
        const GuardRecord& record = bank_[i];
        return record.side == record.last_side &&
               std::fabs(t - record.last) <= resolution_.window(t);
    }

    [[nodiscard]] bool turned_back(std::size_t i) const noexcept
    {
        return resets_any_ && bank_[i].info.resets && bank_[i].turned;
    }

    /// Computes what the resets of the members make of the state before.
    void transform(bool on_time)
    {
        const double t = on_time ? time_event_ : time_of_set();
        resets_.apply(system_, bank_, search_.members().span(), on_time, step_.mode(), t,
                      search_.before());
    }

    /// Whether the event leaves everything as it was, so that the step can stand.
    [[nodiscard]] bool changes_nothing();

    /// Whether this event of the guard, not yet counted, ends the run.
    [[nodiscard]] bool ends_run(std::size_t i) const noexcept;

    void go_on_past_members();

    /// The set that was found cuts the step short.
    void act(bool on_time);

    /// The step after an event at `t` is at most twice the flight before it, or the first
    /// step: no further than what is known of the setup reaches, wherever the end lies. Events
    /// that follow at once shorten it by no more than error control would at each of them.
    void limit_next_step(double t) noexcept;

    /// How far from its surface a guard that has just fired may be. A guard with declared
    /// bounds may be expensive, and is not asked for what its location says as well.
    void find_band(std::size_t i, double t);

    /// |g| where the guard has fired, at the state before.
    [[nodiscard]] double residue_of(std::size_t i, double t)
    {
        return std::fabs(bank_.view(i, mode_before_, calls()).value(t, search_.before()));
    }

    [[nodiscard]] double time_of_set() const noexcept { return set_instant_.value; }

    struct Firing {
        bool located = false;  ///< inside the current step, else at its start
        bool on_time = false;  ///< with a time event
    };

    /// The members fire: `search_.before()` becomes `resets_.after()`. Leaves
    /// the guards that it carries across their surfaces as the new members.
    void fire(const Firing& how);

    [[nodiscard]] std::size_t first_member()
    {
        return search_.members().empty() ? no_guard : search_.members()[0];
    }

    /// Whether the resets have left something to go on from; else the run has ended.
    [[nodiscard]] bool goes_on();

    [[nodiscard]] bool fits_dimension(const X& before, const X& after, bool same_mode) const
    {
        return system_.fits_dimension(before, after, same_mode);
    }

    /// Whether the events of a member accumulate here. It comes to rest, or the run
    /// ends.
    [[nodiscard]] bool accumulates(bool located);

    /// Notes how guard i leaves its surface after its reset. True if it is not going to rise
    /// above its rounding any more.
    [[nodiscard]] bool fades(std::size_t i);

    /// Whether the reset has put guard i so far from its surface, on the side it came from, that
    /// it need not rise: not a residue of the location.
    [[nodiscard]] bool is_away(std::size_t i, double rounding);

    /// The rate [1/s] of guard i at the start of the step; where it is a difference quotient,
    /// over 1e-5 of `scale` [s].
    [[nodiscard]] double departure(std::size_t i, double scale)
    {
        return bank_.view(i, step_.mode(), calls())
            .rate(step_.time(0), step_.x0(), step_.rate0(), scale);
    }

    /// The limit of the events of guard i is `ahead` [s] from here, give or take `error`.
    void come_to_rest(std::size_t i, double ahead, double error);

    /// Whether guard i stays where it is while the state stands still: its surface does not
    /// move. Looked at from a thousandth of the time that is left to all of it.
    [[nodiscard]] bool stays_on_surface(std::size_t i);

    // --- arming ---

    void enable_guards();

    /// Arms every guard at the start of a flight. The members have fired and count as
    /// being on their surface up to the residue of their location. Those that the
    /// resets have carried across their surface become the new members.
    void arm_all();

    /// False: the run has ended.
    [[nodiscard]] bool arm_one(std::size_t i, double widest);

    /// The side that a crossing which counts leaves; `else_side` where both do.
    [[nodiscard]] static constexpr Side side_left_by(Crossing crossing, Side else_side) noexcept
    {
        return crossing == Crossing::falling  ? Side::above
               : crossing == Crossing::rising ? Side::below
                                              : else_side;
    }

    /// The side that a guard on its surface is about to be on.
    [[nodiscard]] Side heading(std::size_t i);

    /// Guards that a reset has carried across fire in turn, at the same instant, until none is
    /// left.
    void cascade();

    /// The rest rule has not stopped the setup into the surface.
    [[nodiscard]] bool still_stuck(std::size_t i) const noexcept
    {
        return bank_[i].info.unilateral && bank_[i].enabled && bank_[i].side == Side::below;
    }

    /// A unilateral guard on its surface that its reset does not turn back.
    [[nodiscard]] std::size_t stuck_member();

    // --- output ---

    void note_crossings(double s);

    /// All that other guards do up to the set of the members: crossings before it, which
    /// leave a guard on its other side, and crossings with it.
    void note_crossings_to_set();

    [[nodiscard]] bool counts_at_set(std::size_t i);

    [[nodiscard]] bool is_member(std::size_t i) noexcept
    {
        auto& members = search_.members();
        return std::find(members.begin(), members.end(), i) != members.end();
    }

    void record(Event<X>&& event)
    {
        if (!options_.record_events) return;
        if (run_.events.empty()) run_.events.reserve(16);  // most runs grow no further
        run_.events.push_back(std::move(event));
    }

    void count_event(std::size_t i, double t, Side side);

    void record_time_event(double t);

    /// A member of the set, found inside the step or flipped at its start.
    void record_crossing(std::size_t i, double t, bool located);

    /// A notification of a guard that a reset has carried across its surface.
    void record_jump(std::size_t i, Side before);

    /// What happened in the step up to offset s without consequence.
    void record_notes(double s);

    void record_step(double s)
    {
        if (options_.record_steps && s > 0) {
            run_.solution.add(step_.time(0), backward_, step_.mode(), step_.dense(), s);
        }
    }

    [[nodiscard]] bool lies_before(double t, double end) const noexcept
    {
        return backward_ ? t > end : t < end;
    }

    /// Samples of the current step before its offset s.
    void emit_samples(double s);

    /// Samples of a state that does not move, before the time `until`.
    void emit_held_samples(double until);

    void add_sample(X&& x);

    // --- saving ---

    template <class Visitor>
    void visit_state(Visitor&& visit);

    /// The next sample is the first that is neither behind nor written already.
    template <class Visitor>
    void visit_samples(Visitor&& visit);

    static constexpr int most_levels = 100;
    static constexpr double stale = std::numeric_limits<double>::quiet_NaN();
    /// Of the last flight of a guard: over so long the rounding of its small excursions is
    /// magnified less by a difference quotient than over the usual 1e-5 of a step.
    static constexpr double low_part = 0.05;
    static constexpr ErrorRule rule_{};

    const RunSetup<X>& setup_;
    SystemAt<X> system_;
    Finders<X> finders_;
    bool error_controlled_;
    bool guarded_;     ///< has guards, if only none of them yet
    bool resets_any_;  ///< has resets
    bool timed_;
    bool puts_off_;
    bool predicts_;
    Options options_;
    Metering meter_;
    EventResolution resolution_;
    bool backward_;
    std::size_t components_;  ///< of the state at the start
    Step<X> step_;
    GuardBank<X, single> bank_;
    EventSearch<X, single> search_;
    std::optional<Planner<X, single>> planner_;
    double h_next_ = 0;
    double first_step_ = 0;    ///< [s]
    double flight_start_ = 0;  ///< [s] time of the last event
    double longest_step_ = 0;  ///< [s] after it
    double last_h_ = 0;        ///< [s] the step before, or the scale at which guards were armed
    bool newly_armed_ = true;  ///< all guards are sampled at the start of the step, none is planned
    bool watching_ = false;    ///< with their rates: every step is checked
    std::size_t careful_steps_ = 0;  ///< without looking ahead
    std::uint64_t next_review_ = 0;  ///< of the number of steps, against the options
    double reviewed_ = 0;            ///< [s] time of the last review
    double time_event_ = std::numeric_limits<double>::infinity();
    bool time_event_due_ = false;
    bool is_last_ = false;
    bool ended_ = false;
    bool resting_ = false;
    bool stops_ = false;
    int calm_steps_ = 0;  ///< in a row that held no event
    bool asked_ = false;  ///< a network, about the step in hand
    MergedResets<X> resets_;
    Instant set_instant_;  ///< of the members, in a step that holds them
    Mode mode_before_ = 0;
    std::size_t next_sample_ = 0;
    std::size_t shown_samples_ = 0;  ///< by `advance`
    std::uint64_t shown_events_ = 0;
    bool showing_sample_ = false;
    Mode sample_mode_ = 0;
    StepStart<X> place_;
    Run<X> run_;
};

}  // namespace ricochet::detail
