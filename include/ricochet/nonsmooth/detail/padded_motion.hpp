// Internal: the declarations of this header may change without notice.
//
// States and set-valued motions of a system of n components and m reactions whose solvers are
// those of N and M (any_inclusion.hpp).
#pragma once

#include <algorithm>
#include <optional>
#include <utility>

#include "ricochet/nonsmooth/composite_step.hpp"
#include "ricochet/nonsmooth/step_controllers.hpp"
#include "ricochet/run.hpp"

namespace ricochet {

struct SetValuedOptions;
struct SetValuedStatistics;

namespace detail {

template <int N, int M>
class RICOCHET_ALIGNED AnyMotion;

/// The first components of a vector, or the vector with zeros behind it.
template <int N, class V>
[[nodiscard]] auto resized(const V& v)
{
    using Scalar = typename V::Scalar;
    if constexpr (N == V::RowsAtCompileTime) {
        return v;
    } else {
        constexpr int common = std::min<int>(N, V::RowsAtCompileTime);
        Eigen::Matrix<Scalar, N, 1> out = Eigen::Matrix<Scalar, N, 1>::Constant(Scalar{});
        out.template head<common>() = v.template head<common>();
        return out;
    }
}

template <int N, int M, int n, int m>
[[nodiscard]] StateWithReaction<N, M> resized(const StateWithReaction<n, m>& from)
{
    return {from.t, resized<N>(from.w), resized<M>(from.reaction)};
}

/// Steps from states of the system.
template <int n, int m, int N, int M>
class PaddedStep {
public:
    using State = StateWithReaction<n, m>;
    using Branches = BranchesOf<m>;

    explicit PaddedStep(AnyStep<N, M>& step) : step_(step) {}

    [[nodiscard]] StageReport take(const State& from, double h, State& to)
    {
        auto there = resized<N, M>(from);
        const StageReport report = step_.take(resized<N, M>(from), h, there);
        to = resized<n, m>(there);
        return report;
    }
    [[nodiscard]] State middle() const { return resized<n, m>(step_.middle()); }
    void branches_of(const State& state, Branches& branches)
    {
        auto all = resized<M>(branches);
        step_.branches_of(resized<N, M>(state), all);
        branches = resized<m>(all);
    }

private:
    AnyStep<N, M>& step_;
};

/// `AnyMotion` of a system of n components and m reactions.
template <int n, int m, int N, int M>
class RICOCHET_ALIGNED PaddedMotion {
    using Motion = AnyMotion<N, M>;

public:
    using Vector = Eigen::Matrix<double, n, 1>;
    using Reaction = Eigen::Matrix<double, m, 1>;
    using State = StateWithReaction<n, m>;
    using Branches = BranchesOf<m>;
    using Switch = typename Motion::Switch;

    PaddedMotion(const AnyInclusion<N, M>& inclusion, const Vector& w0,
                 const SetValuedOptions& options)
        : motion_(inclusion, resized<N>(w0), options)
    {
        refresh();
    }

    void restart(double t, const Vector& w)
    {
        motion_.restart(t, resized<N>(w));
        refresh();
    }
    void restart(const State& state)
    {
        motion_.restart(resized<N, M>(state));
        refresh();
    }

    [[nodiscard]] const State& state() const noexcept { return now_; }
    [[nodiscard]] const State& before() const noexcept { return before_; }
    [[nodiscard]] const State& middle() const noexcept { return middle_; }
    [[nodiscard]] const Branches& branches() const noexcept { return branches_; }
    [[nodiscard]] const SetValuedStatistics& statistics() const noexcept
    {
        return motion_.statistics();
    }
    [[nodiscard]] Outcome outcome() const noexcept { return motion_.outcome(); }
    [[nodiscard]] const StageReport& failure() const noexcept { return motion_.failure(); }
    [[nodiscard]] double next_step() const noexcept { return motion_.next_step(); }
    void next_step(double h) noexcept { motion_.next_step(h); }
    [[nodiscard]] double error() const noexcept { return motion_.error(); }
    [[nodiscard]] const StepController& controller() const noexcept { return motion_.controller(); }
    void locate_switches(bool locate) noexcept { motion_.locate_switches(locate); }
    [[nodiscard]] const Switch& last_switch() const noexcept { return motion_.last_switch(); }
    [[nodiscard]] PaddedStep<n, m, N, M> stepper() noexcept
    {
        return PaddedStep<n, m, N, M>(motion_.stepper());
    }

    Outcome advance()
    {
        const Outcome outcome = motion_.advance();
        refresh();
        return outcome;
    }

    template <class Observer>
    Outcome run(const Observer& observer)
    {
        observer(std::as_const(now_));
        while (advance() == Outcome::running) observer(std::as_const(now_));
        if (outcome() == Outcome::reached_end) observer(std::as_const(now_));
        return outcome();
    }
    Outcome run()
    {
        const Outcome outcome = motion_.run();
        refresh();
        return outcome;
    }

    template <class Function>
    [[nodiscard]] std::optional<State> locate(const Function& g, double tolerance = 0)
    {
        const auto at =
            motion_.locate([&](const auto& state) { return g(resized<n, m>(state)); }, tolerance);
        if (!at) return std::nullopt;
        return resized<n, m>(*at);
    }

private:
    void refresh()
    {
        now_ = resized<n, m>(motion_.state());
        before_ = resized<n, m>(motion_.before());
        middle_ = resized<n, m>(motion_.middle());
        branches_ = resized<m>(motion_.branches());
    }

    Motion motion_;
    State now_, before_, middle_;
    Branches branches_;
};

}  // namespace detail

}  // namespace ricochet
