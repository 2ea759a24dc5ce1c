// Definitions of the solvers of inclusions, for sizes that the library has not compiled.
//
// RICOCHET_INCLUSIONS_OF(N, M, ) in one source, which includes this header, compiles them for
// systems of exactly N components and M reactions; the sources with such a system have
// RICOCHET_INCLUSIONS_OF(N, M, extern) before its first use (nonsmooth/detail/inclusion_sizes.hpp).
#pragma once

#include <memory>

#include "ricochet/detail/debug_checks.hpp"
#include "ricochet/nonsmooth/detail/branch_phases_of.hpp"
#include "ricochet/nonsmooth/detail/inclusion_sizes.hpp"
#include "ricochet/nonsmooth/detail/minimal_selection.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"

namespace ricochet::detail {

template <int N, int M>
AnyMatrices<N, M>::AnyMatrices(const Any& inclusion) : inclusion_(inclusion)
{
    const Eigen::Index own = inclusion.size();
    const Eigen::Index n = N == Eigen::Dynamic ? own : N;
    const Eigen::Index m = M == Eigen::Dynamic ? inclusion.reactions() : M;
    mass_.setIdentity(n, n);
    inclusion.mass(mass_);
    if (!mass_.allFinite()) refuse_inclusion("the matrix A is not finite");
    Eigen::MatrixXd inverse = mass_.topLeftCorner(own, own);
    if (const Eigen::Index rank = invert(inverse, inverse); rank < own) {
        refuse_inclusion("the matrix A is singular; its rank is", static_cast<double>(rank));
    }
    inverse_mass_.setIdentity(n, n);
    inverse_mass_.topLeftCorner(own, own) = inverse;

    observe_.setZero(m, n);
    inclusion.observe(observe_);
    act_ = observe_.transpose();
    inclusion.act(act_);
    if (!observe_.allFinite() || !act_.allFinite()) {
        refuse_inclusion("the matrices E and G must be finite");
    }
    find_selected();
}

template <int N, int M>
AnyStep<N, M>::AnyStep(const AnyInclusion<N, M>& inclusion, const SchemeOptions& options)
    : matrices_(inclusion), options_(options), scratch_(matrices_), newton_(matrices_)
{
    validate(options);
    method_ = options.stage.method;
    const bool box = matrices_.traits().box;
    const bool few = box && matrices_.reactions() <= most_cases;
    falls_back_ = method_ == StageMethod::automatic;
    if (method_ == StageMethod::automatic) {
        // Where reactions depend on one another, Newton's equations are singular.
        const bool by_cases = few || (box && has_dependent_reactions(matrices_));
        method_ = by_cases ? StageMethod::cases : StageMethod::newton;
        falls_back_ = !by_cases;
    } else if (method_ == StageMethod::cases && !few) {
        refuse_inclusion("cases need a box of at most four reactions, not",
                         static_cast<double>(matrices_.reactions()));
    }
    scratch_.inequality.dependent =
        box && matrices_.own_reactions() > 1 && has_dependent_reactions(matrices_);
    if (!box && matrices_.own_reactions() > 1 && has_dependent_reactions(matrices_)) {
        newton_.take_as_dependent();
    }
    const Eigen::Index n = matrices_.size();
    for (Vector* v : {&f_, &stage_.q}) v->setZero(n);
    middle_.w.setZero(n);
    middle_.reaction.setZero(matrices_.reactions());
    branches_.setConstant(matrices_.reactions(), Branch::inside);
}

template <int N, int M>
StageReport AnyStep<N, M>::take(const State& from, double h, State& to, const Branches* frozen)
{
    frozen_ = frozen;
    if (options_.scheme == Scheme::bathe) return composite(from, h, to);
    const double theta = options_.scheme == Scheme::theta ? options_.theta : 1;
    return one_stage(from, {.span = h, .theta = theta, .c = 1 / h}, to);
}

template <int N, int M>
void AnyStep<N, M>::embedded_error(const State& from, double h, const State& to,
                                   Vector& error) const
{
    error.noalias() = times(matrices_.act(), from.reaction);
    error += f_;
    error = (0.5 * h) * times(matrices_.inverse_mass(), error).eval();
    error += 0.5 * (to.w - 4 * middle_.w + 3 * from.w);
}

template <int N, int M>
void AnyStep<N, M>::branches_of(const State& state, Branches& branches)
{
    const bool of_reactions = matrices_.traits().of_reactions();
    matrices_.inclusion().bounds(state.t, state.w, scratch_.lower, scratch_.upper);
    matrices_.observed(state.t, state.w, scratch_.y);
    matrices_.offset(state.t, scratch_.s);
    scratch_.argument = times(matrices_.observe().cwiseAbs(), state.w.cwiseAbs());
    scratch_.argument += scratch_.s.cwiseAbs();
    for (Eigen::Index i = 0; i < branches.size(); ++i) {
        const double y = scratch_.y[i];
        if (of_reactions && std::abs(y) > 1e-14 * scratch_.argument[i]) {
            branches[i] = y > 0 ? Branch::lower : Branch::upper;
            continue;
        }
        const double lower = scratch_.lower[i];
        const double upper = scratch_.upper[i];
        const double at = of_reactions ? state.reaction[i] : y;
        // Bounds that depend on the state are met within the solver's tolerance.
        const double near = 1e-9 * (std::abs(at) + std::min(std::abs(lower), std::abs(upper)));
        branches[i] = at <= lower + near   ? Branch::lower
                      : at >= upper - near ? Branch::upper
                                           : Branch::inside;
    }
}

template <int N, int M>
double AnyStep<N, M>::slack(const State& state, const Branches& branches, Eigen::Index* which)
{
    auto& inequality = scratch_.inequality;
    matrices_.inclusion().bounds(state.t, state.w, inequality.lower, inequality.upper);
    matrices_.observed(state.t, state.w, scratch_.y);
    double least = std::numeric_limits<double>::infinity();
    for (Eigen::Index i = 0; i < matrices_.own_reactions(); ++i) {
        const double here = inequality.slack(i, branches[i], state.reaction[i], scratch_.y[i]);
        if (here < least) {
            least = here;
            if (which) *which = i;
        }
    }
    return least;
}

template <int N, int M>
AnyMotion<N, M>::AnyMotion(const AnyInclusion<N, M>& inclusion, const Vector& w0,
                           const SetValuedOptions& options)
    : options_(options), step_(inclusion, options.scheme)
{
    validate(options);
    validate(options.controller);
    if (options.estimate == ErrorEstimate::embedded &&
        (options.scheme.scheme != Scheme::bathe ||
         options.scheme.first_stage == FirstStage::at_end)) {
        refuse_inclusion("the embedded estimate needs Bathe's scheme with the reaction averaged");
    }
    if (options.switches == Switches::located && !traits().box) {
        refuse_inclusion("only the branches of a box can be located");
    }
    if (w0.size() != step_.matrices().size()) {
        refuse_inclusion("the initial state must have as many components as the system, not",
                         static_cast<double>(w0.size()));
    }
    validate_fields(options.fields, step_.matrices().own_size());
    validate_policy(options, inclusion.step_layout());
    rate_ = w0;
    branches_before_.setConstant(step_.matrices().reactions(), Branch::inside);
    branches_after_ = branches_before_;
    h_ = options.step;
    h_min_ = options.h_min > 0 ? options.h_min : 1e-12 * (options.t_end - options.t_start);
    now_.w = error_ = w0;
    now_.reaction.setZero(step_.matrices().reactions());
    before_ = trial_ = half_ = now_;
    start_branches_.setConstant(now_.reaction.size(), Branch::inside);
    restart(options.t_start, w0);
    before_ = now_;
    if (is_debug_build()) {
        inclusion.check_projection(options.t_start, w0);
    }
}

template <int N, int M>
void AnyMotion<N, M>::restart(double t, const Vector& w)
{
    now_.reaction = minimal_selection(step_.matrices(), t, w);
    now_.t = t;
    now_.w = w;
    begin();
}

template <int N, int M>
void AnyMotion<N, M>::restart(const State& state)
{
    check_start(step_.matrices(), state.t, state.w);
    check_reaction(step_.matrices(), state);
    now_ = state;
    begin();
}

template <int N, int M>
Outcome AnyMotion<N, M>::advance()
{
    if (outcome_ != Outcome::running) return outcome_;
    int failures = 0;
    bool solved = true;
    for (;;) {
        if (statistics_.attempted == options_.max_attempts) {
            return end_with(Outcome::step_limit);
        }
        const double left = options_.t_end - now_.t;
        if (left <= 4 * std::numeric_limits<double>::epsilon() * std::abs(options_.t_end)) {
            // A change was located at the end, up to rounding.
            now_.t = options_.t_end;
            return end_with(Outcome::reached_end);
        }
        double h = std::min(h_, options_.h_max);
        const bool last = is_last_step(h, now_.t, options_.t_end, statistics_.accepted);
        if (last) h = left;
        ++statistics_.attempted;
        const StageReport report = attempt(h);
        if (!report.converged) {
            ++statistics_.unsolved;
            failure_ = report;
            solved = false;
            h_ = h * std::visit([](auto& c) { return c.failed(); }, options_.controller);
            ++failures;
        } else {
            const StepVerdict verdict =
                judge(options_.controller, scaled_error_, h, [&] { return view(h); });
            if (verdict.accepted) {
                if (!holds_length_)
                    h_ = h * verdict.factor;
                else if (failures == 0 && !last)
                    h_ = std::min(options_.step, 2 * h_);
                accept(last);
                return outcome_;
            }
            ++statistics_.rejected;
            h_ = h * verdict.factor;
            solved = true;
        }
        if (!(h_ >= h_min_)) {
            return end_with(solved ? Outcome::step_underflow : Outcome::not_converged);
        }
    }
}

}  // namespace ricochet::detail
