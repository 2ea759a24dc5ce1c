#include "bindings/c/handles.hpp"

#include <mutex>
#include <string>
#include <vector>

#ifndef RICOCHET_KEEP_FREED_HANDLES
#ifdef NDEBUG
#define RICOCHET_KEEP_FREED_HANDLES 0
#else
#define RICOCHET_KEEP_FREED_HANDLES 1
#endif
#endif

namespace ricochet::c {

namespace {

[[nodiscard]] std::string name_of(Kind kind)
{
    switch (kind) {
        case Kind::system: return "rc_system";
        case Kind::simulation: return "rc_simulation";
        case Kind::monitor: return "rc_monitor";
        case Kind::freed: break;
    }
    return "handle";
}

#if RICOCHET_KEEP_FREED_HANDLES
/// Freed handles stay reachable here, so that no leak is reported.
struct Freed {
    std::mutex mutex;
    std::vector<Handle*> handles;
};
Freed& freed()
{
    static Freed* const all = new Freed;
    return *all;
}
#endif

}  // namespace

bool keeps_freed_handles() noexcept
{
    return RICOCHET_KEEP_FREED_HANDLES;
}

void retire(Handle* handle, [[maybe_unused]] void (*release)(Handle*)) noexcept
{
    handle->kind.store(Kind::freed);
#if RICOCHET_KEEP_FREED_HANDLES
    try {
        const std::scoped_lock lock(freed().mutex);
        freed().handles.push_back(handle);
    } catch (...) {  // the handle is kept although it is not in the list
    }
#else
    release(handle);
#endif
}

void check_handle(const Handle* handle, Kind kind)
{
    if (!handle) throw Refusal(RC_BAD_HANDLE, name_of(kind) + ": found null; expected a handle");
    const Kind found = handle->kind.load(std::memory_order_relaxed);
    if (found == kind) return;
    throw Refusal(RC_BAD_HANDLE,
                  name_of(kind) + (found == Kind::freed ? ": the handle has been freed"
                                                        : ": this is no such handle"));
}

InUse::InUse(Handle* handle, Kind kind) : handle_(handle)
{
    check_handle(handle, kind);
    if (handle->busy.exchange(true, std::memory_order_acquire)) {
        throw Refusal(RC_BUSY, name_of(kind) +
                                   ": found it in use by another call, of another thread or around "
                                   "a callback; expected one call at a time");
    }
}

}  // namespace ricochet::c
