#include <fmt/format.h>

#include "input.hpp"
#include "registry.hpp"
#include "ricochet/learn/classifier.hpp"
#include "settings.hpp"
#include "train.hpp"

namespace ricochet::app {

const std::vector<TrainingKind>& ball_kinds()
{
    static const std::vector<TrainingKind> kinds{
        {.name = "fixed-step",
         .other_name = "paper",
         .meaning = "height and velocity in, for one step and gravity"},
        {.name = "any-step",
         .other_name = "dimensionless",
         .meaning = "for every gravity, restitution, height and step"}};
    return kinds;
}

learn::Trained train_ball(const TrainingRequest& request, const learn::ProgressCallback& progress)
{
    const learn::BallModel kind = learn::ball_model_named(request.kind);
    learn::BallTraining training = learn::ball_training(kind);
    if (!request.set.empty() || request.step) {
        if (kind == learn::BallModel::any_step) {
            throw BadInput(
                "an any-step model is for every gravity, height and step; "
                "--set and --step are for --kind fixed-step");
        }
        enum : std::size_t { gravity, restitution, height };  // the order of parameters
        const std::vector<double> p = parameter_values(find_system("bouncing-ball"), request.set);
        training.gravity = p[gravity];
        training.height = p[height];
        training.step = request.step.value_or(training.step);
    }
    training.states = request.states.value_or(training.states);
    training.fresh_events = request.fresh_events.value_or(training.fresh_events);
    training.seed = request.seed.value_or(training.seed);
    training.training.iterations = request.iterations.value_or(training.training.iterations);
    training.training.checkpoint = request.checkpoint;
    training.training.resume = request.resume;
    return learn::train_bouncing_ball(kind, training, progress);
}

}  // namespace ricochet::app
