// Derivatives of a system's functions, transposed, and where they are added.
#pragma once

#include <cstddef>
#include <span>

#include "ricochet/guard.hpp"

namespace ricochet {

/// Where a vector-Jacobian product is added: the derivatives of w . F(t, x, p) for weights w of
/// what F returns.
struct Cotangent {
    std::span<double> x;  ///< by the components of the state
    double& t;            ///< by the time [per second]
    std::span<double> p;  ///< by the parameters, all of them
};

namespace detail {

/// The functions of a system that a reverse sweep needs, on flat numbers.
class Pullback {
public:
    Pullback() = default;
    Pullback(const Pullback&) = delete;
    Pullback& operator=(const Pullback&) = delete;
    virtual ~Pullback() = default;

    [[nodiscard]] virtual std::size_t parameters() const = 0;

    virtual void flow(Mode mode, double t, std::span<const double> x,
                      std::span<double> rate) const = 0;

    // Each adds a product with the weights to a cotangent.

    virtual void flow_back(Mode mode, double t, std::span<const double> x,
                           std::span<const double> weights, const Cotangent& to) const = 0;
    virtual void guard_back(std::size_t which, Mode mode, double t, std::span<const double> x,
                            double weight, const Cotangent& to) const = 0;
    /// Of the reset of a guard; `no_guard`: that of time events.
    virtual void reset_back(std::size_t which, Mode mode, double t, std::span<const double> x,
                            std::span<const double> weights, const Cotangent& to) const = 0;
    /// Of the state at the limit of accumulating events of a guard.
    virtual void rest_back(std::size_t which, Mode mode, double t, std::span<const double> x,
                           std::span<const double> weights, const Cotangent& to) const = 0;
};

}  // namespace detail

}  // namespace ricochet
