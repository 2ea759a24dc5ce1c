// Handles: the validation of pointers that the caller passes.
#pragma once

#include <atomic>
#include <cstdint>

#include "bindings/c/error.hpp"

namespace ricochet::c {

enum class Kind : std::uint64_t {
    freed = 0,
    system = 0x6d65747379736372,      // "rcsystem" in memory
    simulation = 0x616c756d69736372,  // "rcsimula"
    monitor = 0x6f74696e6f6d6372,     // "rcmonito"
};

/// First member of every handle.
struct Handle {
    explicit Handle(Kind kind_) noexcept : kind(kind_) {}

    std::atomic<Kind> kind;
    std::atomic<bool> busy{false};
};

/// Whether the memory of freed handles is kept, so that they are recognised.
[[nodiscard]] bool keeps_freed_handles() noexcept;

/// Marks the handle as freed; `release` gives its memory back, unless freed handles are kept.
void retire(Handle* handle, void (*release)(Handle*)) noexcept;

/// @throws Refusal
void check_handle(const Handle* handle, Kind kind);

/// Exclusive use of a handle during one call.
class InUse {
public:
    /// @throws Refusal if it is no such handle, or in use.
    InUse(Handle* handle, Kind kind);
    InUse(const InUse&) = delete;
    InUse& operator=(const InUse&) = delete;
    ~InUse() { handle_->busy.store(false, std::memory_order_release); }

private:
    Handle* handle_;
};

/// Calls `body(handle)` while no other call may.
template <class H, class Body>
[[nodiscard]] rc_status with(H* handle, const Body& body) noexcept
{
    return guarded([&] {
        const InUse in_use(handle, H::kind_of);
        body(*handle);
    });
}

/// The same where the result is a value, and `failed` means failure.
template <class T, class H, class Body>
[[nodiscard]] T value_of(H* handle, T failed, const Body& body) noexcept
{
    return guarded_value(failed, [&] {
        const InUse in_use(handle, H::kind_of);
        return static_cast<T>(body(*handle));
    });
}

}  // namespace ricochet::c
