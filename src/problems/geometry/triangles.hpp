// Triangles in space: the nearest one to a point, and the distance of two rigid meshes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "box_tree.hpp"
#include "mesh.hpp"

namespace ricochet::geometry {

using Triangle = std::array<Eigen::Vector3d, 3>;

struct NearestOnTriangle {
    std::uint32_t triangle = 0;
    double distance = 0;
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
};

/// The nearest points of two meshes, with their faces.
struct NearestFaces {
    std::uint32_t face = 0, other_face = 0;
    double distance = 0;  ///< 0 where they cross
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3d other_point = Eigen::Vector3d::Zero();
};

/// A rigid displacement.
struct Pose {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

/// A ball that covers a part of a mesh.
struct Ball {
    Eigen::Vector3d centre;
    double radius;
};

/// The triangles of a mesh. `nearest` searches trees, `nearest_brute` examines everything; both
/// return the same bits, of several at the same distance the first.
class Triangles {
public:
    /// @throws std::invalid_argument, as `require_closed`.
    explicit Triangles(const Mesh& mesh);

    [[nodiscard]] std::size_t size() const noexcept { return triangles_.size(); }
    [[nodiscard]] const Triangle& operator[](std::size_t i) const noexcept { return triangles_[i]; }
    [[nodiscard]] const Box<3>& bounds() const noexcept { return tree_.bounds(); }

    /// A point that is not a number is at distance NaN.
    [[nodiscard]] NearestOnTriangle nearest(const Eigen::Vector3d& p,
                                            std::uint32_t hint = 0) const noexcept;
    [[nodiscard]] NearestOnTriangle nearest_brute(const Eigen::Vector3d& p) const noexcept;

    /// The nearest faces of this mesh and of `body`, displaced by `pose`, nearer than
    /// 1e100; `hint` holds faces that may be near. A pose that is not a number gives NaN.
    [[nodiscard]] NearestFaces nearest(const Triangles& body, const Pose& pose,
                                       const NearestFaces& hint = {}) const noexcept;
    [[nodiscard]] NearestFaces nearest_brute(const Triangles& body,
                                             const Pose& pose) const noexcept;

    /// At most `most` balls that cover the surface.
    [[nodiscard]] std::vector<Ball> covering(std::size_t most) const;

private:
    class PairSearch;

    std::vector<Triangle> triangles_;
    std::vector<Ball> balls_;  ///< around each
    BoxTree<3> tree_;
};

/// The point of a triangle nearest to p (Ericson, Real-Time Collision Detection, 5.1.5).
[[nodiscard]] Eigen::Vector3d nearest_point(const Triangle& triangle,
                                            const Eigen::Vector3d& p) noexcept;

/// Nearest points of two triangles; where they cross, a common point at distance 0. The
/// faces in the answer are 0.
[[nodiscard]] NearestFaces nearest_points(const Triangle& a, const Triangle& b) noexcept;

}  // namespace ricochet::geometry
