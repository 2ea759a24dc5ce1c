// Near-tangent crossings, of depths from 0.01 down to the touch tolerance, and near misses.
//
//     y'' = -y,  y = cos(t + p),  guard y - (1 - depth),  over 20 s
//
// A crest higher than the level is crossed twice, 2 asin(sqrt(depth / 2)) to either side
// of it. The attainable error of a time is the error of the guard divided by its slope there.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "measure.hpp"
#include "problems/near_tangent.hpp"
#include "ricochet/detail/random.hpp"
#include "ricochet/detect/extremum.hpp"
#include "ricochet/integrate/integrate.hpp"
#include "ricochet/integrate/methods.hpp"

namespace ricochet::bench {

namespace {

constexpr double t_end = 20;
constexpr int phases = 2000;
constexpr double two_pi = 6.283185307179586;

/// Touch tolerance: a turn of the guard with |g| up to this counts as a touch. It is 64 units in
/// the last place of the guard's size, which is 2 at a trough.
constexpr double band = 64 * std::numeric_limits<double>::epsilon() * 2;

const Options options{.t_end = t_end, .rtol = 1e-14, .atol = 1e-15};

struct Row {
    double depth = 0;
    std::size_t runs = 0;
    std::size_t expected = 0;  ///< crossings, or touches
    std::size_t found = 0;     ///< of these
    std::size_t invented = 0;
    std::size_t touches = 0;
    double time_error = 0;   ///< [s] largest
    double guard_error = 0;  ///< largest error of a time, times the slope there
};

/// Compares the crossings and touches of one run with the closed form: each belongs to the crest
/// that is nearer than half a period.
void score(const Run<NearTangent::State>& run, double depth, double phase, Row& row)
{
    const double width = depth > 0 ? 2 * std::asin(std::sqrt(depth / 2)) : 0;
    const double slope = std::sin(width);
    std::vector<double> crossings;
    std::vector<double> touches;
    for (const auto& event : run.events) {
        (event.kind == EventKind::touch ? touches : crossings).push_back(event.t);
    }
    row.touches += touches.size();
    std::vector<double> exact;
    for (int n = 1; two_pi * n - phase - width <= t_end; ++n) {
        for (const double t : {two_pi * n - phase - width, two_pi * n - phase + width}) {
            if (depth >= 0 && t <= t_end) exact.push_back(t);
            if (!(depth > 0)) break;
        }
    }
    std::vector<double>& right = depth > 0 ? crossings : touches;
    const std::vector<double>& other = depth > 0 ? touches : crossings;
    row.expected += exact.size();
    row.invented += other.size();
    if (right.size() > exact.size()) row.invented += right.size() - exact.size();
    row.found += std::min(right.size(), exact.size());
    if (right.size() != exact.size()) return;
    for (std::size_t i = 0; i < exact.size(); ++i) {
        const double error = std::fabs(right[i] - exact[i]);
        row.time_error = std::max(row.time_error, error);
        row.guard_error = std::max(row.guard_error, error * slope);
    }
}

Row measure(double depth)
{
    learn::Random random(static_cast<std::uint64_t>(20'260'101));
    Row row{.depth = depth};
    for (int k = 0; k < phases; ++k) {
        const double phase = random.uniform(0.5, 5.5);
        const NearTangent system({.depth = depth, .phase = phase});
        const auto run =
            integrate(system, system.start(), options, ErrorControlled<Fehlberg78>{}, Extremum{});
        row.runs += run.outcome == Outcome::reached_end;
        score(run, depth, phase, row);
    }
    return row;
}

/// Largest departure of the height of the crests from 1, over some runs: the amount by which the
/// stepper moves the guard relative to its level.
double stepper_error()
{
    learn::Random random(static_cast<std::uint64_t>(20'260'101));
    double worst = 0;
    for (int k = 0; k < 200; ++k) {
        const NearTangent system({.depth = 0.5, .phase = random.uniform(0.5, 5.5)});
        const auto start = system.start();
        Simulation<NearTangent, NearTangent::State, ErrorControlled<Fehlberg78>> simulation(
            system, start, options);
        while (simulation.step()) {
            const auto& x = simulation.x();
            const long double squared =
                static_cast<long double>(x[0]) * x[0] + static_cast<long double>(x[1]) * x[1];
            worst = std::max(worst, static_cast<double>(std::fabs(std::sqrt(squared) - 1)));
        }
    }
    return worst;
}

}  // namespace

Measured find_near_tangent_pairs()
{
    const double moved = stepper_error();
    std::vector<std::string> details{
        fmt::format("fehlberg78, rtol 1e-14, extremum; {} random phases a depth; touch band "
                    "{:.1e}, error of the stepper in the height of a crest {:.1e}",
                    phases, band, moved),
        fmt::format("{:>10}{:>10}{:>10}{:>9}{:>10}{:>9}{:>14}{:>21}", "depth", "expected", "found",
                    "%", "invented", "touches", "error [s]", "error x slope [-]")};
    bool pass = true;
    std::size_t expected = 0;
    std::size_t found = 0;
    std::size_t invented = 0;
    double guard_error = 0;
    const auto take = [&](double depth, bool required) {
        const Row row = measure(depth);
        details.push_back(fmt::format("{:>10.0e}{:>10}{:>10}{:>9.2f}{:>10}{:>9}{:>14.1e}{:>21.1e}",
                                      depth, row.expected, row.found,
                                      row.expected > 0 ? 100.0 * static_cast<double>(row.found) /
                                                             static_cast<double>(row.expected)
                                                       : 100.0,
                                      row.invented, row.touches, row.time_error, row.guard_error));
        if (!required) return;
        pass = pass && row.runs == phases && row.found == row.expected && row.invented == 0;
        if (depth > 0) {
            expected += row.expected;
            found += row.found;
            guard_error = std::max(guard_error, row.guard_error);
        }
        invented += row.invented;
    };
    for (int k = 2; k <= 13; ++k) {
        const double depth = std::pow(10.0, -k);
        take(depth, depth > 2 * band);
    }
    take(0, true);
    for (const double miss : {-1e-12, -1e-9, -1e-6, -1e-3}) take(miss, true);
    details.push_back(
        "At depth 0 a touch at every crest is expected, at negative depths nothing. Depths not "
        "above twice the band are shown, not judged.");
    return {.pass = pass,
            .text = fmt::format("{} of {} crossings at depths above twice the band ({:.1e}), {} "
                                "invented; error x slope <= {:.1e}",
                                found, expected, 2 * band, invented, guard_error),
            .details = std::move(details)};
}

}  // namespace ricochet::bench
