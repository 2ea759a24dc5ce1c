// Histories of slip rate and friction, as experiments give them, and the exact state of the
// ageing law along them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "ricochet/faults/laws.hpp"

namespace ricochet {

/// Slip rate and friction coefficient at rising times.
struct FrictionHistory {
    /// How the slip rate continues between samples.
    enum class Between {
        constant,  ///< the slip rate holds from its sample to the next, and jumps there
        linear,    ///< it goes linearly from sample to sample
    };
    Between between = Between::constant;
    std::vector<double> t{};         ///< [s], rising
    std::vector<double> v{};         ///< [m/s], positive; at a jump the value after it
    std::vector<double> friction{};  ///< empty where it is not known
};

/// @throws std::invalid_argument for a history that is empty, unsorted, of lists that do not
/// match, or with a slip rate that is not positive, naming where.
void validate(const FrictionHistory& history);

/// theta of the ageing law over an interval in which the slip rate goes linearly from v0 to
/// v1, and its derivative by log(D_RS):
///
///     theta(h) = theta e^(-S(h)/D_RS) + integral over 0..h of e^(-(S(h) - S(t))/D_RS) dt,
///
/// S the slip; by Gauss quadrature to rounding, or in closed form where v0 = v1.
struct AgeingState {
    double theta = 0;     ///< [s]
    double by_log_l = 0;  ///< dtheta / dlog(D_RS) [s]
};
/// Advances theta of the ageing law by h [s], see `AgeingState`.
[[nodiscard]] AgeingState advance_ageing(const AgeingState& from, double d_rs, double v0, double v1,
                                         double h);

/// Friction of the exact pair along a history from the state xi at its start.
[[nodiscard]] std::vector<double> ageing_friction(const RateStateParameters& parameters,
                                                  const FrictionHistory& history, double xi = 0);

/// |found - expected| / |expected| in the Euclidean norm.
[[nodiscard]] double relative_error(const std::vector<double>& found,
                                    const std::vector<double>& expected);
/// Same, relative to expected - f*, the part of friction that depends on state and rate.
[[nodiscard]] double relative_error_beyond(const std::vector<double>& found,
                                           const std::vector<double>& expected, double f_star);

/// Histories with the friction of the ageing law, xi = 0 at their start: half of them with
/// one to five jumps, half continuous with two to eight corners, levels log-uniform in
/// [1e-3, 10] V*, 100 samples 0.02 s apart. (The protocol of Liu, Bhattacharya and Lapusta,
/// arXiv 2507.09796, section 4.2, with what it leaves open fixed.)
[[nodiscard]] std::vector<FrictionHistory> make_histories(
    std::size_t count, std::uint64_t seed, const RateStateParameters& parameters = {});

/// Histories for training, validation and test.
struct FrictionData {
    std::vector<FrictionHistory> training, validation, test;  ///< 480, 160, 160
};
/// Makes 480, 160 and 160 histories by `make_histories` from one seed.
[[nodiscard]] FrictionData make_friction_data(std::uint64_t seed,
                                              const RateStateParameters& parameters = {});

/// Adds independent normal noise of the given standard deviation to the friction.
void add_noise(std::vector<FrictionHistory>& histories, double deviation, std::uint64_t seed);

}  // namespace ricochet
