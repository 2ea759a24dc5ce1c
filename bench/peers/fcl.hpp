// Mesh against mesh by FCL, the Flexible Collision Library.
#pragma once

#include <memory>
#include <string_view>

#include "problems/geometry/mesh.hpp"
#include "problems/geometry/triangles.hpp"

namespace ricochet::bench {

/// Two meshes, the second of which moves.
class FclMeshes {
public:
    FclMeshes(const geometry::Mesh& still, const geometry::Mesh& moving);
    ~FclMeshes();
    FclMeshes(const FclMeshes&) = delete;
    FclMeshes& operator=(const FclMeshes&) = delete;

    /// Distance of their surfaces.
    [[nodiscard]] double distance(const geometry::Pose& pose) const;

    [[nodiscard]] static std::string_view version();

private:
    struct Models;
    std::unique_ptr<Models> models_;
};

}  // namespace ricochet::bench
