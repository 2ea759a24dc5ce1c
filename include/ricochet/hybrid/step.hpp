// The view of a step that detectors and locators use.
//
// Times inside a step are offsets s in [0, h] from its start, because an offset
// resolves what a time of day cannot: at t = 20 s neighbouring doubles are 4e-15 s
// apart, at s = 0.01 s they are 2e-18 s apart. In a run backward in time offsets are
// positive too, and rates are with respect to them. A host's own integrator can offer
// its steps in this form and use the detectors and locators without our loop.
#pragma once

#include <concepts>

#include "ricochet/detail/dense_polynomial.hpp"

namespace ricochet {

/// A step from `start()` to `start()` + h of a one-step method. `restep` is the
/// method's own map from the start of the step, `interpolate` its dense output.
template <class S, class X>
concept MethodStep = requires(const S& step, double s, X& x, X& dxdt, const X& at)
{
    {
        step.time(s)
        } -> std::convertible_to<double>;  // t at offset s
    {
        step.h()
        } -> std::convertible_to<double>;
    {
        step.x0()
        } -> std::convertible_to<const X&>;
    {
        step.x1()
        } -> std::convertible_to<const X&>;
    {
        step.rate0()
        } -> std::convertible_to<const X&>;
    {
        step.rate1()
        } -> std::convertible_to<const X&>;
    {
        step.order()
        } -> std::convertible_to<int>;
    step.interpolate(s, x);
    step.restep(s, x);
    step.restep(s, x, dxdt);  // and the flow at the end of it
    step.flow(s, at, dxdt);   // dx/ds at offset s and state `at`
};

/// A step whose dense output is a polynomial that can be had a component at a time.
template <class S, class X>
concept DenseStep = MethodStep<S, X> && requires(const S& step)
{
    {
        step.dense()
        } -> std::convertible_to<DenseParts<X>>;
};

}  // namespace ricochet
