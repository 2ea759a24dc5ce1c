#include "ricochet/methods.hpp"

#include <vector>

#include "core/detect/named_detectors.hpp"

namespace ricochet::detail {

namespace {

/// "a, b or c"
std::string alternatives(const std::vector<std::string>& names)
{
    std::string all = names.front();
    for (std::size_t i = 1; i < names.size(); ++i) {
        all.append(i + 1 < names.size() ? ", " : " or ").append(names[i]);
    }
    return all;
}

std::string quoted(std::string_view name, std::string_view quotes)
{
    return std::string(quotes).append(name).append(quotes);
}

}  // namespace

std::string spelled_detectors(std::string_view quotes)
{
    std::vector<std::string> names;
    for (const std::string_view name : detector_names) names.push_back(quoted(name, quotes));
    return alternatives(names);
}

std::string spelled_methods(bool with_error_estimate, std::string_view quotes)
{
    std::vector<std::string> names;
    for (const NamedMethod& method : named_methods) {
        if (with_error_estimate && !method.estimates_error) continue;
        names.push_back(quoted(method.spelled, quotes));
    }
    return alternatives(names);
}

}  // namespace ricochet::detail
