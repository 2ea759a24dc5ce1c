// Internal: the declarations of this header may change without notice.
//
// An inclusion as the phases of a run need it, for any number of components and reactions.
//
// A branch mode b has digit i to base 3 for the branch of reaction i: 0 lower (y > 0), 1 inside
// (held), 2 upper (y < 0); `branch_modes()` and the two numbers after it are the modes that do not
// flow by themselves, `several`, `no_flow` and `empty` of branch_modes.hpp. States are arrays of
// `size()` doubles. What is followed by implicit steps alone has mode 0 and none of the explicit
// phases; where another inclusion decides on a mode, it gives `several`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "ricochet/base/detail/owner.hpp"
#include "ricochet/detail/small_state.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/nonsmooth/composite_step.hpp"

namespace ricochet::detail {

template <class X>
struct StepKernel;

/// A kernel and the adapter of its functions.
struct BranchStepper {
    const StepKernel<SmallState>* kernel = nullptr;
    void* adapter = nullptr;
};

struct BranchPhasesOptions {
    SchemeOptions scheme{};      ///< of implicit steps
    double step = 0;             ///< [s] their length
    double event_tolerance = 0;  ///< [s] by which an event may be located too late
};

/// Start of an implicit step.
struct ImplicitStart {
    double t;
    const double* x;
    Mode branches;
    bool crosses;  ///< the step is taken across changes of branch
};

/// Where the end of an implicit step is written.
struct ImplicitEnd {
    double* x;
    double* dxdt;
    double* error = nullptr;  ///< its estimate, if it is asked for
};

class BranchPhases {
public:
    BranchPhases() = default;
    BranchPhases(const BranchPhases&) = delete;
    BranchPhases& operator=(const BranchPhases&) = delete;
    virtual ~BranchPhases() = default;

    [[nodiscard]] virtual std::size_t size() const noexcept = 0;
    [[nodiscard]] virtual std::size_t reactions() const noexcept = 0;
    /// Number of branch modes; 1 where the inclusion is followed by implicit steps alone.
    [[nodiscard]] virtual Mode branch_modes() const noexcept = 0;
    [[nodiscard]] bool has_branches() const noexcept { return branch_modes() > 1; }

    [[nodiscard]] static constexpr Branch branch(std::size_t i, Mode b) noexcept
    {
        for (; i > 0; --i) b /= 3;
        return static_cast<Branch>(static_cast<int>(b % 3) - 1);
    }
    /// b with another branch of reaction i.
    [[nodiscard]] static constexpr Mode with_branch(std::size_t i, Branch branch, Mode b) noexcept
    {
        Mode unit = 1;
        for (std::size_t k = i; k > 0; --k) unit *= 3;
        const Mode digit = static_cast<Mode>(static_cast<int>(branch) + 1);
        return b - (b / unit % 3) * unit + digit * unit;
    }
    /// Whether a branch mode holds a reaction of the system.
    [[nodiscard]] bool holds(Mode b) const noexcept
    {
        for (std::size_t i = 0; i < reactions(); ++i, b /= 3) {
            if (b % 3 == 1) return true;
        }
        return false;
    }

    // --- y and its reactions ---

    /// y = E x - s(t).
    virtual void observe(double t, const double* x, double* y) const = 0;
    /// y' = E x' - s'(t).
    virtual void observe_rate(double t, const double* dxdt, double* rates) const = 0;
    /// Whether no y is beyond zero in branches b. Writes the signs of those that are not zero.
    [[nodiscard]] virtual bool keeps_sides(Mode b, double t, const double* x,
                                           double* sides) const = 0;
    /// The largest component that row i of E reads.
    [[nodiscard]] virtual double size_of_row(std::size_t i, const double* x) const = 0;
    /// Whether the motion is that of a flow wherever no y is zero: for boxes of reactions.
    [[nodiscard]] virtual bool decides_at_zero() const noexcept = 0;
    /// What a reaction alone does to the state that it acts on: it moves x by -y / W_ii along the
    /// reaction, so that y_i is zero. False where it has no influence on its y.
    [[nodiscard]] virtual bool move_onto(std::size_t i, double t, double* x) const = 0;
    /// Moves x along row i of E, so that y_i grows by `amount`.
    virtual void shift(std::size_t i, double amount, double* x) const = 0;
    /// The bounds; false where they form no interval.
    virtual bool bounds(double t, const double* x, double* lower, double* upper) const = 0;
    /// What is wrong with the set at (t, x); empty if nothing is.
    [[nodiscard]] virtual std::string fault(double t, const double* x) const = 0;
    /// Whether a load, a bound or an offset jumps between the double before t and t.
    [[nodiscard]] virtual bool jumps(double t, const double* x) = 0;

    // --- entering ---

    /// See `AnyModes::check_bounds`.
    virtual void check_bounds(double t, const double* x) const = 0;
    /// Whether only branches are followed: implicit steps know of no static bounds.
    [[nodiscard]] virtual bool keeps_to_branches() const noexcept = 0;
    /// The signs of y as a branch mode: inside where y is zero up to rounding.
    [[nodiscard]] virtual Mode signs(double t, const double* x) const = 0;
    /// See `AnyModes::mode_at`. @throws InclusionRefused
    [[nodiscard]] virtual Mode start(double t, double* x) const = 0;
    /// See `AnyModes::arrive`.
    [[nodiscard]] virtual Mode arrive(Mode at, double t, double* x) const = 0;
    /// See `AnyModes::mode_after`. @throws InclusionRefused also for a reaction outside its set
    [[nodiscard]] virtual Mode resume(double t, double* x, const double* reaction,
                                      double error) = 0;
    virtual void hold(Mode at, double t, double* x) const = 0;
    /// See `AnyModes::undetermined`; `no_reaction` where there is none.
    [[nodiscard]] virtual std::size_t undetermined(Mode at, double t, const double* x) const = 0;

    // --- explicit phases ---

    /// Guard 5 i + kind: y, -y, the room above the lower bound, that below the upper one, and 1
    /// where the bounds form an interval.
    static constexpr std::size_t guards_of_reaction = 5;
    [[nodiscard]] virtual GuardInfo guard_info(std::size_t which) const = 0;
    [[nodiscard]] virtual bool enabled(std::size_t which, Mode b) const noexcept = 0;
    [[nodiscard]] virtual double guard(std::size_t which, Mode b, double t,
                                       const double* x) const = 0;
    /// All of them, those of reaction i from g[i stride] on.
    virtual void guards(Mode b, double t, const double* x, double* g, std::size_t stride) const = 0;
    [[nodiscard]] virtual double guard_rate(std::size_t which, Mode b, double t, const double* x,
                                            const double* dxdt) const = 0;
    virtual void guard_rates(Mode b, double t, const double* x, const double* dxdt, double* rates,
                             std::size_t stride) const = 0;
    /// See `AnyModes::reset`.
    [[nodiscard]] virtual Mode reset(std::span<const std::size_t> fired, Mode b, double t,
                                     double* x) const = 0;
    /// Whether the reactions that b holds are inside their bounds.
    [[nodiscard]] virtual bool stays_held(Mode b, double t, const double* x) const = 0;
    /// Writes for every reaction that is held at one of its bounds, up to rounding, that rounding,
    /// and 0 for the others. Returns whether there are any.
    [[nodiscard]] virtual bool at_bounds(Mode b, double t, const double* x,
                                         double* rounding) const = 0;
    [[nodiscard]] virtual bool flows(Mode b) const noexcept = 0;
    virtual void flow(Mode b, double t, const double* x, double* dxdt) const = 0;
    /// Steps in branches b by a method that holds the state in registers, until the next call;
    /// empty where the inclusion has none.
    [[nodiscard]] virtual BranchStepper stepper(MethodName method, Mode b) noexcept = 0;
    /// The reactions in branches b; at the end of the last implicit step.
    virtual void reaction(Mode b, double t, const double* x, double* r) const = 0;
    virtual void reaction_of_step(double* r) const = 0;
    /// Those that the motion selects at (t, x); NaN where there are none.
    virtual void selected_reaction(double t, const double* x, double* r) = 0;
    /// Those at the end of an implicit step of length s, or at its start: the least of all that
    /// have the same effect.
    virtual void reaction_in_step(const ImplicitStart& from, double s, double* r) = 0;
    /// y' of reaction i.
    [[nodiscard]] virtual double rate_of(std::size_t i, const double* dxdt) const = 0;
    /// The fraction of a step that would follow the held reactions; 1 if the step does, and
    /// negative where one was beyond its bound at the start.
    /// @param may_jump  the load may jump at t1: there are time events
    [[nodiscard]] virtual double fraction_of_held(Mode b, double t0, const double* x0, double t1,
                                                  const double* x1, bool may_jump) = 0;

    // --- implicit phases ---

    /// The branches at (t, x) with the reaction that the motion selects; nothing where there is
    /// none.
    [[nodiscard]] virtual bool select(double t, const double* x, Mode& branches) = 0;
    /// The rate at (t, x) with that reaction; NaN where there is none.
    virtual void selected_rate(double t, const double* x, double* dxdt) = 0;
    /// Length [s] of the next step, of at most h: up to the first change of branch.
    [[nodiscard]] virtual double reach(const ImplicitStart& from, double h) = 0;
    /// Takes a step. False where a stage has no solution; see `failure`.
    [[nodiscard]] virtual bool take(const ImplicitStart& from, double h,
                                    const ImplicitEnd& end) = 0;
    /// A step of length s from the start of the current one, whose length is h.
    virtual void take_to(const ImplicitStart& from, double h, double s, const ImplicitEnd& end) = 0;
    /// Whether the step that was taken ends at a change of branch.
    [[nodiscard]] virtual bool ends_at_change() const noexcept = 0;
    /// The branches after that change. May move x onto a surface.
    [[nodiscard]] virtual Mode change(Mode b, double t, double* x) = 0;
    /// The branches at the end of a step across changes.
    [[nodiscard]] virtual Mode branches_at_end() = 0;
    /// The reaction whose branch has changed last.
    [[nodiscard]] virtual std::size_t changed() const noexcept = 0;
    /// See `law_violation`, at the end of the last step.
    [[nodiscard]] virtual double law() const = 0;
    /// The stage that has had no solution; the set that is faulty at (t, x).
    [[nodiscard]] virtual const StageReport& failure() const noexcept = 0;
    virtual void note_faulty(double t, const double* x) = 0;
    [[nodiscard]] virtual std::uint64_t attempts() const noexcept = 0;
    [[nodiscard]] virtual std::uint64_t stages() const noexcept = 0;

    /// The numbers besides time, mode and state on which the future depends.
    virtual void save(std::vector<double>& memory) const = 0;
    /// Reads them from the front of `memory`.
    virtual void restore(std::span<const double> memory) = 0;
};

}  // namespace ricochet::detail
