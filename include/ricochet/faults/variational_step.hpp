// Implicit steps of a block with rate-and-state friction, each stage the stationary point
// of an incremental potential.
//
//     m x'' = k (x_p(t) - x) - N f(x', xi),      xi' = xi'(x', xi)
//
// The methods are singly diagonally implicit Runge-Kutta methods, L-stable and stiffly accurate:
// every stage is one step of backward Euler from a shifted history, so that the properties of the
// variational step of order 1 hold for all of them.
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <cstddef>

#include "ricochet/faults/friction_stage.hpp"
#include "ricochet/faults/incremental.hpp"

namespace ricochet {

/// State of a block.
struct SliderState {
    double t = 0;   ///< [s]
    double x = 0;   ///< [m]
    double v = 0;   ///< [m/s]
    double xi = 0;  ///< log(V* theta / D_RS)
};

/// x_p(t) [m].
template <class Load>
concept LoadPath = requires(const Load& load, double t)
{
    {
        load(t)
        } -> std::convertible_to<double>;
};

/// Counts and residuals of one step.
struct StepReport {
    int iterations = 0;       ///< of all stages
    int most_iterations = 0;  ///< of one stage
    int unsolved = 0;         ///< number of unsolved stages
    int not_convex = 0;       ///< number of stages that are not convex
    double residual = 0;      ///< largest of all stages
    SliderState error{};      ///< estimate, by a method of lower order (none for order 1)
    /// Whether every stage has been solved.
    [[nodiscard]] bool solved() const noexcept { return unsolved == 0; }
};

namespace detail {

/// A table of at most five stages; the last row is the step.
struct SdirkTable {
    std::size_t stages;
    double gamma;
    std::array<std::array<double, 5>, 5> a;  ///< below the diagonal
    std::array<double, 5> c;
    std::array<double, 5> error;  ///< b - b of the lower order
};

/// Backward Euler; gamma = 1 - 1/sqrt(2) (R. Alexander, SIAM Journal on Numerical Analysis
/// 14, 1977); order 4 with five stages (E. Hairer and G. Wanner, Solving Ordinary
/// Differential Equations II, 2nd edition, table IV.6.5).
/// @throws std::invalid_argument unless the order is 1, 2 or 4.
[[nodiscard]] const SdirkTable& sdirk_table(int order);

/// @throws std::invalid_argument unless h is positive and finite.
void require_step(double h);

}  // namespace detail

/// Steps of one block.
template <EliminableLaw Law>
class VariationalStep {
public:
    /// @param order  1, 2 or 4
    /// @throws std::invalid_argument for another order or a block outside its range.
    VariationalStep(const Law& law, const SpringBlock& block, int order)
        : law_(law), block_(block), table_(&detail::sdirk_table(order))
    {
        validate(block);
    }

    [[nodiscard]] const Law& law() const noexcept { return law_; }
    [[nodiscard]] const SpringBlock& block() const noexcept { return block_; }

    /// The state after a step of h [s] under the load, in place.
    /// @throws std::invalid_argument unless h > 0.
    template <LoadPath Load>
    StepReport take(SliderState& state, double h, const Load& load) const
    {
        detail::require_step(h);
        const double own = table_->gamma * h;  // length of a stage
        const StateElimination<Law> eliminate(law_, own);
        std::array<double, 5> v, acceleration, rate;
        StepReport report;
        StageEquation e{.c = block_.mass / own + block_.stiffness * own,
                        .normal_force = block_.normal_force};
        SliderState now = state;
        for (std::size_t i = 0; i < table_->stages; ++i) {
            double x_before = 0;
            double v_before = 0;
            double xi_before = 0;
            for (std::size_t j = 0; j < i; ++j) {
                x_before += table_->a[i][j] * v[j];
                v_before += table_->a[i][j] * acceleration[j];
                xi_before += table_->a[i][j] * rate[j];
            }
            x_before = state.x + h * x_before;
            v_before = state.v + h * v_before;
            e.xi = state.xi + h * xi_before;
            e.force = block_.mass / own * v_before +
                      block_.stiffness * (load(state.t + table_->c[i] * h) - x_before);
            const StageSolution s = solve_stage(eliminate, e, now.v);
            now.v = s.v;
            now.xi = s.xi;
            now.x = x_before + own * s.v;
            v[i] = s.v;
            acceleration[i] = (s.v - v_before) / own;
            rate[i] = (s.xi - e.xi) / own;
            note(s.report, report);
        }
        for (std::size_t i = 0; i < table_->stages; ++i) {
            report.error.x += h * table_->error[i] * v[i];
            report.error.v += h * table_->error[i] * acceleration[i];
            report.error.xi += h * table_->error[i] * rate[i];
        }
        now.t = state.t + h;
        state = now;
        return report;
    }

private:
    static void note(const FrictionStageReport& stage, StepReport& step) noexcept
    {
        step.iterations += stage.iterations;
        step.most_iterations = std::max(step.most_iterations, stage.iterations);
        step.unsolved += !stage.solved;
        step.not_convex += !stage.convex;
        step.residual = std::max(step.residual, stage.residual);
    }

    Law law_;
    SpringBlock block_;
    const detail::SdirkTable* table_;
};

}  // namespace ricochet
