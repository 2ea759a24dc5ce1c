#include "off_policy.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "base/require.hpp"
#include "learn/limits.hpp"

namespace ricochet::learn {

namespace {

constexpr std::string_view first_line = "ricochet policy checkpoint 1\n";

/// The part of the loop that a checkpoint holds; the learner and the buffer add theirs.
struct State {
    std::uint64_t step = 0;
    std::uint64_t episodes = 0;
    double seconds = 0;
    Random::State actions{};  ///< of the uniform ones
    Random::State episode_seeds{};
    std::uint64_t episode_seed = 0;
    std::vector<double> episode_actions;  ///< of the current episode, one after the other
    std::vector<double> observation;
    double episode_return = 0;
    double returns = 0;  ///< summed since the last report
    std::uint64_t returned = 0;
    std::vector<double> lowest, highest;  ///< of the observations
};

template <class Stream, class Member>
void fields(Member&& member, Stream&& s)
{
    member(s.step);
    member(s.episodes);
    member(s.seconds);
    for (auto& word : s.actions) member(word);
    for (auto& word : s.episode_seeds) member(word);
    member(s.episode_seed);
    member(s.episode_actions);
    member(s.observation);
    member(s.episode_return);
    member(s.returns);
    member(s.returned);
    member(s.lowest);
    member(s.highest);
}

class Training {
public:
    Training(const Environment& environment, const PolicyTraining& options, const Learner& learner)
        : environment_(environment),
          options_(options),
          learner_(learner),
          buffer_(environment.observations, environment.actions, options.buffer),
          action_(environment.actions),
          next_(environment.observations)
    {
        Random seeds(options.seed);
        s_.actions = Random(seeds.bits()).state();
        s_.episode_seeds = Random(seeds.bits()).state();
        s_.observation.resize(environment.observations);
        s_.lowest.assign(environment.observations, infinity);
        s_.highest.assign(environment.observations, -infinity);
        shape_ = shape();
        fingerprint_ = fingerprint();
        if (options.resume) {
            resume();
        } else {
            if (!options.start_from.empty()) start_from_other();
            begin_episode();
        }
    }

    TrainedPolicy run(const PolicyCallback& progress)
    {
        start_ = std::chrono::steady_clock::now();
        before_ = s_.seconds;
        good_ = model();
        std::optional<PolicyOutcome> outcome = found_;
        while (!outcome) {
            if (s_.step >= options_.steps) {
                outcome = PolicyOutcome::finished;
            } else if (s_.seconds >= options_.max_seconds) {
                outcome = PolicyOutcome::max_seconds;
            } else {
                outcome = step();
            }
            const bool due = s_.step % options_.report_every == 0 && s_.step != reported_;
            const bool last =
                outcome == PolicyOutcome::finished || outcome == PolicyOutcome::max_seconds;
            if (due || (last && s_.step != reported_)) {
                const std::optional<PolicyOutcome> cut = report(progress);
                if (cut && (!outcome || *cut == PolicyOutcome::diverged)) outcome = cut;
            }
        }
        return {.outcome = *outcome,
                .message = message_,
                .policy = learner_.finite() ? model() : good_,
                .curve = curve_,
                .steps = static_cast<std::size_t>(s_.step),
                .episodes = static_cast<std::size_t>(s_.episodes),
                .seconds = s_.seconds,
                .checkpoint_trouble = keep_.trouble()};
    }

private:
    /// Acts, stores the transition, and learns. Returns an outcome if it cannot continue.
    std::optional<PolicyOutcome> step()
    {
        choose_action();
        for (const double a : action_) {
            if (!std::isfinite(a)) {
                message_ = fmt::format("the action is {} at step {}", a, s_.step + 1);
                return PolicyOutcome::diverged;
            }
        }
        const Reaction reaction = environment_.step(action_, next_);
        if (!check(reaction)) return PolicyOutcome::non_finite;
        buffer_.push(s_.observation, action_, reaction.reward, reaction.terminal, next_);
        s_.episode_actions.insert(s_.episode_actions.end(), action_.begin(), action_.end());
        s_.episode_return += reaction.reward;
        s_.observation = next_;
        look();
        ++s_.step;
        if (s_.step > options_.random_steps) {
            const bool reported = s_.step % options_.report_every == 0 || s_.step == options_.steps;
            learner_.update(buffer_, reported);
        }
        const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - start_;
        s_.seconds = before_ + spent.count();
        if (reaction.terminal || reaction.truncated) {
            ++s_.episodes;
            ++s_.returned;
            s_.returns += s_.episode_return;
            begin_episode();
        }
        return found_;
    }

    void choose_action()
    {
        if (s_.step >= options_.random_steps || !options_.start_from.empty()) {
            learner_.explore(s_.observation, action_);
            return;
        }
        Random random(s_.actions);
        for (double& a : action_) a = random.uniform(-1, 1);
        s_.actions = random.state();
    }

    void begin_episode()
    {
        Random seeds(s_.episode_seeds);
        s_.episode_seed = seeds.bits();
        s_.episode_seeds = seeds.state();
        s_.episode_actions.clear();
        s_.episode_return = 0;
        environment_.reset(s_.episode_seed, s_.observation);
        if (finite(s_.observation)) {
            look();
        } else {
            found_ = PolicyOutcome::non_finite;
        }
    }

    /// Updates the range of the observations.
    void look()
    {
        for (std::size_t i = 0; i < s_.observation.size(); ++i) {
            s_.lowest[i] = std::min(s_.lowest[i], s_.observation[i]);
            s_.highest[i] = std::max(s_.highest[i], s_.observation[i]);
        }
    }

    [[nodiscard]] bool check(const Reaction& reaction)
    {
        if (!std::isfinite(static_cast<float>(reaction.reward))) {
            message_ = fmt::format("the reward is {} {}", reaction.reward, where());
            return false;
        }
        return finite(next_);
    }

    [[nodiscard]] bool finite(const std::vector<double>& observation)
    {
        for (std::size_t i = 0; i < observation.size(); ++i) {
            // Networks take it as float.
            if (std::isfinite(static_cast<float>(observation[i]))) continue;
            message_ =
                fmt::format("component {} of the observation is {} {}", i, observation[i], where());
            return false;
        }
        return true;
    }

    [[nodiscard]] std::string where() const
    {
        const std::size_t steps = s_.episode_actions.size() / action_.size();
        return fmt::format("at step {}, which is step {} of the episode of seed {}", s_.step + 1,
                           steps + 1, s_.episode_seed);
    }

    std::optional<PolicyOutcome> report(const PolicyCallback& progress)
    {
        if (!learner_.finite()) {
            message_ = fmt::format("weights are not finite after step {}", s_.step);
            return PolicyOutcome::diverged;
        }
        good_ = model();
        reported_ = s_.step;
        const LearnerLosses losses =
            s_.step > options_.random_steps ? learner_.losses() : LearnerLosses{nan, nan, nan};
        curve_.push_back(
            {.step = static_cast<std::size_t>(s_.step),
             .steps = options_.steps,
             .episodes = static_cast<std::size_t>(s_.episodes),
             .mean_return = s_.returned > 0 ? s_.returns / static_cast<double>(s_.returned) : nan,
             .critic_loss = losses.critic,
             .actor_loss = losses.actor,
             .temperature = losses.temperature,
             .seconds = s_.seconds});
        s_.returns = 0;
        s_.returned = 0;
        keep_([this] { save(); });
        if (progress && !progress(curve_.back(), good_)) return PolicyOutcome::stopped;
        return std::nullopt;
    }

    [[nodiscard]] Model model() const
    {
        Model model;
        model.activation = Activation::relu;
        model.seed = options_.seed;
        model.layers = learner_.layers();
        model.offset.assign(environment_.observations, 0.0);
        model.scale.assign(environment_.observations, 1.0);
        for (std::size_t i = 0; i < environment_.observations; ++i) {
            const bool seen = s_.lowest[i] <= s_.highest[i];
            model.domain.push_back({seen ? s_.lowest[i] : 0, seen ? s_.highest[i] : 0});
        }
        return model;
    }

    [[nodiscard]] std::uint64_t shape() const
    {
        Writer all;
        all.put(std::uint64_t{environment_.observations});
        all.put(std::uint64_t{environment_.actions});
        learner_.shape(all);
        return checksum(learner_.name + all.bytes());
    }

    [[nodiscard]] std::uint64_t fingerprint() const
    {
        Writer all;
        all.put(shape_);
        all.put(std::uint64_t{!options_.start_from.empty()});
        for (const std::size_t n : {options_.random_steps, options_.batch, options_.buffer}) {
            all.put(std::uint64_t{n});
        }
        all.put(options_.discount);
        all.put(options_.polyak);
        all.put(options_.seed);
        learner_.options(all);
        return checksum(all.bytes());
    }

    void save() const
    {
        Writer writer;
        writer.put(shape_);
        writer.put(fingerprint_);
        fields([&writer](const auto& member) { writer.put(member); }, s_);
        writer.put(std::uint64_t{curve_.size()});
        for (const PolicyProgress& p : curve_) {
            for (const std::size_t n : {p.step, p.steps, p.episodes}) writer.put(std::uint64_t{n});
            for (const double x :
                 {p.mean_return, p.critic_loss, p.actor_loss, p.temperature, p.seconds}) {
                writer.put(x);
            }
        }
        buffer_.save(writer);
        learner_.save(writer);
        write_checkpoint(first_line, writer, options_.checkpoint);
    }

    void resume()
    {
        load(options_.checkpoint, true);
        reported_ = s_.step;
        return_to_episode();
    }

    /// Takes only the networks of another training.
    void start_from_other()
    {
        const State fresh = s_;
        load(options_.start_from, false);
        s_ = fresh;
        curve_.clear();
        buffer_ = ReplayBuffer(environment_.observations, environment_.actions, options_.buffer);
        learner_.reseed(options_.seed);
    }

    void load(const std::filesystem::path& file, bool same_training)
    {
        const std::string bytes = read_checkpoint(first_line, file);
        Reader reader(bytes, file);
        std::uint64_t shape = 0;
        reader.get(shape);
        if (shape != shape_) {
            refuse_checkpoint(file, "is of networks of another shape, or of another trainer");
        }
        std::uint64_t found = 0;
        reader.get(found);
        if (same_training && found != fingerprint_) {
            refuse_checkpoint(file, "is of another training: options or seed differ");
        }
        fields([&reader](auto& member) { reader.get(member); }, s_);
        std::uint64_t points = 0;
        reader.get(points);
        for (std::uint64_t k = 0; k < points; ++k) {
            PolicyProgress& p = curve_.emplace_back();
            for (std::size_t* n : {&p.step, &p.steps, &p.episodes}) {
                std::uint64_t number = 0;
                reader.get(number);
                *n = static_cast<std::size_t>(number);
            }
            for (double* x :
                 {&p.mean_return, &p.critic_loss, &p.actor_loss, &p.temperature, &p.seconds}) {
                reader.get(*x);
            }
        }
        const bool fits = buffer_.load(reader);
        learner_.load(reader);
        reader.finish();
        const std::size_t n = environment_.observations;
        if (!fits || s_.observation.size() != n || s_.lowest.size() != n ||
            s_.highest.size() != n) {
            refuse_checkpoint(file, "has been altered");
        }
    }

    /// Repeats the actions of the interrupted episode.
    void return_to_episode()
    {
        const std::size_t width = action_.size();
        environment_.reset(s_.episode_seed, next_);
        for (std::size_t i = 0; i + width <= s_.episode_actions.size(); i += width) {
            (void)environment_.step(std::span(s_.episode_actions).subspan(i, width), next_);
        }
        if (next_ != s_.observation) {
            throw std::runtime_error(fmt::format(
                "{}: the environment does not repeat the episode of seed {}, so that the training "
                "cannot be resumed; expected the observation ({}), found ({})",
                learner_.name, s_.episode_seed, fmt::join(s_.observation, ", "),
                fmt::join(next_, ", ")));
        }
    }

    const Environment& environment_;
    const PolicyTraining& options_;
    const Learner& learner_;
    ReplayBuffer buffer_;
    State s_;
    std::uint64_t shape_ = 0;  ///< of the networks
    std::uint64_t fingerprint_ = 0;
    std::uint64_t reported_ = 0;  ///< step of the last report
    std::vector<double> action_, next_;
    std::vector<PolicyProgress> curve_;
    std::chrono::steady_clock::time_point start_;
    double before_ = 0;  ///< seconds before this run
    Model good_;         ///< finite
    std::string message_;
    std::optional<PolicyOutcome> found_;  ///< at the start of an episode
    Keeper keep_{options_.checkpoint};
};

}  // namespace

std::string_view describe(PolicyOutcome outcome) noexcept
{
    switch (outcome) {
        case PolicyOutcome::finished: return "took all steps";
        case PolicyOutcome::max_seconds:
            return "reached the time allowed; resume with more if the return still rises";
        case PolicyOutcome::stopped: return "stopped; resume to continue";
        case PolicyOutcome::non_finite:
            return "the environment gave a number that is not finite; the policy learnt until then "
                   "is kept";
        case PolicyOutcome::diverged:
            return "the weights are not finite; scale rewards and observations to order one, or "
                   "learn at a lower rate";
    }
    return "unknown";
}

void check(const std::string& name, const Environment& environment, const PolicyTraining& o)
{
    const ricochet::detail::Refuse refuse{name};
    if (environment.observations == 0 || environment.actions == 0) {
        refuse(fmt::format("expected at least one observation and one action, got {} and {}",
                           environment.observations, environment.actions));
    }
    if (!environment.reset || !environment.step) refuse("the environment has no reset or no step");
    for (const auto& [value, what] : {std::pair{o.steps, "steps"},
                                      {o.batch, "batch"},
                                      {o.buffer, "buffer"},
                                      {o.random_steps, "random_steps"},
                                      {o.report_every, "report_every"}}) {
        if (value == 0) refuse(fmt::format("{} must be positive, got 0", what));
    }
    if (!(o.discount >= 0 && o.discount <= 1)) {
        refuse(fmt::format("discount must lie in [0, 1], got {}", o.discount));
    }
    if (!(o.polyak > 0 && o.polyak <= 1)) {
        refuse(fmt::format("polyak must lie in (0, 1], got {}", o.polyak));
    }
    if (o.threads < 1 || o.threads > 64) {
        refuse(fmt::format("threads must lie in [1, 64], got {}", o.threads));
    }
    if (!(o.max_seconds > 0)) {
        refuse(fmt::format("max_seconds must be positive, got {}", o.max_seconds));
    }
    if (o.resume && o.checkpoint.empty()) refuse("resume needs a checkpoint");
}

TrainedPolicy train_policy(const Environment& environment, const PolicyTraining& training,
                           const Learner& learner, const PolicyCallback& progress)
{
    return Training(environment, training, learner).run(progress);
}

}  // namespace ricochet::learn
