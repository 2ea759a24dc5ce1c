// Ordinary solvers for the slider with rate-and-state friction, kept for comparison.
//
// They integrate the ageing law in its usual log form, or in its potential form, with no more
// safeguards than general packages have: a slip rate that turns negative makes the logarithm
// NaN, which ends the run as unstable.
#pragma once

#include <vector>

#include "ricochet/faults/spring_slider.hpp"

namespace ricochet {

enum class Baseline {
    rk4,             ///< the explicit 3/8 rule
    adams,           ///< predictor and functional iteration, at most `adams_order`
    backward_euler,  ///< plain Newton in (V, state)
};

/// Variable that represents the state.
enum class StateForm {
    theta,      ///< theta' = 1 - V theta / D_RS
    potential,  ///< xi' = dD*/dd at d = -dDdag/dxi, f = dDdag/dV
};

struct BaselineOptions {
    Baseline method = Baseline::rk4;
    StateForm form = StateForm::theta;
    double step = 0;       ///< [s], positive
    double t_end = 2;      ///< [s]
    int adams_order = 12;  ///< 4 to 12; RK4 takes as many steps before it is reached
    /// Iterations of the corrector and its tolerances, as in torchdiffeq's implicit_adams.
    int corrections = 4;
    double rtol = 1e-7, atol = 1e-9;
};

struct BaselineRun {
    bool stable = false;             ///< finite throughout and |V| <= 1e6 V*
    std::vector<double> velocity{};  ///< after every step, up to where it became unstable
};

/// @throws std::invalid_argument for a step that is not positive or an unknown order.
[[nodiscard]] BaselineRun run_baseline(const SpringSlider& slider, const SliderState& start,
                                       const BaselineOptions& options);

}  // namespace ricochet
