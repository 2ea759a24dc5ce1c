#include "ricochet/systems/bouncing_ball.hpp"

#include <array>

#include "entries.hpp"
#include "run_system.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t { gravity, restitution, height, velocity };  // the order of parameters

BouncingBall ball(const std::vector<double>& p)
{
    return BouncingBall({.gravity = p[gravity], .restitution = p[restitution]});
}

std::vector<double> start(const std::vector<double>& p)
{
    return {p[height], p[velocity]};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    const std::vector<double>& p = settings.parameters;
    return run_system(ball(p), BouncingBall::State{p[height], p[velocity]}, settings, repeats);
}

std::vector<double> exact_events(const std::vector<double>& p, double t_end)
{
    const BouncingBall system = ball(p);
    std::vector<double> times;
    constexpr int most = 1000;  // an accumulation of impacts has no end
    for (int n = 0; n < most; ++n) {
        const double t = system.impact_time(n, p[height], p[velocity]);
        if (t > t_end) break;
        times.push_back(t);
    }
    return times;
}

constexpr std::string_view source =
    "Saunders, Steyer and Kuether, Machine learning for event detection in non-smooth initial "
    "value problems, SAND2023-06682C, table 1";

std::vector<Published> published()
{
    return {{.name = "paper: network",
             .source = source,
             .times = {1.427843122926641, 3.997960744196168, 6.311066603338677, 8.392861876565325,
                       10.266477622465255, 11.952731793775415, 13.470360547954783,
                       14.836226426716886, 16.065505717603227, 17.171857079401377,
                       18.167573305020159, 19.063717908075276, 19.870248050826223}},
            {.name = "paper: simple approach (ode45)",
             .source = source,
             .times = {1.427843122927093, 3.997960744195887, 6.311066603337761, 8.392861876565391,
                       10.266477622470353, 11.952731793784908, 13.470360547967886,
                       14.836226426732534, 16.065505717620926, 17.171857079420576,
                       18.167573305040214, 19.063717908097843, 19.870248050849643}}};
}

}  // namespace

SystemEntry bouncing_ball_entry()
{
    return {
        .name = "bouncing-ball",
        .description =
            "A point mass falls onto a rigid floor and bounces, losing speed at every "
            "impact.",
        .source =
            "Saunders, Steyer and Kuether, Machine learning for event detection in "
            "non-smooth initial value problems, SAND2023-06682C, eqs. 1 and 2",
        .parameters =
            {{.name = "gravity",
              .initial = 9.81,
              .unit = "m/s²",
              .range = {.lower = 0},
              .meaning = "acceleration downward"},
             {.name = "restitution",
              .initial = 0.9,
              .unit = "1",
              .range = {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
              .meaning = "Newton's coefficient, speed after over speed before"},
             {.name = "height",
              .initial = 10,
              .unit = "m",
              .range = {.lower = 0, .lower_included = true},
              .meaning = "at the start, above the floor"},
             {.name = "velocity",
              .initial = 0,
              .unit = "m/s",
              .range = {},
              .meaning = "at the start, upward"}},
        .state = {{.name = "u", .unit = "m", .meaning = "height"},
                  {.name = "v", .unit = "m/s", .meaning = "velocity"}},
        .guards = {{.name = "floor", .event = "impact"}},
        .t_end = 20.5,
        .start = start,
        .run = run,
        .series = has_series<BouncingBall>,
        .models = {{.file = "bouncing-ball-step-0.01.safetensors",
                    .kind = "fixed-step",
                    .any_step = false},
                   {.file = "bouncing-ball.safetensors", .kind = "any-step", .any_step = true}},
        .line = "u/(g h²) + v/(g h) <= 1/2",
        .exact_events = exact_events,
        .published = published(),
        .comparison_step = 0.01,
    };
}

}  // namespace ricochet::app
