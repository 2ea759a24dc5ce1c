// Implicit steps of an inclusion: Bathe's composite step, backward Euler, theta.
#pragma once

#include <optional>

#include "ricochet/nonsmooth/detail/stage_cases.hpp"
#include "ricochet/nonsmooth/detail/stage_fixed_point.hpp"
#include "ricochet/nonsmooth/detail/stage_newton.hpp"
#include "ricochet/nonsmooth/detail/typed_inclusion.hpp"

namespace ricochet {

namespace detail {

template <int N, int M>
struct RICOCHET_ALIGNED StateWithReaction {
    double t = 0;
    Eigen::Matrix<double, N, 1> w;
    Eigen::Matrix<double, M, 1> reaction;
};

}  // namespace detail

/// State of a set-valued motion; the reaction belongs to it.
template <Inclusion System>
using SetValuedState = detail::StateWithReaction<state_size<System>, reaction_size<System>>;

/// Scheme of an implicit step.
enum class Scheme {
    /// Over half the step the trapezoidal rule, then backward differences of three points
    /// over all of it: of order 2, and strongly damped at high frequencies (K.-J. Bathe and
    /// G. Noh, Insight into an implicit time integration scheme for structural dynamics,
    /// Computers and Structures 98-99, 2012):
    ///
    ///     A (w_g - w_n) / (h/2) = (f_n + f_g) / 2 + G reaction
    ///     A (3 w_{n+1} - 4 w_g + w_n) / h = f_{n+1} + G reaction_{n+1}
    bathe,
    backward_euler,
    theta,  ///< A (w_{n+1} - w_n) / h = theta f_{n+1} + (1 - theta) f_n + G reaction
};

/// Treatment of the reaction in a stage that averages f over its ends.
enum class FirstStage {
    averaged,  ///< averaged like f: order 2 also where the reaction varies
    at_end,    ///< taken at the stage's end, as in the code of the source: order 1 there
    /// averaged; solved again with at_end where the branch at the stage's end differs from
    /// the one at its start, whose reaction says nothing about the motion after a switch
    switch_aware,
};

/// Scheme of the implicit steps, and how their stages are solved.
struct SchemeOptions {
    Scheme scheme = Scheme::bathe;
    FirstStage first_stage = FirstStage::averaged;
    double theta = 0.5;  ///< in (0, 1], since the reaction must be implicit
    StageOptions stage{};
};

/// @throws std::invalid_argument naming the option.
void validate(const SchemeOptions& options);

namespace detail {

/// Whether E A^-1 G of at most 64 reactions is singular to working precision.
template <int N, int M>
[[nodiscard]] bool has_dependent_reactions(const AnyMatrices<N, M>& m)
{
    if (m.reactions() > 64) return false;
    const Eigen::Index own = m.own_reactions();
    Eigen::MatrixXd w = (m.observe() * (m.inverse_mass() * m.act())).topLeftCorner(own, own);
    return invert(w, w) < w.rows();
}

/// Steps from any state to the next. Only the factors of constant matrices are kept from one
/// step to another, so the same state and step give the same bits.
template <int N, int M>
class RICOCHET_ALIGNED AnyStep {
public:
    using Matrices = AnyMatrices<N, M>;
    using Vector = typename Matrices::State;
    using Reaction = typename Matrices::Reaction;
    using State = StateWithReaction<N, M>;
    using Branches = BranchesOf<M>;

    /// @throws std::invalid_argument for what `SchemeOptions` and `detail::InclusionMatrices`
    /// refuse, and for StageMethod::cases where the set is no box of at most four reactions.
    AnyStep(const AnyInclusion<N, M>& inclusion, const SchemeOptions& options);
    AnyStep(const AnyStep& other) : AnyStep(other.matrices_.inclusion(), other.options_) {}
    AnyStep& operator=(const AnyStep&) = delete;

    [[nodiscard]] const Matrices& matrices() const noexcept { return matrices_; }
    /// See `AnyInclusion::follow`.
    void follow(const PartLaws* laws) noexcept { matrices_.follow(laws); }
    [[nodiscard]] const SchemeOptions& options() const noexcept { return options_; }

    /// Takes a step of h from `from`. If it has not converged, `to` is meaningless.
    /// `frozen`: the branches to assume, whether the solution lies on them or not.
    [[nodiscard]] StageReport take(const State& from, double h, State& to,
                                   const Branches* frozen = nullptr);

    /// The state at the end of the first stage of the last step.
    [[nodiscard]] const State& middle() const noexcept { return middle_; }

    /// Simpson's rule over the three states of the last step minus the step: the local
    /// error of Bathe's step with the averaged reaction, to leading order, at the cost of
    /// a sum,
    ///
    ///     (w_{n+1} - 4 w_g + 3 w_n + h A^-1 (f_n + G reaction_n)) / 2.
    void embedded_error(const State& from, double h, const State& to, Vector& error) const;

    /// The branch of each pair of reaction and y on its graph. For a set of reactions it is
    /// given by the sign of y, and where y is zero up to rounding by the place of the reaction
    /// in the set; for a set of states by the place of y. Boxes only.
    void branches_of(const State& state, Branches& branches);

    /// How far a state is inside its branches, as `LinearInequality::slack`. Boxes only.
    [[nodiscard]] double slack(const State& state, const Branches& branches,
                               Eigen::Index* which = nullptr);

private:
    [[nodiscard]] StageReport composite(const State& from, double h, State& to)
    {
        StageReport first = one_stage(from, {.span = h / 2, .theta = 0.5, .c = 2 / h}, middle_);
        if (!first.converged) return first;
        stage_.t = from.t + h;
        stage_.c = 3 / h;
        stage_.kappa = stage_.sigma = 1;
        stage_.q.noalias() = times(matrices_.mass(), Vector(4 * middle_.w - from.w));
        stage_.q /= h;
        to.t = stage_.t;
        to.w = middle_.w;
        to.reaction = middle_.reaction;
        StageReport second = solve(to);
        second.iterations += first.iterations;
        second.residual = std::max(second.residual, first.residual);
        return second;
    }

    /// A stage with the weights theta and 1 - theta.
    struct ThetaStage {
        double span;  ///< [s]
        double theta;
        double c;  ///< [1/s]
    };

    [[nodiscard]] StageReport one_stage(const State& from, const ThetaStage& stage, State& to)
    {
        matrices_.smooth(from.t, from.w, f_);
        const bool averages = options_.first_stage != FirstStage::at_end && stage.theta < 1;
        StageReport report = attempt(from, stage, averages, to);
        if (matrices_.traits().box && averages && report.converged && !frozen_ &&
            options_.first_stage == FirstStage::switch_aware) {
            Branches before = branches_;
            Branches after = branches_;
            branches_of(from, before);
            branches_of(to, after);
            if (before != after) {
                const int spent = report.iterations;
                report = attempt(from, stage, false, to);
                report.iterations += spent;
            }
        }
        return report;
    }

    [[nodiscard]] StageReport attempt(const State& from, const ThetaStage& stage, bool averages,
                                      State& to)
    {
        const auto [span, theta, c] = stage;
        stage_.t = from.t + span;
        stage_.c = c;
        stage_.kappa = theta;
        stage_.sigma = averages ? theta : 1;
        stage_.q.noalias() = c * times(matrices_.mass(), from.w);
        stage_.q += (1 - theta) * f_;
        if (averages) stage_.q.noalias() += (1 - theta) * times(matrices_.act(), from.reaction);
        to.t = stage_.t;
        to.w = from.w;
        to.reaction = from.reaction;
        return solve(to);
    }

    [[nodiscard]] StageReport solve(State& to)
    {
        if (frozen_) {
            branches_ = *frozen_;
            return StageCases(scratch_, stage_, branches_, true)
                .solve(options_.stage, to.w, to.reaction);
        }
        if (method_ == StageMethod::cases) {
            branches_.setConstant(Branch::inside);
            return StageCases(scratch_, stage_, branches_).solve(options_.stage, to.w, to.reaction);
        }
        if (method_ == StageMethod::fixed_point) {
            return solve_fixed_point(scratch_, stage_, options_.stage, to.w, to.reaction);
        }
        const Vector start = to.w;
        const Reaction reaction = to.reaction;
        const StageReport report =
            newton_.solve(scratch_, stage_, options_.stage, to.w, to.reaction);
        if (report.converged || !falls_back_) return report;
        to.w = start;
        to.reaction = reaction;
        return solve_again(to, report);
    }

    /// Solves again where Newton's method fails: by pivots for a box, else by the fixed point.
    [[nodiscard]] StageReport solve_again(State& to, const StageReport& before)
    {
        StageReport report;
        if (matrices_.traits().box) {
            branches_.setConstant(Branch::inside);
            report =
                StageCases(scratch_, stage_, branches_).solve(options_.stage, to.w, to.reaction);
        } else {
            report = solve_fixed_point(scratch_, stage_, options_.stage, to.w, to.reaction);
        }
        const int spent = report.iterations + before.iterations;
        if (!report.converged && before.residual < report.residual) report = before;
        report.iterations = spent;
        return report;
    }

    Matrices matrices_;
    SchemeOptions options_;
    StageMethod method_ = StageMethod::cases;
    bool falls_back_ = false;  // from Newton's method, where the user did not choose it
    StageScratch<N, M> scratch_;
    StageNewton<N, M> newton_;
    Stage<N, M> stage_;
    Vector f_;  // f_n
    State middle_;
    Branches branches_;
    const Branches* frozen_ = nullptr;
};

}  // namespace detail

/// Steps of a system, from any state to the next.
template <Inclusion System>
class CompositeStep : public detail::AnyStep<state_size<System>, reaction_size<System>> {
public:
    static constexpr bool box = BoxSet<SetOf<System>>;

    /// @throws std::invalid_argument for what `SchemeOptions` and `detail::InclusionMatrices`
    /// refuse, and for StageMethod::cases where the set is no box of at most four reactions.
    explicit CompositeStep(const System& system, const SchemeOptions& options = {})
        : CompositeStep::AnyStep(detail::exact_inclusion(system), options)
    {
        static_assert(detail::check_own_size<state_size<System>, reaction_size<System>>());
    }
};

}  // namespace ricochet
