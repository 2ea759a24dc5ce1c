// Squares of the plane, each with the faces of terrain that a body in it can touch.
//
// A square with many faces is divided in four when a body first enters it. The squares are
// therefore small where bodies fly near many faces, and large where there are none, whatever the
// sizes of the bodies and of the terrain are; the work of dividing follows the places where bodies
// go.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/vector2.hpp"

namespace ricochet::detail {

struct World;
struct Face;

class FaceTree {
public:
    /// Begins with one square around the terrain of a world that does not move, for bodies of at
    /// most this radius [m]. The world's faces must remain where they are.
    void lay(const World& world, double radius);

    [[nodiscard]] bool empty() const noexcept { return nodes_.empty(); }
    /// [m] Distance by which bodies that advance by steps may lie outside their square.
    [[nodiscard]] double outside() const noexcept { return 0.5 * margin_; }
    [[nodiscard]] std::size_t squares() const noexcept { return nodes_.size(); }

    /// Number of the square at p, which has few faces, or cannot be divided with profit.
    [[nodiscard]] std::uint32_t at(const Vector2& p);
    /// Number of the square that a body at p enters when it leaves another one along an axis.
    [[nodiscard]] std::uint32_t beyond(std::uint32_t square, Vector2 p, std::size_t axis,
                                       bool upwards);
    [[nodiscard]] const Square& square(std::uint32_t number) const noexcept
    {
        return nodes_[number].square;
    }
    /// Faces that a body in this square can touch, ascending, with some others.
    [[nodiscard]] const std::vector<std::uint32_t>& faces(std::uint32_t number) const noexcept
    {
        return nodes_[nodes_[number].source].faces;
    }
    /// Appends the faces that are no farther than this from p [m]. They do not depend on how the
    /// squares have been divided; one may be appended several times.
    void append_within(const Vector2& p, double distance, std::vector<std::uint32_t>& found) const;

private:
    struct Node {
        Square square;
        std::uint32_t first = ~0U;  ///< of its four parts, where it is divided
        bool filled = false;        ///< its list has been made
        bool whole = false;         ///< it is not divided any more
        std::uint8_t wasted = 0;    ///< divisions in a row that have hardly shortened the list
        std::uint32_t source = 0;   ///< square whose list it uses: its own, or a larger one's
        std::size_t count = 0;      ///< of faces in reach
        std::vector<std::uint32_t> faces{};
    };

    [[nodiscard]] const Face& face(std::uint32_t number) const;
    [[nodiscard]] bool reaches(std::uint32_t face, const Square& square) const;
    void bound(Square& around, double& largest, double& length) const;
    void divide(std::uint32_t number);
    bool fill(std::uint32_t number, std::uint32_t parent);
    void add(const Square& square, std::vector<std::uint32_t> faces);

    const World* world_ = nullptr;
    double margin_ = 0;     ///< [m]
    double reach_ = 0;      ///< [m] from a square to its faces
    std::size_t left_ = 0;  ///< entries in lists of faces that may still be added
    std::uint32_t root_ = 0;
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> list_;  ///< while it is made
};

}  // namespace ricochet::detail
