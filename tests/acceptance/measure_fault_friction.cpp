// Rate-and-state friction on the strike-slip fault.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <random>
#include <string>

#include "fault_as_slider.hpp"
#include "measure_fault.hpp"
#include "ricochet/detail/fault_friction_stage.hpp"
#include "ricochet/faults/spring_slider.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::bench {

namespace {

constexpr double constant_steps = std::numeric_limits<double>::infinity();

/// The start is six percent faster than the plates, which is unstable: without it, disturbances
/// below the tolerance would grow in their own time.
const FaultFriction disturbed{.overload = 1e-3};

struct TimedCycle {
    RateStateRupture run;
    double seconds = 0;  ///< processor time, with everything that is made before
};

TimedCycle cycle(int n, double t_end, double rtol)
{
    const std::clock_t start = std::clock();
    const StrikeSlipFault fault({.elements = n});
    TimedCycle out{.run = simulate(fault, {.t_end = t_end, .rtol = rtol}, disturbed)};
    out.seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    return out;
}

std::string counts(const TimedCycle& c)
{
    const RuptureStatistics& s = c.run.rupture.statistics;
    const auto per_stage = [&](std::uint64_t count) {
        return static_cast<double>(count) / static_cast<double>(s.solves);
    };
    std::string out = fmt::format(
        "{} steps, {} rejected; {} stages, {} unsolved, residual {:.1e}, {:.2f} Newton and {:.2f} "
        "inner iterations and {:.1f} products with K a stage; {:.1f} s",
        s.steps, s.rejected, s.solves, c.run.unsolved, c.run.residual, per_stage(s.iterations),
        per_stage(c.run.inner), per_stage(s.products), c.seconds);
    for (const FaultEarthquake& e : c.run.earthquakes) {
        out +=
            fmt::format("; earthquake at {:.6g} s for {:.4g} s, slip {:.5f} m, fastest {:.4f} m/s",
                        e.start, e.end - e.start, e.mean_slip, e.largest_velocity);
    }
    return out;
}

bool solved(const TimedCycle& c)
{
    return c.run.rupture.outcome == Outcome::reached_end && c.run.unsolved == 0 &&
           c.run.residual <= RateStateOptions{}.tolerance;
}

}  // namespace

Measured compare_fault_with_slider()
{
    const test::FaultAsSlider pair;
    double worst = 0;
    for (const int order : {1, 2, 4}) {
        const RateStateRupture r = pair.run_fault(order);
        const SliderRun s = pair.run_as_slider(order);
        worst = std::max({worst, std::abs(r.rupture.slip[0] / s.state.x - 1),
                          std::abs(r.rupture.velocity[0] / s.state.v - 1),
                          std::abs(r.xi[0] / s.state.xi - 1)});
    }
    return {.pass = worst <= 1e-11,
            .text = fmt::format("slip, velocity, state apart by at most {:.1e}", worst)};
}

Measured observe_orders_on_fault()
{
    const StrikeSlipFault fault({.elements = 10});
    const FaultFriction friction{.plate_velocity = 1e-3, .slip_rate = 2e-3, .overload = 1e-3};
    const auto velocity = [&](int order, double h) {
        return simulate(fault, {.t_end = 8, .step = h, .rtol = constant_steps}, friction,
                        {.order = order, .tolerance = 1e-13})
            .rupture.velocity;
    };
    const Eigen::VectorXd exact = velocity(4, 1.0 / 256);
    Measured out{.pass = true, .text = {}};
    for (const int order : {1, 2, 4}) {
        const double coarse = (velocity(order, 1.0 / 32) - exact).norm();
        const double fine = (velocity(order, 1.0 / 64) - exact).norm();
        const double observed = std::log2(coarse / fine);
        out.pass = out.pass && std::abs(observed - order) <= (order == 4 ? 0.4 : 0.1);
        out.text += fmt::format("{}{:.2f}", out.text.empty() ? "" : ", ", observed);
    }
    return out;
}

Measured solve_random_stages()
{
    // Velocities of 1e-12 to 1 m/s, states in [-10, 30], stresses from backwards to 1.5 strengths.
    const StrikeSlipFault fault({.elements = 8});
    const Eigen::Index n = fault.size();
    StageStiffness stiffness(fault, 1e-4);
    std::mt19937_64 engine(7);
    const auto uniform = [&engine] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
    constexpr int repeats = 400;
    Measured out{.pass = true, .text = {}};
    for (const double b : {0.005, 0.02}) {  // below and above a
        RateStateParameters p = FaultFriction{}.law;
        p.b = b;
        const AgeingLaw<> law(p);
        FaultFrictionStage<AgeingLaw<>> stage(law, fault, stiffness, fault.weight());
        const double strongest = fault.weight().maxCoeff() * b;
        const double convex = std::sqrt(p.d_rs / fault.slip_unit() / strongest);
        int within = 0, beyond = 0, all_beyond = 0, worst = 0;
        for (double lg = -6; lg <= 9; lg += 1.5) {
            stiffness.set_length(std::pow(10, lg) / fault.time_unit());
            const bool may_fail = b > p.a && stiffness.length() > convex;
            all_beyond += may_fail ? repeats : 0;
            for (int i = 0; i < repeats; ++i) {
                FaultStageEquation e{.force = Eigen::VectorXd(n), .xi = Eigen::VectorXd(n)};
                FaultStagePoint at{.v = Eigen::VectorXd(n), .xi = {}, .friction = {}, .ease = {}};
                for (Eigen::Index k = 0; k < n; ++k) {
                    e.xi[k] = -10 + 40 * uniform();
                    at.v[k] = std::pow(10, -12 + 12 * uniform()) / fault.velocity_unit();
                    e.force[k] = at.v[k] / stiffness.length() +
                                 fault.weight()[k] * p.f_star * (1.7 * uniform() - 0.2);
                }
                const FaultStageReport report = stage.solve(e, at);
                (may_fail ? beyond : within) += !report.solved;
                worst = std::max(worst, report.iterations);
            }
        }
        out.pass = out.pass && within == 0 && beyond <= all_beyond / 20;
        out.text += fmt::format("{}b = {}: {} unsolved", out.text.empty() ? "" : "; ", b, within);
        if (all_beyond > 0) out.text += fmt::format(", {} of {} beyond", beyond, all_beyond);
        out.text += fmt::format(", at most {} iterations", worst);
    }
    return out;
}

Measured cycle_25()
{
    const TimedCycle usual = cycle(25, 1e9, 1e-3);
    const TimedCycle finer = cycle(25, 1e8, 1e-4);
    Measured out;
    out.details = {counts(usual), "rtol 1e-4, 1e8 s: " + counts(finer)};
    if (usual.run.earthquakes.size() < 2 || finer.run.earthquakes.empty()) {
        out.text = "fewer earthquakes than expected";
        return out;
    }
    const FaultEarthquake& a = usual.run.earthquakes.front();
    const FaultEarthquake& b = finer.run.earthquakes.front();
    const double slip = std::abs(a.mean_slip / b.mean_slip - 1);
    const double start = std::abs(a.start / b.start - 1);
    out.pass =
        solved(usual) && solved(finer) && slip <= 0.01 && start <= 0.01 && usual.seconds <= 60;
    out.text = fmt::format(
        "{} earthquakes, {} unsolved, {:.1f} s; from rtol 1e-4: slip {:.3f} %, start {:.3f} %",
        usual.run.earthquakes.size(), usual.run.unsolved, usual.seconds, 100 * slip, 100 * start);
    return out;
}

Measured cycle_50()
{
    const TimedCycle c = cycle(50, 1e8, 1e-3);
    return {.pass = solved(c) && !c.run.earthquakes.empty() && c.seconds <= 120,
            .text = fmt::format("{} earthquakes, {} unsolved, {:.1f} s", c.run.earthquakes.size(),
                                c.run.unsolved, c.seconds),
            .details = {counts(c)}};
}

}  // namespace ricochet::bench
