// Systems that hide properties of their guards: only the sign, or only the value, is known.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "ricochet/guard.hpp"

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

/// A system with one guard, of which no more is shown than the flow, the reset and, at a cost,
/// the value.
template <class System>
class Pinhole {
public:
    using State = typename System::State;

    [[nodiscard]] const System& system() const noexcept { return system_; }
    [[nodiscard]] State start() const noexcept { return system_.start(); }

    template <class X>
    void flow(double t, const X& x, X& dxdt) const noexcept
    {
        system_.flow(t, x, dxdt);
    }
    template <class X>
    void reset(double t, X& x) const noexcept
    {
        system_.reset(t, x);
    }

protected:
    Pinhole(std::string_view name, System system, double cost)
        : system_(std::move(system)), cost_(checked_cost(name, cost))
    {
    }

    template <class X>
    [[nodiscard]] double value(double t, const X& x) const noexcept
    {
        wait(cost_);
        return system_.guard(t, x);
    }

private:
    System system_;
    double cost_;
};

}  // namespace detail

/// A system with one guard of which nothing is known but its value: no rate, no bounds.
template <class System>
class Hidden : public detail::Pinhole<System> {
public:
    /// `cost` [s] is added to each call of the guard.
    /// @throws std::invalid_argument for a cost outside of [0, 1] s.
    explicit Hidden(System system, double cost = 0)
        : detail::Pinhole<System>("Hidden", std::move(system), cost)
    {
    }

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const noexcept
    {
        return this->system().guard_info(which);
    }
    template <class X>
    [[nodiscard]] double guard(double t, const X& x) const noexcept
    {
        return this->value(t, x);
    }
};

/// A system with one guard of which only the sign is known, at a stated cost: a collision
/// checker that says yes or no.
template <class System>
class BlackBox : public detail::Pinhole<System> {
public:
    /// `cost` [s] of a call, spent waiting.
    /// @throws std::invalid_argument for a cost outside of [0, 1] s.
    explicit BlackBox(System system, double cost = 50e-6)
        : detail::Pinhole<System>("BlackBox", std::move(system), cost)
    {
    }

    [[nodiscard]] GuardInfo guard_info(std::size_t which) const noexcept
    {
        GuardInfo info = this->system().guard_info(which);
        info.boolean = true;
        info.unilateral = false;  // on the surface it cannot tell pressing from leaving
        info.touch = 0;
        info.degree = 0;
        return info;
    }
    /// Whether the state is inside. If the guard is not a number, it is not.
    template <class X>
    [[nodiscard]] bool guard(double t, const X& x) const noexcept
    {
        return this->value(t, x) > 0;
    }
};

}  // namespace ricochet
