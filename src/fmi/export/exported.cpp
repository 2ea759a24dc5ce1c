#include "ricochet/fmi/detail/exported.hpp"

#include <utility>

namespace ricochet::fmi::detail {

ExportedModel::ExportedModel(ModelFacts facts) : facts_(std::move(facts))
{
    for (const Exported& state : facts_.states) x.push_back(state.start);
    for (const Exported& parameter : facts_.parameters) parameters.push_back(parameter.start);
    for (const Exported& input : facts_.inputs) inputs.push_back(input.start);
}

}  // namespace ricochet::fmi::detail
