// Internal: what it declares may change without notice.
//
// A step of a host, as the engine knows it.
#pragma once

#include <cstddef>

#include "ricochet/detail/instant.hpp"

namespace ricochet::detail {

/// Arrays have as many elements as the state. Rates are with respect to the offset s in [0, h].
///
/// Time and remainder lie apart: a compiler that copies both together, right after they have been
/// written one by one, has the processor wait for them.
struct HostStepTable {
    double t = 0;  ///< [s] at the start
    double h = 0;  ///< [s]
    const double* x0 = nullptr;
    const double* x1 = nullptr;
    const double* rate0 = nullptr;
    const double* rate1 = nullptr;

    const void* host = nullptr;  ///< what the functions are called with
    void (*interpolate)(const void* host, double s, double* x, std::size_t n) = nullptr;
    /// The derivative of `interpolate`. Null: it is a difference.
    void (*rate)(const void* host, double s, double* dxdt, std::size_t n) = nullptr;
    /// The host's own map from the start of the step. Null: `interpolate` is as good.
    void (*restep)(const void* host, double s, double* x, std::size_t n) = nullptr;
    double t_remainder = 0;  ///< [s] of the start
    bool is_cubic = false;   ///< the path is the cubic through the states and rates at both ends

    [[nodiscard]] Instant start() const noexcept { return {t, t_remainder}; }
};

}  // namespace ricochet::detail
