// Balls that bounce for very long, and quantities of every size.
#include <fmt/format.h>

#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/stick_slip.hpp"
#include "stress.hpp"

namespace ricochet::stress {

namespace {

using Two = std::array<double, 2>;

/// A ball whose restitution is e - loss |v|^(1/5), the law of a viscoelastic sphere to first order
/// (W. Goldsmith, Impact, Edward Arnold, 1960).
struct LawfulBall {
    using State = Two;
    static constexpr bool unilateral = true;
    double gravity = 1;
    double e = 1;
    double loss = 0;

    [[nodiscard]] double rebound(double v) const
    {
        const double factor = loss == 0 ? e : e - loss * std::pow(std::fabs(v), 0.2);
        return -factor * v;
    }
    void flow(double /*t*/, const Two& x, Two& dxdt) const { dxdt = {x[1], -gravity}; }
    [[nodiscard]] double guard(double /*t*/, const Two& x) const { return x[0]; }
    [[nodiscard]] double guard_rate(double /*t*/, const Two& /*x*/, const Two& dxdt) const
    {
        return dxdt[0];
    }
    void reset(double /*t*/, Two& x) const { x = {0, rebound(x[1])}; }
};

void bounce(Tally& tally, const LawfulBall& ball, std::uint64_t wanted)
{
    // A flight takes 2 v / g and ends with the velocity that it began with: the times are summed
    // in long double. Each flight is a step or two, and adds a few units in the last place of the
    // velocity; under a constant law an error of one flight is carried to all later ones, so
    // the errors grow at most as the number of bounces.
    // Without an end: against such a span every motion stands still.
    const Options options{
        .t_end = 1e300, .rtol = 1e-10, .atol = 1e-14, .record_events = false, .stall_steps = 0};
    Simulation<LawfulBall, Two> simulation(ball, Two{0.5, 0}, options);
    long double t = std::sqrt(1 / static_cast<long double>(ball.gravity));
    double v = -std::sqrt(ball.gravity);
    std::uint64_t n = 0;
    bool above = true;
    for (; n < wanted && simulation.advance(); ++n) {
        above = above && simulation.x()[0] >= 0;
        if (n > 0) t += 2 * static_cast<long double>(-v) / ball.gravity;
        // The law is evaluated at the exact velocity, not the computed one.
        if (n + 1 < wanted) v = -ball.rebound(v);
    }
    const double growth = 8 * 2.3e-16 * static_cast<double>(wanted);
    const double time_error =
        std::fabs(static_cast<double>((static_cast<long double>(simulation.t()) - t) / t));
    const double last = ball.rebound(v);
    const double speed_error = std::fabs(simulation.x()[1] - last) / std::fabs(last);
    tally.expect(n == wanted && above && time_error <= growth && speed_error <= growth, [&] {
        return fmt::format(
            "e = {}, loss = {}: {} of {} bounces, {}, relative errors {:.1e} of the "
            "time, {:.1e} of the velocity",
            ball.e, ball.loss, n, wanted, above ? "above" : "below the floor", time_error,
            speed_error);
    });
    tally.said = fmt::format("{} bounces each", wanted);
}

/// A ball of 13 impacts in other units of length and time.
void scaled_ball(Tally& tally, double length, double time, bool fixed)
{
    const double gravity = 9.81 * length / time / time;
    if (!std::isfinite(gravity) || gravity < 1e-290) return;
    const BouncingBall ball({.gravity = gravity, .restitution = 0.9});
    Options options{.t_end = 20.5 * time, .rtol = 1e-10, .atol = 0};
    // Errors are measured in the units of the problem.
    options.component_atol = {1e-10 * length, 1e-10 * length / time};
    if (fixed) options.step = 0.01 * time;
    const auto run = fixed ? integrate(ball, Two{10 * length, 0}, options, FixedStep<Rk4>{})
                           : integrate(ball, Two{10 * length, 0}, options);
    double error = 0;
    for (std::size_t k = 0; k < run.events.size() && k < 13; ++k) {
        const double exact = ball.impact_time(static_cast<int>(k), 10 * length, 0);
        error = std::max(error, std::fabs(run.events[k].t - exact) / exact);
    }
    tally.expect(run.outcome == Outcome::reached_end && run.events.size() == 13 && error <= 1e-12,
                 [&] {
                     return fmt::format("length {:g}, time {:g}, {}: {}, {} impacts, error {:.1e}",
                                        length, time, fixed ? "rk4" : "dopri5", name(run.outcome),
                                        run.events.size(), error);
                 });
}

/// Mass, stiffness and friction scaled by the same factor: the same motion.
void scaled_mass(Tally& tally, double mass)
{
    const StickSlip system({.mass = mass, .stiffness = mass, .friction = mass});
    const auto run = integrate(system, StickSlip::start,
                               {.t_end = 2.2 * StickSlip::period, .rtol = 1e-12, .atol = 1e-12},
                               ErrorControlled<Fehlberg78>{});
    // Stick, slip, stick, slip.
    double error = 1;
    if (run.events.size() == 4) {
        error = std::max(std::fabs(run.events[0].t - StickSlip::stick_time),
                         std::fabs(run.events[3].t - 2 * StickSlip::period));
    }
    tally.expect(run.outcome == Outcome::reached_end && error <= 1e-9, [&] {
        return fmt::format("mass {:g}: {}, {} events, error {:.1e}", mass, name(run.outcome),
                           run.events.size(), error);
    });
}

/// An impact in the middle of a hundred tiny steps, or of one huge step.
template <class Detector>
void scaled_step(Tally& tally, double step, const Detector& detector, std::string_view detected)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = 0.9});
    if (step >= 1e-2) {
        const auto run =
            integrate(ball, Two{10, 0}, {.t_end = 20.5, .step = step}, FixedStep<Rk4>{}, detector);
        double error = 0;
        for (std::size_t k = 0; k < run.events.size() && k < 13; ++k) {
            error = std::max(
                error, std::fabs(run.events[k].t - ball.impact_time(static_cast<int>(k), 10, 0)));
        }
        tally.expect(run.events.size() == 13 && error <= 1e-12, [&] {
            return fmt::format("step {:g}, {}: {} impacts, error {:.1e}", step, detected,
                               run.events.size(), error);
        });
        return;
    }
    const double height = 50.5 * step;
    const auto run = integrate(ball, Two{height, -1}, {.t_end = 100 * step, .step = step},
                               FixedStep<Rk4>{}, detector);
    // t = (sqrt(v² + 2 g h) - v) / g without cancellation; the position has an error of a few
    // units in the last place of the height.
    const double exact = 2 * height / (1 + std::sqrt(1 + 2 * 9.81 * height));
    const double error = run.events.size() == 1 ? std::fabs(run.events[0].t - exact) / exact : 1;
    tally.expect(error <= 1e-12, [&] {
        return fmt::format("step {:g}, {}: {} impacts, relative error {:.1e}", step, detected,
                           run.events.size(), error);
    });
}

}  // namespace

Tally bounces(const Size& size)
{
    Tally tally;
    const std::uint64_t wanted = size.cases(20'000, 100'000'000);
    bounce(tally, {.e = 1}, wanted);
    bounce(tally, {.gravity = 9.81, .e = 1}, wanted);
    // The remaining speed after all of them is above the least speed of a rebound.
    bounce(tally, {.e = 1 - 2.0 / static_cast<double>(wanted)}, wanted);
    bounce(tally, {.e = 1, .loss = 1e-9}, std::min<std::uint64_t>(wanted, 10'000'000));
    return tally;
}

Tally scales(const Size& size)
{
    Tally tally;
    const int every = size.long_form ? 1 : 3;
    for (int time = -15; time <= 15; time += every) {
        for (int length = -8; length <= 8; length += every == 1 ? 1 : 4) {
            for (const bool fixed : {false, true}) {
                scaled_ball(tally, std::pow(10.0, length), std::pow(10.0, time), fixed);
            }
        }
    }
    for (int mass = -8; mass <= 8; mass += every) scaled_mass(tally, std::pow(10.0, mass));
    for (int step = -12; step <= 6; ++step) {
        scaled_step(tally, std::pow(10.0, step), Ends{}, "ends");
        scaled_step(tally, std::pow(10.0, step), Extremum{}, "extremum");
    }
    return tally;
}

}  // namespace ricochet::stress
