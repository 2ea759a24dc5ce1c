// Counts heap allocations: a program that links allocations.cpp has its operator
// new replaced by one that counts, on every thread by itself.
#pragma once

#include <cstdint>

namespace ricochet::testing_support {

/// Calls of operator new on this thread so far.
[[nodiscard]] std::uint64_t allocations() noexcept;

}  // namespace ricochet::testing_support
