// Internal: the declarations of this header may change without notice.
//
// The number of guards of a system that is made from another one.
#pragma once

#include <cstddef>

#include "ricochet/system.hpp"

namespace ricochet::detail {

/// `guard_count` as a system declares it: not at all, a constant, or a number.
template <std::size_t fixed>
struct GuardCount {
    explicit GuardCount(std::size_t) noexcept {}
    static constexpr std::size_t guard_count = fixed;
};
template <>
struct GuardCount<0> {
    explicit GuardCount(std::size_t) noexcept {}
};
template <>
struct GuardCount<counted_at_run_time> {
    explicit GuardCount(std::size_t count) noexcept : guard_count(count) {}
    std::size_t guard_count;
};

}  // namespace ricochet::detail
