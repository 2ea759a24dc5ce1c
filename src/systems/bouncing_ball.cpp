#include "ricochet/systems/bouncing_ball.hpp"

#include <cmath>
#include <span>
#include <vector>

#include "base/require.hpp"
#include "ricochet/systems/descriptor.hpp"

namespace ricochet {

BouncingBall::BouncingBall(const Parameters& parameters)
    : gravity_(parameters.gravity), restitution_(parameters.restitution)
{
    constexpr detail::Require require{"BouncingBall"};
    require(gravity_ > 0 && std::isfinite(gravity_), "gravity must be positive and finite [m/s2]",
            gravity_);
    require(restitution_ >= 0 && restitution_ <= 1, "restitution must lie in [0, 1]", restitution_);
}

double BouncingBall::first_impact(double height, double velocity) const noexcept
{
    const double speed = std::sqrt(velocity * velocity + 2 * gravity_ * height);
    // Of the two forms of the root, the one without cancellation.
    return velocity >= 0 ? (velocity + speed) / gravity_ : 2 * height / (speed - velocity);
}

double BouncingBall::impact_time(int n, double height, double velocity) const noexcept
{
    // In long double, so that the sum is a reference for runs in double.
    const long double g = gravity_;
    const long double v = velocity;
    const long double speed = std::sqrt(v * v + 2 * g * height);
    long double flight = 2 * speed / g;
    long double t = velocity >= 0 ? (v + speed) / g : 2 * height / (speed - v);
    for (int i = 0; i < n; ++i) {
        flight *= restitution_;
        t += flight;
    }
    return static_cast<double>(t);
}

double BouncingBall::zeno_time(double height, double velocity) const noexcept
{
    const double speed = std::sqrt(velocity * velocity + 2 * gravity_ * height);
    return first_impact(height, velocity) +
           2 * speed / gravity_ * restitution_ / (1 - restitution_);
}

// Long: one list of what the system consists of.
const SystemDescriptor& BouncingBall::descriptor()
{
    using Numbers = std::span<const double>;
    static const SystemDescriptor all{
        .name = name,
        .type = "BouncingBall",
        .description =
            "A point mass falls onto a rigid floor and bounces, losing speed at every impact.",
        .source =
            "Saunders, Steyer and Kuether, Machine learning for event detection in "
            "non-smooth initial value problems, SAND2023-06682C, eqs. 1 and 2",
        .equations = {"u'' = -gravity while u >= 0",
                      "impact at u = 0: v+ = -restitution v; at rest after infinitely many"},
        .parameters =
            {{.name = "gravity",
              .initial = Parameters{}.gravity,
              .unit = "m/s²",
              .range = {.lower = 0},
              .meaning = "acceleration downward"},
             {.name = "restitution",
              .initial = Parameters{}.restitution,
              .unit = "1",
              .range = {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
              .meaning = "Newton's coefficient, speed after over speed before"}},
        .state = {{.name = "u",
                   .unit = "m",
                   .meaning = "height",
                   .title = "height",
                   .start = 10,
                   .start_meaning = "at the start, above the floor",
                   .start_range = {.lower = 0, .lower_included = true}},
                  {.name = "v",
                   .unit = "m/s",
                   .meaning = "velocity",
                   .title = "velocity",
                   .start_meaning = "at the start, upward"}},
        .events = {"impact"},
        .guard_name = "floor",
        .t_end = 20.5,
        .comparison_step = 0.01,
        .known = {{.name = "impact_time",
                   .meaning = "Time [s] of impact n = 0, 1, 2, ...",
                   .arguments = {{.name = "n", .whole = true},
                                 {.name = "height"},
                                 {.name = "velocity", .initial = 0}},
                   .values =
                       [](Numbers p, Numbers a) {
                           const auto ball = with_parameters<BouncingBall>(p);
                           return std::vector{ball.impact_time(static_cast<int>(a[0]), a[1], a[2])};
                       }},
                  {.name = "zeno_time",
                   .meaning = "Limit [s] of the times of impact; infinite for restitution 1.",
                   .arguments = {{.name = "height"}, {.name = "velocity", .initial = 0}},
                   .values =
                       [](Numbers p, Numbers a) {
                           return std::vector{
                               with_parameters<BouncingBall>(p).zeno_time(a[0], a[1])};
                       }}},
        .event_times = [](Numbers p, Numbers x0, double t_end) {
            const auto ball = with_parameters<BouncingBall>(p);
            std::vector<double> times;
            constexpr int most = 1000;  // an accumulation of impacts has no end
            for (int n = 0; n < most; ++n) {
                const double t = ball.impact_time(n, x0[0], x0[1]);
                if (t > t_end) break;
                times.push_back(t);
            }
            return times;
        }};
    return all;
}

}  // namespace ricochet
