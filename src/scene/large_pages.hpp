// Memory for many bodies and events in large pages, where the system provides them. A million
// bodies touch 100 000 small pages, each of which costs the system more than the arithmetic.
#pragma once

#include <cstdint>
#include <iterator>
#include <vector>

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace ricochet::detail {

/// Reserves memory for `count` elements at least, in large pages if it is large. Results are the
/// same.
template <class T>
void reserve_large(std::vector<T>& list, std::size_t count)
{
    if (count <= list.capacity()) return;
    std::vector<T> larger;
    larger.reserve(count);
#if defined(__linux__) && defined(MADV_HUGEPAGE)
    constexpr std::uintptr_t page = 1U << 21;
    const auto begin = (reinterpret_cast<std::uintptr_t>(larger.data()) + page - 1) & ~(page - 1);
    const auto end =
        reinterpret_cast<std::uintptr_t>(larger.data() + larger.capacity()) & ~(page - 1);
    if (begin < end) {
        // Where this is refused the memory is usable, but slower.
        // NOLINTNEXTLINE(performance-no-int-to-ptr): begin is rounded up to a page
        static_cast<void>(madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE));
    }
#endif
    larger.assign(std::make_move_iterator(list.begin()), std::make_move_iterator(list.end()));
    list.swap(larger);
}

/// Asks for a record before it is used.
template <class T>
void fetch_record(const T& record) noexcept
{
    const auto* const first = reinterpret_cast<const char*>(&record);
    for (std::size_t at = 0; at < sizeof(T); at += 64) __builtin_prefetch(first + at);
}

}  // namespace ricochet::detail
