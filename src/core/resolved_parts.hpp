// Division of a step into parts on each of which the cubic through its ends describes the guard.
#pragma once

#include <algorithm>
#include <boost/container/small_vector.hpp>
#include <cmath>
#include <cstddef>
#include <limits>

#include "ricochet/step_probe.hpp"

namespace ricochet::detail {

/// The inner nodes of one guard's parts in the current step. The step is not repeated: its
/// polynomial is evaluated, at the cost of guard calls alone.
class ResolvedParts {
public:
    /// Forgets the nodes, for another step.
    void clear() noexcept { guard_ = none; }

    /// Divides the interval in which guard i is watched, unless it is divided already.
    /// `everywhere`: starts with all fractions of `CubicCheck::places`.
    void resolve(GuardPath& path, std::size_t i, const Watch& watch, double declared_touch,
                 bool everywhere);

    /// The first node beyond offset s and before `end`, else null.
    [[nodiscard]] const GuardSample* next(double s, double end) const noexcept
    {
        for (const GuardSample& node : nodes_) {
            if (node.s > s) return node.s < end ? &node : nullptr;
        }
        return nullptr;
    }

    [[nodiscard]] bool divided() const noexcept { return divided_; }
    /// Whether the guard is a cubic in the whole interval up to 1/64 of its size.
    [[nodiscard]] bool nearly_cubic() const noexcept { return nearly_cubic_; }
    [[nodiscard]] const Watch& whole() const noexcept { return whole_; }
    [[nodiscard]] bool unresolved() const noexcept { return unresolved_; }

private:
    static constexpr std::size_t none = static_cast<std::size_t>(-1);
    static constexpr double smallest_part = 0x1p-12;  ///< of the step
    /// Fraction at which an interval is divided, which no symmetry of the guard singles out.
    static constexpr double cut = 0.4142135;
    static constexpr int shallow = 3;  ///< divisions before rounding is considered

    void divide(GuardPath& path, const GuardSample& start, const GuardSample& end, double smallest,
                int depth);

    std::size_t guard_ = none;
    Watch whole_;                                            ///< the interval that is divided
    boost::container::small_vector<GuardSample, 32> nodes_;  ///< the first without an allocation
    double declared_touch_ = 0;
    double noise_ = -1;  ///< of the guard by rounding of the state; below 0: not yet computed
    bool divided_ = false;
    bool nearly_cubic_ = false;
    bool unresolved_ = false;
};

}  // namespace ricochet::detail
