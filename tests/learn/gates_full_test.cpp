// Trained gates before guards of which only the sign or the value is known: calls of the guard
// saved, and events missed. Calls are counted; a guard of 50 us costs its calls times 50 us,
// compared with which steps and networks are negligible.
#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "problems/opaque.hpp"
#include "problems/planar_arm.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/learn/train.hpp"

namespace ricochet::gates_full_test {
namespace {

using learn::GateTraining;
using learn::GateTrial;
using learn::Random;
using learn::RunStart;

constexpr double step = 1e-3;  // [s]
constexpr std::uint64_t seed = 99;

GateTraining arm_training(std::size_t events)
{
    GateTraining training;
    training.recipe = gate_recipe("chain");
    training.levels = learn::horizons(step, {2, 4, 8, 16, 32, 64});
    training.step_min = training.step_max = step;
    training.run_length = 100;
    training.hidden = {64, 64};
    training.events = 20'000;
    training.validation_events = 10'000;
    training.iterations = 6000;
    training.fresh_events = events;
    // Contacts of four to seven steps, two of 30 000, are practically invisible from a distance:
    // margins of 0.25 and of 3 clear steps before them.
    training.logit_margin = 10;
    return training;
}

/// A gate for an arm seen through `Wrapped`, beside checks of every k-th step.
template <class Wrapped, std::size_t N>
void compare_on_arm(std::size_t obstacles, std::size_t events,
                    const std::vector<std::size_t>& every, double least_gain)
{
    using X = typename PlanarArm<N>::State;
    const PlanarArm<N> arm({.obstacles = obstacles});
    const Wrapped system(arm, 0);
    // From rest, at any phase of its drives.
    const learn::Starts<X> starts = [start = arm.start()](Random& random) {
        return RunStart<X>{.t = random.uniform(0, 1e4), .x = start};
    };
    const GateTraining training = arm_training(events);
    learn::GateRuns<Wrapped, X, FixedStep<Rk4>> runs(system, starts, {}, training);
    const learn::TrainedGate trained =
        learn::train_gate(system, starts, FixedStep<Rk4>{}, {}, training);
    const GateTrial gate = runs.compare(Calibrated(gates::Gate(trained.model)), events, seed);
    EXPECT_EQ(gate.misses, 0U);
    EXPECT_GE(gate.events, events);
    EXPECT_GE(gate.gain(), least_gain);
    for (const std::size_t k : every) {
        const GateTrial rival = runs.compare(EveryK(k), events, seed);
        if (rival.misses <= gate.misses) {
            EXPECT_GE(gate.gain(), 1.5 * rival.gain()) << k;
        }
    }
}

TEST(GatesInFull, ABlackBoxAroundAnArmIsAskedAQuarterAsOftenWithoutAMiss)
{
    compare_on_arm<BlackBox<PlanarArm<4>>, 4>(8, 30'000, {2, 3, 4, 5, 6, 8, 16}, 4);
}

}  // namespace
}  // namespace ricochet::gates_full_test
