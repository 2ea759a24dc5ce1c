#include "ricochet/detect/network.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace ricochet {

namespace detail {

void check_model(const Model& model, Recipe recipe, std::size_t features, bool offered)
{
    if (!offered) {
        throw std::invalid_argument(
            fmt::format("Network: the features '{}' of the model for {} need a guard whose rate "
                        "and curvature the system declares",
                        name(recipe), model.system));
    }
    if (model.offset.size() != features) {
        throw std::invalid_argument(
            fmt::format("Network: the model for {} takes {} features, but '{}' of this state are {}",
                        model.system, model.offset.size(), name(recipe), features));
    }
}

void check_model_step(const Model& model, double smallest, double largest)
{
    if (largest < model.step_min || smallest > model.step_max) {
        throw std::invalid_argument(
            fmt::format("Network: the model for {} is trained for steps in [{}, {}] s, got [{}, {}]",
                        model.system, model.step_min, model.step_max, smallest, largest));
    }
}

}  // namespace detail

Network::Network(Model model)
    : classifier_(std::make_shared<const Classifier>(std::move(model))),
      recipe_(recipe_named(classifier_->model().recipe))
{
    if (classifier_->inputs() > max_features) {
        throw std::invalid_argument(
            fmt::format("Network: expected at most {} features, the model for {} has {}",
                        max_features, classifier_->model().system, classifier_->inputs()));
    }
}

}  // namespace ricochet
