#include "scene/grid.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>

namespace ricochet::detail {

namespace {

constexpr double boundless = 0x1p200;

/// Bodies whose density around them is measured. The box is even enough if a square that would hold
/// `in_a_square` others at its density holds between half and twice as many; by chance fewer bodies
/// than these differ by more.
constexpr double most_uncounted = 64;
constexpr double in_a_square = 6;

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

[[nodiscard]] std::uint32_t power_above(double count)
{
    return std::bit_ceil(static_cast<std::uint32_t>(std::ceil(count)));
}

/// Numbers of buckets along x and y: one for each cell of the box, but no more than there would be
/// for bodies that are evenly spread.
std::array<std::uint32_t, 2> buckets(const Vector2& extent, double side, double count,
                                     std::uint32_t least)
{
    std::array<std::uint32_t, 2> number{};
    for (std::size_t c = 0; c < 2; ++c) {
        const double cells = std::clamp(extent[c] / side, 4.0, 0x1p24);
        number[c] = std::max(std::bit_ceil(static_cast<std::uint32_t>(cells)), least);
    }
    const double most = 16 * count + 64;
    for (;;) {
        auto& longer = number[number[0] < number[1] ? 1 : 0];
        const double all = static_cast<double>(number[0]) * static_cast<double>(number[1]);
        if (all <= most || longer <= std::max(least, 4U)) return number;
        longer /= 2;
    }
}

/// The mean number of other bodies in the square of a body, in a lattice of squares with this side.
double mean_others(std::span<const Vector2> places, double side, std::vector<std::uint32_t>& counts)
{
    const auto bits = static_cast<unsigned>(std::bit_width(8 * places.size()));
    counts.assign(std::size_t{1} << bits, 0);
    const auto square_of = [&](const Vector2& p) {
        const auto number = [&](std::size_t c) {
            const double squares = std::floor((p[c] - places[0][c]) / side);
            return static_cast<std::uint64_t>(static_cast<std::int64_t>(squares));
        };
        const std::uint64_t x = number(0);
        const std::uint64_t y = number(1);
        const std::uint64_t mixed = (x * 0x9e3779b97f4a7c15U + y) * 0xbf58476d1ce4e5b9U;
        return static_cast<std::size_t>(mixed >> (64 - bits));
    };
    for (const Vector2& p : places) ++counts[square_of(p)];
    double sum = 0;
    for (const std::uint32_t count : counts) sum += static_cast<double>(count) * (count - 1.0);
    return sum / static_cast<double>(places.size());
}

/// [m^2] Area that the bodies would take if they were everywhere as dense as a body finds it around
/// itself: much less than that of their box where most of it is empty, and more where they are on a
/// line.
double area_by_density(std::span<const Vector2> places, double area)
{
    const auto count = static_cast<double>(places.size());
    std::vector<std::uint32_t> counts;
    double side = std::sqrt((in_a_square + 0.5) * area / count);
    const double least = 1e-12 * side;
    for (int round = 0; round < 40 && side > least; ++round) {
        const double others = mean_others(places, side, counts);
        const bool even = others >= in_a_square / 2 && others <= 2 * in_a_square;
        if (even && round == 0) return area;
        const bool found = others >= in_a_square / 1.5 && others <= 1.5 * in_a_square;
        if (found) return count * side * side / (others + 0.5);
        side *= std::sqrt((in_a_square + 0.5) / (others + 0.5));
    }
    return std::clamp(count * side * side / in_a_square, 1e-12 * area, area);
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
    const double area = box.area;
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

/// Bodies of ordinary size of which some are points.
struct Mixture {
    double discs = 0, points = 0;
    double radius = 0;  ///< [m] mean of the discs
};

/// [m] Side of cells where points, which are tested against discs alone, are among discs: the sum
/// of crossings and tests is least. Between the sides for all bodies and for the discs alone.
double side_of_mixture(double area, const Mixture& of, double from, double to)
{
    const double density = (of.discs + of.points) / area;
    const double of_discs = of.discs / area;
    const double wide = 1 / std::sqrt(area);
    // Impacts of discs and of points while all move by one metre; with walls, one in each width.
    const double struck = of.discs * (2 * of.radius * (density + of_discs) + wide);
    const double strike = of.points * (2 * of.radius * of_discs + wide);
    const auto cost = [&](double side) {
        const double crossings = 4 / (3.141592653589793 * side);
        const double ahead = 3 * side * side;
        return crossings * ((of.discs + of.points) * crossing_cost +
                            ahead * (of.discs * density + of.points * of_discs)) +
               3 * ahead * (struck * density + strike * of_discs);
    };
    double best = from;
    for (double side = from; side < to; side *= 1.25) {
        if (cost(side) < cost(best)) best = side;
    }
    return best;
}

}  // namespace

double largest_ordinary(const World& world, std::span<const std::uint32_t> members, const Box& box,
                        double slack)
{
    if (box.count <= static_cast<double>(few_bodies)) return box.largest;
    if (2 * box.largest * slack <= side_of(box.area, box.count, 0, slack)) return box.largest;
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

Box box_of(const World& world, std::span<const std::uint32_t> members,
           std::span<const Vector2> places)
{
    Vector2 low{never, never};
    Vector2 high{-never, -never};
    Box box{.count = static_cast<double>(members.size())};
    for (std::size_t k = 0; k < members.size(); ++k) {
        for (std::size_t c = 0; c < 2; ++c) {
            low[c] = std::min(low[c], places[k][c]);
            high[c] = std::max(high[c], places[k][c]);
        }
        box.largest = std::max(box.largest, world.bodies[members[k]].radius);
    }
    box.extent = high - low + Vector2{2 * box.largest, 2 * box.largest};
    const double area = box.extent[0] * box.extent[1];
    const bool counted = box.count >= most_uncounted && std::isfinite(area);
    box.area = counted ? area_by_density(places, area) : area;
    box.uneven = box.area != area;
    return box;
}

/// Sides of cells along one axis, and their number.
struct Repeat {
    double side = 0;
    std::uint32_t count = 0;
};

/// Cells that repeat with a period: a power of two of them, which buckets on a torus fold by
/// themselves, with sides near the wanted one, and at least `least`. Without a period, as given.
static Repeat repeat_of(double period, double side, double least, std::uint32_t count)
{
    if (!(period > 0)) return {side, count};
    std::uint32_t cells = fewest_periodic;
    const double smallest = std::max(least, 0.72 * side);
    while (cells < (1U << 20) && period / (2.0 * cells) >= smallest) cells *= 2;
    return {period / cells, cells};
}

void Grid::size(World& world, std::span<const std::uint32_t> members,
                std::span<const Vector2> places, bool steps)
{
    const Box box = box_of(world, members, places);
    // Steps are tested only now and then, and may lie a tenth outside their cell.
    const double slack = steps ? 1.3 : 1.0001;
    const double wanted = world.tuning.big_above;
    const double ordinary = world.periodic       ? never
                            : std::isnan(wanted) ? largest_ordinary(world, members, box, slack)
                                                 : wanted;
    Box small{.extent = box.extent};
    Mixture mixture;
    double taken = 0;
    for (const std::uint32_t i : members) {
        Body& body = world.bodies[i];
        body.big = body.radius > ordinary;
        if (body.big) {
            taken += 3.141592653589793 * body.radius * body.radius;
        } else {
            small.largest = std::max(small.largest, body.radius);
            small.count += 1;
            mixture.radius += body.radius;
            (body.radius > 0 ? mixture.discs : mixture.points) += 1;
        }
    }
    const double room = box.uneven ? box.area : std::max(box.area - taken, 0.1 * box.area);
    double side = side_of(room, std::max(small.count, 1.0), small.largest, slack);
    if (!(side > 0)) side = std::max({box.extent[0], box.extent[1], 1.0});
    if (mixture.points > 0 && mixture.discs > 0) {
        mixture.radius /= mixture.discs;
        side = side_of_mixture(room, mixture, side,
                               side_of(room, mixture.discs, small.largest, slack));
    }
    const bool some_big = small.count < box.count;
    if (box.count <= static_cast<double>(few_bodies) && !some_big) side = boundless;
    const double forced = world.tuning.cell_side;
    if (!std::isnan(forced)) side = std::max(2 * small.largest * slack, forced);
    const bool points = mixture.points > 0;
    cells_.size(side, 4, 4, points);
    rings_.size(cells_, small.largest, play * side, steps ? 0.1 * side : 0);
    const std::uint32_t least = some_big ? power_above(rings_.across(cells_, box.largest)) : 4;
    const auto [columns, rows] = buckets(box.extent, side, box.count, least);
    if (world.periodic) {
        const Repeat x = repeat_of(world.period[0], side, 2 * small.largest * slack, columns);
        const Repeat y = repeat_of(world.period[1], side, 2 * small.largest * slack, rows);
        cells_.size({x.side, y.side}, x.count, y.count, points);
    } else {
        cells_.size(side, columns, rows, points);
    }
    find_cells_away(world, 1.001 * small.largest + 0.15 * side);
    if (some_big) size_big(world, members, box);
}

void Grid::lay_terrain(const World& world, std::span<const std::uint32_t> members)
{
    double ordinary = 0;
    double big = 0;
    for (const std::uint32_t i : members) {
        const Body& body = world.bodies[i];
        double& largest = body.big ? big : ordinary;
        largest = std::max(largest, body.radius);
    }
    terrain_.lay(world, ordinary);
    terrain_of_big_ = {};
    if (big > 0) terrain_of_big_.lay(world, big);
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
        const double edge =
            (wall.at[along] + (from_below ? reach : -reach)) / cells_.sides()[along];
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
    const double reach = 1.001 * box.largest + 0.5 * cells_.side();
    double side = std::max(2 * reach, 0.65 * std::sqrt(box.area / count));
    if (count <= static_cast<double>(few_bodies)) side = boundless;
    const auto [columns, rows] = buckets(box.extent, side, count, 4);
    big_cells_.size(side, columns, rows, false);
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
