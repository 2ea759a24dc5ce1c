// Solvers of one stage: cases, semismooth Newton, fixed point.

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "problems/super_twisting.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/friction_inclusion.hpp"

namespace ricochet::stage_test {
namespace {

using namespace sets;

// --- stages: all solvers agree ---

template <class System>
SetValuedState<System> step_with(const System& system, StageMethod method,
                                 const SetValuedState<System>& from, double h, double tolerance,
                                 int* iterations = nullptr)
{
    CompositeStep<System> step(system, {.stage = {.method = method, .tolerance = tolerance}});
    SetValuedState<System> to = from;
    const StageReport report = step.take(from, h, to);
    EXPECT_TRUE(report.converged) << static_cast<int>(method) << " " << report.residual;
    if (iterations) *iterations = report.iterations;
    return to;
}

TEST(StageSolvers, AgreeOnTheCircuit)
{
    const double starts[][3] = {
        {9.998, 1.98, -10.9}, {0.01, 0.5, 0.1}, {0, 0.5, 0.1}, {-0.02, 3, 1}};
    for (const auto& w : starts) {
        for (const double h : {1e-3, 0.02, 0.3}) {
            const double r = w[0] > 0 ? -0.8 : w[0] < 0 ? 0.8 : -0.35;
            const SetValuedState<DiodeCircuit> from{
                0, {w[0], w[1], w[2]}, Eigen::Matrix<double, 1, 1>::Constant(r)};
            int fixed = 0;
            const auto a = step_with(DiodeCircuit(), StageMethod::cases, from, h, 1e-12);
            const auto b = step_with(DiodeCircuit(), StageMethod::newton, from, h, 1e-12);
            const auto c =
                step_with(DiodeCircuit(), StageMethod::fixed_point, from, h, 1e-11, &fixed);
            EXPECT_LT((a.w - b.w).norm(), 1e-10);
            EXPECT_LT((a.w - c.w).norm(), 1e-9);
            EXPECT_GT(fixed, 4);
        }
    }
}

TEST(StageSolvers, AgreeWhereTheBoundDependsOnTheState)
{
    const FrictionInclusion system({.belt_speed = 0.2, .friction = 1, .weakening = 3});
    for (const double v : {-0.5, 0.1, 0.2, 0.7}) {
        SetValuedMotion<FrictionInclusion> start(system, {0.4, v}, {.t_end = 1, .step = 0.1});
        for (const double h : {0.01, 0.1}) {
            const auto a = step_with(system, StageMethod::cases, start.state(), h, 1e-12);
            const auto b = step_with(system, StageMethod::newton, start.state(), h, 1e-12);
            EXPECT_LT((a.w - b.w).norm(), 1e-10) << v << " " << h;
        }
    }
}

// The same without the derivative of its bound.
struct WithoutGradient {
    static constexpr int state_size = 2;
    static constexpr int reaction_size = 1;
    FrictionInclusion inner{{.belt_speed = 0.2, .friction = 1, .weakening = 3}};
    void smooth(double t, const Eigen::Vector2d& w, Eigen::Vector2d& f) const
    {
        inner.smooth(t, w, f);
    }
    void observe(Eigen::Matrix<double, 1, 2>& e) const { inner.observe(e); }
    void offset(double t, FrictionInclusion::Scalar& s) const { inner.offset(t, s); }
    [[nodiscard]] IntervalSet reaction_set(double t, const Eigen::Vector2d& w) const
    {
        return inner.reaction_set(t, w);
    }
};

TEST(StageSolvers, TheDerivativeOfTheBoundMakesNewtonQuadratic)
{
    const FrictionInclusion with({.belt_speed = 0.2, .friction = 1, .weakening = 3});
    const WithoutGradient without;
    SetValuedMotion<FrictionInclusion> start(with, {0.4, -0.3}, {.t_end = 1, .step = 0.1});
    int fast = 0;
    int slow = 0;
    const auto a = step_with(with, StageMethod::newton, start.state(), 0.2, 1e-12, &fast);
    const auto b = step_with(without, StageMethod::newton,
                             {0, start.state().w, start.state().reaction}, 0.2, 1e-12, &slow);
    EXPECT_LT((a.w - b.w).norm(), 1e-10);
    EXPECT_LE(fast, 10);  // of two stages
    EXPECT_GT(slow, fast);
}

TEST(StageSolvers, TheDerivativeOfTheBoundIsThatOfDifferences)
{
    for (const auto law : {FrictionLaw::constant, FrictionLaw::hyperbolic, FrictionLaw::exponential,
                           FrictionLaw::humped}) {
        const FrictionInclusion system(
            {.belt_speed = 0.2, .friction = 1, .weakening = 2, .residual = 0.1, .law = law});
        for (const double v : {-0.3, 0.1, 0.6}) {
            Eigen::Vector2d g;
            system.bound_gradient(0, {0.3, v}, 0, g);
            const auto bound = [&](double at) { return system.reaction_set(0, {0.3, at}).upper(); };
            EXPECT_NEAR(g[1], (bound(v + 1e-6) - bound(v - 1e-6)) / 2e-6, 1e-8);
            EXPECT_EQ(g[0], 0);
        }
    }
}

struct Planar {
    static constexpr int state_size = 4;
    static constexpr int reaction_size = 2;
    static void smooth(double, const Eigen::Vector4d&, Eigen::Vector4d& f) { f << 1, 0, 0, 0; }
    static void observe(Eigen::Matrix<double, 2, 4>& e) { e.setIdentity(); }
    static void act(Eigen::Matrix<double, 4, 2>& g) { g.setIdentity(); }
    static Ball<2> reaction_set(double, const Eigen::Vector4d&) { return Ball<2>(0.5); }
};

TEST(StageSolvers, CasesRefuseSetsThatAreNoBoxes)
{
    EXPECT_THROW(CompositeStep<Planar>({}, {.stage = {.method = StageMethod::cases}}),
                 std::invalid_argument);
    EXPECT_NO_THROW(CompositeStep<Planar>({}, {}));
}

// --- states that are sized at run time, stops, user-defined sets ---

struct ManyRelays {
    static constexpr int state_size = Eigen::Dynamic;
    static constexpr int reaction_size = Eigen::Dynamic;
    int n = 6;
    [[nodiscard]] int size() const { return n; }
    [[nodiscard]] int reactions() const { return n; }
    void smooth(double t, const Eigen::VectorXd& w, Eigen::VectorXd& f) const
    {
        f.resize(n);
        for (int i = 0; i < n; ++i) {
            f[i] = std::sin(t + i) - 0.5 * w[i] + (i > 0 ? 0.3 * w[i - 1] : 0.0);
        }
    }
    struct Relays {
        std::size_t n;
        [[nodiscard]] std::size_t dimension() const { return n; }
        static double lower(std::size_t) { return -0.7; }
        static double upper(std::size_t) { return 0.7; }
        void project(std::span<const double> z, std::span<double> p) const
        {
            for (std::size_t i = 0; i < n; ++i) p[i] = std::clamp(z[i], -0.7, 0.7);
        }
        void derivative(std::span<const double> z, std::span<double> d) const
        {
            std::fill(d.begin(), d.end(), 0.0);
            for (std::size_t i = 0; i < n; ++i) d[i * n + i] = std::abs(z[i]) < 0.7 ? 1 : 0;
        }
    };
    [[nodiscard]] Relays reaction_set(double, const Eigen::VectorXd&) const
    {
        return {static_cast<std::size_t>(n)};
    }
};

TEST(SetsOfOnesOwn, SixRelaysOfDynamicSizeMatchTheSameInCases)
{
    // Three relays by cases against the first three of six, which are independent of the others.
    Eigen::VectorXd final[2];
    for (const int n : {3, 6}) {
        SetValuedMotion<ManyRelays> motion(ManyRelays{n}, Eigen::VectorXd::Constant(n, 0.4),
                                           {.t_end = 3, .step = 0.01});
        EXPECT_EQ(motion.run(), Outcome::reached_end);
        final[n == 6] = motion.state().w.head(3);
    }
    EXPECT_LT((final[0] - final[1]).norm(), 1e-9);
}

struct Saturated {
    static constexpr int state_size = 1;
    static constexpr int reaction_size = 1;
    static constexpr Confines confines = Confines::state;
    using V = Eigen::Matrix<double, 1, 1>;
    static void smooth(double t, const V&, V& f) { f[0] = 3 * std::cos(t); }
    static IntervalSet reaction_set(double, const V&) { return IntervalSet(-1, 2); }
};

TEST(Stops, KeepTheStateInsideAndPushOnlyInwards)
{
    // 3 sin t rises to 2 and is held there until the drive turns at pi / 2; then 2 + 3 (sin t - 1)
    // falls to -1 where sin t = 0, and is held until 3 pi / 2.
    for (const auto method : {StageMethod::cases, StageMethod::newton, StageMethod::fixed_point}) {
        SetValuedMotion<Saturated> motion(
            Saturated(), Saturated::V::Zero(),
            {.t_end = 5,
             .step = 1e-3,
             .scheme = {.stage = {.method = method, .tolerance = 1e-11}}});
        double worst = 0;
        EXPECT_EQ(motion.run([&](const auto& s) {
            const double t = s.t;
            const double pi = 3.14159265358979323846;
            const double exact = t < pi / 2       ? std::min(2.0, 3 * std::sin(t))
                                 : t < 3 * pi / 2 ? std::max(-1.0, 2 + 3 * (std::sin(t) - 1))
                                                  : -1 + 3 * (std::sin(t) + 1);
            worst = std::max(worst, std::abs(s.w[0] - exact));
            EXPECT_GE(s.w[0], -1);
            EXPECT_LE(s.w[0], 2);
        }),
                  Outcome::reached_end);
        // The step that meets the stop uses half of its reaction: the error is a step times the
        // drive.
        EXPECT_LT(worst, 3e-3);
    }
}

// --- a relay two integrations away ---

TEST(SuperTwistingMotion, ReachesZeroInFiniteTimeAndStays)
{
    const double step = 1e-3;
    SetValuedMotion<SuperTwisting> motion(
        SuperTwisting(), {1, 0.5},
        {.t_end = 10, .step = step, .scheme = {.scheme = Scheme::backward_euler}});
    double late = 0;
    EXPECT_EQ(motion.run([&](const auto& state) {
        if (state.t > 6) late = std::max(late, std::abs(state.w[0]));
    }),
              Outcome::reached_end)
        << motion.state().t << " " << motion.failure().residual;
    // With implicit discretisation there is no chattering: x1 is zero to rounding, so is x2,
    // and the reaction is minus the rate of the disturbance.
    EXPECT_LT(late, 1e-12);
    EXPECT_NEAR(motion.state().w[1], 0, 1e-9);
    EXPECT_NEAR(motion.state().reaction[0], -std::cos(10.0), 1e-6);
}

}  // namespace
}  // namespace ricochet::stage_test
