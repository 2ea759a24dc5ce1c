// Systems whose guards are seen through a pinhole: only their sign, or nothing but their value.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "ricochet/hybrid/guard.hpp"

namespace ricochet {

namespace detail {

/// Keeps the processor busy for `seconds`.
inline void wait(double seconds) noexcept
{
    if (!(seconds > 0)) return;
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (std::chrono::steady_clock::now() < end) {
    }
}

/// @throws std::invalid_argument outside of [0, 1] s.
inline double checked_cost(std::string_view system, double cost)
{
    if (cost >= 0 && cost <= 1) return cost;
    throw std::invalid_argument(std::string(system) + ": cost must lie in [0, 1] s, got " +
                                std::to_string(cost));
}

}  // namespace detail

/// A system with one guard of which nothing is known but its value: no rate, no bounds.
template <class System>
class Hidden {
public:
    using State = typename System::State;

    /// `cost` [s] is what a call of the guard takes longer.
    /// @throws std::invalid_argument for a cost outside of [0, 1] s.
    explicit Hidden(System system, double cost = 0)
        : system_(std::move(system)), cost_(detail::checked_cost("Hidden", cost))
    {
    }

    [[nodiscard]] const System& system() const noexcept { return system_; }
    [[nodiscard]] State start() const noexcept { return system_.start(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const noexcept
    {
        return system_.guard_info(which);
    }

    template <class X>
    void flow(double t, const X& x, X& dxdt) const noexcept
    {
        system_.flow(t, x, dxdt);
    }
    template <class X>
    [[nodiscard]] double guard(double t, const X& x) const noexcept
    {
        detail::wait(cost_);
        return system_.guard(t, x);
    }
    template <class X>
    void reset(double t, X& x) const noexcept
    {
        system_.reset(t, x);
    }

private:
    System system_;
    double cost_;
};

/// A system with one guard of which only the sign is known, at a stated cost: a collision
/// checker that says yes or no.
template <class System>
class BlackBox {
public:
    using State = typename System::State;

    /// `cost` [s] of a call, spent waiting.
    /// @throws std::invalid_argument for a cost outside of [0, 1] s.
    explicit BlackBox(System system, double cost = 50e-6)
        : system_(std::move(system)), cost_(detail::checked_cost("BlackBox", cost))
    {
    }

    [[nodiscard]] const System& system() const noexcept { return system_; }
    [[nodiscard]] State start() const noexcept { return system_.start(); }
    [[nodiscard]] GuardInfo guard_info(std::size_t which) const noexcept
    {
        GuardInfo info = system_.guard_info(which);
        info.boolean = true;
        info.unilateral = false;  // on the surface it cannot tell pressing from leaving
        info.touch = 0;
        info.degree = 0;
        return info;
    }

    template <class X>
    void flow(double t, const X& x, X& dxdt) const noexcept
    {
        system_.flow(t, x, dxdt);
    }
    /// Whether the state is inside. A guard that is no number is not.
    template <class X>
    [[nodiscard]] bool guard(double t, const X& x) const noexcept
    {
        detail::wait(cost_);
        return system_.guard(t, x) > 0;
    }
    template <class X>
    void reset(double t, X& x) const noexcept
    {
        system_.reset(t, x);
    }

private:
    System system_;
    double cost_;
};

}  // namespace ricochet
