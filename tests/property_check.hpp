// A random problem, run and compared with its exact run.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "exact_run.hpp"
#include "random_systems.hpp"
#include "ricochet/bernstein.hpp"
#include "ricochet/extremum.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/methods.hpp"

namespace ricochet::test {

/// Contents and failures of many random problems.
struct PropertyReport {
    std::uint64_t problems = 0;
    std::uint64_t irregular = 0;  ///< discarded: the answer is not unique
    std::uint64_t events = 0;
    std::uint64_t sets = 0;
    std::uint64_t together = 0;
    std::uint64_t cascades = 0;

    std::uint64_t unfinished = 0;       ///< another outcome, or time that stands still
    std::uint64_t missed = 0;           ///< problems with an event that was not found
    std::uint64_t spurious = 0;         ///< problems with a wrong event, or one twice
    std::uint64_t misplaced = 0;        ///< problems with an event at another time
    std::uint64_t astray = 0;           ///< problems with another end
    std::uint64_t order_dependent = 0;  ///< problems that the order of guards changed
    std::uint64_t first_wrong = 0;      ///< the number of the first such problem
    double error = 0;                   ///< [s] largest of an event, over max(1, |t|)

    [[nodiscard]] std::uint64_t wrong() const noexcept
    {
        return unfinished + missed + spurious + misplaced + astray + order_dependent;
    }
};

namespace property {

using X = RandomSystem::State;

/// An exact run, and the accuracy with which its events are known.
struct Expected {
    ExactRun run;
    std::vector<Real> doubt;  ///< [s] for each event
    Real state_doubt = 0;
};

/// Nothing if the problem is not regular.
[[nodiscard]] inline std::optional<Expected> expected(const RandomProblem& problem,
                                                      learn::Random& random)
{
    Expected out{.run = ExactMotion(problem)(), .doubt = {}};
    if (!out.run.regular) return std::nullopt;
    out.doubt.assign(out.run.events.size(), 0);
    for (int k = 0; k < 2; ++k) {
        const ExactRun other = ExactMotion(problem, &random)();
        if (!other.regular || other.mode != out.run.mode) return std::nullopt;
        if (other.events.size() != out.run.events.size()) return std::nullopt;
        Real worst = 0;
        for (std::size_t i = 0; i < other.events.size(); ++i) {
            const ExactEvent& a = out.run.events[i];
            const ExactEvent& b = other.events[i];
            if (a.guard != b.guard || a.mode_after != b.mode_after) return std::nullopt;
            worst = std::max(worst, std::fabs(a.t - b.t));
            out.doubt[i] = std::max(out.doubt[i], worst);
        }
        for (std::size_t c = 0; c < 3; ++c) {
            out.state_doubt = std::max(out.state_doubt, std::fabs(other.x[c] - out.run.x[c]));
        }
    }
    // Too sensitive to compare: a disturbance of 1e-9 has grown to more than 1e-5.
    if (!out.doubt.empty() && out.doubt.back() > 1e-5L) return std::nullopt;
    return out;
}

/// The events of one guard, or the time events.
template <class Events>
[[nodiscard]] std::vector<std::size_t> of_guard(const Events& events, std::size_t guard)
{
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < events.size(); ++i) {
        if (events[i].guard == guard) out.push_back(i);
    }
    return out;
}

/// Whether time advances throughout the run.
[[nodiscard]] inline bool advances(const Run<X>& run, bool backward)
{
    return std::is_sorted(
        run.events.begin(), run.events.end(),
        [backward](const auto& a, const auto& b) { return backward ? a.t > b.t : a.t < b.t; });
}

/// Whether the run has every event of the exact run, once, at its time; counts the differences.
inline bool compare(const Run<X>& run, const Expected& expected, const RandomProblem& problem,
                    PropertyReport& report)
{
    const std::uint64_t before = report.wrong();
    if (run.outcome != Outcome::reached_end || !advances(run, problem.backward())) {
        ++report.unfinished;
        return false;
    }
    // Rounding moves a run by less than a thousandth of a disturbance of 1e-9:
    // a step adds a few units in the last place, 1e-15 of the states' sizes, and there are
    // fewer than a thousand steps between two disturbances.
    constexpr Real share = 1e-3L;
    std::vector<std::size_t> guards(problem.system.guard_count() + 1, no_guard);
    for (std::size_t i = 0; i + 1 < guards.size(); ++i) guards[i] = i;
    bool missed = false;
    bool spurious = false;
    bool misplaced = false;
    for (const std::size_t guard : guards) {
        const auto exact = of_guard(expected.run.events, guard);
        const auto found = of_guard(run.events, guard);
        missed = missed || found.size() < exact.size();
        spurious = spurious || found.size() > exact.size();
        for (std::size_t k = 0; k < std::min(exact.size(), found.size()); ++k) {
            const ExactEvent& a = expected.run.events[exact[k]];
            const auto& b = run.events[found[k]];
            const Real size = std::max<Real>(1, std::fabs(a.t));
            const Real error = std::fabs(b.t - a.t);
            const Real tolerance = share * expected.doubt[exact[k]] + 1e-14L * size;
            misplaced = misplaced || error > tolerance || a.kind != b.kind;
            if (found.size() == exact.size()) {
                report.error = std::max(report.error, static_cast<double>(error / size));
            }
        }
    }
    report.missed += missed;
    report.spurious += spurious;
    report.misplaced += !missed && !spurious && misplaced;
    if (report.wrong() == before) {
        Real apart = 0;
        for (std::size_t c = 0; c < 3; ++c) {
            const Real size = 1 + std::fabs(expected.run.x[c]);
            apart = std::max(apart, std::fabs(run.x[c] - expected.run.x[c]) / size);
        }
        const bool there = apart <= share * expected.state_doubt + 1e-13L;
        report.astray += !there || run.mode != expected.run.mode || run.t != problem.t_end;
    }
    return report.wrong() == before;
}

/// Everything in a run that must not depend on the order of the guards, which are
/// renamed back by `names`.
[[nodiscard]] inline auto trace(const Run<X>& run, const std::vector<std::size_t>& names)
{
    using Row = std::tuple<double, std::size_t, int, Mode, Mode, X, X, double, double>;
    std::vector<Row> rows;
    for (const auto& e : run.events) {
        const std::size_t guard = e.guard == no_guard ? no_guard : names[e.guard];
        rows.emplace_back(e.t, guard, static_cast<int>(e.kind), e.mode_before, e.mode_after,
                          e.before, e.after, e.bracket.lo, e.bracket.hi);
    }
    std::sort(rows.begin(), rows.end());
    return std::make_tuple(run.outcome, run.t, run.x, run.mode, std::move(rows));
}

inline constexpr std::size_t methods = 6;

/// Runs a problem by one of several methods. All of them are exact on polynomials of
/// degree three, but for rounding.
[[nodiscard]] inline Run<X> run(const RandomProblem& problem, std::size_t method, double step)
{
    const auto with = [&](double fixed, double longest, const auto& stepping,
                          const auto& detector) {
        return integrate(problem.system, problem.x0,
                         {.t_start = problem.t_start,
                          .t_end = problem.t_end,
                          .mode = problem.mode,
                          .step = fixed,
                          .h_max = longest,
                          .max_steps = 100'000},
                         stepping, detector);
    };
    constexpr double any = std::numeric_limits<double>::infinity();
    switch (method) {
        case 0: return with(0, any, ErrorControlled<Dopri5>{}, Extremum{});
        case 1: return with(0, step, ErrorControlled<Dopri5>{}, Extremum{});
        case 2: return with(0, any, ErrorControlled<Fehlberg78>{}, Extremum{});
        case 3: return with(step, any, FixedStep<Rk4>{}, Extremum{});
        case 4: return with(0, any, ErrorControlled<Dopri5>{}, Bernstein{});
        default: return with(step, any, FixedStep<Rk4>{}, Bernstein{});
    }
}

}  // namespace property

/// Runs `problems` regular problems and the same with their guards in another order.
[[nodiscard]] inline PropertyReport check_random_systems(std::uint64_t seed, std::uint64_t problems)
{
    PropertyReport report;
    RandomProblems next(seed);
    while (report.problems < problems) {
        RandomProblem problem = next();
        const auto expected = property::expected(problem, next.random());
        const std::size_t method = next.random().below(property::methods);
        const double step = next.random().log_uniform(0.02, 2);
        const auto order = learn::permutation(problem.system.guard_count(), next.random());
        if (!expected) {
            ++report.irregular;
            continue;
        }
        ++report.problems;
        report.events += expected->run.events.size();
        report.sets += expected->run.sets;
        report.together += expected->run.together;
        report.cascades += expected->run.cascades;

        const auto run = property::run(problem, method, step);
        bool right = property::compare(run, *expected, problem, report);

        std::vector<std::size_t> same(order.size());
        for (std::size_t i = 0; i < same.size(); ++i) same[i] = i;
        RandomProblem other = problem;
        other.system = reordered(problem.system, order);
        if (property::trace(property::run(other, method, step), order) !=
            property::trace(run, same)) {
            ++report.order_dependent;
            right = false;
        }
        if (!right && report.first_wrong == 0) report.first_wrong = report.problems;
    }
    return report;
}

}  // namespace ricochet::test
