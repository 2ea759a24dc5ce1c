// Training states sampled from the event surface backward.
//
// After Saunders, Steyer and Kuether, "Machine learning for event detection in
// non-smooth initial value problems", eqs. 4-6: points of the event surface
// are integrated backward by sample steps. Within the step h of the model the
// result is an event by construction; further back it is a clear state.
//
// Close to the boundary between the two answers lies a band of clear states
// that no finite network separates from events. It is counted and not trained
// on: a network that sees both labels side by side must miss some events.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include "ricochet/base/random.hpp"
#include "ricochet/learn/data_set.hpp"

namespace ricochet::learn {

/// Requirements of the sampler on one guard. Times are counted in the unit of
/// the step, and states are of any copyable type.
///
///     surface(random)    a random point of the event surface, about to cross it
///     guard(x)           E(x), positive before the event
///     horizon(x)         how long the flow backward from a surface point is free of
///                        events, positive; infinite if there is no limit
///     magnitude(x, h)    sum of the magnitudes of the terms that cancel in
///                        E(map(x, h)); positive
///     inside(x)          whether x belongs to the domain of the model
///     columns()          what the features are
///     features(x, out)   writes one number per column
template <class Problem>
concept SurfaceProblem = requires(const Problem& problem, Random& random,
                                  const typename Problem::State& x, double h, double* out)
{
    {
        problem.surface(random)
        } -> std::convertible_to<typename Problem::State>;
    {
        problem.guard(x)
        } -> std::convertible_to<double>;
    {
        problem.horizon(x)
        } -> std::convertible_to<double>;
    {
        problem.magnitude(x, h)
        } -> std::convertible_to<double>;
    {
        problem.inside(x)
        } -> std::convertible_to<bool>;
    {
        problem.columns()
        } -> std::convertible_to<std::vector<Column>>;
    problem.features(x, out);
};

/// How a surface is sampled.
struct SurfaceOptions {
    double step = 0.01;           ///< h of the model, positive
    std::size_t events = 50'000;  ///< as many events as clear states keep the classes balanced
    std::size_t clear = 50'000;
    double margin = 0.1;     ///< a clear state nearer to the boundary than this belongs to the band
    bool keep_band = false;  ///< keep the band, for an assessment, instead of counting it
    double longest = 1e3;    ///< [steps] furthest sample step backward where nothing else limits it
    double closest = 1e-6;   ///< [steps] sample steps approach 0, h and the horizon up to this
    double beyond_share =
        0.1;  ///< fraction of states on the far side of the surface, as an earlier miss leaves them
    std::uint64_t seed = 1;
};

/// A sampled surface.
struct SurfaceSample {
    DataSet data;
    std::size_t band = 0;     ///< clear states inside the margin that were drawn
    std::size_t outside = 0;  ///< states outside the domain that were drawn and discarded
};

namespace detail {

/// A sample step in (lower, upper), often close to either end: where the answer
/// changes, and where it must not.
inline double sample_step(double lower, double upper, double closest, Random& random)
{
    const double length = upper - lower;
    const double nearest = std::min(closest, 0.5 * length);
    switch (random.below(3)) {
        case 0: return lower + random.log_uniform(nearest, length);
        case 1: return upper - random.log_uniform(nearest, length);
        default: return random.uniform(lower, upper);
    }
}

/// A state whose next step of h meets the surface, or does not, as requested.
template <class Problem, class Map>
typename Problem::State propose(const Problem& problem, const Map& map, bool event,
                                const SurfaceOptions& options, Random& random)
{
    const double h = options.step;
    const double closest = options.closest * h;
    const typename Problem::State on_surface = problem.surface(random);
    const double horizon = std::min<double>(problem.horizon(on_surface), options.longest * h);

    if (random.chance(options.beyond_share)) {
        if (event && random.chance(0.5)) {
            return map(on_surface, random.log_uniform(closest, options.longest * h));
        }
        // A state on the far side returns within the step, or too late.
        const double early = event ? h + random.log_uniform(closest, options.longest * h)
                                   : sample_step(0, h, closest, random);
        return map(on_surface, -(horizon + early));
    }
    if (event) return map(on_surface, -sample_step(0, std::min(h, horizon), closest, random));
    if (horizon <= h) return map(on_surface, -horizon);
    return map(on_surface, -sample_step(h, horizon, closest, random));
}

}  // namespace detail

/// Samples the event surface of `problem`.
///
/// A state x is an event iff E(map(x, h)) <= 0 (eq. 4), regardless of the class for which
/// it was drawn, so that rounding cannot mislabel one. Its margin is E(map(x, h)) over
/// magnitude(x, h).
///
/// @param map  the one-step map of the integrator, x(t + h) = map(x(t), h), for
///             steps of both signs
/// @throws std::invalid_argument if an option is outside its range, or if
///         `problem` yields too few states of one class.
template <SurfaceProblem Problem, class Map>
[[nodiscard]] SurfaceSample sample_surface(const Problem& problem, const Map& map,
                                           const SurfaceOptions& options)
{
    if (!(options.step > 0)) {
        throw std::invalid_argument("sample_surface: the step must be positive, got " +
                                    std::to_string(options.step));
    }
    if (!(options.margin >= 0 && options.margin < 1)) {
        throw std::invalid_argument("sample_surface: the margin must lie in [0, 1), got " +
                                    std::to_string(options.margin));
    }
    Random random(options.seed);
    SurfaceSample sample;
    sample.data.columns = problem.columns();
    std::vector<double> row(sample.data.width());
    std::size_t events_left = options.events;
    std::size_t clear_left = options.clear;
    std::size_t attempts_left = 1000 * (options.events + options.clear);

    while (events_left + clear_left > 0) {
        if (attempts_left-- == 0) {
            throw std::invalid_argument(
                "sample_surface: after 1000 draws a state, " + std::to_string(events_left) +
                " events and " + std::to_string(clear_left) + " clear states are still missing");
        }
        const bool ask_for_event = random.below(events_left + clear_left) < events_left;
        const auto x = detail::propose(problem, map, ask_for_event, options, random);
        if (!problem.inside(x)) {
            ++sample.outside;
            continue;
        }
        const double margin =
            problem.guard(map(x, options.step)) / problem.magnitude(x, options.step);
        const bool event = margin <= 0;
        if (!event && margin < options.margin) {
            ++sample.band;
            if (!options.keep_band) continue;
        }
        std::size_t& left = event ? events_left : clear_left;
        if (left == 0) continue;
        --left;
        problem.features(x, row.data());
        sample.data.append(row, event, margin);
    }
    return sample;
}

}  // namespace ricochet::learn
