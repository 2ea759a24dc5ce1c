// Internal: the declarations of this header may change without notice.
//
// An inclusion of which only the sizes are known.
//
// The solvers of inclusions are compiled for N components and M reactions, once for all systems of
// at most these sizes: they see a system through `AnyInclusion`, a table of functions that
// typed_inclusion.hpp makes for the user's system. Where the sizes are the same, vectors and
// matrices are, too, so nothing is converted.
//
// A system of n < N components or m < M reactions is padded. The components behind its own have
// f = 0, unit mass, no column in E and no row in G; they stay zero. The reactions behind its own
// have no row in E and no column in G, and stay zero, too: for a set of reactions theirs is {0},
// and in a box their y is 1, so that they are never at y = 0; in a set of states their y is zero
// inside [-1, 1]. What counts components or reactions takes those of the system.
#pragma once

#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "ricochet/detail/components.hpp"
#include "ricochet/guard.hpp"
#include "ricochet/nonsmooth/detail/branch_terms.hpp"
#include "ricochet/nonsmooth/detail/ordered_products.hpp"
#include "ricochet/nonsmooth/inclusion.hpp"
#include "ricochet/nonsmooth/linear_cases.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"

namespace ricochet {

namespace detail {

/// What a system declares besides its functions.
struct InclusionTraits {
    Confines confines = Confines::reaction;
    bool affine = false;
    bool box = false;             ///< its sets are boxes
    bool gives_jacobian = false;  ///< has `smooth_jacobian`
    bool moves = false;           ///< has `offset`, or padded reactions
    bool gives_offset_rate = false;
    bool continues_bounds = false;  ///< has `branch_bound`
    bool gives_static_bound = false;
    bool gives_bound_gradient = false;

    [[nodiscard]] bool of_reactions() const noexcept { return confines == Confines::reaction; }
};

/// Motion in a mode of branches, where the bounds are those of `branch_bounds`.
template <int N, int M>
struct RICOCHET_ALIGNED MotionInBranches {
    Eigen::Matrix<double, N, 1> rate;
    Eigen::Matrix<double, M, 1> reaction, lower, upper;
};

/// What the solvers take for the set of one part of the reactions.
enum class PartLaw : unsigned char {
    kinetic,        ///< that of `reaction_set`
    within_static,  ///< the ball of `static_bound`
    held,           ///< everything, so that y stays zero
    given           ///< one point
};

/// The same for all parts, with the points of those that are given.
struct PartLaws {
    std::vector<PartLaw> of;
    Eigen::VectorXd given;
};

/// p = the projection of z on the set that `law`, which is not the kinetic one, has.
void project_part(PartLaw law, double bound, std::span<const double> given,
                  std::span<const double> z, std::span<double> p);
/// Writes its derivative into the rows of the part, which begins at reaction `first` of `count`,
/// of a matrix that is stored row by row.
void part_derivative(PartLaw law, double bound, std::span<const double> z, std::size_t first,
                     std::size_t count, std::span<double> matrix);

/// The functions of inclusion.hpp, which take the system first. Those that a system does not have
/// are null. Those of a set refer to the set at (t, w).
template <int N, int M>
struct RICOCHET_ALIGNED InclusionTable {
    using System = const void*;
    using State = Eigen::Matrix<double, N, 1>;
    using Reaction = Eigen::Matrix<double, M, 1>;
    using Square = Eigen::Matrix<double, N, N>;
    using Observation =
        Eigen::Matrix<double, M, N, M == 1 && N != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
    using Action =
        Eigen::Matrix<double, N, M, N == 1 && M != 1 ? Eigen::RowMajor : Eigen::ColMajor>;
    using Terms = BranchTerms<N, M>;
    using Flow = BranchFlow<N>;
    using StepInputs = std::array<double, StepView::state_inputs>;

    InclusionTraits traits;

    void (*smooth)(System, double t, const State& w, State& f) = nullptr;
    void (*smooth_jacobian)(System, double t, const State& w, Square& j) = nullptr;
    void (*mass)(System, Square& a) = nullptr;
    void (*observe)(System, Observation& e) = nullptr;
    void (*act)(System, Action& g) = nullptr;
    void (*offset)(System, double t, Reaction& s) = nullptr;
    void (*offset_rate)(System, double t, Reaction& s) = nullptr;
    /// Whether the offset is more than that of padded reactions; null: `traits.moves`.
    bool (*has_own_offset)(System) = nullptr;

    // False where the set is faulty. `bounds` is that of a box.
    bool (*project)(System, double t, const State& w, const Reaction& z, Reaction& p) = nullptr;
    bool (*derivative)(System, double t, const State& w, const Reaction& z, double* d) = nullptr;
    bool (*bounds)(System, double t, const State& w, Reaction& lower, Reaction& upper) = nullptr;
    std::string (*fault)(System, double t, const State& w) = nullptr;
    std::size_t (*set_dimension)(System, double t, const State& w) = nullptr;

    /// A bound that is smooth beyond y = 0 where the system gives such an extension.
    double (*bound)(System, double t, const State& w, Eigen::Index i, Branch side) = nullptr;
    double (*static_bound)(System, double t, const State& w, Eigen::Index i) = nullptr;
    /// Sizes of the discs and intervals of a set that is no box, if `static_bound` is theirs.
    std::span<const int> parts{};
    void (*bound_gradient)(System, double t, const State& w, Eigen::Index i, State& g) = nullptr;

    // Functions of the modes of branches (branch_terms.hpp). Each is one call, so that nothing goes
    // through memory between the functions of a system and the arithmetic around them. In `flow`
    // every held y that is a component is at rest to the last bit.
    typename Flow::Function flow = nullptr;
    typename Flow::Function flow_of_diagonal = nullptr;  ///< for a diagonal A
    using BranchState = void (*)(System, const Terms& terms, Mode mode, double t, const State& w,
                                 MotionInBranches<N, M>& out);
    BranchState branch_state = nullptr;
    BranchState branch_state_of_diagonal = nullptr;

    const StepLayout& (*step_layout)() = nullptr;
    double (*step_unit)(System) = nullptr;
    void (*step_inputs)(System, double t, const State& w, const State& rate,
                        const Reaction& reaction, StepInputs& out) = nullptr;
};

/// A system and its table. Copies share the system, which is constant.
template <int N, int M>
class RICOCHET_ALIGNED AnyInclusion {
public:
    using Table = InclusionTable<N, M>;
    using State = typename Table::State;
    using Reaction = typename Table::Reaction;
    using Square = typename Table::Square;
    using Observation = typename Table::Observation;
    using Action = typename Table::Action;
    using Delassus = Eigen::Matrix<double, M, M>;
    using Terms = typename Table::Terms;
    using Flow = typename Table::Flow;
    using StepInputs = typename Table::StepInputs;
    using BranchMotion = MotionInBranches<N, M>;

    AnyInclusion(const Table& table, std::shared_ptr<const void> system, Eigen::Index size,
                 Eigen::Index reactions)
        : table_(&table), system_(std::move(system)), size_(size), reactions_(reactions)
    {
    }

    [[nodiscard]] const InclusionTraits& traits() const noexcept { return table_->traits; }
    [[nodiscard]] const void* system() const noexcept { return system_.get(); }
    /// Components and reactions of the system, at most N and M.
    [[nodiscard]] Eigen::Index size() const noexcept { return size_; }
    [[nodiscard]] Eigen::Index reactions() const noexcept
    {
        if constexpr (M == 1) return 1;
        return reactions_;
    }

    void smooth(double t, const State& w, State& f) const { table_->smooth(system(), t, w, f); }
    void smooth_jacobian(double t, const State& w, Square& j) const
    {
        table_->smooth_jacobian(system(), t, w, j);
    }
    // These three change what is not the default, which they are given.
    void mass(Square& a) const
    {
        if (table_->mass) table_->mass(system(), a);
    }
    void observe(Observation& e) const
    {
        if (table_->observe) return table_->observe(system(), e);
        for (Eigen::Index i = 0; i < reactions(); ++i) e(i, i) = 1;
    }
    void act(Action& g) const
    {
        if (table_->act) table_->act(system(), g);
    }
    void offset(double t, Reaction& s) const
    {
        if (table_->offset) table_->offset(system(), t, s);
    }
    [[nodiscard]] bool has_own_offset() const
    {
        return table_->has_own_offset ? table_->has_own_offset(system()) : traits().moves;
    }
    void offset_rate(double t, Reaction& s) const
    {
        if (table_->offset_rate) table_->offset_rate(system(), t, s);
    }

    bool project(double t, const State& w, const Reaction& z, Reaction& p) const
    {
        if (laws_) return project_parts(t, w, z, p);
        return table_->project(system(), t, w, z, p);
    }
    bool derivative(double t, const State& w, const Reaction& z, double* d) const
    {
        const bool fine = table_->derivative(system(), t, w, z, d);
        if (laws_) replace_derivative(t, w, z, d);
        return fine;
    }

    [[nodiscard]] std::span<const int> parts() const noexcept { return table_->parts; }
    /// Takes these laws for the parts of the set, which must outlive their use; none where null.
    void follow(const PartLaws* laws) noexcept { laws_ = laws; }
    bool bounds(double t, const State& w, Reaction& lower, Reaction& upper) const
    {
        if (table_->bounds) return table_->bounds(system(), t, w, lower, upper);
        lower.setZero();
        upper.setZero();
        return false;
    }
    [[nodiscard]] double bound(double t, const State& w, Eigen::Index i, Branch side) const
    {
        return table_->bound ? table_->bound(system(), t, w, i, side) : 0;
    }
    /// The bounds of a box, smooth beyond y = 0 where the system gives such an extension.
    void branch_bounds(double t, const State& w, Reaction& lower, Reaction& upper) const
    {
        if (!traits().continues_bounds) {
            bounds(t, w, lower, upper);
            return;
        }
        for (Eigen::Index i = 0; i < lower.size(); ++i) {
            lower[i] = bound(t, w, i, Branch::lower);
            upper[i] = bound(t, w, i, Branch::upper);
        }
    }
    /// The largest |reaction i| that holds y_i; only where the system gives one.
    [[nodiscard]] double static_bound(double t, const State& w, Eigen::Index i) const
    {
        return table_->static_bound(system(), t, w, i);
    }
    void bound_gradient(double t, const State& w, Eigen::Index i, State& g) const
    {
        if (table_->bound_gradient) table_->bound_gradient(system(), t, w, i, g);
    }
    [[nodiscard]] std::string fault(double t, const State& w) const
    {
        return table_->fault ? table_->fault(system(), t, w) : std::string{};
    }
    [[nodiscard]] std::size_t set_dimension(double t, const State& w) const
    {
        return table_->set_dimension(system(), t, w);
    }
    void check_projection(double t, const State& w) const
    {
        using Span = std::span<const double>;
        const Eigen::Index count = M == Eigen::Dynamic ? reactions() : M;
        Reaction z = Reaction::Zero(count), p = z;
        const auto read = [&](Span from) { std::copy(from.begin(), from.end(), z.data()); };
        detail::check_projection(
            static_cast<std::size_t>(count),
            [&](Span from, std::span<double> to) {
                read(from);
                project(t, w, z, p);
                std::copy(p.data(), p.data() + p.size(), to.begin());
            },
            [&](Span from, std::span<double> to) {
                read(from);
                derivative(t, w, z, to.data());
            });
    }

    /// Null for systems without modes of branches.
    [[nodiscard]] typename Flow::Function branch_flow(bool diagonal) const noexcept
    {
        return diagonal ? table_->flow_of_diagonal : table_->flow;
    }
    [[nodiscard]] typename Table::BranchState branch_state(bool diagonal) const noexcept
    {
        return diagonal ? table_->branch_state_of_diagonal : table_->branch_state;
    }

    /// The layout of the system's inputs for policies; null if it has none.
    [[nodiscard]] const StepLayout* step_layout() const
    {
        return table_->step_layout ? &table_->step_layout() : nullptr;
    }
    [[nodiscard]] double step_unit() const
    {
        return table_->step_unit ? table_->step_unit(system()) : 1;
    }
    void step_inputs(double t, const State& w, const State& rate, const Reaction& reaction,
                     StepInputs& out) const
    {
        table_->step_inputs(system(), t, w, rate, reaction, out);
    }

private:
    /// Calls `visit(law, first reaction, their number, static bound)` for the parts whose law is
    /// not the kinetic one.
    template <class Visit>
    void for_parts(double t, const State& w, const Visit& visit) const
    {
        std::size_t first = 0;
        for (std::size_t k = 0; k < parts().size(); ++k) {
            const PartLaw law = laws_->of[k];
            const auto n = static_cast<std::size_t>(parts()[k]);
            const double bound = law == PartLaw::within_static
                                     ? static_bound(t, w, static_cast<Eigen::Index>(k))
                                     : 0;
            if (law != PartLaw::kinetic) visit(law, first, n, bound);
            first += n;
        }
    }
    bool project_parts(double t, const State& w, const Reaction& z, Reaction& p) const;
    void replace_derivative(double t, const State& w, const Reaction& z, double* d) const;

    const Table* table_;
    std::shared_ptr<const void> system_;
    Eigen::Index size_, reactions_;
    const PartLaws* laws_ = nullptr;
};

template <int N, int M>
bool AnyInclusion<N, M>::project_parts(double t, const State& w, const Reaction& z,
                                       Reaction& p) const
{
    const Reaction from = z;
    const bool fine = table_->project(system(), t, w, from, p);
    for_parts(t, w, [&](PartLaw law, std::size_t first, std::size_t n, double bound) {
        project_part(law, bound, span_of(laws_->given).subspan(first, n),
                     span_of(from).subspan(first, n), span_of(p).subspan(first, n));
    });
    return fine;
}

template <int N, int M>
void AnyInclusion<N, M>::replace_derivative(double t, const State& w, const Reaction& z,
                                            double* d) const
{
    const std::span<const double> at = span_of(z);
    const std::span<double> all(d, at.size() * at.size());
    for_parts(t, w, [&](PartLaw law, std::size_t first, std::size_t n, double bound) {
        part_derivative(law, bound, at.subspan(first, n), first, at.size(), all);
    });
}

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

    [[nodiscard]] const Any& inclusion() const noexcept { return inclusion_; }
    /// See `AnyInclusion::follow`.
    void follow(const PartLaws* laws) noexcept { inclusion_.follow(laws); }
    [[nodiscard]] const InclusionTraits& traits() const noexcept { return inclusion_.traits(); }
    /// Of the vectors, N and M where these are fixed.
    [[nodiscard]] Eigen::Index size() const noexcept { return mass_.rows(); }
    [[nodiscard]] Eigen::Index reactions() const noexcept { return observe_.rows(); }
    /// Of the system, without padding.
    [[nodiscard]] Eigen::Index own_size() const noexcept { return inclusion_.size(); }
    [[nodiscard]] Eigen::Index own_reactions() const noexcept { return inclusion_.reactions(); }

    [[nodiscard]] const Square& mass() const noexcept { return mass_; }                  // A
    [[nodiscard]] const Square& inverse_mass() const noexcept { return inverse_mass_; }  // 1/A
    [[nodiscard]] const Observation& observe() const noexcept { return observe_; }       // E
    [[nodiscard]] const Action& act() const noexcept { return act_; }                    // G

    void smooth(double t, const State& w, State& f) const { inclusion_.smooth(t, w, f); }

    /// The Jacobian of f; where the system does not give it, by central differences of relative
    /// step 6e-6, the cube root of the rounding unit.
    void jacobian(double t, const State& w, Square& j) const
    {
        if (traits().gives_jacobian) return inclusion_.smooth_jacobian(t, w, j);
        State moved = w;
        State ahead = w;
        State behind = w;
        if (own_size() < size()) j.setZero();
        for (Eigen::Index i = 0; i < own_size(); ++i) {
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
        if (traits().moves) inclusion_.offset(t, s);
    }

    /// Subtracts s'(t); where the system does not give it, by a central difference.
    void subtract_offset_rate(double t, Reaction& rate) const
    {
        if (traits().gives_offset_rate) {
            Reaction declared = Reaction::Zero(reactions());
            inclusion_.offset_rate(t, declared);
            rate -= declared;
        } else if (traits().moves) {
            const double step = 1e-5 * std::max(1.0, std::abs(t));
            Reaction ahead, behind;
            offset(t + step, ahead);
            offset(t - step, behind);
            rate -= (ahead - behind) / (2 * step);
        }
    }

    /// y = E w - s(t).
    void observed(double t, const State& w, Reaction& y) const
    {
        offset(t, y);
        y = times(observe_, w) - y;
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

    Any inclusion_;
    Square mass_, inverse_mass_;
    Observation observe_;
    Action act_;
    Eigen::Matrix<Eigen::Index, M, 1> selected_;
};

}  // namespace detail

/// The reaction that the motion takes from (t, w); see minimal_selection.hpp.
template <int N, int M>
[[nodiscard]] Eigen::Matrix<double, M, 1> minimal_selection(
    const detail::AnyMatrices<N, M>& m, double t,
    const std::type_identity_t<Eigen::Matrix<double, N, 1>>& w, double span = 0);

/// How far a state and its reaction violate their law; see law.hpp.
template <int N, int M>
[[nodiscard]] double law_violation(
    const detail::AnyMatrices<N, M>& m, double t,
    const std::type_identity_t<Eigen::Matrix<double, N, 1>>& w,
    const std::type_identity_t<Eigen::Matrix<double, M, 1>>& reaction, double span);

}  // namespace ricochet
