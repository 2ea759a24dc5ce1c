// Memory with the alignment of vector registers.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace ricochet::learn {

inline constexpr std::size_t cache_line = 64;  // [bytes]

template <class T>
struct AlignedAllocator {
    using value_type = T;

    AlignedAllocator() = default;
    template <class U>
    explicit AlignedAllocator(const AlignedAllocator<U>&) noexcept
    {
    }

    [[nodiscard]] T* allocate(std::size_t n)
    {
        return static_cast<T*>(::operator new (n * sizeof(T), std::align_val_t{cache_line}));
    }
    void deallocate(T* memory, std::size_t) noexcept
    {
        ::operator delete (memory, std::align_val_t{cache_line});
    }

    friend bool operator==(const AlignedAllocator&, const AlignedAllocator&) { return true; }
};

/// Vector whose first element begins a cache line.
template <class T>
using Buffer = std::vector<T, AlignedAllocator<T>>;

/// `columns` rounded up to whole cache lines.
template <class T>
[[nodiscard]] constexpr std::size_t padded(std::size_t columns) noexcept
{
    constexpr std::size_t per_line = cache_line / sizeof(T);
    return (columns + per_line - 1) / per_line * per_line;
}

}  // namespace ricochet::learn
