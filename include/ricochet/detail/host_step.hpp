// Internal: the declarations of this header may change without notice.
//
// A step of a host program, as the engine sees it.
#pragma once

#include <cstddef>

#include "ricochet/instant.hpp"

namespace ricochet::detail {

/// Table of a step's data and functions. Arrays have as many elements as the state.
/// Rates are with respect to the offset s in [0, h].
/// Time and remainder are not adjacent: a compiler would copy both together, right after they
/// were written one by one, and the processor would stall.
struct HostStepTable {
    double t = 0;  ///< [s] at the start
    double h = 0;  ///< [s]
    const double* x0 = nullptr;
    const double* x1 = nullptr;
    const double* rate0 = nullptr;
    const double* rate1 = nullptr;

    const void* host = nullptr;  ///< first argument of the functions
    void (*interpolate)(const void* host, double s, double* x, std::size_t n) = nullptr;
    /// The derivative of `interpolate`. Null: a difference is used.
    void (*rate)(const void* host, double s, double* dxdt, std::size_t n) = nullptr;
    /// The host's own map from the start of the step. Null: `interpolate` is used.
    void (*restep)(const void* host, double s, double* x, std::size_t n) = nullptr;
    double t_remainder = 0;  ///< [s] of the start
    bool is_cubic = false;   ///< the path is the cubic through the states and rates at both ends

    [[nodiscard]] Instant start() const noexcept { return {t, t_remainder}; }
};

}  // namespace ricochet::detail
