// The smallest eigenvalue of a matrix that depends on parameters: an expensive guard without
// geometry.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string_view>

#include "ricochet/guard.hpp"

namespace ricochet {

/// A structure under four varying loads. It is about to buckle where the smallest eigenvalue of its
/// stiffness matrix falls below a level; these events are recorded, and change nothing.
///
/// State x = loads q, four components.
///
///     flow    q_k' = amplitude w_k cos(w_k t + p_k),  so that q_k = amplitude sin(w_k t + p_k)
///     guard   smallest eigenvalue of K(q) = K_0 + sum of q_k K_k, less level;  either direction
///
/// K_0 and K_k are random symmetric matrices of order 24, K_0 positive definite. The frequencies
/// have no common period.
///
/// *Bounds* (Weyl): an eigenvalue changes by no more than the norm of the change of the matrix. The
/// path per second is therefore the sum of |q_k'| ||K_k||, and its rate of change is at most the
/// sum of amplitude w_k² ||K_k||, at any time.
///
/// *Values.* The smallest eigenvalue is the least of u K(q) u over unit vectors u, a least of
/// functions affine in q, hence concave. With `table` its values and tangents at the nodes of a
/// grid of loads bound it from both sides (`geometry::ConcaveTable`); each node costs an eigenvalue
/// problem when the system is made.
///
/// Every call solves an eigenvalue problem, some 20 us. `slow` adds a stated cost, spent
/// waiting. Functions are generic in the state type.
class LeastEigenvalue {
public:
    using State = std::array<double, 4>;
    static constexpr bool resets = false;
    static constexpr std::size_t order = 24;

    struct Parameters {
        double level = 1.3;      ///< of the eigenvalue
        double amplitude = 1;    ///< of the loads, positive
        double frequency = 0.7;  ///< [rad/s] of the slowest load, positive
        double slow = 0;         ///< [s] time added to each call of the guard, at most 1
        std::uint64_t seed = 1;  ///< of the matrices
        std::size_t table = 0;   ///< cells along a load, at most 48; 0: no bounds of the value
    };

    LeastEigenvalue() : LeastEigenvalue(Parameters{}) {}

    /// @throws std::invalid_argument if a parameter is outside its range.
    explicit LeastEigenvalue(const Parameters& parameters);

    static constexpr std::string_view name = "eigenvalue";

    /// The loads at t = 0.
    [[nodiscard]] State start() const noexcept;

    [[nodiscard]] static constexpr GuardInfo guard_info(std::size_t /*which*/) noexcept
    {
        return {.name = "buckling", .crossing = Crossing::either};
    }

    template <class X>
    void flow(double t, const X& /*x*/, X& dxdt) const noexcept
    {
        for (std::size_t k = 0; k < 4; ++k) {
            dxdt[k] = p_.amplitude * frequency_[k] * std::cos(frequency_[k] * t + phase_[k]);
        }
    }

    template <class X>
    [[nodiscard]] double guard(double /*t*/, const X& x) const noexcept
    {
        return eigenvalue({x[0], x[1], x[2], x[3]}) - p_.level;
    }

    /// u K' u with the eigenvector u: as expensive as the guard.
    template <class X, class D>
    [[nodiscard]] double guard_rate(double /*t*/, const X& x, const D& dxdt) const noexcept
    {
        return eigenvalue_rate({x[0], x[1], x[2], x[3]}, {dxdt[0], dxdt[1], dxdt[2], dxdt[3]});
    }

    [[nodiscard]] static constexpr double lipschitz() noexcept { return 1; }

    template <class X>
    [[nodiscard]] double speed_bound(double t, const X& /*x*/) const noexcept
    {
        double sum = 0;
        for (std::size_t k = 0; k < 4; ++k) {
            sum += norm_[k] * std::fabs(std::cos(frequency_[k] * t + phase_[k])) * frequency_[k];
        }
        return p_.amplitude * sum;
    }

    template <class X>
    [[nodiscard]] double acceleration_bound(double /*t*/, const X& /*x*/) const noexcept
    {
        double sum = 0;
        for (std::size_t k = 0; k < 4; ++k) sum += norm_[k] * frequency_[k] * frequency_[k];
        return p_.amplitude * sum;
    }

    /// A lower bound from the table; -infinity where there is none.
    template <class X>
    [[nodiscard]] double lower_bound(double /*t*/, const X& x) const noexcept
    {
        return least({x[0], x[1], x[2], x[3]}) - p_.level;
    }
    template <class X>
    [[nodiscard]] double upper_bound(double /*t*/, const X& x) const noexcept
    {
        return most({x[0], x[1], x[2], x[3]}) - p_.level;
    }

    /// By Weyl's inequality, for `learn::certify`.
    template <class X>
    [[nodiscard]] double guard_slack(const X& half_widths) const noexcept
    {
        double sum = 1e-11;  // of two solutions
        for (std::size_t k = 0; k < 4; ++k) sum += norm_[k] * half_widths[k];
        return sum;
    }
    /// Lower bound over a box: a concave function is least at a corner. The values at the 16
    /// corners come from the table, or from eigenvalue problems without one.
    template <class X>
    [[nodiscard]] double guard_least(const X& lower, const X& upper) const noexcept
    {
        return least_over({lower[0], lower[1], lower[2], lower[3]},
                          {upper[0], upper[1], upper[2], upper[3]}) -
               p_.level;
    }

    /// The parameter with the given name; empty if there is none.
    [[nodiscard]] std::optional<double> parameter(std::string_view which) const noexcept;

    /// Number of eigenvalue problems solved for the table.
    [[nodiscard]] std::size_t tabulated() const noexcept;

    /// Smallest eigenvalue of K(q); NaN where q is not finite.
    [[nodiscard]] double eigenvalue(const State& q) const noexcept;

    /// ||K_k||, rounded up.
    [[nodiscard]] double norm(std::size_t k) const noexcept { return norm_[k]; }

private:
    struct Matrices;

    [[nodiscard]] double least(const State& q) const noexcept;
    [[nodiscard]] double most(const State& q) const noexcept;
    [[nodiscard]] double least_over(const State& lower, const State& upper) const noexcept;
    [[nodiscard]] double eigenvalue_rate(const State& q, const State& rates) const noexcept;

    Parameters p_;
    std::array<double, 4> frequency_{};  ///< [rad/s]
    std::array<double, 4> phase_{};
    std::array<double, 4> norm_{};
    std::shared_ptr<const Matrices> matrices_;
};

}  // namespace ricochet
