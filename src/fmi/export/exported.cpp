#include "ricochet/fmi/detail/exported.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace ricochet::fmi::detail {

void ModelFacts::take_starts(std::string_view words)
{
    while (!words.empty()) {
        const std::string_view word = words.substr(0, words.find(' '));
        words.remove_prefix(std::min(words.size(), word.size() + 1));
        const std::size_t equals = word.find('=');
        double value = 0;
        bool taken = false;
        if (equals != std::string_view::npos) {
            const std::string_view text = word.substr(equals + 1);
            const auto [end, error] =
                std::from_chars(text.data(), text.data() + text.size(), value);
            taken =
                error == std::errc() && end == text.data() + text.size() && std::isfinite(value);
        }
        Exported* found = nullptr;
        for (std::vector<Exported>* all : {&parameters, &states}) {
            for (Exported& each : *all) {
                if (word.substr(0, equals) == each.name) found = &each;
            }
        }
        if (!taken || found == nullptr) {
            throw std::invalid_argument(
                fmt::format("{}: found '{}'; expected name=value of a parameter or a component of "
                            "the state, with a finite value",
                            name, word));
        }
        found->start = value;
    }
}

ExportedModel::ExportedModel(ModelFacts facts) : facts_(std::move(facts))
{
    for (const Exported& state : facts_.states) x.push_back(state.start);
    for (const Exported& parameter : facts_.parameters) parameters.push_back(parameter.start);
    for (const Exported& input : facts_.inputs) inputs.push_back(input.start);
}

}  // namespace ricochet::fmi::detail
