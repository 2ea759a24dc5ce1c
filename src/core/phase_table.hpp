// Phases of a run whose motion is not always that of the system's flow, as a table of pointers.
//
// A mode of such a run is a mode of the system and, in the bits above it, the kind of phase: kind 0
// is the system's own flow. The mode determines which stepper takes the steps. A step may end at a
// change that its stepper has located by itself, and after the resets of every set the phases
// decide how the motion goes on. Everything else is the loop's.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "ricochet/detail/own_mode.hpp"
#include "ricochet/detail/step_state.hpp"
#include "ricochet/run.hpp"

namespace ricochet::detail {

/// What takes the steps in a mode.
template <class X>
struct Stepper {
    const StepKernel<X>* kernel = nullptr;
    void* adapter = nullptr;  ///< first argument of the kernel's functions
    /// Flow for kernels that call it by pointer, with that adapter.
    bool (*flow)(void* adapter, Mode mode, double t, const X& x, X& dxdt) = nullptr;
};

/// What has happened at one instant, before the phases decide.
template <class X>
struct PhaseSet {
    std::span<const std::size_t> fired;
    bool on_time;    ///< with a time event
    bool on_change;  ///< at the change that the stepper has located
    double t;
    Mode before, after;  ///< the modes before and after the resets of the system
    const X& x;          ///< x⁻
};

/// A change of a reaction at the last set.
struct ReactionChange {
    std::size_t reaction = 0;
    EventKind kind = EventKind::mode;
    std::size_t fired = no_guard;  ///< guard of the phases by which it was located, or `no_guard`
    std::size_t guard = no_guard;  ///< guard of the system under which it is recorded
};

/// Where the run is after a step, with all events in it.
template <class X>
struct PhaseStep {
    double t;
    Mode mode;
    const X& x;
    const X& rate;      ///< the flow there
    double h_next;      ///< [s] length of the next step
    bool has_advanced;  ///< false: a set, or another change of phase, at the same instant
};

/// A place s [s] after the start of a step, at which the state is x.
template <class X>
struct PhasePlace {
    Mode mode;
    double t0;
    const X& x0;  ///< at the start of the step
    double s;
    double t;
    const X& x;
};

/// How a run has ended.
template <class X>
struct PhaseEnd {
    Outcome outcome;
    std::size_t guard;
    double t;
    Mode mode;
    const X& x;
};

/// How the motion goes on.
struct PhaseVerdict {
    enum class Kind { stands, changes, ends };
    Kind kind = Kind::stands;
    Mode mode = 0;  ///< of a change
    double h = 0;   ///< [s] length of the next step; 0: as at a start; negative: as it was
    Outcome outcome = Outcome::reached_end;  ///< of an end
};

template <class X>
struct PhaseTable {
    using SystemAdapter = void*;

    SystemAdapter adapter = nullptr;  ///< first argument of the functions

    /// The number of guards of the system. Those behind them belong to the phases: their crossings
    /// cut steps, and are no events by themselves.
    std::size_t (*own_guards)(SystemAdapter) = nullptr;
    Stepper<X> (*stepper)(SystemAdapter, Mode) = nullptr;
    /// The mode in which a run starts at (t, x) in a mode of the system. May move x onto a surface.
    Mode (*enter)(SystemAdapter, Mode, double t, X& x) = nullptr;
    /// The mode after a set. May move x⁺ onto a surface.
    Mode (*decide)(SystemAdapter, const PhaseSet<X>&, X& after) = nullptr;
    /// Changes of reactions at the last set, by reaction.
    std::span<const ReactionChange> (*changes)(SystemAdapter) = nullptr;
    /// Whether the last set has an event of its own for a guard of the system: not for one that
    /// stands for a reaction whose change is recorded under another guard.
    bool (*records)(SystemAdapter, std::size_t guard) = nullptr;
    /// Whether the phase goes on after a step, as far as a quick test tells; else `review` decides.
    /// Null: it always does.
    /// @param has_advanced  as in `PhaseStep`
    bool (*goes_on)(SystemAdapter, Mode, double t, const X& x, bool has_advanced) = nullptr;
    /// The phase after a step. May move x onto a surface.
    PhaseVerdict (*review)(SystemAdapter, const PhaseStep<X>&, X& x) = nullptr;
    /// The phase where the run would end. May move x onto a surface.
    PhaseVerdict (*give_up)(SystemAdapter, const PhaseEnd<X>&, X& x) = nullptr;
    /// What a guard of the phases is about. May be null.
    std::string (*name_of)(SystemAdapter, std::size_t guard) = nullptr;
    /// A sentence about the end that the phases have given to the run, or an empty one.
    std::string_view (*reason)(SystemAdapter) = nullptr;
    /// Moves the list of phases to `phases`, where it goes on. This function and the two below may
    /// be null.
    void (*list_in)(SystemAdapter, std::vector<MotionPhase>& phases) = nullptr;
    /// Writes the reactions at a place in the current step, or in one that has just ended.
    void (*reaction)(SystemAdapter, const PhasePlace<X>&, std::vector<double>& r) = nullptr;
    /// Adds to the result of the run what the phases know of it.
    void (*complete)(SystemAdapter, Run<X>& run) = nullptr;
    /// The numbers besides time, mode and state on which the future of the run depends.
    void (*save)(SystemAdapter, std::vector<double>& memory) = nullptr;
    void (*restore)(SystemAdapter, const std::vector<double>& memory) = nullptr;
};

}  // namespace ricochet::detail
