// A strike-slip fault with rate-and-state friction as an ordinary differential equation, for every
// method of the library.
//
//     const RateStateFaultSystem system(StrikeSlipFault({.elements = 3}), friction);
//     const auto run = integrate(system, system.start(), {.t_end = 30, .rtol = 1e-6, .atol = 1e-6},
//                                ErrorControlled<Rosenbrock4>{});
//     use(system.slip(run.t, run.x));
#pragma once

#include <Eigen/Core>
#include <concepts>
#include <cstddef>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "ricochet/faults/strike_slip_fault.hpp"

namespace ricochet {

/// A fault with rate-and-state friction in the logarithm of its slip rates, V > 0.
///
/// State (u / D_RS, log(V / V*), xi) of all elements, one after the other, each a block of
/// `fault.size()` components; time in seconds. With the slip d and u = d - V_pl t [m],
///
///     u' = V - V_pl
///     rho L (log V)' = (tau - G/L K u - H u' - sigma f(V, xi)) / V,    H = 2 zeta sqrt(rho G K)
///     xi' = xi'(V, xi)
///
/// the equations of `simulate(fault, options, friction)`, from `StrikeSlipFault` with the laws of
/// friction.hpp. With `rtol` = `atol` the error of u is measured as there, relative to |u| + D_RS.
///
/// The fastest rate is sigma a / (rho L V): explicit steps are the shorter the slower the slowest
/// element is. An element that slips back has no logarithm; `simulate` follows it. docs/fault.md
/// says which method to take. There is no guard and no reset. A value: copies share matrices that
/// never change, and threads may share a system.
class RateStateFaultSystem {
public:
    using State = std::vector<double>;

    static constexpr std::string_view name = "rate-state-fault";

    /// @param polynomial_bound  largest relative error, over the spectrum of K, of the polynomial
    ///     that replaces sqrt(K); then K is not stored, and products with it are those of
    ///     `StiffnessProduct`. 0: K and its exact root are stored on up to `most_stored` elements,
    ///     and the bound is 1e-8 on more.
    /// @throws std::invalid_argument for a friction that `validate` refuses, a slip rate at the
    ///     start that is not positive, and a bound that is negative or cannot be met.
    explicit RateStateFaultSystem(const StrikeSlipFault& fault, const FaultFriction& friction = {},
                                  double polynomial_bound = 0);

    /// Most elements, n^2, for which K and its root are stored, in 1.3 MB each: there a call of the
    /// flow takes 77 us, and 253 us by transforms.
    static constexpr Eigen::Index most_stored = 400;

    /// The start that `friction` describes: u = 0.
    [[nodiscard]] State start() const;

    /// @throws std::invalid_argument unless x has three components an element, here and below.
    template <class X>
    requires(std::same_as<typename X::value_type, double>) void flow(double /*t*/, const X& x,
                                                                     X& dxdt) const
    {
        rates({x.data(), static_cast<std::size_t>(x.size())}, dxdt.data());
    }

    /// The exact derivatives of the flow by the state, row by row. Where K is not stored this takes
    /// products with K and its root for every element.
    template <class X>
    void jacobian(double /*t*/, const X& x, std::span<double> rows) const
    {
        slopes({x.data(), static_cast<std::size_t>(x.size())}, rows);
    }

    [[nodiscard]] const StrikeSlipFault& fault() const noexcept;   ///< as given
    [[nodiscard]] const FaultFriction& friction() const noexcept;  ///< as given

    /// Slips d [m] of a state at time t [s].
    [[nodiscard]] Eigen::VectorXd slip(double t, std::span<const double> x) const;
    /// Slip rates V [m/s] of a state.
    [[nodiscard]] Eigen::VectorXd velocity(std::span<const double> x) const;

private:
    void rates(std::span<const double> x, double* dxdt) const;
    void slopes(std::span<const double> x, std::span<double> rows) const;

    struct Parts;
    std::shared_ptr<const Parts> parts_;
};

}  // namespace ricochet
