// Internal: the declarations of this header may change without notice.
//
// `BranchPhases` of inclusions that are followed by implicit steps alone, in solvers of N
// components and M reactions: of sets that are no boxes of reactions, and of more than four
// reactions.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "ricochet/nonsmooth/detail/branch_phases.hpp"
#include "ricochet/nonsmooth/detail/law.hpp"
#include "ricochet/nonsmooth/detail/least_reaction.hpp"
#include "ricochet/nonsmooth/detail/minimal_selection.hpp"

namespace ricochet::detail {

template <int N, int M>
class RICOCHET_ALIGNED ImplicitPhases : public BranchPhases {
protected:
    using Matrices = AnyMatrices<N, M>;
    using Vector = typename Matrices::State;
    using Reaction = typename Matrices::Reaction;
    using State = StateWithReaction<N, M>;

public:
    ImplicitPhases(const AnyInclusion<N, M>& inclusion, const BranchPhasesOptions& options)
        : options_(options), step_(inclusion, options.scheme), own_size_(inclusion.size())
    {
        from_.w.setZero(matrices().size());
        from_.reaction.setZero(matrices().reactions());
        from_.t = std::numeric_limits<double>::lowest();
        to_ = probe_ = from_is_to_ = from_;
        error_ = from_.w;
    }

    [[nodiscard]] std::size_t size() const noexcept override
    {
        return static_cast<std::size_t>(matrices().own_size());
    }
    [[nodiscard]] std::size_t reactions() const noexcept override
    {
        return static_cast<std::size_t>(matrices().own_reactions());
    }
    [[nodiscard]] Mode branch_modes() const noexcept override { return 1; }

    // --- y and its reactions ---

    void observe(double t, const double* x, double* y) const override
    {
        Reaction out;
        matrices().observed(t, vector(x), out);
        write(out, y, reactions());
    }
    void observe_rate(double t, const double* dxdt, double* rates) const override
    {
        Reaction rate = times(matrices().observe(), vector(dxdt));
        matrices().subtract_offset_rate(t, rate);
        write(rate, rates, reactions());
    }
    [[nodiscard]] bool keeps_sides(Mode, double, const double*, double*) const override
    {
        return false;  // there are no branches
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
    [[nodiscard]] bool decides_at_zero() const noexcept override
    {
        return matrices().traits().box && matrices().traits().of_reactions();
    }
    [[nodiscard]] bool move_onto(std::size_t i, double t, double* x) const override
    {
        const auto& m = matrices();
        const Vector lever = times(m.inverse_mass(), Vector(m.act().col(index(i))));
        const double influence = rate_of(i, lever.data());
        if (influence == 0) return false;
        Vector w = vector(x);
        Reaction y, s;
        m.observed(t, w, y);
        w -= lever * (y[index(i)] / influence);
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
    /// Of a set that is no box: its extent along each axis.
    bool bounds(double t, const double* x, double* lower, double* upper) const override
    {
        Reaction least = from_.reaction, most = from_.reaction;
        bool fine = true;
        if (matrices().traits().box) {
            fine = matrices().inclusion().bounds(t, vector(x), least, most);
        } else {
            for (std::size_t i = 0; i < reactions(); ++i) {
                least[index(i)] = extent(t, vector(x), index(i), -1, fine);
                most[index(i)] = extent(t, vector(x), index(i), 1, fine);
            }
        }
        write(least, lower, reactions());
        write(most, upper, reactions());
        return fine;
    }
    [[nodiscard]] std::string fault(double t, const double* x) const override
    {
        return matrices().inclusion().fault(t, vector(x));
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
        Vector f0 = w, f1 = w;
        matrices().smooth(before, w, f0);
        matrices().smooth(t, w, f1);
        if (differ(f0, f1)) return true;
        std::vector<double> a(2 * reactions()), b(2 * reactions());
        bounds(before, x, a.data(), a.data() + reactions());
        bounds(t, x, b.data(), b.data() + reactions());
        if (a != b) return true;
        Reaction s0, s1;
        matrices().offset(before, s0);
        matrices().offset(t, s1);
        return differ(s0, s1);
    }

    // --- entering ---

    void check_bounds(double, const double*) const override {}
    [[nodiscard]] bool keeps_to_branches() const noexcept override { return false; }
    [[nodiscard]] Mode signs(double, const double*) const override { return 0; }
    [[nodiscard]] Mode start(double t, double* x) const override
    {
        (void)minimal_selection(matrices(), t, vector(x));
        return branch_modes();
    }
    [[nodiscard]] Mode arrive(Mode, double, double*) const override { return branch_modes(); }
    [[nodiscard]] Mode resume(double, double*, const double*, double) override
    {
        return branch_modes();
    }
    void hold(Mode, double, double*) const override {}
    [[nodiscard]] std::size_t undetermined(Mode, double, const double*) const override
    {
        return no_reaction;
    }

    // --- explicit phases, of which there are none ---

    [[nodiscard]] GuardInfo guard_info(std::size_t) const override { return {}; }
    [[nodiscard]] bool enabled(std::size_t, Mode) const noexcept override { return false; }
    [[nodiscard]] double guard(std::size_t which, Mode, double t, const double* x) const override
    {
        Reaction y;
        matrices().observed(t, vector(x), y);
        return -y[index(which / guards_of_reaction)];
    }
    void guards(Mode, double, const double*, double*, std::size_t) const override {}
    [[nodiscard]] double guard_rate(std::size_t which, Mode, double t, const double*,
                                    const double* dxdt) const override
    {
        Reaction rate = times(matrices().observe(), vector(dxdt));
        matrices().subtract_offset_rate(t, rate);
        return -rate[index(which / guards_of_reaction)];
    }
    void guard_rates(Mode, double, const double*, const double*, double*,
                     std::size_t) const override
    {
    }
    [[nodiscard]] Mode reset(std::span<const std::size_t>, Mode b, double, double*) const override
    {
        return b;
    }
    [[nodiscard]] bool stays_held(Mode, double, const double*) const override { return true; }
    [[nodiscard]] bool at_bounds(Mode, double, const double*, double*) const override
    {
        return false;
    }
    [[nodiscard]] bool flows(Mode) const noexcept override { return false; }
    void flow(Mode, double, const double*, double* dxdt) const override
    {
        std::fill_n(dxdt, size(), 0.0);
    }
    [[nodiscard]] BranchStepper stepper(MethodName, Mode) noexcept override { return {}; }
    void reaction(Mode, double, const double*, double* r) const override { reaction_of_step(r); }
    void reaction_of_step(double* r) const override { write(to_.reaction, r, reactions()); }
    void selected_reaction(double t, const double* x, double* r) override
    {
        probe_.t = t;
        probe_.w = vector(x);
        if (!select(probe_)) probe_.reaction.setConstant(std::numeric_limits<double>::quiet_NaN());
        write(probe_.reaction, r, reactions());
    }
    void reaction_in_step(const ImplicitStart& from, double s, double* r) override
    {
        if (s > 0) {
            std::vector<double> end(2 * size());
            take_to(from, s, s, {end.data(), end.data() + size()});
        } else {
            place(from);
            probe_ = from_;
        }
        if (probe_.w.allFinite()) {
            least_.choose(matrices(), probe_);
        } else {
            probe_.reaction.setConstant(std::numeric_limits<double>::quiet_NaN());
        }
        write(probe_.reaction, r, reactions());
    }
    [[nodiscard]] double rate_of(std::size_t i, const double* dxdt) const override
    {
        double rate = 0;
        for (std::size_t c = 0; c < size(); ++c) {
            rate += matrices().observe()(index(i), index(c)) * dxdt[c];
        }
        return rate;
    }
    [[nodiscard]] double fraction_of_held(Mode, double, const double*, double, const double*,
                                          bool) override
    {
        return 1;
    }

    // --- implicit phases ---

    [[nodiscard]] bool select(double t, const double* x, Mode& branches) override
    {
        probe_.t = t;
        probe_.w = vector(x);
        if (!select(probe_)) return false;
        keep_selection();
        to_ = probe_;
        branches = branches_of(to_);
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
    [[nodiscard]] double reach(const ImplicitStart&, double h) override { return h; }
    [[nodiscard]] bool take(const ImplicitStart& from, double h, const ImplicitEnd& end) override
    {
        ++attempts_;
        place(from);
        from_is_to_ = from_;
        if (!solve(h, to_, nullptr)) return false;
        step_.embedded_error(from_, h, to_, error_);
        put(end);
        return true;
    }
    void take_to(const ImplicitStart& from, double, double s, const ImplicitEnd& end) override
    {
        place(from);
        if (!solve(s, probe_, nullptr)) give_up(probe_);
        write(probe_.w, end.x, size());
        rate(probe_, end.dxdt);
    }
    [[nodiscard]] bool ends_at_change() const noexcept override { return false; }
    [[nodiscard]] Mode change(Mode b, double, double*) override { return b; }
    [[nodiscard]] Mode branches_at_end() override { return branches_of(to_); }
    [[nodiscard]] std::size_t changed() const noexcept override { return no_reaction; }
    [[nodiscard]] double law() const override
    {
        return law_violation(matrices(), to_.t, to_.w, to_.reaction, options_.step);
    }
    [[nodiscard]] const StageReport& failure() const noexcept override { return failure_; }
    void note_faulty(double, const double*) override { failure_.converged = false; }
    [[nodiscard]] std::uint64_t attempts() const noexcept override { return attempts_; }
    [[nodiscard]] std::uint64_t stages() const noexcept override { return stages_; }

    // --- memory ---

    void save(std::vector<double>& memory) const override
    {
        memory.push_back(to_.t);
        add(memory, to_.w);
        add(memory, to_.reaction);
        add(memory, from_is_to_.w);
    }
    void restore(std::span<const double> memory) override
    {
        to_.t = memory[0];
        std::size_t next = 1;
        read(memory, next, to_.w);
        read(memory, next, to_.reaction);
        read(memory, next, from_is_to_.w);
        from_is_to_.t = std::numeric_limits<double>::quiet_NaN();
    }

protected:
    [[nodiscard]] const Matrices& matrices() const noexcept { return step_.matrices(); }
    [[nodiscard]] static constexpr Eigen::Index index(std::size_t i) noexcept
    {
        return static_cast<Eigen::Index>(i);
    }

    // Components behind those of the system are zero.
    [[nodiscard]] Vector vector(const double* x) const
    {
        Vector w(matrices().size());
        read_state(x, w.data());
        return w;
    }
    // Numbers are copied one by one, as functions of systems write them: see components.hpp.
    void read_state(const double* x, double* w) const
    {
        if constexpr (N > 0) {
            if (own_size_ == N) return copy<N>(x, w);
            std::fill_n(w, N, 0.0);
        }
        std::copy_n(x, own_size_, w);
    }
    void write_state(const double* w, double* x) const
    {
        if constexpr (N > 0) {
            if (own_size_ == N) return copy<N>(w, x);
        }
        std::copy_n(w, own_size_, x);
    }
    template <int count>
    static void copy(const double* from, double* to)
    {
        for (int i = 0; i < count; ++i) to[i] = *static_cast<const volatile double*>(from + i);
    }
    template <class V>
    static void write(const V& v, double* x, std::size_t count)
    {
        for (std::size_t i = 0; i < count; ++i) x[i] = v[index(i)];
    }
    template <class V>
    static void add(std::vector<double>& memory, const V& v)
    {
        memory.insert(memory.end(), v.data(), v.data() + v.size());
    }
    template <class V>
    static void read(std::span<const double> memory, std::size_t& next, V& v)
    {
        for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = memory[next++];
    }

    [[nodiscard]] virtual bool select(State& at)
    {
        try {
            at.reaction = minimal_selection(matrices(), at.t, at.w, options_.step);
        } catch (const InclusionRefused&) {
            return false;
        }
        return true;
    }
    /// The next step starts with what has been selected.
    virtual void keep_selection() {}
    [[nodiscard]] virtual Mode branches_of(const State&) { return 0; }

    /// Whether (t, x) is the end of the last step, up to the rounding with which it is accepted.
    [[nodiscard]] bool continues(double t, const double* x) const
    {
        constexpr double ulps = 8 * std::numeric_limits<double>::epsilon();
        if (!(std::abs(t - to_.t) <= ulps * std::abs(t))) return false;
        for (std::size_t i = 0; i < size(); ++i) {
            // The loop has added the change over the step to the state before it.
            const double there = to_.w[index(i)];
            const double terms = std::abs(there) + std::abs(from_is_to_.w[index(i)]);
            if (!(std::abs(x[i] - there) <= ulps * terms)) return false;
        }
        return true;
    }
    enum class Placed { at_end_of_last, at_start_of_last, anew };
    /// Sets the start of a step, with the reaction of the step before; after anything else that of
    /// the minimal selection.
    Placed place(const ImplicitStart& from)
    {
        from_.t = from.t;
        from_.w = vector(from.x);
        if (continues(from.t, from.x)) {
            from_.reaction = to_.reaction;
            return Placed::at_end_of_last;
        }
        if (from_is_to_.t == from.t && from_is_to_.w == from_.w) {
            from_.reaction = from_is_to_.reaction;  // another attempt
            return Placed::at_start_of_last;
        }
        if (!select(from_)) from_.reaction.setZero();
        return Placed::anew;
    }
    [[nodiscard]] bool solve(double h, State& to, const BranchesOf<M>* frozen)
    {
        stages_ += 2;
        const StageReport report = step_.take(from_, h, to, frozen);
        if (!report.converged) failure_ = report;
        return report.converged;
    }
    /// A state that no step has reached.
    static void give_up(State& at)
    {
        at.w.setConstant(std::numeric_limits<double>::quiet_NaN());
        at.reaction.setZero();
    }
    /// Writes the end of a step.
    void put(const ImplicitEnd& end)
    {
        write(to_.w, end.x, size());
        rate(to_, end.dxdt);
        if (end.error) write(error_, end.error, size());
    }

    /// w' = A^-1 (f + G r), where a held component follows its surface exactly.
    void rate(const State& at, double* dxdt)
    {
        const auto& m = matrices();
        Vector f = at.w;
        m.smooth(at.t, at.w, f);
        const Vector rate = times(m.inverse_mass(), Vector(f + times(m.act(), at.reaction)));
        write(rate, dxdt, size());
        if (!decides_at_zero() || (m.traits().moves && !m.traits().gives_offset_rate)) return;
        Reaction lower = at.reaction, upper = at.reaction, y, still = at.reaction;
        m.inclusion().bounds(at.t, at.w, lower, upper);
        m.observed(at.t, at.w, y);
        still.setZero();
        if (m.traits().gives_offset_rate) m.inclusion().offset_rate(at.t, still);
        for (Eigen::Index i = 0; i < m.own_reactions(); ++i) {
            const bool inside = at.reaction[i] > lower[i] && at.reaction[i] < upper[i];
            if (m.selected(i) < 0 || y[i] != 0 || !inside) continue;
            dxdt[m.selected(i)] = still[i];
        }
    }

    BranchPhasesOptions options_;
    AnyStep<N, M> step_;
    Eigen::Index own_size_;
    State from_, to_, probe_;
    State from_is_to_;  ///< start of the last step
    Vector error_;      ///< of the last step
    std::uint64_t attempts_ = 0, stages_ = 0;
    StageReport failure_;
    LeastOfState<M> least_;

private:
    /// How far the set reaches along axis i, in the direction of `sign`.
    [[nodiscard]] double extent(double t, const Vector& w, Eigen::Index i, double sign,
                                bool& fine) const
    {
        constexpr double far = 1e150;
        Reaction z = Reaction::Zero(matrices().reactions()), p = z;
        z[i] = sign * far;
        fine = matrices().inclusion().project(t, w, z, p) && fine;
        const bool reaches = std::abs(p[i]) > 1e-3 * far;
        return reaches ? sign * std::numeric_limits<double>::infinity() : p[i];
    }
};

}  // namespace ricochet::detail
