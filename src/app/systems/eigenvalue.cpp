#include <algorithm>

#include "entries.hpp"
#include "labels.hpp"
#include "problems/least_eigenvalue.hpp"
#include "run_system.hpp"
#include "scenes.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t { level, amplitude, frequency, slow, seed, table };  // the order of parameters

}  // namespace

LeastEigenvalue eigenvalue_of(const std::vector<double>& p)
{
    return LeastEigenvalue({.level = p[level],
                            .amplitude = p[amplitude],
                            .frequency = p[frequency],
                            .slow = p[slow],
                            .seed = static_cast<std::uint64_t>(p[seed]),
                            .table = static_cast<std::size_t>(p[table])});
}

namespace {

std::vector<double> start(const std::vector<double>& p)
{
    const LeastEigenvalue::State q = eigenvalue_of(p).start();
    return {q.begin(), q.end()};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_system(eigenvalue_of(settings.parameters), start(settings.parameters), settings,
                      repeats);
}

}  // namespace

SystemEntry eigenvalue_entry()
{
    const LeastEigenvalue::Parameters d;
    return {
        .name = LeastEigenvalue::name,
        .description = "The smallest eigenvalue of a stiffness under four loads meets a level.",
        .parameters = {{"level", d.level, "1", {}, "of the eigenvalue"},
                       {"amplitude", d.amplitude, "1", {.lower = 0}, "of the loads"},
                       {"frequency", d.frequency, "rad/s", {.lower = 0}, "of the slowest load"},
                       {"slow",
                        d.slow,
                        "s",
                        {.lower = 0, .upper = 1, .lower_included = true, .upper_included = true},
                        "that a call of the guard takes longer"},
                       {"seed",
                        static_cast<double>(d.seed),
                        "1",
                        {.lower = 0, .lower_included = true},
                        "of the matrices"},
                       {"table",
                        static_cast<double>(d.table),
                        "1",
                        {.lower = 0, .upper = 48, .lower_included = true, .upper_included = true},
                        "cells along a load, for bounds of the value; 0: none"}},
        .state = {{"q0", "1", "load"},
                  {"q1", "1", "load"},
                  {"q2", "1", "load"},
                  {"q3", "1", "load"}},
        .guards = labels(LeastEigenvalue{}, {"level met"}),
        .t_end = 40,
        .start = start,
        .run = run,
    };
}

}  // namespace ricochet::app
