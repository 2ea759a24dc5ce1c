#include "ricochet/learn_steps/policies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/require.hpp"
#include "base/workers.hpp"
#include "off_policy.hpp"
#include "td3_losses.hpp"
#include "trained_vector.hpp"

namespace ricochet::learn {

namespace {

constexpr std::size_t part_rows = 64;  // as in tqc.cpp

void check(const Td3Options& o)
{
    constexpr ricochet::detail::Refuse refuse{"train_td3"};
    for (const auto* hidden : {&o.actor, &o.critic}) {
        if (hidden->empty() || std::ranges::count(*hidden, std::size_t{0}) > 0) {
            refuse("actor and critic need hidden layers of at least one unit each");
        }
    }
    if (!(o.rate > 0 && std::isfinite(o.rate))) {
        refuse(fmt::format("rate must be positive, got {}", o.rate));
    }
    for (const auto& [value, what] : {std::pair{o.exploration, "exploration"},
                                      {o.smoothing, "smoothing"},
                                      {o.smoothing_bound, "smoothing_bound"}}) {
        if (!(value >= 0 && std::isfinite(value))) {
            refuse(fmt::format("{} must not be negative, got {}", what, value));
        }
    }
    if (o.delay == 0) refuse("delay must be positive, got 0");
}

class Td3 {
public:
    Td3(const Environment& environment, const Td3Options& options)
        : options_(options),
          losses_({.observations = environment.observations,
                   .actions = environment.actions,
                   .actor = options.actor,
                   .critic = options.critic}),
          random_(options.training.seed),
          workers_(options.training.threads),
          actor_(losses_.actor().size(), true),
          critics_(losses_.shape().critics * losses_.critic().size(), true),
          actor_transposed_(losses_.actor().transposed_size()),
          critics_transposed_(losses_.shape().critics * losses_.critic().transposed_size()),
          acting_(losses_.actor().work(1)),
          observation_(padded<float>(environment.observations))
    {
        losses_.actor().initialise(actor_.data(), random_);
        for (std::size_t c = 0; c < losses_.shape().critics; ++c) {
            losses_.critic().initialise(critics_.data() + c * losses_.critic().size(), random_);
        }
        actor_.copy_to_target();
        critics_.copy_to_target();
        const std::size_t parts = (options.training.batch + part_rows - 1) / part_rows;
        for (std::size_t k = 0; k < parts; ++k) parts_.push_back(losses_.work(part_rows));
        critic_gradient_.resize(parts * critics_.size());
        actor_gradient_.resize(parts * actor_.size());
        critic_losses_.resize(parts);
        actor_losses_.resize(parts);
        prepare();
    }

    void explore(std::span<const double> observation, std::span<double> action)
    {
        std::ranges::transform(observation, observation_.begin(),
                               [](double x) { return static_cast<float>(x); });
        const Rows<float> out = losses_.actor().forward(
            actor_.data(), {observation_.data(), observation_.size()}, 1, acting_);
        for (std::size_t a = 0; a < action.size(); ++a) {
            const double best = std::tanh(static_cast<double>(out.data[a]));
            action[a] = std::clamp(best + options_.exploration * random_.normal(), -1.0, 1.0);
        }
    }

    void update(const ReplayBuffer& buffer)
    {
        ++updates_;
        const bool delayed = updates_ % options_.delay == 0;
        draw_batch(buffer);
        const Td3Losses<float>::Parameters p{
            .actor = actor_.data(),
            .actor_transposed = actor_transposed_.data(),
            .critics = critics_.data(),
            .critics_transposed = critics_transposed_.data(),
            .target_actor = actor_.target(),
            .target_critics = critics_.target(),
            .discount = static_cast<float>(options_.training.discount),
            .batch = options_.training.batch};
        workers_.run(parts_.size(), [&](std::size_t k) {
            critic_losses_[k] =
                losses_.critic_part(p, parts_[k], critic_gradient_.data() + k * critics_.size());
        });
        move_critics(delayed);
        if (!delayed) return;
        workers_.run(parts_.size(), [&](std::size_t k) {
            actor_losses_[k] =
                losses_.actor_part(p, parts_[k], actor_gradient_.data() + k * actor_.size());
        });
        actor_.begin_step();
        actor_.step(0, actor_.size(), actor_gradient_, parts_.size(), options_.rate,
                    options_.training.polyak);
        losses_.actor().transpose(actor_.data(), actor_transposed_.data());
    }

    [[nodiscard]] LearnerLosses losses() const
    {
        LearnerLosses out;
        for (const double loss : critic_losses_) out.critic += loss;
        for (const double loss : actor_losses_) out.actor += loss;
        return out;
    }

    [[nodiscard]] bool finite() const { return actor_.finite() && critics_.finite(); }

    [[nodiscard]] std::vector<DenseLayer> layers() const
    {
        return losses_.actor().layers(actor_.data());
    }

    void shape(Writer& writer) const
    {
        for (const auto* hidden : {&options_.actor, &options_.critic}) {
            writer.put(std::vector<std::uint64_t>(hidden->begin(), hidden->end()));
        }
    }

    void options(Writer& writer) const
    {
        for (const double x :
             {options_.rate, options_.exploration, options_.smoothing, options_.smoothing_bound}) {
            writer.put(x);
        }
        writer.put(std::uint64_t{options_.delay});
    }

    void reseed(std::uint64_t seed)
    {
        random_ = Random(seed);
        updates_ = 0;
    }

    void save(Writer& writer) const
    {
        actor_.save(writer);
        critics_.save(writer);
        for (const std::uint64_t word : random_.state()) writer.put(word);
        writer.put(updates_);
        writer.put(actor_losses_);
    }

    void load(Reader& reader)
    {
        actor_.load(reader);
        critics_.load(reader);
        Random::State state{};
        for (std::uint64_t& word : state) reader.get(word);
        random_ = Random(state);
        reader.get(updates_);
        reader.get(actor_losses_);
        prepare();
    }

private:
    void prepare()
    {
        losses_.actor().transpose(actor_.data(), actor_transposed_.data());
        for (std::size_t c = 0; c < losses_.shape().critics; ++c) transpose(c);
    }

    void transpose(std::size_t c)
    {
        const BatchMlp<float>& critic = losses_.critic();
        critic.transpose(critics_.data() + c * critic.size(),
                         critics_transposed_.data() + c * critic.transposed_size());
    }

    void draw_batch(const ReplayBuffer& buffer)
    {
        const std::size_t stride = padded<float>(buffer.actions());
        for (std::size_t k = 0; k < parts_.size(); ++k) {
            Transitions<float>& rows = parts_[k].batch;
            rows.rows = std::min(part_rows, options_.training.batch - k * part_rows);
            for (std::size_t i = 0; i < rows.rows; ++i) {
                rows.set(i, buffer[random_.below(buffer.size())]);
                for (std::size_t a = 0; a < buffer.actions(); ++a) {
                    parts_[k].smoothing[i * stride + a] = static_cast<float>(
                        std::clamp(options_.smoothing * random_.normal(), -options_.smoothing_bound,
                                   options_.smoothing_bound));
                }
            }
        }
    }

    void move_critics(bool with_targets)
    {
        critics_.begin_step();
        workers_.run(losses_.shape().critics, [&](std::size_t c) {
            const std::size_t size = losses_.critic().size();
            critics_.step(c * size, size, critic_gradient_, parts_.size(), options_.rate,
                          with_targets ? options_.training.polyak : 0);
            transpose(c);
        });
    }

    const Td3Options& options_;
    Td3Losses<float> losses_;
    Random random_;
    ricochet::detail::Workers workers_;
    TrainedVector actor_;
    TrainedVector critics_;
    Buffer<float> actor_transposed_, critics_transposed_;
    BatchMlp<float>::Work acting_;
    Buffer<float> observation_;
    std::uint64_t updates_ = 0;
    std::vector<Td3Losses<float>::Work> parts_;
    Buffer<float> critic_gradient_, actor_gradient_;  ///< one per part
    std::vector<double> critic_losses_, actor_losses_;
};

}  // namespace

TrainedPolicy train_td3(const Environment& environment, const Td3Options& options,
                        const PolicyCallback& progress)
{
    check("train_td3", environment, options.training);
    check(options);
    Td3 td3(environment, options);
    return train_policy(
        environment, options.training,
        {.name = "train_td3",
         .explore = [&](auto observation, auto action) { td3.explore(observation, action); },
         .update = [&](const ReplayBuffer& buffer, bool) { td3.update(buffer); },
         .losses = [&] { return td3.losses(); },
         .finite = [&] { return td3.finite(); },
         .layers = [&] { return td3.layers(); },
         .shape = [&](Writer& writer) { td3.shape(writer); },
         .options = [&](Writer& writer) { td3.options(writer); },
         .save = [&](Writer& writer) { td3.save(writer); },
         .load = [&](Reader& reader) { td3.load(reader); },
         .reseed = [&](std::uint64_t seed) { td3.reseed(seed); }},
        progress);
}

}  // namespace ricochet::learn
