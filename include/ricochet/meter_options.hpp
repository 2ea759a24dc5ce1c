// How a detector decides whether its network pays, and what it has measured.
#pragma once

#include <cstdint>

namespace ricochet {

/// How `Metered` decides.
struct MeterOptions {
    /// The rule by which `Metered` decides whether to ask its network.
    enum class Decision : std::uint8_t {
        measured,  ///< by costs sampled with a clock
        counted,   ///< by the costs given here, so that the same run always makes the same choices
        always,    ///< the network is evaluated whenever possible
        never,
        every_step,  ///< every step is checked, and nothing is planned
    };
    Decision decision = Decision::measured;
    /// [s] Cost of a check of the guard, of an inference and of a step, if `counted`; not
    /// negative, and the step above 0.
    double guard = 0;
    double network = 0;
    double step = 0;
    /// Fraction of the run's time that useless trials may cost, in [0, 1].
    double trials = 0.01;
    std::uint64_t piece = 128;  ///< steps between decisions, at least 1
};

/// Measurements of a meter so far. Costs in seconds, 0 before the first sample.
struct MeterReading {
    double guard = 0;    ///< cost of a check
    double network = 0;  ///< cost of an inference
    double step = 0;     ///< cost of a step without checks and inferences, in the best alternative
    std::uint64_t asked = 0;
    std::uint64_t cleared = 0;  ///< inferences that cleared something
    double asking = 0;          ///< cost of a step while the network is asked; 0: never tried
    double not_asking = 0;      ///< cost of a step while it is not, in the better alternative
    double checking = 0;        ///< cost of a step while every one is checked; 0: never tried
    bool pays = false;          ///< asking the network pays
    bool checks = false;        ///< checking every step is cheapest

    /// Fraction of the inferences that cleared something; 0 without inferences.
    [[nodiscard]] double share_cleared() const noexcept
    {
        return asked > 0 ? static_cast<double>(cleared) / static_cast<double>(asked) : 0;
    }
};

}  // namespace ricochet
