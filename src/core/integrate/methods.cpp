#include "ricochet/methods.hpp"

#include <vector>

namespace ricochet::detail {

std::string spelled_methods(bool with_error_estimate, std::string_view quotes)
{
    std::vector<std::string> names;
    for (const NamedMethod& method : named_methods) {
        if (with_error_estimate && !method.estimates_error) continue;
        names.push_back(std::string(quotes).append(method.spelled).append(quotes));
    }
    std::string all = names.front();
    for (std::size_t i = 1; i < names.size(); ++i) {
        all.append(i + 1 < names.size() ? ", " : " or ").append(names[i]);
    }
    return all;
}

}  // namespace ricochet::detail
