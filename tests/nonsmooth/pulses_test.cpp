// Loads that jump while reactions hold: the steps after the slip are as long as those before.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <utility>

#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/systems/diode_circuit.hpp"
#include "ricochet/systems/friction_inclusion.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::pulses_test {
namespace {

/// i' = s(t) - 1 + u, u >= 0 while i = 0: a diode behind a chopper, s = 2 in the first 0.4 of each
/// second and 0 in the rest.
struct Chopper {
    static constexpr int state_size = 1, reaction_size = 1;
    using W = Eigen::Matrix<double, 1, 1>;
    void smooth(double t, const W&, W& f) const { f[0] = (t - std::floor(t) < 0.4 ? 2 : 0) - 1; }
    [[nodiscard]] sets::IntervalSet reaction_set(double, const W&) const
    {
        return sets::IntervalSet::half_line();
    }
};

TEST(Pulses, ADiodeBehindAChopperTakesFewStepsThoughItsHeldPhaseEndsSharply)
{
    const auto run = hand_over(Chopper{}, Chopper::W{0}, {.t_end = 1.2});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    EXPECT_NEAR(run.x[0], 0.2, 1e-8);
    EXPECT_LE(run.statistics.steps, 300u);
}

/// 1 kg with friction 1 N: the load 0.5 N, from t = 1 on 1.5 N.
struct Brake {
    static constexpr int state_size = 1, reaction_size = 1;
    using W = Eigen::Matrix<double, 1, 1>;
    void smooth(double t, const W&, W& f) const { f[0] = t < 1 ? 0.5 : 1.5; }
    [[nodiscard]] sets::IntervalSet reaction_set(double, const W&) const { return {-1, 1}; }
};

TEST(Pulses, ABlockThatAStepOfItsLoadReleasesTakesFewSteps)
{
    const auto run = hand_over(Brake{}, Brake::W{0}, {.t_end = 3});
    ASSERT_EQ(run.outcome, Outcome::reached_end);
    ASSERT_EQ(run.events.size(), 1u);
    EXPECT_NEAR(run.events[0].t, 1, 1e-8);
    EXPECT_NEAR(run.x[0], 1, 1e-8);
    EXPECT_LE(run.statistics.steps, 300u);
}

/// A ready inclusion with a load of `size` on one component between two times.
template <class System>
struct Pulsed : System {
    int component;
    double size, from, to;

    Pulsed(const System& system, int on, double load, double begin, double end)
        : System(system), component(on), size(load), from(begin), to(end)
    {
    }
    void smooth(double t, const typename System::Vector& w, typename System::Vector& f) const
    {
        System::smooth(t, w, f);
        if (t >= from && t < to) f[component] += size;
    }
};

/// The pulse is one phase of three runs, each with a constant load; the run across its ends comes
/// to the same state, in not many more steps.
template <class System>
void expect_few_steps(const Pulsed<System>& pulsed, const typename System::Vector& w0, double t_end)
{
    const auto whole = hand_over(pulsed, w0, {.t_end = t_end});
    ASSERT_EQ(whole.outcome, Outcome::reached_end);
    std::uint64_t steps = 0;
    typename System::Vector w = w0;
    const std::pair<double, double> spans[] = {
        {0, pulsed.from}, {pulsed.from, pulsed.to}, {pulsed.to, t_end}};
    for (const auto& [from, to] : spans) {
        Pulsed<System> part = pulsed;
        part.from = from == pulsed.from ? -1 : t_end + 1;
        part.to = t_end + 2;
        const auto run = hand_over(part, w, {.t_start = from, .t_end = to});
        ASSERT_EQ(run.outcome, Outcome::reached_end);
        steps += run.statistics.steps;
        w = run.x;
    }
    EXPECT_LE(whole.statistics.steps, 2 * steps + 300);
    EXPECT_LE((whole.x - w).cwiseAbs().maxCoeff(), 1e-7);
}

TEST(Pulses, EveryReadyInclusionGoesOnWithLongStepsAfterAPulseThatReleasesIt)
{
    expect_few_steps(Pulsed(SlidingMode(), 0, 3.0, 0.5, 0.52), SlidingMode::Vector(0.0), 1);
    expect_few_steps(Pulsed(FrictionInclusion(), 1, 1.0, 1.0, 1.5),
                     FrictionInclusion::Vector(0.1, 0), 4);
    expect_few_steps(Pulsed(DiodeCircuit(), 0, 2.0, 1.0, 1.3), DiodeCircuit::Vector(0, 0.1, 0.1),
                     3);
}

/// An oscillator whose period is 1e-11 of the run.
struct Fast {
    static constexpr int state_size = 2, reaction_size = 1;
    using W = Eigen::Vector2d;
    void smooth(double, const W& w, W& f) const { f << w[1] * 1e12, -w[0] * 1e12; }
    [[nodiscard]] sets::IntervalSet reaction_set(double, const W&) const { return {-1, 1}; }
    void offset(double, Eigen::Matrix<double, 1, 1>& s) const { s[0] = 10; }
    void offset_rate(double, Eigen::Matrix<double, 1, 1>& rate) const { rate[0] = 0; }
};

TEST(Pulses, ARunWhoseStepsHardlyAdvanceItEndsAsStalled)
{
    const auto run = hand_over(Fast{}, Fast::W(1, 0), {.t_end = 10, .stall_steps = 500});
    EXPECT_EQ(run.outcome, Outcome::stalled);
    const auto option = integrate(Fast{}, Fast::W(1, 0), {.t_end = 10, .stall_steps = 500});
    EXPECT_EQ(option.outcome, Outcome::stalled);
}

}  // namespace
}  // namespace ricochet::pulses_test
