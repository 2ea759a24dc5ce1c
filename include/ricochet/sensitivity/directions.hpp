// The quantities with respect to which a run is differentiated.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "ricochet/guard.hpp"
#include "ricochet/sensitivity/differences.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

namespace detail {

class Recorded;  // the scalar of Taylor's method (taylor/detail/taylor_recording.hpp)

/// Derivatives of a system's functions by one parameter. Where a function is empty, differences
/// are taken.
struct ParameterDerivatives {
    std::function<void(Mode, double t, std::span<const double> x, std::span<double> df)> flow{};
    /// The same for power series of n components.
    std::function<void(Mode, const Recorded& t, const Recorded* x, std::size_t n, Recorded* df)>
        flow_series{};
    std::function<double(std::size_t which, Mode, double t, std::span<const double> x)> guard{};
    /// False: this reset has no derivative.
    std::function<bool(const FiredGuards&, Mode, double t, std::span<const double> x,
                       std::span<double> by)>
        reset{};
};

}  // namespace detail

/// A parameter of a system, given by a function that makes the system with another value of it:
///
///     {.with = [](double r) { return BouncingBall({.restitution = r}); }, .nominal = 0.9}
template <class System>
struct Parameter {
    std::function<System(double)> with{};                       ///< the system with that value
    double nominal = std::numeric_limits<double>::quiet_NaN();  ///< value in the system that is run
    double scale = 0;  ///< over which the system becomes nonlinear; 0: |nominal|, or 1 if that is 0
    std::vector<double> start{};           ///< derivative of the initial state by it; empty: zero
    detail::ParameterDerivatives exact{};  ///< set by `parameter(make, nominal)`
};

/// The columns of derivatives, in this order: one for each component of the initial
/// state, where wanted, then one for each parameter.
template <class System>
struct Directions {
    bool initial_state = true;
    std::vector<Parameter<System>> parameters{};
    Differences differences{};  ///< used where the system gives no derivative
};

namespace detail {

/// @throws std::invalid_argument naming what is wrong with parameter `index`.
void validate_parameter(std::size_t index, bool callable, double nominal, double scale,
                        const std::vector<double>& start, std::size_t components);

/// The systems around a parameter's value, from which differences are taken.
template <class System>
struct Neighbours {
    Stencil stencil;
    double h;
    std::vector<System> systems;
    std::optional<System> closest{};  ///< at `close` of a step, for a system with time events
    static constexpr double close = 1e-6;

    /// The largest distance of the systems, in units of that of the closest.
    [[nodiscard]] double widening() const noexcept
    {
        const auto [least, most] = std::ranges::minmax(stencil.offset);
        return std::max(-least, most) / close;
    }
};

/// Central differences, or one-sided ones at the edge of the parameter's range, where the
/// system for some value is refused with std::invalid_argument.
template <class System>
[[nodiscard]] Neighbours<System> neighbours_of(const Parameter<System>& parameter, double step)
{
    const double size = std::fabs(parameter.nominal);
    const double h = step * (parameter.scale > 0 ? parameter.scale : size > 0 ? size : 1.0);
    const auto build = [&](const Stencil& stencil) {
        Neighbours<System> neighbours{stencil, h, {}, {}};
        neighbours.systems.reserve(stencil.points);
        for (std::size_t k = 0; k < stencil.points; ++k) {
            neighbours.systems.push_back(parameter.with(parameter.nominal + stencil.offset[k] * h));
        }
        if constexpr (Timed<System>) {
            const double close = Neighbours<System>::close * stencil.offset[1];
            neighbours.closest.emplace(parameter.with(parameter.nominal + close * h));
        }
        return neighbours;
    };
    try {
        return build(central_stencil);
    } catch (const std::invalid_argument&) {
    }
    try {
        return build(one_sided_stencil(-1));
    } catch (const std::invalid_argument&) {
    }
    return build(one_sided_stencil(1));
}

}  // namespace detail

}  // namespace ricochet
