// A request from Python for a run, in the library's terms.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "ricochet/detail/core.hpp"
#include "ricochet/integrate/methods.hpp"
#include "ricochet/integrate/options.hpp"
#include "ricochet/nn/model.hpp"

namespace ricochet::python {

using State = std::vector<double>;

struct Request {
    Options options;
    MethodName method = MethodName::dopri5;
    bool by_series = false;  ///< by Taylor's method instead
    bool fixed = false;      ///< steps of `options.step`
    std::string_view detector = "extremum";
    std::string_view locator = "newton";
    std::shared_ptr<const Model> gate{};  ///< for the detectors that ask one
    bool record_steps = false;            ///< keep the state at the end of every step
    bool dense = false;                   ///< keep every step as a polynomial

    /// Everything by default, so that a loop made for its system at compile time may serve.
    [[nodiscard]] bool is_plain() const noexcept
    {
        return detector == "extremum" && locator == "newton" && !fixed && !record_steps && !dense &&
               !by_series;
    }
};

}  // namespace ricochet::python
