// Internal: the declarations of this header may change without notice.
//
// `BranchPhases` of boxes of at most four reactions, in solvers of N components and M reactions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "ricochet/nonsmooth/branch_modes.hpp"
#include "ricochet/nonsmooth/detail/branch_kernels.hpp"
#include "ricochet/nonsmooth/detail/false_position.hpp"
#include "ricochet/nonsmooth/detail/held_reactions.hpp"
#include "ricochet/nonsmooth/detail/implicit_phases.hpp"
#include "ricochet/nonsmooth/detail/phases_of_parts.hpp"

namespace ricochet::detail {

template <int N, int M>
class RICOCHET_ALIGNED BranchPhasesOf final : public ImplicitPhases<N, M> {
    using Base = ImplicitPhases<N, M>;
    using Modes = AnyModes<N, M>;
    using Vector = typename Modes::Vector;
    using Reaction = typename Modes::Reaction;
    using Branches = BranchesOf<M>;
    using State = StateWithReaction<N, M>;
    using X = typename Modes::State;

public:
    using Base::reactions, Base::size;

    BranchPhasesOf(const AnyInclusion<N, M>& inclusion, const BranchPhasesOptions& options)
        : Base(inclusion, options), modes_(inclusion)
    {
        located_.end = to_;
        located_.error = error_;
    }

    [[nodiscard]] Mode branch_modes() const noexcept override { return Modes::branch_modes; }

    // --- y and its reactions ---

    void observe(double t, const double* x, double* y) const override
    {
        write(modes_.observed(t, vector(x)), y, reactions());
    }

    [[nodiscard]] bool keeps_sides(Mode b, double t, const double* x, double* sides) const override
    {
        const Reaction y = modes_.observed(t, vector(x));
        for (Eigen::Index i = 0; i < modes_.count(); ++i, b /= 3) {
            if ((b % 3 == 0 && y[i] < 0) || (b % 3 == 2 && y[i] > 0)) return false;
            if (y[i] != 0) sides[i] = std::copysign(1.0, y[i]);
        }
        return true;
    }

    // --- entering ---

    void check_bounds(double t, const double* x) const override
    {
        modes_.check_bounds(t, vector(x));
    }
    [[nodiscard]] bool keeps_to_branches() const noexcept override
    {
        return matrices().traits().gives_static_bound;
    }
    [[nodiscard]] Mode signs(double t, const double* x) const override
    {
        return Modes::mode_of(modes_.zero_branches(t, vector(x)));
    }
    [[nodiscard]] Mode start(double t, double* x) const override
    {
        Vector w = vector(x);
        const Mode b = modes_.mode_at(t, w);
        write(w, x, size());
        return b;
    }
    [[nodiscard]] Mode arrive(Mode at, double t, double* x) const override
    {
        Vector w = vector(x);
        const Mode b = modes_.arrive(Modes::branches_of(at), t, w);
        write(w, x, size());
        return b;
    }
    [[nodiscard]] Mode resume(double t, double* x, const double* reaction, double error) override
    {
        State end = from_;
        end.t = t;
        end.w = vector(x);
        end.reaction.setZero();
        for (std::size_t i = 0; i < reactions(); ++i) end.reaction[index(i)] = reaction[i];
        check_start(matrices(), end.t, end.w);
        check_reaction(matrices(), end);
        to_ = end;
        const Mode b = modes_.mode_after(end, error);
        write(end.w, x, size());
        return b;
    }
    void hold(Mode at, double t, double* x) const override
    {
        Vector w = vector(x);
        modes_.hold(Modes::branches_of(at), t, w);
        write(w, x, size());
    }

    [[nodiscard]] std::size_t undetermined(Mode at, double t, const double* x) const override
    {
        return modes_.undetermined(Modes::branches_of(at), t, vector(x));
    }

    // --- explicit phases ---

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const override
    {
        return Modes::guard_info(of_modes(which));
    }
    [[nodiscard]] bool enabled(std::size_t which, Mode b) const noexcept override
    {
        return modes_.enabled(of_modes(which), b);
    }
    [[nodiscard]] double guard(std::size_t which, Mode b, double t, const double* x) const override
    {
        return modes_.guard(of_modes(which), b, t, vector(x));
    }
    void guards(Mode b, double t, const double* x, double* g, std::size_t stride) const override
    {
        std::array<double, Modes::guard_count> all;
        const Vector w = vector(x);
        modes_.guards(b, t, w, known(b, t, w), all);
        spread(all, g, stride);
    }
    [[nodiscard]] double guard_rate(std::size_t which, Mode b, double t, const double* x,
                                    const double* dxdt) const override
    {
        return modes_.guard_rate(of_modes(which), b, t, vector(x), vector(dxdt));
    }
    void guard_rates(Mode b, double t, const double* x, const double* dxdt, double* rates,
                     std::size_t stride) const override
    {
        std::array<double, Modes::guard_count> all;
        const Vector w = vector(x);
        modes_.guard_rates(b, t, w, vector(dxdt), known(b, t, w), all);
        spread(all, rates, stride);
    }
    [[nodiscard]] Mode reset(std::span<const std::size_t> fired, Mode b, double t,
                             double* x) const override
    {
        std::array<std::size_t, Modes::guard_count> which;
        for (std::size_t k = 0; k < fired.size(); ++k) which[k] = of_modes(fired[k]);
        X at = array(x);
        const Mode next = modes_.reset(FiredGuards({which.data(), fired.size()}), b, t, at);
        std::copy_n(at.data(), size(), x);
        return next;
    }
    [[nodiscard]] bool stays_held(Mode b, double t, const double* x) const override
    {
        typename Modes::Motion motion;
        typename Modes::Rooms rooms;
        modes_.rooms(b, t, vector(x), motion, rooms);
        return *std::min_element(rooms.begin(), rooms.end()) >= 0;
    }
    [[nodiscard]] bool at_bounds(Mode b, double t, const double* x, double* rounding) const override
    {
        typename Modes::Motion motion;
        typename Modes::Rooms rooms;
        modes_.rooms(b, t, vector(x), motion, rooms);
        const double doubt = modes_.rounding_at_bound(b, motion);
        bool any = false;
        for (std::size_t i = 0; i < reactions(); ++i) {
            // One that has a single value has no motion to be released to.
            const auto [near, far] = std::minmax(rooms[2 * i], rooms[2 * i + 1]);
            const bool is_at_bound = std::fabs(near) <= doubt && far > doubt;
            rounding[i] = is_at_bound ? doubt : 0;
            any = any || is_at_bound;
        }
        return any;
    }
    [[nodiscard]] bool flows(Mode b) const noexcept override { return modes_.flows(b); }
    void flow(Mode b, double t, const double* x, double* dxdt) const override
    {
        X rate;
        modes_.flow(b, t, array(x), rate);
        Base::write_state(rate.data(), dxdt);
    }
    [[nodiscard]] BranchStepper stepper(MethodName method, Mode b) noexcept override
    {
        if constexpr (has_branch_kernel<N>) {
            if (size() != static_cast<std::size_t>(N)) return {};  // a state of another size
            flow_.of = modes_.flow_by_components();
            flow_.mode = b;
            return {&branch_kernel<N>(method), &adapter_};
        }
        return {};
    }
    void reaction(Mode b, double t, const double* x, double* r) const override
    {
        write(modes_.reaction(b, t, vector(x)), r, reactions());
    }
    [[nodiscard]] double rate_of(std::size_t i, const double* dxdt) const override
    {
        return modes_.rate_of(index(i), vector(dxdt));
    }
    [[nodiscard]] double fraction_of_held(Mode b, double t0, const double* x0, double t1,
                                          const double* x1, bool may_jump) override
    {
        const Vector w0 = vector(x0), w1 = vector(x1);
        // A set at the end of the last step has moved the state.
        if (held_end_.t == t0 && held_end_.w != w0) forget_held();
        known_.t = t1;
        known_.branches = b;
        known_.w = w1;
        typename Modes::Rooms rooms;
        modes_.rooms(b, t1, w1, known_.motion, rooms);
        HeldStep<Vector> step{b, t0, t1, w0, w1, options_.event_tolerance};
        double fraction = fraction_to(step, known_.motion.rate, rooms);
        if (may_jump && fraction != 1 && this->jumps(t1, x1)) {
            // A load that jumps at the end of the step belongs to the next one.
            step.t1 = std::nextafter(t1, t0);
            typename Modes::Motion motion;
            modes_.rooms(b, step.t1, w1, motion, rooms);
            forget_held();
            fraction = fraction_to(step, motion.rate, rooms);
            // The loop does not see an exit that the jump hides.
            if (fraction == beyond_at_end) return 0.5;
        }
        return fraction == beyond_at_end ? 1 : fraction;
    }

    // --- implicit phases ---

    [[nodiscard]] double reach(const ImplicitStart& from, double h) override
    {
        located_.valid = false;
        if (from.crosses) return h;
        place(from);
        const Branches b = Modes::branches_of(from.branches);
        const auto slack_after = [&](double s) {
            return solve(s, located_.end, &b) ? step_.slack(located_.end, b)
                                              : std::numeric_limits<double>::quiet_NaN();
        };
        double high = h;
        double at_high = slack_after(h);
        bool clear = at_high >= 0;
        // A branch that is left and entered again within the step shows at its middle stage.
        if (clear && !(step_.slack(step_.middle(), b) >= 0)) {
            clear = false;
            high = h / 2;
            at_high = slack_after(high);
        }
        if (!clear) {
            const double low = 1e-6 * high;
            const double at_low = slack_after(low);
            if (!(at_high < 0) || !(at_low > 0)) return h;  // across all changes
            high = false_position(low, at_low, high, at_high, 0, slack_after);
            if (!(high > 0) || !solve(high, located_.end, &b)) return h;
        }
        located_.valid = true;
        located_.change = !clear;
        located_.t = from.t;
        located_.length = high;
        located_.branches = from.branches;
        located_.w = from_.w;
        step_.embedded_error(from_, high, located_.end, located_.error);
        return high;
    }
    [[nodiscard]] bool take(const ImplicitStart& from, double h, const ImplicitEnd& end) override
    {
        ++this->attempts_;
        place(from);
        from_is_to_ = from_;
        bool stays = stays_in_branches(from, h);
        const bool to_end = stays && h == located_.length;
        const Branches b = Modes::branches_of(from.branches);
        if (to_end) {
            to_ = located_.end;
            error_ = located_.error;
        } else if (stays) {
            // A y that has returned by the end of the step that was looked at may be away here.
            stays = solve(h, to_, &b) && step_.slack(to_, b) >= 0;
            located_.valid = stays;
        }
        if (!stays && !solve(h, to_, nullptr)) return false;
        if (!to_end) step_.embedded_error(from_, h, to_, error_);
        change_ = to_end && located_.change;
        crossed_ = !stays && !from.crosses;
        if (crossed_) {  // a change that was not located shows at the end
            next_ = branches_of(to_);
            change_ = next_ != from.branches;
        }
        put(end);
        return true;
    }
    void take_to(const ImplicitStart& from, double h, double s, const ImplicitEnd& end) override
    {
        place(from);
        const Branches b = Modes::branches_of(from.branches);
        // Held reactions that depend on one another are not always determined in their branches.
        const bool stays = stays_in_branches(from, h) && solve(s, probe_, &b);
        if (!stays && !solve(s, probe_, nullptr)) Base::give_up(probe_);
        write(probe_.w, end.x, size());
        Base::rate(probe_, end.dxdt);
    }
    [[nodiscard]] bool ends_at_change() const noexcept override { return change_; }
    [[nodiscard]] Mode change(Mode b, double t, double* x) override
    {
        change_ = false;
        if (crossed_) {
            for (std::size_t i = 0; i < reactions(); ++i) {
                if (Base::branch(i, next_) != Base::branch(i, b)) changed_ = i;
            }
            return next_;
        }
        Branches branches = Modes::branches_of(b);
        Eigen::Index which = 0;
        (void)step_.slack(located_.end, branches, &which);
        changed_ = static_cast<std::size_t>(which);
        if (branches[which] == Branch::inside) {
            Reaction lower, upper;
            matrices().inclusion().bounds(t, vector(x), lower, upper);
            double& r = to_.reaction[which];
            const bool up = r - lower[which] > upper[which] - r;
            branches[which] = up ? Branch::upper : Branch::lower;
            r = up ? upper[which] : lower[which];
            return Modes::mode_of(branches);
        }
        return arrive_at(which, t, x);
    }
    [[nodiscard]] std::size_t changed() const noexcept override { return changed_; }
    void note_faulty(double t, const double* x) override
    {
        Base::note_faulty(t, x);
        this->failure_.set = modes_.faulty(t, vector(x));
    }

    // --- memory ---

    void save(std::vector<double>& memory) const override
    {
        memory.insert(memory.end(), {held_end_.t, held_end_.h,
                                     static_cast<double>(held_end_.branches), held_.worst()});
        Base::add(memory, held_end_.w);
        Base::save(memory);
    }
    void restore(std::span<const double> memory) override
    {
        held_end_.t = memory[0];
        held_end_.h = memory[1];
        held_end_.branches = static_cast<Mode>(memory[2]);
        const double worst = memory[3];
        std::size_t next = 4;
        Base::read(memory, next, held_end_.w);
        Base::restore(memory.subspan(next));
        held_.forget();
        if (held_end_.h > 0) {
            held_.resume(modes_, held_end_.branches, held_end_.t, held_end_.w, held_end_.h, worst);
        }
        located_.valid = change_ = false;
    }

private:
    struct Located {
        bool valid = false;
        bool change = false;  ///< the step ends at one
        double t = 0, length = 0;
        Mode branches = 0;
        Vector w;
        State end;
        Vector error;
    };
    struct HeldEnd {
        double t = 0, h = 0;
        Mode branches = 0;
        Vector w = Vector::Zero(N);
    };

    using Base::error_, Base::from_, Base::from_is_to_, Base::options_, Base::probe_, Base::step_,
        Base::to_;
    using Base::index, Base::matrices, Base::place, Base::put, Base::solve, Base::vector,
        Base::write;

    [[nodiscard]] static constexpr std::size_t of_modes(std::size_t which) noexcept
    {
        const std::size_t i = which / Base::guards_of_reaction,
                          kind = which % Base::guards_of_reaction;
        return kind < 4 ? 4 * i + kind : Modes::first_set_guard + i;
    }
    void spread(const std::array<double, Modes::guard_count>& all, double* g,
                std::size_t stride) const
    {
        for (std::size_t i = 0; i < reactions(); ++i, g += stride) {
            for (std::size_t k = 0; k < 4; ++k) g[k] = all[4 * i + k];
            g[4] = all[Modes::first_set_guard + i];
        }
    }

    /// The motion in branches b at (t, w) where a held step has just ended, else null.
    [[nodiscard]] const typename Modes::Motion* known(Mode b, double t, const Vector& w) const
    {
        const bool same = t == known_.t && b == known_.branches && w == known_.w;
        return same ? &known_.motion : nullptr;
    }

    [[nodiscard]] X array(const double* x) const
    {
        X out;
        Base::read_state(x, out.data());
        return out;
    }

    void forget_held()
    {
        held_.forget();
        held_end_.h = 0;
    }
    /// The fraction of a step with these rooms at its end that would follow the held reactions;
    /// `beyond_at_end` where one has passed its bound by then, and negative where one was beyond it
    /// at the start.
    [[nodiscard]] double fraction_to(const HeldStep<Vector>& step, const Vector& rate,
                                     const typename Modes::Rooms& rooms)
    {
        for (const double room : rooms) {
            if (!(room < 0)) continue;
            if (!exits(step.mode, step.t0, step.w0, rooms)) return -1;
            return held_.passes_once(modes_, step, rate, rooms) ? beyond_at_end : 0.5;
        }
        const double fraction = held_.fraction(modes_, step, rate, rooms);
        held_end_ = {step.t1, step.h(), step.mode, step.w1};
        return held_.starts_beyond() ? -1 : fraction;
    }
    static constexpr double beyond_at_end = 2;

    /// Whether the reactions that are beyond their bounds at the end of a step, which leaves the
    /// `rooms`, were inside at its start: then the loop finds an event.
    [[nodiscard]] bool exits(Mode b, double t0, const Vector& w0,
                             const typename Modes::Rooms& rooms) const
    {
        typename Modes::Motion motion;
        typename Modes::Rooms before;
        modes_.rooms(b, t0, w0, motion, before);
        const double rounding = modes_.rounding_at_bound(b, motion);
        for (std::size_t k = 0; k < rooms.size(); ++k) {
            if (rooms[k] < 0 && !(before[k] >= -rounding)) return false;
        }
        return true;
    }

    [[nodiscard]] Mode branches_of(const State& at) override
    {
        Branches b;
        b.setConstant(M, Branch::lower);
        step_.branches_of(at, b);
        for (Eigen::Index i = modes_.count(); i < M; ++i) b[i] = Branch::lower;
        return Modes::mode_of(b);
    }

    /// Whether a step of length h from here ends no later than the first change, as `reach` found.
    [[nodiscard]] bool stays_in_branches(const ImplicitStart& from, double h) const
    {
        return located_.valid && h <= located_.length && located_.t == from.t &&
               located_.branches == from.branches && located_.w == from_.w;
    }

    /// Reaction `which` has stopped to slide: it sticks, or slides on in the other direction.
    [[nodiscard]] Mode arrive_at(Eigen::Index which, double t, double* x)
    {
        const auto& m = matrices();
        Vector w = vector(x);
        Reaction s;
        m.offset(t, s);
        const Reaction y = modes_.observed(t, w);
        const double rounding = 1e-14 * w.template lpNorm<Eigen::Infinity>();
        for (Eigen::Index i = 0; i < modes_.count(); ++i) {
            if (i == which || std::abs(y[i]) <= rounding) m.hold(i, 0, s[i], w);
        }
        write(w, x, size());
        to_.t = t;
        to_.w = w;
        (void)Base::select(to_);  // else the solver's reaction is kept
        return branches_of(to_);
    }

    /// The motion where it was asked for at the end of the last held step.
    struct Known {
        double t = std::numeric_limits<double>::quiet_NaN();
        Mode branches = 0;
        Vector w;
        typename Modes::Motion motion;
    };

    Modes modes_;
    Known known_;
    FlowInMode<N> flow_;
    SystemAdapter<FlowInMode<N>, X> adapter_{flow_, X{}};
    HeldReactions<N, M> held_;
    HeldEnd held_end_;
    Located located_;
    bool change_ = false;
    bool crossed_ = false;  ///< the change lies somewhere in the step
    Mode next_ = 0;         ///< branches after it
    std::size_t changed_ = 0;
};

template <int N, int M>
Owner<BranchPhases> make_branch_phases(const AnyInclusion<N, M>& inclusion,
                                       const BranchPhasesOptions& options)
{
    if constexpr (has_modes<N, M>) {
        const InclusionTraits& traits = inclusion.traits();
        if (traits.box && traits.of_reactions()) {
            return Owner<BranchPhases>(new BranchPhasesOf<N, M>(inclusion, options));
        }
    }
    if constexpr (M != 1) {
        if (!inclusion.parts().empty()) {
            return Owner<BranchPhases>(new PhasesOfParts<N, M>(inclusion, options));
        }
    }
    return Owner<BranchPhases>(new ImplicitPhases<N, M>(inclusion, options));
}

}  // namespace ricochet::detail
