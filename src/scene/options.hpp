#pragma once

#include <cstdint>
#include <limits>
#include <stdexcept>

#include "ricochet/scene/simulate.hpp"

namespace ricochet::detail {

/// @throws std::invalid_argument naming the option, what was given and what was expected.
void validate(const SceneOptions& options);

/// Parameters that affect time but no result. They follow rules, unless a test sets them.
struct SceneTuning {
    /// Bodies of a larger radius [m] are in the second grid.
    double big_above = std::numeric_limits<double>::quiet_NaN();
    /// [m] Side of the cells, unless bodies of ordinary size need larger ones.
    double cell_side = std::numeric_limits<double>::quiet_NaN();
    /// The grid is laid again after this number of acts (events, crossings), whatever they cost;
    /// 0: where it saves time.
    std::uint64_t lay_after = 0;
    /// The calendar of a group of at least this many bodies is a ring of lists. In a gas of discs
    /// that cover 0.3 of the area a ring takes 3 % more time at 100 bodies and the same at 300; it
    /// takes 5 % less at 1000 and 3000, 14 % less at 10 000 and 2 % less at 100 000.
    std::size_t ring_from = 1000;
};
[[nodiscard]] SceneRun simulate(const Scene& scene, const SceneOptions& options,
                                const SceneTuning& tuning);

/// The exception of `Scene::check` for a body at a place where it must not be.
struct Misplaced : std::invalid_argument {
    Misplaced(const std::string& what, std::uint32_t which)
        : std::invalid_argument(what), body(which)
    {
    }
    std::uint32_t body;
};

}  // namespace ricochet::detail
