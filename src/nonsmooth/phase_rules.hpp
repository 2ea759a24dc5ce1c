// The rules by which the phases of a set-valued run follow each other.
//
// The inclusion decides while some y is not clear of zero. Its motion is explicit where every
// reaction is at a bound or held, and implicit where that is impossible: changes that coincide,
// reactions that y' = 0 does not determine, switchings that accumulate or chatter. Nothing is kept
// beside time, mode and state but the numbers of `Memory`.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "../core/phase_table.hpp"
#include "ricochet/nonsmooth/detail/branch_phases.hpp"
#include "ricochet/nonsmooth/detail/phased_run.hpp"
#include "ricochet/nonsmooth/detail/stall_watch.hpp"

namespace ricochet::detail {

/// Kind of a phase.
using Kind = Mode;

struct PhaseOptions {
    double t_start = 0, t_end = 0;  ///< [s]
    double rtol = 0, atol = 0;
    double step = 0;     ///< [s] longest implicit steps; with fixed steps their length
    bool fixed = false;  ///< steps of the own flow have that length, too
    std::optional<AloneOptions> alone{};
};

/// The inclusion of a mode of the system.
struct ModeInclusion {
    Mode mode = 0;
    BranchPhases* inclusion = nullptr;  ///< null: the system's own flow is followed
    /// Of each guard of the system: the reaction whose y it is, or `no_reaction`.
    std::vector<std::size_t> stands_for{};
    std::vector<bool> watched{};  ///< reactions whose y is watched in own phases
};

class PhaseRules {
public:
    static constexpr Kind own = 0;

    /// @param any      the inclusion of some mode, which has the sizes of all
    /// @param by_mode  there is one inclusion for each mode, which holds wherever the mode does
    PhaseRules(const BranchPhases& any, bool by_mode, const PhaseOptions& options);
    PhaseRules(const PhaseRules&) = delete;
    PhaseRules& operator=(const PhaseRules&) = delete;

    [[nodiscard]] const PhaseOptions& options() const noexcept { return options_; }

    /// Chooses the reactions whose y is watched in own phases: those of a mode of its own, where
    /// both bounds are finite, or a guard of the system stands for y. Another one with an infinite
    /// bound, such as the reaction of a floor to a speed, may be a law of some modes only.
    void choose_watched(ModeInclusion& of, const double* x0);
    /// Makes a mode of the system the one that the rules are about, until the next call.
    PhaseRules& in(const ModeInclusion& now) noexcept
    {
        now_ = &now;
        return *this;
    }
    [[nodiscard]] const ModeInclusion& now() const noexcept { return *now_; }

    /// Number of guards for each reaction: those of `BranchPhases` and, unless the inclusion is
    /// alone, one on y, which is watched in own phases.
    [[nodiscard]] std::size_t guards_of_reaction() const noexcept
    {
        return BranchPhases::guards_of_reaction + (options_.alone ? 0 : 1);
    }

    // --- kinds ---

    [[nodiscard]] Kind kinds() const noexcept { return over() + 1; }
    [[nodiscard]] Kind across() const noexcept { return 1 + 2 * branch_modes_; }
    [[nodiscard]] bool is_approach(Kind kind) const noexcept
    {
        return kind > across() && kind < over();
    }
    [[nodiscard]] bool is_explicit(Kind kind) const noexcept
    {
        return (kind != own && kind <= branch_modes_) || is_approach(kind);
    }
    /// Whether the guards that stand for a y are watched.
    [[nodiscard]] bool has_own_guards(Kind kind) const noexcept
    {
        return kind == own || is_approach(kind);
    }
    [[nodiscard]] bool is_implicit(Kind kind) const noexcept
    {
        return kind > branch_modes_ && kind <= across();
    }
    /// The branches of a kind that has some, else 0.
    [[nodiscard]] Mode branches_of(Kind kind) const noexcept
    {
        if (is_approach(kind)) return kind - 1 - across();
        if (is_explicit(kind)) return kind - 1;
        return is_implicit(kind) && kind != across() ? kind - 1 - branch_modes_ : 0;
    }
    [[nodiscard]] bool holds(Kind kind) const noexcept
    {
        return is_explicit(kind) && inclusion().holds(branches_of(kind));
    }

    // --- the motion ---

    /// Writes the rate of the state in implicit phases, and where nothing moves.
    void flow(Kind kind, double t, const double* x, double* dxdt);
    /// See `BranchPhases::fraction_of_held`.
    [[nodiscard]] double fraction_of_held(BranchPhases& inclusion, Mode b, double t0,
                                          const double* x0, double t1, const double* x1,
                                          bool may_jump);

    /// The guard of `BranchPhases` that is guard `which` of the phases.
    [[nodiscard]] std::size_t in_branches(std::size_t which) const noexcept
    {
        if (options_.alone) return which;
        return BranchPhases::guards_of_reaction * reaction_of(which) + kind_of_guard(which);
    }
    /// Whether guard `which` of the phases watches own phases.
    [[nodiscard]] bool watches_own(std::size_t which) const noexcept
    {
        return !options_.alone && kind_of_guard(which) == BranchPhases::guards_of_reaction;
    }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const;
    /// What a guard is about, in messages.
    [[nodiscard]] std::string name_of(std::size_t which) const;
    /// Whether a guard that watches own phases is enabled.
    [[nodiscard]] bool watches(std::size_t which, Kind kind) const;
    // Guards that watch own phases are evaluated here, and all guards outside explicit phases.
    [[nodiscard]] double guard(std::size_t which, double t, const double* x) const;
    void guards(Kind kind, double t, const double* x, std::span<double> g) const;
    [[nodiscard]] double guard_rate(std::size_t which, double t, const double* x,
                                    const double* dxdt) const;
    void guard_rates(Kind kind, double t, const double* x, const double* dxdt,
                     std::span<double> rates) const;
    /// Whether a reaction is held at its bound. It may stay there for any time, and where it leaves
    /// is an event: until then the room that it has, which is zero, counts as inside.
    [[nodiscard]] bool is_at_bound() const noexcept { return is_at_bound_; }
    /// The room of a held reaction as a guard: far from zero where it is zero up to rounding.
    [[nodiscard]] double room_at_bound(std::size_t i, double room) const noexcept
    {
        return std::fabs(room) <= at_bound_[i] ? at_bound_[i] * 0x1p40 : room;
    }
    /// The same for one of the guards, and for all of them.
    [[nodiscard]] double guard_at_bound(std::size_t which, double g) const noexcept
    {
        const std::size_t kind = kind_of_guard(which);
        return kind == 2 || kind == 3 ? room_at_bound(reaction_of(which), g) : g;
    }
    void set_guards_at_bound(std::span<double> g) const noexcept
    {
        for (std::size_t which = 0; which < g.size(); ++which) {
            g[which] = guard_at_bound(which, g[which]);
        }
    }
    /// Sets the numbers of the guards that watch own phases.
    void fill_watching(std::span<double> numbers, double to) const noexcept
    {
        if (options_.alone) return;
        constexpr std::size_t from = BranchPhases::guards_of_reaction;
        for (std::size_t i = from; i < numbers.size(); i += from + 1) numbers[i] = to;
    }

    /// A place s [s] after the start of a step, where the state is x.
    struct Place {
        double t0;
        const double* x0;
        double s, t;
        const double* x;
    };
    /// Writes the reactions there; none without an inclusion, NaN where none follows.
    void reaction(Kind kind, const Place& at, std::vector<double>& r);

    // --- rules ---

    /// The kind of phase in which a run starts. @throws InclusionRefused
    [[nodiscard]] Kind enter(double t, double* x);
    /// The kind of phase that follows from (t, x) alone: after a change of mode that has changed
    /// the inclusion, and after the reset of a change.
    [[nodiscard]] Kind enter_mode(Kind before, double t, double* x);

    /// A guard of a set: one of the phases, or one of the system with a reaction.
    struct Fired {
        std::size_t which = no_guard;        ///< of the phases
        std::size_t guard = no_guard;        ///< of the system
        std::size_t reaction = no_reaction;  ///< whose y the guard is
        std::size_t asks = no_reaction;      ///< that is asked where its y is at rest
    };
    struct Set {
        Kind kind;
        double t;
        std::span<const Fired> fired;
        bool on_time, on_change;
        const double* before;
    };
    [[nodiscard]] Kind decide(const Set& set, double* x);
    /// Forgets the changes of the set before.
    void forget_changes();
    /// Moves x, where reactions have arrived, onto the side that their y come from. False where
    /// that is impossible.
    [[nodiscard]] bool step_back(double t, double* x);
    /// Whether the flow of the system at (t, x), on that side, is that of the inclusion.
    [[nodiscard]] bool is_flow(double t, const double* x, const double* rate);
    /// As `is_flow`, at a start from which the inclusion decides, where every y is farther from
    /// zero than a thousandth of what it reads, whatever the tolerances are.
    [[nodiscard]] bool is_flow_at_start(double t, const double* x, const double* rate);
    [[nodiscard]] Kind end_as_violated() { return end_with(Outcome::law_violated); }
    [[nodiscard]] std::span<const ReactionChange> changes() const noexcept { return changes_; }
    /// Whether a guard of the system has an event of its own in the last set.
    [[nodiscard]] bool records(std::size_t reaction, std::size_t guard) const;

    struct Verdict {
        PhaseVerdict::Kind what = PhaseVerdict::Kind::stands;
        Kind kind = own;
        double h = 0;
        Outcome outcome = Outcome::reached_end;
    };
    struct Step {
        Kind kind;
        double t;
        const double* rate;
        double h_next;
        bool has_advanced;
    };
    /// Whether the phase in branches b of an inclusion goes on, as far as a quick test tells.
    [[nodiscard]] bool goes_on(Kind kind, const BranchPhases& inclusion, Mode b, double t,
                               const double* x, bool has_advanced)
    {
        const bool may_let_go = !options_.alone || options_.alone->until_released;
        if (begins_ || is_approach(kind) || (may_let_go && !inclusion.holds(b))) return false;
        if (is_at_bound_) return false;
        if (memory_.contradicts != 0 || memory_.fluttering > most_flutters) return false;
        if (memory_.events >= memory_.marked_events + most_events) return false;
        if (stall_.is_due(steps_ + has_advanced)) return false;
        if (!inclusion.keeps_sides(b, t, x, sides_.data())) return false;
        kind_ = kind;
        steps_ += has_advanced;
        return true;
    }
    [[nodiscard]] Verdict review(const Step& step, double* x);

    struct End {
        Kind kind;
        Outcome outcome;
        double t;
        bool of_phases;        ///< not by a guard of the system
        std::size_t which;     ///< guard of the phases, or `no_guard`
        std::size_t reaction;  ///< of the guard of the system, or `no_reaction`
    };
    [[nodiscard]] Verdict give_up(const End& end, double* x);

    // --- records ---

    /// How an inclusion alone has ended.
    [[nodiscard]] EndInBranches end_in_branches(double t, const double* x) const;
    /// A sentence about the end that the rules have given to the run.
    [[nodiscard]] const std::string& reason() const noexcept { return reason_; }
    /// Moves the list of phases to `phases`, where it goes on.
    void list_in(std::vector<MotionPhase>& phases)
    {
        phases = std::move(*phases_);
        phases_ = &phases;
    }
    [[nodiscard]] std::uint64_t implicit_steps() const noexcept { return implicit_steps_; }

    // The memory of the rules in the mode in which the run is. It may be shorter than that of the
    // mode in which another run is that reads it.
    void save(std::vector<double>& memory) const;
    [[nodiscard]] std::size_t memory_in(const ModeInclusion& of) const;
    void restore(const std::vector<double>& memory);

private:
    static constexpr double never = std::numeric_limits<double>::lowest();
    /// Events within a hundredth of a step that are no longer worth locating, and events in a row
    /// between which a y stays within its error: their times are then determined by rounding, and
    /// unlike those of an accumulation they need not become denser.
    static constexpr double most_events = 200, most_flutters = 400;
    /// What the rules remember. Numbers, as snapshots are.
    struct Memory {
        double set_valued = 0;         ///< whether the phase that is listed last is
        double sort = 0;               ///< own, explicit or implicit
        double since = never;          ///< [s] since when
        double patience = 1;           ///< implicit steps before explicit ones are tried
        double chatter_patience = 10;  ///< found by trial; 1 hands back during the chattering
        double steps = 0;              ///< implicit ones since the last change
        double across = 0;             ///< branches in a phase across changes
        double changed_at = never;     ///< [s]
        double events = 0;             ///< in this explicit phase
        double marked_events = 0, marked_at = 0;  ///< [s] of the watch for chattering
        double fluttering = 0, fluttered_at = 0;  ///< number of flutters in a row, time [s]
        double contradicts = 0;     ///< a held reaction was beyond its bound at the start of a step
        double gave_up_at = never;  ///< [s]
        double outcome = 0;         ///< of a run that is over
        double listed = 0;          ///< number of phases; none before the first of a start
    };
    static constexpr std::size_t remembered = sizeof(Memory) / sizeof(double);

    [[nodiscard]] Kind over() const noexcept { return across() + 1 + branch_modes_; }
    [[nodiscard]] Kind approach_in(Mode b) const noexcept { return across() + 1 + b; }
    [[nodiscard]] Kind explicit_in(Mode b) const noexcept { return 1 + b; }
    [[nodiscard]] Kind implicit_in(Mode b) const noexcept { return 1 + branch_modes_ + b; }
    [[nodiscard]] bool is_set_valued(Kind kind) const noexcept
    {
        return is_implicit(kind) || (!options_.alone && holds(kind));
    }
    [[nodiscard]] bool has_inclusion() const noexcept { return now_->inclusion != nullptr; }
    [[nodiscard]] BranchPhases& inclusion() const noexcept { return *now_->inclusion; }
    [[nodiscard]] std::size_t count() const noexcept { return count_; }

    /// Size of y_i that the tolerances of a step resolve.
    [[nodiscard]] double resolution(std::size_t i, const double* x) const
    {
        return options_.atol + options_.rtol * inclusion().size_of_row(i, x);
    }
    /// Whether y_i is farther from zero than the error of a thousand steps, and the motion thus
    /// that of a flow.
    [[nodiscard]] bool is_clear(std::size_t i, double y, const double* x) const
    {
        return inclusion().decides_at_zero() && std::fabs(y) >= 1e3 * resolution(i, x);
    }
    /// Whether the y of all reactions at a bound are clear.
    [[nodiscard]] bool are_clear(Mode b, double t, const double* x);
    /// Whether branches b hold nothing and every y is clear.
    [[nodiscard]] bool lets_go(Mode b, double t, const double* x);
    [[nodiscard]] bool is_near_surface(double t, const double* x);

    [[nodiscard]] Kind decide_own(const Set& set, double* x);
    [[nodiscard]] Kind decide_explicit(const Set& set, double* x);
    [[nodiscard]] Kind decide_implicit(const Set& set, double* x);
    /// Branches of an explicit phase after resets that have moved the state from `before`.
    [[nodiscard]] Mode branches_after(Mode b, double t, const double* x);
    [[nodiscard]] Mode branches_before(const Set& set) const;
    [[nodiscard]] bool has_finite_bounds(Mode at, double t, const double* x)
    {
        return unbounded(at, t, x) == no_reaction;
    }

    /// @throws InclusionRefused where the set of reactions is empty, or has a bound that is not a
    /// number.
    void refuse_faulty_set(double t, const double* x);
    /// The mode of `BranchPhases` in which a run starts.
    [[nodiscard]] Mode start(double t, double* x);
    /// Whether the system's own flow is followed from (t, x).
    [[nodiscard]] bool goes_by_itself(double t, const double* x);
    /// The kind of phase where the y of the reactions marked inside are zero.
    [[nodiscard]] Kind settle(Mode at, double t, double* x, PhaseCause cause);
    /// As `settle`, where the mode of `BranchPhases` is b if the motion is unique.
    [[nodiscard]] Kind determined_kind(Mode at, Mode b, double t, const double* x,
                                       PhaseCause cause);
    /// The kind of phase for a mode of `BranchPhases`.
    [[nodiscard]] Kind kind_for(Mode b, double t, const double* x, PhaseCause cause);
    [[nodiscard]] Kind go_by_steps(PhaseCause cause, double t, const double* x);
    /// The first reaction that is unbounded at the bound where `at` has it, or `no_reaction`.
    [[nodiscard]] std::size_t unbounded(Mode at, double t, const double* x);
    [[nodiscard]] std::string sentence_of_unbounded(std::size_t i) const;
    [[nodiscard]] Kind end_with(Outcome outcome) noexcept
    {
        memory_.outcome = static_cast<double>(outcome);
        return over();
    }

    [[nodiscard]] Kind end_without_reaction(double t);

    /// The reactions where the system's own flow is followed: at the bounds on the side of y.
    void reaction_of_own(double t, const double* x, double* r);

    void note_changes(const Set& set, Mode before, Kind next, const double* x);
    void note_flutter(const Set& set, Kind next, const double* x);
    void note_sides(double t, const double* x);
    void note_bounds(Kind kind, double t, const double* x);
    void note(Kind kind, double t, PhaseCause cause);
    [[nodiscard]] bool chatters(double t) noexcept;

    /// Whether a watched y may arrive at zero within `reach` [s].
    [[nodiscard]] bool may_arrive(const Step& step, double reach);
    /// The same within some steps of fixed length of a flow beside an inclusion without branches:
    /// such steps do not end where the flow jumps, and implicit ones are taken there.
    [[nodiscard]] bool may_arrive_unseen(const Step& step, int steps)
    {
        if (!options_.fixed || inclusion().has_branches()) return false;
        return inclusion().decides_at_zero() && may_arrive(step, steps * options_.step);
    }
    /// Whether the flow of the system is that of the inclusion in branches b.
    [[nodiscard]] bool is_flow_of(Mode b, const Step& step, const double* x);
    [[nodiscard]] static constexpr Mode other_side(std::size_t i, Mode b) noexcept
    {
        const bool low = BranchPhases::branch(i, b) == Branch::lower;
        return BranchPhases::with_branch(i, low ? Branch::upper : Branch::lower, b);
    }
    [[nodiscard]] Verdict after_end(const End& end, double* x);
    [[nodiscard]] Verdict ask(const End& end, double* x, PhaseCause cause);
    [[nodiscard]] Verdict review_own(const Step& step, const double* x);
    [[nodiscard]] Verdict review_explicit(Kind kind, double t, double* x);
    [[nodiscard]] Verdict review_implicit(const Step& step, double* x);
    [[nodiscard]] Verdict change_to(Kind kind, double t, PhaseCause cause, double h = 0);
    /// The system's own flow is followed again; an inclusion alone ends.
    [[nodiscard]] Verdict release(double t);

    [[nodiscard]] std::size_t reaction_of(std::size_t which) const noexcept
    {
        return which / guards_of_reaction();
    }
    [[nodiscard]] std::size_t kind_of_guard(std::size_t which) const noexcept
    {
        return which % guards_of_reaction();
    }

    const BranchPhases& any_;
    const ModeInclusion* now_ = nullptr;
    Mode branch_modes_;
    std::size_t count_, size_;  ///< of reactions, and of components
    bool by_mode_;
    PhaseOptions options_;
    std::string reason_;
    Memory memory_;
    std::vector<double> sides_;         ///< sign of each y when it was last not zero
    std::vector<double> sides_before_;  ///< at the last set
    /// Rounding of each reaction that is held at its bound, and 0 for the others.
    std::vector<double> at_bound_;
    bool is_at_bound_ = false;  ///< there are some
    std::vector<double> y_, y_before_, lower_, upper_, rates_, flow_;
    std::vector<bool> arrived_;
    std::vector<std::size_t> kept_;
    mutable std::vector<double> observed_;
    std::vector<ReactionChange> changes_;
    std::vector<BranchChange> branch_changes_;  ///< of an inclusion alone
    std::vector<MotionPhase> first_phases_;     ///< until the list is moved
    std::vector<MotionPhase>* phases_ = &first_phases_;
    Kind kind_ = own;                       ///< at the end of the last step
    bool begins_ = false;                   ///< no step has been taken since the start
    PhaseCause cause_ = PhaseCause::start;  ///< why the phase that was entered last began
    std::uint64_t steps_ = 0, implicit_steps_ = 0;
    double shortest_ = 0;  ///< [s] steps below this length follow nothing that is smooth
    StallWatch stall_;     ///< of an inclusion alone
};

}  // namespace ricochet::detail
