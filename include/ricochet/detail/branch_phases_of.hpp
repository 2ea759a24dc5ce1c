// Internal: the declarations of this header may change without notice.
//
// `BranchPhases` for solvers of N components and M reactions.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "ricochet/detail/branch_modes.hpp"
#include "ricochet/detail/branch_phases.hpp"
#include "ricochet/detail/false_position.hpp"
#include "ricochet/detail/held_reactions.hpp"
#include "ricochet/detail/law.hpp"
#include "ricochet/detail/minimal_selection.hpp"

namespace ricochet::detail {

template <int N, int M>
class RICOCHET_ALIGNED BranchPhasesOf final : public BranchPhases {
    using Modes = AnyModes<N, M>;
    using Vector = typename Modes::Vector;
    using Reaction = typename Modes::Reaction;
    using Branches = BranchesOf<M>;
    using State = StateWithReaction<N, M>;
    using X = typename Modes::State;

public:
    BranchPhasesOf(const AnyInclusion<N, M>& inclusion, const BranchPhasesOptions& options)
        : options_(options), modes_(inclusion), step_(inclusion, options.scheme)
    {
        from_.w.setZero(N);
        from_.reaction.setZero(M);
        from_.t = std::numeric_limits<double>::lowest();
        located_.end = to_ = probe_ = from_is_to_ = from_;
    }

    [[nodiscard]] std::size_t size() const noexcept override
    {
        return static_cast<std::size_t>(matrices().own_size());
    }
    [[nodiscard]] std::size_t reactions() const noexcept override
    {
        return static_cast<std::size_t>(modes_.count());
    }
    [[nodiscard]] Mode branch_modes() const noexcept override { return Modes::branch_modes; }

    // --- y and its reactions ---

    void observe(double t, const double* x, double* y) const override
    {
        write(modes_.observed(t, vector(x)), y, reactions());
    }
    void observe_rate(double t, const double* dxdt, double* rates) const override
    {
        const auto& m = matrices();
        Reaction rate = times(m.observe(), vector(dxdt));
        m.subtract_offset_rate(t, rate);
        write(rate, rates, reactions());
    }
    [[nodiscard]] double size_of_row(std::size_t i, const double* x) const override
    {
        double largest = 0;
        for (std::size_t c = 0; c < size(); ++c) {
            const bool reads = matrices().observe()(index(i), index(c)) != 0;
            if (reads) largest = std::max(largest, std::abs(x[c]));
        }
        return largest;
    }
    [[nodiscard]] bool move_onto(std::size_t i, double t, double* x) const override
    {
        const auto& m = matrices();
        const Vector lever = times(m.inverse_mass(), Vector(m.act().col(index(i))));
        const double influence = modes_.rate_of(index(i), lever);
        if (influence == 0) return false;
        Vector w = vector(x);
        w -= lever * (modes_.observed(t, w)[index(i)] / influence);
        Reaction s;
        m.offset(t, s);
        m.hold(index(i), 0, s[index(i)], w);
        write(w, x, size());
        return true;
    }
    void shift(std::size_t i, double amount, double* x) const override
    {
        const auto& row = matrices().observe().row(index(i));
        const double square = row.squaredNorm();
        for (std::size_t c = 0; c < size(); ++c) x[c] += amount / square * row[index(c)];
    }
    bool bounds(double t, const double* x, double* lower, double* upper) const override
    {
        Reaction least, most;
        const bool fine = matrices().inclusion().bounds(t, vector(x), least, most);
        write(least, lower, reactions());
        write(most, upper, reactions());
        return fine;
    }
    [[nodiscard]] bool jumps(double t, const double* x) override
    {
        constexpr double part = 64 * std::numeric_limits<double>::epsilon();
        const double before = std::nextafter(t, -std::numeric_limits<double>::infinity());
        const Vector w = vector(x);
        const auto differ = [](const auto& a, const auto& b) {
            const double size = std::max(a.cwiseAbs().maxCoeff(), b.cwiseAbs().maxCoeff());
            return !((a - b).cwiseAbs().maxCoeff() <= part * size);
        };
        Vector f0, f1;
        matrices().smooth(before, w, f0);
        matrices().smooth(t, w, f1);
        if (differ(f0, f1)) return true;
        Reaction a, b, c, d;
        matrices().inclusion().bounds(before, w, a, b);
        matrices().inclusion().bounds(t, w, c, d);
        for (Eigen::Index i = 0; i < modes_.count(); ++i) {
            if (a[i] != c[i] || b[i] != d[i]) return true;
        }
        matrices().offset(before, a);
        matrices().offset(t, b);
        return differ(a, b);
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
        return modes_.guard(of_modes(which), b, t, array(x));
    }
    void guards(Mode b, double t, const double* x, double* g) const override
    {
        std::array<double, Modes::guard_count> all;
        modes_.guards(b, t, array(x), all);
        spread(all, g);
    }
    [[nodiscard]] double guard_rate(std::size_t which, Mode b, double t, const double* x,
                                    const double* dxdt) const override
    {
        return modes_.guard_rate(of_modes(which), b, t, array(x), array(dxdt));
    }
    void guard_rates(Mode b, double t, const double* x, const double* dxdt,
                     double* rates) const override
    {
        std::array<double, Modes::guard_count> all;
        modes_.guard_rates(b, t, array(x), array(dxdt), all);
        spread(all, rates);
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
    [[nodiscard]] bool flows(Mode b) const noexcept override { return modes_.flows(b); }
    void flow(Mode b, double t, const double* x, double* dxdt) const override
    {
        X rate;
        modes_.flow(b, t, array(x), rate);
        std::copy_n(rate.data(), size(), dxdt);
    }
    [[nodiscard]] double rate_of(std::size_t i, const double* dxdt) const override
    {
        return modes_.rate_of(index(i), vector(dxdt));
    }
    [[nodiscard]] double fraction_of_held(Mode b, double t0, const double* x0, double t1,
                                          const double* x1) override
    {
        const Vector w0 = vector(x0), w1 = vector(x1);
        typename Modes::Motion motion;
        typename Modes::Rooms rooms;
        modes_.rooms(b, t1, w1, motion, rooms);
        for (const double room : rooms) {
            if (room < 0) return exits(b, t0, w0, rooms) ? 1 : -1;
        }
        const double fraction =
            held_.fraction(modes_, {.mode = b,
                                    .t0 = t0,
                                    .t1 = t1,
                                    .w0 = w0,
                                    .w1 = w1,
                                    .event_tolerance = options_.event_tolerance});
        held_end_ = {t1, t1 - t0, b, w1};
        return held_.starts_beyond() ? -1 : fraction;
    }

    // --- implicit phases ---

    [[nodiscard]] bool select(double t, const double* x, Mode& branches) override
    {
        probe_.t = t;
        probe_.w = vector(x);
        if (!select(probe_)) return false;
        branches = branches_of(probe_);
        return true;
    }
    void selected_rate(double t, const double* x, double* dxdt) override
    {
        probe_.t = t;
        probe_.w = vector(x);
        if (continues(t, x)) {
            probe_.reaction = to_.reaction;
        } else if (!select(probe_)) {
            probe_.reaction.setConstant(std::numeric_limits<double>::quiet_NaN());
        }
        rate(probe_, dxdt);
    }
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
        return high;
    }
    [[nodiscard]] bool take(const ImplicitStart& from, double h, double* x, double* dxdt) override
    {
        ++attempts_;
        place(from);
        from_is_to_ = from_;
        bool stays = stays_in_branches(from, h);
        const bool to_end = stays && h == located_.length;
        const Branches b = Modes::branches_of(from.branches);
        if (to_end) {
            to_ = located_.end;
        } else if (stays) {
            // A y that has returned by the end of the step that was looked at may be away here.
            stays = solve(h, to_, &b) && step_.slack(to_, b) >= 0;
            located_.valid = stays;
        }
        if (!stays && !solve(h, to_, nullptr)) return false;
        change_ = to_end && located_.change;
        crossed_ = !stays && !from.crosses;
        if (crossed_) {  // a change that was not located shows at the end
            next_ = branches_of(to_);
            change_ = next_ != from.branches;
        }
        write(to_.w, x, size());
        rate(to_, dxdt);
        return true;
    }
    void take_to(const ImplicitStart& from, double h, double s, double* x, double* dxdt) override
    {
        place(from);
        const Branches b = Modes::branches_of(from.branches);
        // Held reactions that depend on one another are not always determined in their branches.
        const bool stays = stays_in_branches(from, h) && solve(s, probe_, &b);
        if (!stays && !solve(s, probe_, nullptr)) {
            probe_.w.setConstant(std::numeric_limits<double>::quiet_NaN());
            probe_.reaction.setZero(M);
        }
        write(probe_.w, x, size());
        rate(probe_, dxdt);
    }
    [[nodiscard]] bool ends_at_change() const noexcept override { return change_; }
    [[nodiscard]] Mode change(Mode b, double t, double* x) override
    {
        change_ = false;
        if (crossed_) {
            for (std::size_t i = 0; i < reactions(); ++i) {
                if (branch(i, next_) != branch(i, b)) changed_ = i;
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
    [[nodiscard]] Mode branches_at_end() override { return branches_of(to_); }
    [[nodiscard]] std::size_t changed() const noexcept override { return changed_; }
    [[nodiscard]] double law() const override
    {
        return law_violation(matrices(), to_.t, to_.w, to_.reaction, options_.step);
    }
    [[nodiscard]] const StageReport& failure() const noexcept override { return failure_; }
    void note_faulty(double t, const double* x) override
    {
        failure_.converged = false;
        failure_.set = modes_.faulty(t, vector(x));
    }
    [[nodiscard]] std::uint64_t attempts() const noexcept override { return attempts_; }
    [[nodiscard]] std::uint64_t stages() const noexcept override { return stages_; }

    // --- memory ---

    void save(std::vector<double>& memory) const override
    {
        const auto add = [&](const auto& v) {
            memory.insert(memory.end(), v.data(), v.data() + v.size());
        };
        memory.insert(memory.end(), {to_.t, held_end_.t, held_end_.h,
                                     static_cast<double>(held_end_.branches), held_.worst()});
        add(to_.w);
        add(to_.reaction);
        add(held_end_.w);
    }
    void restore(std::span<const double> memory) override
    {
        std::size_t next = 0;
        const auto read = [&](auto& v) {
            for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = memory[next++];
        };
        to_.t = memory[next++];
        held_end_.t = memory[next++];
        held_end_.h = memory[next++];
        held_end_.branches = static_cast<Mode>(memory[next++]);
        const double worst = memory[next++];
        read(to_.w);
        read(to_.reaction);
        read(held_end_.w);
        held_.forget();
        if (held_end_.h > 0) {
            held_.resume(modes_, held_end_.branches, held_end_.t, held_end_.w, held_end_.h, worst);
        }
        located_.valid = change_ = false;
        from_is_to_.t = std::numeric_limits<double>::quiet_NaN();
    }

private:
    struct Located {
        bool valid = false;
        bool change = false;  ///< the step ends at one
        double t = 0, length = 0;
        Mode branches = 0;
        Vector w;
        State end;
    };
    struct HeldEnd {
        double t = 0, h = 0;
        Mode branches = 0;
        Vector w = Vector::Zero(N);
    };

    [[nodiscard]] const AnyMatrices<N, M>& matrices() const noexcept { return modes_.matrices(); }
    [[nodiscard]] static Eigen::Index index(std::size_t i) noexcept
    {
        return static_cast<Eigen::Index>(i);
    }
    [[nodiscard]] static constexpr std::size_t of_modes(std::size_t which) noexcept
    {
        const std::size_t i = which / guards_of_reaction, kind = which % guards_of_reaction;
        return kind < 4 ? 4 * i + kind : Modes::first_set_guard + i;
    }
    void spread(const std::array<double, Modes::guard_count>& all, double* g) const
    {
        const std::size_t count = guards_of_reaction * reactions();
        for (std::size_t k = 0; k < count; ++k) g[k] = all[of_modes(k)];
    }

    // Components behind those of the system are zero.
    [[nodiscard]] Vector vector(const double* x) const
    {
        Vector w = Vector::Zero(N);
        for (std::size_t i = 0; i < size(); ++i) w[index(i)] = x[i];
        return w;
    }
    [[nodiscard]] X array(const double* x) const
    {
        X out{};
        std::copy_n(x, size(), out.data());
        return out;
    }
    template <class V>
    static void write(const V& v, double* x, std::size_t count)
    {
        for (std::size_t i = 0; i < count; ++i) x[i] = v[index(i)];
    }

    /// Whether the reactions that are beyond their bounds at the end of a step, which leaves the
    /// `rooms`, were inside at its start: then the loop finds an event.
    [[nodiscard]] bool exits(Mode b, double t0, const Vector& w0,
                             const typename Modes::Rooms& rooms) const
    {
        typename Modes::Motion motion;
        typename Modes::Rooms before;
        modes_.rooms(b, t0, w0, motion, before);
        for (std::size_t k = 0; k < rooms.size(); ++k) {
            if (rooms[k] < 0 && !(before[k] > 0)) return false;
        }
        return true;
    }

    [[nodiscard]] bool select(State& at) const
    {
        try {
            at.reaction = minimal_selection(matrices(), at.t, at.w);
        } catch (const InclusionRefused&) {
            return false;
        }
        return true;
    }
    [[nodiscard]] Mode branches_of(const State& at)
    {
        Branches b;
        b.setConstant(M, Branch::lower);
        step_.branches_of(at, b);
        for (Eigen::Index i = modes_.count(); i < M; ++i) b[i] = Branch::lower;
        return Modes::mode_of(b);
    }

    /// Whether (t, x) is the end of the last step, up to the rounding with which it is accepted.
    [[nodiscard]] bool continues(double t, const double* x) const
    {
        constexpr double ulps = 8 * std::numeric_limits<double>::epsilon();
        if (!(std::abs(t - to_.t) <= ulps * std::abs(t))) return false;
        for (std::size_t i = 0; i < size(); ++i) {
            const double there = to_.w[index(i)];
            if (!(std::abs(x[i] - there) <= ulps * std::abs(there))) return false;
        }
        return true;
    }
    /// Sets the start of a step, with the reaction of the step before; after anything else that of
    /// the minimal selection.
    void place(const ImplicitStart& from)
    {
        from_.t = from.t;
        from_.w = vector(from.x);
        if (continues(from.t, from.x)) {
            from_.reaction = to_.reaction;
        } else if (from_is_to_.t == from.t && from_is_to_.w == from_.w) {
            from_.reaction = from_is_to_.reaction;  // another attempt
        } else if (!select(from_)) {
            from_.reaction.setZero(M);
        }
    }
    /// Whether a step of length h from here ends no later than the first change, as `reach` found.
    [[nodiscard]] bool stays_in_branches(const ImplicitStart& from, double h) const
    {
        return located_.valid && h <= located_.length && located_.t == from.t &&
               located_.branches == from.branches && located_.w == from_.w;
    }
    [[nodiscard]] bool solve(double h, State& to, const Branches* frozen)
    {
        stages_ += 2;
        const StageReport report = step_.take(from_, h, to, frozen);
        if (!report.converged) failure_ = report;
        return report.converged;
    }

    /// w' = A^-1 (f + G r), where a held component follows its surface exactly.
    void rate(const State& at, double* dxdt)
    {
        const auto& m = matrices();
        Vector f;
        m.smooth(at.t, at.w, f);
        const Vector rate = times(m.inverse_mass(), Vector(f + times(m.act(), at.reaction)));
        write(rate, dxdt, size());
        if (m.traits().moves && !m.traits().gives_offset_rate) return;
        Reaction lower, upper, still = Reaction::Zero(M);
        m.inclusion().bounds(at.t, at.w, lower, upper);
        const Reaction y = modes_.observed(at.t, at.w);
        if (m.traits().gives_offset_rate) m.inclusion().offset_rate(at.t, still);
        for (Eigen::Index i = 0; i < modes_.count(); ++i) {
            const bool inside = at.reaction[i] > lower[i] && at.reaction[i] < upper[i];
            if (m.selected(i) < 0 || y[i] != 0 || !inside) continue;
            dxdt[m.selected(i)] = still[i];
        }
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
        (void)select(to_);  // else the solver's reaction is kept
        return branches_of(to_);
    }

    BranchPhasesOptions options_;
    Modes modes_;
    AnyStep<N, M> step_;
    HeldReactions<N, M> held_;
    HeldEnd held_end_;
    State from_, to_, probe_;
    State from_is_to_;  ///< start of the last step
    Located located_;
    bool change_ = false;
    bool crossed_ = false;  ///< the change lies somewhere in the step
    Mode next_ = 0;         ///< branches after it
    std::size_t changed_ = 0;
    std::uint64_t attempts_ = 0, stages_ = 0;
    StageReport failure_;
};

/// Null where the inclusion has no modes of branches.
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
    return {};
}

}  // namespace ricochet::detail
