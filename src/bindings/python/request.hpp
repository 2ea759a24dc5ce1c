// What Python asks of a run, in the library's terms.
#pragma once

#include <string_view>
#include <vector>

#include "ricochet/detail/core.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/integrate/options.hpp"

namespace ricochet::python {

using State = std::vector<double>;

struct Request {
    Options options;
    MethodName method = MethodName::dopri5;
    bool fixed = false;  ///< steps of `options.step`
    std::string_view detector = "extremum";
    std::string_view locator = "newton";
    bool record_steps = false;  ///< keep the state at the end of every step
    bool dense = false;         ///< keep every step as a polynomial

    /// One component of a scaled state is worth so much; empty: 1 each. Powers of two, so that
    /// scaling rounds nothing.
    std::vector<double> scale{};

    /// Everything by default, so that a loop made for its system at compile time may serve.
    [[nodiscard]] bool is_plain() const noexcept
    {
        return detector == "extremum" && locator == "newton" && !fixed && !record_steps && !dense &&
               scale.empty();
    }
};

/// The setup of a run with states sized at run time. The detector and the locator are the
/// library's; a system and its door are still to be named.
/// @throws std::invalid_argument for a detector or locator that there is not.
[[nodiscard]] detail::RunSetup<State> setup_for(const Request& request);

}  // namespace ricochet::python
