// The fault with rate-and-state friction as an ordinary differential equation.
#include "ricochet/faults/fault_system.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "refusal.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/rosenbrock.hpp"

namespace ricochet::fault_system_test {
namespace {

const FaultFriction driven{.plate_velocity = 1e-3, .slip_rate = 2e-3, .overload = 1e-3};

using State = RateStateFaultSystem::State;

/// The largest of |a - b| over |b| + floor.
template <class A, class B>
double apart(const A& a, const B& b, double floor = 0)
{
    double worst = 0;
    for (std::size_t i = 0; i < static_cast<std::size_t>(b.size()); ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        worst =
            std::max(worst, std::abs(a.data()[k] - b.data()[k]) / (std::abs(b.data()[k]) + floor));
    }
    return worst;
}

/// A state near the start in which every component of every element differs.
State uneven(const RateStateFaultSystem& system)
{
    State x = system.start();
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += std::sin(1 + 2.3 * static_cast<double>(i));
    return x;
}

State flow(const RateStateFaultSystem& system, const State& x)
{
    State out(x.size());
    system.flow(0, x, out);
    return out;
}

/// Kernels of each kind: by distances, by rows, of a file, and by distances on another mesh.
std::vector<StrikeSlipFault> faults()
{
    const auto file = std::filesystem::path(RICOCHET_TEST_FIXTURES) / "fault_kernels" /
                      "fault-kernel-10x10-3km.npy";
    return {StrikeSlipFault({.elements = 3}), StrikeSlipFault({.elements = 12}),
            StrikeSlipFault({.elements = 4, .medium = FaultMedium::half_space}),
            StrikeSlipFault({.elements = 10, .kernel = file}),
            StrikeSlipFault({.elements = 5, .mesh = FaultMesh::tip_corrected})};
}

std::vector<FaultFriction> frictions()
{
    std::vector<FaultFriction> out;
    for (const StateEvolution evolution :
         {StateEvolution::ageing, StateEvolution::slip, StateEvolution::prz}) {
        for (const DirectEffect effect : {DirectEffect::log, DirectEffect::asinh}) {
            FaultFriction friction = driven;
            friction.evolution = evolution;
            friction.effect = effect;
            out.push_back(friction);
        }
    }
    out.push_back(driven);
    out.back().normal_stress = 20e6;
    out.back().theta = 3.0;
    // Friction so weak that w is of the size of V: the logarithm is not the asinh.
    out.push_back(driven);
    out.back().law.f_star = 0.02;
    return out;
}

// Both at 1e-9 for every step. Over 30 s the slip is 0.03 m and errors of some hundred steps
// remain; the polynomial for sqrt(K) is within 1e-9 in the one, and exact in the other.
template <class Method>
void expect_variational_steps(double rtol)
{
    const StrikeSlipFault fault({.elements = 3});
    const RateStateFaultSystem system(fault, driven);
    const auto run = integrate(system, system.start(), {.t_end = 30, .rtol = rtol, .atol = rtol},
                               ErrorControlled<Method>{});
    const RateStateRupture steps = simulate(
        fault, {.t_end = 30, .rtol = 1e-9, .polynomial_bound = 1e-9}, driven, {.tolerance = 1e-12});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(steps.rupture.outcome, Outcome::reached_end);
    EXPECT_LT(apart(system.slip(30, run.x), steps.rupture.slip), 1e-7);
    EXPECT_LT(apart(system.velocity(run.x), steps.rupture.velocity), 1e-7);
    const Eigen::VectorXd xi = Eigen::Map<const Eigen::VectorXd>(run.x.data() + 18, 9);
    EXPECT_LT(apart(xi, steps.xi), 1e-7);
}

TEST(RateStateFaultSystem, HasTheSlipOfVariationalSteps)
{
    expect_variational_steps<Dopri5>(1e-9);
    expect_variational_steps<Fehlberg78>(1e-9);
    expect_variational_steps<Rosenbrock4>(1e-8);
}

// Other laws, over a shorter time.
TEST(RateStateFaultSystem, HasTheFrictionOfEveryLaw)
{
    const StrikeSlipFault fault({.elements = 2});
    for (const FaultFriction& friction : frictions()) {
        const RateStateFaultSystem system(fault, friction);
        const auto run =
            integrate(system, system.start(), {.t_end = 2, .rtol = 1e-9, .atol = 1e-9});
        const RateStateRupture steps =
            simulate(fault, {.t_end = 2, .rtol = 1e-8, .polynomial_bound = 1e-9}, friction);
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        EXPECT_LT(apart(system.velocity(run.x), steps.rupture.velocity), 1e-6);
        EXPECT_LT(apart(system.slip(2, run.x), steps.rupture.slip), 1e-6);
    }
}

// Central differences over 1e-5: their rounding is 1e-16 of the largest term over 1e-5, where
// forces cancel to a tenth or less, and their curvature 1e-10 of the third derivative.
TEST(RateStateFaultSystem, JacobianIsThatOfDifferences)
{
    const auto expect = [](const RateStateFaultSystem& system) {
        const State x = uneven(system);
        const std::size_t n = x.size();
        std::vector<double> rows(n * n, NAN);
        system.jacobian(0, x, rows);
        double largest = 0;
        for (const double each : rows) largest = std::max(largest, std::abs(each));
        ASSERT_TRUE(std::isfinite(largest));
        for (std::size_t j = 0; j < n; ++j) {
            constexpr double delta = 1e-5;
            State up = x;
            State down = x;
            up[j] += delta;
            down[j] -= delta;
            const State above = flow(system, up);
            const State below = flow(system, down);
            for (std::size_t i = 0; i < n; ++i) {
                const double slope = (above[i] - below[i]) / (2 * delta);
                ASSERT_NEAR(rows[i * n + j], slope, 1e-7 * std::abs(slope) + 1e-8 * largest)
                    << i << ' ' << j;
            }
        }
    };
    for (const FaultFriction& friction : frictions()) {
        expect(RateStateFaultSystem(StrikeSlipFault({.elements = 2}), friction));
    }
    for (const StrikeSlipFault& fault : faults()) {
        expect(RateStateFaultSystem(fault, driven));
        expect(RateStateFaultSystem(fault, driven, 1e-9));
    }
}

// The forces of stored matrices and of transforms differ by the bound of the polynomial, 1e-9, and
// are at most a hundred times the rates that remain of them.
TEST(RateStateFaultSystem, StoredMatricesAndTransformsAgree)
{
    for (const StrikeSlipFault& fault : faults()) {
        const RateStateFaultSystem stored(fault, driven);
        const RateStateFaultSystem by_transforms(fault, driven, 1e-9);
        const State x = uneven(stored);
        const State a = flow(stored, x);
        const State b = flow(by_transforms, x);
        double largest = 0;
        for (const double each : a) largest = std::max(largest, std::abs(each));
        EXPECT_LT(apart(a, b, largest), 1e-8);
        std::vector<double> rows(x.size() * x.size());
        std::vector<double> other(rows.size());
        stored.jacobian(0, x, rows);
        by_transforms.jacobian(0, x, other);
        largest = 0;
        for (const double each : rows) largest = std::max(largest, std::abs(each));
        EXPECT_LT(apart(rows, other, largest), 1e-8);
    }
    // Above the limit the matrices are not stored.
    const StrikeSlipFault large({.elements = 21});
    ASSERT_GT(large.size(), RateStateFaultSystem::most_stored);
    const RateStateFaultSystem system(large, driven);
    EXPECT_EQ(flow(system, uneven(system)).size(), 3U * 441U);
    EXPECT_EQ(flow(system, uneven(system)),
              flow(RateStateFaultSystem(large, driven, 1e-8), uneven(system)));
}

TEST(RateStateFaultSystem, SlidingWithThePlatesIsSteady)
{
    FaultFriction friction{.plate_velocity = 1e-9, .slip_rate = 1e-9, .overload = 0};
    for (const double bound : {0.0, 1e-9}) {
        const RateStateFaultSystem system(StrikeSlipFault({.elements = 4}), friction, bound);
        // The state rate V* e^-xi / D_RS - V / D_RS cancels from 1e-7, log V from some 1e10.
        const State rate = flow(system, system.start());
        for (std::size_t i = 0; i < 16; ++i) EXPECT_NEAR(rate[i], 0, 1e-21);
        for (std::size_t i = 16; i < 32; ++i) EXPECT_NEAR(rate[i], 0, 1e-4);
        for (std::size_t i = 32; i < 48; ++i) EXPECT_NEAR(rate[i], 0, 1e-21);
        // What has slipped is the motion of the plates.
        EXPECT_NEAR(system.slip(1e9, system.start()).mean(), 1, 1e-15);
        EXPECT_NEAR(system.velocity(system.start()).mean(), 1e-9, 1e-23);
    }
}

TEST(RateStateFaultSystem, ThreadsShareOne)
{
    for (const double bound : {0.0, 1e-9}) {
        const RateStateFaultSystem system(StrikeSlipFault({.elements = 8}), driven, bound);
        const auto run = [&system] {
            return integrate(system, system.start(), {.t_end = 0.5, .rtol = 1e-6, .atol = 1e-6}).x;
        };
        const State alone = run();
        std::vector<State> ends(3);
        std::vector<std::thread> threads;
        for (State& end : ends) threads.emplace_back([&] { end = run(); });
        for (std::thread& thread : threads) thread.join();
        for (const State& end : ends) EXPECT_EQ(end, alone);
    }
}

TEST(RateStateFaultSystem, BadInputIsRefused)
{
    const StrikeSlipFault fault({.elements = 2});
    const auto refused = [&](const FaultFriction& friction, double bound = 0) {
        return refusal([&] { RateStateFaultSystem system(fault, friction, bound); });
    };
    FaultFriction backward = driven;
    backward.slip_rate = -1e-3;  // fine for the asinh form, but has no logarithm
    EXPECT_EQ(refused(backward),
              "RateStateFaultSystem: slip_rate must be positive and finite, got -0.001");
    FaultFriction bad = driven;
    bad.law.a = 0;
    EXPECT_NE(refused(bad), "accepted");
    bad = driven;
    bad.overload = -2;
    EXPECT_NE(refused(bad), "accepted");
    EXPECT_NE(refused(driven, -1), "accepted");
    EXPECT_NE(refused(driven, NAN), "accepted");
    EXPECT_NE(refused(driven, 1e-300), "accepted");  // no polynomial is as good as that
    EXPECT_EQ(refused(driven), "accepted");

    const RateStateFaultSystem system(fault, driven);
    EXPECT_EQ(system.start().size(), 12U);
    State rate(13);
    EXPECT_EQ(refusal([&] { system.flow(0, State(13), rate); }),
              "RateStateFaultSystem: a state must have 3 components for each of 4 elements, got 13 "
              "in all");
    EXPECT_NE(refusal([&] { (void)system.slip(0, State(11)); }), "accepted");
    EXPECT_NE(refusal([&] { (void)system.velocity(State{}); }), "accepted");
    std::vector<double> rows(143);
    EXPECT_NE(refusal([&] { system.jacobian(0, system.start(), rows); }), "accepted");
}

}  // namespace
}  // namespace ricochet::fault_system_test
