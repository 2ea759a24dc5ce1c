// The two classifiers of the bouncing ball, from surface samples to model.
//
// The exact map of free fall over a step is a parabola, and a step of h from
// height u and velocity v ends on or below the floor iff
//
//     u + v h - g h^2 / 2 <= 0,   that is   u / (g h^2) + v / (g h) <= 1/2.
//
// Margins are that difference over the sum of its terms' magnitudes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "ricochet/detail/surface.hpp"
#include "ricochet/learn/classifier.hpp"

namespace ricochet::learn {

/// Kinds of classifiers of the ball.
enum class BallModel {
    fixed_step,  ///< features (u, v), one step and one gravity, as in the source paper
    any_step,    ///< recipe `ballistic`: every gravity, restitution, height and step
};

/// Name of a kind: "fixed-step" or "any-step".
[[nodiscard]] std::string_view name(BallModel kind) noexcept;

/// The kind of this name. @throws std::invalid_argument naming what was given and what is known.
[[nodiscard]] BallModel ball_model_named(std::string_view name);

/// Data and options of a training of a classifier of the ball.
struct BallTraining {
    // Of a fixed-step model only.
    double gravity = 9.81;  ///< [m/s^2], positive
    double step = 0.01;     ///< [s], positive
    double height = 10;     ///< [m], positive; the highest drop the model is for

    std::size_t states = 200'000;       ///< sampled for training and testing, half of them events
    std::size_t fresh_events = 40'000;  ///< for the report, with as many clear states
    double margin = 0.1;                ///< clear states nearer to the boundary are not trained on
    std::uint64_t seed = 1;             ///< of sampling, splitting and training
    TrainingOptions training{};         ///< its seed is replaced by the one above
};

/// Default options, from which the models that come with the library were made.
///
/// A fixed-step model has five hidden layers like the paper's; their width, which the paper does
/// not state, is 16 here. An any-step model has one hidden layer of 16, trained on 400 000 states:
/// in its logarithmic features the boundary is two straight lines and a bend. A layer of 8 suffices
/// for most seeds, but for some it cuts off a corner of the boundary and misses events.
[[nodiscard]] BallTraining ball_training(BallModel kind);

/// States of a ball, sampled backward in time from the floor (and, for a tenth of them, forward),
/// the closest to the boundary at 1e-6 h from it.
///
/// - fixed step: speeds at the floor half uniform, half log-uniform, such that the
///   box of the model is filled: 15 % above `height` and 10 % above the speed of
///   a fall from it, and below the floor what two steps at that speed reach.
/// - any step: gravity in [0.1, 100] m/s^2, step in [1e-6, 100] s and speed at the
///   floor in [1e-3, 2e14] g h, all log-uniform, half of the speeds in
///   [0.03, 30] g h, where the boundary bends; |u| <= 1e14 g h^2, |v| <= 1e14 g h.
///
/// @param keep_band  whether to keep clear states whose margin is too small for training
[[nodiscard]] SurfaceSample sample_ball(BallModel kind, const BallTraining& training,
                                        std::size_t events, std::size_t clear, std::uint64_t seed,
                                        bool keep_band);

/// Samples, trains and assesses on fresh states. The model is complete and can be stored;
/// `Trained::misses_none` says whether it should be.
/// @throws as `train`, and std::invalid_argument if a parameter is outside its range.
[[nodiscard]] Trained train_bouncing_ball(BallModel kind, const BallTraining& training,
                                          const ProgressCallback& progress = {});

}  // namespace ricochet::learn
