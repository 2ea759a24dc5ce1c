// Cost of locating an event: one flight of the ball that ends at its first impact, taken in one
// step, with and without location.
//
// A run of one step without an event is timed as well; the difference is the cost of location,
// without the reset, since the run stops there.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "problems.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/locators.hpp"
#include "ricochet/methods.hpp"
#include "timing.hpp"

namespace {

using namespace ricochet;

/// From (10, 0) over 2 s: the impact at sqrt(20 / 9.81) s lies inside.
template <class Method, class Locator>
void one_event(benchmark::State& state, double tolerance, const Locator& locator)
{
    const BouncingBall ball;
    const std::array<double, 2> x0{10, 0};
    const double exact = bench::b1().events.front();
    const Options options{.t_end = 2,
                          .step = 2,
                          .event_tolerance = tolerance,
                          .stop_at_event = true,
                          .record_events = false};
    const auto check = integrate(ball, x0, options, FixedStep<Method>{}, Ends{}, locator);
    const double error = std::fabs(check.t - exact);
    if (check.statistics.events != 1 || error > std::max(2 * tolerance, 1e-13)) {
        state.SkipWithError("the event was not found, or not where it is");
        return;
    }
    for (auto _ : state) {
        auto run = integrate(ball, x0, options, FixedStep<Method>{}, Ends{}, locator);
        bench::keep(run);
    }
    state.counters["event_error_s"] = error;
    state.counters["resteps"] = static_cast<double>(check.statistics.resteps);
    state.counters["guard_calls"] = static_cast<double>(check.statistics.guard_calls);
    state.counters["flow_calls"] = static_cast<double>(check.statistics.flow_calls);
}

/// The same step of a ball so high that there is nothing to locate.
template <class Method>
void no_event(benchmark::State& state)
{
    const BouncingBall ball;
    const std::array<double, 2> x0{1000, 0};
    const Options options{.t_end = 2, .step = 2, .stop_at_event = true, .record_events = false};
    for (auto _ : state) {
        auto run = integrate(ball, x0, options, FixedStep<Method>{}, Ends{});
        bench::keep(run);
    }
}

template <class Method>
void register_method(const std::string& method)
{
    using S = benchmark::State;
    const std::string ball_name = "/bouncing_ball/" + method + "/";

    const auto add = [](const std::string& name, auto body) {
        benchmark::RegisterBenchmark(name.c_str(), body);
    };
    add("locate_nothing" + ball_name + "one_step", [](S& s) { no_event<Method>(s); });
    for (const double tolerance : {0.0, 1e-10}) {
        const std::string setting = tolerance == 0 ? "/tol=0" : "/tol=1e-10";
        const auto with = [=](const std::string& name, const auto& locator) {
            add("locate_event" + ball_name + name + setting,
                [=](S& s) { one_event<Method>(s, tolerance, locator); });
        };
        with("newton", Newton{});
        with("toms748", Toms748{});
        with("bisection", Bisection{});
    }
}

}  // namespace

int main(int argc, char** argv)
{
    register_method<Rk4>("rk4");
    register_method<Dopri5>("dopri5");
    register_method<Fehlberg78>("fehlberg78");
    benchmark::Initialize(&argc, argv);
    if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
    benchmark::RunSpecifiedBenchmarks();
    benchmark::Shutdown();
    return 0;
}
