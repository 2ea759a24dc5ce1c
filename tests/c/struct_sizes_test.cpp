// The sizes that structs of the interface may claim, with addresses of 64 and of 32 bits; needs no
// library, so that `scripts/check m32` runs it.
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <string>

#include "bindings/c/structs.hpp"

namespace {

int failures = 0;

/// Counts a failure where a struct of type T that claims `size` bytes is accepted, or not.
template <class T>
void expect(bool accepted, std::size_t size, const char* name)
{
    T given{};
    std::memcpy(&given, &size, sizeof size);
    bool was = true;
    try {
        was = ricochet::c::size_of_given<T>(&given, name) == size;
    } catch (const ricochet::c::Refusal& refusal) {
        was = refusal.status() != RC_WRONG_SIZE;
    }
    if (was == accepted) return;
    ++failures;
    std::printf("%s with %zu of %zu bytes: found %d, expected %d\n", name, size, sizeof(T), was,
                accepted);
}

/// The struct of this release, one of an earlier release, which was a word shorter, and sizes of
/// none.
template <class T>
void check(const char* name)
{
    constexpr std::size_t word = sizeof(std::size_t);
    expect<T>(true, sizeof(T), name);
    expect<T>(true, sizeof(T) - word, name);
    expect<T>(false, sizeof(T) - 1, name);
    expect<T>(false, sizeof(T) + word, name);
    expect<T>(false, word, name);
    expect<T>(false, 0, name);
}

}  // namespace

int main()
{
    check<rc_guard_info>("rc_guard_info");
    check<rc_inclusion>("rc_inclusion");
    check<rc_callbacks>("rc_callbacks");
    check<rc_options>("rc_options");
    check<rc_callback_error>("rc_callback_error");
    check<rc_statistics>("rc_statistics");
    check<rc_event>("rc_event");
    check<rc_phase>("rc_phase");
    check<rc_monitor_options>("rc_monitor_options");
    check<rc_host_step>("rc_host_step");
    check<rc_cut>("rc_cut");
    return failures == 0 ? 0 : 1;
}
