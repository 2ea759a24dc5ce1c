// Which bodies can meet at all before the end.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/world.hpp"

namespace ricochet::detail {

/// All that a body can touch until the end of the run, in any event, lies in this box.
struct Reach {
    Vector2 low{}, high{};
};

/// Bodies whose boxes overlap, directly or by others, and members of one island, ascending. Bodies
/// of different groups never meet: each group runs by itself.
[[nodiscard]] std::vector<std::vector<std::uint32_t>> groups_of(const World& world);

}  // namespace ricochet::detail
