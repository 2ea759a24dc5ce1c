// Counts heap allocations: in a program that links allocations.cpp operator
// new is replaced by one that counts, separately on every thread.
#pragma once

#include <cstdint>

namespace ricochet::testing_support {

/// Calls of operator new on this thread so far.
[[nodiscard]] std::uint64_t allocations() noexcept;

}  // namespace ricochet::testing_support
