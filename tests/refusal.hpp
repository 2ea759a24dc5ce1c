// Messages about a wrong set-up.
#pragma once

#include <stdexcept>
#include <string>

namespace ricochet {

/// The sentence with which `call` is refused, or "accepted".
template <class Call>
[[nodiscard]] std::string refusal(Call&& call)
{
    try {
        call();
    } catch (const std::invalid_argument& error) {
        return error.what();
    }
    return "accepted";
}

}  // namespace ricochet
