// The least of many squared distances between segments and a point, for one instruction set. This
// file is included by one source file per set, compiled with its flags and without contraction, so
// that the bits are the same.
#pragma once

#include <cstddef>

namespace ricochet::geometry::detail {

/// Segments in one check; columns are a multiple of it long.
inline constexpr std::size_t segments_per_block = 64;

struct SegmentColumns {
    const double* ax;
    const double* ay;
    const double* dx;
    const double* dy;
    const double* inverse;
    std::size_t count;
};

/// The first block that holds the least distance, and its square; `squared` is as given if none is
/// less.
struct LeastBlock {
    double squared;
    std::size_t block;
};

#if defined(__AVX__)
inline constexpr std::size_t lanes = 4;
#else
inline constexpr std::size_t lanes = 2;
#endif
typedef double Lanes __attribute__((vector_size(lanes * sizeof(double)), may_alias, aligned(8)));

/// |a + t d - p|² with t = (p - a) d / d² within [0, 1]; of numbers or of several together.
template <class T>
[[gnu::always_inline]] inline T squared_distance(T ax, T ay, T dx, T dy, T inverse, double px,
                                                 double py) noexcept
{
    const T zero{};
    const T one = zero + 1.0;
    const T wx = px - ax;
    const T wy = py - ay;
    T t = (wx * dx + wy * dy) * inverse;
    t = t > zero ? t : zero;
    t = t < one ? t : one;
    const T ex = wx - t * dx;
    const T ey = wy - t * dy;
    return ex * ex + ey * ey;
}

using LeastBlockFunction = LeastBlock (*)(const SegmentColumns& columns, double px, double py,
                                          double above) noexcept;

[[gnu::always_inline]] inline LeastBlock least_block(const SegmentColumns& columns, double px,
                                                     double py, double above) noexcept
{
    // Not inlined, this would be one function for the files of all instruction sets.
    const auto load = [](const double* from) __attribute__((always_inline))
    {
        return *reinterpret_cast<const Lanes*>(from);
    };
    LeastBlock best{above, 0};
    for (std::size_t i = 0; i < columns.count; i += segments_per_block) {
        Lanes least = Lanes{} + best.squared;
        for (std::size_t j = i; j < i + segments_per_block; j += lanes) {
            const auto square = squared_distance<Lanes>(load(columns.ax + j), load(columns.ay + j),
                                                        load(columns.dx + j), load(columns.dy + j),
                                                        load(columns.inverse + j), px, py);
            least = square < least ? square : least;
        }
        for (std::size_t k = 0; k < lanes; ++k) {
            if (least[k] < best.squared) best = {least[k], i / segments_per_block};
        }
    }
    return best;
}

/// Null where the file is compiled for another processor.
extern const LeastBlockFunction least_block_v3;

}  // namespace ricochet::geometry::detail
