#include "ricochet/learn_steps/step_environment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "base/require.hpp"
#include "ricochet/nn/mlp.hpp"
#include "step_reference.hpp"

namespace ricochet::learn {

namespace {

constexpr std::size_t observations = 3 + StepView::state_inputs;

/// Result of an attempt.
struct Attempt {
    bool solved = false;
    double length = 0;  ///< [s] of the step taken, or requested
    double error = 0;   ///< scaled
    double work = 0;
    double work_per_solve = 1;
    bool ended = false;
};

/// A fault whose steps are chosen by the caller.
class FaultRun {
public:
    FaultRun(const StrikeSlipFault& fault, double t_end, const StepEnvironmentOptions& options)
        : t_end_(t_end),
          options_(options),
          reference_(detail::reference_of(fault, t_end, 0, options.watch)),
          runs_(fault)
    {
        const bool doubling = options.estimate == ErrorEstimate::doubling;
        bathe_ = {.first_stage = options.first_stage,
                  .estimate = options.estimate,
                  .norm = doubling ? FaultNorm::components : FaultNorm::fields,
                  .rtol = options.tolerance,
                  .atol = 1e-3 * options.tolerance,
                  .observer = [this](const BatheStep& step) { comparison_->look(step); }};
        reset();
    }
    FaultRun(const FaultRun&) = delete;
    FaultRun& operator=(const FaultRun&) = delete;

    static double longest(double t_end) { return t_end / 5; }
    static const StepLayout& layout() { return fault_step_layout(); }

    void reset()
    {
        comparison_.emplace(reference_, t_end_ / runs_.fault().time_unit());
        motion_.reset();
        motion_ = std::make_unique<BatheMotion>(
            runs_.start({.t_end = t_end_, .step = options_.h_min}, bathe_));
        ended_ = false;
    }

    Attempt step(double h)
    {
        const RuptureStatistics before = motion_->statistics();
        const double t = motion_->t();
        Attempt out;
        out.solved = motion_->step(h);
        const RuptureStatistics& s = motion_->statistics();
        out.length = out.solved ? motion_->t() - t : h;
        out.error = motion_->error();
        out.work = static_cast<double>(s.iterations - before.iterations);
        out.work_per_solve = out.work / static_cast<double>(s.solves - before.solves);
        ended_ = motion_->ended() || (options_.until_rest && motion_->rests());
        out.ended = ended_;
        return out;
    }

    [[nodiscard]] double done() const { return motion_->t() / t_end_; }
    [[nodiscard]] const StepView& view() const { return motion_->view(); }
    /// The squared error so far as a fraction of the whole; at the end with the remaining part.
    double squares(bool ended)
    {
        if (!ended) return comparison_->squares();
        const double error = comparison_->error();
        return error * error;
    }

    [[nodiscard]] StepTrial trial() const
    {
        const RuptureStatistics& s = motion_->statistics();
        StepTrial out{.ended = ended_,
                      .work = static_cast<double>(s.iterations),
                      .steps = s.steps,
                      .rejected = s.rejected,
                      .solves = s.solves,
                      .iterations = s.iterations};
        if (ended_) {
            out.error = std::sqrt(comparison_->squares());
            out.final_error = std::abs(motion_->mean_slip() / reference_.mean_slip - 1);
        }
        return out;
    }

private:
    double t_end_;
    StepEnvironmentOptions options_;
    detail::FaultReference reference_;
    std::optional<detail::Comparison> comparison_;
    BatheOptions bathe_;
    BatheRuns runs_;
    std::unique_ptr<BatheMotion> motion_;
    bool ended_ = false;
};

/// A small inclusion whose steps are chosen by the caller. A step without a solution ends it.
template <class System>
class SmallRun {
public:
    using State = StateOf<System>;

    SmallRun(const System& system, const State& start, double t_end,
             detail::Reference<System> reference, const StepEnvironmentOptions& options)
        : system_(system), start_(start), t_end_(t_end), reference_(std::move(reference))
    {
        for (const State& w : reference_) of_all_ += w.squaredNorm();
        set_.t_end = t_end;
        set_.step = std::min(options.h_min, t_end);
        set_.estimate = options.estimate;
        set_.scheme.first_stage = options.first_stage;
        if (options.estimate == ErrorEstimate::doubling) {
            set_.rtol = options.tolerance;
            set_.atol = 1e-3 * options.tolerance;
            set_.error_order = 1;
        } else {
            set_.fields = {{.first = 0,
                            .count = start.size(),
                            .rtol = options.tolerance,
                            .floor = start.stableNorm()}};
        }
        reset();
    }

    static const StepLayout& layout() { return System::step_layout(); }

    void reset()
    {
        motion_.emplace(system_, start_, set_);
        samples_.emplace(t_end_, set_.estimate);
        sum_ = 0;
        done_ = 0;
        view_ = {.step = 0};
        const auto& now = motion_->state();
        system_.step_inputs(0, start_, State::Zero(), now.reaction, view_.state);
    }

    Attempt step(double h)
    {
        const std::uint64_t stages = motion_->statistics().stages;
        motion_->next_step(h);
        const Outcome outcome = motion_->advance();
        Attempt out{.length = h};
        out.work = static_cast<double>(motion_->statistics().stages - stages);
        out.ended = outcome != Outcome::running;
        out.solved = outcome == Outcome::running || outcome == Outcome::reached_end;
        if (!out.solved || !motion_->state().w.allFinite()) {
            out.solved = false;
            out.ended = true;
            return out;
        }
        const auto& a = motion_->before();
        const auto& b = motion_->state();
        out.length = b.t - a.t;
        out.error = motion_->error();
        samples_->step(*motion_, [&](std::size_t i, const State& w) {
            sum_ += (w - reference_[i]).squaredNorm();
            done_ = i;
        });
        look(a, b, out.length);
        return out;
    }

    [[nodiscard]] double done() const { return motion_->state().t / t_end_; }
    [[nodiscard]] const StepView& view() const { return view_; }
    double squares(bool ended)
    {
        // The part that was not reached counts as if it were zero.
        if (ended) {
            while (done_ + 1 < reference_.size()) sum_ += reference_[++done_].squaredNorm();
        }
        return sum_ / of_all_;
    }

    [[nodiscard]] StepTrial trial() const
    {
        const SetValuedStatistics& s = motion_->statistics();
        StepTrial out{.ended = motion_->outcome() == Outcome::reached_end,
                      .work = static_cast<double>(s.stages),
                      .steps = s.accepted,
                      .rejected = s.rejected + s.unsolved,
                      .solves = s.stages,
                      .iterations = s.iterations};
        if (out.ended) {
            out.error = std::sqrt(sum_ / of_all_);
            out.final_error = (motion_->state().w - reference_.back()).norm() / start_.norm();
        }
        return out;
    }

private:
    template <class Instant>
    void look(const Instant& a, const Instant& b, double h)
    {
        const State rate = detail::StepParabola(set_.estimate).rate(*motion_);
        view_.step = h / system_.step_unit();
        system_.step_inputs(b.t, b.w, rate, b.reaction, view_.state);
        const auto held = [](const State& w) { return w[0] == 0; };
        view_.switched = held(a.w) != held(b.w) || (a.w[0] > 0) != (b.w[0] > 0) ? 1 : 0;
    }

    System system_;
    State start_;
    double t_end_;
    detail::Reference<System> reference_;
    double of_all_ = 0;
    SetValuedOptions set_;
    std::optional<SetValuedMotion<System>> motion_;
    std::optional<detail::Samples<System>> samples_;
    double sum_ = 0;
    std::size_t done_ = 0;
    StepView view_;
};

/// Episodes of a run: actions, rewards, observations.
template <class Run>
class Episodes {
public:
    template <class... Parts>
    Episodes(const StepEnvironmentOptions& options, Parts&&... parts)
        : options_(options), run_(std::forward<Parts>(parts)...)
    {
    }

    void reset(std::span<double> observation)
    {
        run_.reset();
        attempts_ = 0;
        failures_ = 0;
        squares_ = 0;
        ended_ = false;
        observe(observation, 0, 0);
    }

    Reaction step(double action, std::span<double> observation)
    {
        const Attempt attempt = run_.step(length_of(action));
        ++attempts_;
        failures_ = attempt.solved ? 0 : failures_ + 1;
        ended_ = attempt.ended || failures_ >= step_environment_failures;
        const double squares = run_.squares(ended_);
        Reaction out;
        out.reward =
            options_.reward == StepReward::published
                ? published(attempt)
                : -attempt.work / options_.work_unit - options_.lambda * (squares - squares_);
        squares_ = squares;
        out.terminal = ended_;
        const bool cut =
            attempts_ >= options_.max_attempts || (options_.watch && !options_.watch(run_.done()));
        out.truncated = !ended_ && cut;
        observe(observation, attempt.error, attempt.solved ? 0 : 1);
        return out;
    }

    [[nodiscard]] double length_of(double action) const
    {
        const double x = (std::clamp(action, -1.0, 1.0) + 1) / 2;
        if (options_.scale == StepScale::linear) {
            return std::lerp(options_.h_min, options_.h_max, x);
        }
        return options_.h_min * std::pow(options_.h_max / options_.h_min, x);
    }
    [[nodiscard]] double action_of(double length) const
    {
        const double x =
            options_.scale == StepScale::linear
                ? (length - options_.h_min) / (options_.h_max - options_.h_min)
                : std::log(length / options_.h_min) / std::log(options_.h_max / options_.h_min);
        return std::clamp(2 * x - 1, -1.0, 1.0);
    }
    [[nodiscard]] StepTrial trial() const { return run_.trial(); }

private:
    [[nodiscard]] double published(const Attempt& attempt) const
    {
        const double x = (attempt.length - options_.h_min) / (options_.h_max - options_.h_min);
        if (!attempt.solved) return -x;
        const double cheap = 1 - (attempt.work_per_solve - 1) / (options_.expensive - 1);
        return x * std::clamp(cheap, 0.0, 1.0) * std::exp(-options_.alpha * attempt.error);
    }

    void observe(std::span<double> out, double error, double failed) const
    {
        const StepView& view = run_.view();
        const auto bounded = [](double x) { return std::clamp(x, -5.0, 5.0); };
        // As in the source: 1 / (1 + E) says little about errors far from 1, unlike their
        // logarithm.
        out[0] = bounded(std::log(std::max(error, 1e-10)) / 5);
        out[1] = bounded((std::log(std::max(view.step, 1e-6)) + 2) / 3);
        out[2] = view.switched - 2 * failed;
        for (std::size_t i = 0; i < StepView::state_inputs; ++i) {
            const StepInput& input = Run::layout().state[i];
            const double width = input.width > 0 ? input.width : 1;
            out[3 + i] = bounded((view.state[i] - input.centre) / width);
        }
    }

    StepEnvironmentOptions options_;
    Run run_;
    std::uint64_t attempts_ = 0;
    int failures_ = 0;
    double squares_ = 0;
    bool ended_ = false;
};

template <class Run>
StepEnvironment environment_of(std::shared_ptr<Episodes<Run>> episodes)
{
    StepEnvironment out;
    out.environment = {
        .observations = observations,
        .actions = 1,
        .reset = [episodes](std::uint64_t, std::span<double> o) { episodes->reset(o); },
        .step = [episodes](std::span<const double> action,
                           std::span<double> o) { return episodes->step(action[0], o); }};
    out.trial = [episodes] { return episodes->trial(); };
    out.length_of = [episodes](double action) { return episodes->length_of(action); };
    out.action_of = [episodes](double length) { return episodes->action_of(length); };
    return out;
}

StepEnvironmentOptions checked(StepEnvironmentOptions o, double longest)
{
    constexpr ricochet::detail::Require require{"StepEnvironmentOptions"};
    if (o.h_max == 0) o.h_max = longest;
    require(o.alpha >= 0 && std::isfinite(o.alpha), "alpha must be zero or positive", o.alpha);
    require(o.expensive > 1, "expensive must be above 1", o.expensive);
    require(o.lambda >= 0 && std::isfinite(o.lambda), "lambda must be zero or positive", o.lambda);
    require(o.work_unit > 0, "work_unit must be positive", o.work_unit);
    require(o.h_min > 0, "h_min must be positive", o.h_min);
    require(o.h_max > o.h_min && std::isfinite(o.h_max), "h_max must be above h_min", o.h_max);
    require(o.tolerance > 0, "tolerance must be positive", o.tolerance);
    require(o.max_attempts > 0, "max_attempts must be positive", 0);
    return o;
}

}  // namespace

StepEnvironmentOptions published_step_environment(double alpha)
{
    return {.alpha = alpha,
            .scale = StepScale::linear,
            .estimate = ErrorEstimate::doubling,
            .first_stage = FirstStage::at_end};
}

StepEnvironment step_environment(const StrikeSlipFault& fault, double t_end,
                                 const StepEnvironmentOptions& options)
{
    const StepEnvironmentOptions o = checked(options, t_end / 5);
    return environment_of(std::make_shared<Episodes<FaultRun>>(o, fault, t_end, o));
}

StepEnvironment step_environment(const SlidingMode& system, double from, double t_end,
                                 const StepEnvironmentOptions& options)
{
    const StepEnvironmentOptions o =
        checked(options, 2 * std::numbers::pi / (10 * system.parameters().frequency));
    using Run = SmallRun<SlidingMode>;
    return environment_of(
        std::make_shared<Episodes<Run>>(o, system, SlidingMode::Vector::Constant(from), t_end,
                                        detail::reference_of(system, from, t_end), o));
}

StepEnvironment step_environment(const DiodeCircuit& system, const Eigen::Vector3d& start,
                                 double t_end, const StepEnvironmentOptions& options)
{
    const StepEnvironmentOptions o = checked(options, t_end / 10);
    using Run = SmallRun<DiodeCircuit>;
    return environment_of(std::make_shared<Episodes<Run>>(
        o, system, start, t_end, detail::reference_of(system, start, t_end), o));
}

StepTrial follow(const StepEnvironment& runs, const Model& policy)
{
    const Mlp<double> network(policy);
    const Environment& environment = runs.environment;
    if (network.inputs() != environment.observations || network.outputs() != environment.actions) {
        throw std::invalid_argument(fmt::format(
            "a policy of steps has {} inputs and {} output, not {} and {}",
            environment.observations, environment.actions, network.inputs(), network.outputs()));
    }
    std::array<double, observations> o{};
    environment.reset(0, o);
    for (;;) {
        double action = 0;
        network.forward(o.data(), &action);
        action = std::tanh(action);
        const Reaction reaction = environment.step({&action, 1}, o);
        if (reaction.terminal || reaction.truncated) return runs.trial();
    }
}

}  // namespace ricochet::learn
