// The strike-slip fault on fine meshes, with friction of any kind, and through earthquakes.
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <random>
#include <string>

#include "faults/fault_friction_stage.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet::fault_full_test {
namespace {

constexpr double constant_steps = std::numeric_limits<double>::infinity();
constexpr double mm = 1e3;

/// The largest resident size [MiB] of the process since this was made.
class PeakMemory {
public:
    PeakMemory()
    {
        malloc_trim(0);
        std::ofstream("/proc/self/clear_refs") << 5;
    }
    [[nodiscard]] double mib() const
    {
        std::ifstream in("/proc/self/status");
        for (std::string line; std::getline(in, line);) {
            if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024;
        }
        return std::nan("");
    }
};

Rupture rupture(int n, FaultMesh mesh = FaultMesh::plain, double step = 0)
{
    return simulate(StrikeSlipFault({.elements = n, .mesh = mesh}), {.t_end = 30, .step = step});
}

TEST(RuptureInFull, AHundredElementsASideSlipAsWithAQuarterOfTheStep)
{
    const PeakMemory memory;
    const Rupture usual = rupture(100);
    EXPECT_LE(memory.mib(), 64);
    EXPECT_NEAR(usual.mean_slip * mm, 249.773, 0.05);
    const Rupture finer = rupture(100, FaultMesh::plain, usual.longest_step / 4);
    EXPECT_NEAR(usual.mean_slip / finer.mean_slip, 1, 2e-4);
    // Nearly all of the time is that of the products with K.
    RecordProperty("products", static_cast<int>(usual.statistics.products));
}

TEST(RuptureInFull, TwoHundredElementsASideSlipAsTheFinerMeshesDo)
{
    const PeakMemory memory;
    EXPECT_NEAR(rupture(200).mean_slip * mm, 250.01, 0.05);
    EXPECT_LE(memory.mib(), 128);
}

TEST(RuptureInFull, PlainAndCorrectedMeshesApproachTheLimitFromBothSides)
{
    constexpr double limit = 250.32;
    double before = 0;
    for (const int n : {10, 25, 50, 100, 200, 400}) {
        const double slip = rupture(n).mean_slip * mm;
        EXPECT_GT(slip, before) << n;
        EXPECT_LT(slip, limit) << n;
        before = slip;
        if (n > 100) continue;
        EXPECT_GT(rupture(n, FaultMesh::tip_corrected).mean_slip * mm, limit) << n;
    }
}

TEST(FaultBatheInFull, AHundredElementsASideSlipAsByExplicitSteps)
{
    const Rupture r =
        simulate(StrikeSlipFault({.elements = 100}), {.t_end = 30, .step = 0.125}, BatheOptions{});
    EXPECT_NEAR(r.mean_slip * mm / 249.7726, 1, 3e-4);
}

TEST(FaultRateStateInFull, StepsAreOfTheirOrder)
{
    const StrikeSlipFault fault({.elements = 10});
    const FaultFriction friction{.plate_velocity = 1e-3, .slip_rate = 2e-3, .overload = 1e-3};
    const auto velocity = [&](int order, double h) {
        return simulate(fault, {.t_end = 8, .step = h, .rtol = constant_steps}, friction,
                        {.order = order, .tolerance = 1e-13})
            .rupture.velocity;
    };
    const Eigen::VectorXd exact = velocity(4, 1.0 / 256);
    for (const int order : {1, 2, 4}) {
        const double coarse = (velocity(order, 1.0 / 32) - exact).norm();
        const double fine = (velocity(order, 1.0 / 64) - exact).norm();
        EXPECT_NEAR(std::log2(coarse / fine), order, order == 4 ? 0.4 : 0.1);
    }
}

double uniform(std::mt19937_64& engine)
{
    return static_cast<double>(engine() >> 11) * 0x1p-53;
}

TEST(FaultRateStateInFull, RandomStagesAreSolvedWhereTheyAreConvex)
{
    // Velocities of 1e-12 to 1 m/s, states in [-10, 30], stresses from backwards to 1.5 strengths.
    const StrikeSlipFault fault({.elements = 8});
    const Eigen::Index n = fault.size();
    StageStiffness stiffness(fault, 1e-4);
    std::mt19937_64 engine(7);
    constexpr int repeats = 400;
    for (const double b : {0.005, 0.02}) {  // below and above a
        RateStateParameters p = FaultFriction{}.law;
        p.b = b;
        const AgeingLaw<> law(p);
        FaultFrictionStage<AgeingLaw<>> stage(law, fault, stiffness, fault.weight());
        const double strongest = fault.weight().maxCoeff() * b;
        const double convex = std::sqrt(p.d_rs / fault.slip_unit() / strongest);
        int beyond = 0, all_beyond = 0;
        for (double lg = -6; lg <= 9; lg += 1.5) {
            stiffness.set_length(std::pow(10, lg) / fault.time_unit());
            const bool may_fail = b > p.a && stiffness.length() > convex;
            all_beyond += may_fail ? repeats : 0;
            for (int i = 0; i < repeats; ++i) {
                FaultStageEquation e{.force = Eigen::VectorXd(n), .xi = Eigen::VectorXd(n)};
                FaultStagePoint at{.v = Eigen::VectorXd(n), .xi = {}, .friction = {}, .ease = {}};
                for (Eigen::Index k = 0; k < n; ++k) {
                    e.xi[k] = -10 + 40 * uniform(engine);
                    at.v[k] = std::pow(10, -12 + 12 * uniform(engine)) / fault.velocity_unit();
                    e.force[k] = at.v[k] / stiffness.length() +
                                 fault.weight()[k] * p.f_star * (1.7 * uniform(engine) - 0.2);
                }
                const bool solved = stage.solve(e, at).solved;
                if (may_fail) {
                    beyond += !solved;
                } else {
                    EXPECT_TRUE(solved) << "b = " << b << ", 1e" << lg << " s, stage " << i;
                }
            }
        }
        EXPECT_LE(20 * beyond, all_beyond) << b;
    }
}

TEST(FaultRateStateInFull, OrderFourGoesOnWithAnyFriction)
{
    // Faults of up to 5 x 5 elements, all laws, from creep to an overload of a tenth.
    for (std::uint64_t seed = 0; seed < 150; ++seed) {
        std::mt19937_64 engine(seed);
        const int n = 1 + static_cast<int>(uniform(engine) * 5);
        FaultFriction f;
        f.law.a = 0.004 * std::pow(5, uniform(engine));
        f.law.b = f.law.a * 1.2 * std::pow(5, uniform(engine));
        f.law.d_rs = 0.002 * std::pow(25, uniform(engine));
        f.overload = std::pow(10, -4 + 3 * uniform(engine));
        const double law = uniform(engine);
        f.evolution = law < 0.6   ? StateEvolution::ageing
                      : law < 0.8 ? StateEvolution::slip
                                  : StateEvolution::prz;
        if (uniform(engine) < 0.3) f.normal_stress = 20e6;
        const StrikeSlipFault fault(
            {.elements = n, .damping = uniform(engine) < 0.8 ? 0.8 / 3 : 0.05});
        const RateStateRupture r =
            simulate(fault, {.t_end = 3e8, .rtol = 1e-3, .max_steps = 60'000}, f, {.order = 4});
        EXPECT_EQ(r.rupture.outcome, Outcome::reached_end) << seed;
    }
}

/// Six percent faster than the plates at the start, which is unstable: without it, disturbances
/// below the tolerance would grow in their own time.
RateStateRupture cycle(int n, double t_end, double rtol)
{
    const RateStateRupture r =
        simulate(StrikeSlipFault({.elements = n}), {.t_end = t_end, .rtol = rtol},
                 FaultFriction{.overload = 1e-3});
    EXPECT_EQ(r.rupture.outcome, Outcome::reached_end);
    EXPECT_EQ(r.unsolved, 0U);
    EXPECT_LE(r.residual, RateStateOptions{}.tolerance);
    return r;
}

TEST(FaultRateStateInFull, EarthquakesOfTwentyFiveElementsASideAreThoseOfATenthOfTheTolerance)
{
    const RateStateRupture usual = cycle(25, 1e9, 1e-3);
    const RateStateRupture finer = cycle(25, 1e8, 1e-4);
    ASSERT_GE(usual.earthquakes.size(), 2U);
    ASSERT_GE(finer.earthquakes.size(), 1U);
    const FaultEarthquake& a = usual.earthquakes.front();
    const FaultEarthquake& b = finer.earthquakes.front();
    EXPECT_NEAR(a.mean_slip / b.mean_slip, 1, 0.01);
    EXPECT_NEAR(a.start / b.start, 1, 0.01);
    // Nearly all of the time is that of the stages.
    EXPECT_LE(usual.rupture.statistics.steps, 6000U);
}

TEST(FaultRateStateInFull, FiftyElementsASideGoThroughTheirFirstEarthquake)
{
    EXPECT_GE(cycle(50, 1e8, 1e-3).earthquakes.size(), 1U);
}

}  // namespace
}  // namespace ricochet::fault_full_test
