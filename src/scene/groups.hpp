// Determines which bodies can meet before the end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "scene/world.hpp"

namespace ricochet::detail {

/// A box that contains everything that a body can touch until the end of the run.
struct Reach {
    Vector2 low{}, high{};
};

/// Bodies whose boxes overlap, directly or through others, and members of one island, ascending.
/// Bodies of different groups never meet: each group runs by itself.
class Groups {
public:
    [[nodiscard]] std::size_t size() const noexcept { return ends_.size(); }
    [[nodiscard]] std::span<const std::uint32_t> operator[](std::size_t k) const noexcept
    {
        const std::size_t begin = k == 0 ? 0 : ends_[k - 1];
        return {order_.data() + begin, ends_[k] - begin};
    }

private:
    friend Groups groups_of(const World& world);
    std::vector<std::uint32_t> order_;
    std::vector<std::size_t> ends_;  ///< of groups, one after another
};
[[nodiscard]] Groups groups_of(const World& world);

}  // namespace ricochet::detail
