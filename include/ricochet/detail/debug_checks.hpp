// Internal: what it declares may change without notice.
//
// Checks that debug builds make of what they are told.
#pragma once

namespace ricochet::detail {

/// Whether the library was built without NDEBUG. Asked of the library, so that every file of a
/// program has the same answer, whatever its own flags are.
[[nodiscard]] bool is_debug_build() noexcept;

}  // namespace ricochet::detail
