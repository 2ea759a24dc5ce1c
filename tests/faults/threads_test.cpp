// Eight threads share one system and one model; each run has the bits of the run on one thread.
// It is built with the thread sanitizer too, which finds errors that equal results may hide.
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "problems/cavern.hpp"
#include "problems/least_eigenvalue.hpp"
#include "problems/planar_arm.hpp"
#include "ricochet/detail/features.hpp"
#include "ricochet/faults/friction.hpp"
#include "ricochet/faults/strike_slip_fault.hpp"
#include "ricochet/gates.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/nonsmooth/hand_over.hpp"
#include "ricochet/nonsmooth/set_valued_motion.hpp"
#include "ricochet/planned.hpp"
#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/sliding_mode.hpp"

namespace ricochet::threads_test {
namespace {

const std::string models = RICOCHET_MODELS "/";

using Numbers = std::vector<double>;

/// The results of `work` in one thread and in each of eight that begin together.
void expect_the_same_in_eight_threads(const std::function<Numbers()>& work)
{
    const Numbers alone = work();
    ASSERT_FALSE(alone.empty());
    std::array<Numbers, 8> found;
    {
        std::vector<std::jthread> threads;
        for (Numbers& mine : found) threads.emplace_back([&] { mine = work(); });
    }
    for (const Numbers& mine : found) EXPECT_EQ(mine, alone);
}

template <class X>
Numbers numbers_of(const Run<X>& run)
{
    Numbers out{run.t, static_cast<double>(run.statistics.guard_calls)};
    for (const auto& event : run.events) out.push_back(event.t);
    for (std::size_t i = 0; i < run.x.size(); ++i) out.push_back(run.x[i]);
    return out;
}

TEST(Threads, ShareABallAndItsNetworks)
{
    const BouncingBall ball;
    const std::array<double, 2> start{10, 0};
    const Options options{.t_end = 20};
    const BareNetwork network(load_model(models + "bouncing-ball.safetensors"));
    const Verified<Extremum> verified(network);
    const Classifier classifier(load_model(models + "bouncing-ball.safetensors"));
    expect_the_same_in_eight_threads([&] {
        Numbers out = numbers_of(integrate(ball, start, options));
        for (const double number : numbers_of(
                 integrate(ball, start, {.t_end = 20, .step = 0.01}, FixedStep<Rk4>{}, network))) {
            out.push_back(number);
        }
        for (const double number : numbers_of(
                 integrate(ball, start, {.t_end = 20, .step = 0.01}, FixedStep<Rk4>{}, verified))) {
            out.push_back(number);
        }
        std::vector<double> features(classifier.inputs(), 0.3);
        for (int i = 0; i < 100; ++i) {
            features[0] = 0.01 * i;
            out.push_back(classifier.logit(features.data()));
        }
        return out;
    });
}

TEST(Threads, ShareScenesWithBounds)
{
    const Cavern cavern({.segments = 200});
    expect_the_same_in_eight_threads([&] {
        return numbers_of(integrate(cavern, cavern.start(), {.t_end = 3, .step = 1e-3},
                                    FixedStep<Rk4>{}, Planned<>{}));
    });
    const PlanarArm<2> arm;
    expect_the_same_in_eight_threads(
        [&] { return numbers_of(integrate(arm, arm.start(), {.t_end = 0.2})); });
}

TEST(Threads, ShareACertificate)
{
    const LeastEigenvalue system(LeastEigenvalue::Parameters{});
    const Certified<> certified(load_model(models + "eigenvalue-certified.safetensors"));
    expect_the_same_in_eight_threads([&] {
        return numbers_of(integrate(system, system.start(), {.t_end = 0.5, .step = 1e-3},
                                    FixedStep<Rk4>{}, certified));
    });
}

TEST(Threads, ShareAnInclusionAndItsPolicy)
{
    const SlidingMode system;
    const SlidingMode::Vector start(SlidingMode::start);
    const auto policy =
        std::make_shared<const StepPolicy>(load_model(models + "sliding-mode-step.safetensors"));
    const SetValuedOptions options{
        .t_end = SlidingMode::t_end,
        .step = 1e-3,
        .controller = LearnedStep{.policy = policy},
        .estimate = ErrorEstimate::embedded,
        .rtol = 1e-3,
        .fields = {{.first = 0, .count = 1, .rtol = 1e-3, .floor = 0.15}},
        .scheme = {.first_stage = FirstStage::switch_aware}};
    expect_the_same_in_eight_threads([&] {
        Numbers out;
        SetValuedMotion motion(system, start, options);
        motion.run([&](const auto& now) { out.insert(out.end(), {now.t, now.w[0]}); });
        HandOver run(system, start, {.t_end = SlidingMode::t_end});
        const auto done = run.take();
        out.insert(out.end(), {done.t, done.x[0]});
        return out;
    });
}

TEST(Threads, ShareAFaultAndItsPolicy)
{
    const StrikeSlipFault fault({.elements = 3});
    const auto policy =
        std::make_shared<const StepPolicy>(load_model(models + "fault-step.safetensors"));
    const BatheOptions learned{.controller = LearnedStep{.policy = policy},
                               .estimate = ErrorEstimate::embedded,
                               .rtol = 1e-2};
    expect_the_same_in_eight_threads([&] {
        const Rupture by_pair = simulate(fault, {.t_end = 10});
        const Rupture by_stages = simulate(fault, {.t_end = 10, .step = 0.1}, learned);
        return Numbers{by_pair.mean_slip, by_pair.peak_velocity, by_stages.mean_slip,
                       static_cast<double>(by_stages.statistics.iterations)};
    });
}

TEST(Threads, ShareALearnedPotential)
{
    const AdditivePair pair = load_pair(models + "ageing-friction.json");
    expect_the_same_in_eight_threads([&] {
        Numbers out;
        for (const double xi : {-3.0, 0.0, 3.0}) {
            const FrictionAndRate at = pair.evaluate(1e-5, xi);
            out.insert(out.end(), {at.friction, at.rate, pair.rate_potential(1e-5, xi).value});
        }
        return out;
    });
}

TEST(Threads, LoadOneFileTogether)
{
    expect_the_same_in_eight_threads([&] {
        const Model model = load_model(models + "fault-step.safetensors");
        return model.layers.front().weight;
    });
}

}  // namespace
}  // namespace ricochet::threads_test
