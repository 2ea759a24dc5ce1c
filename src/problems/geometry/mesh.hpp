// Closed surfaces made of triangles: reading, checking, making.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

namespace ricochet::geometry {

/// Vertices, and triples of them; faces and vertices are counted from 0.
struct Mesh {
    std::vector<Eigen::Vector3d> vertices;
    std::vector<std::array<std::uint32_t, 3>> faces;
};

/// Reads a mesh in the format OFF (it begins with that word) or Wavefront OBJ (lines `v` and
/// `f`; other lines are ignored). Faces of more than three vertices are cut into triangles
/// from their first vertex.
/// @throws std::invalid_argument naming the line that is not understood or the face whose vertex
/// does not exist.
[[nodiscard]] Mesh read_mesh(std::string_view text);

/// @throws std::invalid_argument if there is no face, or naming a face that has a vertex which does
/// not exist or is not finite, that has no area, or that has an edge which is not shared with
/// exactly one other face in the opposite direction.
void require_closed(const Mesh& mesh);

/// Winding number of the surface of a closed mesh around p, from the solid angles of its faces
/// (Van Oosterom and Strackee, IEEE Trans. Biomed. Eng. 30, 1983, eq. 8): 0 outside; 1 or -1
/// inside of a simple surface, by the way its faces run. Not defined on the surface.
[[nodiscard]] int winding_number(const Mesh& mesh, const Eigen::Vector3d& p);

/// A sphere around the origin whose radius depends on the direction: an icosahedron,
/// every face cut into four `refinements` times; 20 * 4^refinements faces.
[[nodiscard]] Mesh bumpy_sphere(int refinements,
                                const std::function<double(const Eigen::Vector3d&)>& radius);

}  // namespace ricochet::geometry
