// One trajectory, four kinds of state: the same bits.
#include <fmt/format.h>

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <string_view>
#include <vector>

#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"

namespace ricochet::bench {

namespace {

/// Times, brackets and states of all events, and the final state, in one row.
template <class X, class System, class Stepping, class Detector>
std::vector<double> trace(const System& system, const X& x0, const Options& options,
                          const Stepping& stepping, const Detector& detector)
{
    const auto run = integrate(system, x0, options, stepping, detector);
    std::vector<double> row{run.t, run.x[0], run.x[1]};
    for (const auto& event : run.events) {
        row.insert(row.end(), {event.t, event.bracket.lo, event.bracket.hi, event.before[0],
                               event.before[1], event.after[0], event.after[1]});
    }
    return row;
}

struct Comparison {
    std::size_t runs = 0;
    std::size_t events = 0;
    std::vector<std::string> differences;
};

template <class P, class Stepping, class Detector>
void compare(const P& problem, std::string_view name, Options options, const Stepping& stepping,
             const Detector& detector, Comparison& result)
{
    options.t_end = problem.t_end;
    const double a = problem.x0[0];
    const double b = problem.x0[1];
    const auto with = [&](const auto& x0) {
        return trace(problem.system, x0, options, stepping, detector);
    };
    Eigen::VectorXd dynamic(2);
    dynamic << a, b;
    const std::vector<double> reference = with(std::array<double, 2>{a, b});
    const auto check = [&](std::string_view type, const std::vector<double>& row) {
        ++result.runs;
        if (row != reference) {
            result.differences.push_back(
                fmt::format("{} {}: {} differs from std::array", problem.name, name, type));
        }
    };
    result.events += problem.events.size();
    check("std::vector", with(std::vector<double>{a, b}));
    check("Eigen::Vector2d", with(Eigen::Vector2d(a, b)));
    check("Eigen::VectorXd", with(dynamic));
}

template <class P, class Detector>
void compare_steppers(const P& problem, const Detector& detector, Comparison& result)
{
    compare(problem, "rk4", {.step = 0.037}, FixedStep<Rk4>{}, detector, result);
    compare(problem, "dopri5", {.rtol = 1e-8, .atol = 1e-8}, ErrorControlled<Dopri5>{}, detector,
            result);
    compare(problem, "fehlberg78", {.rtol = 1e-10, .atol = 1e-10}, ErrorControlled<Fehlberg78>{},
            detector, result);
}

}  // namespace

Measured compare_state_types()
{
    Comparison result;
    compare_steppers(b1(), Ends{}, result);
    compare_steppers(b1(), Extremum{}, result);
    compare_steppers(spiral(), Extremum{}, result);
    return {
        .pass = result.differences.empty(),
        .text = fmt::format("{} of {} runs equal std::array's bit for bit; {} events, rk4, "
                            "dopri5, fehlberg78, ball and spiral",
                            result.runs - result.differences.size(), result.runs, result.events),
        .details = result.differences};
}

}  // namespace ricochet::bench
