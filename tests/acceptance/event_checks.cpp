// Acceptance checks of the semantics of events.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/sensitivity/sensitivities.hpp"

namespace ricochet::bench {

namespace {

/// Derivatives of the impact times of B1 by height, speed and restitution, against those of
///
///     t_n = t0 (1 + 2 (r + r² + ... + r^(n-1))),  t0 = (v + sqrt(v² + 2 g height)) / g
///
/// at v = 0; the speeds of the impacts are r^k times that of the first.
Measured differentiate_impacts()
{
    const BallProblem problem = b1();
    const BouncingBall& ball = problem.system;
    const double r = ball.restitution();
    const double g = ball.gravity();
    const double height = problem.x0[0];
    const double t0 = ball.first_impact(height);
    const auto derivatives = sensitivities(
        ball, problem.x0,
        {.parameters = {{.with =
                             [=](double restitution) {
                                 return BouncingBall({.gravity = g, .restitution = restitution});
                             },
                         .nominal = r}}},
        {.t_end = problem.t_end, .rtol = 1e-13, .atol = 1e-13});
    double error = 0;
    double power = 1;  // r^n
    double sum = 0;    // r + r² + ... + r^n
    double slope = 0;  // 1 + 2 r + ... + n r^(n-1)
    for (std::size_t n = 0; n < derivatives.events.size(); ++n) {
        const auto& dt = derivatives.events[n].dt;
        const std::array exact{t0 * (1 + 2 * sum) / (2 * height), 1 / g, 2 * t0 * slope};
        for (Eigen::Index i = 0; i < 3; ++i) {
            const double size = std::max(std::fabs(exact[static_cast<std::size_t>(i)]), 1e-3);
            error = std::max(error, std::fabs(dt[i] - exact[static_cast<std::size_t>(i)]) / size);
        }
        slope += static_cast<double>(n + 1) * power;
        power *= r;
        sum += power;
    }
    const bool all = derivatives.events.size() == problem.events.size();
    return {.pass = all && error <= 1e-10,
            .text = fmt::format("{} impacts, largest relative error {:.1e}",
                                derivatives.events.size(), error)};
}

}  // namespace

std::vector<Check> event_checks()
{
    return {
        {.topic = "events",
         .id = "systems",
         .sentence = "every problem with a known solution: missed, spurious, order, times",
         .target = "0 missed, 0 spurious, right order, times to 1e-12 where the reference allows",
         .run = compare_systems},
        {.topic = "events",
         .id = "near-tangent",
         .sentence = "D2, 2000 random phases a depth, fehlberg78 rtol 1e-14, extremum",
         .target = "100 % of both crossings above twice the band, 0 invented",
         .run = find_near_tangent_pairs},
        {.topic = "events",
         .id = "identical-balls",
         .sentence = "2 and 1000 bit-identical balls",
         .target = "nobody lost, the same bits",
         .run = drop_identical_balls},
        {.topic = "events",
         .id = "long-bounce",
         .sentence = "balls of restitution 0, 0.1, 0.5, 0.9, 0.99, 1 for 1e7 s",
         .target = "none below the floor, energy never grows by more than 4 ulp a bounce",
         .run = bounce_for_ever},
        {.topic = "events",
         .id = "elastic-energy",
         .sentence = "an elastic ball over 1e6 bounces",
         .target = "<= 4 ulp a bounce, drift <= 1e-10",
         .run = keep_elastic_energy},
        {.topic = "events",
         .id = "any-order",
         .sentence = "guards in another order",
         .target = "the same bits",
         .run = reorder_guards},
        {.topic = "events",
         .id = "save-restore",
         .sentence = "saved and restored at 100 random points of 8 systems",
         .target = "the same bits",
         .run = restore_anywhere},
        {.topic = "events",
         .id = "impacts-1e-8",
         .sentence = "impact oscillator, wall 1.2, 200 impacts, largest error of a time 1e-8",
         .target = "<= 1 ms",
         .run = time_impacts_to_1e8},
        {.topic = "events",
         .id = "impacts-1e-12",
         .sentence = "the same, largest error 1e-12",
         .target = "<= 2.5 ms",
         .run = [] { return time_impacts_to_1e12(2.5e-3); }},
        {.topic = "events",
         .id = "impacts-1e-12-wish",
         .sentence = "the same, largest error 1e-12",
         .target = "1 ms",
         .run = [] { return time_impacts_to_1e12(1e-3); },
         .required = false},
        {.topic = "events",
         .id = "impacts-curve",
         .sentence = "the same at four errors, beside odeint by hand",
         .target = "faster at equal error",
         .run = compare_impacts},
        {.topic = "events",
         .id = "impacts-long",
         .sentence = "O1 at w = 0.8 over 1000 periods, error 1e-12",
         .target = "printed; a Taylor integrator: 420 to 560 ns a unit of time",
         .run = time_long_impacts},
        {.topic = "events",
         .id = "recorded-crossings",
         .sentence = "N oscillators whose crossings are only recorded, time over that without",
         .target = "<= 1.3 at N = 1, <= 2 at N = 10 to 1000",
         .run = time_recorded_crossings},
        {.topic = "events",
         .id = "idle-guard",
         .sentence = "a guard that never fires, dopri5 on the pendulum",
         .target = "<= 5 % for ends, <= 15 % for extremum",
         .run = time_idle_guard},
        {.topic = "events",
         .id = "idle-guards",
         .sentence = "100 guards that never fire, from one function",
         .target = "<= 2 times the loop for ends",
         .run = time_hundred_idle_guards},
        {.topic = "events",
         .id = "derivatives",
         .sentence = "derivatives of B1's impact times by height, speed, restitution",
         .target = "<= 1e-10 relative to the closed form",
         .run = differentiate_impacts},
        {.topic = "events",
         .id = "random-systems",
         .sentence = "100000 random hybrid systems against their closed forms",
         .target = "0 missed, 0 spurious, 0 misplaced, 0 that depend on the order",
         .run = check_random_systems},
    };
}

}  // namespace ricochet::bench
