// One implicit stage of rate-and-state friction: the state is eliminated, then the slip rate
// is found.
//
// A stage of length h from slip rate and state before it has the equations
//
//     c V + N f(V, xi) = F,      xi = xi^ + h xi'(V, xi),
//
// with c > 0 and F from inertia and springs. The second is solved for xi for every V, in
// closed form for the ageing law; one equation in y = log(|V| / V*) remains, whose residual
// has opposite signs at the two ends, so that there is a solution for every h. It is the
// stationary point of an incremental potential (incremental.hpp), and the only one where
// the potential is convex. Where f is odd in V, V has the sign of F.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>

#include "ricochet/faults/detail/wright_omega.hpp"
#include "ricochet/faults/friction.hpp"

namespace ricochet {

/// Friction and state at the end of a stage as functions of y = log(|V|/V*).
struct StageResponse {
    double friction = 0, friction_y = 0;  ///< along the eliminated state, for V > 0
    double xi = 0, xi_y = 0;
};

/// Requirements of the elimination on a law: friction and rate with gradients, a rate that falls
/// with xi, and V*. (With the asinh form the rate of the slip law rises where V is below w and
/// V theta / D_RS below 1e-16; the state found there is one of several.)
template <class Law>
concept EliminableLaw = requires(const Law& law, double v, double xi)
{
    {
        law.gradient(v, xi)
        } -> std::same_as<FrictionAndRateGradient>;
    {
        law.parameters().v_star
        } -> std::convertible_to<double>;
    {
        Law::effect
        } -> std::convertible_to<DirectEffect>;
};

namespace detail {

/// The root of xi - before - h rate(v, xi), which lies between `before` and before +
/// h rate(v, before), since the rate falls with xi. Newton's method is kept in this interval.
template <class Law>
[[nodiscard]] double implicit_state(const Law& law, double h, double v, double before, double start)
{
    const double far = before + h * law.gradient(v, before).rate;
    double lower = std::min(before, far);
    double upper = std::max(before, far);
    double xi = std::clamp(start, lower, upper);
    for (int i = 0; i < 200; ++i) {
        const FrictionAndRateGradient g = law.gradient(v, xi);
        const double gap = xi - before - h * g.rate;
        const double step = -gap / (1 - h * g.rate_xi);
        (gap > 0 ? upper : lower) = xi;
        if (std::abs(step) <= 1e-15 * (1 + std::abs(xi))) return xi;
        const double next = xi + step;
        xi = next > lower && next < upper ? next : lower + (upper - lower) / 2;
        if (!(upper - lower > 1e-15 * (1 + std::abs(xi)))) return xi;
    }
    return xi;
}

template <class Law>
[[nodiscard]] StageResponse implicit_response(const Law& law, double h, double v, double before,
                                              double start)
{
    if constexpr (Law::effect == DirectEffect::log) {
        // Below the smallest double the log form is not defined.
        constexpr double none = std::numeric_limits<double>::quiet_NaN();
        if (!(v > 0)) return {none, none, none, none};
    }
    const double xi = implicit_state(law, h, v, before, start);
    const FrictionAndRateGradient g = law.gradient(v, xi);
    const double xi_y = v * h * g.rate_v / (1 - h * g.rate_xi);
    return {g.friction, v * g.friction_v + g.friction_xi * xi_y, xi, xi_y};
}

}  // namespace detail

/// Eliminates the state of a law over stages of length h [s].
template <EliminableLaw Law>
class StateElimination {
public:
    /// Keeps a reference to `law`. @param h  [s] length of the step
    StateElimination(const Law& law, double h) noexcept : law_(&law), h_(h) {}

    [[nodiscard]] const Law& law() const noexcept { return *law_; }
    [[nodiscard]] double v_star() const noexcept { return law_->parameters().v_star; }

    /// For V = V* e^y > 0, from the state `before`.
    [[nodiscard]] StageResponse operator()(double /*y*/, double v, double before) const
    {
        return detail::implicit_response(*law_, h_, v, before, before);
    }
    /// The state after a stage at rest, for a law that is odd in V.
    [[nodiscard]] double at_rest(double before) const
    {
        return detail::implicit_state(*law_, h_, 0, before, before);
    }

private:
    const Law* law_;
    double h_;
};

/// The ageing law, in closed form: with A = h V* / D_RS and B = xi^ - h V / D_RS
///
///     xi = B + A e^-xi = B + omega(log A - B),      dxi/dy = -(h V / D_RS) / (1 + omega).
template <DirectEffect effect>
class StateElimination<RateStateLaw<StateEvolution::ageing, effect>> {
public:
    using Law = RateStateLaw<StateEvolution::ageing, effect>;

    StateElimination(const Law& law, double h) noexcept
        : law_(&law),
          h_(h),
          per_slip_(h / law.parameters().d_rs),
          log_a_(std::log(per_slip_ * law.parameters().v_star)),
          a_(law.parameters().a),
          b_(law.parameters().b),
          f_star_(law.parameters().f_star)
    {
    }

    [[nodiscard]] const Law& law() const noexcept { return *law_; }
    [[nodiscard]] double v_star() const noexcept { return law_->parameters().v_star; }

    [[nodiscard]] StageResponse operator()(double y, double v, double before) const
    {
        const double drift = per_slip_ * v;
        const double rest = before - drift;
        const double omega = wright_omega(log_a_ - rest);
        // log(omega) = log A - xi does not cancel where omega is large.
        const double xi = omega < 4 ? rest + omega : log_a_ - std::log(omega);
        const double xi_y = -drift / (1 + omega);
        const double strength = f_star_ + b_ * xi;
        const double friction = strength + a_ * y;
        if constexpr (effect == DirectEffect::asinh) {
            // Otherwise w, in which the two forms differ, would matter: h w / D_RS > 1e-17.
            if (!(friction > 40 * a_ && strength > a_ * (40 + log_a_))) {
                return detail::implicit_response(*law_, h_, v, before, xi);
            }
        }
        return {friction, a_ + b_ * xi_y, xi, xi_y};
    }

    /// The state after a stage at rest.
    [[nodiscard]] double at_rest(double before) const
    {
        return before + wright_omega(log_a_ - before);
    }

private:
    const Law* law_;
    double h_, per_slip_, log_a_;
    double a_, b_, f_star_;
};

/// The equation of a stage.
struct StageEquation {
    double c = 0;             ///< [kg/s], positive
    double normal_force = 0;  ///< N [N], positive
    double force = 0;         ///< F [N]
    double xi = 0;            ///< xi^
};

/// How the solution of a stage ended.
struct FrictionStageReport {
    int iterations = 0;   ///< evaluations of friction and state
    double residual = 0;  ///< |c V + N f - F| over the sum of their sizes
    bool solved = false;
    bool convex = true;  ///< whether the incremental potential is convex at the solution
};

/// Slip rate, state and coefficient of friction at the end of a stage.
struct StageSolution {
    double v = 0, xi = 0, friction = 0;
    FrictionStageReport report{};
};

namespace detail {

/// Newton's method in y, kept between points of opposite signs; it bisects where Newton's step
/// leaves them or the slope is not positive.
class StageSearch {
public:
    StageSearch(double c, double y) noexcept : c_(c), y_(y) {}

    /// The step in y from a point with the residual `gap` and the slope dgap/dy, where
    /// the speed is v = V* e^y.
    [[nodiscard]] double step(double gap, double slope, double v, double v_star)
    {
        (gap < 0 ? lower_ : upper_) = y_;
        ++count_;
        double step = -gap / slope;
        const bool newton = slope > 0 && std::isfinite(step) && count_ % 16 != 0;
        newton_ = newton && y_ + step > lower_ && y_ + step < upper_;
        if (newton && step < -0.5 && c_ * v > slope / 2) {
            step = std::log1p(-std::min(-step, 1 - 1e-12));  // Newton's step in V, not in y
        }
        if (newton && step > 1) {
            // Friction that rises with V keeps the solution below v - gap / c.
            step = std::min(step, std::max(std::log((v - gap / c_) / v_star) - y_, 1.0));
        }
        if (newton && y_ + step > lower_ && y_ + step < upper_) return step;
        if (std::isfinite(lower_) && std::isfinite(upper_)) return (lower_ + upper_) / 2 - y_;
        stride_ *= 2;
        return gap < 0 ? stride_ : -stride_;
    }

    void move(double step) noexcept { y_ += step; }
    [[nodiscard]] double y() const noexcept { return y_; }
    /// Whether the last step was Newton's.
    [[nodiscard]] bool newton() const noexcept { return newton_; }
    [[nodiscard]] bool closed() const noexcept
    {
        return upper_ - lower_ <= 1e-14 * (1 + std::abs(y_));
    }

private:
    double c_, y_;
    double lower_ = -std::numeric_limits<double>::infinity();
    double upper_ = std::numeric_limits<double>::infinity();
    double stride_ = 1;
    int count_ = 0;
    bool newton_ = false;
};

}  // namespace detail

/// Limit of the search: bisection alone closes 2000 units of y to 1e-14 in 60 iterations.
inline constexpr int most_stage_iterations = 300;

/// Solves the equation of a stage for a force F > 0 (with the log form for any F), from
/// the guess y of log(V / V*), to 1e-13 in log V or to the rounding of the equation.
template <class Elimination>
[[nodiscard]] StageSolution solve_forward(const Elimination& eliminate, const StageEquation& e,
                                          double guess)
{
    detail::StageSearch search(e.c, guess);
    const double v_star = eliminate.v_star();
    StageSolution out;
    for (int i = 1; i <= most_stage_iterations; ++i) {
        const double v = v_star * std::exp(search.y());
        const StageResponse r = eliminate(search.y(), v, e.xi);
        if (std::isnan(r.friction)) return out;
        const double inertia = e.c * v;
        const double grip = e.normal_force * r.friction;
        const double gap = inertia + grip - e.force;
        const double slope = inertia + e.normal_force * r.friction_y;
        const double size = inertia + std::abs(grip) + std::abs(e.force);
        const double step = search.step(gap, slope, v, v_star);
        // A root at which the residual falls is a saddle of the potential, and is skipped.
        const bool flat = (slope > 0 && std::abs(gap) <= 4e-16 * size) || search.closed();
        // A Newton step this small leaves an error of its square, so it is added to first order.
        if (flat || (search.newton() && std::abs(step) <= 3e-8)) {
            const double last = flat ? 0 : step;
            out.v = v * (1 + last * (1 + last / 2));
            out.xi = r.xi + r.xi_y * last;
            out.friction = r.friction + r.friction_y * last;
            const double rest = e.c * out.v + e.normal_force * out.friction - e.force;
            out.report = {.iterations = i,
                          .residual = std::abs(rest) / size,
                          .solved = std::abs(rest) <= 1e-10 * size,
                          .convex = slope > 0};
            return out;
        }
        search.move(step);
        out = {v, r.xi, r.friction, {i, std::abs(gap) / size, false, slope > 0}};
    }
    return out;
}

/// Solves the equation of a stage, starting from the slip rate `v_guess`.
template <class Law>
[[nodiscard]] StageSolution solve_stage(const StateElimination<Law>& eliminate,
                                        const StageEquation& e, double v_guess)
{
    const double v_star = eliminate.v_star();
    if constexpr (Law::effect == DirectEffect::log) {
        const double y = v_guess > 0 ? std::log(v_guess / v_star) : -1;
        return solve_forward(eliminate, e, y);
    } else {
        if (e.force == 0) return {0, eliminate.at_rest(e.xi), 0, {0, 0, true, true}};
        const double sign = e.force < 0 ? -1 : 1;
        StageEquation forward = e;
        forward.force = std::abs(e.force);
        // Friction opposes V, which is therefore at most F / c.
        const double most = forward.force / e.c;
        const double guess = sign * v_guess > 0 ? std::min(sign * v_guess, most) : most;
        StageSolution out = solve_forward(eliminate, forward, std::log(guess / v_star));
        out.v *= sign;
        out.friction *= sign;
        return out;
    }
}

}  // namespace ricochet
