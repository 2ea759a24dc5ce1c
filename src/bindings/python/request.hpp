// A request for a run, translated from Python.
#pragma once

#include <memory>
#include <string_view>
#include <vector>

#include "ricochet/detail/core.hpp"
#include "ricochet/methods.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/options.hpp"

namespace ricochet::python {

using State = std::vector<double>;

struct Request {
    Options options;
    MethodName method = MethodName::dopri5;
    bool by_series = false;  ///< use Taylor's method instead of `method`
    bool implicit = false;   ///< use Rosenbrock's method instead of `method`
    bool fixed = false;      ///< steps of `options.step`
    std::string_view detector = "extremum";
    std::string_view locator = "newton";
    std::shared_ptr<const Model> gate{};  ///< the network of a detector that uses one
    bool record_steps = false;            ///< keep the state at the end of every step
    bool dense = false;                   ///< keep every step as a polynomial
    bool events_only = false;             ///< a mechanism's run ends where contact would begin
    const double* parameters = nullptr;   ///< of formulas, for as long as the run

    /// Whether all choices are the defaults, so that a loop compiled for the system can be used.
    [[nodiscard]] bool is_plain() const noexcept { return is_plain_or_series() && !by_series; }
    /// The same but for Taylor's method.
    [[nodiscard]] bool is_plain_or_series() const noexcept
    {
        return detector == "extremum" && locator == "newton" && !gate && !fixed && !record_steps &&
               !dense && !implicit;
    }
};

}  // namespace ricochet::python
