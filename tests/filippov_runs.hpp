// Runs of Filippov systems for tests.
#pragma once

#include <cstddef>
#include <functional>

#include "ricochet/filippov.hpp"
#include "ricochet/integrate.hpp"

namespace ricochet::test {

/// Tolerances tight enough for measuring the switching, not the steps.
inline Options tight(double t_end, Mode mode)
{
    return {.t_end = t_end, .mode = mode, .rtol = 1e-12, .atol = 1e-14};
}

/// Fields of any type behind one type, so that the loop is compiled once for all of them.
template <std::size_t surfaces, class X>
struct AnyFields {
    static constexpr std::size_t surface_count = surfaces;
    using State = X;

    std::function<double(std::size_t, double, const X&)> any_surface;
    std::function<double(std::size_t, double, const X&, const X&)> any_rate;
    std::function<void(std::size_t, double, const X&, X&)> any_field;

    double surface(std::size_t which, double t, const X& x) const
    {
        return any_surface(which, t, x);
    }
    double surface_rate(std::size_t which, double t, const X& x, const X& dxdt) const
    {
        return any_rate(which, t, x, dxdt);
    }
    void field(std::size_t region, double t, const X& x, X& dxdt) const
    {
        any_field(region, t, x, dxdt);
    }
};

/// Runs from (0, x0) in the start mode of the system.
template <class Fields, class X = typename Fields::State>
Run<X> run_from(const Filippov<Fields>& system, const X& x0, double t_end)
{
    const Fields& fields = system.fields();
    const Filippov<AnyFields<Fields::surface_count, X>> any(
        {[&](std::size_t which, double t, const X& x) { return fields.surface(which, t, x); },
         [&](std::size_t which, double t, const X& x, const X& dxdt) {
             return fields.surface_rate(which, t, x, dxdt);
         },
         [&](std::size_t region, double t, const X& x, X& dxdt) {
             fields.field(region, t, x, dxdt);
         }});
    return integrate(any, x0, tight(t_end, system.start_mode(0, x0)));
}

}  // namespace ricochet::test
