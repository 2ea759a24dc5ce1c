// TQC, TD3 and Adam against PyTorch: fixtures/make_policy_losses.py.

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "gradient_check.hpp"
#include "learn_steps/td3_losses.hpp"
#include "learn_steps/tqc_losses.hpp"

namespace ricochet::learn::policy_losses_test {
namespace {

using nlohmann::json;
using Numbers = std::vector<double>;

// Numbers of order one in sums of some dozen terms.
constexpr double tolerance = 1e-13;

const json& fixture()
{
    static const json all =
        json::parse(std::ifstream(RICOCHET_TEST_FIXTURES "/policy_losses.json"));
    return all;
}

std::vector<DenseLayer> layers(const json& from)
{
    std::vector<DenseLayer> out;
    for (const json& layer : from) {
        DenseLayer dense;
        dense.weight = layer.at("weight").get<Numbers>();
        dense.bias = layer.at("bias").get<Numbers>();
        dense.outputs = dense.bias.size();
        dense.inputs = dense.weight.size() / dense.outputs;
        out.push_back(dense);
    }
    return out;
}

/// Networks of one shape, one after the other.
Buffer<double> parameters(const BatchMlp<double>& shape, const json& networks)
{
    Buffer<double> out(networks.size() * shape.size());
    for (std::size_t i = 0; i < networks.size(); ++i) {
        shape.assign(layers(networks[i]), out.data() + i * shape.size());
    }
    return out;
}

Buffer<double> transposed(const BatchMlp<double>& shape, const Buffer<double>& networks)
{
    const std::size_t n = networks.size() / shape.size();
    Buffer<double> out(n * shape.transposed_size());
    for (std::size_t i = 0; i < n; ++i) {
        shape.transpose(networks.data() + i * shape.size(),
                        out.data() + i * shape.transposed_size());
    }
    return out;
}

void expect_equal(const std::vector<DenseLayer>& found, const json& expected)
{
    const std::vector<DenseLayer> wanted = layers(expected);
    ASSERT_EQ(found.size(), wanted.size());
    for (std::size_t k = 0; k < found.size(); ++k) {
        ASSERT_EQ(found[k].weight.size(), wanted[k].weight.size());
        for (std::size_t i = 0; i < found[k].weight.size(); ++i) {
            EXPECT_NEAR(found[k].weight[i], wanted[k].weight[i], tolerance);
        }
        for (std::size_t i = 0; i < found[k].bias.size(); ++i) {
            EXPECT_NEAR(found[k].bias[i], wanted[k].bias[i], tolerance);
        }
    }
}

void fill(const json& from, Transitions<double>& batch)
{
    const auto numbers = [&](const char* name) { return from.at(name).get<Numbers>(); };
    const Numbers states = numbers("states"), actions = numbers("actions"), next = numbers("next");
    const Numbers rewards = numbers("rewards"), terminal = numbers("terminal");
    batch.rows = rewards.size();
    for (std::size_t i = 0; i < batch.rows; ++i) {
        std::vector<float> row;
        const auto put = [&](const Numbers& list, std::size_t n) {
            for (std::size_t k = 0; k < n; ++k) row.push_back(static_cast<float>(list[i * n + k]));
        };
        put(states, batch.observations);
        put(actions, batch.actions);
        put(next, batch.observations);
        put(rewards, 1);
        put(terminal, 1);
        batch.set(i, row.data());
    }
}

std::size_t number(const char* name)
{
    return fixture().at("shape").at(name).get<std::size_t>();
}

std::vector<std::size_t> widths(const char* name)
{
    return fixture().at("shape").at(name).get<std::vector<std::size_t>>();
}

TEST(PolicyLosses, OfTqcAreThoseOfPyTorch)
{
    const json& given = fixture().at("tqc");
    const TqcLosses<double> losses({.observations = number("observations"),
                                    .actions = number("actions"),
                                    .actor = widths("actor"),
                                    .critic = widths("critic"),
                                    .critics = number("critics"),
                                    .quantiles = number("quantiles"),
                                    .dropped = number("dropped")});
    const GaussianActor<double>& shape = losses.actor();
    const std::size_t stride = padded<double>(shape.actions());
    const std::size_t latent = shape.trunk().outputs();
    Buffer<double> actor(shape.size());
    shape.trunk().assign(layers(given.at("trunk")), actor.data());
    shape.mean().assign(layers(given.at("mean")), actor.data() + shape.trunk().size());
    auto noise = shape.noise();
    for (std::size_t j = 0; j < latent; ++j) {
        for (std::size_t a = 0; a < shape.actions(); ++a) {
            const std::size_t i = j * shape.actions() + a;
            actor[shape.deviation_offset() + j * stride + a] = given.at("log_deviation").at(i);
            noise.normal[j * stride + a] = given.at("normal").at(i);
        }
    }
    shape.prepare(actor.data(), noise);
    const Buffer<double> critics = parameters(losses.critic(), given.at("critics"));
    const Buffer<double> targets = parameters(losses.critic(), given.at("targets"));
    const Buffer<double> critics_transposed = transposed(losses.critic(), critics);

    auto work = losses.work(number("batch"));
    fill(given.at("batch"), work.batch);
    const TqcLosses<double>::Parameters p{.actor = actor.data(),
                                          .critics = critics.data(),
                                          .critics_transposed = critics_transposed.data(),
                                          .targets = targets.data(),
                                          .noise = &noise,
                                          .temperature = fixture().at("shape").at("temperature"),
                                          .discount = fixture().at("shape").at("discount"),
                                          .batch = number("batch")};
    Buffer<double> gradient(critics.size());
    EXPECT_NEAR(losses.critic_part(p, work, true, gradient.data()),
                given.at("critic_loss").get<double>(), tolerance);
    for (std::size_t c = 0; c < number("critics"); ++c) {
        SCOPED_TRACE(c);
        expect_equal(losses.critic().layers(gradient.data() + c * losses.critic().size()),
                     given.at("critic_gradient").at(c));
    }

    Buffer<double> by_actor(actor.size());
    const ActorSums sums = losses.actor_part(p, work, by_actor.data());
    EXPECT_NEAR(sums.loss, given.at("actor_loss").get<double>(), tolerance);
    for (std::size_t i = 0; i < work.batch.rows; ++i) {
        EXPECT_NEAR(work.actor.log_density[i], given.at("log_density").at(i).get<double>(),
                    tolerance);
        for (std::size_t a = 0; a < shape.actions(); ++a) {
            EXPECT_NEAR(work.actor.actions[i * stride + a],
                        given.at("action").at(i * shape.actions() + a).get<double>(), tolerance);
        }
    }
    expect_equal(shape.trunk().layers(by_actor.data()), given.at("trunk_gradient"));
    expect_equal(shape.mean().layers(by_actor.data() + shape.trunk().size()),
                 given.at("mean_gradient"));
    for (std::size_t i = 0; i < latent * shape.actions(); ++i) {
        const std::size_t at = i / shape.actions() * stride + i % shape.actions();
        EXPECT_NEAR(by_actor[shape.deviation_offset() + at],
                    given.at("log_deviation_gradient").at(i).get<double>(), tolerance);
    }
}

/// TD3 with the data of the fixture.
struct Td3Problem {
    const json& given = fixture().at("td3");
    Td3Losses<double> losses{{.observations = number("observations"),
                              .actions = number("actions"),
                              .actor = widths("actor"),
                              .critic = widths("critic")}};
    Buffer<double> actor = parameters(losses.actor(), json::array({given.at("actor")}));
    Buffer<double> target_actor =
        parameters(losses.actor(), json::array({given.at("target_actor")}));
    Buffer<double> critics = parameters(losses.critic(), given.at("critics"));
    Buffer<double> targets = parameters(losses.critic(), given.at("targets"));
    Buffer<double> critic_gradient = critics;
    Buffer<double> actor_gradient = actor;

    double loss(bool of_actor)
    {
        const Buffer<double> actor_t = transposed(losses.actor(), actor);
        const Buffer<double> critics_t = transposed(losses.critic(), critics);
        auto work = losses.work(number("batch"));
        fill(given.at("batch"), work.batch);
        const std::size_t actions = number("actions");
        for (std::size_t i = 0; i < work.batch.rows * actions; ++i) {
            work.smoothing[i / actions * padded<double>(actions) + i % actions] =
                given.at("smoothing").at(i);
        }
        const Td3Losses<double>::Parameters p{.actor = actor.data(),
                                              .actor_transposed = actor_t.data(),
                                              .critics = critics.data(),
                                              .critics_transposed = critics_t.data(),
                                              .target_actor = target_actor.data(),
                                              .target_critics = targets.data(),
                                              .discount = fixture().at("shape").at("discount"),
                                              .batch = number("batch")};
        return of_actor ? losses.actor_part(p, work, actor_gradient.data())
                        : losses.critic_part(p, work, critic_gradient.data());
    }
};

TEST(PolicyLosses, OfTd3AreThoseOfPyTorch)
{
    Td3Problem td3;
    EXPECT_NEAR(td3.loss(false), td3.given.at("critic_loss").get<double>(), tolerance);
    EXPECT_NEAR(td3.loss(true), td3.given.at("actor_loss").get<double>(), tolerance);
    const BatchMlp<double>& critic = td3.losses.critic();
    for (std::size_t c = 0; c < 2; ++c) {
        expect_equal(critic.layers(td3.critic_gradient.data() + c * critic.size()),
                     td3.given.at("critic_gradient").at(c));
    }
    expect_equal(td3.losses.actor().layers(td3.actor_gradient.data()),
                 td3.given.at("actor_gradient"));
}

TEST(PolicyLosses, GradientsOfTd3AreThoseOfFiniteDifferences)
{
    Td3Problem td3;
    (void)td3.loss(false);
    (void)td3.loss(true);
    const std::vector<double> by_critics(td3.critic_gradient.begin(), td3.critic_gradient.end());
    expect_gradient(by_critics, td3.critics, [&] { return td3.loss(false); });
    const std::vector<double> by_actor(td3.actor_gradient.begin(), td3.actor_gradient.end());
    expect_gradient(by_actor, td3.actor, [&] { return td3.loss(true); });
}

TEST(PolicyLosses, StepsOfAdamAreThoseOfPyTorch)
{
    const json& given = fixture().at("adam");
    const auto aligned = [](const json& from) {
        const auto list = from.get<Numbers>();
        return Buffer<double>(list.begin(), list.end());
    };
    Buffer<double> p = aligned(given.at("begin")), first(8), second(8), target(8);
    double power1 = 1, power2 = 1;
    for (const json& step : given.at("gradients")) {
        // In two parts, which are summed.
        Buffer<double> gradient = aligned(step);
        for (double& g : gradient) g /= 2;
        gradient.insert(gradient.end(), gradient.begin(), gradient.begin() + 8);
        power1 *= 0.9;
        power2 *= 0.999;
        dense_kernels<double>().adam({.parameters = p.data(),
                                      .gradient = gradient.data(),
                                      .parts = 2,
                                      .part_stride = 8,
                                      .first = first.data(),
                                      .second = second.data(),
                                      .target = target.data(),
                                      .n = 8,
                                      .beta1 = 0.9,
                                      .beta2 = 0.999,
                                      .epsilon = 1e-8,
                                      .rate = 0.1 / (1 - power1),
                                      .root_second = 1 / std::sqrt(1 - power2),
                                      .polyak = 0.25});
    }
    for (std::size_t i = 0; i < 8; ++i) {
        EXPECT_NEAR(p[i], given.at("end").at(i).get<double>(), tolerance);
        EXPECT_NEAR(target[i], given.at("target").at(i).get<double>(), tolerance);
    }
}

}  // namespace
}  // namespace ricochet::learn::policy_losses_test
