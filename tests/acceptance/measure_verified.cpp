// The verified gate: for any weights it returns the events of the exact detector.
#include <fmt/format.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "measure.hpp"
#include "problems.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/detect/gates.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"

namespace ricochet::bench {

namespace {

using X = BallProblem::State;

/// All results of a run except the counts of the network, as bits. The features of the
/// network read the guard once each time, which is no part of the exact detector's
/// work and is subtracted.
std::vector<std::uint64_t> bits_of(const Run<X>& run)
{
    std::vector<std::uint64_t> bits;
    const auto add = [&](double value) { bits.push_back(std::bit_cast<std::uint64_t>(value)); };
    add(run.t);
    for (const double value : run.x) add(value);
    for (const auto& event : run.events) {
        for (const double value : {event.t, event.bracket.lo, event.bracket.hi, event.slope,
                                   event.error, event.before[0], event.before[1], event.after[0],
                                   event.after[1], event.late ? 1.0 : 0.0}) {
            add(value);
        }
    }
    const Statistics& s = run.statistics;
    bits.insert(bits.end(),
                {static_cast<std::uint64_t>(run.outcome), s.steps, s.rejected, s.resteps,
                 s.flow_calls, s.guard_calls - s.network_calls, s.late_events, s.events});
    return bits;
}

/// A 2-8-1 network with weights from `next`, for every step.
template <class Next>
Network network_of(Next next, double threshold = 0)
{
    Model model;
    model.system = "bouncing-ball";
    model.recipe = "ballistic";
    model.offset = {0, 0};
    model.scale = {1, 1};
    model.step_min = 1e-300;
    model.step_max = 1e300;
    model.threshold = threshold;
    model.layers = {{.inputs = 2, .outputs = 8, .weight = {}, .bias = {}},
                    {.inputs = 8, .outputs = 1, .weight = {}, .bias = {}}};
    for (DenseLayer& layer : model.layers) {
        for (std::size_t i = 0; i < layer.inputs * layer.outputs; ++i) {
            layer.weight.push_back(next());
        }
        for (std::size_t i = 0; i < layer.outputs; ++i) layer.bias.push_back(next());
    }
    return Network(model);
}

struct Comparison {
    std::size_t runs = 0;
    std::size_t differences = 0;
    std::uint64_t events = 0;
    std::uint64_t cleared = 0;   ///< events in steps that the network had cleared
    std::uint64_t deferred = 0;  ///< exact checks
};

template <class Stepping, class Exact>
void compare(const BallProblem& problem, const Options& options, const Network& network,
             Comparison& result)
{
    const auto exact = integrate(problem.system, problem.x0, options, Stepping{}, Exact{});
    const auto gated =
        integrate(problem.system, problem.x0, options, Stepping{}, Verified<Exact>(network));
    ++result.runs;
    if (bits_of(gated) != bits_of(exact)) ++result.differences;
    result.events += exact.statistics.events;
    result.cleared += gated.statistics.missed_events;
    result.deferred += gated.statistics.checks_deferred;
}

/// The ball, the step and the tolerance change with `i`.
void compare_all(std::size_t i, const Network& network, Comparison& result)
{
    static const std::array<BallProblem, 3> problems{b1(), b2(), b3()};
    constexpr std::array<double, 5> steps{0.0037, 0.01, 0.05, 0.1, 0.37};
    constexpr std::array<double, 4> tolerances{1e-4, 1e-6, 1e-8, 1e-10};
    const BallProblem& problem = problems[i % problems.size()];
    const double rtol = tolerances[i % tolerances.size()];
    const Options fixed{.t_end = problem.t_end, .step = steps[i % steps.size()]};
    const Options controlled{.t_end = problem.t_end, .rtol = rtol, .atol = rtol};
    compare<FixedStep<Rk4>, Extremum>(problem, fixed, network, result);
    compare<FixedStep<Rk4>, Ends>(problem, fixed, network, result);
    compare<ErrorControlled<Dopri5>, Extremum>(problem, controlled, network, result);
    compare<ErrorControlled<Dopri5>, Ends>(problem, controlled, network, result);
}

}  // namespace

Measured compare_verified()
{
    Comparison total;
    std::vector<std::string> details;
    const auto add = [&](std::string_view weights, const Comparison& part) {
        details.push_back(fmt::format(
            "{:<28}{:>6} runs, {} differences; {} events, {} of them in steps the network cleared",
            weights, part.runs, part.differences, part.events, part.cleared));
        total.runs += part.runs;
        total.differences += part.differences;
        total.deferred += part.deferred;
    };
    std::mt19937_64 random(20230605);
    Comparison part;
    for (std::size_t i = 0; i < 1000; ++i) {
        const double size = std::pow(10.0, static_cast<double>(random() % 7) - 3);
        const Network network =
            network_of([&] { return size * (static_cast<double>(random() >> 11U) * 0x1p-52 - 1); });
        compare_all(i, network, part);
    }
    add("1000 random networks", part);

    // Each with every ball, step and tolerance.
    const auto add_special = [&](std::string_view weights, const Network& network) {
        Comparison special;
        for (std::size_t i = 0; i < 60; ++i) compare_all(i, network, special);
        add(weights, special);
    };
    constexpr double infinite = std::numeric_limits<double>::infinity();
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    add_special("weights NaN", network_of([] { return nan; }));
    add_special("weights infinite", network_of([] { return infinite; }));
    add_special("weights minus infinite", network_of([] { return -infinite; }));
    add_special("always \"clear\"", network_of([] { return 0.0; }, 1));
    add_special("never \"clear\"", network_of([] { return 0.0; }, -1));
    return {.pass = total.differences == 0 && total.runs >= 4000,
            .text = fmt::format("{} runs compared, {} differences, {} checks put off", total.runs,
                                total.differences, total.deferred),
            .details = std::move(details)};
}

}  // namespace ricochet::bench
