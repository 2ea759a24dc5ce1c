// The features of a state for a gate, by a recipe that its model names.
//
//     state            x
//     state-rate       x, x'
//     state-phase(w)   x, sin(w t), cos(w t): for a force of the frequency w [rad/s]
//     angles           sin and cos of the first half of x, then the other half
//     chain            the same for the sums q_1 + ... + q_i of the first half: the directions
//                      of the links of a chain whose joints turn relative to each other
//     own              computed by the system: features(t, x, out), feature_count
//
// With the suffix " mode(n)", n further features encode which of n modes it is: 1 for the mode, 0
// for the others.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>

#include "ricochet/detail/components.hpp"
#include "ricochet/system.hpp"

namespace ricochet {

/// How features are computed from (mode, t, x).
struct GateRecipe {
    /// The recipes at the head of this file.
    enum class Kind { state, state_rate, state_phase, angles, chain, own };

    static constexpr std::size_t most = 64;  ///< features

    Kind kind = Kind::state;
    double frequency = 0;   ///< [rad/s] of `state_phase`
    std::size_t modes = 0;  ///< 0: the mode is no feature

    friend bool operator==(const GateRecipe&, const GateRecipe&) = default;

    /// Writes the features of a state, `feature_count` numbers.
    template <class System, class X>
    void write(const System& system, Mode mode, double t, const X& x, double* out) const;
};

/// Name as a model spells it, e.g. "state-phase(0.7) mode(3)".
[[nodiscard]] std::string to_string(const GateRecipe& recipe);

/// @throws std::invalid_argument naming what was given and what is known.
[[nodiscard]] GateRecipe gate_recipe(std::string_view spelled);

/// A system with features of its own.
template <class System, class X>
concept FeaturesOwned = requires(const System& system, double t, const X& x, double* out)
{
    {
        system.feature_count
        } -> std::convertible_to<std::size_t>;
    system.features(t, x, out);
};

/// The number of features that a recipe makes of a state; 0 where it cannot be computed.
template <class System, class X>
[[nodiscard]] std::size_t feature_count(const GateRecipe& recipe,
                                        [[maybe_unused]] const System& system, const X& x)
{
    const auto n = static_cast<std::size_t>(x.size());
    switch (recipe.kind) {
        case GateRecipe::Kind::state: return n + recipe.modes;
        case GateRecipe::Kind::state_rate: return 2 * n + recipe.modes;
        case GateRecipe::Kind::state_phase: return n + 2 + recipe.modes;
        case GateRecipe::Kind::angles:
        case GateRecipe::Kind::chain: return n % 2 == 0 ? n + n / 2 + recipe.modes : 0;
        case GateRecipe::Kind::own:
            if constexpr (FeaturesOwned<System, X>) {
                return static_cast<std::size_t>(system.feature_count) + recipe.modes;
            }
            return 0;
    }
    return 0;
}

namespace detail {

template <class System, class X>
void flow_features(const System& system, Mode mode, double t, const X& x, double* out)
{
    X rate = x;
    call_flow(system, mode, t, x, rate);
    for_each_component(x, [&](auto i) { out[i] = rate[i]; });
}

template <class X>
void angle_features(const X& x, bool chained, double* out) noexcept
{
    const auto n = static_cast<std::size_t>(x.size()) / 2;
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) {
        const double angle = x[static_cast<decltype(x.size())>(i)];
        sum = chained ? sum + angle : angle;
        out[2 * i] = std::sin(sum);
        out[2 * i + 1] = std::cos(sum);
        out[2 * n + i] = x[static_cast<decltype(x.size())>(n + i)];
    }
}

}  // namespace detail

template <class System, class X>
void GateRecipe::write(const System& system, Mode mode, double t, const X& x, double* out) const
{
    const auto n = static_cast<std::size_t>(x.size());
    const auto copy = [&] { detail::for_each_component(x, [&](auto i) { out[i] = x[i]; }); };
    switch (kind) {
        case Kind::state: copy(); break;
        case Kind::state_rate:
            copy();
            detail::flow_features(system, mode, t, x, out + n);
            break;
        case Kind::state_phase:
            copy();
            out[n] = std::sin(frequency * t);
            out[n + 1] = std::cos(frequency * t);
            break;
        case Kind::angles: detail::angle_features(x, false, out); break;
        case Kind::chain: detail::angle_features(x, true, out); break;
        case Kind::own:
            if constexpr (FeaturesOwned<System, X>) system.features(t, x, out);
            break;
    }
    if (modes == 0) return;
    double* const flags = out + feature_count(*this, system, x) - modes;
    for (std::size_t m = 0; m < modes; ++m) flags[m] = m == mode ? 1 : 0;
}

}  // namespace ricochet
