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
#include "ricochet/detail/phased_run.hpp"
#include "ricochet/detail/refusals.hpp"

namespace ricochet::detail {

/// The combined system; the door of its table.
template <class C>
class PhasedSystem {
public:
    PhasedSystem(PhasedSetup<C>&& setup, const C& x0, const PhaseOptions& options)
        : user_(setup.user),
          own_(*setup.user.system),
          start_mode_(setup.start_mode),
          inclusion_(std::move(setup.inclusion)),
          rules_(*inclusion_, options),
          guards_(own_.guarded ? own_.guard_count(user_.door) : 0)
    {
        if (own_.moded && own_.mode_count(user_.door) >= own_modes) {
            throw std::invalid_argument(
                "integrate: a system with set_valued() has at most 2^24 - 1 modes");
        }
        for (std::size_t i = 0; i < guards_; ++i) {
            infos_.push_back(own_.info(user_.door, i));
            infos_.back().resets = infos_.back().resets && own_.resets();
        }
        find_reactions_of_guards(x0);
        rules_.watch(x0.data(), stands_for_);
        make_kernels(setup.method, x0.size());
        make_table();
        make_phases();
    }
    PhasedSystem(const PhasedSystem&) = delete;
    PhasedSystem& operator=(const PhasedSystem&) = delete;

    [[nodiscard]] const SystemTable<C>& table() const noexcept { return table_; }
    [[nodiscard]] const PhaseRules& rules() const noexcept { return rules_; }
    [[nodiscard]] const BranchPhases& inclusion() const noexcept { return *inclusion_; }

    /// The mode in which a run starts at (t, x) in a mode of the user's.
    [[nodiscard]] Mode enter(Mode mode, double t, C& x)
    {
        const std::size_t modes = own_.moded ? own_.mode_count(user_.door) : 1;
        if (modes > 0 && mode >= modes) throw_unknown_mode("integrate", mode, modes);
        return with(rules_.enter(t, x.data()), mode);
    }

private:
    [[nodiscard]] static PhasedSystem& at(void* door) noexcept
    {
        return *static_cast<PhasedSystem*>(door);
    }

    [[nodiscard]] static constexpr Kind kind_of(Mode mode) noexcept { return mode / own_modes; }
    [[nodiscard]] static constexpr Mode with(Kind kind, Mode mode) noexcept
    {
        return kind * own_modes + mode;
    }
    /// The user's mode after a reset, or one that no system has.
    [[nodiscard]] Mode reached(Kind kind, Mode mode) const
    {
        const std::size_t modes = own_.moded ? own_.mode_count(user_.door) : 1;
        const std::size_t most = modes > 0 ? modes : own_modes - 1;
        return mode < most ? with(kind, mode) : std::numeric_limits<Mode>::max();
    }

    void find_reactions_of_guards(const C& x0);
    void make_kernels(MethodName method, std::size_t size);
    void make_table();
    void add_guards();
    void add_resets();
    void add_time_events();
    void make_phases();

    // --- guards: the user's, then six for each reaction, of which the last watches own phases ---

    [[nodiscard]] std::size_t all_guards() const noexcept
    {
        return guards_ + PhaseRules::guards_of_reaction * inclusion_->reactions();
    }
    [[nodiscard]] GuardInfo info(std::size_t i) const
    {
        if (i >= guards_) return rules_.guard_info(i - guards_);
        GuardInfo info = infos_[i];
        // What stands for a y changes the motion there.
        if (stands_for_[i] != no_reaction && !info.unilateral) info.resets = true;
        return info;
    }
    void guards(Mode mode, double t, const C& x, std::span<double> g) const
    {
        if (guards_ > 0) own_.guards(user_.door, own_mode(mode), t, x, g.first(guards_));
        rules_.guards(kind_of(mode), t, x.data(), g.subspan(guards_));
    }
    [[nodiscard]] double guard(std::size_t i, Mode mode, double t, const C& x) const
    {
        if (i < guards_) return own_.guard(user_.door, i, own_mode(mode), t, x);
        return rules_.guard(i - guards_, kind_of(mode), t, x.data());
    }
    [[nodiscard]] double rate(GuardInMode of, ScaledTime time, const C& x, const C& dxdt) const
    {
        const Mode mode = own_mode(of.mode);
        if (of.which < guards_) {
            return own_.rate(user_.door, {of.which, mode, of.backward}, time, x, dxdt);
        }
        return rules_.guard_rate(of.which - guards_, kind_of(of.mode), time.t, x.data(),
                                 dxdt.data());
    }
    void rates(const Along<C>& motion, std::span<double> rates) const
    {
        const Mode mode = own_mode(motion.mode);
        const Along<C> own{mode, motion.t, motion.x, motion.s};
        if (own_.rates) {
            own_.rates(user_.door, own, rates.first(guards_));
        } else {
            for (std::size_t i = 0; i < guards_; ++i) {
                rates[i] = own_.rate(user_.door, {i, mode}, {motion.t, 0}, motion.x, motion.s);
            }
        }
        rules_.guard_rates(kind_of(motion.mode), motion.t, motion.x.data(), motion.s.data(),
                           rates.subspan(guards_));
    }
    [[nodiscard]] bool enabled(std::size_t i, Mode mode) const
    {
        const Kind kind = kind_of(mode);
        if (i >= guards_) return rules_.enabled(i - guards_, kind);
        if (!rules_.has_own_guards(kind) && stands_for_[i] != no_reaction) return false;
        return !own_.enabled_in || own_.enabled_in(user_.door, i, own_mode(mode));
    }

    // --- resets ---

    [[nodiscard]] Mode reset(std::size_t i, Mode mode, double t, C& x) const
    {
        if (i >= guards_ || !infos_[i].resets) return mode;
        return reached(kind_of(mode), own_.reset(user_.door, i, own_mode(mode), t, x));
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
            return reached(kind_of(mode), own_.reset_set(user_.door, set, own, t, x));
        }
        if (!fired.time_event() || !own_.time_reset) return mode;
        return reached(kind_of(mode), own_.time_reset(user_.door, own, t, x));
    }
    [[nodiscard]] Mode rest(std::size_t i, Mode mode, double t, C& x)
    {
        const C before = x;
        const Mode own = own_.rest(user_.door, i, own_mode(mode), t, x);
        if (kind_of(mode) == PhaseRules::own) return reached(PhaseRules::own, own);
        const PhaseSet<C> set{{}, false, false, t, mode, mode, before};
        return reached(kind_of(decide(set, x)), own);
    }

    // --- phases ---

    [[nodiscard]] Stepper<C> stepper(Mode mode)
    {
        const Kind kind = kind_of(mode);
        if (kind == PhaseRules::own) return {user_.kernel, user_.door, own_.flow};
        if (rules_.is_implicit(kind)) return {&implicit_, this, table_.flow};
        return {rules_.holds(kind) ? &held_ : free_, this, table_.flow};
    }
    bool flow(Mode mode, double t, const C& x, C& dxdt)
    {
        const Kind kind = kind_of(mode);
        if (kind == PhaseRules::own) return own_.flow(user_.door, own_mode(mode), t, x, dxdt);
        rules_.flow(kind, t, x.data(), dxdt.data());
        return true;
    }
    [[nodiscard]] Mode decide(const PhaseSet<C>& set, C& after)
    {
        fired_.clear();
        for (const std::size_t i : set.fired) {
            if (i >= guards_) {
                fired_.push_back({i - guards_, no_guard, no_reaction});
            } else if (stands_for_[i] != no_reaction) {
                fired_.push_back({no_guard, i, stands_for_[i]});
            }
        }
        const Kind kind = rules_.decide({.kind = kind_of(set.before),
                                         .t = set.t,
                                         .fired = fired_,
                                         .on_time = set.on_time,
                                         .on_change = set.on_change,
                                         .before = set.x.data()},
                                        after.data());
        return with(kind, own_mode(set.after));
    }
    [[nodiscard]] std::span<const ReactionChange> changes();
    [[nodiscard]] PhaseVerdict verdict(const PhaseRules::Verdict& of, Mode mode, double t,
                                       const C& x) const
    {
        PhaseVerdict out{.kind = of.what, .h = of.h, .outcome = of.outcome};
        Mode own = own_mode(mode);
        const bool releases = of.what == PhaseVerdict::Kind::changes &&
                              of.kind == PhaseRules::own && !rules_.has_own_guards(kind_of(mode));
        if (start_mode_ && releases) {
            own = start_mode_(user_.door, t, x);
        }
        out.mode = reached(of.kind, own);
        return out;
    }

    // --- steps ---

    [[nodiscard]] ImplicitStart implicit_start(const StepState<C>& step) const
    {
        const Kind kind = kind_of(step.mode);
        return {step.start.value, step.x0.data(), rules_.branches_of(kind),
                kind == rules_.across()};
    }
    [[nodiscard]] double take_implicit(StepState<C>& step, double h)
    {
        step.h = h;
        step.has_middle = false;
        step.asked_alone = 0;
        ++step.flow_calls;
        const bool solved =
            inclusion_->take(implicit_start(step), h, step.x1.data(), step.rate1.data());
        if (!solved) return std::numeric_limits<double>::quiet_NaN();
        for_each_component(
            step.x1, [&](auto i) { step.w[i] = (step.x1[i] - step.x0[i]) - h * step.rate0[i]; });
        return 0;
    }
    void depart(StepState<C>& step, double s, C& w, C& rate)
    {
        assign(w, step.x0);
        assign(rate, step.rate0);
        inclusion_->take_to(implicit_start(step), step.h, s, w.data(), rate.data());
        for_each_component(w, [&](auto i) {
            w[i] = (w[i] - step.x0[i]) - s * step.rate0[i];
            rate[i] -= step.rate0[i];
        });
    }
    /// The error of a step that the held reactions do not follow asks for a shorter one.
    [[nodiscard]] double attempt_held(StepState<C>& step, double h, double rtol, double atol)
    {
        const double error = free_->attempt(this, step, h, rtol, atol);
        if (!(error <= 1)) return error;
        const double fraction = rules_.fraction_of_held(
            kind_of(step.mode), step.start.value, step.x0.data(), step.time(h), step.x1.data());
        if (fraction == 1) return error;
        return std::max(error, std::pow(0.9 / fraction, free_->error_order + 1));
    }

    RunSetup<C> user_;
    const SystemTable<C>& own_;
    Mode (*start_mode_)(void* door, double t, const C& x);
    Owner<BranchPhases> inclusion_;
    PhaseRules rules_;
    std::size_t guards_;                   ///< number of the user's
    std::vector<GuardInfo> infos_;         ///< of the user's
    std::vector<std::size_t> stands_for_;  ///< reaction whose y a guard of the user's is
    std::vector<std::size_t> own_fired_;
    std::vector<PhaseRules::Fired> fired_;
    std::vector<ReactionChange> changes_;
    const StepKernel<C>* free_ = nullptr;
    StepKernel<C> held_, implicit_;
    SystemTable<C> table_;
    PhaseTable<C> phases_;
};

/// A guard stands for a y if it vanishes where that y does and not elsewhere, at four states around
/// the start. One that cannot be evaluated there stands for none.
template <class C>
void PhasedSystem<C>::find_reactions_of_guards(const C& x0)
{
    stands_for_.assign(guards_, no_reaction);
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
            away = std::fmax(away, std::fabs(own_.guard(user_.door, i, 0, t, x)));
            if (!inclusion_->move_onto(k, t, x.data())) return false;
            near = std::fmax(near, std::fabs(own_.guard(user_.door, i, 0, t, x)));
        }
        return std::isfinite(away) && away > 0 && near <= 1e-9 * away;
    };
    for (std::size_t i = 0; i < guards_; ++i) {
        if (infos_[i].boolean) continue;
        try {
            for (std::size_t k = 0; k < inclusion_->reactions(); ++k) {
                if (!stands_for(i, k)) continue;
                stands_for_[i] = k;
                break;
            }
        } catch (...) {
            // The states are invented, and the run may never come near them.
        }
    }
}

template <class C>
void PhasedSystem<C>::make_kernels(MethodName method, std::size_t size)
{
    free_ = &kernel_by_name<C>(method, size);
    held_ = *free_;
    held_.attempt = [](void* door, StepState<C>& step, double h, double rtol, double atol) {
        return at(door).attempt_held(step, h, rtol, atol);
    };
    implicit_.order = implicit_.error_order = 2;
    implicit_.end_rate = true;
    implicit_.take = [](void* door, StepState<C>& step, double h) {
        return at(door).take_implicit(step, h) == 0;
    };
    implicit_.attempt = [](void* door, StepState<C>& step, double h, double, double) {
        return at(door).take_implicit(step, h);
    };
    implicit_.depart = [](void* door, StepState<C>& step, double s, C& w, C& rate) {
        at(door).depart(step, s, w, rate);
    };
    implicit_.reach = [](void* door, StepState<C>& step, double, double) {
        PhasedSystem& me = at(door);
        return me.inclusion_->reach(me.implicit_start(step), me.rules_.options().step);
    };
    implicit_.ends_at_change = [](void* door, const StepState<C>&) {
        return at(door).inclusion_->ends_at_change();
    };
}

template <class C>
void PhasedSystem<C>::make_table()
{
    SystemTable<C>& t = table_;
    t.guarded = t.moded = t.fixed_dimension = t.guard_alone = t.forward_only = true;
    t.phases = &phases_;
    t.name = [](void* door) { return at(door).own_.name(at(door).user_.door); };
    t.flow = [](void* door, Mode mode, double time, const C& x, C& dxdt) {
        return at(door).flow(mode, time, x, dxdt);
    };
    t.mode_count = [](void* door) {
        return static_cast<std::size_t>(at(door).rules_.kinds()) * own_modes;
    };
    add_guards();
    add_resets();
    if (own_.timed()) add_time_events();
}

template <class C>
void PhasedSystem<C>::add_guards()
{
    SystemTable<C>& t = table_;
    t.guard_count = [](void* door) { return at(door).all_guards(); };
    t.info = [](void* door, std::size_t i) { return at(door).info(i); };
    t.guards = [](void* door, Mode mode, double time, const C& x, std::span<double> g) {
        at(door).guards(mode, time, x, g);
    };
    t.guard = [](void* door, std::size_t i, Mode mode, double time, const C& x) {
        return at(door).guard(i, mode, time, x);
    };
    t.rate = [](void* door, GuardInMode of, ScaledTime time, const C& x, const C& dxdt) {
        return at(door).rate(of, time, x, dxdt);
    };
    t.rated = guards_ == 0 || own_.rated;
    t.calls_of_rate = t.rated ? 0 : 2;
    if (t.rated) {
        t.rates = [](void* door, const Along<C>& motion, std::span<double> rates) {
            at(door).rates(motion, rates);
        };
    }
    t.enabled_in = [](void* door, std::size_t i, Mode mode) { return at(door).enabled(i, mode); };
    if (!own_.enabled_at) return;
    t.enabled_at = [](void* door, std::size_t i, Mode mode, double time, const C& x) {
        const PhasedSystem& me = at(door);
        return i >= me.guards_ || me.own_.enabled_at(me.user_.door, i, own_mode(mode), time, x);
    };
}

template <class C>
void PhasedSystem<C>::add_resets()
{
    SystemTable<C>& t = table_;
    if (own_.reset_set) {
        t.reset_set = [](void* door, const FiredGuards& fired, Mode mode, double time, C& x) {
            return at(door).reset(fired, mode, time, x);
        };
    } else {
        t.reset = [](void* door, std::size_t i, Mode mode, double time, C& x) {
            return at(door).reset(i, mode, time, x);
        };
    }
    if (!own_.rest) return;
    t.rest = [](void* door, std::size_t i, Mode mode, double time, C& x) {
        return at(door).rest(i, mode, time, x);
    };
}

template <class C>
void PhasedSystem<C>::add_time_events()
{
    SystemTable<C>& t = table_;
    if (own_.next_time_event) {
        t.next_time_event = [](void* door, double time) {
            return at(door).own_.next_time_event(at(door).user_.door, time);
        };
    }
    if (own_.next_time_event_at) {
        t.next_time_event_at = [](void* door, Mode mode, double time, const C& x) {
            const PhasedSystem& me = at(door);
            return me.own_.next_time_event_at(me.user_.door, own_mode(mode), time, x);
        };
    }
    if (own_.time_event_count) {
        t.time_event_count = [](void* door, double time) {
            return at(door).own_.time_event_count(at(door).user_.door, time);
        };
    }
    if (own_.time_reset) {
        t.time_reset = [](void* door, Mode mode, double time, C& x) {
            const PhasedSystem& me = at(door);
            return me.reached(kind_of(mode),
                              me.own_.time_reset(me.user_.door, own_mode(mode), time, x));
        };
    }
}

template <class C>
void PhasedSystem<C>::make_phases()
{
    PhaseTable<C>& t = phases_;
    t.own_guards = [](void* door) { return at(door).guards_; };
    t.stepper = [](void* door, Mode mode) { return at(door).stepper(mode); };
    t.enter = [](void* door, Mode mode, double time, C& x) {
        return at(door).enter(mode, time, x);
    };
    t.decide = [](void* door, const PhaseSet<C>& set, C& after) {
        return at(door).decide(set, after);
    };
    t.changes = [](void* door) { return at(door).changes(); };
    t.records = [](void* door, std::size_t i) {
        const PhasedSystem& me = at(door);
        return i < me.guards_ && me.rules_.records(me.stands_for_[i], i);
    };
    t.review = [](void* door, const PhaseStep<C>& step, C& x) {
        PhasedSystem& me = at(door);
        const auto of = me.rules_.review({.kind = kind_of(step.mode),
                                          .t = step.t,
                                          .rate = step.rate.data(),
                                          .h_next = step.h_next,
                                          .has_advanced = step.has_advanced},
                                         x.data());
        return me.verdict(of, step.mode, step.t, x);
    };
    t.give_up = [](void* door, const PhaseEnd<C>& end, C& x) {
        PhasedSystem& me = at(door);
        const bool of_phases = end.guard == no_guard || end.guard >= me.guards_;
        const std::size_t own = of_phases ? no_reaction : me.stands_for_[end.guard];
        const std::size_t which =
            of_phases && end.guard != no_guard ? end.guard - me.guards_ : no_guard;
        const auto of = me.rules_.give_up({.kind = kind_of(end.mode),
                                           .outcome = end.outcome,
                                           .t = end.t,
                                           .of_phases = of_phases,
                                           .which = which,
                                           .reaction = own},
                                          x.data());
        return me.verdict(of, end.mode, end.t, x);
    };
    t.save = [](void* door, std::vector<double>& memory) { at(door).rules_.save(memory); };
    t.restore = [](void* door, const std::vector<double>& memory) {
        at(door).rules_.restore(memory);
    };
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
