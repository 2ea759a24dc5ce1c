// Structs whose first member is their size, so that versions of the header may differ.
#pragma once

#include <cstddef>
#include <cstring>
#include <string>
#include <type_traits>

#include "bindings/c/error.hpp"

namespace ricochet::c {

[[noreturn]] inline void throw_null(const char* name)
{
    throw Refusal(RC_INVALID, std::string(name) + ": found null; expected a pointer");
}

/// The size that the caller's struct claims to have.
/// @throws Refusal if it is larger than the library's, or cannot belong to any release: structs
/// consist of whole words, of eight bytes or, on machines with addresses of 32 bits, of four.
template <class T>
[[nodiscard]] std::size_t size_of_given(const void* given, const char* name)
{
    static_assert(std::is_trivially_copyable_v<T> && offsetof(T, size) == 0);
    static_assert(sizeof(T) % sizeof(std::size_t) == 0);
    if (!given) throw_null(name);
    std::size_t size = 0;
    std::memcpy(&size, given, sizeof size);
    if (size > sizeof(T)) {
        throw Refusal(RC_WRONG_SIZE,
                      std::string(name) + ": found a size of " + std::to_string(size) +
                          " bytes; this library, version " RICOCHET_VERSION ", knows " +
                          std::to_string(sizeof(T)) +
                          " of them: it is older than the program, or `size` has not been set");
    }
    if (size < 2 * sizeof(std::size_t) || size % sizeof(std::size_t) != 0) {
        throw Refusal(RC_WRONG_SIZE, std::string(name) + ": found a size of " +
                                         std::to_string(size) + " bytes; expected sizeof(" + name +
                                         ") in its field `size`");
    }
    return size;
}

/// A copy of the caller's struct; fields that it does not have are taken from `full`.
template <class T>
[[nodiscard]] T read_struct(const void* given, const char* name, T full = {})
{
    const std::size_t size = size_of_given<T>(given, name);
    std::memcpy(&full, given, size);
    full.size = sizeof(T);
    return full;
}

/// Writes `full` to the caller's struct, up to its size.
template <class T>
void write_struct(T* given, T full, const char* name)
{
    const std::size_t size = size_of_given<T>(given, name);
    full.size = size;
    std::memcpy(given, &full, size);
}

}  // namespace ricochet::c
