#include "scene/face_tree.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "scene/world.hpp"

namespace ricochet::detail {

namespace {

/// A square with more faces is divided: testing them all costs as much as several crossings.
constexpr std::size_t few_faces = 12;

/// A part with this fraction of the faces of the whole has gained little; after as many divisions
/// in a row none follows, as where many faces end at one point. At the scale of the radius a few in
/// a row gain little, before those that do.
constexpr double hardly_less = 0.8;
constexpr std::uint8_t most_wasted = 6;

/// Largest length of the lists of all squares together, as a multiple of that of all faces, and 16
/// MB more, as for two thousand places where a large disc touches thousands of faces.
constexpr std::size_t most_each = 32;
constexpr std::size_t most_besides = 1 << 22;

}  // namespace

const Face& FaceTree::face(std::uint32_t number) const
{
    return world_->faces[number];
}

/// The box around all faces, their largest coordinate and the median of their lengths [m].
void FaceTree::bound(Square& around, double& largest, double& length) const
{
    around = {{never, never}, {-never, -never}};
    std::vector<double> lengths;
    for (std::uint32_t f = world_->wall_count; f < world_->fixed_count; ++f) {
        const Square box = box_of(face(f));
        for (std::size_t c = 0; c < 2; ++c) {
            around.low[c] = std::min(around.low[c], box.low[c]);
            around.high[c] = std::max(around.high[c], box.high[c]);
            largest = std::max({largest, std::fabs(box.low[c]), std::fabs(box.high[c])});
        }
        if (face(f).kind != Face::Kind::vertex) lengths.push_back(face(f).length);
    }
    const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
    std::nth_element(lengths.begin(), middle, lengths.end());
    length = *middle;
}

void FaceTree::lay(const World& world, double radius)
{
    world_ = &world;
    nodes_.clear();
    root_ = 0;
    const std::size_t count = world.fixed_count - world.wall_count;
    if (count == 0) return;
    Square around;
    double largest = 0;
    double length = 0;
    bound(around, largest, length);
    // By rounding, bodies may be a little outside their square.
    margin_ = std::max(0.1 * length, 1e-9 * largest);
    reach_ = 1.001 * radius + margin_;
    left_ = most_each * count + most_besides;
    std::vector<std::uint32_t> all(count);
    for (std::size_t k = 0; k < count; ++k) {
        all[k] = world.wall_count + static_cast<std::uint32_t>(k);
    }
    const Vector2 extent = around.high - around.low;
    const double half = 0.5 * std::max(extent[0], extent[1]) + reach_;
    const Vector2 middle = around.low + 0.5 * extent;
    const Vector2 low = middle - Vector2{half, half};
    const Vector2 high = middle + Vector2{half, half};
    const bool bounded = std::isfinite(half) && low[0] < high[0] && low[1] < high[1];
    if (count <= few_faces || !bounded) {
        add({{-never, -never}, {never, never}}, std::move(all));
        nodes_[0].whole = true;
        return;
    }
    add({{-never, -never}, {low[0], never}}, {});
    add({{high[0], -never}, {never, never}}, {});
    add({{low[0], -never}, {high[0], low[1]}}, {});
    add({{low[0], high[1]}, {high[0], never}}, {});
    root_ = 4;
    add({low, high}, std::move(all));
}

/// Adds a square with a list of its own.
void FaceTree::add(const Square& square, std::vector<std::uint32_t> faces)
{
    Node node{.square = square, .filled = true};
    node.source = static_cast<std::uint32_t>(nodes_.size());
    node.count = faces.size();
    node.faces = std::move(faces);
    nodes_.push_back(std::move(node));
}

/// Whether a body in this square can touch a face. Not certain where a number is not finite: then
/// it can.
bool FaceTree::reaches(std::uint32_t number, const Square& square) const
{
    const Square box = box_of(face(number));
    for (std::size_t c = 0; c < 2; ++c) {
        if (box.low[c] > square.high[c] + reach_ || box.high[c] < square.low[c] - reach_)
            return false;
    }
    const Vector2 extent = square.high - square.low;
    const Vector2 middle = square.low + 0.5 * extent;
    const double apart = norm(middle - nearest_on(face(number), middle));
    return !(apart > reach_ + 0.5001 * norm(extent));
}

/// Divides a square in four, whose lists are made when a body enters them.
void FaceTree::divide(std::uint32_t number)
{
    const Square all = nodes_[number].square;
    const Vector2 middle = all.low + 0.5 * (all.high - all.low);
    const bool resolved = all.low[0] < middle[0] && middle[0] < all.high[0] &&
                          all.low[1] < middle[1] && middle[1] < all.high[1];
    if (!resolved) {
        nodes_[number].whole = true;
        return;
    }
    nodes_[number].first = static_cast<std::uint32_t>(nodes_.size());
    for (std::size_t k = 0; k < 4; ++k) {
        Square part = all;
        for (std::size_t c = 0; c < 2; ++c) {
            ((k >> c & 1) != 0 ? part.low : part.high)[c] = middle[c];
        }
        nodes_.push_back({.square = part});
    }
}

/// Finds the faces of a part among those of the whole; false where there is no room for their list.
/// One that is hardly shorter is not kept.
bool FaceTree::fill(std::uint32_t number, std::uint32_t parent)
{
    Node& part = nodes_[number];
    const Node& whole = nodes_[parent];
    const std::vector<std::uint32_t>& all = faces(parent);
    list_.clear();
    for (const std::uint32_t f : all) {
        if (reaches(f, part.square)) list_.push_back(f);
    }
    part.count = list_.size();
    part.source = whole.source;
    if (part.count <= few_faces || 2 * part.count <= all.size()) {
        if (part.count > left_) return false;
        left_ -= part.count;
        part.faces.assign(list_.begin(), list_.end());
        part.source = number;
    }
    part.filled = true;
    const double side = part.square.high[0] - part.square.low[0];
    const bool little =
        static_cast<double>(part.count) > hardly_less * static_cast<double>(whole.count);
    part.wasted = little && side < 2 * reach_ ? whole.wasted + 1 : 0;
    // By less than the margin no list becomes shorter.
    part.whole = part.wasted >= most_wasted || side < margin_;
    return true;
}

std::uint32_t FaceTree::at(const Vector2& p)
{
    if (root_ == 0) return 0;
    const Square& all = nodes_[root_].square;
    if (p[0] < all.low[0]) return 0;
    if (p[0] >= all.high[0]) return 1;
    if (p[1] < all.low[1]) return 2;
    if (p[1] >= all.high[1]) return 3;
    std::uint32_t number = root_;
    for (;;) {
        const Node& node = nodes_[number];
        if (node.first == ~0U) {
            if (node.whole || node.count <= few_faces) return number;
            divide(number);
            continue;
        }
        const Vector2& middle = nodes_[node.first].square.high;
        const std::uint32_t part = node.first + static_cast<std::uint32_t>(p[0] >= middle[0]) +
                                   2 * static_cast<std::uint32_t>(p[1] >= middle[1]);
        if (!nodes_[part].filled && !fill(part, number)) return number;
        number = part;
    }
}

std::uint32_t FaceTree::beyond(std::uint32_t from, Vector2 p, std::size_t axis, bool upwards)
{
    const Square& square = nodes_[from].square;
    for (std::size_t c = 0; c < 2; ++c) {
        p[c] = std::clamp(p[c], square.low[c], std::nextafter(square.high[c], -never));
    }
    p[axis] = upwards ? square.high[axis] : std::nextafter(square.low[axis], -never);
    return at(p);
}

void FaceTree::append_within(const Vector2& p, double distance,
                             std::vector<std::uint32_t>& found) const
{
    if (nodes_.empty()) return;
    std::vector<std::uint32_t> open{root_};
    while (!open.empty()) {
        const Node& node = nodes_[open.back()];
        open.pop_back();
        bool apart = false;
        for (std::size_t c = 0; c < 2; ++c) {
            apart = apart || p[c] + distance < node.square.low[c] ||
                    p[c] - distance > node.square.high[c];
        }
        if (apart) continue;
        bool complete = node.first != ~0U;
        for (std::uint32_t k = 0; k < 4 && complete; ++k) complete = nodes_[node.first + k].filled;
        if (complete) {
            for (std::uint32_t k = 0; k < 4; ++k) open.push_back(node.first + k);
            continue;
        }
        for (const std::uint32_t f : nodes_[node.source].faces) {
            if (norm(p - nearest_on(face(f), p)) <= distance) found.push_back(f);
        }
    }
}

}  // namespace ricochet::detail
