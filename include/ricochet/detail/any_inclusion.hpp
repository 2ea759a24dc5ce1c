// Internal: the declarations of this header may change without notice.
//
// An inclusion of which only the sizes are known.
//
// The solvers of inclusions are compiled for N components and M reactions, once for all systems
// of these sizes: they see a system through `AnyInclusion`, which `TypedInclusion` implements for
// the user's system. Vectors and matrices are the same on both sides, so nothing is converted.
#pragma once

#include <Eigen/LU>

#include <array>
#include <memory>
#include <string>

#include "ricochet/detail/branch_terms.hpp"
#include "ricochet/detail/components.hpp"
#include "ricochet/detail/inclusion_declarations.hpp"
#include "ricochet/detail/linear_cases.hpp"
#include "ricochet/detail/owned.hpp"
#include "ricochet/hybrid/guard.hpp"
#include "ricochet/nonsmooth/inclusion.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet {

namespace detail {

/// What a system declares besides its functions.
struct InclusionTraits {
    Confines confines = Confines::reaction;
    bool affine = false;
    bool box = false;             ///< its sets are boxes
    bool gives_jacobian = false;  ///< has `smooth_jacobian`
    bool moves = false;           ///< has `offset`
    bool gives_offset_rate = false;
    bool continues_bounds = false;  ///< has `branch_bound`
    bool gives_bound_gradient = false;
    const StepLayout* layout = nullptr;  ///< of its inputs for policies, if it has any

    [[nodiscard]] bool of_reactions() const noexcept { return confines == Confines::reaction; }
};

/// Interface with the functions of inclusion.hpp. Those of a set refer to the set at (t, w). A
/// function that the system lacks does nothing, or returns its default.
template <int N, int M>
class RICOCHET_ALIGNED AnyInclusion {
public:
    using State = Eigen::Matrix<double, N, 1>;
    using Reaction = Eigen::Matrix<double, M, 1>;
    using Square = Eigen::Matrix<double, N, N>;
    using Observation =
        Eigen::Matrix<double, M, N, M == 1 && N != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
    using Action =
        Eigen::Matrix<double, N, M, N == 1 && M != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
    using Delassus = Eigen::Matrix<double, M, M>;
    using Terms = BranchTerms<N, M>;
    using Flow = BranchFlow<AnyInclusion, Terms,
                            std::make_index_sequence<static_cast<std::size_t>(N > 0 ? N : 0)>>;
    using StepInputs = std::array<double, StepView::state_inputs>;
    /// Motion in a mode of branches, where the bounds are those of `branch_bounds`.
    struct BranchMotion {
        State rate;
        Reaction reaction, lower, upper;
    };

    explicit AnyInclusion(const InclusionTraits& of) : traits(of) {}
    virtual ~AnyInclusion() = default;

    const InclusionTraits traits;

    [[nodiscard]] virtual std::unique_ptr<const AnyInclusion> clone() const = 0;
    [[nodiscard]] virtual Eigen::Index size() const = 0;
    [[nodiscard]] virtual Eigen::Index reactions() const = 0;

    virtual void smooth(double t, const State& w, State& f) const = 0;
    virtual void smooth_jacobian(double t, const State& w, Square& j) const = 0;
    virtual void mass(Square& a) const = 0;
    virtual void observe(Observation& e) const = 0;
    virtual void act(Action& g) const = 0;
    virtual void offset(double t, Reaction& s) const = 0;
    virtual void offset_rate(double t, Reaction& s) const = 0;

    // False where the set is faulty.
    virtual bool project(double t, const State& w, const Reaction& z, Reaction& p) const = 0;
    virtual bool derivative(double t, const State& w, const Reaction& z, double* d) const = 0;
    /// Bounds of a box.
    virtual bool bounds(double t, const State& w, Reaction& lower, Reaction& upper) const = 0;
    /// The same bounds, smooth beyond y = 0 where the system gives such an extension.
    virtual void branch_bounds(double t, const State& w, Reaction& lower,
                               Reaction& upper) const = 0;
    [[nodiscard]] virtual double bound(double t, const State& w, Eigen::Index i,
                                       Branch side) const = 0;
    // Functions of the modes of branches (branch_terms.hpp). Each is one call, so that nothing goes
    // through memory between the functions of a system and the arithmetic around them.
    /// The flow, in which every held y that is a component is at rest to the last bit; null for
    /// systems without such modes. `diagonal`: A is diagonal.
    [[nodiscard]] virtual typename Flow::Function branch_flow(bool diagonal) const = 0;
    virtual void branch_state(const Terms& terms, Mode mode, double t, const State& w,
                              BranchMotion& out) const = 0;
    virtual void bound_gradient(double t, const State& w, Eigen::Index i, State& g) const = 0;
    [[nodiscard]] virtual std::string fault(double t, const State& w) const = 0;
    [[nodiscard]] virtual std::size_t set_dimension(double t, const State& w) const = 0;
    virtual void check_projection(double t, const State& w) const = 0;

    [[nodiscard]] virtual double step_unit() const = 0;
    virtual void step_inputs(double t, const State& w, const State& rate, const Reaction& reaction,
                             StepInputs& out) const = 0;
};

template <class System>
using AnyOf = AnyInclusion<state_size<System>, reaction_size<System>>;

template <class System>
class RICOCHET_ALIGNED TypedInclusion final : public AnyOf<System> {
    static_assert(check_inclusion<System>());
    using Any = AnyOf<System>;
    using Set = SetOf<System>;
    using State = typename Any::State;
    using Reaction = typename Any::Reaction;
    using Terms = typename Any::Terms;
    static constexpr bool box = BoxSet<Set>;
    static constexpr bool gives_jacobian =
        requires(const System& s, const State& w, typename Any::Square& j)
    {
        s.smooth_jacobian(0.0, w, j);
    };
    static constexpr bool moves = requires(const System& s, Reaction& r) { s.offset(0.0, r); };
    static constexpr bool gives_offset_rate = requires(const System& s, Reaction& r)
    {
        s.offset_rate(0.0, r);
    };
    static constexpr bool continues_bounds = requires(const System& s, const State& w, int i)
    {
        {
            s.branch_bound(0.0, w, i, Branch::upper)
            } -> std::convertible_to<double>;
    };
    static constexpr bool gives_bound_gradient =
        requires(const System& s, const State& w, int i, State& g)
    {
        s.bound_gradient(0.0, w, i, g);
    };
    static constexpr bool branching =
        has_modes<state_size<System>, reaction_size<System>> && (box || continues_bounds);
    static constexpr bool declares_inputs = DeclaresStepInputs<System, State, Reaction>;

    [[nodiscard]] static InclusionTraits traits_of() noexcept
    {
        InclusionTraits traits;
        if constexpr (requires { System::confines; }) traits.confines = System::confines;
        if constexpr (requires { System::affine; }) traits.affine = System::affine;
        traits.box = box;
        traits.gives_jacobian = gives_jacobian;
        traits.moves = moves;
        traits.gives_offset_rate = gives_offset_rate;
        traits.continues_bounds = continues_bounds;
        traits.gives_bound_gradient = gives_bound_gradient;
        if constexpr (declares_inputs) {
            const StepLayout& layout = System::step_layout();
            traits.layout = &layout;
        }
        return traits;
    }

public:
    explicit TypedInclusion(const System& system) : Any(traits_of()), system(system) {}

    System system;

    [[nodiscard]] std::unique_ptr<const Any> clone() const override
    {
        return std::make_unique<TypedInclusion>(system);
    }
    [[nodiscard]] Eigen::Index size() const override
    {
        if constexpr (state_size<System> == Eigen::Dynamic) {
            return static_cast<Eigen::Index>(system.size());
        } else {
            return state_size<System>;
        }
    }
    [[nodiscard]] Eigen::Index reactions() const override
    {
        if constexpr (reaction_size<System> == Eigen::Dynamic) {
            return static_cast<Eigen::Index>(system.reactions());
        } else {
            return reaction_size<System>;
        }
    }

    void smooth(double t, const State& w, State& f) const override { system.smooth(t, w, f); }
    void smooth_jacobian(double t, const State& w, typename Any::Square& j) const override
    {
        if constexpr (gives_jacobian) system.smooth_jacobian(t, w, j);
    }
    void mass(typename Any::Square& a) const override
    {
        if constexpr (requires { system.mass(a); }) system.mass(a);
    }
    void observe(typename Any::Observation& e) const override
    {
        if constexpr (requires { system.observe(e); }) {
            system.observe(e);
        } else {
            e.leftCols(reactions()).setIdentity();
        }
    }
    void act(typename Any::Action& g) const override
    {
        if constexpr (requires { system.act(g); }) system.act(g);
    }
    void offset(double t, Reaction& s) const override
    {
        if constexpr (moves) system.offset(t, s);
    }
    void offset_rate(double t, Reaction& s) const override
    {
        if constexpr (gives_offset_rate) system.offset_rate(t, s);
    }

    bool project(double t, const State& w, const Reaction& z, Reaction& p) const override
    {
        const Set set = system.reaction_set(t, w);
        set.project(span_of(z), span_of(p));
        return fault_of(set).empty();
    }
    bool derivative(double t, const State& w, const Reaction& z, double* d) const override
    {
        const Set set = system.reaction_set(t, w);
        const auto k = static_cast<std::size_t>(z.size());
        set.derivative(span_of(z), {d, k * k});
        return fault_of(set).empty();
    }
    bool bounds(double t, const State& w, Reaction& lower, Reaction& upper) const override
    {
        if constexpr (box) {
            const Set set = system.reaction_set(t, w);
            for (Eigen::Index i = 0; i < lower.size(); ++i) {
                lower[i] = set.lower(static_cast<std::size_t>(i));
                upper[i] = set.upper(static_cast<std::size_t>(i));
            }
            return fault_of(set).empty();
        } else {
            return false;
        }
    }
    void branch_bounds(double t, const State& w, Reaction& lower, Reaction& upper) const override
    {
        if constexpr (!continues_bounds) {
            bounds(t, w, lower, upper);
        } else {
            for (Eigen::Index i = 0; i < lower.size(); ++i) {
                lower[i] = bound(t, w, i, Branch::lower);
                upper[i] = bound(t, w, i, Branch::upper);
            }
        }
    }
    [[nodiscard]] double bound(double t, const State& w, Eigen::Index i, Branch side) const override
    {
        if constexpr (continues_bounds) {
            return system.branch_bound(t, w, static_cast<int>(i), side);
        } else if constexpr (box) {
            const Set set = system.reaction_set(t, w);
            const auto k = static_cast<std::size_t>(i);
            return side == Branch::lower ? set.lower(k) : set.upper(k);
        } else {
            return 0;
        }
    }
    [[nodiscard]] typename Any::Flow::Function branch_flow(bool diagonal) const override
    {
        if constexpr (branching) {
            return diagonal ? &Any::Flow::template call<TypedInclusion, true>
                            : &Any::Flow::template call<TypedInclusion, false>;
        } else {
            return nullptr;
        }
    }
    template <bool diagonal>
    [[gnu::always_inline]] void flow(const Terms& terms, Mode mode, double t, const State& w,
                                     State& rate) const
    {
        free_rate<diagonal>(terms, t, w, rate);
        const Reaction r = reactions(terms, mode, t, w, rate);
        add_reactions(terms, r, rate);
        for (Eigen::Index i = 0; i < r.size(); ++i, mode /= 3) {
            if (branch_of_first(mode) != Branch::inside || terms.selected[i] < 0) continue;
            const double still = rate_of_offset(t)[i];
            for_each_component(rate,
                               [&](auto k) { set_where(k == terms.selected[i], still, rate[k]); });
        }
    }
    void branch_state(const Terms& terms, Mode mode, double t, const State& w,
                      typename Any::BranchMotion& out) const override
    {
        if constexpr (branching) {
            // Works on copies, since the output may overlap the input.
            const State at = by_components(w.data());
            State motion;
            terms.diagonal ? free_rate<true>(terms, t, at, motion)
                           : free_rate<false>(terms, t, at, motion);
            const Reaction acting = reactions(terms, mode, t, at, motion);
            add_reactions(terms, acting, motion);
            for_each_component(motion, [&](auto i) { out.rate[i] = motion[i]; });
            out.reaction = acting;
            branch_bounds(t, at, out.lower, out.upper);
        }
    }
    void bound_gradient(double t, const State& w, Eigen::Index i, State& g) const override
    {
        if constexpr (gives_bound_gradient) system.bound_gradient(t, w, static_cast<int>(i), g);
    }
    [[nodiscard]] std::string fault(double t, const State& w) const override
    {
        const Set set = system.reaction_set(t, w);
        return std::string(fault_of(set));
    }
    [[nodiscard]] std::size_t set_dimension(double t, const State& w) const override
    {
        return system.reaction_set(t, w).dimension();
    }
    void check_projection(double t, const State& w) const override
    {
        ricochet::check_projection(system.reaction_set(t, w));
    }

    [[nodiscard]] double step_unit() const override
    {
        if constexpr (declares_inputs) return system.step_unit();
        return 1;
    }
    void step_inputs(double t, const State& w, const State& rate, const Reaction& reaction,
                     typename Any::StepInputs& out) const override
    {
        if constexpr (declares_inputs) system.step_inputs(t, w, rate, reaction, out);
    }

private:
    /// Reads a state one component at a time, as it was written: see components.hpp. Volatile,
    /// since compilers otherwise read pairs.
    [[nodiscard, gnu::always_inline]] static State by_components(const double* x)
    {
        State w;
        for_each_component(w, [&](auto i) { w[i] = *static_cast<const volatile double*>(x + i); });
        return w;
    }

    /// A copy for Eigen's products, whose operands are in memory; the original stays in registers.
    [[nodiscard, gnu::always_inline]] static State copied(const State& from)
    {
        State to;
        for_each_component(from, [&](auto i) { to[i] = from[i]; });
        return to;
    }

    static void set_where(bool here, double value, double& out) noexcept
    {
        if (here) out = value;
    }

    /// The branch of the first reaction, or of the only one.
    [[nodiscard]] static constexpr Branch branch_of_first(Mode mode) noexcept
    {
        if constexpr (reaction_size < System >> 1) mode %= 3;
        return static_cast<Branch>(static_cast<int>(mode) - 1);
    }

    /// s'(t), by a central difference where the system does not give it.
    [[nodiscard]] Reaction rate_of_offset(double t) const
    {
        Reaction rate;
        if constexpr (gives_offset_rate) {
            system.offset_rate(t, rate);
        } else if constexpr (moves) {
            const double step = 1e-5 * std::max(1.0, std::abs(t));
            Reaction ahead, behind;
            ahead.setZero();
            behind.setZero();
            system.offset(t + step, ahead);
            system.offset(t - step, behind);
            rate = (ahead - behind) / (2 * step);
        } else {
            rate.setZero();
        }
        return rate;
    }

    /// Writes A^-1 f.
    template <bool diagonal>
    [[gnu::always_inline]] void free_rate(const Terms& terms, double t, const State& w,
                                          State& free) const
    {
        State f;
        system.smooth(t, w, f);
        if constexpr (diagonal) {
            for_each_component(f, [&](auto i) { free[i] = terms.inverse_diagonal[i] * f[i]; });
        } else {
            const State force = copied(f);
            const State out = terms.inverse_mass.lazyProduct(force);
            free = by_components(out.data());
        }
    }

    /// The reactions in a mode, where the rate without them is `free`.
    [[nodiscard, gnu::always_inline]] Reaction reactions(const Terms& terms, const Mode mode,
                                                         double t, const State& w,
                                                         const State& free) const
    {
        Reaction r;
        std::size_t held = 0;
        Mode rest = mode;
        for (Eigen::Index i = 0; i < r.size(); ++i, rest /= 3) {
            const Branch at = branch_of_first(rest);
            if (at == Branch::inside) held |= std::size_t{1} << i;
            r[i] = at == Branch::inside ? 0 : TypedInclusion::bound(t, w, i, at);
        }
        if (held == 0) return r;
        if constexpr (reaction_size<System> == 1) {
            const Eigen::Index k = terms.selected[0];
            double rate = 0;
            if (k < 0) {
                if constexpr (Terms::in_order) {
                    rate = terms.observed(0, free);
                } else {
                    rate = terms.observed(0, copied(free));
                }
            } else {
                // Avoids free[k]: an array that is indexed at run time is kept in memory.
                for_each_component(free, [&](auto i) { set_where(i == k, free[i], rate); });
            }
            if constexpr (moves) rate -= rate_of_offset(t)[0];
            r[0] = -terms.holds[1].inverse(0, 0) * rate;
        } else {
            const State all = copied(free);
            Reaction rate = terms.observe.lazyProduct(all);
            rate += terms.delassus.lazyProduct(r);
            if constexpr (moves) rate -= rate_of_offset(t);
            r -= terms.holds[held].inverse.lazyProduct(rate);
        }
        return r;
    }

    /// A^-1 (f + G r) from A^-1 f.
    [[gnu::always_inline]] static void add_reactions(const Terms& terms, const Reaction& r,
                                                     State& free)
    {
        if constexpr (reaction_size<System> == 1) {
            for_each_component(free, [&](auto i) { free[i] = free[i] + terms.lever(i, 0) * r[0]; });
        } else {
            const Reaction acting = r;
            const State more = terms.lever.lazyProduct(acting);
            for_each_component(free, [&](auto i) { free[i] += more[i]; });
        }
    }
};

/// Rank of a square matrix to working precision. Writes its inverse if it has one.
[[nodiscard]] Eigen::Index invert(const Eigen::MatrixXd& a, Eigen::MatrixXd& inverse);

/// An inclusion with its constant matrices, which have been checked.
template <int N, int M>
class RICOCHET_ALIGNED AnyMatrices {
public:
    using Any = AnyInclusion<N, M>;
    using State = typename Any::State;
    using Reaction = typename Any::Reaction;
    using Square = typename Any::Square;
    using Observation = typename Any::Observation;
    using Action = typename Any::Action;
    using Delassus = typename Any::Delassus;

    /// @throws std::invalid_argument for a singular or non-finite A, or E or G that are not
    /// finite.
    explicit AnyMatrices(const Any& inclusion);

    [[nodiscard]] const Any& inclusion() const noexcept { return *inclusion_; }
    [[nodiscard]] const InclusionTraits& traits() const noexcept { return inclusion_->traits; }
    [[nodiscard]] Eigen::Index size() const noexcept { return mass_.rows(); }
    [[nodiscard]] Eigen::Index reactions() const noexcept { return observe_.rows(); }

    [[nodiscard]] const Square& mass() const noexcept { return mass_; }                  // A
    [[nodiscard]] const Square& inverse_mass() const noexcept { return inverse_mass_; }  // 1/A
    [[nodiscard]] const Observation& observe() const noexcept { return observe_; }       // E
    [[nodiscard]] const Action& act() const noexcept { return act_; }                    // G

    void smooth(double t, const State& w, State& f) const { inclusion_->smooth(t, w, f); }

    /// The Jacobian of f; where the system does not give it, by central differences of relative
    /// step 6e-6, the cube root of the rounding unit.
    void jacobian(double t, const State& w, Square& j) const
    {
        if (traits().gives_jacobian) return inclusion_->smooth_jacobian(t, w, j);
        State moved = w;
        State ahead = w;
        State behind = w;
        for (Eigen::Index i = 0; i < w.size(); ++i) {
            const double step = 6e-6 * std::max(1.0, std::abs(w[i]));
            moved[i] = w[i] + step;
            smooth(t, moved, ahead);
            moved[i] = w[i] - step;
            smooth(t, moved, behind);
            moved[i] = w[i];
            j.col(i) = (ahead - behind) / (2 * step);
        }
    }

    /// s(t).
    void offset(double t, Reaction& s) const
    {
        s.setZero(reactions());
        if (traits().moves) inclusion_->offset(t, s);
    }

    /// y = E w - s(t).
    void observed(double t, const State& w, Reaction& y) const
    {
        offset(t, y);
        y = observe_ * w - y;
    }

    /// The component that row i of E selects, or -1 where it is not just one.
    [[nodiscard]] Eigen::Index selected(Eigen::Index i) const { return selected_[i]; }

    /// Writes y_i exactly into w where row i of E selects one component.
    void hold(Eigen::Index i, double y, double s, State& w) const
    {
        const Eigen::Index component = selected_[i];
        if (component >= 0) w[component] = s + y;
    }

private:
    void find_selected()
    {
        selected_.setConstant(reactions(), -1);
        for (Eigen::Index i = 0; i < reactions(); ++i) {
            Eigen::Index where = -1;
            int entries = 0;
            for (Eigen::Index j = 0; j < size(); ++j) {
                if (observe_(i, j) != 0) ++entries, where = j;
            }
            if (entries == 1 && observe_(i, where) == 1) selected_[i] = where;
        }
    }

    Owned<Any> inclusion_;
    Square mass_, inverse_mass_;
    Observation observe_;
    Action act_;
    Eigen::Matrix<Eigen::Index, M, 1> selected_;
};

template <int N, int M>
AnyMatrices<N, M>::AnyMatrices(const Any& inclusion) : inclusion_(inclusion)
{
    const Eigen::Index n = inclusion.size();
    const Eigen::Index m = inclusion.reactions();
    mass_.setIdentity(n, n);
    inclusion.mass(mass_);
    if (!mass_.allFinite()) refuse_inclusion("the matrix A is not finite");
    Eigen::MatrixXd inverse = mass_;
    if (const Eigen::Index rank = invert(inverse, inverse); rank < n) {
        refuse_inclusion("the matrix A is singular; its rank is", static_cast<double>(rank));
    }
    inverse_mass_ = inverse;

    observe_.setZero(m, n);
    inclusion.observe(observe_);
    act_ = observe_.transpose();
    inclusion.act(act_);
    if (!observe_.allFinite() || !act_.allFinite()) {
        refuse_inclusion("the matrices E and G must be finite");
    }
    find_selected();
}

}  // namespace detail

/// A system with its constant matrices, which have been checked.
template <Inclusion System>
class InclusionMatrices : public detail::AnyMatrices<state_size<System>, reaction_size<System>> {
public:
    static constexpr int N = state_size<System>;
    static constexpr int M = reaction_size<System>;

    /// @throws std::invalid_argument for a singular or non-finite A, or E or G that are not
    /// finite.
    explicit InclusionMatrices(const System& system)
        : InclusionMatrices::AnyMatrices(detail::TypedInclusion<System>(system))
    {
    }

    [[nodiscard]] const System& system() const noexcept
    {
        return static_cast<const detail::TypedInclusion<System>&>(this->inclusion()).system;
    }
};

}  // namespace ricochet
