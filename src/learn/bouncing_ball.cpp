#include "ricochet/learn/classifier.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

#include "ricochet/detail/features.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::learn {

namespace {

/// A ball with its own gravity and step, so that one sample may hold many kinds. Times
/// are counted in steps.
struct Ball {
    double u;        ///< height [m]
    double v;        ///< velocity [m/s]
    double gravity;  ///< [m/s^2]
    double step;     ///< h [s]
};

Ball fall(const Ball& ball, double steps)
{
    const double time = steps * ball.step;
    return {.u = ball.u + time * (ball.v - 0.5 * ball.gravity * time),
            .v = ball.v - ball.gravity * time,
            .gravity = ball.gravity,
            .step = ball.step};
}

/// Parts that both models share; see `SurfaceProblem`.
struct Floor {
    using State = Ball;

    [[nodiscard]] double guard(const Ball& ball) const { return ball.u; }

    /// Time back to the impact that began the flight.
    [[nodiscard]] double horizon(const Ball& ball) const
    {
        return -2 * ball.v / (ball.gravity * ball.step);
    }

    [[nodiscard]] double magnitude(const Ball& ball, double steps) const
    {
        const double time = steps * ball.step;
        return std::abs(ball.u) + time * (std::abs(ball.v) + 0.5 * ball.gravity * time);
    }
};

struct FixedStepFloor : Floor {
    double gravity;
    double step;
    double highest;  ///< [m]
    double fastest;  ///< [m/s]
    double lowest;   ///< [m], negative

    explicit FixedStepFloor(const BallTraining& training)
        : gravity(training.gravity),
          step(training.step),
          highest(1.15 * training.height),
          fastest(1.1 * std::sqrt(2 * gravity * training.height)),
          lowest(-2 * fastest * step)
    {
    }

    [[nodiscard]] Ball surface(Random& random) const
    {
        const double slowest = 1e-3 * gravity * step;
        const double of_the_corners = std::sqrt(fastest * fastest + 2 * gravity * highest);
        const double speed = random.chance(0.5) ? random.log_uniform(slowest, of_the_corners)
                                                : random.uniform(slowest, of_the_corners);
        return {.u = 0, .v = -speed, .gravity = gravity, .step = step};
    }

    [[nodiscard]] bool inside(const Ball& ball) const
    {
        return ball.u >= lowest && ball.u <= highest && std::abs(ball.v) <= fastest;
    }

    [[nodiscard]] std::vector<Column> columns() const { return {{"u", "m"}, {"v", "m/s"}}; }

    void features(const Ball& ball, double* out) const
    {
        ricochet::detail::features(ricochet::detail::Recipe::state,
                                   BouncingBall({.gravity = gravity}),
                                   BouncingBall::State{ball.u, ball.v}, step, out);
    }

    [[nodiscard]] std::vector<ValueRange> domain() const
    {
        return {{.lower = lowest, .upper = highest}, {.lower = -fastest, .upper = fastest}};
    }
};

struct AnyStepFloor : Floor {
    static constexpr double largest = 1e14;  ///< of |u| / (g h^2) and |v| / (g h)

    [[nodiscard]] Ball surface(Random& random) const
    {
        const double gravity = random.log_uniform(0.1, 100);
        const double step = random.log_uniform(1e-6, 1e2);
        const double speed =
            random.chance(0.5) ? random.log_uniform(0.03, 30) : random.log_uniform(1e-3, 2e14);
        return {.u = 0, .v = -speed * gravity * step, .gravity = gravity, .step = step};
    }

    [[nodiscard]] bool inside(const Ball& ball) const
    {
        const double speed = ball.gravity * ball.step;
        return std::abs(ball.u) <= largest * speed * ball.step &&
               std::abs(ball.v) <= largest * speed;
    }

    [[nodiscard]] std::vector<Column> columns() const
    {
        return {{"slog(u / (g h^2))", "1"}, {"slog(v / (g h))", "1"}};
    }

    void features(const Ball& ball, double* out) const
    {
        ricochet::detail::features(ricochet::detail::Recipe::ballistic,
                                   BouncingBall({.gravity = ball.gravity}),
                                   BouncingBall::State{ball.u, ball.v}, ball.step, out);
    }

    [[nodiscard]] std::vector<ValueRange> domain() const
    {
        const double end = ricochet::detail::slog(largest);
        return {{.lower = -end, .upper = end}, {.lower = -end, .upper = end}};
    }
};

void check(const BallTraining& training)
{
    const auto require_positive = [](double value, const char* what) {
        if (value > 0 && std::isfinite(value)) return;
        throw std::invalid_argument(std::string("bouncing ball training: ") + what +
                                    " must be positive and finite, got " + std::to_string(value));
    };
    require_positive(training.gravity, "gravity");
    require_positive(training.step, "step");
    require_positive(training.height, "height");
}

/// A scale of order one where a fixed step crosses the boundary, and where the boundary
/// bends in logarithmic features.
std::vector<double> scale(BallModel kind, const BallTraining& training)
{
    if (kind == BallModel::any_step) return {0.25, 0.25};
    const double fastest = FixedStepFloor(training).fastest;
    return {1 / (fastest * training.step), 1 / fastest};
}

}  // namespace

std::string_view name(BallModel kind) noexcept
{
    return kind == BallModel::fixed_step ? "fixed-step" : "any-step";
}

BallModel ball_model_named(std::string_view given)
{
    for (const BallModel kind : {BallModel::fixed_step, BallModel::any_step}) {
        if (given == name(kind)) return kind;
    }
    throw std::invalid_argument("unknown model of the bouncing ball '" + std::string(given) +
                                "'; known are fixed-step, any-step");
}

BallTraining ball_training(BallModel kind)
{
    BallTraining training;
    if (kind == BallModel::fixed_step) {
        training.training.hidden = {16, 16, 16, 16, 16};
        training.training.iterations = 20'000;
    } else {
        training.states = 400'000;
        training.training.hidden = {16};
        training.training.iterations = 100'000;
    }
    return training;
}

SurfaceSample sample_ball(BallModel kind, const BallTraining& training, std::size_t events,
                          std::size_t clear, std::uint64_t seed, bool keep_band)
{
    check(training);
    SurfaceOptions options{.step = 1,
                           .events = events,
                           .clear = clear,
                           .margin = training.margin,
                           .keep_band = keep_band,
                           .seed = seed};
    if (kind == BallModel::fixed_step) {
        options.longest = 1e4;
        return sample_surface(FixedStepFloor(training), fall, options);
    }
    options.longest = 4 * AnyStepFloor::largest;
    return sample_surface(AnyStepFloor{}, fall, options);
}

Trained train_bouncing_ball(BallModel kind, const BallTraining& training,
                            const ProgressCallback& progress)
{
    const std::size_t half = training.states / 2;
    const SurfaceSample sample =
        sample_ball(kind, training, half, half, training.seed, /*keep_band=*/false);

    TrainingOptions options = training.training;
    options.seed = training.seed;
    if (options.offset.empty()) options.offset = {0, 0};
    if (options.scale.empty()) options.scale = scale(kind, training);
    Trained trained = train(sample.data, options, progress);

    Model& model = trained.model;
    model.system = "bouncing-ball";
    if (kind == BallModel::fixed_step) {
        model.recipe = name(ricochet::detail::Recipe::state);
        model.parameters = {{"gravity", training.gravity}};
        model.domain = FixedStepFloor(training).domain();
        model.step_min = model.step_max = training.step;
    } else {
        model.recipe = name(ricochet::detail::Recipe::ballistic);
        model.domain = AnyStepFloor{}.domain();
        model.step_min = 1e-6;
        model.step_max = 1e2;
    }
    const SurfaceSample fresh = sample_ball(kind, training, training.fresh_events,
                                            training.fresh_events, training.seed + 1000, true);
    Report& report = trained.report;
    report.band = sample.band;
    report.fresh = assess(model, fresh.data, training.margin);
    if (report.outcome != TrainingOutcome::diverged && !trained.misses_none()) {
        report.outcome = TrainingOutcome::misses_remain;
    }
    return trained;
}

}  // namespace ricochet::learn
