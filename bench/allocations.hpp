// Counts heap allocations: a program that links allocations.cpp has its operator
// new replaced by one that counts.
#pragma once

#include <cstdint>

namespace ricochet::bench {

/// Calls of operator new in this program so far, by all threads.
[[nodiscard]] std::uint64_t allocations() noexcept;

}  // namespace ricochet::bench
