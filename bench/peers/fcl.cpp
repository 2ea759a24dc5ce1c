#include "peers/fcl.hpp"

#include <fcl/config.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/narrowphase/distance.h>

#include <memory>
#include <vector>

namespace ricochet::bench {

namespace {

using Model = fcl::BVHModel<fcl::OBBRSSd>;

std::shared_ptr<Model> model_of(const geometry::Mesh& mesh)
{
    auto model = std::make_shared<Model>();
    std::vector<fcl::Vector3d> vertices(mesh.vertices.begin(), mesh.vertices.end());
    std::vector<fcl::Triangle> faces;
    for (const auto& f : mesh.faces) faces.emplace_back(f[0], f[1], f[2]);
    model->beginModel();
    model->addSubModel(vertices, faces);
    model->endModel();
    return model;
}

}  // namespace

struct FclMeshes::Models {
    std::shared_ptr<Model> still, moving;
};

FclMeshes::FclMeshes(const geometry::Mesh& still, const geometry::Mesh& moving)
    : models_(std::make_unique<Models>(Models{model_of(still), model_of(moving)}))
{
}

FclMeshes::~FclMeshes() = default;

double FclMeshes::distance(const geometry::Pose& pose) const
{
    fcl::Transform3d at = fcl::Transform3d::Identity();
    at.linear() = pose.rotation;
    at.translation() = pose.translation;
    fcl::DistanceRequestd request;
    request.enable_nearest_points = false;
    fcl::DistanceResultd result;
    return fcl::distance(models_->still.get(), fcl::Transform3d::Identity(), models_->moving.get(),
                         at, request, result);
}

std::string_view FclMeshes::version()
{
    return FCL_VERSION;
}

}  // namespace ricochet::bench
