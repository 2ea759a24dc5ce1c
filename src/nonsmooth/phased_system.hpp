// A hybrid system and its inclusion as one system, which the loop of the library integrates.
//
// A mode of this system is a mode of the user's and the kind of phase, in the bits above it:
//
//     own           the user's flow, by the user's method
//     approach b    the same motion as the inclusion's in branches b, where a y may arrive at zero
//     explicit b    the inclusion in branches b: an ordinary differential equation
//                   (branch_modes.hpp), with the guards of the branches
//     implicit b    Bathe's steps that start in branches b; a change of branch ends the step
//     across        Bathe's steps across the changes of branch
//     over          the run is about to end
//
// The user's own flow is followed only while every y is clear of zero: farther from it than the
// error of a thousand steps. Elsewhere the inclusion decides: at the start, after every set, and
// where a y arrives at zero, which a guard of the phases watches in own phases. All of the user's
// guards are watched in all phases, except those that stand for a y while the inclusion decides.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "../core/phase_table.hpp"
#include "phase_rules.hpp"
#include "ricochet/detail/kernels.hpp"
#include "ricochet/detail/refusals.hpp"
#include "ricochet/nonsmooth/detail/phased_run.hpp"

namespace ricochet::detail {

/// The combined system; the adapter of its table.
template <class C>
class PhasedSystem {
public:
    PhasedSystem(PhasedSetup<C>&& setup, const C& x0, const PhaseOptions& options)
        : user_(setup.user),
          own_(*setup.user.system),
          own_kernel_(*setup.user.kernel),
          by_mode_(setup.by_mode),
          start_mode_(setup.start_mode),
          change_(setup.change),
          method_(setup.method),
          inclusions_(std::move(setup.inclusions)),
          rules_(some_inclusion(), by_mode_, options),
          reactions_(some_inclusion().reactions()),
          guards_(own_.guarded ? own_.guard_count(user_.adapter) : 0)
    {
        if (own_.moded && own_.mode_count(user_.adapter) >= own_modes) {
            throw std::invalid_argument(
                "integrate: a system with set_valued() has at most 2^24 - 1 modes");
        }
        for (std::size_t i = 0; i < guards_; ++i) {
            infos_.push_back(own_.info(user_.adapter, i));
            infos_.back().resets = infos_.back().resets && own_.resets();
        }
        refuse_other_size(x0.size());
        make_modes(x0);
        find_asked_reactions();
        make_kernels(x0.size());
        make_table();
        make_phases();
        for (const ModeInclusion& of : modes_) memory_ = std::max(memory_, rules_.memory_in(of));
    }
    PhasedSystem(const PhasedSystem&) = delete;
    PhasedSystem& operator=(const PhasedSystem&) = delete;

    [[nodiscard]] const SystemTable<C>& table() const noexcept { return table_; }
    [[nodiscard]] const PhaseRules& rules() const noexcept { return rules_; }

    /// The mode in which a run starts at (t, x) in a mode of the user's.
    [[nodiscard]] Mode enter(Mode mode, double t, C& x)
    {
        const std::size_t modes = own_.moded ? own_.mode_count(user_.adapter) : 1;
        if (modes > 0 && mode >= modes) throw_unknown_mode("integrate", mode, modes);
        mode_ = mode;
        const Kind kind = in(mode).enter(t, x.data());
        const bool is_examined = kind != PhaseRules::own && !by_mode_ && !rules_.options().alone;
        if (!is_examined || agrees_at_start(mode, t, x)) return with(kind, mode);
        return with(rules_.end_as_violated(), mode);
    }

private:
    [[nodiscard]] static PhasedSystem& at(void* adapter) noexcept
    {
        return *static_cast<PhasedSystem*>(adapter);
    }

    [[nodiscard]] static constexpr Kind kind_of(Mode mode) noexcept { return kind_of_phase(mode); }
    [[nodiscard]] static constexpr Mode with(Kind kind, Mode mode) noexcept
    {
        return kind * own_modes + mode;
    }
    [[nodiscard]] bool is_mode(Mode mode) const
    {
        const std::size_t modes = own_.moded ? own_.mode_count(user_.adapter) : 1;
        return mode < (modes > 0 ? modes : own_modes - 1);
    }
    /// The mode after a reset that returned a mode of the user's: one that no system has if the
    /// user's does not exist.
    [[nodiscard]] Mode reached(Kind kind, Mode mode) const
    {
        return is_mode(mode) ? with(kind, mode) : std::numeric_limits<Mode>::max();
    }
    [[nodiscard]] bool changes_inclusion(Mode from, Mode to) const
    {
        const BranchPhases* const before = inclusion_of(from).inclusion;
        return before != inclusion_of(to).inclusion;
    }

    /// The rules of a mode of the user's.
    PhaseRules& in(Mode mode) const
    {
        if (mode == seen_) return rules_;
        seen_ = mode;
        if (by_mode_) return rules_.in(mode < modes_.size() ? modes_[mode] : none_);
        return rules_.in(is_active(mode) ? modes_[0] : none_);
    }
    [[nodiscard]] const ModeInclusion& inclusion_of(Mode mode) const { return in(mode).now(); }

    /// What an explicit phase follows.
    struct InBranches {
        Mode mode = std::numeric_limits<Mode>::max();
        BranchPhases* inclusion = nullptr;  ///< null in other phases
        Mode branches = 0;
    };
    [[nodiscard]] const InBranches& in_branches(Mode mode) const
    {
        if (mode != in_branches_.mode) find_branches(mode);
        return in_branches_;
    }
    [[gnu::noinline]] void find_branches(Mode mode) const
    {
        const Kind kind = kind_of(mode);
        const bool is_explicit = rules_.is_explicit(kind);
        in_branches_ = {mode, is_explicit ? inclusion_of(own_mode(mode)).inclusion : nullptr,
                        rules_.branches_of(kind)};
    }
    /// Whether some guard with a reaction is enabled in a mode, or no guard has one.
    [[nodiscard]] bool is_active(Mode mode) const;

    [[nodiscard]] const BranchPhases& some_inclusion() const;
    void refuse_other_size(std::size_t size) const;
    void make_modes(const C& x0);
    void find_asked_reactions();
    void refuse_partly_active() const;
    void find_reactions_of_guards(ModeInclusion& of, const C& x0);
    void make_kernels(std::size_t size);
    void make_table();
    void add_guards();
    void add_resets();
    void add_time_events();
    void make_phases();
    /// Adds the counts of the implicit steps and a stage without a solution to the result.
    void complete(Run<C>& run) const;

    // --- guards: the user's, then six for each reaction, of which the last watches own phases ---

    [[nodiscard]] std::size_t all_guards() const noexcept
    {
        return guards_ + rules_.guards_of_reaction() * reactions_;
    }
    [[nodiscard]] GuardInfo info(std::size_t i) const
    {
        if (i >= guards_) return rules_.guard_info(i - guards_);
        GuardInfo info = infos_[i];
        // A guard that stands for a y changes the motion at its event.
        if (stands_somewhere_[i] && !info.unilateral) info.resets = true;
        return info;
    }
    void guards(Mode mode, double t, const C& x, std::span<double> g) const
    {
        if (guards_ > 0) {
            own_.guards(user_.adapter, own_mode(mode), t, x, g.first(guards_));
            g = g.subspan(guards_);
        }
        guards_of_phases(mode, t, x.data(), g);
    }
    void guards_of_phases(Mode mode, double t, const double* x, std::span<double> g) const
    {
        const InBranches& by = in_branches(mode);
        if (!by.inclusion) return in(own_mode(mode)).guards(kind_of(mode), t, x, g);
        rules_.fill_watching(g, 1);
        by.inclusion->guards(by.branches, t, x, g.data(), rules_.guards_of_reaction());
        if (rules_.is_at_bound()) rules_.set_guards_at_bound(g);
    }
    [[nodiscard]] double guard(std::size_t i, Mode mode, double t, const C& x) const
    {
        if (i < guards_) return own_.guard(user_.adapter, i, own_mode(mode), t, x);
        const std::size_t which = i - guards_;
        const InBranches& by = in_branches(mode);
        if (!by.inclusion || rules_.watches_own(which)) {
            return in(own_mode(mode)).guard(which, t, x.data());
        }
        const double g = by.inclusion->guard(rules_.in_branches(which), by.branches, t, x.data());
        return rules_.is_at_bound() ? rules_.guard_at_bound(which, g) : g;
    }
    [[nodiscard]] double rate(GuardInMode of, ScaledTime time, const C& x, const C& dxdt) const
    {
        const Mode mode = own_mode(of.mode);
        if (of.which < guards_) {
            return own_.rate(user_.adapter, {of.which, mode, of.backward}, time, x, dxdt);
        }
        const std::size_t which = of.which - guards_;
        const InBranches& by = in_branches(of.mode);
        if (!by.inclusion || rules_.watches_own(which)) {
            return in(mode).guard_rate(which, time.t, x.data(), dxdt.data());
        }
        return by.inclusion->guard_rate(rules_.in_branches(which), by.branches, time.t, x.data(),
                                        dxdt.data());
    }
    void rates(const Along<C>& motion, std::span<double> rates) const
    {
        const Mode mode = own_mode(motion.mode);
        if (own_.rates) {
            own_.rates(user_.adapter, {mode, motion.t, motion.x, motion.s}, rates.first(guards_));
        } else {
            for (std::size_t i = 0; i < guards_; ++i) {
                rates[i] = own_.rate(user_.adapter, {i, mode}, {motion.t, 0}, motion.x, motion.s);
            }
        }
        rates_of_phases(motion, rates.subspan(guards_));
    }
    void rates_of_phases(const Along<C>& motion, std::span<double> rates) const
    {
        const double *const x = motion.x.data(), *const dxdt = motion.s.data();
        const InBranches& by = in_branches(motion.mode);
        if (!by.inclusion) {
            return in(own_mode(motion.mode))
                .guard_rates(kind_of(motion.mode), motion.t, x, dxdt, rates);
        }
        rules_.fill_watching(rates, 0);
        by.inclusion->guard_rates(by.branches, motion.t, x, dxdt, rates.data(),
                                  rules_.guards_of_reaction());
    }
    /// The reaction whose y a guard of the user's is, in a mode of the user's.
    [[nodiscard]] std::size_t stands_for(std::size_t i, Mode mode) const
    {
        const ModeInclusion& of = inclusion_of(mode);
        return of.stands_for.empty() ? no_reaction : of.stands_for[i];
    }
    /// The reaction that is asked where events of a guard of the user's cannot go on.
    [[nodiscard]] std::size_t reaction_of(std::size_t i, Mode mode) const
    {
        const std::size_t its_own = stands_for(i, mode);
        return its_own != no_reaction || !inclusion_of(mode).inclusion ? its_own
                                                                       : infos_[i].reaction;
    }
    [[nodiscard]] bool enabled(std::size_t i, Mode mode) const
    {
        const Kind kind = kind_of(mode);
        if (i >= guards_) {
            const std::size_t which = i - guards_;
            if (rules_.watches_own(which)) return in(own_mode(mode)).watches(which, kind);
            const InBranches& by = in_branches(mode);
            return by.inclusion && by.inclusion->enabled(rules_.in_branches(which), by.branches);
        }
        if (!rules_.has_own_guards(kind) && stands_for(i, own_mode(mode)) != no_reaction) {
            return false;
        }
        return !own_.enabled_in || own_.enabled_in(user_.adapter, i, own_mode(mode));
    }

    // --- resets ---

    [[nodiscard]] Mode reset(std::size_t i, Mode mode, double t, C& x) const
    {
        if (i >= guards_ || !infos_[i].resets) return mode;
        return reached(kind_of(mode), own_.reset(user_.adapter, i, own_mode(mode), t, x));
    }
    [[nodiscard]] Mode reset(const FiredGuards& fired, Mode mode, double t, C& x)
    {
        own_fired_.clear();
        bool resets = false;
        for (const std::size_t i : fired) {
            if (i >= guards_) continue;
            own_fired_.push_back(i);
            resets = resets || infos_[i].resets;
        }
        const Mode own = own_mode(mode);
        if (resets) {
            const FiredGuards set(own_fired_, fired.time_event());
            return reached(kind_of(mode), own_.reset_set(user_.adapter, set, own, t, x));
        }
        if (!fired.time_event() || !own_.time_reset) return mode;
        return reached(kind_of(mode), own_.time_reset(user_.adapter, own, t, x));
    }
    [[nodiscard]] Mode rest(std::size_t i, Mode mode, double t, C& x)
    {
        const C before = x;
        const Mode own = own_.rest(user_.adapter, i, own_mode(mode), t, x);
        if (!is_mode(own)) return std::numeric_limits<Mode>::max();
        mode_ = own;
        if (changes_inclusion(own_mode(mode), own)) {
            rules_.forget_changes();
            return with(in(own).enter_mode(kind_of(mode), t, x.data()), own);
        }
        if (kind_of(mode) == PhaseRules::own && reaction_of(i, own) == no_reaction) {
            return with(PhaseRules::own, own);
        }
        const std::size_t fired[] = {i};
        const PhaseSet<C> set{fired, false, false, t, mode, with(kind_of(mode), own), before};
        return decide(set, x);
    }

    // --- phases ---

    [[nodiscard]] Stepper<C> stepper(Mode mode)
    {
        const Kind kind = kind_of(mode);
        if (kind == PhaseRules::own) return {&own_kernel_, user_.adapter, own_.flow};
        if (rules_.is_implicit(kind)) return {&implicit_, this, table_.flow};
        const InBranches& by = in_branches(mode);
        if (!by.inclusion) return {free_, this, table_.flow};
        explicit_ = explicit_stepper(by);
        const bool holds = by.inclusion->holds(by.branches);
        return holds ? Stepper<C>{&held_, this, table_.flow} : explicit_;
    }
    [[nodiscard]] Stepper<C> explicit_stepper(const InBranches& by)
    {
        if constexpr (std::is_same_v<C, SmallState>) {
            const BranchStepper steps = by.inclusion->stepper(method_, by.branches);
            if (steps.kernel) return {steps.kernel, steps.adapter};
        }
        return {free_, this, table_.flow};
    }
    bool flow(Mode mode, double t, const C& x, C& dxdt)
    {
        const Kind kind = kind_of(mode);
        if (kind == PhaseRules::own) return own_.flow(user_.adapter, own_mode(mode), t, x, dxdt);
        if (const InBranches& by = in_branches(mode); by.inclusion) {
            by.inclusion->flow(by.branches, t, x.data(), dxdt.data());
        } else {
            in(own_mode(mode)).flow(kind, t, x.data(), dxdt.data());
        }
        return true;
    }
    [[nodiscard]] Mode decide(const PhaseSet<C>& set, C& after);
    /// The kind of phase after a set that leaves the inclusion as it is.
    [[nodiscard]] Kind decide_kind(const PhaseSet<C>& set, C& after);
    /// Whether the flow of the user is that of the inclusion where a run starts.
    [[nodiscard]] bool agrees_at_start(Mode mode, double t, const C& x);
    /// Whether the user's flow is that of the inclusion where reactions of a set have arrived.
    [[nodiscard]] bool agrees(const PhaseSet<C>& set);
    /// Calls the reset of the changes of a set.
    [[nodiscard]] Mode after_changes(Mode decided, double t, C& x);
    [[nodiscard]] std::span<const ReactionChange> changes();
    [[nodiscard]] PhaseVerdict verdict(const PhaseRules::Verdict& of, Mode mode, double t, C& x)
    {
        PhaseVerdict out{.kind = of.what, .h = of.h, .outcome = of.outcome};
        Mode own = own_mode(mode);
        const bool releases = of.what == PhaseVerdict::Kind::changes &&
                              of.kind == PhaseRules::own && !rules_.has_own_guards(kind_of(mode));
        if (start_mode_ && releases) {
            own = start_mode_(user_.adapter, own, t, x);
            if (!is_mode(own)) return {PhaseVerdict::Kind::ends, mode, 0, Outcome::unknown_mode};
            if (changes_inclusion(own_mode(mode), own)) {
                out.mode = with(in(own).enter_mode(of.kind, t, x.data()), own);
                mode_ = own;
                return out;
            }
        }
        mode_ = own;
        out.mode = with(of.kind, own);
        return out;
    }

    // --- steps ---

    [[nodiscard]] ImplicitStart implicit_start(const StepState<C>& step) const
    {
        const Kind kind = kind_of(step.mode);
        return {step.start.value, step.x0.data(), rules_.branches_of(kind),
                kind == rules_.across()};
    }
    [[nodiscard]] BranchPhases& inclusion(const StepState<C>& step) const
    {
        return *inclusion_of(own_mode(step.mode)).inclusion;
    }
    /// False where a stage has no solution.
    [[nodiscard]] bool take_implicit(StepState<C>& step, double h)
    {
        step.h = h;
        step.has_middle = false;
        step.asked_alone = 0;
        ++step.flow_calls;
        const ImplicitEnd end{step.x1.data(), step.rate1.data(), step.error.data()};
        if (!inclusion(step).take(implicit_start(step), h, end)) return false;
        for_each_component(
            step.x1, [&](auto i) { step.w[i] = (step.x1[i] - step.x0[i]) - h * step.rate0[i]; });
        return true;
    }
    /// Error of an implicit step over its tolerance. A step of at most a billionth of the longest
    /// is accepted whatever its error: the motion has no smoothness there that shorter steps could
    /// follow.
    [[nodiscard]] double attempt_implicit(StepState<C>& step, double h, double rtol, double atol)
    {
        if (!take_implicit(step, h)) return std::numeric_limits<double>::quiet_NaN();
        double worst = 0;
        for_each_component(step.x1, [&](auto i) {
            const auto c = static_cast<std::size_t>(i);
            const double least = step.component_atol ? step.component_atol[c] : atol;
            const double size = std::max(std::fabs(step.x0[i]), std::fabs(step.x1[i]));
            const double most = std::max(least + rtol * size, least_tolerance);
            const double error = std::fabs(step.error[i]) / most;
            if (!(error <= worst)) worst = error;
        });
        const double rounding =
            32 * std::numeric_limits<double>::epsilon() * std::fabs(step.start.value);
        const double least = std::max(1e-9 * rules_.options().step, rounding);
        // The steps of an inclusion alone are as long as they are asked for.
        if (rules_.options().alone) return worst == worst ? 0 : worst;
        return h <= least ? std::min(worst, 1.0) : worst;
    }
    void depart(StepState<C>& step, double s, C& w, C& rate)
    {
        assign(w, step.x0);
        assign(rate, step.rate0);
        inclusion(step).take_to(implicit_start(step), step.h, s, {w.data(), rate.data()});
        for_each_component(w, [&](auto i) {
            w[i] = (w[i] - step.x0[i]) - s * step.rate0[i];
            rate[i] -= step.rate0[i];
        });
    }
    /// Error of an explicit step over its tolerance. If the held reactions do not follow the step,
    /// the error is that which asks for a shorter one.
    [[nodiscard]] double attempt_held(StepState<C>& step, double h, double rtol, double atol)
    {
        const double error = explicit_.kernel->attempt(explicit_.adapter, step, h, rtol, atol);
        if (!(error <= 1)) return error;
        const InBranches& by = in_branches(step.mode);
        const double fraction =
            rules_.fraction_of_held(*by.inclusion, by.branches, step.start.value, step.x0.data(),
                                    step.time(h), step.x1.data(), own_.timed());
        if (fraction == 1) return error;
        return std::max(error, std::pow(0.9 / fraction, free_->error_order + 1));
    }

    RunBindings<C> user_;
    const SystemTable<C>& own_;
    StepKernel<C> own_kernel_;
    bool by_mode_;  ///< one inclusion for each mode, else the first in all modes
    Mode (*start_mode_)(void* adapter, Mode mode, double t, const C& x);
    Mode (*change_)(void* adapter, std::size_t reaction, EventKind kind, Mode mode, double t, C& x);
    MethodName method_;  ///< of explicit phases
    std::vector<Owner<BranchPhases>> inclusions_;
    std::vector<ModeInclusion> modes_;
    const ModeInclusion none_;
    mutable PhaseRules rules_;
    mutable Mode seen_ = std::numeric_limits<Mode>::max();  ///< that the rules are about
    Mode mode_ = 0;                                         ///< of the user's, in which the run is
    std::size_t memory_ = 0;        ///< numbers of a snapshot, the same in all modes: see `save`
    std::size_t reactions_;         ///< their number
    std::size_t guards_;            ///< number of the user's
    std::vector<GuardInfo> infos_;  ///< of the user's
    std::vector<bool> stands_somewhere_;  ///< guards of the user's that are a y in some mode
    std::vector<bool> has_reaction_;      ///< guards of the user's with a reaction in some mode
    std::vector<std::size_t> own_fired_;
    std::vector<PhaseRules::Fired> fired_;
    std::vector<ReactionChange> changes_;
    mutable InBranches in_branches_;  ///< in the mode that was asked for last
    Stepper<C> explicit_;             ///< in an explicit phase, without a look at what is held
    const StepKernel<C>* free_ = nullptr;
    StepKernel<C> held_, implicit_;
    SystemTable<C> table_;
    PhaseTable<C> phases_;
};

template <class C>
const BranchPhases& PhasedSystem<C>::some_inclusion() const
{
    for (const auto& inclusion : inclusions_) {
        if (inclusion) return *inclusion;
    }
    throw std::invalid_argument(
        "integrate: set_valued(mode) gives no mode an inclusion; expected it to give one to some");
}

template <class C>
void PhasedSystem<C>::refuse_other_size(std::size_t size) const
{
    for (const auto& inclusion : inclusions_) {
        if (!inclusion || inclusion->size() == size) continue;
        throw std::invalid_argument(
            fmt::format("integrate: the inclusion of set_valued has {} components, the state {}; "
                        "expected as many",
                        inclusion->size(), size));
    }
}

template <class C>
void PhasedSystem<C>::make_modes(const C& x0)
{
    stands_somewhere_.assign(guards_, false);
    for (std::size_t mode = 0; mode < inclusions_.size(); ++mode) {
        ModeInclusion of{.mode = static_cast<Mode>(mode),
                         .inclusion = inclusions_[mode].operator->()};
        if (of.inclusion) find_reactions_of_guards(of, x0);
        rules_.choose_watched(of, x0.data());
        for (std::size_t i = 0; i < of.stands_for.size(); ++i) {
            stands_somewhere_[i] = stands_somewhere_[i] || of.stands_for[i] != no_reaction;
        }
        modes_.push_back(std::move(of));
    }
}

template <class C>
void PhasedSystem<C>::find_asked_reactions()
{
    for (std::size_t i = 0; i < guards_; ++i) {
        const std::size_t reaction = infos_[i].reaction;
        if (reaction != no_reaction && reaction >= reactions_) {
            throw std::invalid_argument(fmt::format(
                "integrate: guard {} has reaction {}; expected one below {}, the number of "
                "reactions of set_valued()",
                i, reaction, reactions_));
        }
        has_reaction_.push_back(stands_somewhere_[i] || reaction != no_reaction);
    }
    refuse_partly_active();
}

/// Refuses modes in which the guards of some reactions are disabled and those of others are not. Of
/// a system with very many modes only the first ones are examined.
template <class C>
void PhasedSystem<C>::refuse_partly_active() const
{
    if (by_mode_ || !own_.enabled_in || !own_.moded) return;
    const std::size_t modes = std::min(own_.mode_count(user_.adapter), most_inclusions);
    for (std::size_t mode = 0; mode < modes; ++mode) {
        std::size_t inactive = no_reaction, active = 0;
        for (std::size_t k = 0; k < reactions_; ++k) {
            bool any = false, enabled = false;
            for (std::size_t i = 0; i < guards_; ++i) {
                const std::size_t its = modes_[0].stands_for[i];
                if ((its != no_reaction ? its : infos_[i].reaction) != k) continue;
                any = true;
                enabled = enabled || own_.enabled_in(user_.adapter, i, static_cast<Mode>(mode));
            }
            if (any && !enabled) {
                inactive = k;
            } else {
                ++active;
            }
        }
        if (inactive == no_reaction || active == 0) continue;
        throw std::invalid_argument(fmt::format(
            "integrate: all guards of reaction {} are disabled in mode {}, those of others are "
            "not; expected set_valued(mode), an inclusion for each mode",
            inactive, mode));
    }
}

template <class C>
bool PhasedSystem<C>::is_active(Mode mode) const
{
    if (!own_.enabled_in) return true;
    bool any = false;
    for (std::size_t i = 0; i < has_reaction_.size(); ++i) {
        if (!has_reaction_[i]) continue;
        any = true;
        if (own_.enabled_in(user_.adapter, i, mode)) return true;
    }
    return !any;
}

/// A guard stands for a y if it vanishes where that y does and not elsewhere, at four states around
/// the start. One that cannot be evaluated there stands for none. A guard that names a reaction is
/// compared with the y of that one alone.
template <class C>
void PhasedSystem<C>::find_reactions_of_guards(ModeInclusion& of, const C& x0)
{
    of.stands_for.assign(guards_, no_reaction);
    double size = 1;
    for (const double component : x0) size = std::max(size, std::fabs(component));
    const auto stands_for = [&](std::size_t i, std::size_t k) {
        double away = 0, near = 0;
        for (int j = 0; j < 4; ++j) {
            const double t = rules_.options().t_start;
            C x = x0;
            for (std::size_t c = 0; c < static_cast<std::size_t>(x.size()); ++c) {
                x[c] += 0.3 * size * std::sin(1.7 + 3.1 * static_cast<double>(c) + 5.3 * j);
            }
            away = std::fmax(away, std::fabs(own_.guard(user_.adapter, i, of.mode, t, x)));
            if (!of.inclusion->move_onto(k, t, x.data())) return false;
            near = std::fmax(near, std::fabs(own_.guard(user_.adapter, i, of.mode, t, x)));
        }
        return std::isfinite(away) && away > 0 && near <= 1e-9 * away;
    };
    for (std::size_t i = 0; i < guards_; ++i) {
        if (infos_[i].boolean) continue;
        try {
            for (std::size_t k = 0; k < of.inclusion->reactions(); ++k) {
                if (infos_[i].reaction != no_reaction && infos_[i].reaction != k) continue;
                if (!stands_for(i, k)) continue;
                of.stands_for[i] = k;
                break;
            }
        } catch (...) {
            // The states are invented, and the run may never come near them.
        }
    }
}

template <class C>
Mode PhasedSystem<C>::decide(const PhaseSet<C>& set, C& after)
{
    const Mode before = own_mode(set.before), mode = own_mode(set.after);
    const bool is_own = kind_of(set.before) == PhaseRules::own;
    mode_ = mode;
    if (changes_inclusion(before, mode)) {
        // Numbers of reactions have no meaning across modes.
        rules_.forget_changes();
        return with(in(mode).enter_mode(kind_of(set.before), set.t, after.data()), mode);
    }
    Kind kind = decide_kind(set, after);
    const bool hands_over = is_own && !rules_.has_own_guards(kind) && !rules_.changes().empty();
    if (hands_over && !agrees(set)) kind = rules_.end_as_violated();
    const Mode decided = with(kind, mode);
    return change_ && !rules_.changes().empty() ? after_changes(decided, set.t, after) : decided;
}

template <class C>
Kind PhasedSystem<C>::decide_kind(const PhaseSet<C>& set, C& after)
{
    const Mode mode = own_mode(set.after);
    fired_.clear();
    for (const std::size_t i : set.fired) {
        if (i >= guards_) {
            fired_.push_back({.which = i - guards_});
        } else if (const std::size_t k = stands_for(i, mode); k != no_reaction) {
            fired_.push_back({.guard = i, .reaction = k});
        } else if (const std::size_t asks = reaction_of(i, mode); asks != no_reaction) {
            fired_.push_back({.guard = i, .asks = asks});
        }
    }
    return in(mode).decide({.kind = kind_of(set.before),
                            .t = set.t,
                            .fired = fired_,
                            .on_time = set.on_time,
                            .on_change = set.on_change,
                            .before = set.x.data()},
                           after.data());
}

template <class C>
bool PhasedSystem<C>::agrees(const PhaseSet<C>& set)
{
    C x = set.x;
    if (!rules_.step_back(set.t, x.data())) return true;
    C rate = x;
    if (!own_.flow(user_.adapter, own_mode(set.before), set.t, x, rate)) return true;
    return rules_.is_flow(set.t, x.data(), rate.data());
}

template <class C>
bool PhasedSystem<C>::agrees_at_start(Mode mode, double t, const C& x)
{
    C rate = x;
    if (!own_.flow(user_.adapter, mode, t, x, rate)) return true;
    return rules_.is_flow_at_start(t, x.data(), rate.data());
}

template <class C>
Mode PhasedSystem<C>::after_changes(Mode decided, double t, C& x)
{
    const Mode mode = own_mode(decided);
    const C before = x;
    Mode next = mode;
    for (const ReactionChange& change : rules_.changes()) {
        if (change.kind == EventKind::touch) continue;
        next = change_(user_.adapter, change.reaction, change.kind, next, t, x);
        if (!is_mode(next)) return std::numeric_limits<Mode>::max();
    }
    if (next == mode && same_state(x, before)) return decided;
    mode_ = next;
    return with(in(next).enter_mode(kind_of(decided), t, x.data()), next);
}

template <class C>
void PhasedSystem<C>::make_kernels(std::size_t size)
{
    // Power series are those of the user's guards alone.
    own_kernel_.guard_series = nullptr;
    own_kernel_.cross = nullptr;
    free_ = &kernel_by_name<C>(method_, size);
    held_ = *free_;
    held_.take = [](void* adapter, StepState<C>& step, double h) {
        const Stepper<C>& by = at(adapter).explicit_;
        return by.kernel->take(by.adapter, step, h);
    };
    held_.depart = [](void* adapter, StepState<C>& step, double s, C& w, C& rate) {
        const Stepper<C>& by = at(adapter).explicit_;
        by.kernel->depart(by.adapter, step, s, w, rate);
    };
    held_.attempt = [](void* adapter, StepState<C>& step, double h, double rtol, double atol) {
        return at(adapter).attempt_held(step, h, rtol, atol);
    };
    implicit_.order = implicit_.error_order = 2;
    implicit_.end_rate = true;
    implicit_.take = [](void* adapter, StepState<C>& step, double h) {
        return at(adapter).take_implicit(step, h);
    };
    implicit_.attempt = [](void* adapter, StepState<C>& step, double h, double rtol, double atol) {
        return at(adapter).attempt_implicit(step, h, rtol, atol);
    };
    implicit_.depart = [](void* adapter, StepState<C>& step, double s, C& w, C& rate) {
        at(adapter).depart(step, s, w, rate);
    };
    implicit_.reach = [](void* adapter, StepState<C>& step, double h, double, double) {
        PhasedSystem& me = at(adapter);
        return me.inclusion(step).reach(me.implicit_start(step),
                                        std::min(h, me.rules_.options().step));
    };
    implicit_.ends_at_change = [](void* adapter, const StepState<C>& step) {
        return at(adapter).inclusion(step).ends_at_change();
    };
}

template <class C>
void PhasedSystem<C>::make_table()
{
    SystemTable<C>& t = table_;
    t.guarded = t.moded = t.fixed_dimension = t.guard_alone = t.forward_only = true;
    t.phases = &phases_;
    t.name = [](void* adapter) { return at(adapter).own_.name(at(adapter).user_.adapter); };
    t.flow = [](void* adapter, Mode mode, double time, const C& x, C& dxdt) {
        return at(adapter).flow(mode, time, x, dxdt);
    };
    t.mode_count = [](void* adapter) {
        return static_cast<std::size_t>(at(adapter).rules_.kinds()) * own_modes;
    };
    add_guards();
    add_resets();
    if (own_.timed()) add_time_events();
}

template <class C>
void PhasedSystem<C>::add_guards()
{
    SystemTable<C>& t = table_;
    t.guard_count = [](void* adapter) { return at(adapter).all_guards(); };
    t.info = [](void* adapter, std::size_t i) { return at(adapter).info(i); };
    t.guards = [](void* adapter, Mode mode, double time, const C& x, std::span<double> g) {
        at(adapter).guards(mode, time, x, g);
    };
    if (guards_ == 0) {
        t.guards = [](void* adapter, Mode mode, double time, const C& x, std::span<double> g) {
            at(adapter).guards_of_phases(mode, time, x.data(), g);
        };
    }
    t.guard = [](void* adapter, std::size_t i, Mode mode, double time, const C& x) {
        return at(adapter).guard(i, mode, time, x);
    };
    t.rate = [](void* adapter, GuardInMode of, ScaledTime time, const C& x, const C& dxdt) {
        return at(adapter).rate(of, time, x, dxdt);
    };
    t.rated = guards_ == 0 || own_.rated;
    t.calls_of_rate = t.rated ? 0 : 2;
    if (t.rated) {
        t.rates = [](void* adapter, const Along<C>& motion, std::span<double> rates) {
            at(adapter).rates(motion, rates);
        };
    }
    if (guards_ == 0) {
        t.rates = [](void* adapter, const Along<C>& motion, std::span<double> rates) {
            at(adapter).rates_of_phases(motion, rates);
        };
    }
    t.enabled_in = [](void* adapter, std::size_t i, Mode mode) {
        return at(adapter).enabled(i, mode);
    };
    if (!own_.enabled_at) return;
    t.enabled_at = [](void* adapter, std::size_t i, Mode mode, double time, const C& x) {
        const PhasedSystem& me = at(adapter);
        return i >= me.guards_ || me.own_.enabled_at(me.user_.adapter, i, own_mode(mode), time, x);
    };
}

template <class C>
void PhasedSystem<C>::add_resets()
{
    SystemTable<C>& t = table_;
    if (own_.reset_set) {
        t.reset_set = [](void* adapter, const FiredGuards& fired, Mode mode, double time, C& x) {
            return at(adapter).reset(fired, mode, time, x);
        };
    } else {
        t.reset = [](void* adapter, std::size_t i, Mode mode, double time, C& x) {
            return at(adapter).reset(i, mode, time, x);
        };
    }
    if (!own_.rest) return;
    t.rest = [](void* adapter, std::size_t i, Mode mode, double time, C& x) {
        return at(adapter).rest(i, mode, time, x);
    };
}

template <class C>
void PhasedSystem<C>::add_time_events()
{
    SystemTable<C>& t = table_;
    if (own_.next_time_event) {
        t.next_time_event = [](void* adapter, double time) {
            return at(adapter).own_.next_time_event(at(adapter).user_.adapter, time);
        };
    }
    if (own_.next_time_event_at) {
        t.next_time_event_at = [](void* adapter, Mode mode, double time, const C& x) {
            const PhasedSystem& me = at(adapter);
            return me.own_.next_time_event_at(me.user_.adapter, own_mode(mode), time, x);
        };
    }
    if (own_.time_event_count) {
        t.time_event_count = [](void* adapter, double time) {
            return at(adapter).own_.time_event_count(at(adapter).user_.adapter, time);
        };
    }
    if (own_.time_reset) {
        t.time_reset = [](void* adapter, Mode mode, double time, C& x) {
            const PhasedSystem& me = at(adapter);
            return me.reached(kind_of(mode),
                              me.own_.time_reset(me.user_.adapter, own_mode(mode), time, x));
        };
    }
}
// Long: a list of functions, one for each entry of the table.
template <class C>
void PhasedSystem<C>::make_phases()
{
    PhaseTable<C>& t = phases_;
    t.adapter = this;
    t.own_guards = [](void* adapter) { return at(adapter).guards_; };
    t.stepper = [](void* adapter, Mode mode) { return at(adapter).stepper(mode); };
    t.enter = [](void* adapter, Mode mode, double time, C& x) {
        return at(adapter).enter(mode, time, x);
    };
    t.decide = [](void* adapter, const PhaseSet<C>& set, C& after) {
        return at(adapter).decide(set, after);
    };
    t.changes = [](void* adapter) { return at(adapter).changes(); };
    t.records = [](void* adapter, std::size_t i) {
        const PhasedSystem& me = at(adapter);
        return i < me.guards_ && me.rules_.records(me.stands_for(i, me.mode_), i);
    };
    t.goes_on = [](void* adapter, Mode mode, double time, const C& x, bool has_advanced) {
        PhasedSystem& me = at(adapter);
        const InBranches& by = me.in_branches(mode);
        if (!by.inclusion) return false;
        me.mode_ = own_mode(mode);
        return me.rules_.goes_on(kind_of(mode), *by.inclusion, by.branches, time, x.data(),
                                 has_advanced);
    };
    t.review = [](void* adapter, const PhaseStep<C>& step, C& x) {
        PhasedSystem& me = at(adapter);
        const auto of = me.in(own_mode(step.mode))
                            .review({.kind = kind_of(step.mode),
                                     .t = step.t,
                                     .rate = step.rate.data(),
                                     .h_next = step.h_next,
                                     .has_advanced = step.has_advanced},
                                    x.data());
        return me.verdict(of, step.mode, step.t, x);
    };
    t.give_up = [](void* adapter, const PhaseEnd<C>& end, C& x) {
        PhasedSystem& me = at(adapter);
        const bool of_phases = end.guard == no_guard || end.guard >= me.guards_;
        const Mode mode = own_mode(end.mode);
        const std::size_t reaction = of_phases ? no_reaction : me.reaction_of(end.guard, mode);
        const std::size_t which =
            of_phases && end.guard != no_guard ? end.guard - me.guards_ : no_guard;
        const auto of = me.in(mode).give_up({.kind = kind_of(end.mode),
                                             .outcome = end.outcome,
                                             .t = end.t,
                                             .of_phases = of_phases,
                                             .which = which,
                                             .reaction = reaction},
                                            x.data());
        return me.verdict(of, end.mode, end.t, x);
    };
    t.name_of = [](void* adapter, std::size_t guard) {
        const PhasedSystem& me = at(adapter);
        return me.rules_.name_of(guard - me.guards_);
    };
    t.reason = [](void* adapter) { return std::string_view(at(adapter).rules_.reason()); };
    t.reaction = [](void* adapter, const PhasePlace<C>& at, std::vector<double>& r) {
        PhasedSystem& me = PhasedSystem::at(adapter);
        me.in(own_mode(at.mode))
            .reaction(kind_of(at.mode), {at.t0, at.x0.data(), at.s, at.t, at.x.data()}, r);
    };
    t.list_in = [](void* adapter, std::vector<MotionPhase>& phases) {
        at(adapter).rules_.list_in(phases);
    };
    t.complete = [](void* adapter, Run<C>& run) { at(adapter).complete(run); };
    t.save = [](void* adapter, std::vector<double>& memory) {
        const PhasedSystem& me = at(adapter);
        me.in(me.mode_).save(memory);
        memory.resize(std::max(me.memory_, memory.size()));
        memory.push_back(static_cast<double>(me.mode_));
    };
    t.restore = [](void* adapter, const std::vector<double>& memory) {
        PhasedSystem& me = at(adapter);
        me.mode_ = static_cast<Mode>(memory.back());
        me.in(me.mode_).restore(memory);
    };
}

template <class C>
void PhasedSystem<C>::complete(Run<C>& run) const
{
    run.set_valued = {.accepted = rules_.implicit_steps()};
    for (const auto& inclusion : inclusions_) {
        if (!inclusion) continue;
        run.set_valued.attempted += inclusion->attempts();
        run.set_valued.stages += inclusion->stages();
    }
    run.failure = {};
    if (run.outcome != Outcome::not_converged) return;
    const BranchPhases* const here = inclusion_of(mode_).inclusion;
    run.failure = here ? here->failure() : some_inclusion().failure();
}

template <class C>
std::span<const ReactionChange> PhasedSystem<C>::changes()
{
    changes_.assign(rules_.changes().begin(), rules_.changes().end());
    for (ReactionChange& change : changes_) {
        if (change.fired != no_guard) change.fired += guards_;
    }
    return changes_;
}

}  // namespace ricochet::detail
