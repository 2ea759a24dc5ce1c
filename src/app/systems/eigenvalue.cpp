#include <algorithm>

#include "../any_system.hpp"
#include "../model_lookup.hpp"
#include "entries.hpp"
#include "problems/least_eigenvalue.hpp"

namespace ricochet::app {

namespace {

enum : std::size_t { level, amplitude, frequency, slow, seed, table };  // the order of parameters

LeastEigenvalue system(const std::vector<double>& p)
{
    return LeastEigenvalue({.level = p[level],
                            .amplitude = p[amplitude],
                            .frequency = p[frequency],
                            .slow = p[slow],
                            .seed = static_cast<std::uint64_t>(p[seed]),
                            .table = static_cast<std::size_t>(p[table])});
}

std::vector<double> start(const std::vector<double>& p)
{
    const LeastEigenvalue::State q = system(p).start();
    return {q.begin(), q.end()};
}

TimedRun run(const RunSettings& settings, int repeats)
{
    return run_any(AnySystem(system(settings.parameters)), start(settings.parameters), settings,
                   repeats);
}

/// Proofs ask for bounds over many boxes: a table repays itself.
learn::GuardProblem guard_problem(const Model& model)
{
    std::vector<double> p = parameters_of(find_system(LeastEigenvalue::name), model);
    p[table] = std::max(p[table], 16.0);
    const LeastEigenvalue made = system(p);
    return learn::guard_problem(made, model, made.start());
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
        .guard_problem = guard_problem,
    };
}

}  // namespace ricochet::app
