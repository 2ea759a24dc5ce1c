// Balls: many equal ones, balls of every restitution for a very long time, and the energy of
// an elastic one.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "clustered_systems.hpp"
#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::bench {

namespace {

using State = BouncingBall::State;

/// Whether balls with bitwise equal states bounce at the same instants, which are those of a single
/// ball.
template <class Stepping>
bool bounce_together(std::string_view method, std::size_t n, const Options& options,
                     const Stepping& stepping, std::vector<std::string>& details)
{
    const BallProblem problem = b1();
    const test::Balls balls{.balls = n, .gravity = 9.81, .restitution = 0.9};
    const auto run = integrate(balls, balls.drop(10), options, stepping);
    const std::size_t impacts = problem.events.size();
    std::vector<std::size_t> of_ball(n, 0);
    double error = 0;
    for (const auto& event : run.events) {
        const std::size_t k = of_ball[event.guard]++;
        const double exact = k < impacts ? problem.events[k] : options.t_end;
        error = std::max(error, std::fabs(event.t - exact));
    }
    const auto lost = static_cast<std::size_t>(
        std::count_if(of_ball.begin(), of_ball.end(), [=](std::size_t k) { return k != impacts; }));
    std::size_t other_bits = 0;
    for (std::size_t i = 1; i < n; ++i) {
        other_bits += run.x[2 * i] != run.x[0] || run.x[2 * i + 1] != run.x[1];
    }
    details.push_back(
        fmt::format("{:>5} balls, {:<18} {:>6} impacts, {} balls with another number than 13, {} "
                    "with other bits at the end, error {:.1e} s",
                    n, method, run.events.size(), lost, other_bits, error));
    return run.outcome == Outcome::reached_end && lost == 0 && other_bits == 0 && error <= 2e-13;
}

/// Steps a ball to `t_end` and watches its height at every step and after every impact.
struct Watched {
    Outcome outcome = Outcome::cancelled;
    double t = 0;
    double lowest = std::numeric_limits<double>::infinity();  ///< [m]
    double highest_energy = 0;                                ///< [m²/s²], at steps
    double energy = 0;                                        ///< at the end
    std::uint64_t impacts = 0;
};

double energy(const BouncingBall& ball, const State& x)
{
    return ball.gravity() * x[0] + x[1] * x[1] / 2;
}

Watched watch(double restitution, double t_end)
{
    const BouncingBall ball({.gravity = 9.81, .restitution = restitution});
    const Options options{.t_end = t_end, .record_events = false};
    Simulation<BouncingBall, State> simulation(ball, {1, 0}, options);
    Watched out;
    bool going = true;
    while (going) {
        going = simulation.step();
        out.lowest = std::min(out.lowest, simulation.x()[0]);
        out.highest_energy = std::max(out.highest_energy, energy(ball, simulation.x()));
    }
    out.impacts = simulation.run().statistics.events;
    out.outcome = simulation.run().outcome;
    const auto run = simulation.finish();
    out.t = run.t;
    out.energy = energy(ball, run.x);
    return out;
}

struct Drift {
    double relative = 0;      ///< of the energy after the last bounce
    double worst_bounce = 0;  ///< largest growth from one bounce to the next, in ulp
    std::uint64_t bounces = 0;
    bool reached = false;
};

/// The energy just after every bounce of an elastic ball.
Drift elastic(double h_max)
{
    constexpr std::uint64_t wanted = 1'000'000;
    const BouncingBall ball({.gravity = 9.81, .restitution = 1});
    const double flight = 2 * ball.first_impact(1);
    const Options options{.t_end = (static_cast<double>(wanted) + 1) * flight,
                          .h_max = h_max,
                          .record_events = false};
    Simulation<BouncingBall, State> simulation(ball, {1, 0}, options);
    const double start = 9.81;
    Drift drift;
    double last = start;
    while (drift.bounces < wanted && simulation.advance()) {
        const double now = energy(ball, simulation.x());
        const double ulp = std::nextafter(last, 2 * last) - last;
        drift.worst_bounce = std::max(drift.worst_bounce, (now - last) / ulp);
        last = now;
        ++drift.bounces;
    }
    drift.relative = (last - start) / start;
    drift.reached = drift.bounces == wanted;
    return drift;
}

std::string text(const Drift& drift)
{
    return fmt::format("drift {:+.1e}, at most {:.1f} ulp a bounce", drift.relative,
                       drift.worst_bounce);
}

}  // namespace

Measured drop_identical_balls()
{
    std::vector<std::string> details;
    bool pass = true;
    for (const std::size_t n : {2U, 1000U}) {
        const Options fixed{.t_end = 20.5, .step = 0.01};
        const Options controlled{.t_end = 20.5, .rtol = 1e-10, .atol = 1e-10};
        pass &= bounce_together("rk4 step 0.01", n, fixed, FixedStep<Rk4>{}, details);
        pass &=
            bounce_together("dopri5 rtol 1e-10", n, controlled, ErrorControlled<Dopri5>{}, details);
    }
    return {.pass = pass,
            .text = pass ? "nobody is lost, everyone has the same bits" : "see below",
            .details = std::move(details)};
}

Measured bounce_for_ever()
{
    constexpr double t_end = 1e7;  // [s]
    std::vector<std::string> details;
    bool pass = true;
    for (const double restitution : {0.0, 0.1, 0.5, 0.9, 0.99, 1.0}) {
        const Watched run = watch(restitution, t_end);
        const bool rests = restitution < 1;
        // Four units in the last place for every bounce.
        const double growth =
            4 * std::numeric_limits<double>::epsilon() * static_cast<double>(run.impacts);
        const bool good = run.outcome == Outcome::reached_end && run.t == t_end &&
                          run.lowest >= 0 && run.highest_energy <= 9.81 * (1 + growth) &&
                          (!rests || run.energy == 0);
        pass = pass && good;
        details.push_back(fmt::format(
            "restitution {:<4} {:>9} impacts, lowest height {:g} m, energy at the end {:.6g} of "
            "{:.6g}, at most {:+.1e} of it gained{}",
            restitution, run.impacts, run.lowest, run.energy, 9.81,
            (run.highest_energy - 9.81) / 9.81, good ? "" : "  WRONG"));
    }
    return {.pass = pass,
            .text = pass ? "all six reach 1e7 s, none below the floor, those below 1 at rest on it"
                         : "see below",
            .details = std::move(details)};
}

Measured keep_elastic_energy()
{
    const Drift held = elastic(0.2);
    const Drift free = elastic(std::numeric_limits<double>::infinity());
    return {
        .pass = held.reached && std::fabs(held.relative) <= 1e-10 && held.worst_bounce <= 4,
        .text =
            fmt::format("h_max = 0.2: {}; default, one step a flight: {}", text(held), text(free)),
        .details = {"The target is asked of h_max = 0.2 s; a step over a whole flight rounds at "
                    "the size of the whole parabola."}};
}

}  // namespace ricochet::bench
