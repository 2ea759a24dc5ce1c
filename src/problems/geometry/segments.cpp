#include "segments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "segment_kernel.hpp"

namespace ricochet::geometry {

namespace {

constexpr double largest = std::numeric_limits<double>::max();
constexpr double infinity = std::numeric_limits<double>::infinity();

bool finite(Point2 p)
{
    return std::isfinite(p.x) && std::isfinite(p.y);
}

std::array<double, 2> coordinates(Point2 p)
{
    return {p.x, p.y};
}

void check(const std::vector<Segment2>& segments)
{
    if (segments.empty()) throw std::invalid_argument("Segments: there is none");
    for (std::size_t i = 0; i < segments.size(); ++i) {
        const auto [a, b] = segments[i];
        if (!finite(a) || !finite(b)) {
            throw std::invalid_argument(
                fmt::format("Segments: the ends of segment {} must be finite, got ({}, {}) and "
                            "({}, {})",
                            i, a.x, a.y, b.x, b.y));
        }
        const double inverse = 1 / dot(b - a, b - a);
        if (!(inverse > 0) || !std::isfinite(inverse)) {
            throw std::invalid_argument(fmt::format(
                "Segments: the length of segment {} must be positive, with a finite square; it "
                "goes from ({}, {}) to ({}, {})",
                i, a.x, a.y, b.x, b.y));
        }
    }
}

BoxTree<2> tree_of(const std::vector<Segment2>& segments)
{
    check(segments);
    std::vector<Box<2>> boxes(segments.size());
    for (std::size_t i = 0; i < segments.size(); ++i) {
        boxes[i].add(coordinates(segments[i].a));
        boxes[i].add(coordinates(segments[i].b));
    }
    return BoxTree<2>(std::move(boxes));
}

detail::LeastBlock least_block_baseline(const detail::SegmentColumns& columns, double px, double py,
                                        double above) noexcept
{
    return detail::least_block(columns, px, py, above);
}

detail::LeastBlockFunction chosen_block_function()
{
#if defined(__x86_64__)
    __builtin_cpu_init();
    if (detail::least_block_v3 != nullptr && __builtin_cpu_supports("avx2")) {
        return detail::least_block_v3;
    }
#endif
    return least_block_baseline;
}

/// The point of a segment nearest to p, and the square of its distance.
struct Foot {
    Point2 point;
    double squared;
};

Foot foot(const Segment2& s, Point2 p) noexcept
{
    const Point2 d = s.b - s.a;
    const double t = std::clamp(dot(p - s.a, d) / dot(d, d), 0.0, 1.0);
    const Point2 point = s.a + t * d;
    return {point, dot(p - point, p - point)};
}

}  // namespace

Segments::Segments(const std::vector<Segment2>& segments)
    : segments_(segments), tree_(tree_of(segments))
{
    for (const Segment2& s : segments_) given_.append(s);
    for (const std::uint32_t i : tree_.order()) sorted_.append(segments_[i]);
    while (sorted_.ax.size() % 4 != 0) sorted_.append(segments_.back());
    while (given_.ax.size() % detail::segments_per_block != 0) given_.append(segments_.back());
}

void Segments::Columns::append(const Segment2& s)
{
    const Point2 d = s.b - s.a;
    ax.push_back(s.a.x);
    ay.push_back(s.a.y);
    dx.push_back(d.x);
    dy.push_back(d.y);
    inverse.push_back(1 / dot(d, d));
}

double Segments::Columns::squared_distance(std::size_t i, Point2 p) const noexcept
{
    return detail::squared_distance(ax[i], ay[i], dx[i], dy[i], inverse[i], p.x, p.y);
}

std::array<double, 4> Segments::Columns::four_squared_distances(std::size_t first,
                                                                Point2 p) const noexcept
{
    static_assert(4 % detail::lanes == 0);
    std::array<double, 4> out;
    for (std::size_t i = 0; i < 4; i += detail::lanes) {
        const auto load = [&](const std::vector<double>& column) {
            return *reinterpret_cast<const detail::Lanes*>(column.data() + first + i);
        };
        const auto squares = detail::squared_distance<detail::Lanes>(
            load(ax), load(ay), load(dx), load(dy), load(inverse), p.x, p.y);
        for (std::size_t k = 0; k < detail::lanes; ++k) out[i + k] = squares[k];
    }
    return out;
}

NearestOnSegment Segments::at(std::uint32_t segment, double squared, Point2 p) const noexcept
{
    if (!(squared < largest)) {
        return {0, std::isnan(p.x) || std::isnan(p.y) ? p.x + p.y : infinity, 0, segments_[0].a};
    }
    const Point2 a{given_.ax[segment], given_.ay[segment]};
    const Point2 d{given_.dx[segment], given_.dy[segment]};
    const double t = std::clamp(dot(p - a, d) * given_.inverse[segment], 0.0, 1.0);
    return {segment, std::sqrt(squared), t, t == 1 ? segments_[segment].b : a + t * d};
}

NearestOnSegment Segments::nearest(Point2 p, std::uint32_t hint) const noexcept
{
    std::uint32_t which = hint < segments_.size() ? hint : 0;
    double best = given_.squared_distance(which, p);
    if (!(best < largest)) best = largest;  // and NaN, which opens nothing
    if (std::isnan(p.x) || std::isnan(p.y)) return at(0, largest, p);
    const std::array<double, 2> point = coordinates(p);
    tree_.search(
        best, [&](const FourBoxes<2>& boxes) { return squared_distances(boxes, point, point); },
        [&](std::size_t first, std::size_t last) {
            const std::array<double, 4> squares = sorted_.four_squared_distances(first, p);
            for (std::size_t i = first; i < last; ++i) {
                const double square = squares[i - first];
                if (square > best) continue;
                const std::uint32_t segment = tree_.order()[i];
                if (square < best || segment < which) which = segment;
                best = square;
            }
        });
    return at(which, best, p);
}

NearestOnSegment Segments::nearest_brute(Point2 p) const noexcept
{
    static const detail::LeastBlockFunction look = chosen_block_function();
    const detail::LeastBlock found =
        look({given_.ax.data(), given_.ay.data(), given_.dx.data(), given_.dy.data(),
              given_.inverse.data(), given_.ax.size()},
             p.x, p.y, largest);
    std::size_t which = found.block * detail::segments_per_block;
    if (found.squared < largest) {
        while (given_.squared_distance(which, p) != found.squared) ++which;
    }
    return at(static_cast<std::uint32_t>(std::min(which, size() - 1)), found.squared, p);
}

NearestPair nearest_points(const Segment2& s, const Segment2& other) noexcept
{
    const Point2 d = s.b - s.a;
    const Point2 e = other.b - other.a;
    const double from = cross(d, other.a - s.a);
    const double to = cross(d, other.b - s.a);
    const double start = cross(e, s.a - other.a);
    const double end = cross(e, s.b - other.a);
    if (((from < 0 && to > 0) || (from > 0 && to < 0)) &&
        ((start < 0 && end > 0) || (start > 0 && end < 0))) {
        const Point2 common = s.a + (start / (start - end)) * d;
        return {0, 0, common, common};
    }
    // Segments that do not cross are nearest at an end of one of them.
    NearestPair best;
    double least = infinity;
    const auto offer = [&](Point2 on_s, Point2 on_other, double squared) {
        if (squared < least) {
            least = squared;
            best = {0, 0, on_s, on_other};
        }
    };
    for (const Point2 p : {s.a, s.b}) {
        const Foot f = foot(other, p);
        offer(p, f.point, f.squared);
    }
    for (const Point2 p : {other.a, other.b}) {
        const Foot f = foot(s, p);
        offer(f.point, p, f.squared);
    }
    best.distance = std::sqrt(least);
    return best;
}

namespace {

/// The query segment, with precomputed quantities for the comparisons.
struct Asked {
    explicit Asked(const Segment2& s) noexcept
        : a(s.a), b(s.b), d(s.b - s.a), inverse(dot(d, d) > 0 ? 1 / dot(d, d) : 0)
    {
        normal = std::sqrt(inverse) * Point2{-d.y, d.x};
        reach = {std::fabs(normal.x), std::fabs(normal.y)};
    }
    Point2 a, b, d;
    double inverse;
    Point2 normal;  ///< of unit length, or 0
    Point2 reach;   ///< magnitudes of its components
};

/// Squares of distances between a segment and several; 0 where they cross.
template <class T>
[[gnu::always_inline]] inline T squared_distances(const Asked& s, T ax, T ay, T dx, T dy,
                                                  T inverse) noexcept
{
    const T zero{};
    const T one = zero + 1.0;
    const auto less = [](const T& u, const T& v) { return u < v ? u : v; };
    const T bx = ax + dx;
    const T by = ay + dy;
    // Segments that do not cross are nearest at an end of one of them.
    T least = less(detail::squared_distance<T>(ax, ay, dx, dy, inverse, s.a.x, s.a.y),
                   detail::squared_distance<T>(ax, ay, dx, dy, inverse, s.b.x, s.b.y));
    const auto from_end = [&](const T& x, const T& y) {
        const T wx = x - s.a.x;
        const T wy = y - s.a.y;
        T t = (wx * s.d.x + wy * s.d.y) * s.inverse;
        t = t > zero ? t : zero;
        t = t < one ? t : one;
        const T ex = wx - t * s.d.x;
        const T ey = wy - t * s.d.y;
        return ex * ex + ey * ey;
    };
    least = less(least, from_end(ax, ay));
    least = less(least, from_end(bx, by));
    const T from = s.d.x * (ay - s.a.y) - s.d.y * (ax - s.a.x);
    const T to = s.d.x * (by - s.a.y) - s.d.y * (bx - s.a.x);
    const T start = dx * (s.a.y - ay) - dy * (s.a.x - ax);
    const T end = dx * (s.b.y - ay) - dy * (s.b.x - ax);
    least = from * to < zero ? (start * end < zero ? zero : least) : least;
    return least;
}

/// Lower bounds from the boxes along the axes, and along the normal of the segment: a long
/// oblique segment has a large box itself.
[[gnu::always_inline]] inline std::array<double, 4> squared_bounds(
    const Asked& s, const FourBoxes<2>& boxes, const std::array<double, 2>& lower,
    const std::array<double, 2>& upper) noexcept
{
    using detail::Lanes;
    std::array<double, 4> out = squared_distances(boxes, lower, upper);
    const Lanes zero{};
    for (std::size_t i = 0; i < 4; i += detail::lanes) {
        const auto load = [&](const double* column) {
            return *reinterpret_cast<const Lanes*>(column + i);
        };
        const Lanes x0 = load(boxes.lower[0]) - s.a.x;
        const Lanes y0 = load(boxes.lower[1]) - s.a.y;
        const Lanes x1 = load(boxes.upper[0]) - s.a.x;
        const Lanes y1 = load(boxes.upper[1]) - s.a.y;
        // Twice the offset of the centre along the normal, less twice the reach of the box.
        const Lanes offset = s.normal.x * (x0 + x1) + s.normal.y * (y0 + y1);
        const Lanes reach = s.reach.x * (x1 - x0) + s.reach.y * (y1 - y0);
        const Lanes twice = (offset > zero ? offset : -offset) * (1 - 1e-14) - reach * (1 + 1e-14);
        const Lanes gap = twice > zero ? twice : zero;  // missing boxes: NaN becomes 0
        const Lanes square = 0.25 * gap * gap;
        for (std::size_t k = 0; k < detail::lanes; ++k) {
            out[i + k] = square[k] > out[i + k] ? square[k] : out[i + k];
        }
    }
    return out;
}

}  // namespace

std::array<double, 4> Segments::Columns::four_squared_distances(std::size_t first,
                                                                const Segment2& s) const noexcept
{
    const Asked asked(s);
    std::array<double, 4> out;
    for (std::size_t i = 0; i < 4; i += detail::lanes) {
        const auto load = [&](const std::vector<double>& column) {
            return *reinterpret_cast<const detail::Lanes*>(column.data() + first + i);
        };
        const auto squares = squared_distances<detail::Lanes>(asked, load(ax), load(ay), load(dx),
                                                              load(dy), load(inverse));
        for (std::size_t k = 0; k < detail::lanes; ++k) out[i + k] = squares[k];
    }
    return out;
}

NearestPair Segments::pair_at(std::uint32_t segment, double squared,
                              const Segment2& s) const noexcept
{
    NearestPair out = nearest_points(s, segments_[segment]);
    out.segment = segment;
    out.distance = std::sqrt(squared);
    return out;
}

NearestPair Segments::nearest(const Segment2& s, double limit, std::uint32_t hint) const noexcept
{
    NearestPair out;
    out.distance = limit;
    if (!finite(s.a) || !finite(s.b)) {
        out.distance = std::numeric_limits<double>::quiet_NaN();
        return out;
    }
    const double allowed = std::min(limit * limit, largest);
    double best = allowed;
    std::uint32_t which = 0;
    const auto offer = [&](std::uint32_t segment, double square) {
        if (square > best) return;
        if (square < best || segment < which) which = segment;
        best = square;
    };
    {
        const std::uint32_t at = hint < segments_.size() ? hint : 0;
        const std::size_t first = at;
        offer(at, given_.four_squared_distances(first / 4 * 4, s)[first % 4]);
    }
    const Asked asked(s);
    const std::array<double, 2> lower{std::min(s.a.x, s.b.x), std::min(s.a.y, s.b.y)};
    const std::array<double, 2> upper{std::max(s.a.x, s.b.x), std::max(s.a.y, s.b.y)};
    tree_.search(
        best, [&](const FourBoxes<2>& boxes) { return squared_bounds(asked, boxes, lower, upper); },
        [&](std::size_t first, std::size_t last) {
            const std::array<double, 4> squares = sorted_.four_squared_distances(first, s);
            for (std::size_t i = first; i < last; ++i) offer(tree_.order()[i], squares[i - first]);
        });
    return best < allowed ? pair_at(which, best, s) : out;
}

NearestPair Segments::nearest_brute(const Segment2& s, double limit) const noexcept
{
    NearestPair out;
    out.distance = limit;
    if (!finite(s.a) || !finite(s.b)) {
        out.distance = std::numeric_limits<double>::quiet_NaN();
        return out;
    }
    const double allowed = std::min(limit * limit, largest);
    double best = allowed;
    std::size_t which = 0;
    for (std::size_t i = 0; i < segments_.size(); i += 4) {
        const std::array<double, 4> squares = given_.four_squared_distances(i, s);
        for (std::size_t k = 0; k < 4; ++k) {
            if (squares[k] < best) {
                best = squares[k];
                which = i + k;
            }
        }
    }
    return best < allowed ? pair_at(static_cast<std::uint32_t>(which), best, s) : out;
}

}  // namespace ricochet::geometry
