#include "policy_lookup.hpp"

#include <fmt/format.h>

#include <memory>
#include <stdexcept>

#include "input.hpp"
#include "model_lookup.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::app {

namespace fs = std::filesystem;

fs::path policy_file(const StepLayout& layout, const std::optional<std::string>& given)
{
    return find_model(given ? *given : fmt::format("{}-step", layout.system));
}

std::shared_ptr<const StepPolicy> named_policy(const StepLayout& layout,
                                               const std::optional<std::string>& given)
{
    const fs::path file = policy_file(layout, given);
    try {
        auto policy = std::make_shared<const StepPolicy>(load_model(file));
        policy->require(layout);
        return policy;
    } catch (const std::invalid_argument& error) {
        throw BadInput(fmt::format("model '{}': {}", file.string(), error.what()));
    }
}

}  // namespace ricochet::app
