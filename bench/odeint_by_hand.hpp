// The rival that needs no library but Boost: odeint's own loop, with a sign check
// after each step and bisection inside it, as a competent user writes it.
//
// It is compiled in a file of its own, so that surrounding code does not change
// how well it is optimised.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "ricochet/systems/bouncing_ball.hpp"
#include "ricochet/systems/impact_oscillator.hpp"

namespace ricochet::bench {

/// Result of a run by hand; the counts are made by the user's code.
struct ByHand {
    std::vector<double> times;  ///< [s]
    std::size_t steps = 0;
    std::size_t flow_calls = 0;
    std::size_t guard_calls = 0;
};

/// dopri5 with `make_dense_output`; bisection on the dense output.
[[nodiscard]] ByHand by_hand_on_dense_output(const BouncingBall& ball,
                                             const std::array<double, 2>& x0, double t_end,
                                             double tolerance);

/// dopri5 with `make_controlled`; bisection on the step itself, repeated by a
/// second stepper, so that events are as accurate as the method.
[[nodiscard]] ByHand by_hand_on_step_map(const BouncingBall& ball, const std::array<double, 2>& x0,
                                         double t_end, double tolerance);

/// The same for the impact oscillator, which needs real steps.
[[nodiscard]] ByHand by_hand_on_dense_output(const ImpactOscillator& oscillator,
                                             const std::array<double, 2>& x0, double t_end,
                                             double tolerance);
[[nodiscard]] ByHand by_hand_on_step_map(const ImpactOscillator& oscillator,
                                         const std::array<double, 2>& x0, double t_end,
                                         double tolerance);

/// As `by_hand_on_step_map`, by TOMS 748 instead of bisection: a fifth of the steps.
[[nodiscard]] ByHand by_hand_with_toms748(const ImpactOscillator& oscillator,
                                          const std::array<double, 2>& x0, double t_end,
                                          double tolerance);

}  // namespace ricochet::bench
