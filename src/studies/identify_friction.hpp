// The parameters of the ageing law from measured friction.
#pragma once

#include <atomic>
#include <vector>

#include "ricochet/faults/friction.hpp"

namespace ricochet::learn {

struct IdentifiedFriction {
    RateStateParameters parameters{};
    double xi_start = 0;  ///< the state at the start of every history
    /// Standard errors of a, b, f*, log(D_RS) and xi_start, from the residuals.
    double a_error = 0, b_error = 0, f_star_error = 0, log_d_rs_error = 0, xi_error = 0;
    double residual = 0;  ///< root mean square, in friction
    int iterations = 0;
    bool converged = false;
};

/// Fits (a, b, f*, D_RS) of the ageing law and the state at the start, which all histories
/// share, to friction by least squares: for a given D_RS the state is exact and the law is
/// linear in the other parameters, so that the best D_RS of a logarithmic grid is a start from
/// which Levenberg and Marquardt's method needs a few steps. V* is a convention: another value
/// gives another f*.
///
/// @throws std::invalid_argument for no history, one that `validate` refuses or without
/// friction, or for friction that does not rise with rate and state.
/// @param cancelled  true ends the fit, with the parameters found so far
[[nodiscard]] IdentifiedFriction identify_ageing_law(const std::vector<FrictionHistory>& histories,
                                                     double v_star = 1e-4,
                                                     const std::atomic<bool>* cancelled = nullptr);

}  // namespace ricochet::learn
