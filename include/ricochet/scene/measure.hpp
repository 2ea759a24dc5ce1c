// Measured quantities of a scene: rates of collisions, pressures, the mean free path and the pair
// distribution, with errors by blocks.
//
//     SceneMeasure measure(scene, {.t_start = 10, .t_end = 110, .blocks = 20});
//     options.observe = [&](const SceneEvent& event) { measure.add(event); };
//     const SceneRun run = simulate(scene, options);
//     const SceneMeasures found = measure.result();
//
// The time from t_start to t_end is divided into blocks of equal length. A quantity is the mean of
// its values in the blocks, and its error the standard deviation of these divided by the root of
// their number: true where the blocks are longer than the correlations. Plates are no part of the
// gas: an impact on one counts among those on surfaces.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "ricochet/scene/simulate.hpp"

namespace ricochet {

/// A mean and its standard error; NaN for the error of fewer than two values.
struct Measured {
    double mean = 0;
    double error = 0;
};

/// The mean of values that are independent of each other, NaN of none.
[[nodiscard]] Measured mean_of(std::span<const double> values);

/// Options of `SceneMeasure`.
struct MeasureOptions {
    double t_start = 0;       ///< [s] events before it do not count
    double t_end = 0;         ///< [s] above t_start
    std::size_t blocks = 10;  ///< two at least
    double area = 0;          ///< [m^2] of the gas, for the pressures; 0: that of the period
};

/// Results of `SceneMeasure`.
struct SceneMeasures {
    Measured collision_rate;  ///< [1/s] impacts between two bodies
    Measured wall_rate;       ///< [1/s] impacts on surfaces
    Measured temperature;     ///< [J] kT: kinetic energy of the centres for each body, about their
                              ///< mean velocity, in two directions
    /// [N/m] By the virial: N kT / area, and the sum over impacts between bodies of impulse times
    /// distance of the centres along the normal, divided by 2 area time.
    Measured virial_pressure;
    Measured
        mean_free_path;  ///< [m] mean speed of all bodies / impacts of one with others a second
    /// [N/m] Of each surface: the impulse along its normal for each second and each metre; for
    /// surfaces whose length has been given by `length_of`, else NaN.
    std::vector<Measured> surface_pressure;
};

/// Collects the events of a run.
class SceneMeasure {
public:
    /// @throws std::invalid_argument for options outside their ranges, or where no area is known.
    SceneMeasure(const Scene& scene, const MeasureOptions& options);

    /// Sets the length [m] of a surface, over which bodies strike it.
    /// @throws std::invalid_argument unless it is positive.
    void length_of(SurfaceId surface, double length);

    /// Takes the next event, in the order of time.
    void add(const SceneEvent& event);
    /// Takes all events of a run that has recorded them.
    void add(const SceneRun& run);

    /// The quantities up to `t_end`, as if nothing happened after the last event.
    [[nodiscard]] SceneMeasures result() const;

private:
    struct Block {
        double collisions = 0, wall_hits = 0;
        double virial = 0;         ///< [J] sum over impacts
        double energy = 0;         ///< [J s] integral of twice the kinetic energy of the centres
        double speed = 0;          ///< [m] integral of the sum of all speeds
        std::vector<double> push;  ///< [N s] on each surface
    };
    void advance(double t);
    void change(std::uint32_t body, const Vector2& velocity);

    const Scene* scene_;
    MeasureOptions options_;
    double length_ = 0;  ///< [s] of a block
    std::vector<Block> blocks_;
    std::vector<double> lengths_;
    std::vector<Vector2> velocities_;
    Vector2 momentum_{};
    double mass_ = 0;
    double twice_energy_ = 0;
    double speeds_ = 0;
    double t_ = 0;
};

/// A pair distribution g(r): the number of pairs at a distance, relative to that of bodies spread
/// evenly over the period.
struct PairDistribution {
    std::vector<double> distances;  ///< [m] middles of the bins
    std::vector<Measured> values;   ///< over the samples
};

/// The pair distribution of the samples of a run, up to a distance of at most half the period, in
/// bins of equal width. Errors treat samples as independent.
/// @throws std::invalid_argument for a scene without a period along both axes, or no samples.
[[nodiscard]] PairDistribution pair_distribution(const Scene& scene, const SceneRun& run,
                                                 double distance, std::size_t bins);

/// Temperatures along an axis.
struct TemperatureProfile {
    std::vector<double> places;    ///< [m] middles of the slices
    std::vector<Measured> values;  ///< [J] kT, over the samples; NaN where there were none
};

/// Temperatures of the samples of a run in slices of equal width from `low` to `high` [m] along x
/// (`axis` 0) or y (1): the kinetic energy of the centres about the mean velocity of their slice,
/// in two directions. Samples with fewer than two bodies in a slice do not count there. Errors
/// treat samples as independent.
/// @throws std::invalid_argument for an empty interval, no slices or no samples.
[[nodiscard]] TemperatureProfile temperature_profile(const Scene& scene, const SceneRun& run,
                                                     std::size_t axis, double low, double high,
                                                     std::size_t slices);

}  // namespace ricochet
