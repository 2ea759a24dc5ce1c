// Internal: the declarations of this header may change without notice.
//
// Base of the gates: delegates to the exact detector that a gate wraps.
#pragma once

#include "ricochet/finding.hpp"

namespace ricochet::detail {

/// Forwards every question to `Exact`.
template <class Exact>
class WrappedDetector {
public:
    static constexpr bool uses_rates = Exact::uses_rates;
    static constexpr Screening screening = screening_of<Exact>;
    static constexpr bool checks_inside = ChecksInside<Exact>;
    static constexpr Evidence evidence = Exact::evidence;  ///< about a step it has examined

    explicit WrappedDetector(const Exact& exact) : exact_(exact) {}

    [[nodiscard]] static constexpr bool suspects(double sign, const GuardSample& start,
                                                 const GuardSample& end) noexcept
    {
        return Exact::suspects(sign, start, end);
    }

    [[nodiscard]] static bool leaves_plainly(double sign, const GuardSample& start,
                                             const GuardSample& end, double touch) noexcept
    {
        return Exact::leaves_plainly(sign, start, end, touch);
    }

    /// `path` is a `GuardPath`, or the path that a user-defined detector takes.
    template <class Path>
    [[nodiscard]] Finding examine(Path& path, Watch& watch) const
    {
        return exact_.examine(path, watch);
    }

private:
    Exact exact_;
};

}  // namespace ricochet::detail
