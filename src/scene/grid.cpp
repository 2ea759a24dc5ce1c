#include "scene/grid.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>

namespace ricochet::detail {

namespace {

/// Up to this number of bodies there are no cells: testing all pairs costs less than the crossings
/// from cell to cell.
constexpr double few_bodies = 16;
constexpr std::size_t few_faces = 64;
constexpr double boundless = 0x1p200;

/// [cells] A ring is laid again when its body has moved this far along an axis. A big body of
/// radius R is struck 2 R n v times a second by bodies of density n and speed v, and each time
/// tests those on its ring, 2 pi R n per metre of width, which are more the farther it may move;
/// its ring, some 2 pi R / side cells a layer, is laid v / play times a second. With cells of 0.4
/// bodies the sum is least at play^2 = 4 side^3 / R: two thirds of a cell for R of ten cells, a
/// third for fifty.
constexpr double play = 0.35;

/// Cost of visiting a cell, and of laying a ring on it and lifting it, relative to a test for a
/// first contact: they read one and several numbers, the test a record of two cache lines.
constexpr double visiting = 0.2;
constexpr double laying = 1;

Box box_of(const World& world, std::span<const std::uint32_t> members)
{
    Vector2 low{never, never};
    Vector2 high{-never, -never};
    Box box{.count = static_cast<double>(members.size())};
    for (const std::uint32_t i : members) {
        const Body& body = world.bodies[i];
        for (std::size_t c = 0; c < 2; ++c) {
            low[c] = std::min(low[c], body.p[c]);
            high[c] = std::max(high[c], body.p[c]);
        }
        box.largest = std::max(box.largest, body.radius);
    }
    box.extent = high - low + Vector2{2 * box.largest, 2 * box.largest};
    return box;
}

[[nodiscard]] std::uint32_t buckets(double cells, double count)
{
    return std::bit_ceil(
        static_cast<std::uint32_t>(std::clamp(cells, 4.0, 4 * std::sqrt(count) + 1e3)));
}

[[nodiscard]] std::uint32_t power_above(double count)
{
    return std::bit_ceil(static_cast<std::uint32_t>(std::ceil(count)));
}

/// The least and the greatest height of the line from a to b between `left` and `right`.
std::pair<double, double> heights(const Vector2& a, const Vector2& b, double left, double right)
{
    if (a[0] == b[0]) return std::minmax({a[1], b[1]});
    const auto height = [&](double x) {
        return a[1] + std::clamp((x - a[0]) / (b[0] - a[0]), 0.0, 1.0) * (b[1] - a[1]);
    };
    return std::minmax({height(left), height(right)});
}

/// A face lies in every bucket from which a body can touch it. One that is as long as very many
/// cells, or as far away, lies in all buckets.
void place_faces(const World& world, double reach, Cells& cells)
{
    constexpr double most = 1 << 20;               // cells along a face
    constexpr double far = std::int64_t{1} << 52;  // whose number is still a whole one
    const double side = cells.side();
    const double radius = reach + 0.7072 * side;
    const auto row_of = [&](double y) { return cells.cell_of({0, y}).y; };
    for (std::uint32_t f = world.wall_count; f < world.fixed_count; ++f) {
        const Face& face = world.faces[f];
        const Vector2 end = face.at - face.length * turned(face.normal);
        const auto [left, right] = std::minmax({face.at[0], end[0]});
        const auto [low, high] = std::minmax({face.at[1], end[1]});
        const double farthest = std::max({-left, right, -low, high});
        if (!(right - left + high - low < most * side && farthest + reach < far * side)) {
            for (std::uint32_t b = 0; b < cells.buckets(); ++b) cells.add_face(b, f);
            continue;
        }
        const auto from = cells.cell_of({left - reach, low - reach});
        const auto to = cells.cell_of({right + reach, high + reach});
        for (std::int64_t x = from.x; x <= to.x; ++x) {
            const double across = (static_cast<double>(x) + 0.5) * side;
            const auto [lowest, highest] = heights(face.at, end, across - radius, across + radius);
            const std::int64_t first = std::max(from.y, row_of(lowest - radius) - 1);
            const std::int64_t last = std::min(to.y, row_of(highest + radius) + 1);
            for (std::int64_t y = first; y <= last; ++y) {
                const Vector2 middle{across, (static_cast<double>(y) + 0.5) * side};
                const double apart = norm(middle - nearest_on(face.at, end, middle));
                if (apart <= radius) cells.add_face(cells.bucket_of(x, y), f);
            }
        }
    }
}

/// Bodies by size, the largest first, in classes of half an octave.
struct SizeClass {
    double count = 0;
    double radii = 0, squares = 0;  ///< sums
    double largest = 0;
};
using SizeClasses = std::array<SizeClass, 64>;

/// Tests for first contacts per second, divided by 2 n v, if the first `big` classes are big. A
/// body of radius r is struck in proportion to r plus the mean radius.
double work(const SizeClasses& classes, std::size_t big, const Box& box, double slack)
{
    SizeClass small;
    SizeClass large;
    for (std::size_t k = 0; k < classes.size(); ++k) {
        SizeClass& sum = k < big ? large : small;
        sum.count += classes[k].count;
        sum.radii += classes[k].radii;
        sum.squares += classes[k].squares;
        sum.largest = std::max(sum.largest, classes[k].largest);
    }
    if (small.count == 0) return never;
    constexpr double pi = 3.141592653589793;
    const double area = box.extent[0] * box.extent[1];
    const double room = std::max(area - pi * large.squares, 0.1 * area);
    const double mean = (small.radii + large.radii) / box.count;
    const double density = small.count / room;
    const double side = side_of(room, small.count, small.largest, slack);
    const double asked = std::min(small.count, 9 * density * side * side) + 9 * visiting;
    // Twice the play, a radius, and a cell and a half or more on both sides of the edge.
    const double width = small.largest + (2 * 1.5 * play + 1.3) * side;
    const double covered = 2 * pi * large.radii * width / room;
    const double crossings = 2 / (pi * density * side);
    const double of_small = (small.radii + small.count * mean) * (asked + covered) +
                            small.count * crossings * (asked / 3 + covered);
    if (big == 0) return of_small;
    const double cell = visiting / (side * side);
    const double laid = 1 / (2 * density * play * side);
    const double others =
        std::min(large.count, 9 * large.count * std::pow(2 * large.largest + side, 2) / area);
    const double of_rings = 2 * pi * width *
                            ((large.squares + large.radii * (mean + laid)) * (density + cell) +
                             large.radii * laid * laying / (side * side));
    return of_small + of_rings + (large.radii + large.count * (mean + laid)) * others;
}

}  // namespace

double largest_ordinary(const World& world, std::span<const std::uint32_t> members, const Box& box,
                        double slack)
{
    if (box.count <= few_bodies) return box.largest;
    const double area = box.extent[0] * box.extent[1];
    if (2 * box.largest * slack <= side_of(area, box.count, 0, slack)) return box.largest;
    SizeClasses classes;
    for (const std::uint32_t i : members) {
        const double r = world.bodies[i].radius;
        const double halves = r > 0 ? 2 * std::log2(box.largest / r) : never;
        const double last = static_cast<double>(classes.size() - 1);
        SizeClass& of = classes[static_cast<std::size_t>(std::min(halves, last))];
        of.count += 1;
        of.radii += r;
        of.squares += r * r;
        of.largest = std::max(of.largest, r);
    }
    // The sums are rounded and the model is rough: a small gain does not justify a second grid.
    double least = 0.8 * work(classes, 0, box, slack);
    double ordinary = box.largest;
    for (std::size_t k = 1; k < classes.size(); ++k) {
        if (classes[k].count == 0) continue;
        const double cost = work(classes, k, box, slack);
        if (cost >= least) continue;
        least = cost;
        ordinary = classes[k].largest;
    }
    return ordinary;
}

void Grid::size(World& world, std::span<const std::uint32_t> members, bool steps)
{
    const Box box = box_of(world, members);
    // Steps are tested only now and then, and may lie a tenth outside their cell.
    const double slack = steps ? 1.3 : 1.0001;
    const double wanted = world.tuning.big_above;
    const double ordinary =
        std::isnan(wanted) ? largest_ordinary(world, members, box, slack) : wanted;
    Box small{.extent = box.extent};
    double taken = 0;
    for (const std::uint32_t i : members) {
        Body& body = world.bodies[i];
        body.big = body.radius > ordinary;
        if (body.big) {
            taken += 3.141592653589793 * body.radius * body.radius;
        } else {
            small.largest = std::max(small.largest, body.radius);
            small.count += 1;
        }
    }
    const double area = box.extent[0] * box.extent[1];
    const double room = std::max(area - taken, 0.1 * area);
    double side = side_of(room, std::max(small.count, 1.0), small.largest, slack);
    if (!(side > 0)) side = std::max({box.extent[0], box.extent[1], 1.0});
    const bool some_big = small.count < box.count;
    const bool few = world.fixed_count - world.wall_count <= few_faces;
    if (box.count <= few_bodies && few && !some_big) side = boundless;
    cells_.size(side, 4, 4);
    rings_.size(cells_, small.largest, play * side, steps ? 0.1 * side : 0);
    const std::uint32_t least = some_big ? power_above(rings_.across(cells_, box.largest)) : 4;
    cells_.size(side, std::max(buckets(box.extent[0] / side, box.count), least),
                std::max(buckets(box.extent[1] / side, box.count), least));
    const double reach = 1.001 * small.largest + 0.15 * side;
    place_faces(world, reach, cells_);
    find_cells_away(world, reach);
    if (some_big) size_big(world, members, box);
}

void Grid::find_cells_away(const World& world, double reach)
{
    constexpr std::int64_t far = std::int64_t{1} << 52;  // cells beyond count as near a wall
    away_ = {{-far, -far}, {far, far}};
    for (std::uint32_t f = 0; f < world.wall_count; ++f) {
        const Face& wall = world.faces[f];
        const std::size_t along = wall.normal[0] != 0 ? 0 : 1;
        const bool slanted = wall.normal[1 - along] != 0;
        const bool from_below = wall.normal[along] > 0;
        const double edge = (wall.at[along] + (from_below ? reach : -reach)) / cells_.side();
        if (slanted || !(std::fabs(edge) < static_cast<double>(far))) {
            away_ = {{0, 0}, {-1, -1}};
            return;
        }
        std::int64_t& low = along == 0 ? away_.low.x : away_.low.y;
        std::int64_t& high = along == 0 ? away_.high.x : away_.high.y;
        if (from_below) {
            low = std::max(low, static_cast<std::int64_t>(std::ceil(edge)));
        } else {
            high = std::min(high, static_cast<std::int64_t>(std::floor(edge)) - 1);
        }
    }
}

/// Sizes the second grid: a body may lie farther from its cell by the play of its ring.
void Grid::size_big(const World& world, std::span<const std::uint32_t> members, const Box& box)
{
    ring_of_.assign(world.bodies.size(), none);
    double count = 0;
    for (const std::uint32_t i : members) {
        if (!world.bodies[i].big) continue;
        ring_of_[i] = rings_.add(world.bodies[i].radius);
        count += 1;
    }
    const bool few = world.fixed_count - world.wall_count <= few_faces;
    const double reach = 1.001 * box.largest + 0.5 * cells_.side();
    double side = std::max(2 * reach, 0.65 * std::sqrt(box.extent[0] * box.extent[1] / count));
    if (count <= few_bodies && few) side = boundless;
    big_cells_.size(side, buckets(box.extent[0] / side, count),
                    buckets(box.extent[1] / side, count));
    place_faces(world, reach, big_cells_);
}

Cells::Cell Grid::insert(std::vector<Body>& bodies, std::uint32_t i, const Vector2& p)
{
    Cells& own = bodies[i].big ? big_cells_ : cells_;
    const Cells::Cell cell = own.cell_of(p);
    own.insert(bodies, i, cell);
    if (bodies[i].big) rings_.lay(cells_, ring_of_[i], i, p);
    return cell;
}

void Grid::move(std::vector<Body>& bodies, std::uint32_t i, Cells::Cell& cell, const Vector2& p)
{
    if (bodies[i].big) {
        if (!rings_.holds(ring_of_[i], p)) lay_again(bodies, i, cell, p);
        return;
    }
    const auto there = cells_.cell_of(p);
    if (there == cell) return;
    cells_.remove(bodies, i);
    cell = there;
    cells_.insert(bodies, i, cell);
}

void Grid::lay_again(std::vector<Body>& bodies, std::uint32_t i, Cells::Cell& cell,
                     const Vector2& p)
{
    rings_.lift(cells_, ring_of_[i], i);
    big_cells_.remove(bodies, i);
    cell = insert(bodies, i, p);
}

}  // namespace ricochet::detail
