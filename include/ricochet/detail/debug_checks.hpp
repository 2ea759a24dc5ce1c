// Internal: the declarations of this header may change without notice.
//
// Checks of declarations in debug builds.
#pragma once

namespace ricochet::detail {

/// Whether the library was built without NDEBUG. It is a function of the library, so that every
/// file of a program gets the same answer, whatever its own flags are.
[[nodiscard]] bool is_debug_build() noexcept;

}  // namespace ricochet::detail
