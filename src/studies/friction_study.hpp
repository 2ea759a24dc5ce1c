// The published study of learned friction, repeated: its tables 1 to 4.
//
// S. Liu, K. Bhattacharya and N. Lapusta, Learning a potential formulation for
// rate-and-state friction, arXiv 2507.09796, 2025. What the paper leaves open (ranges, seeds,
// initial states) is fixed as described at `make_histories` and `slider_cases`.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "baselines.hpp"
#include "ricochet/learn_steps/train_friction.hpp"

namespace ricochet::learn {

/// Table 1: errors with a number of internal variables.
struct InternalVariables {
    int internal = 0;
    std::size_t parameters = 0;
    double seconds = 0;
    FrictionErrors training{}, test{};
};
[[nodiscard]] InternalVariables try_internal_variables(
    const FrictionData& data, int internal, std::size_t histories, double seconds,
    const std::atomic<bool>* cancelled = nullptr);

/// Table 2: mean relative L2 errors inside sliders, ten runs of 2 s.
struct SliderErrors {
    double x = 0, v = 0, friction = 0;
    double beyond = 0;  ///< of f - f*
};
struct Transfer {
    SliderErrors as_trained{};       ///< by a pair that was trained on histories only
    SliderErrors further_trained{};  ///< after training on slip rates of other sliders
};
/// Sliders at 1.5 to 4 times the critical stiffness whose load changes its velocity twice.
/// @throws std::invalid_argument unless the fit is an additive pair with one internal
/// variable.
/// @param cancelled  true ends it within moments; the result is then meaningless
[[nodiscard]] Transfer transfer_to_sliders(const LearnedFriction& fit, std::uint64_t seed,
                                           double seconds,
                                           const std::atomic<bool>* cancelled = nullptr);

/// Tables 3 and 4: the fixed steps, as the number of them in 1/64 s, so that all of them
/// meet at common times: 2^-13.5, 2^-13, ..., 2^-11 s to within one in a hundred.
inline constexpr int study_steps[] = {181, 128, 91, 64, 45, 32};

/// Velocities at the common times, and whether the run was stable.
struct SliderVelocities {
    bool stable = true;
    std::size_t unsolved = 0;
    std::vector<double> velocity{};
};
/// Computes them by variational steps of an order.
[[nodiscard]] SliderVelocities slider_velocities(const SliderCase& slider, int order,
                                                 int steps_in_64th);
/// Computes them by a baseline.
[[nodiscard]] SliderVelocities slider_velocities(const SliderCase& slider, BaselineOptions options,
                                                 int steps_in_64th);

}  // namespace ricochet::learn
