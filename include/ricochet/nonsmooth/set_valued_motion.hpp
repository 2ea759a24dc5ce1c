// Integrating an inclusion, a step at a time or to the end.
//
//     SetValuedMotion motion(DiodeCircuit{}, w0, {.t_end = 20, .step = 0.01});
//     const Outcome outcome = motion.run();
//
// A step is computed, its error assessed by the controller, and accepted or repeated; a
// stage that has no solution shortens the step and in the end stops the run. The state,
// with its reaction, is all that a step depends on.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "ricochet/nonsmooth/composite_step.hpp"
#include "ricochet/nonsmooth/detail/false_position.hpp"
#include "ricochet/nonsmooth/detail/inclusion_sizes.hpp"
#include "ricochet/nonsmooth/detail/padded_motion.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"
#include "ricochet/run.hpp"

namespace ricochet {

/// How the error of a step is estimated.
enum class ErrorEstimate {
    none,      ///< sufficient for a `ConstantStep`
    embedded,  ///< `CompositeStep::embedded_error`: Bathe's scheme, averaged reaction
    doubling,  ///< one step against two of half the length, whose result is kept
};

/// How changes of branch inside a step are treated.
enum class Switches {
    stepped_over,  ///< as in the source paper: of order 1 at a jump of the reaction
    /// A step in which a branch changes ends at the last instant up to which the motion is
    /// consistent with the branches of its start. For boxes only.
    located,
};

/// Components whose error is measured as that of one field: its norm against
/// rtol max(norm of the field, floor). A floor as large as the field will be makes the tolerance
/// absolute, a floor of zero makes it relative.
struct ErrorField {
    Eigen::Index first = 0;
    Eigen::Index count = 0;  ///< number of components, positive
    double rtol = 1e-3;      ///< positive
    double floor = 0;        ///< in the units of the state
};

/// Options of set-valued motion.
struct SetValuedOptions {
    double t_start = 0;
    double t_end = std::numeric_limits<double>::quiet_NaN();
    double step = 0;  ///< length of the first step, and of all steps with `ConstantStep`; positive
    StepController controller = ConstantStep{};
    ErrorEstimate estimate = ErrorEstimate::none;
    double rtol = 1e-4;  ///< errors are measured against atol + rtol |w|, in root mean square
    double atol = 1e-6;
    /// Fields to measure instead of rtol and atol: the error is that of the worst field.
    std::vector<ErrorField> fields{};
    int error_order = 2;  ///< p in (two half steps - one step) / (2^p - 1)
    double h_min = 0;     ///< 0: 1e-12 of the time integrated
    double h_max = std::numeric_limits<double>::infinity();
    Switches switches = Switches::stepped_over;
    SchemeOptions scheme{};
    std::uint64_t max_attempts = 100'000'000;
};

/// Validates options. @throws std::invalid_argument naming the option, what was given and expected.
void validate(const SetValuedOptions& options);

namespace detail {

/// Whether a step of length h [s] from t is the last: where `steps` steps have led to t, only their
/// rounding, or a part in 1e9 of the step, would be left of the time to t_end.
[[nodiscard]] inline bool is_last_step(double h, double t, double t_end,
                                       std::uint64_t steps) noexcept
{
    const double rounding = static_cast<double>(steps) * std::numeric_limits<double>::epsilon() *
                            std::max(std::abs(t), std::abs(t_end));
    return t_end - t <= h * (1 + 1e-9) + std::min(rounding, 1e-3 * h);
}
/// @throws std::invalid_argument naming the field, unless it lies within `size` components.
void validate_fields(const std::vector<ErrorField>& fields, Eigen::Index size);
/// @throws std::invalid_argument if a learned controller's policy is null, or is for another
/// layout.
void validate_policy(const SetValuedOptions& options, const StepLayout* layout);

/// `SetValuedMotion` for systems of any type.
template <int N, int M>
class RICOCHET_ALIGNED AnyMotion {
public:
    using Matrices = AnyMatrices<N, M>;
    using Vector = typename Matrices::State;
    using Reaction = typename Matrices::Reaction;
    using State = StateWithReaction<N, M>;
    using Branches = BranchesOf<M>;

    AnyMotion(const AnyInclusion<N, M>& inclusion, const Vector& w0,
              const SetValuedOptions& options);

    /// Restarts from (t, w): after a jump, or when an event-driven
    /// integrator hands over.
    /// @throws std::invalid_argument for a time or state that is not finite, and for another size.
    void restart(double t, const Vector& w);

    /// Restarts from a state with a known reaction.
    /// @throws std::invalid_argument also if the reaction lies outside the set.
    void restart(const State& state);

    [[nodiscard]] const State& state() const noexcept { return now_; }
    /// Start of the last accepted step, and its middle stage.
    [[nodiscard]] const State& before() const noexcept { return before_; }
    [[nodiscard]] const State& middle() const noexcept { return step_.middle(); }
    [[nodiscard]] const SetValuedStatistics& statistics() const noexcept { return statistics_; }
    [[nodiscard]] Outcome outcome() const noexcept { return outcome_; }
    /// The stage that ended the run as `not_converged`.
    [[nodiscard]] const StageReport& failure() const noexcept { return failure_; }
    /// Length of the step that will be tried next.
    [[nodiscard]] double next_step() const noexcept { return h_; }
    /// Sets the length of the next step, positive, for callers that choose the steps themselves.
    void next_step(double h) noexcept { h_ = h; }
    /// The scaled error of the last attempt.
    [[nodiscard]] double error() const noexcept { return scaled_error_; }
    /// The step controller in its present state, with the counts of a `LearnedStep`.
    [[nodiscard]] const StepController& controller() const noexcept { return options_.controller; }
    [[nodiscard]] AnyStep<N, M>& stepper() noexcept { return step_; }
    [[nodiscard]] const Matrices& matrices() const noexcept { return step_.matrices(); }
    /// The branches of the state, which are kept if switches are located.
    [[nodiscard]] const Branches& branches() const noexcept { return start_branches_; }
    /// Sets whether switches are located from now on; requires that the options ask for it.
    void locate_switches(bool locate) noexcept { locates_ = locate; }
    /// The switch that was located last.
    struct Switch {
        std::size_t reaction = 0;
        Branch before = Branch::inside;
        Branch after = Branch::inside;
    };
    [[nodiscard]] const Switch& last_switch() const noexcept { return last_switch_; }

    /// Takes the next accepted step. Returns `running`, or how the run ended.
    Outcome advance();

    /// Runs to the end. `observer(state)` sees the start and every accepted step.
    template <class Observer>
    Outcome run(const Observer& observer)
    {
        observer(std::as_const(now_));
        while (advance() == Outcome::running) observer(std::as_const(now_));
        if (outcome_ == Outcome::reached_end) observer(std::as_const(now_));
        return outcome_;
    }

    Outcome run()
    {
        return run([](const State&) {});
    }

    /// The state within the last step at which the scalar `g(state)`, of opposite signs at
    /// its ends, vanishes: found by repeating the step with other lengths, so that it is as
    /// accurate as a step; to `tolerance` in time. `g` may depend on the reaction, as for the
    /// release of a sticking contact. Empty if the signs are equal or a step fails.
    template <class Function>
    [[nodiscard]] std::optional<State> locate(const Function& g, double tolerance = 0)
    {
        State at = now_;
        const double width = detail::false_position(
            0, g(before_), now_.t - before_.t, g(now_), tolerance, [&](double h) {
                return step_.take(before_, h, at).converged
                           ? g(std::as_const(at))
                           : std::numeric_limits<double>::quiet_NaN();
            });
        if (!(width > 0) || !step_.take(before_, width, at).converged) return std::nullopt;
        return at;
    }

private:
    [[nodiscard]] const InclusionTraits& traits() const noexcept
    {
        return step_.matrices().traits();
    }
    [[nodiscard]] const AnyInclusion<N, M>& inclusion() const noexcept
    {
        return step_.matrices().inclusion();
    }

    void begin()
    {
        std::visit([](auto& c) { c.reset(); }, options_.controller);
        holds_length_ = std::holds_alternative<ConstantStep>(options_.controller);
        if (traits().box) step_.branches_of(now_, start_branches_);
        outcome_ = now_.t < options_.t_end ? Outcome::running : Outcome::reached_end;
    }

    Outcome end_with(Outcome outcome) { return outcome_ = outcome; }

    /// Makes one attempt at a step, with its error, into trial_.
    StageReport attempt(double h)
    {
        switched_ = false;
        StageReport report = counted(step_.take(now_, h, trial_));
        if (!report.converged) return report;
        scaled_error_ = 0;
        if (options_.estimate == ErrorEstimate::embedded) {
            step_.embedded_error(now_, h, trial_, error_);
            scaled_error_ = scaled(error_, now_.w, trial_.w);
        } else if (options_.estimate == ErrorEstimate::doubling) {
            report = counted(step_.take(now_, h / 2, half_));
            if (!report.converged) return report;
            error_ = trial_.w;
            report = counted(step_.take(half_, h / 2, trial_));
            if (!report.converged) return report;
            error_ -= trial_.w;
            const double divisor = std::pow(2.0, options_.error_order) - 1;
            const Vector coarse = trial_.w + error_;
            error_ /= divisor;
            scaled_error_ = scaled(error_, coarse, trial_.w);
        }
        if (!std::isfinite(scaled_error_)) report.converged = false;
        if (traits().box && options_.switches == Switches::located && locates_ &&
            short_switches_ <= 4 + 2 * step_.matrices().own_reactions()) {
            return end_at_switch(h, report);
        }
        return report;
    }

    StageReport counted(const StageReport& report)
    {
        statistics_.stages += options_.scheme.scheme == Scheme::bathe ? 2 : 1;
        statistics_.iterations += static_cast<std::uint64_t>(report.iterations);
        return report;
    }

    /// Inputs of a policy for the attempt.
    [[nodiscard]] StepView view(double h)
    {
        StepView out{.step = h};
        if (inclusion().step_layout() != nullptr) {
            out.tolerance = options_.fields.empty() ? options_.rtol : options_.fields.front().rtol;
            out.step = h / inclusion().step_unit();
            rate_ = (3 * trial_.w - 4 * step_.middle().w + now_.w) / h;
            inclusion().step_inputs(trial_.t, trial_.w, rate_, trial_.reaction, out.state);
            if (traits().box) {
                step_.branches_of(now_, branches_before_);
                step_.branches_of(trial_, branches_after_);
                const Eigen::Index n = step_.matrices().own_reactions();
                double changed = 0;
                for (Eigen::Index i = 0; i < n; ++i) {
                    changed += branches_before_[i] != branches_after_[i] ? 1 : 0;
                }
                out.switched = n > 0 ? changed / static_cast<double>(n) : 0;
            }
        }
        return out;
    }

    [[nodiscard]] double scaled_by_fields(const Vector& error, const Vector& a,
                                          const Vector& b) const
    {
        double worst = 0;
        for (const ErrorField& field : options_.fields) {
            const auto norm = [&](const Vector& v) {
                return norm_of_segment(v, field.first, field.count);
            };
            const double size = std::max({norm(a), norm(b), field.floor});
            // Nothing moved, and nothing is wrong: zero over zero counts as no error.
            const double off = norm(error);
            if (!(off == 0)) worst = std::max(worst, off / (field.rtol * size));
            if (std::isnan(off)) return off;
        }
        return worst;
    }

    [[nodiscard]] double scaled(const Vector& error, const Vector& a, const Vector& b) const
    {
        if (!options_.fields.empty()) return scaled_by_fields(error, a, b);
        double sum = 0;
        const Eigen::Index n = step_.matrices().own_size();
        for (Eigen::Index i = 0; i < n; ++i) {
            const double size =
                options_.atol + options_.rtol * std::max(std::abs(a[i]), std::abs(b[i]));
            sum += (error[i] / size) * (error[i] / size);
        }
        return std::sqrt(sum / static_cast<double>(n));
    }

    /// If the step leaves the branches of its start, trial_ becomes the end
    /// of the shorter step that stays on them.
    StageReport end_at_switch(double h, const StageReport& whole)
    {
        const auto slack_after = [&](double width) {
            const StageReport report = counted(step_.take(now_, width, half_, &start_branches_));
            return report.converged ? step_.slack(half_, start_branches_)
                                    : std::numeric_limits<double>::quiet_NaN();
        };
        double end = slack_after(h);
        double low = 0;
        double high = h;
        double at_high = end;
        if (end >= 0) {
            // A branch that was left and entered again within the step shows at the middle stage.
            const double middle = step_.slack(step_.middle(), start_branches_);
            if (middle >= 0) {
                // The two half steps of `doubling` are better than the step that was examined.
                const bool keep = options_.estimate == ErrorEstimate::doubling &&
                                  step_.slack(trial_, start_branches_) >= 0;
                if (!keep) trial_ = half_;
                return whole;
            }
            high = h / 2;
            at_high = slack_after(high);
        }
        double at_low = slack_after(1e-6 * high);
        low = 1e-6 * high;
        if (!(at_high < 0) || !(at_low > 0)) return whole;
        const double width = detail::false_position(low, at_low, high, at_high, 0, slack_after);
        if (!(width > 0)) return whole;
        StageReport report = counted(step_.take(now_, width, half_, &start_branches_));
        if (!report.converged) return whole;
        trial_ = half_;
        switched_ = true;
        return report;
    }

    void accept(bool last)
    {
        before_ = now_;
        const double t = now_.t;
        std::swap(now_.w, trial_.w);
        std::swap(now_.reaction, trial_.reaction);
        if (last && !switched_) {
            now_.t = options_.t_end;
            outcome_ = Outcome::reached_end;
        } else {
            now_.t = trial_.t;
        }
        ++statistics_.accepted;
        if (options_.switches == Switches::located) {
            // Reactions that depend on one another can exchange branches endlessly.
            if (!switched_) {
                short_switches_ = 0;
            } else if (now_.t - t < 0.1 * options_.step) {
                ++short_switches_;
            }
            enter_next_branches();
        }
    }

    /// After a switch the reaction is that of the branch now entered. A bound that it has
    /// just reached is set exactly, so that rounding cannot lead back inside.
    void enter_next_branches()
    {
        if (!switched_) {
            step_.branches_of(now_, start_branches_);
            return;
        }
        ++statistics_.switches;
        Eigen::Index which = 0;
        (void)step_.slack(now_, start_branches_, &which);
        const Branch from = start_branches_[which];
        if (traits().of_reactions() && from == Branch::inside) {
            Reaction lower = now_.reaction, upper = now_.reaction;
            inclusion().bounds(now_.t, now_.w, lower, upper);
            double& r = now_.reaction[which];
            const bool up = r - lower[which] > upper[which] - r;
            start_branches_[which] = up ? Branch::upper : Branch::lower;
            r = up ? upper[which] : lower[which];
            last_switch_ = {static_cast<std::size_t>(which), from, start_branches_[which]};
            return;
        }
        // Sliding has stopped: the contact sticks, or slides on in the other direction.
        zero_observed(which);
        try {
            now_.reaction = minimal_selection(step_.matrices(), now_.t, now_.w);
        } catch (const InclusionRefused&) {
            // There is no minimal selection: the solver's reaction is kept.
        }
        step_.branches_of(now_, start_branches_);
        last_switch_ = {static_cast<std::size_t>(which), from, start_branches_[which]};
    }

    /// Sets y to exactly zero for reaction `which`, and for the reactions whose y is zero up to
    /// rounding.
    void zero_observed(Eigen::Index which)
    {
        if (!traits().of_reactions()) return;
        const auto& m = step_.matrices();
        Reaction s, y;
        m.offset(now_.t, s);
        m.observed(now_.t, now_.w, y);
        const double rounding = 1e-14 * now_.w.template lpNorm<Eigen::Infinity>();
        for (Eigen::Index i = 0; i < y.size(); ++i) {
            if (i == which || std::abs(y[i]) <= rounding) m.hold(i, 0, s[i], now_.w);
        }
    }

    SetValuedOptions options_;
    AnyStep<N, M> step_;
    State now_, before_, trial_, half_;
    Vector error_;
    Vector rate_;
    Branches start_branches_, branches_before_, branches_after_;
    Switch last_switch_;
    SetValuedStatistics statistics_;
    StageReport failure_;
    Outcome outcome_ = Outcome::running;
    double h_ = 0;
    double h_min_ = 0;
    double scaled_error_ = 0;
    bool holds_length_ = true;
    bool locates_ = true;
    bool switched_ = false;
    Eigen::Index short_switches_ = 0;  // number of consecutive ones
};

template <class System>
using MotionOf =
    std::conditional_t<runs_exactly<System>, AnyMotion<state_size<System>, reaction_size<System>>,
                       PaddedMotion<state_size<System>, reaction_size<System>,
                                    solver_components<state_size<System>, reaction_size<System>>,
                                    solver_reactions<state_size<System>, reaction_size<System>>>>;

}  // namespace detail

/// Motion of a differential inclusion by implicit steps.
///
/// A step of length h from (w_n, r_n) solves for (w_n+1, r_n+1)
///
///     A w' = f(t, w) + G r,    y = E w - s(t),    -y in the normal cone of K at r
///
/// in the stages of Bathe's scheme. The step controller assesses it, and it is accepted or repeated
/// with another length. The reaction is part of the state, so that the same (t, w, r) and h give
/// the same bits.
template <Inclusion System>
class SetValuedMotion : public detail::MotionOf<System> {
    static_assert(!HasStaticBound<System>,
                  "ricochet: found static_bound in an inclusion that is to be followed by "
                  "set-valued steps, which know of none; expected hand_over or integrate");

public:
    /// Starts with the minimal selection. Debug builds test the projection of the first set.
    /// @throws std::invalid_argument for invalid options, systems and initial
    /// states.
    SetValuedMotion(const System& system, const StateOf<System>& w0,
                    const SetValuedOptions& options)
        : detail::MotionOf<System>(detail::solver_inclusion(system), w0, options)
    {
    }
};

}  // namespace ricochet

#if !RICOCHET_ALIGNED_AS_LIBRARY
#include "ricochet/nonsmooth/solvers.hpp"
#endif
