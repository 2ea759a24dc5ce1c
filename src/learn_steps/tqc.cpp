#include "ricochet/learn_steps/policies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/require.hpp"
#include "base/workers.hpp"
#include "off_policy.hpp"
#include "tqc_losses.hpp"
#include "trained_vector.hpp"

namespace ricochet::learn {

namespace {

// Number of rows of a batch processed together: few enough for their layers to stay in the cache,
// and independent of the number of threads, so that sums have the same bits.
constexpr std::size_t part_rows = 64;

void check(const TqcOptions& o)
{
    constexpr ricochet::detail::Refuse refuse{"train_tqc"};
    for (const auto* hidden : {&o.actor, &o.critic}) {
        if (hidden->empty() || std::ranges::count(*hidden, std::size_t{0}) > 0) {
            refuse("actor and critic need hidden layers of at least one unit each");
        }
    }
    if (o.critics == 0 || o.quantiles == 0) {
        refuse(fmt::format("expected at least one critic and one quantile, got {} and {}",
                           o.critics, o.quantiles));
    }
    if (o.dropped >= o.quantiles) {
        refuse(
            fmt::format("dropped must be below the {} quantiles, got {}", o.quantiles, o.dropped));
    }
    if (!(o.rate > 0 && std::isfinite(o.rate))) {
        refuse(fmt::format("rate must be positive, got {}", o.rate));
    }
    if (!(o.first_temperature > 0 && std::isfinite(o.first_temperature))) {
        refuse(fmt::format("first_temperature must be positive, got {}", o.first_temperature));
    }
    if (o.noise_interval == 0) refuse("noise_interval must be positive, got 0");
}

/// Adam for one number in double.
struct AdamOfOne {
    std::uint64_t steps = 0;
    double first = 0;
    double second = 0;

    [[nodiscard]] double step(double gradient, double rate)
    {
        ++steps;
        const auto k = static_cast<double>(steps);
        first = 0.9 * first + 0.1 * gradient;
        second = 0.999 * second + 0.001 * gradient * gradient;
        return -rate * first / (1 - std::pow(0.9, k)) /
               (std::sqrt(second / (1 - std::pow(0.999, k))) + 1e-8);
    }
};

class Tqc {
public:
    Tqc(const Environment& environment, const TqcOptions& options)
        : options_(options),
          losses_({.observations = environment.observations,
                   .actions = environment.actions,
                   .actor = options.actor,
                   .critic = options.critic,
                   .critics = options.critics,
                   .quantiles = options.quantiles,
                   .dropped = options.dropped}),
          random_(options.training.seed),
          workers_(options.training.threads),
          actor_(losses_.actor().size(), false),
          critics_(losses_.critics_size(), true),
          critics_transposed_(losses_.critics_transposed_size()),
          noise_(losses_.actor().noise()),
          exploring_(losses_.actor().noise()),
          acting_(losses_.actor().work(1)),
          observation_(padded<float>(environment.observations)),
          log_temperature_(std::log(options.first_temperature))
    {
        losses_.actor().initialise(actor_.data(), random_);
        const BatchMlp<float>& critic = losses_.critic();
        for (std::size_t c = 0; c < options.critics; ++c) {
            critic.initialise(critics_.data() + c * critic.size(), random_);
        }
        critics_.copy_to_target();
        const std::size_t parts = (options.training.batch + part_rows - 1) / part_rows;
        for (std::size_t k = 0; k < parts; ++k) parts_.push_back(losses_.work(part_rows));
        critic_gradient_.resize(parts * critics_.size());
        actor_gradient_.resize(parts * actor_.size());
        sums_.resize(parts);
        critic_losses_.resize(parts);
        prepare();
    }

    void explore(std::span<const double> observation, std::span<double> action)
    {
        if (explored_ % options_.noise_interval == 0) {
            losses_.actor().draw(exploring_, random_);
            losses_.actor().prepare_forward(actor_.data(), exploring_);
        }
        ++explored_;
        std::ranges::transform(observation, observation_.begin(),
                               [](double x) { return static_cast<float>(x); });
        losses_.actor().forward(actor_.data(), exploring_,
                                {observation_.data(), observation_.size()}, 1, acting_);
        std::copy_n(acting_.actions.begin(), action.size(), action.begin());
    }

    void update(const ReplayBuffer& buffer, bool losses)
    {
        draw_batch(buffer);
        losses_.actor().draw(noise_, random_);
        losses_.actor().prepare(actor_.data(), noise_);
        const TqcLosses<float>::Parameters p{
            .actor = actor_.data(),
            .critics = critics_.data(),
            .critics_transposed = critics_transposed_.data(),
            .targets = critics_.target(),
            .noise = &noise_,
            .temperature = static_cast<float>(std::exp(log_temperature_)),
            .discount = static_cast<float>(options_.training.discount),
            .batch = options_.training.batch};
        workers_.run(parts_.size(), [&](std::size_t k) {
            const double loss = losses_.critic_part(p, parts_[k], losses,
                                                    critic_gradient_.data() + k * critics_.size());
            critic_losses_[k] = losses ? loss : std::numeric_limits<double>::quiet_NaN();
        });
        move_critics();
        workers_.run(parts_.size(), [&](std::size_t k) {
            sums_[k] = losses_.actor_part(p, parts_[k], actor_gradient_.data() + k * actor_.size());
        });
        actor_.begin_step();
        actor_.step(0, actor_.size(), actor_gradient_, parts_.size(), options_.rate, 0);
        move_temperature();
    }

    [[nodiscard]] LearnerLosses losses() const
    {
        LearnerLosses out{.critic = 0, .actor = 0, .temperature = std::exp(log_temperature_)};
        for (const double loss : critic_losses_) out.critic += loss;
        for (const ActorSums& sums : sums_) out.actor += sums.loss;
        return out;
    }

    [[nodiscard]] bool finite() const
    {
        return actor_.finite() && critics_.finite() && std::isfinite(log_temperature_);
    }

    [[nodiscard]] std::vector<DenseLayer> layers() const
    {
        return losses_.actor().layers(actor_.data());
    }

    void shape(Writer& writer) const
    {
        for (const auto* hidden : {&options_.actor, &options_.critic}) {
            writer.put(std::vector<std::uint64_t>(hidden->begin(), hidden->end()));
        }
        writer.put(std::uint64_t{options_.critics});
        writer.put(std::uint64_t{options_.quantiles});
    }

    void options(Writer& writer) const
    {
        for (const std::size_t n :
             {options_.critics, options_.quantiles, options_.dropped, options_.noise_interval}) {
            writer.put(std::uint64_t{n});
        }
        writer.put(options_.rate);
        writer.put(options_.first_temperature);
    }

    void reseed(std::uint64_t seed)
    {
        random_ = Random(seed);
        explored_ = 0;
    }

    void save(Writer& writer) const
    {
        actor_.save(writer);
        critics_.save(writer);
        writer.put(log_temperature_);
        writer.put(temperature_adam_.steps);
        writer.put(temperature_adam_.first);
        writer.put(temperature_adam_.second);
        for (const std::uint64_t word : random_.state()) writer.put(word);
        writer.put(explored_);
        for (const Buffer<float>* list : {&exploring_.normal, &exploring_.product}) {
            for (const float value : *list) writer.put(value);
        }
    }

    void load(Reader& reader)
    {
        actor_.load(reader);
        critics_.load(reader);
        reader.get(log_temperature_);
        reader.get(temperature_adam_.steps);
        reader.get(temperature_adam_.first);
        reader.get(temperature_adam_.second);
        Random::State state{};
        for (std::uint64_t& word : state) reader.get(word);
        random_ = Random(state);
        reader.get(explored_);
        for (Buffer<float>* list : {&exploring_.normal, &exploring_.product}) {
            for (float& value : *list) reader.get(value);
        }
        prepare();
    }

private:
    /// Values that depend on the critics' parameters only.
    void prepare()
    {
        for (std::size_t c = 0; c < options_.critics; ++c) transpose(c);
    }

    void transpose(std::size_t c)
    {
        const BatchMlp<float>& critic = losses_.critic();
        critic.transpose(critics_.data() + c * critic.size(),
                         critics_transposed_.data() + c * critic.transposed_size());
    }

    void draw_batch(const ReplayBuffer& buffer)
    {
        for (std::size_t k = 0; k < parts_.size(); ++k) {
            Transitions<float>& rows = parts_[k].batch;
            rows.rows = std::min(part_rows, options_.training.batch - k * part_rows);
            for (std::size_t i = 0; i < rows.rows; ++i) {
                rows.set(i, buffer[random_.below(buffer.size())]);
            }
        }
    }

    void move_critics()
    {
        critics_.begin_step();
        workers_.run(options_.critics, [this](std::size_t c) {
            const std::size_t size = losses_.critic().size();
            critics_.step(c * size, size, critic_gradient_, parts_.size(), options_.rate,
                          options_.training.polyak);
            transpose(c);
        });
    }

    /// Descends the gradient of -log(temperature) times the mean of log density + target, where the
    /// target is an entropy of -1 per action.
    void move_temperature()
    {
        double mean = 0;
        for (const ActorSums& sums : sums_) mean += sums.log_density;
        mean /= static_cast<double>(options_.training.batch);
        const double target = -static_cast<double>(losses_.actor().actions());
        log_temperature_ += temperature_adam_.step(-(mean + target), options_.rate);
    }

    const TqcOptions& options_;
    TqcLosses<float> losses_;
    Random random_;
    ricochet::detail::Workers workers_;
    TrainedVector actor_;
    TrainedVector critics_;
    Buffer<float> critics_transposed_;
    GaussianActor<float>::Noise noise_;      ///< of the update
    GaussianActor<float>::Noise exploring_;  ///< of the actions
    GaussianActor<float>::Work acting_;
    Buffer<float> observation_;
    double log_temperature_;
    AdamOfOne temperature_adam_;
    std::uint64_t explored_ = 0;
    std::vector<TqcLosses<float>::Work> parts_;
    Buffer<float> critic_gradient_, actor_gradient_;  ///< one per part
    std::vector<ActorSums> sums_;
    std::vector<double> critic_losses_;
};

}  // namespace

TrainedPolicy train_tqc(const Environment& environment, const TqcOptions& options,
                        const PolicyCallback& progress)
{
    check("train_tqc", environment, options.training);
    check(options);
    Tqc tqc(environment, options);
    return train_policy(
        environment, options.training,
        {.name = "train_tqc",
         .explore = [&](auto observation, auto action) { tqc.explore(observation, action); },
         .update = [&](const ReplayBuffer& buffer, bool losses) { tqc.update(buffer, losses); },
         .losses = [&] { return tqc.losses(); },
         .finite = [&] { return tqc.finite(); },
         .layers = [&] { return tqc.layers(); },
         .shape = [&](Writer& writer) { tqc.shape(writer); },
         .options = [&](Writer& writer) { tqc.options(writer); },
         .save = [&](Writer& writer) { tqc.save(writer); },
         .load = [&](Reader& reader) { tqc.load(reader); },
         .reseed = [&](std::uint64_t seed) { tqc.reseed(seed); }},
        progress);
}

}  // namespace ricochet::learn
