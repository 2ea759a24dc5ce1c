// Fits potentials of friction to histories of slip rate: recurrent neural operators whose internal
// variables are found by the fit.
//
// The fit uses slip rate and friction alone. Along a history the internal variables xi_j' =
// G_j(d_j), d_j = -dDdag/dxi_j, are integrated by an L-stable method of order 4. The parameters are
// found by the Levenberg-Marquardt method, with sensitivities propagated through the stages, so
// that the gradient is that of the computed friction.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "ricochet/faults/friction.hpp"
#include "ricochet/learn/levenberg_marquardt.hpp"

namespace ricochet::learn {

namespace detail {
class FrictionModel;
}

/// Classes of potentials that can be fitted.
enum class FrictionNetwork {
    /// AdditivePair: f = A(log V) + beta sum of xi_j, with monotone nets.
    additive,
    /// Ddag = V N(log V, xi) + c(xi): N one hidden layer of softplus units, convex in both
    /// arguments, with a linear part (B. Amos, L. Xu and J. Z. Kolter, Input convex neural
    /// networks, 2017); one internal variable.
    general,
};

/// Options of `train_friction`.
struct FrictionTrainingOptions {
    FrictionNetwork network = FrictionNetwork::additive;
    int internal = 1;               ///< internal variables: 0, 1 or 2 (general: 1)
    std::size_t direct_units = 8;   ///< of A, at most 8
    std::size_t state_units = 7;    ///< of C, at most 8
    std::size_t rate_units = 7;     ///< of G, at most 8
    std::size_t hidden_units = 16;  ///< hidden units of N
    double v_star = 1e-4;           ///< [m/s] unit of the slip rate
    std::uint64_t seed = 1;         ///< seed of the initial weights
    int iterations = 60;
    double seconds = 60;   ///< [s] limit of processor time
    double target = 1e-7;  ///< root mean square relative error at which the fit stops
    /// Initial iterations by Adam, each on a few histories, before those of Levenberg-Marquardt.
    int adam_iterations = 0;
    double adam_rate = 3e-3;
    const std::atomic<bool>* cancelled = nullptr;  ///< true ends the fit, which keeps its result
};

/// A fitted model of friction.
class LearnedFriction {
public:
    /// Takes a fitted model; made by `train_friction`.
    explicit LearnedFriction(std::shared_ptr<const detail::FrictionModel> model);

    /// Friction along a history. The integration steps are halved `refine` times.
    /// @throws std::invalid_argument for a history that `validate` refuses.
    [[nodiscard]] std::vector<double> friction(const FrictionHistory& history,
                                               int refine = 0) const;
    /// The internal variables along a history, one list for each; throws as `friction`.
    [[nodiscard]] std::vector<std::vector<double>> internal(const FrictionHistory& history) const;

    /// Number of fitted parameters.
    [[nodiscard]] std::size_t parameters() const noexcept;
    /// The pair of potentials of an additive model with one internal variable, with the
    /// domain of its training; empty for other models.
    [[nodiscard]] std::optional<AdditivePair> pair() const;

    double seconds = 0;  ///< [s] processor time of the training
    int iterations = 0;
    double training_error = 0;  ///< root mean square over histories of the relative error

    [[nodiscard]] const std::shared_ptr<const detail::FrictionModel>& model() const noexcept
    {
        return model_;
    }

private:
    std::shared_ptr<const detail::FrictionModel> model_;
};

/// Fits a model to histories with friction.
/// @throws std::invalid_argument for options outside their range, for no histories, and for a
/// history that `validate` refuses or that has no friction.
[[nodiscard]] LearnedFriction train_friction(const std::vector<FrictionHistory>& histories,
                                             const FrictionTrainingOptions& options = {});

/// Continues a fit with other histories, as in transfer learning. @throws as `train_friction`.
[[nodiscard]] LearnedFriction train_further(const LearnedFriction& from,
                                            const std::vector<FrictionHistory>& histories,
                                            const FrictionTrainingOptions& options);

/// Errors of a fit over many histories.
struct FrictionErrors {
    double mean = 0, deviation = 0, most = 0;  ///< of relative L2 errors of friction
    double mean_beyond = 0;                    ///< mean of those relative to f - f*
};
/// Errors of `fit` on histories with friction; `f_star` is f*.
[[nodiscard]] FrictionErrors assess(const LearnedFriction& fit,
                                    const std::vector<FrictionHistory>& histories, double f_star);

}  // namespace ricochet::learn
