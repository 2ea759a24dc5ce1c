#include "ricochet/gates.hpp"

#include <fmt/format.h>

#include <stdexcept>

namespace ricochet {

namespace detail {

void check_model_system(const Model& model, std::string_view name)
{
    if (model.system == name) return;
    if (name.empty()) {
        throw std::invalid_argument(fmt::format(
            "Network: the model is for {}, and this system declares no name to tell what it is",
            model.system));
    }
    throw std::invalid_argument(
        fmt::format("Network: the model is for {}, this system is {}", model.system, name));
}

void check_model_parameter(const Model& model, std::string_view parameter, double trained,
                           std::optional<double> value)
{
    if (!value) {
        throw std::invalid_argument(
            fmt::format("Network: the model for {} is trained for {} = {}, and this system does "
                        "not declare that parameter",
                        model.system, parameter, trained));
    }
    if (*value != trained) {
        throw std::invalid_argument(
            fmt::format("Network: the model for {} is trained for {} = {}, got {}", model.system,
                        parameter, trained, *value));
    }
}

void check_model_features(const Model& model, Recipe recipe, std::size_t features, bool offered)
{
    if (!offered) {
        throw std::invalid_argument(
            fmt::format("Network: the features '{}' of the model for {} need a guard whose rate "
                        "and curvature the system declares",
                        name(recipe), model.system));
    }
    if (model.offset.size() != features) {
        throw std::invalid_argument(fmt::format(
            "Network: the model for {} takes {} features, but '{}' of this state are {}",
            model.system, model.offset.size(), name(recipe), features));
    }
}

void check_model_step(const Model& model, double smallest, double largest)
{
    const bool one_step_only = model.step_min == model.step_max && smallest != largest;
    if (largest < model.step_min || smallest > model.step_max || one_step_only) {
        throw std::invalid_argument(fmt::format(
            "Network: the model for {} is trained for steps in [{}, {}] s, got [{}, {}]",
            model.system, model.step_min, model.step_max, smallest, largest));
    }
}

}  // namespace detail

BareNetwork::BareNetwork(Model model)
    : classifier_(detail::Shared<Classifier>::make(std::move(model))),
      recipe_(detail::recipe_named(classifier_->model().recipe))
{
    if (this->model().kind != "event-classifier") {
        throw std::invalid_argument(
            fmt::format("Network: the model for {} is a {}, expected an event-classifier",
                        this->model().system, this->model().kind));
    }
    if (classifier_->inputs() > max_features) {
        throw std::invalid_argument(
            fmt::format("Network: expected at most {} features, the model for {} has {}",
                        max_features, classifier_->model().system, classifier_->inputs()));
    }
}

}  // namespace ricochet
